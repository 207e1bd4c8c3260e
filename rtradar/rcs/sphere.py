"""Scattering length of a conducting sphere: geometric optics, physical optics, Mie series."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import jv, yv

from rtradar.conventions import SPEED_OF_LIGHT_MPS


def sphere(
    radius: ArrayLike, frequency: ArrayLike, method: Literal["go", "po", "mie"] = "mie"
) -> NDArray[np.complex128]:
    """Compute the monostatic far-field scattering length of a perfectly conducting sphere.

    The phase belongs to the path over the sphere's centre.

    Parameters
    ----------
    radius : array_like
        Radius [m]; broadcasts with ``frequency``.
    frequency : array_like
        Frequency [Hz].
    method : {"go", "po", "mie"}
        Geometric optics: sqrt(pi) a exp(2jka). Physical optics: the closed form of its integral
        over the lit half. Mie: the exact series.

    Returns
    -------
    ndarray of complex128
        Scattering length F [m] for exp(+j omega t); ``|F|^2`` is the radar cross-section [m^2].

    Raises
    ------
    ValueError
        Where ``method`` is none of the three, or radius or frequency is not positive.

    Notes
    -----
    Mie series of a conductor: Harrington, *Time-Harmonic Electromagnetic Fields*, section 6-9.
    Physical optics: F = jk / sqrt(pi) times the integral of (n.s) exp(2jk s.r) over the lit half.

    Equations :eq:`sphere-go`, :eq:`sphere-po` and :eq:`sphere-mie` of the theory page.
    """
    radius, frequency = np.broadcast_arrays(
        np.asarray(radius, np.float64), np.asarray(frequency, np.float64)
    )
    if not ((radius > 0).all() and (frequency > 0).all()):
        raise ValueError("rcs.sphere: radius [m] and frequency [Hz] must be positive")
    k = 2 * np.pi * frequency / SPEED_OF_LIGHT_MPS
    ka = k * radius
    if method == "go":
        return np.asarray(np.sqrt(np.pi) * radius * np.exp(2j * ka))
    if method == "po":
        # 1/(4k^2) (exp(2jka) - 1) cancels for small ka: expm1 keeps its digits.
        integral = (
            2 * np.pi * (np.exp(2j * ka) * radius / (2j * k) + np.expm1(2j * ka) / (4 * k**2))
        )
        return np.asarray(1j * k / np.sqrt(np.pi) * integral)
    if method == "mie":
        series = np.array([_mie_backscatter(x) for x in ka.ravel()]).reshape(ka.shape)
        return np.asarray(np.sqrt(np.pi) / k * series)
    raise ValueError(f"rcs.sphere: method {method!r} is unknown; allowed: go, po, mie")


def _mie_backscatter(ka: float) -> complex:
    """Sum over n of -j (-1)^n (2n+1) (a_n - b_n) for exp(+j omega t).

    It tends to ka exp(2jka) for large ka.
    """
    # Wiscombe's count of terms that matter, with a margin.
    orders = np.arange(int(np.ceil(ka + 4.05 * ka ** (1 / 3) + 10)))
    # Spherical Bessel functions but for a factor that a_n and b_n do not know. SciPy's own walk up
    # to each order anew.
    j, y = jv(orders + 0.5, ka), yv(orders + 0.5, ka)
    orders = orders[1:]
    dj, dy = j[:-1] - (orders + 1) / ka * j[1:], y[:-1] - (orders + 1) / ka * y[1:]
    j, y = j[1:], y[1:]
    known = np.isfinite(y) & np.isfinite(dy)
    orders, j, y, dj, dy = orders[known], j[known], y[known], dj[known], dy[known]
    a = (j + ka * dj) / (j + ka * dj - 1j * (y + ka * dy))
    b = j / (j - 1j * y)
    return complex(-1j * np.sum((-1.0) ** orders * (2 * orders + 1) * (a - b)))
