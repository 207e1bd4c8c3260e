"""The few highest maxima of angle spectra that are neither side lobes nor noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled
from rtradar.process.angles.parabola import refine

MOST_PEAKS = 3
"""Peaks taken of one spectrum."""

BELOW_HIGHEST_DB = 6.0
"""Peaks further below the highest are left out. Off the boresight, elements read different range bins: in a cell beside a
strong, fast echo its side lobes in range and angle meet. ``validation/closed_forms/spatial_cloud.py`` counts the points that
are of no body part: 4 % of those of a walk at 6 dB, 9 % at 10 dB."""

ABOVE_MEDIAN_DB = 11.0
"""So are peaks, the highest excepted, nearer to the median of their spectrum; noise alone passes it in 2 of 100 spectra."""


@dataclass(frozen=True)
class Peaks:
    """Highest maxima of a number of spectra, the strongest first.

    Parameters
    ----------
    sine, power : (cell, peak) float64
        Refined between the points of the grid.
    real : (cell, peak) bool
        False where a cell has fewer peaks; sine and power are those of its strongest there. A cell with any power has one.
    """

    sine: NDArray[np.float64]
    power: NDArray[np.float64]
    real: NDArray[np.bool_]


def find_peaks(sines: NDArray[np.float64], power: NDArray[np.float32]) -> Peaks:
    """Up to `MOST_PEAKS` maxima of each spectrum.

    Parameters
    ----------
    sines : (sine,) float64
        Uniform grid.
    power : (cell, sine) float32

    Returns
    -------
    Peaks
    """
    index = np.empty((len(power), MOST_PEAKS), dtype=np.int64)
    count = np.empty(len(power), dtype=np.int64)
    _highest(
        power,
        np.float32(10 ** (-BELOW_HIGHEST_DB / 10)),
        np.float32(10 ** (ABOVE_MEDIAN_DB / 10)),
        index,
        count,
    )
    real = np.arange(MOST_PEAKS) < count[:, None]
    return Peaks(*refine(sines, power, index), real)


@compiled()
def _highest(power, below, above, index, count):
    """Fill index (cell, peak) with the maxima, the strongest first and again where there are no more, and count (cell,)."""
    sines, peaks = power.shape[1], index.shape[1]
    for cell in range(len(power)):
        own, best, found = power[cell], index[cell], 0
        top = 0
        for sine in range(1, sines):
            if own[sine] > own[top]:
                top = sine
        highest = own[top]
        best[:] = top
        for sine in range(sines):
            value = own[sine]
            rises, falls = (
                sine == 0 or value > own[sine - 1],
                sine == sines - 1 or value >= own[sine + 1],
            )
            if not (value > 0 and value >= highest * below and rises and falls):
                continue
            # That far above the median: as far above half of the spectrum. Only what is not the highest is asked about.
            if value < highest:
                lower = 0
                for other in range(sines):
                    lower += own[other] * above <= value
                if 2 * lower <= sines:
                    continue
            place = found
            while place > 0 and value > own[best[place - 1]]:
                place -= 1
            if place < peaks:
                for later in range(peaks - 1, place, -1):
                    best[later] = best[later - 1]
                best[place] = sine
                found = min(found + 1, peaks)
        for none in range(found, peaks):
            best[none] = best[0]
        count[cell] = found
