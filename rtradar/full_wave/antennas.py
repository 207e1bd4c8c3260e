"""Antennas of the full-wave methods: Hertzian dipoles across the line of sight to the origin.

An antenna stands at a point, and its dipole moment is a unit vector across the line of sight from
the origin of the coordinates. Fields are multiplied by the distance ``R0`` of the antenna from the
origin and by exp(+j k R0), so that they tend to a plane wave of unit amplitude and of phase zero at
the origin as the antenna recedes. The terms of the near field are kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Polarization = Literal["v", "h"]

_STEEP = 1e-9
"""Sine of the angle from the vertical below which x serves in place of z."""


def wavenumber(frequency_hz: float) -> float:
    """Return the wavenumber of a frequency in vacuum [rad/m]."""
    return 2 * np.pi * frequency_hz / SPEED_OF_LIGHT_MPS


def antenna_moments(antennas: Array, polarization: Polarization) -> Array:
    """Compute the unit dipole moments of antennas.

    Parameters
    ----------
    antennas : (n, 3) float64
        Positions relative to the origin [m].
    polarization : {"v", "h"}
        v is world z projected across the line of sight, h is the cross product of the direction to
        the antenna and z. Straight above and below, x takes the place of z.

    Returns
    -------
    (n, 3) float64
    """
    to_antenna = antennas / np.linalg.norm(antennas, axis=1, keepdims=True)
    steep = np.hypot(to_antenna[:, 0], to_antenna[:, 1]) < _STEEP
    up = np.where(steep[:, None], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0])
    across = np.cross(to_antenna, up)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return across if polarization == "h" else np.cross(across, to_antenna)


@dataclass(frozen=True)
class Dipole:
    """One antenna.

    Parameters
    ----------
    position : (3,) float64
        Position [m].
    moment : (3,) float64
        Unit vector of its dipole moment.
    """

    position: Array
    moment: Array

    def fields(self, points: ArrayLike, wavenumber: float) -> tuple[Field, Field]:
        """Compute the field of the dipole, relative to that of a plane wave at the origin.

        Parameters
        ----------
        points : (..., 3) array_like
            Points [m].
        wavenumber : float
            Wavenumber in vacuum [rad/m].

        Returns
        -------
        electric, magnetic : (..., 3) complex128
            E and H times the wave impedance of vacuum, for exp(+j omega t), both times R0 exp(j k
            R0) with the distance R0 of the antenna from the origin.

        Notes
        -----
        Equation :eq:`antenna-dipole` of the theory page.
        """
        at = np.asarray(points, dtype=np.float64)
        away = at - self.position
        distance = np.linalg.norm(away, axis=-1, keepdims=True)
        from_origin = float(np.linalg.norm(self.position))
        # distance - from_origin without the cancellation that far antennas would bring
        squares = (at**2).sum(axis=-1, keepdims=True) - 2 * (at @ self.position)[..., None]
        excess = squares / (distance + from_origin)
        # The far field, then the terms of the near field in powers of 1 / kR.
        wave = np.exp(-1j * wavenumber * excess) * from_origin / distance
        unit, inverse = away / distance, 1 / (wavenumber * distance)
        along = (unit @ self.moment)[..., None]
        electric = wave * (
            (1 - 1j * inverse - inverse**2) * self.moment
            - (1 - 3j * inverse - 3 * inverse**2) * along * unit
        )
        return electric, wave * (1 - 1j * inverse) * np.cross(unit, self.moment)
