"""Far-field pattern of virtual elements over the sine of an angle: its beam and grating lobes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GRATING_DB = -3.0
"""A lobe beside the main lobe counts as a grating lobe from here on, below the main lobe [dB]."""

_PER_WAVELENGTH = 64  # points over the finest ripple of the pattern, 1 / aperture
_MOST_POINTS = 2**20
_LEAST = 1e-6  # aperture below which elements are at one place [wavelengths]


@dataclass(frozen=True)
class LinePattern:
    """What a beam of all elements shows of an echo whose sine differs by 0 to 2.

    ``wide`` is whether elements differ in their place at all. ``grating_sine`` is the difference in
    sine at which the first grating lobe is, 2 if there is none, and ``grating_db`` its power below
    the main lobe. ``width_deg`` is the half-power width of the main lobe at broadside.
    """

    wide: bool
    grating_sine: float
    grating_db: float
    width_deg: float

    @property
    def max_angle_deg(self) -> float:
        """Angle between whose two ends no echo shows at another's place [deg]."""
        return math.degrees(math.asin(min(1.0, self.grating_sine / 2)))

    @classmethod
    def of(cls, places: NDArray[np.float64]) -> LinePattern:
        """Pattern of elements at these places (element,) along the line, in wavelengths."""
        aperture = float(np.ptp(places))
        if aperture < _LEAST:
            return cls(False, 2.0, -math.inf, 180.0)
        count = min(_MOST_POINTS, math.ceil(2 * _PER_WAVELENGTH * max(1.0, aperture)))
        sines = np.linspace(0.0, 2.0, count + 1)
        power = pattern(places, sines)
        half = np.flatnonzero(power < 0.5)
        width = 180.0
        if len(half):
            end = half[0]
            inside = (power[end - 1] - 0.5) / (power[end - 1] - power[end])
            edge = sines[end - 1] + inside * (sines[end] - sines[end - 1])
            width = 2 * math.degrees(math.asin(min(1.0, edge)))
        # The main lobe ends where the power has its first minimum.
        rising = np.flatnonzero(np.diff(power) > 0)
        if not len(rising):
            return cls(True, 2.0, -math.inf, width)
        beyond = power[rising[0] :]
        peaks = np.flatnonzero((beyond[1:-1] >= beyond[:-2]) & (beyond[1:-1] > beyond[2:])) + 1
        high = peaks[beyond[peaks] > 10 ** (GRATING_DB / 10)]
        if not len(high):
            return cls(True, 2.0, -math.inf, width)
        first = rising[0] + high[0]
        left, middle, right = power[first - 1 : first + 2]
        shift = 0.5 * (left - right) / (left - 2 * middle + right)
        sine = sines[first] + shift * sines[1]
        level = float(pattern(places, np.array([sine]))[0])
        return cls(True, float(sine), 10 * math.log10(level), width)


def pattern(places: NDArray[np.float64], sines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Power (sine,) of a beam of all elements (element,) [wavelengths], 1 at sine 0."""
    distinct, count = np.unique(np.round(places, 9), return_counts=True)
    field = np.zeros(len(sines), dtype=np.complex128)
    for place, number in zip(distinct - distinct[0], count, strict=True):
        field += number * np.exp(2j * np.pi * place * sines)
    return np.abs(field / len(places)) ** 2
