"""Range-Doppler spectra, whole or in chosen cells: laws of the transform, and known echoes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.process import WindowFunctions, power_map, range_doppler, range_spectrum, range_time
from rtradar.process.spectra import cell_spectra
from rtradar.process.steering import range_walk
from rtradar.radar import Radar

# Small in every axis; 1.2 ms of 20 cycles, bins of 3.75 cm and 0.6 m/s.
SMALL = Radar(
    tx_y=2,
    tx_z=1,
    rx_y=2,
    rx_z=2,
    samples_per_chirp=32,
    frame_duration_s=3.75e-3,
    chirp_duration_s=62.5e-6,
)

HANN = WindowFunctions("hann", "hann")
"""What the closed forms of these tests are of."""


def noise(radar: Radar, n_chirps: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    shape = (n_chirps, radar.n_rx, radar.samples_per_chirp)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def point_echo(radar: Radar, n_chirps: int, range_m: float, velocity_mps: float) -> np.ndarray:
    """IF of a point without delay differences over the array; ``range_m`` is where it is in the
    middle of the capture."""
    times = radar.chirp_times(n_chirps)
    tau = (
        2
        * (range_m + velocity_mps * (times - n_chirps * radar.chirp_duration_s / 2))
        / SPEED_OF_LIGHT_MPS
    )
    fast = np.arange(radar.samples_per_chirp) / radar.sample_rate_hz
    slope = radar.slope_hz_per_s
    delay = tau[:, None]
    phase = radar.start_frequency_hz * delay + slope * delay * fast - slope * delay**2 / 2
    return np.repeat(np.exp(2j * np.pi * phase)[:, None, :], radar.n_rx, axis=1)


def centroid(power: np.ndarray) -> float:
    """Mean bin of the power within 12 bins of the peak: a Hann-windowed tone has 1e-6 of its power
    beyond."""
    bins = power.argmax() + np.arange(-12, 13)
    return float(power[bins] @ bins / power[bins].sum())


@pytest.mark.parametrize("preset", ["paper-12ghz", "paper-77ghz"])
@pytest.mark.parametrize("velocity", [0.0, 2.0, -2.0, 0.731])
def test_point_reads_back(preset: str, velocity: float) -> None:
    # One Tx and one Rx with the cycle of the presets: the same axes at a twelfth of the work.
    whole = Radar.preset(preset)
    radar = Radar(
        start_frequency_hz=whole.start_frequency_hz,
        chirp_duration_s=whole.cycle_duration_s,
        tx_y=1,
        tx_z=0,
        rx_y=1,
        rx_z=0,
    )
    n = radar.cycles_per_frame
    truth_m = 4.321
    spectra = range_doppler(point_echo(radar, n, truth_m, velocity), radar)
    power = np.abs(spectra.values[..., 0]) ** 2
    # 2 m/s for 0.1 s blurs the echo over five range bins, evenly about the middle of the window;
    # its Doppler shift of 187 Hz reads as 0.02 bins of range (12 GHz).
    assert abs(centroid(power.sum(axis=1)) - truth_m / radar.range_bin_m) < 0.03
    doppler = power.sum(axis=0)
    assert (
        abs(centroid(doppler) - n // 2 - velocity / radar.velocity_bin_mps) < 0.01
    )  # measured 0.001
    assert abs(spectra.velocity[doppler.argmax()] - velocity) <= radar.velocity_bin_mps
    assert spectra.velocity[n // 2] == 0


@pytest.mark.parametrize("doppler_bin", [-9, -1, 0, 4, 9])
def test_unit_tone_on_a_bin_reads_one(doppler_bin: int) -> None:
    n, range_bin = 20, 7
    cycle, sample = np.arange(n), np.arange(SMALL.samples_per_chirp)
    tone = np.exp(
        2j
        * np.pi
        * (doppler_bin * cycle[:, None] / n + range_bin * sample / SMALL.samples_per_chirp)
    )
    x = np.repeat(
        np.repeat(tone[:, None], SMALL.n_tx, axis=1).reshape(-1, 1, SMALL.samples_per_chirp),
        SMALL.n_rx,
        axis=1,
    )
    spectra = range_doppler(x, SMALL, window_functions=HANN)
    expected = np.zeros(spectra.values.shape[:2])
    expected[range_bin, n // 2 + doppler_bin] = 1
    for offset in (-1, 1):  # Hann: half an amplitude on the neighbours
        expected[range_bin + offset, n // 2 + doppler_bin] = 0.5
    for k in (-1, 1):
        expected[:, (n // 2 + doppler_bin + k) % n] += 0.5 * expected[:, n // 2 + doppler_bin]
    for channel in range(SMALL.n_channels):
        np.testing.assert_allclose(
            np.abs(spectra.values[..., channel]), expected, atol=1e-12
        )  # rounding of float64


def test_channels_are_tx_times_rx() -> None:
    x = np.zeros((6 * SMALL.n_tx, SMALL.n_rx, SMALL.samples_per_chirp), np.complex64)
    x[2 :: SMALL.n_tx, 1] = 1  # Tx 2, Rx 1
    spectra = range_doppler(x, SMALL)
    assert spectra.values.dtype == np.complex64
    lit = np.flatnonzero(np.abs(spectra.values).max(axis=(0, 1)) > 0)
    assert lit.tolist() == [2 * SMALL.n_rx + 1]


@pytest.mark.parametrize(
    ("given", "kind"), [("f4", "c8"), ("c8", "c8"), ("f8", "c16"), ("c16", "c16")]
)
def test_single_stays_single_and_double_double(given: str, kind: str) -> None:
    ones = np.ones((3, SMALL.n_rx, SMALL.samples_per_chirp), given)
    assert range_doppler(ones, SMALL).values.dtype == np.dtype(kind)


def test_parseval() -> None:
    # With rectangular windows of weight 1 / n: the mean power of the samples is the sum of the
    # power of the cells.
    x = noise(SMALL, 30)
    flat = WindowFunctions("boxcar", "boxcar")
    power = np.sum(np.abs(range_doppler(x, SMALL, window_functions=flat).values) ** 2)
    mean = np.mean(np.abs(x) ** 2) * SMALL.n_channels
    np.testing.assert_allclose(power, mean, rtol=1e-12)  # rounding of float64


@given(shift_range=st.integers(0, 31), shift_doppler=st.integers(0, 9))
@settings(max_examples=20, deadline=None)
def test_turning_the_samples_moves_the_map(shift_range: int, shift_doppler: int) -> None:
    n, x = 10, noise(SMALL, 30)
    cycle = np.repeat(np.arange(n), SMALL.n_tx)
    turn = np.exp(
        2j * np.pi * (shift_range * np.arange(32) / 32 + shift_doppler * cycle[:, None, None] / n)
    )
    moved = np.abs(range_doppler(x * turn, SMALL).values)
    still = np.abs(range_doppler(x, SMALL).values)
    np.testing.assert_allclose(
        moved, np.roll(still, (shift_range, shift_doppler), axis=(0, 1)), atol=1e-12
    )  # float64


def test_power_map_is_the_sum_of_the_channels() -> None:
    radar = Radar.preset("paper-12ghz")
    x = noise(radar, 5 * 12).astype(np.complex64)
    exact = np.abs(range_doppler(x.astype(complex), radar).values) ** 2
    spectra = range_spectrum(x, radar).reshape(5, 12, 8, 256)
    power = power_map(spectra, radar)
    assert power.dtype == np.float32
    # The least of 5 x 256 sums of 96 cells is not small beside the mean: the rounding of complex64
    # is all there is.
    np.testing.assert_allclose(power, exact.sum(axis=2), rtol=1e-5)
    alone = power_map(spectra, radar, channel=3 * 8 + 5)
    np.testing.assert_allclose(
        alone, exact[..., 3 * 8 + 5], rtol=1e-3, atol=1e-6 * exact.max()
    )  # nulls are rounding
    double = power_map(spectra.astype(complex), radar)
    assert double.dtype == np.float64
    np.testing.assert_allclose(double, power, rtol=1e-5)


def test_range_spectrum_does_not_depend_on_the_block() -> None:
    x = noise(SMALL, 300)
    whole = range_spectrum(x, SMALL)
    assert whole.dtype == np.complex64
    parts = [range_spectrum(block, SMALL) for block in np.array_split(x, [1, 7, 7, 250])]
    np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_chirps_after_the_last_cycle_are_left_out() -> None:
    x = noise(SMALL, 32)
    np.testing.assert_array_equal(
        range_doppler(x, SMALL).values, range_doppler(x[:30], SMALL).values
    )


def test_one_cycle_is_enough() -> None:
    assert range_doppler(noise(SMALL, 3), SMALL).values.shape == (32, 1, 6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: range_doppler(noise(SMALL, 30)[:, :1], SMALL), "needs"),
        (lambda: range_doppler(noise(SMALL, 30)[0], SMALL), "needs"),
        (lambda: range_doppler(noise(SMALL, 2), SMALL), "at least 3"),
        (lambda: range_doppler(np.full((3, 2, 32), np.nan), SMALL), "NaN"),
        (lambda: range_doppler(np.full((3, 2, 32), "a"), SMALL), "complex"),
        (lambda: range_spectrum(noise(SMALL, 30), Radar.preset("paper-12ghz")), "needs"),
        (lambda: power_map(np.zeros((10, 2, 3, 32), complex), SMALL), "needs"),
        (lambda: power_map(np.zeros((0, 3, 2, 32), complex), SMALL), ">= 1, 3, 2"),
        (lambda: power_map(np.zeros((10, 3, 2, 32), complex), SMALL, channel=6), "0 to 5"),
        (lambda: power_map(np.zeros((10, 3, 2, 32), complex), SMALL, channel=-1), "0 to 5"),
    ],
)
def test_bad_input_is_refused(call, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        call()
    assert "\n" not in str(error.value)


def test_range_time_is_the_mean_power_of_its_cycles() -> None:
    radar = Radar(
        tx_y=2,
        tx_z=1,
        rx_y=2,
        rx_z=2,
        samples_per_chirp=8,
        frame_duration_s=3.75e-3,
        chirp_duration_s=1e-3,
    )
    random = np.random.default_rng(0)
    spectra = random.standard_normal((15, 2, 8)) + 1j * random.standard_normal((15, 2, 8))
    power, times = range_time(
        spectra, radar, first_chirp=30, step_s=6e-3
    )  # two cycles of three chirps
    expected = [
        (np.abs(spectra[first : first + 6]) ** 2).sum(axis=(0, 1)) / (2 * n)
        for first, n in ((0, 6), (6, 6), (12, 3))
    ]
    np.testing.assert_allclose(power, expected, rtol=1e-12)
    np.testing.assert_allclose(times, [33e-3, 39e-3, 43.5e-3], rtol=1e-12)
    whole, one_by_one = (
        range_time(spectra, radar, step_s=1e-9)[0],
        range_time(spectra[:3], radar)[0],
    )
    assert whole.shape == (5, 8)  # one cycle at least
    np.testing.assert_allclose(whole[0], one_by_one[0], rtol=1e-12)
    assert range_time(spectra[:0], radar)[0].shape == (0, 8)
    with pytest.raises(InputError, match="range_time: spectra have shape"):
        range_time(spectra[:, :1], radar)


@pytest.mark.parametrize("kind", [np.complex64, np.complex128])
def test_into_an_array_that_is_there(kind: type) -> None:
    x = noise(SMALL, 6).astype(kind)
    expected, out = range_spectrum(x, SMALL), np.full(x.shape, np.nan, np.complex64)
    assert range_spectrum(x, SMALL, out=out) is out
    np.testing.assert_array_equal(out, expected)


@pytest.mark.parametrize(
    ("shape", "kind", "every"),
    [((6, 2, 31), np.complex64, 1), ((6, 2, 32), float, 1), ((6, 2, 64), np.complex64, 2)],
)
def test_an_array_that_cannot_be_filled(shape: tuple[int, ...], kind: type, every: int) -> None:
    out = np.empty(shape, kind)[..., ::every]
    with pytest.raises(
        ValueError,
        match=r"range_spectrum: out has shape .* must have \(6, 2, 32\), complex64, C-contiguous",
    ):
        range_spectrum(noise(SMALL, 6), SMALL, out=out)


LOW = Radar.preset("paper-12ghz")
CROSS = dataclasses.replace(LOW, tx_y=3, tx_z=2, rx_y=4, rx_z=4, samples_per_chirp=32)


def cube_of(x: np.ndarray, radar: Radar) -> np.ndarray:
    return range_spectrum(x, radar).reshape(-1, radar.n_tx, radar.n_rx, radar.samples_per_chirp)


@given(data=st.data(), n_cycles=st.integers(1, 24))
@settings(max_examples=40, deadline=None)
def test_cells_are_those_of_the_whole_map(data: st.DataObject, n_cycles: int) -> None:
    x = noise(CROSS, n_cycles * CROSS.n_tx)
    cells = st.tuples(st.integers(0, CROSS.samples_per_chirp - 1), st.integers(0, n_cycles - 1))
    chosen = np.array(data.draw(st.lists(cells, min_size=1, max_size=40)))
    values = cell_spectra(cube_of(x, CROSS), CROSS, chosen[:, 0], chosen[:, 1])
    whole = range_doppler(x, CROSS).values
    walk = range_walk(CROSS)
    assert values.shape == (len(chosen), 2 * walk + 1, CROSS.n_channels)
    for offset in range(-walk, walk + 1):
        expected = whole[(chosen[:, 0] + offset) % CROSS.samples_per_chirp, chosen[:, 1]]
        # 1e-6: the range spectra are complex64.
        np.testing.assert_allclose(values[:, walk + offset], expected, atol=1e-6)


def test_every_cell_of_a_real_window() -> None:
    # Cells in all of the range, so that blocks of bins with gaps and the ends of the axis are met.
    x = noise(LOW, LOW.chirps_per_frame).astype(np.complex64)
    rows, columns = (
        np.array([255, 0, 107, 107, 108, 3, 250, 180]),
        np.array([0, 132, 66, 66, 5, 70, 131, 64]),
    )
    values = cell_spectra(cube_of(x, LOW), LOW, rows, columns)
    assert values.dtype == np.complex64
    np.testing.assert_allclose(
        values[:, 4], range_doppler(x, LOW).values[rows, columns], atol=1e-6
    )  # complex64


def test_double_stays_double() -> None:
    cube = cube_of(noise(CROSS, 3 * CROSS.n_tx), CROSS).astype(np.complex128)
    assert cell_spectra(cube, CROSS, [1], [2]).dtype == np.complex128


def test_no_cells() -> None:
    cube = cube_of(noise(CROSS, 2 * CROSS.n_tx), CROSS)
    assert cell_spectra(cube, CROSS, [], []).shape == (
        0,
        2 * range_walk(CROSS) + 1,
        CROSS.n_channels,
    )


@pytest.mark.parametrize(
    ("radar", "walk"), [(LOW, 4), (Radar.preset("paper-77ghz"), 1)], ids=["12 GHz", "77 GHz"]
)
def test_range_walk_by_hand(radar: Radar, walk: int) -> None:
    # End elements: 10 + 1.75 wavelengths of the start off the middle, half of it one way, 12 GHz:
    # 0.1468 m x sin(59 deg) = 0.126 m = 3.4 bins; 77 GHz: 0.0229 m x sin(77 deg) = 0.6 bins.
    assert range_walk(radar) == walk


@pytest.mark.parametrize(
    ("rows", "columns", "message"),
    [
        ([32], [0], "range_bins must be whole numbers"),
        ([-1], [0], "range_bins must be whole numbers"),
        ([1], [2], "velocity_bins must be whole numbers"),
        ([1.0], [0], "range_bins must be whole numbers"),
        ([[1]], [[0]], "range_bins must be whole numbers"),
        ([1, 2], [0], "one of each"),
    ],
)
def test_cells_outside_the_map(rows: list, columns: list, message: str) -> None:
    with pytest.raises(InputError, match=message):
        cell_spectra(cube_of(noise(CROSS, 2 * CROSS.n_tx), CROSS), CROSS, rows, columns)


def test_a_shape_that_does_not_fit() -> None:
    with pytest.raises(InputError, match="spectra have shape"):
        cell_spectra(np.zeros((2, 3, 4, 32), np.complex64), CROSS, [1], [0])
