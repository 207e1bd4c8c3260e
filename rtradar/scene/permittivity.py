"""Laws of complex relative permittivity over frequency: power laws, relaxations, and the perfect conductor."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

VACUUM_PERMITTIVITY_FPM = 8.8541878188e-12
"""Permittivity of vacuum [F/m], CODATA 2022. P.2040-3 rounds 1e-9 / (2 pi eps_0) = 17.975 to 17.98."""


@dataclass(frozen=True)
class PowerLaw:
    """Permittivity a f^b and conductivity c f^d [S/m], f in GHz: a row of ITU-R P.2040-3, table 3.

    Parameters
    ----------
    low_hz, high_hz : float
        Where it was measured; both ends belong to it.
    a, b, c, d : float
        As in the Recommendation.
    """

    low_hz: float
    high_hz: float
    a: float
    b: float
    c: float
    d: float

    def eta(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Complex relative permittivity, exp(+j omega t): the imaginary part is never positive."""
        ghz = frequency_hz / 1e9
        conductivity = self.c * ghz**self.d
        return np.asarray(
            self.a * ghz**self.b
            - 1j * conductivity / (2 * pi * frequency_hz * VACUUM_PERMITTIVITY_FPM)
        )


@dataclass(frozen=True)
class ColeCole:
    """Sum of Cole-Cole relaxations and an ionic conductivity.

    Parameters
    ----------
    low_hz, high_hz : float
        Where it is used; both ends belong to it.
    infinite : float
        Permittivity far above all relaxations.
    terms : tuple of (float, float, float)
        Step of permittivity, relaxation time [s] and broadening alpha of each.
    conductivity : float
        Ionic [S/m].
    """

    low_hz: float
    high_hz: float
    infinite: float
    terms: tuple[tuple[float, float, float], ...]
    conductivity: float

    def eta(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Complex relative permittivity, exp(+j omega t): the imaginary part is never positive."""
        omega = 2 * pi * frequency_hz
        eta = self.infinite + self.conductivity / (1j * omega * VACUUM_PERMITTIVITY_FPM)
        for step, time, alpha in self.terms:
            eta = eta + step / (1 + (1j * omega * time) ** (1 - alpha))
        return np.asarray(eta)


@dataclass(frozen=True)
class Conductor:
    """Perfect conductor: the permittivity is -j infinity, which `reflection` and `slab` know."""

    low_hz: float = 0.0
    high_hz: float = inf

    def eta(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Minus j infinity."""
        return np.full(frequency_hz.shape, complex(0.0, -inf))
