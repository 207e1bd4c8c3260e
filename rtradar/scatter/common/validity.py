"""Where optics ends: a warning for targets whose curvature is too small for the wavelength."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import MINIMUM_KA
from rtradar.errors import ValidityWarning
from rtradar.rcs import ellipsoid_radii

_WARN_SHARE = 0.05
"""Less of the echo power than this is not worth a warning."""


def warn_of_small_radii(
    target: Ellipsoids,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    wavenumber: NDArray[np.float64],
    amplitude: NDArray[np.float64],
    *,
    stacklevel: int = 2,
) -> None:
    """Warn where much of an echo comes from radii of curvature below `MINIMUM_KA` over the wavenumber.

    Parameters
    ----------
    target : Ellipsoids
    tx, rx : (n, 3) float64
        Antennas, pair by pair [m].
    wavenumber : (n,) float64
        [1/m].
    amplitude : (n, part) float64
        Amplitude of each part's echo; only its ratio to the others counts.
    stacklevel : int
        Stack level of the warning, counted from the caller; see `warnings.warn`.

    Warns
    -----
    ValidityWarning
        Where such radii, taken where the normal halves the angle between both antennas, give more than 5 % of the power.

    Notes
    -----
    Equation :eq:`validity` of the theory page.
    """
    normal = np.zeros((len(tx), *target.centres.shape))
    for antennas in (tx, rx):
        sight = np.einsum("pji,npj->npi", target.frames, antennas[:, None] - target.centres)
        normal += sight / np.linalg.norm(sight, axis=-1, keepdims=True)
    # Opposite antennas have no such normal, and no echo.
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    theta, phi = (
        np.arccos(np.clip(normal[..., 2], -1, 1)),
        np.arctan2(normal[..., 1], normal[..., 0]),
    )
    a, b, c = target.semi_axes.T
    smaller, _ = ellipsoid_radii(a, b, c, theta, phi)
    small = wavenumber[:, None] * smaller < MINIMUM_KA
    power = np.abs(amplitude) ** 2
    concerned, whole = float(power[small].sum()), float(power.sum())
    if whole > 0 and concerned > _WARN_SHARE * whole:
        least = float((wavenumber[:, None] * smaller)[small].min())
        warnings.warn(
            f"{concerned / whole:.0%} of the echo power is from places whose wavenumber times radius of curvature is below "
            f"{MINIMUM_KA:g}, down to {least:.3g}, where optics is off by decibels; rtradar.rcs.sphere(method='mie') is exact",
            ValidityWarning,
            stacklevel=stacklevel + 1,
        )
