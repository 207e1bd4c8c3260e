"""The radar against the paper's Tables 1 and 2, by physics and as in the paper; its schedule."""

from __future__ import annotations

import dataclasses
import inspect
import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.radar import Radar

LOW, HIGH = Radar.preset("paper-12ghz"), Radar.preset("paper-77ghz")
ROUNDING = 1e-12
"""Relative error of a handful of float64 operations."""


def approx(value: float, rel: float = ROUNDING) -> Any:
    return pytest.approx(value, rel=rel, abs=0)


# -- the paper's tables ----------------------------------------------------------------------------


def test_table_1() -> None:
    assert (LOW.start_frequency_hz, LOW.bandwidth_hz, LOW.chirp_duration_s) == (12e9, 4e9, 62.5e-6)
    assert (LOW.samples_per_chirp, LOW.frame_duration_s, LOW.frame_hop_s) == (256, 0.1, 0.025)
    assert (LOW.tx_y, LOW.tx_z, LOW.rx_y, LOW.rx_z) == (6, 6, 8, 8)
    assert LOW.position_m == (-4.0, 1.0, 1.0)
    assert LOW.slope_hz_per_s == approx(6.4e13)
    assert LOW.sample_rate_hz == approx(4.096e6)
    assert LOW.start_wavelength_m == approx(
        0.025, rel=1e-3
    )  # the paper's c is 3e8, 0.7 per mille more


def test_the_77_ghz_preset_differs_in_frequency_and_chirp_only() -> None:
    assert (
        dataclasses.replace(
            LOW, name="paper-77ghz", start_frequency_hz=77e9, chirp_duration_s=12.5e-6
        )
        == HIGH
    )


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
    # Range depends on the bandwidth only: 3.75 cm and 9.6 m.
    assert radar.range_bin_m == approx(0.037474, digits)
    assert radar.max_range_m == approx(9.5934, digits)


def test_table_2_as_the_paper_has_it() -> None:
    # The paper: c = 3e8, the start wavelength, and 0.1 s for 133 cycles (its eqs 1 to 6).
    c, start_hz, chirp_s, frame_s, virtual = 3e8, 12e9, 62.5e-6, 0.1, 48
    wavelength = c / start_hz
    rounded = 2e-3  # the paper's two or three digits
    assert c * 4.096e6 / (2 * 6.4e13) == approx(9.6, rounded)
    assert wavelength / (4 * 12 * chirp_s) == approx(8.33, rounded)
    assert wavelength / (2 * frame_s) == approx(0.125, rounded)
    # 2 asin(1/48) is 2.387; the paper truncates it to 2.38.
    assert math.degrees(2 * math.asin(wavelength / (2 * virtual * (wavelength / 2)))) == approx(
        2.38, 5e-3
    )
    # Ours from theirs: the centre of the sweep instead of its start, whole cycles instead of 0.1 s.
    exact_c = SPEED_OF_LIGHT_MPS / c
    centre = exact_c * 12 / 14
    assert LOW.max_range_m == approx(exact_c * 9.6)
    assert LOW.range_bin_m == approx(exact_c * 0.0375)
    assert LOW.max_velocity_mps == approx(centre * wavelength / (4 * 12 * chirp_s))
    assert LOW.velocity_bin_mps == approx(
        centre * wavelength / (2 * frame_s) * frame_s / (133 * 12 * chirp_s)
    )
    # The paper's +-90 deg needs half a wavelength between receivers; at mid-sweep it is 0.583.
    assert math.sin(math.radians(LOW.max_angle_deg)) == approx(12 / 14)


def test_angles_do_not_alias_where_the_spacing_is_half_a_wavelength_or_less() -> None:
    assert Radar(rx_spacing_wavelengths=0.25).max_angle_deg == 90.0


def test_a_single_channel_has_no_angle_resolution() -> None:
    assert Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=1).angle_resolution_deg == 180.0


# -- the array -------------------------------------------------------------------------------------


@pytest.mark.parametrize("radar", [LOW, HIGH], ids=["12 GHz", "77 GHz"])
def test_antenna_places(radar: Radar) -> None:
    wavelength = SPEED_OF_LIGHT_MPS / radar.start_frequency_hz
    expected_tx = [(0, (i - 2.5) * 4, 0) for i in range(6)] + [
        (0, 0, (i - 2.5) * 4) for i in range(6)
    ]
    expected_rx = [(0, (j - 3.5) / 2, 0) for j in range(8)] + [
        (0, 0, (j - 3.5) / 2) for j in range(8)
    ]
    for places, expected in ((radar.tx, expected_tx), (radar.rx, expected_rx)):
        assert places.dtype == np.float64
        # Rounding where metres are added to millimetres.
        np.testing.assert_allclose(
            places, np.array([-4.0, 1.0, 1.0]) + wavelength * np.array(expected), rtol=0, atol=1e-14
        )


counts = st.integers(0, 7)


@given(
    tx_y=counts,
    tx_z=counts,
    rx_y=counts,
    rx_z=counts,
    tx_spacing=st.floats(0.1, 9),
    rx_spacing=st.floats(0.1, 9),
)
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
            np.testing.assert_allclose(
                np.diff(line[:, axis]), spacing * radar.start_wavelength_m, rtol=1e-9
            )
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


# -- the schedule ----------------------------------------------------------------------------------


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
        # 3 s at 12 GHz: 4000 cycles of 0.75 ms, 133 a frame, so the last may start at 3867, and
        # 116 x 33.33 = 3866.7 does.
        # 77 GHz: 20 000 cycles of 0.15 ms, 666 a window: 19 334; 116 x 166.67 = 19 333.3 does.
        (LOW, 48_000, Fraction(100, 3), 3867),
        (HIGH, 240_000, Fraction(500, 3), 19_333),
    ],
    ids=["12 GHz", "77 GHz"],
)
def test_windows_of_three_seconds(
    radar: Radar, chirps: int, cycles_per_hop: Fraction, last_start: int
) -> None:
    starts = radar.window_starts(chirps)
    assert len(starts) == 117
    assert starts[-1] == last_start
    assert starts.tolist() == [
        round(k * cycles_per_hop) for k in range(117)
    ]  # thirds: never half-way between cycles
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
def test_windows_by_brute_force(
    hop_eighths: int, frame_cycles: int, n_tx: int, chirps: int
) -> None:
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
    assert radar.window_starts(chirps).tolist() == sorted(
        start for start in nearest if start <= last
    )


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


def test_carriers_of_fdm_lie_evenly_about_the_sweep() -> None:
    radar = Radar(multiplexing="fdm", carrier_step_hz=10e6, tx_y=2, tx_z=1)
    np.testing.assert_allclose(radar.tx_offset_hz, [-10e6, 0, 10e6])


def test_a_word_that_is_no_field_is_told_in_one_line() -> None:
    with pytest.raises(InputError, match=r"unknown key 'start_freq' \(did you mean start_frequ"):
        Radar(start_freq=60e9)  # type: ignore[call-arg]
    assert "start_frequency_hz" in inspect.signature(Radar).parameters
