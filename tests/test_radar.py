"""The radar against the paper's Tables 1 and 2, by the physics and as the paper has them; its schedule, array and files."""

from __future__ import annotations

import dataclasses
import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.radar import PRESETS, Radar

LOW, HIGH = Radar.preset("paper-12ghz"), Radar.preset("paper-77ghz")
ROUNDING = 1e-12
"""Relative: a handful of float64 operations."""


def approx(value: float, rel: float = ROUNDING) -> Any:
    return pytest.approx(value, rel=rel, abs=0)


# -- the paper's tables ----------------------------------------------------------------------------------------------


def test_table_1() -> None:
    assert (LOW.start_frequency_hz, LOW.bandwidth_hz, LOW.chirp_duration_s) == (12e9, 4e9, 62.5e-6)
    assert (LOW.samples_per_chirp, LOW.frame_duration_s, LOW.frame_hop_s) == (256, 0.1, 0.025)
    assert (LOW.tx_y, LOW.tx_z, LOW.rx_y, LOW.rx_z) == (6, 6, 8, 8)
    assert LOW.position_m == (-4.0, 1.0, 1.0)
    assert LOW.slope_hz_per_s == approx(6.4e13)
    assert LOW.sample_rate_hz == approx(4.096e6)
    assert LOW.start_wavelength_m == approx(0.025, rel=1e-3)  # the paper's c is 3e8, 0.7 per mille more


def test_the_77_ghz_preset_differs_in_frequency_and_chirp_only() -> None:
    assert dataclasses.replace(LOW, name="paper-77ghz", start_frequency_hz=77e9, chirp_duration_s=12.5e-6) == HIGH


@pytest.mark.parametrize(
    ("radar", "centre_hz", "cycle_s", "cycles", "velocity_mps", "bin_mps", "beam_deg", "angle_deg"),
    [
        # Figures by hand, with lambda = c / 14 GHz = 21.4137 mm and c / 79 GHz = 3.79484 mm.
        (LOW, 14e9, 0.75e-3, 133, 7.1379, 0.10734, 1.8130, 58.997),
        (HIGH, 79e9, 0.15e-3, 666, 6.3247, 0.018993, 2.0616, 77.080),
    ],
    ids=["12 GHz", "77 GHz"],
)
def test_table_2_by_the_physics(
    radar: Radar,
    centre_hz: float,
    cycle_s: float,
    cycles: int,
    velocity_mps: float,
    bin_mps: float,
    beam_deg: float,
    angle_deg: float,
) -> None:
    digits = 5e-5  # the last of the digits written above
    assert radar.centre_frequency_hz == centre_hz
    assert radar.wavelength_m == approx(SPEED_OF_LIGHT_MPS / centre_hz)
    assert radar.cycle_duration_s == approx(cycle_s)
    assert radar.cycles_per_frame == cycles
    assert radar.chirps_per_frame == 12 * cycles
    assert radar.max_velocity_mps == approx(velocity_mps, digits)
    assert radar.velocity_bin_mps == approx(bin_mps, digits)
    assert radar.angle_resolution_deg == approx(beam_deg, digits)
    assert radar.max_angle_deg == approx(angle_deg, digits)
    # Range knows the bandwidth only: 3.75 cm and 9.6 m.
    assert radar.range_bin_m == approx(0.037474, digits)
    assert radar.max_range_m == approx(9.5934, digits)


def test_table_2_as_the_paper_has_it() -> None:
    # The paper: c = 3e8, the start wavelength, and 0.1 s for the time of 133 cycles (its eqs 1 to 6).
    c, start_hz, chirp_s, frame_s, virtual = 3e8, 12e9, 62.5e-6, 0.1, 48
    wavelength = c / start_hz
    rounded = 2e-3  # the paper's two or three digits
    assert c * 4.096e6 / (2 * 6.4e13) == approx(9.6, rounded)
    assert wavelength / (4 * 12 * chirp_s) == approx(8.33, rounded)
    assert wavelength / (2 * frame_s) == approx(0.125, rounded)
    # 2 asin(1/48) is 2.387; the paper cuts off and writes 2.38.
    assert math.degrees(2 * math.asin(wavelength / (2 * virtual * (wavelength / 2)))) == approx(2.38, 5e-3)
    # Ours from theirs: the sweep centre instead of its start, and the whole cycles instead of 0.1 s.
    exact_c = SPEED_OF_LIGHT_MPS / c
    centre = exact_c * 12 / 14
    assert LOW.max_range_m == approx(exact_c * 9.6)
    assert LOW.range_bin_m == approx(exact_c * 0.0375)
    assert LOW.max_velocity_mps == approx(centre * wavelength / (4 * 12 * chirp_s))
    assert LOW.velocity_bin_mps == approx(centre * wavelength / (2 * frame_s) * frame_s / (133 * 12 * chirp_s))
    # The paper's +-90 deg needs half a wavelength between receivers; at the centre of the sweep it is 0.583.
    assert math.sin(math.radians(LOW.max_angle_deg)) == approx(12 / 14)


def test_angles_do_not_alias_where_the_spacing_is_half_a_wavelength_or_less() -> None:
    assert Radar(rx_spacing_wavelengths=0.25).max_angle_deg == 90.0


def test_a_single_channel_has_no_angle_resolution() -> None:
    assert Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=1).angle_resolution_deg == 180.0


# -- the array -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("radar", [LOW, HIGH], ids=["12 GHz", "77 GHz"])
def test_antenna_places(radar: Radar) -> None:
    wavelength = SPEED_OF_LIGHT_MPS / radar.start_frequency_hz
    expected_tx = [(0, (i - 2.5) * 4, 0) for i in range(6)] + [(0, 0, (i - 2.5) * 4) for i in range(6)]
    expected_rx = [(0, (j - 3.5) / 2, 0) for j in range(8)] + [(0, 0, (j - 3.5) / 2) for j in range(8)]
    for places, expected in ((radar.tx, expected_tx), (radar.rx, expected_rx)):
        assert places.dtype == np.float64
        # Rounding where metres are added to millimetres.
        np.testing.assert_allclose(places, np.array([-4.0, 1.0, 1.0]) + wavelength * np.array(expected), rtol=0, atol=1e-14)


counts = st.integers(0, 7)


@given(tx_y=counts, tx_z=counts, rx_y=counts, rx_z=counts, tx_spacing=st.floats(0.1, 9), rx_spacing=st.floats(0.1, 9))
def test_lines_are_centred_even_and_rising(
    tx_y: int, tx_z: int, rx_y: int, rx_z: int, tx_spacing: float, rx_spacing: float
) -> None:
    assume(tx_y + tx_z > 0)
    assume(rx_y + rx_z > 0)
    radar = Radar(
        tx_y=tx_y,
        tx_z=tx_z,
        rx_y=rx_y,
        rx_z=rx_z,
        tx_spacing_wavelengths=tx_spacing,
        rx_spacing_wavelengths=rx_spacing,
        channels="all",
        position_m=(0, 0, 0),
    )
    for places, along_y, spacing in ((radar.tx, tx_y, tx_spacing), (radar.rx, rx_y, rx_spacing)):
        for line, axis in ((places[:along_y], 1), (places[along_y:], 2)):
            assert not np.delete(line, axis, axis=1).any()
            np.testing.assert_allclose(np.diff(line[:, axis]), spacing * radar.start_wavelength_m, rtol=1e-9)
            if len(line):
                assert abs(line[:, axis].sum()) < 1e-12  # rounding: symmetric pairs cancel
    assert len(radar.tx) == radar.n_tx
    assert len(radar.rx) == radar.n_rx


def test_virtual_line_is_filled_without_gap_or_overlap() -> None:
    sums = np.add.outer(LOW.tx[:6, 1], LOW.rx[:8, 1]).ravel()
    np.testing.assert_allclose(np.diff(sums), LOW.start_wavelength_m / 2, rtol=1e-9)


def test_pairs_keep_the_line_of_the_transmitter() -> None:
    assert (LOW.n_tx, LOW.n_rx, LOW.n_channels) == (12, 8, 96)
    assert LOW.rx_of_tx.shape == (12, 8)
    for tx in range(12):
        assert LOW.rx_of_tx[tx].tolist() == list(range(8) if tx < 6 else range(8, 16))


def test_all_keeps_every_receiver() -> None:
    radar = dataclasses.replace(LOW, channels="all")
    assert (radar.n_tx, radar.n_rx, radar.n_channels) == (12, 16, 192)
    assert radar.rx_of_tx.tolist() == [list(range(16))] * 12


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ({"tx_y": 2, "tx_z": 0, "rx_y": 3, "rx_z": 0}, [[0, 1, 2]] * 2),
        ({"tx_y": 0, "tx_z": 2, "rx_y": 4, "rx_z": 3}, [[4, 5, 6]] * 2),
        ({"tx_y": 1, "tx_z": 1, "rx_y": 2, "rx_z": 2}, [[0, 1], [2, 3]]),
    ],
)
def test_pairs_of_other_arrays(lines: dict[str, int], expected: list[list[int]]) -> None:
    radar = Radar(**lines)
    assert radar.rx_of_tx.tolist() == expected
    assert radar.n_rx == len(expected[0])


# -- the schedule ----------------------------------------------------------------------------------------------------


def test_chirp_times_are_centres() -> None:
    np.testing.assert_allclose(LOW.chirp_times(3), [31.25e-6, 93.75e-6, 156.25e-6], rtol=ROUNDING)
    np.testing.assert_array_equal(LOW.chirp_times(2, first=1000), LOW.chirp_times(1002)[1000:])
    assert LOW.chirp_times(0).shape == (0,)


def test_transmitters_take_turns() -> None:
    assert LOW.tx_of_chirp(np.arange(26)).tolist() == [*range(12), *range(12), 0, 1]
    assert LOW.tx_of_chirp(np.array([48_000_000_007])).tolist() == [7]


@pytest.mark.parametrize(
    ("radar", "chirps", "cycles_per_hop", "last_start"),
    [
        # 3 s. 12 GHz: 4000 cycles of 0.75 ms, 133 a window, so the last may start at 3867; 116 x 33.33 = 3866.7 does.
        # 77 GHz: 20 000 cycles of 0.15 ms, 666 a window: 19 334; 116 x 166.67 = 19 333.3 does.
        (LOW, 48_000, Fraction(100, 3), 3867),
        (HIGH, 240_000, Fraction(500, 3), 19_333),
    ],
    ids=["12 GHz", "77 GHz"],
)
def test_windows_of_three_seconds(radar: Radar, chirps: int, cycles_per_hop: Fraction, last_start: int) -> None:
    starts = radar.window_starts(chirps)
    assert len(starts) == 117
    assert starts[-1] == last_start
    assert starts.tolist() == [round(k * cycles_per_hop) for k in range(117)]  # thirds: never half-way between cycles
    # Every start is within half a cycle of k x 25 ms, and the time of a window is its middle.
    error = starts * radar.cycle_duration_s - np.arange(117) * 0.025
    assert np.abs(error).max() < radar.cycle_duration_s / 2
    middle = starts * radar.cycle_duration_s + radar.chirps_per_frame * radar.chirp_duration_s / 2
    np.testing.assert_allclose(radar.window_times(starts), middle, rtol=ROUNDING)


def test_windows_at_the_end_of_a_capture() -> None:
    one = 133 * 12
    assert LOW.window_starts(0).tolist() == []
    assert LOW.window_starts(one - 1).tolist() == []
    assert LOW.window_starts(one).tolist() == [0]
    # The next starts at cycle 33, whole cycles only.
    assert LOW.window_starts(one + 33 * 12 - 1).tolist() == [0]
    assert LOW.window_starts(one + 33 * 12).tolist() == [0, 33]


@given(
    hop_eighths=st.integers(1, 400),
    frame_cycles=st.integers(1, 40),
    n_tx=st.integers(1, 5),
    chirps=st.integers(0, 2000),
)
def test_windows_by_brute_force(hop_eighths: int, frame_cycles: int, n_tx: int, chirps: int) -> None:
    # Binary fractions, so nothing is rounded: cycles of n_tx / 1024 s, hops of eighths of a cycle.
    chirp = 2.0**-10
    radar = Radar(
        chirp_duration_s=chirp,
        frame_duration_s=frame_cycles * n_tx * chirp,
        frame_hop_s=hop_eighths / 8 * n_tx * chirp,
        tx_y=n_tx,
        tx_z=0,
    )
    assert radar.cycles_per_frame == frame_cycles
    last = chirps // n_tx - frame_cycles
    hop = Fraction(hop_eighths, 8)
    nearest = {round(k * hop) for k in range(int((last + 1) / hop) + 2)} if last >= 0 else set()
    assert radar.window_starts(chirps).tolist() == sorted(start for start in nearest if start <= last)


@given(n=st.integers(1, 700))
def test_velocity_axis(n: int) -> None:
    velocity = LOW.velocity_mps(n)
    assert velocity[n // 2] == 0
    np.testing.assert_allclose(np.diff(velocity), 2 * LOW.max_velocity_mps / n, rtol=1e-9)
    assert np.abs(velocity).max() <= LOW.max_velocity_mps * (1 + ROUNDING)


def test_axes_have_the_bins() -> None:
    np.testing.assert_allclose(np.diff(LOW.velocity_mps(133)), LOW.velocity_bin_mps, rtol=1e-9)
    np.testing.assert_allclose(LOW.range_m, np.arange(256) * LOW.max_range_m / 256, rtol=ROUNDING)


def test_a_frame_of_exactly_whole_cycles_keeps_the_last_one() -> None:
    # 0.3 / 0.1 is 2.999... in float64.
    assert Radar(tx_y=1, tx_z=0, chirp_duration_s=0.1, frame_duration_s=0.3).cycles_per_frame == 3


# -- files and bad values --------------------------------------------------------------------------------------------


def refusal(call: Any, *args: Any, **values: Any) -> str:
    """What an `InputError` says, which is one line."""
    with pytest.raises(InputError) as caught:
        call(*args, **values)
    message = str(caught.value)
    assert message
    assert "\n" not in message
    return message


def write(folder: Path, text: str | bytes) -> Path:
    file = folder / "mine.toml"
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return file


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_by_its_name(name: str) -> None:
    assert Radar.load(name) == Radar.preset(name)
    assert Radar.load(name).name == name


def test_a_file_that_names_every_field(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        """
        name = "mine"
        start_frequency_hz = 60e9
        bandwidth_hz = 2_000_000_000   # a whole number does as well
        chirp_duration_s = 25e-6
        samples_per_chirp = 128
        frame_duration_s = 0.05
        frame_hop_s = 0.01
        tx_y = 2
        tx_z = 1
        rx_y = 4
        rx_z = 3
        tx_spacing_wavelengths = 2
        rx_spacing_wavelengths = 0.6
        position_m = [-3, 0.5, 1.2]
        channels = "all"
        polarization = "h"
        """,
    )
    expected = Radar(
        name="mine",
        start_frequency_hz=60e9,
        bandwidth_hz=2e9,
        chirp_duration_s=25e-6,
        samples_per_chirp=128,
        frame_duration_s=0.05,
        frame_hop_s=0.01,
        tx_y=2,
        tx_z=1,
        rx_y=4,
        rx_z=3,
        tx_spacing_wavelengths=2.0,
        rx_spacing_wavelengths=0.6,
        position_m=(-3.0, 0.5, 1.2),
        channels="all",
        polarization="h",
    )
    assert Radar.load(file) == expected
    assert Radar.load(str(file)) == expected


def test_an_empty_file_is_the_default_by_the_name_of_the_file(tmp_path: Path) -> None:
    assert Radar.load(write(tmp_path, "")) == Radar(name="mine")


@pytest.mark.parametrize("call", [Radar.preset, Radar.load])
def test_unknown_preset(call: Any) -> None:
    message = refusal(call, "paper-24ghz")
    assert "'paper-24ghz' is unknown" in message
    for name in PRESETS:
        assert name in message


def test_missing_file(tmp_path: Path) -> None:
    message = refusal(Radar.load, tmp_path / "none.toml")
    assert "none.toml" in message
    assert "No such file" in message


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    (tmp_path / "folder.toml").mkdir()
    assert "folder.toml" in refusal(Radar.load, tmp_path / "folder.toml")


@pytest.mark.parametrize("text", ["name = ", "tx_y = 6\ntx_y = 7", "\0", b"\xff\xfe", b'name = "\xe9"', "[radar", "12"])
def test_not_toml(tmp_path: Path, text: str | bytes) -> None:
    assert "mine.toml' is not TOML: " in refusal(Radar.load, write(tmp_path, text))


@pytest.mark.parametrize(
    ("text", "key"), [("chirp_time_s = 1", "chirp_time_s"), ("[radar]\ntx_y = 1", "radar"), ("n_tx = 3", "n_tx")]
)
def test_unknown_key(tmp_path: Path, text: str, key: str) -> None:
    message = refusal(Radar.load, write(tmp_path, text))
    assert f"unknown key '{key}'" in message
    assert "chirp_duration_s" in message  # what is allowed


POSITIVE = (
    "start_frequency_hz",
    "bandwidth_hz",
    "chirp_duration_s",
    "frame_duration_s",
    "frame_hop_s",
    "tx_spacing_wavelengths",
    "rx_spacing_wavelengths",
)
WHOLE = ("samples_per_chirp", "tx_y", "tx_z", "rx_y", "rx_z")


@pytest.mark.parametrize("field", POSITIVE)
@pytest.mark.parametrize(
    "value", ["-4e9", "-1", "0", "0.0", "nan", "inf", "-inf", '"4e9"', "true", "[4e9]", "{hz = 4e9}", "1979-05-27"]
)
def test_a_quantity_is_a_positive_finite_number(tmp_path: Path, field: str, value: str) -> None:
    message = refusal(Radar.load, write(tmp_path, f"{field} = {value}"))
    assert "mine.toml" in message
    assert f"{field} = " in message
    assert "positive, finite number" in message


@pytest.mark.parametrize("field", WHOLE)
@pytest.mark.parametrize("value", ["-1", "2.0", "nan", '"8"', "false", "[8]"])
def test_a_count_is_a_whole_number(tmp_path: Path, field: str, value: str) -> None:
    message = refusal(Radar.load, write(tmp_path, f"{field} = {value}"))
    assert f"{field} = " in message
    assert "whole number" in message


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"tx_y": 10**400}, "tx_y = a number of more than 20 digits"),
        ({"bandwidth_hz": 10**400}, "bandwidth_hz = a number of more than 20 digits"),
        ({"samples_per_chirp": 10**15}, "samples_per_chirp = 1000000000000000"),
        ({"bandwidth_hz": 1e300}, "bandwidth_hz = 1e+300"),
        ({"chirp_duration_s": 1e-300}, "chirp_duration_s = 1e-300"),
        ({"name": 5}, "name = 5"),
        ({"name": "two\nlines"}, "one line of text"),
        ({"position_m": "123"}, "three finite numbers"),
        ({"position_m": ["1", "2", "3"]}, "three finite numbers"),
        ({"position_m": [True, 0, 0]}, "three finite numbers"),
        ({"position_m": [10**400, 0, 0]}, "three finite numbers"),
        ({"channels": "x" * 1000}, "..."),
        ({"frame_duration_s": 1e9}, "more than 2.1e+09"),
        ({"chirp_duration_s": 1e-14}, "shorten the frame"),
        # Every Tx with every Rx: 137 GB, were they written down before the frame is looked at.
        (dict.fromkeys(("tx_y", "tx_z", "rx_y", "rx_z"), 65536) | {"channels": "all"}, "holds no whole TDM cycle"),
    ],
)
def test_values_far_outside_are_refused_in_one_short_line(values: dict[str, Any], says: str) -> None:
    message = refusal(Radar, **values)
    assert says in message
    assert len(message) < 300


def test_numpy_scalars_do_as_well() -> None:
    radar = Radar(bandwidth_hz=np.float32(2e9), tx_y=np.int64(3), position_m=np.array([-4, 1, 1]))  # type: ignore[arg-type]
    assert (type(radar.bandwidth_hz), type(radar.tx_y)) == (float, int)
    assert radar.position_m == (-4.0, 1.0, 1.0)
    assert all(type(value) is float for value in radar.position_m)
    fdm = Radar(multiplexing="fdm", carrier_step_hz=np.float32(5e6))  # type: ignore[arg-type]
    ddm = Radar(multiplexing="ddm", channels="all", doppler_bands=np.int64(16))  # type: ignore[arg-type]
    assert (type(fdm.carrier_step_hz), type(ddm.doppler_bands)) == (float, int)


def test_a_hop_far_below_a_cycle_takes_every_cycle() -> None:
    radar = Radar(tx_y=1, tx_z=0, frame_hop_s=1e-14, frame_duration_s=0.001)
    assert radar.window_starts(20).tolist() == list(range(20 - radar.cycles_per_frame + 1))


def test_a_chirp_has_a_sample() -> None:
    assert "samples_per_chirp = 0; it must be a whole number from 1 to 65536" in refusal(Radar, samples_per_chirp=0)


@pytest.mark.parametrize(
    "value", ["[1, 2]", "[1, 2, 3, 4]", "[]", "5", "true", '"here"', "[1, 2, nan]", "[1, inf, 3]", '[1, 2, "x"]', "[[1, 2, 3]]"]
)
def test_a_place_is_three_finite_numbers(tmp_path: Path, value: str) -> None:
    message = refusal(Radar.load, write(tmp_path, f"position_m = {value}"))
    assert "position_m = " in message
    assert "three finite numbers" in message


@pytest.mark.parametrize(("field", "allowed"), [("channels", "pairs, all"), ("polarization", "v, h")])
@pytest.mark.parametrize("value", ['"x"', '"V"', '""', "1", "true", '["v"]'])
def test_a_choice_is_one_of_those_named(tmp_path: Path, field: str, allowed: str, value: str) -> None:
    message = refusal(Radar.load, write(tmp_path, f"{field} = {value}"))
    assert f"{field} = " in message
    assert f"allowed: {allowed}" in message


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ({"tx_y": 0, "tx_z": 0}, "no Tx or no Rx"),
        ({"rx_y": 0, "rx_z": 0}, "no Tx or no Rx"),
        ({"rx_y": 8, "rx_z": 4}, "8 and 4"),
        ({"rx_y": 0, "rx_z": 4}, "channels = 'all'"),
        ({"tx_y": 1, "tx_z": 0, "rx_y": 0, "rx_z": 4}, "channels = 'all'"),
    ],
)
def test_an_array_without_channels(lines: dict[str, int], says: str) -> None:
    assert says in refusal(Radar, **lines)


def test_other_lines_of_receivers_do_with_all_channels() -> None:
    assert Radar(rx_y=8, rx_z=4, channels="all").n_channels == 12 * 12


def test_a_frame_holds_a_cycle() -> None:
    message = refusal(Radar, chirp_duration_s=0.01)
    assert "frame_duration_s = 0.1" in message
    assert "0.12 s" in message
    assert Radar(chirp_duration_s=0.1 / 12).cycles_per_frame == 1


@given(
    field=st.sampled_from(POSITIVE),
    value=st.one_of(st.floats(max_value=0), st.just(math.nan), st.just(math.inf), st.none(), st.text(max_size=5), st.booleans()),
)
def test_no_value_without_meaning_gets_through(field: str, value: object) -> None:
    assert f"{field} = {value!r}" in refusal(Radar, **{field: value})
