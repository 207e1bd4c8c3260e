"""Configuration files of TI's mmWave SDK as radars, and the boards that their antennas are on."""

from __future__ import annotations

import argparse
import contextlib
import warnings
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtradar.cli.captures import _radar_and_layout
from rtradar.errors import InputError, ValidityWarning
from rtradar.exchange import Dca1000Layout
from rtradar.front_end import Chip
from rtradar.radar import Radar
from rtradar.radar.ti_cfg import read_ti_cfg
from rtradar.system.registries import BOARDS

PROFILE = """\
% Platform:xWR14xx
sensorStop
flushCfg
dfeDataOutputMode 1
channelCfg 15 7 0
adcCfg 2 1
adcbufCfg 0 1 0 1
profileCfg 0 77 7 7 57.14 0 0 70 1 240 4884 0 0 30
chirpCfg 0 0 0 0 0 0 0 1
chirpCfg 1 1 0 0 0 0 0 4
chirpCfg 2 2 0 0 0 0 0 2
frameCfg 0 2 16 0 33.333 1 0
guiMonitor 1 0 0 0 0 0   % what the demo sends
sensorStart
"""


def write(folder: Path, *changes: tuple[str, str]) -> Path:
    text = PROFILE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = folder / "people.cfg"
    file.write_text(text)
    return file


def test_a_profile_says_what_the_chip_does(tmp_path: Path) -> None:
    board = Radar.preset("iwr1443")
    radar = Radar.load(write(tmp_path))
    assert radar == Radar.from_ti_cfg(tmp_path / "people.cfg")
    assert radar.name == "iwr1443 people"
    assert radar.start_frequency_hz == 77e9
    assert radar.slope_hz_per_s == pytest.approx(70e12)
    assert radar.chirp_period_s == pytest.approx(64.14e-6)
    assert (radar.samples_per_chirp, radar.sample_rate_hz) == (240, 4.884e6)
    assert radar.adc_start_s == pytest.approx(7e-6)
    assert (radar.chirps_per_frame, radar.cycles_per_frame) == (48, 16)
    assert radar.frame_period_s == pytest.approx(33.333e-3)
    assert radar.tx_order == (0, 2, 1)
    assert radar.rx_positions_m == board.rx_positions_m
    assert radar.tx_positions_m == board.tx_positions_m
    assert radar.transmit_power_dbm == board.transmit_power_dbm


def test_radhar_is_that_profile_as_far_as_its_points_go(tmp_path: Path) -> None:
    profile, radar = Radar.load(write(tmp_path)), Radar.preset("radhar")
    assert radar.range_bin_m == pytest.approx(0.043577, abs=5e-7)
    assert radar.max_range_m == pytest.approx(126 * 0.043577, abs=1e-4)
    assert radar.velocity_bin_mps == pytest.approx(0.6147, abs=5e-5)
    assert radar.max_velocity_mps == pytest.approx(4.917, abs=5e-4)
    assert radar.cycles_per_frame == 16
    for limit in ("range_bin_m", "velocity_bin_mps", "max_velocity_mps"):
        assert getattr(radar, limit) == pytest.approx(getattr(profile, limit), rel=1e-6)


def test_what_is_off_is_left_out(tmp_path: Path) -> None:
    board = Radar.preset("iwr6843")
    file = write(
        tmp_path,
        ("% Platform:xWR14xx", "% Platform:xWR68xx"),
        ("channelCfg 15 7 0", "channelCfg 0xa 5 0"),
        ("profileCfg 0 77", "profileCfg 0 60"),
        ("0 0 70", "197379 0 70"),  # 3 dB less at each Tx
        ("chirpCfg 2 2 0 0 0 0 0 2\n", ""),
        ("frameCfg 0 2", "frameCfg 0 1"),
    )
    radar = Radar.from_ti_cfg(file)
    assert radar.rx_positions_m == (board.rx_positions_m[1], board.rx_positions_m[3])
    assert radar.tx_positions_m == (board.tx_positions_m[0], board.tx_positions_m[2])
    assert (radar.tx_order, radar.chirps_per_frame) == ((0, 1), 32)
    assert radar.transmit_power_dbm == board.transmit_power_dbm - 3
    assert read_ti_cfg(file).rx_mask == 10


def test_real_samples_are_half_as_many_complex_ones(tmp_path: Path) -> None:
    file = write(tmp_path, ("adcCfg 2 1", "adcCfg 2 0"))
    said = read_ti_cfg(file)
    assert said.real
    assert not said.q_first
    assert (said.radar.samples_per_chirp, said.radar.sample_rate_hz) == (120, 2.442e6)
    assert read_ti_cfg(write(tmp_path)).q_first


def test_the_file_of_an_awr2944_has_the_samples_before_the_period(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        ("xWR14xx", "xWR294x"),
        ("channelCfg 15 7 0", "channelCfg 15 15 0 0 0"),
        ("chirpCfg 2 2 0 0 0 0 0 2\n", "chirpCfg 2 2 0 0 0 0 0 8\nchirpCfg 3 3 0 0 0 0 0 2\n"),
        ("frameCfg 0 2 16 0 33.333 1 0", "frameCfg 0 3 16 0 240 33.333 1 0"),
    )
    radar = Radar.from_ti_cfg(file)
    assert radar.tx_order == (0, 2, 3, 1)
    assert radar.frame_period_s == pytest.approx(33.333e-3)


def test_a_frame_may_repeat_its_cycle(tmp_path: Path) -> None:
    lines = "chirpCfg 0 0 0 0 0 0 0 1\nchirpCfg 1 1 0 0 0 0 0 4\nchirpCfg 2 2 0 0 0 0 0 2\n"
    file = write(tmp_path, (lines, "chirpCfg 0 2 0 0 0 0 0 1\n"))
    radar = Radar.from_ti_cfg(file)
    assert (radar.n_tx, radar.cycles_per_frame) == (1, 48)


def test_the_board_is_named_or_follows_from_the_band(tmp_path: Path) -> None:
    file = write(tmp_path, ("% Platform:xWR14xx\n", ""))
    with pytest.warns(ValidityWarning, match="names no board: the antennas are those of iwr1843"):
        assert Radar.from_ti_cfg(file).name == "iwr1843 people"
    assert Radar.from_ti_cfg(file, board="awr2243").name == "awr2243 people"
    file.write_text(file.read_text().replace("Cfg 0 77", "Cfg 0 60"))
    with pytest.warns(ValidityWarning, match="iwr6843"):
        Radar.from_ti_cfg(file)


def test_lines_that_are_not_read_are_named_in_one_warning(tmp_path: Path) -> None:
    file = write(tmp_path, ("sensorStart\n", "trackingCfg 1 2\nfoo\nfoo 1\n"))
    with pytest.warns(ValidityWarning) as caught:
        Radar.from_ti_cfg(file)
    (warning,) = caught
    assert "not read: trackingCfg (line 14), foo (line 15)" in str(warning.message)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("frameCfg 0 2 16", "frameCfg 0 3 16", "line 12: no chirpCfg says what chirp 3 is"),
        ("frameCfg 0 2 16", "frameCfg 0 2 1.5", "line 12: the number of loops is 1.5"),
        ("frameCfg 0 2 16 0 33.333 1 0", "frameCfg 0 2 16", "line 12: frameCfg has 3 values"),
        ("33.333", "1", "frame_period_s = 0.001"),
        ("57.14", "soon", "line 8: profileCfg has 'soon', which is no number"),
        ("0 0 70", "0 0 -70", "line 8: the sweep must rise"),
        ("0 0 70", "0 4 70", "line 8: phases of the Tx"),
        ("0 0 70", "768 0 70", "line 8: the Tx have different powers"),
        ("240 4884", "600 4884", "do not fit into chirp_duration_s"),
        ("0 0 0 0 0 0 0 1", "0 0 0 0 0 0 0 5", "line 9: several Tx transmit in one chirp"),
        ("0 0 0 0 0 0 0 1", "0 0 0 0 0 2 0 1", "line 9: the chirp differs from its profile"),
        ("chirpCfg 1 1 0 0 0 0 0 4", "chirpCfg 1 1 0 0 0 0 0 1", "a Tx transmits twice"),
        ("chirpCfg 1 1 0", "chirpCfg 1 1 1", "line 12: its chirps must have one profileCfg"),
        ("channelCfg 15 7", "channelCfg 15 3", "line 10: Tx 3 transmits, but channelCfg"),
        ("channelCfg 15 7", "channelCfg 0 7", "line 5: the mask of Rx is 0"),
        ("adcCfg 2 1", "adcCfg 2 2", "line 6: the samples must be complex 1x (1) or real (0)"),
        ("dfeDataOutputMode 1", "dfeDataOutputMode 3", "line 4: dfeDataOutputMode must be 1"),
        ("sensorStart", "bpmCfg -1 1 0 2", "line 14: binary phase modulation"),
        ("sensorStart", "advFrameCfg 1 0 0 1 0", "line 14: frames of several kinds"),
        ("adcCfg 2 1\n", "", "has no adcCfg"),
        ("profileCfg 0 77", "profileCfg 0 60", "xWR14xx of 76 to 81 GHz, and starts at 60 GHz"),
        ("adcCfg 2 1", "adcCfg 99 1", "the bits of a sample is 99"),
        ("adcCfg 2 1", "adcCfg 1 1", "samples must have 16 bits"),
        ("adcbufCfg 0 1", "adcbufCfg 0 7", "Q first and the interleaving must be 0 or 1"),
        ("channelCfg 15 7", "channelCfg 15 6", "Tx 1 transmits, but channelCfg"),
        ("xWR14xx", "xWR12xx", "is for platform xWR12xx, whose antennas are not known"),
        ("xWR14xx", "xWR16xx", "Tx 3 is on, and board iwr1642 has 2"),
    ],
)
def test_what_is_not_simulated_is_refused_in_one_line(
    tmp_path: Path, old: str, new: str, says: str
) -> None:
    with pytest.raises(InputError) as caught:
        Radar.load(write(tmp_path, (old, new)))
    assert says in str(caught.value)
    assert "people.cfg'" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        Radar.load(tmp_path / "none.cfg")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_text_is_read_or_refused(tmp_path: Path, data: st.DataObject) -> None:
    lines = PROFILE.splitlines()
    words = st.sampled_from(PROFILE.split()) | st.text(max_size=6) | st.floats().map(str)
    for _ in range(data.draw(st.integers(1, 4))):
        k = data.draw(st.integers(0, len(lines) - 1))
        lines[k] = " ".join(data.draw(st.lists(words, max_size=15)))
    file = tmp_path / "any.cfg"
    file.write_text("\n".join(lines), encoding="utf-8", errors="replace")
    with warnings.catch_warnings(), contextlib.suppress(InputError):
        warnings.simplefilter("ignore")
        assert Radar.from_ti_cfg(file).n_tx >= 1


@pytest.mark.parametrize("name", BOARDS)
def test_a_board_has_all_that_is_asked_of_it(name: str) -> None:
    radar = Radar.preset(name)
    few = dict.fromkeys(("iwr1642", "awr1642"), (2, 4)) | {"iwrl6432": (2, 3)}
    many = {"awr2944": (4, 4), "awr2243-cascade": (12, 16)}
    assert (radar.n_tx, radar.n_rx) == (few | many).get(name, (3, 4))
    assert radar.transmit_power_dbm is not None
    assert radar.noise_figure_db is not None
    assert radar.tx_antenna is not None
    assert radar.rx_antenna == radar.tx_antenna
    # Each virtual element is somewhere else, and their centre is the radar's place. Of the cascade
    # some are twice, so that its chips can be aligned, and 86 lie side by side.
    half = 1.9518e-3 if name == "awr2243-cascade" else 1e-6  # of a wavelength at 76.8 GHz [m]
    places = np.unique(np.round((radar.virtual_m - radar.virtual_m[0]) / half), axis=0)
    if name == "awr2243-cascade":
        assert (len(places), (places[:, 2] == places[:, 2].min()).sum()) == (86 + 3 * 16, 86)
    else:
        assert len(places) == radar.n_channels
    np.testing.assert_allclose(radar.virtual_m.mean(axis=0), 0, atol=1e-5)


def test_rtradar_process_takes_the_order_of_words_from_the_profile(tmp_path: Path) -> None:
    file = write(tmp_path)
    options = argparse.Namespace(
        radar=str(file), samples=tmp_path / "adc.bin", lanes=None, real=False, q_first=False
    )
    options.rx_mask, options.format = None, None
    assert _radar_and_layout(options) == (
        Radar.load(file),
        Dca1000Layout(q_first=True, rx_mask=15),
    )
    options.lanes = 2  # what is asked for is not mixed with the profile
    assert _radar_and_layout(options)[1] == Dca1000Layout(lanes=2)
    options.lanes = None
    (tmp_path / "adc.json").write_text("{}")  # says the order of what rtradar wrote
    assert _radar_and_layout(options)[1] is None


# -- what other boards, languages and labs write ---------------------------------------------------

# Made here, line for line as TI's tools and labs write them.
VISUALIZER_16XX = """\
% Platform:xWR16xx
sensorStop
flushCfg
dfeDataOutputMode 1
channelCfg 15 3 0
adcCfg 2 1
adcbufCfg 0 1 0 1
profileCfg 0 77 39 7 57.14 0 0 70 1 256 5209 0 0 30
chirpCfg 0 0 0 0 0 0 0 1
chirpCfg 1 1 0 0 0 0 0 2
frameCfg 0 1 16 0 33.333 1 0
sensorStart
"""
LOW_POWER = """\
% Platform: xWRL6432
channelCfg 7 3 0
chirpComnCfg 15 5 0 128 1 34 3
chirpTimingCfg 6 26 1 47.95 60
frameCfg 2 0 600 64 200 0
antGeometryCfg 1 0 0 1 1 2 1 1 0 2 1 3 2.5 2.5
sensorStart 0 0 0 0
"""
FALL_BPM = """\
% Platform: xWR68xx
dfeDataOutputMode 1
channelCfg 15 7 0
adcCfg 2 1
adcbufCfg -1 0 1 1 1
profileCfg 0 60.75 30.00 1.00 10.00 0 0 200.0 1 96 10785.00 2 1 36
chirpCfg 0 0 0 0 0 0 0 5
chirpCfg 1 1 0 0 0 0 0 2
chirpCfg 2 2 0 0 0 0 0 5
frameCfg 0 2 48 0 90.00 1 0
bpmCfg -1 1 0 2
sensorStart
"""
DDM = """\
% Platform: xWR294x
dfeDataOutputMode 1
channelCfg 15 15 0 0 0
adcCfg 2 0
adcbufCfg -1 1 0 1 1
profileCfg 0 77 7 7 20.81 0 0 80 0 256 25000 0 0 164
chirpCfg 0 5 0 0 0 0 0 15
frameCfg 0 5 128 0 384 50 1 0
ddmPhaseShiftAntOrder 0 2 3 1
"""


def said(text: str, folder: Path) -> tuple[Radar, str]:
    (folder / "a.cfg").write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        radar = Radar.load(folder / "a.cfg")
    return radar, " ".join(str(one.message) for one in caught)


@pytest.mark.parametrize(
    ("text", "name", "bin_m", "most_m", "most_mps", "warned"),
    [
        # dR, Rmax and vmax by hand: c / 2B of the sampled sweep, samples times that, lambda / 4T.
        (VISUALIZER_16XX, "iwr1642 a", 0.0436, 11.15, 4.92, ""),
        (LOW_POWER, "iwrl6432 a", 0.163, 10.42, 2.06, "taken evenly"),
        (FALL_BPM, "iwr6843 a", 0.0842, 8.08, 10.1, "3 dB less signal"),
        (DDM, "awr2944 a", 0.183, 23.4, 5.72, ""),
    ],
)
def test_profiles_of_other_boards_and_languages(
    tmp_path: Path, text: str, name: str, bin_m: float, most_m: float, most_mps: float, warned: str
) -> None:
    radar, warning = said(text, tmp_path)
    assert radar.name == name
    assert radar.range_bin_m == pytest.approx(bin_m, rel=5e-3)
    assert radar.max_range_m == pytest.approx(most_m, rel=5e-3)
    assert radar.max_velocity_mps / radar.n_doppler_bands == pytest.approx(most_mps, rel=1e-2)
    assert warned in warning
    assert bool(warned) == bool(warning)


def test_bursts_of_a_low_power_chip(tmp_path: Path) -> None:
    radar, _ = said(LOW_POWER, tmp_path)
    assert (radar.n_tx, radar.n_rx, radar.cycles_per_frame) == (2, 3, 64)
    assert radar.frame_period_s == pytest.approx(0.2)
    # Rows and columns of the virtual antennas, 2.5 mm apart, the first row on top.
    virtual = (radar.tx[:, None] + radar.rx[None]).reshape(-1, 3)[:, 1:]
    steps = np.array([[1, 0], [0, 1], [1, 2], [1, 1], [0, 2], [1, 3]])
    expected = steps[:, ::-1] * [2.5e-3, -2.5e-3]
    np.testing.assert_allclose(virtual - virtual[0], expected - expected[0], atol=1e-12)
    both, _ = said(LOW_POWER.replace("128 1 34", "128 4 34"), tmp_path)
    assert both.multiplexing == "bpm"
    with pytest.raises(InputError, match="has no frameCfg"):
        said(LOW_POWER.replace("frameCfg", "% frameCfg"), tmp_path)
    with pytest.raises(InputError, match=r"line 5: .*the sweep must rise and the chirps fit"):
        said(LOW_POWER.replace("2 0 600", "2 0 60"), tmp_path)
    with pytest.raises(InputError, match="virtual antenna 6 is not where"):
        said(LOW_POWER.replace("1 3 2.5", "1 4 2.5"), tmp_path)
    with pytest.raises(InputError, match="has no antGeometryCfg"):
        said(LOW_POWER.replace("6432", "6844").replace("antGeometryCfg", "% ant"), tmp_path)


def test_signs_and_phases_tell_the_tx_apart(tmp_path: Path) -> None:
    shared = FALL_BPM.replace("frameCfg 0 2", "frameCfg 0 1").replace("-1 1 0 2", "-1 1 0 1")
    shared = shared.replace("channelCfg 15 7", "channelCfg 15 3")
    shared = shared.replace("0 0 0 0 0 5\n", "0 0 0 0 0 3\n").replace(
        "0 0 0 0 0 2\n", "0 0 0 0 0 3\n"
    )
    radar, warning = said(shared, tmp_path)
    assert (radar.multiplexing, radar.n_tx, warning) == ("bpm", 2, "")
    # Release 1 of the SDK names no subframe: on, and the two chirps.
    assert said(shared.replace("-1 1 0 1", "1 0 1"), tmp_path)[0] == radar
    for off in ("-1 0 0 0", "0 0 0"):
        with pytest.raises(InputError, match="neither bpmCfg nor ddmPhaseShiftAntOrder"):
            said(shared.replace("-1 1 0 1", off), tmp_path)
    with pytest.raises(InputError, match="two chirps of the frame, with the same two Tx"):
        said(FALL_BPM.replace("-1 1 0 2", "-1 1 0 1"), tmp_path)
    ddm, _ = said(DDM, tmp_path)
    board = Radar.preset("awr2944").tx_positions_m
    assert board is not None
    assert (ddm.multiplexing, ddm.n_doppler_bands, ddm.cycles_per_frame) == ("ddm", 6, 768)
    assert ddm.tx_positions_m == tuple(board[k] for k in (0, 2, 3, 1))


def test_the_board_is_that_of_the_virtual_antennas(tmp_path: Path) -> None:
    base = FALL_BPM.replace("% Platform: xWR68xx", "").replace("bpmCfg -1 1 0 2", "")
    base = base.replace("0 0 0 0 0 5\n", "0 0 0 0 0 1\n", 1).replace(
        "2 2 0 0 0 0 0 5", "2 2 0 0 0 0 0 4"
    )
    ods = "antGeometry0 0 0 -1 -1 -2 -2 -3 -3 -2 -2 -3 -3\n"
    ods += "antGeometry1 0 -1 -1 0 0 -1 -1 0 -2 -3 -3 -2\n"
    radar, warning = said(base + ods, tmp_path)
    assert (radar.name, warning) == ("iwr6843ods a", "")
    virtual = (radar.tx[:, None] + radar.rx[None]).reshape(-1, 3)[:, 1:] / 2.5e-3
    columns = -np.array([0, 0, -1, -1, -2, -2, -3, -3, -2, -2, -3, -3])
    rows = -np.array([0, -1, -1, 0, 0, -1, -1, 0, -2, -3, -3, -2])
    expected = np.stack([columns, rows], axis=1)
    np.testing.assert_allclose(virtual - virtual[0], expected, atol=1e-3)
    radar, warning = said(base, tmp_path)
    assert radar.name == "iwr6843 a"
    assert "names no board" in warning
    assert Radar.load(tmp_path / "a.cfg", board="iwr6843ods").name == "iwr6843ods a"


def test_what_a_file_asks_of_the_processing_is_named_with_what_does_it(tmp_path: Path) -> None:
    more = "clutterRemoval -1 1\ncfarCfg -1 0 2 8 4 3 0 15 1\nextendedMaxVelocity -1 0\n"
    _, warning = said(VISUALIZER_16XX + more, tmp_path)
    assert "clutterRemoval (line 13; --clutter-removal mean)" in warning
    assert "cfarCfg" not in warning
    assert "extendedMaxVelocity" not in warning
    assert said(VISUALIZER_16XX + "clutterRemoval -1 0\n", tmp_path)[1] == ""


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        # Of the xWR14xx: 512 steps are 6 dB.
        (
            "cfarCfg 0 2 8 4 3 0 768\npeakGrouping 1 0 1 1 125\n",
            {"cfar_axes": "range", "threshold_db": 9.03, "grouping": "doppler"},
        ),
        # Of the xWR16xx: 256 steps for each of 2 x 4 virtual antennas.
        (
            "cfarCfg -1 0 0 6 2 4 0 5120\ncfarCfg -1 1 1 4 1 2 0 2560\n"
            "peakGrouping -1 1 1 1 1 255\n",
            {
                "threshold_db": 15.05,
                "range_mode": "ca",
                "range_noise": 6,
                "range_guard": 2,
                "doppler_threshold_db": 7.53,
                "doppler_mode": "cago",
                "doppler_noise": 4,
                "doppler_guard": 1,
            },
        ),
        # Of SDK 3: decibels, and grouping by axis.
        (
            "cfarCfg -1 0 2 8 4 3 0 15 0\ncfarCfg -1 1 0 4 2 3 1 12 1\n",
            {"threshold_db": 15.0, "doppler_threshold_db": 12.0, "grouping": "doppler"},
        ),
        ("cfarCfg -1 0 2 8 4 3 0 15 0\n", {"cfar_axes": "range", "grouping": "doppler"}),
    ],
)
def test_how_the_chip_detects_is_read(lines: str, expected: dict[str, Any], tmp_path: Path) -> None:
    radar, warning = said(VISUALIZER_16XX + lines, tmp_path)
    assert radar.chip is not None
    for key, value in asdict(Chip(**expected)).items():
        wanted = value if isinstance(value, str) else pytest.approx(value, rel=1e-3)
        assert getattr(radar.chip, key) == wanted, key
    # Six cells on either side are divided by 16.
    assert ("the noise is the mean of its cells" in warning) == (" 6 2 4 " in lines)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("cfarCfg -1 2 2 8 4 3 0 15 1", "line 13: the direction of CFAR is 2"),
        ("cfarCfg -1 0 3 8 4 3 0 15 1", "line 13: the mode of CFAR is 3"),
        ("cfarCfg -1 0 2 8 4 3 0 0 1", "chip: threshold_db = 0.0; it must be above 0 dB"),
        ("cfarCfg -1 0 2", "cfarCfg has 3 values"),
    ],
)
def test_what_no_chip_does_is_refused(line: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=says):
        said(VISUALIZER_16XX + line + "\n", tmp_path)


def test_the_place_of_the_sensor_is_that_of_the_radar(tmp_path: Path) -> None:
    wall, _ = said(VISUALIZER_16XX + "sensorPosition 2 0 15\n", tmp_path)
    assert (wall.position_m, wall.pitch_deg) == ((-4.0, 1.0, 2.0), -15.0)
    ceiling, _ = said(VISUALIZER_16XX + "sensorPosition 2.9 0 90\n", tmp_path)
    assert (ceiling.position_m, ceiling.pitch_deg) == ((0.0, 0.0, 2.9), -90.0)
