"""Complex Doppler values of chosen range-Doppler cells, without the whole map of every channel.

A window has some hundred detected cells among 30 000 to 170 000, in a few dozen range bins: only these are transformed.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.fft
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.process.angles.steering import range_walk
from rtradar.process.window_functions import HANN, WindowFunctions, weights
from rtradar.radar import Radar
from rtradar.system.threads import in_threads

_CACHE_BYTES = 2_500_000
"""What a thread transforms at once: several channels of a short window, of a long one (77 GHz: 666 cycles) each by itself."""


def cell_spectra(
    spectra: NDArray[np.complexfloating],
    radar: Radar,
    range_bins: ArrayLike,
    velocity_bins: ArrayLike,
    *,
    window_functions: WindowFunctions = HANN,
) -> NDArray[np.complexfloating]:
    """Values of chosen cells in every channel, with those of the range bins beside them.

    An echo from the side reaches the ends of the array sooner and later than the middle, by more than a range bin: its
    channels stand in the neighbours of its cell.

    Parameters
    ----------
    spectra : (cycle, tx, rx, range) complex
        Range spectra of one window, from `range_spectrum`.
    radar : Radar
        Gives the shape.
    range_bins, velocity_bins : (cell,) int
        Indices of the cells in the map of `power_map`: velocity ascending, zero at ``n_cycles // 2``.

    window_functions : WindowFunctions
        The window function in slow time is taken from it.

    Returns
    -------
    (cell, offset, channel) complex
        What `range_doppler` gives at range bins ``-walk`` to ``+walk`` about each cell, walk = `range_walk` of the radar (offset
        ``walk`` is the cell itself; past the end of the range axis it goes on at the other), in the precision of ``spectra``.
        Coherent gain 1; channel = tx * n_rx + rx. The phase that a moving echo gains
        between the Tx of one cycle is left in.

    Raises
    ------
    InputError
        Where the shape does not fit the radar, the cells are no whole numbers within the map, or the radar has no line
        that could tell an angle.
    """
    cube = np.asarray(spectra)
    if (
        cube.ndim != 4
        or cube.shape[1:3] != (radar.n_tx, radar.n_rx)
        or cube.shape[0] < 1
        or cube.dtype.kind != "c"
    ):
        raise InputError(
            f"cell_spectra: spectra have shape {cube.shape}, type {cube.dtype}; radar '{radar.name}' needs complex "
            f"(cycle, tx, rx, range) = (>= 1, {radar.n_tx}, {radar.n_rx}, any)"
        )
    n_cycles, n_range = cube.shape[0], cube.shape[3]
    rows = _indices(range_bins, n_range, "range_bins")
    columns = _indices(velocity_bins, n_cycles, "velocity_bins")
    if rows.shape != columns.shape:
        raise InputError(
            f"cell_spectra: {len(rows)} range_bins and {len(columns)} velocity_bins; give one of each for a cell"
        )
    walk = range_walk(radar)
    steps = (rows[:, None] + np.arange(-walk, walk + 1)) % n_range
    # Index 0 of the map is the DFT bin of the most negative velocity.
    turns = np.broadcast_to(((columns - n_cycles // 2) % n_cycles)[:, None], steps.shape)
    values = np.empty((*steps.shape, radar.n_channels), dtype=cube.dtype)
    scale = weights(window_functions.doppler, n_cycles).astype(cube.real.dtype)[:, None, None]
    used, place = np.unique(steps, return_inverse=True)
    place = place.reshape(steps.shape)

    # Before the range bins in use are picked out, NumPy copies all of them.
    at_once = min(radar.n_rx, max(1, _CACHE_BYTES // (n_cycles * n_range * cube.itemsize)))
    batches = math.ceil(radar.n_rx / at_once)

    def transform(item: int) -> None:
        # Channels of one Tx lie side by side in what is filled.
        tx, rx = item // batches, item % batches * at_once
        weighted = np.take(cube[:, tx, rx : rx + at_once], used, axis=2)
        weighted *= scale
        doppler = scipy.fft.fft(weighted, axis=0, overwrite_x=True)
        first = tx * radar.n_rx + rx
        values[:, :, first : first + weighted.shape[1]] = doppler[turns, :, place]

    in_threads(transform, range(radar.n_tx * batches))
    return values


def _indices(bins: ArrayLike, n: int, name: str) -> NDArray[np.int64]:
    indices = np.asarray(bins)
    if indices.ndim == 1 and indices.size == 0:
        return np.zeros(0, dtype=np.int64)
    if (
        indices.ndim != 1
        or indices.dtype.kind not in "iu"
        or indices.min() < 0
        or indices.max() >= n
    ):
        raise InputError(f"cell_spectra: {name} must be whole numbers (cell,) from 0 to {n - 1}")
    return indices.astype(np.int64)
