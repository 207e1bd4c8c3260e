"""Element-wise steps of spectra that read and write each value once."""

from __future__ import annotations

import numpy as np
from numba import prange

from rtradar.kernels.jit import compiled

_CELLS_AT_ONCE = 1024


@compiled(fastmath={"contract"})
def weigh_samples(values, weights, out):
    """Fill ``out (chirp, rx, sample)`` with the values times the weight of their sample."""
    for chirp in range(len(out)):
        for receiver in range(out.shape[1]):
            for sample in range(out.shape[2]):
                out[chirp, receiver, sample] = values[chirp, receiver, sample] * weights[sample]


def weigh_samples_reference(values, weights):
    """The same by NumPy."""
    return values * weights


@compiled(parallel=True)
def subtract_mean(cycles, out):
    """Fill ``out (cycle, cell)`` with ``cycles`` less their mean over the cycles."""
    count, cells = cycles.shape
    for block in prange((cells + _CELLS_AT_ONCE - 1) // _CELLS_AT_ONCE):
        first, last = block * _CELLS_AT_ONCE, min((block + 1) * _CELLS_AT_ONCE, cells)
        # Summed in double: the mean of equal values is that value, and their difference is zero.
        mean = np.zeros(last - first, dtype=np.complex128)
        for cycle in range(count):
            row = cycles[cycle, first:last]
            for cell in range(last - first):
                mean[cell] += row[cell]
        rounded = (mean / count).astype(cycles.dtype)
        for cycle in range(count):
            row, left = cycles[cycle, first:last], out[cycle, first:last]
            for cell in range(last - first):
                left[cell] = row[cell] - rounded[cell]


def subtract_mean_reference(cycles):
    """The same by NumPy."""
    return cycles - cycles.mean(axis=0, dtype=np.complex128).astype(cycles.dtype)
