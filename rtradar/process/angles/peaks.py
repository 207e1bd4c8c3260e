"""The few highest maxima of angle spectra that are neither side lobes nor noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.angles import highest_maxima
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
    highest_maxima(
        power,
        np.float32(10 ** (-BELOW_HIGHEST_DB / 10)),
        np.float32(10 ** (ABOVE_MEDIAN_DB / 10)),
        index,
        count,
    )
    real = np.arange(MOST_PEAKS) < count[:, None]
    return Peaks(*refine(sines, power, index), real)
