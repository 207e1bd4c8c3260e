"""Radars from files and by name; values without meaning are refused in one line."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rtradar.errors import InputError
from rtradar.radar import PRESETS, Radar


def refusal(call: Any, *args: Any, **values: Any) -> str:
    """Message of an `InputError`, which is one line."""
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
        ({"polarization": "V"}, "polarization = 'V'; allowed: v, h"),
        (
            {"samples_per_chirp": 0},
            "samples_per_chirp = 0; it must be a whole number from 1",
        ),
        ({"frame_hop_s": 0}, "frame_hop_s = 0; it must be a positive, finite number"),
        ({"tx_order": [0.5]}, "tx_order = [0.5]; it must be a list of whole numbers"),
        ({"tx_positions_m": [[0, 0, 101]]}, "places [x, y, z], within 100 m"),
        ({"rx_antenna": 3}, "rx_antenna = 3; it must be a table of the fields of Antenna"),
        ({"frame_duration_s": 1e9}, "more than 2.1e+09"),
        ({"chirp_duration_s": 1e-14}, "shorten the frame"),
        # Every Tx with every Rx: 137 GB, were they written down before the frame is looked at.
        (
            dict.fromkeys(("tx_y", "tx_z", "rx_y", "rx_z"), 65536) | {"channels": "all"},
            "holds no whole TDM cycle",
        ),
    ],
)
def test_values_far_outside_are_refused_in_one_short_line(
    values: dict[str, Any], says: str
) -> None:
    message = refusal(Radar, **values)
    assert says in message
    assert len(message) < 300


def test_numpy_scalars_do_as_well() -> None:
    lengths = {"bandwidth_hz": np.float32(2e9), "position_m": np.array([-4, 1, 1])}
    radar = Radar(tx_y=np.int64(3), **lengths)
    assert (type(radar.bandwidth_hz), type(radar.tx_y)) == (float, int)
    assert radar.position_m == (-4.0, 1.0, 1.0)
    assert all(type(value) is float for value in radar.position_m)
    fdm = Radar(multiplexing="fdm", carrier_step_hz=np.float32(5e6))
    ddm = Radar(multiplexing="ddm", channels="all", doppler_bands=np.int64(16))
    assert (type(fdm.carrier_step_hz), type(ddm.doppler_bands)) == (float, int)


def test_a_hop_far_below_a_cycle_takes_every_cycle() -> None:
    radar = Radar(tx_y=1, tx_z=0, frame_hop_s=1e-14, frame_duration_s=0.001)
    assert radar.window_starts(20).tolist() == list(range(20 - radar.cycles_per_frame + 1))


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


def test_a_file_may_change_another_radar(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('base = "iwr6843"\npitch_deg = -20\nidle_s = 20e-6\n')
    radar, board = Radar.load(file), Radar.preset("iwr6843")
    changed = dataclasses.replace(board, name="mine", pitch_deg=-20.0, idle_s=20e-6)
    assert radar == changed
    (tmp_path / "again.toml").write_text(
        'base = "mine.toml"\nname = "again"\nframe_duration_s = 0.02\n'
    )
    again = Radar.load(tmp_path / "again.toml")
    assert (again.pitch_deg, again.frame_period_s) == (-20.0, None)
    assert again.cycles_per_frame == int(0.02 / again.cycle_duration_s)
    file.write_text('base = "iwr6843"\ntx_y = 2\nrx_y = 4\ntx_z = 0\nrx_z = 0\n')
    assert Radar.load(file).tx_positions_m is None
    assert Radar.load({"base": "iwr1843", "roll_deg": 3}).roll_deg == 3
    file.write_text('board = "iwr1642"\n')
    assert Radar.load(file).n_channels == 8


def test_antennas_that_a_file_does_not_name_are_not_there(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("tx_y = 2\nrx_y = 4\n")
    radar = Radar.load(file)
    assert (radar.n_tx, radar.n_rx, radar.tx_z, radar.rx_z) == (2, 4, 0, 0)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("start_frequency_hz = 77", r"start_frequency_hz = 77; .*is that 77e9\?"),
        ("start_frequency_hz = 77e9\nbandwidth_hz = 4", r"bandwidth_hz = 4; .*is that 4e9\?"),
        ("chirp_duration_s = 62.5", r"chirp_duration_s = 62.5; .*is that 62.5e-6\?"),
        ("start_frequency_hz = 1e9\nbandwidth_hz = 4e9", "it must be below start_frequency_hz"),
        ("samples_per_chirp = 65521", "a whole number from 1 to 16384"),
        ('base = "iwr9999"', "iwr9999"),
        ("base = 3", "base = 3; it must be a name or a path"),
        ('base = "none.toml"', "none.toml"),
        ('base = "iwr1443"\nboard = "iwr1843"', "leave the board out"),
    ],
)
def test_values_of_another_unit_and_bases_that_are_none(
    tmp_path: Path, text: str, says: str
) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(InputError, match=says) as caught:
        Radar.load(file)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        *((name, 0) for name in ("bandwidth_hz", "frame_duration_s", "frame_period_s")),
        *((name, 0) for name in ("adc_rate_hz", "tx_spacing_wavelengths", "carrier_step_hz")),
        *((name, -1) for name in ("rx_spacing_wavelengths", "idle_s", "adc_start_s")),
        *((name, -1) for name in ("tx_y", "tx_z", "rx_y", "rx_z", "noise_figure_db")),
        *(("noise_temperature_k", -1), ("transmit_power_dbm", 201), ("yaw_deg", 361)),
        *(("channels", "x"), ("position_m", [1, 2])),
    ],
)
def test_each_field_has_its_limits(field: str, value: Any) -> None:
    assert f"{field} = {value!r}; " in refusal(Radar, **{field: value})
