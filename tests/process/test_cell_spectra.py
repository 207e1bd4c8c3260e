"""Chosen cells: the values of the whole range-Doppler map there, and in the range bins beside."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtradar.errors import InputError
from rtradar.process import range_doppler, range_spectrum
from rtradar.process.spectra import cell_spectra
from rtradar.process.steering import range_walk
from rtradar.radar import Radar

LOW = Radar.preset("paper-12ghz")
SMALL = dataclasses.replace(LOW, tx_y=3, tx_z=2, rx_y=4, rx_z=4, samples_per_chirp=32)


def noise(n_chirps: int, radar: Radar, seed: int = 0) -> np.ndarray:
    random = np.random.default_rng(seed)
    shape = (n_chirps, radar.n_rx, radar.samples_per_chirp)
    return random.standard_normal(shape) + 1j * random.standard_normal(shape)


def cube_of(x: np.ndarray, radar: Radar) -> np.ndarray:
    return range_spectrum(x, radar).reshape(-1, radar.n_tx, radar.n_rx, radar.samples_per_chirp)


@given(data=st.data(), n_cycles=st.integers(1, 24))
@settings(max_examples=40, deadline=None)
def test_cells_are_those_of_the_whole_map(data: st.DataObject, n_cycles: int) -> None:
    x = noise(n_cycles * SMALL.n_tx, SMALL)
    cells = st.tuples(st.integers(0, SMALL.samples_per_chirp - 1), st.integers(0, n_cycles - 1))
    chosen = np.array(data.draw(st.lists(cells, min_size=1, max_size=40)))
    values = cell_spectra(cube_of(x, SMALL), SMALL, chosen[:, 0], chosen[:, 1])
    whole = range_doppler(x, SMALL).values
    walk = range_walk(SMALL)
    assert values.shape == (len(chosen), 2 * walk + 1, SMALL.n_channels)
    for offset in range(-walk, walk + 1):
        expected = whole[(chosen[:, 0] + offset) % SMALL.samples_per_chirp, chosen[:, 1]]
        # 1e-6: the range spectra are complex64.
        np.testing.assert_allclose(values[:, walk + offset], expected, atol=1e-6)


def test_every_cell_of_a_real_window() -> None:
    # Cells in all of the range, so that blocks of bins with gaps and the ends of the axis are met.
    x = noise(LOW.chirps_per_frame, LOW).astype(np.complex64)
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
    cube = cube_of(noise(3 * SMALL.n_tx, SMALL), SMALL).astype(np.complex128)
    assert cell_spectra(cube, SMALL, [1], [2]).dtype == np.complex128


def test_no_cells() -> None:
    cube = cube_of(noise(2 * SMALL.n_tx, SMALL), SMALL)
    assert cell_spectra(cube, SMALL, [], []).shape == (
        0,
        2 * range_walk(SMALL) + 1,
        SMALL.n_channels,
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
        cell_spectra(cube_of(noise(2 * SMALL.n_tx, SMALL), SMALL), SMALL, rows, columns)


def test_a_shape_that_does_not_fit() -> None:
    with pytest.raises(InputError, match="spectra have shape"):
        cell_spectra(np.zeros((2, 3, 4, 32), np.complex64), SMALL, [1], [0])
