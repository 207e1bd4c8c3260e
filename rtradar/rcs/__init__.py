"""Closed forms of scattering by conductors, the reference: ellipsoids by geometric optics, spheres.

Nothing here uses rays, meshes or echo models.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import jv, yv

from rtradar.conventions import SPEED_OF_LIGHT_MPS

__all__ = ["ellipsoid", "ellipsoid_radii", "sphere"]


def ellipsoid(
    a: ArrayLike, b: ArrayLike, c: ArrayLike, theta: ArrayLike, phi: ArrayLike
) -> NDArray[np.float64]:
    """Monostatic radar cross-section of a conducting ellipsoid, far away (:eq:`rcs-ellipsoid`).

    Parameters
    ----------
    a, b, c : array_like
        Semi-axes [m]; all five arguments broadcast.
    theta : array_like
        Angle of the line of sight from the c axis [rad].
    phi : array_like
        Angle of its projection from the a axis [rad].

    Returns
    -------
    ndarray of float64
        Cross-section [m^2] by geometric optics, pi R1 R2 with the principal radii of curvature at
        the specular point.

    Raises
    ------
    ValueError
        Where a semi-axis is not positive.

    Notes
    -----
    pi a^2 b^2 c^2 / (a^2 sin^2(theta) cos^2(phi) + b^2 sin^2(theta) sin^2(phi) + c^2
    cos^2(theta))^2, from Mahafza, *Radar Systems Analysis and Design Using MATLAB*, eq. 2.39. Code
    published with the paper writes c cos^2(theta) in the denominator, whose unit does not fit and
    which is 14 to 26 dB low end-on.

    Examples
    --------
    Seen along the long axis c, from theta = 0, and across it:

    >>> import numpy as np
    >>> import rtradar as rt
    >>> np.round(rt.rcs.ellipsoid(0.1, 0.1, 0.3, theta=[0.0, np.pi / 2], phi=0.0), 4)
    array([0.0035, 0.2827])
    """
    a, b, c, theta, phi = (np.asarray(value, dtype=np.float64) for value in (a, b, c, theta, phi))
    if not all((axis > 0).all() for axis in (a, b, c)):
        raise ValueError("rcs.ellipsoid: semi-axes must be positive [m]")
    if np.isnan(theta).any() or np.isnan(phi).any():
        raise ValueError("rcs.ellipsoid: angles must be numbers [rad]")
    sine = np.sin(theta)
    # The axes are scaled by the largest, because fourth powers of tiny or huge axes would leave the
    # range of float64.
    largest = np.maximum(np.maximum(a, b), c)
    a, b, c = a / largest, b / largest, c / largest
    # The square of the support function h, for pi R1 R2 = pi (abc)^2 / h^4.
    support_squared = (
        (a * sine * np.cos(phi)) ** 2 + (b * sine * np.sin(phi)) ** 2 + (c * np.cos(theta)) ** 2
    )
    return np.asarray(np.pi * (largest * a * b * c / support_squared) ** 2)


def ellipsoid_radii(
    a: ArrayLike, b: ArrayLike, c: ArrayLike, theta: ArrayLike, phi: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute principal radii of curvature where the outward normal points along (theta, phi).

    Parameters
    ----------
    a, b, c : array_like
        Semi-axes [m]; all five arguments broadcast.
    theta, phi : array_like
        Angle of the normal from the c axis, and of its projection from the a axis [rad].

    Returns
    -------
    smaller, larger : ndarray of float64
        Radii [m]. Both optics need the wavenumber times the smaller one well above 1.

    Notes
    -----
    The inverse of the shape operator on the tangent plane is the Hessian of the support function
    h(n) = sqrt(n . A^2 n); its trace and determinant there are (tr A^2 - n.A^4 n / h^2) / h and
    (abc)^2 / h^4 (:eq:`radii`).
    """
    a, b, c, theta, phi = np.broadcast_arrays(
        *(np.asarray(value, dtype=np.float64) for value in (a, b, c, theta, phi))
    )
    squares = np.stack([a, b, c], axis=-1) ** 2
    normal = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )
    # Mean and product of the two radii; their difference follows from both.
    h = np.sqrt((squares * normal**2).sum(-1))
    mean = (squares.sum(-1) - (squares**2 * normal**2).sum(-1) / h**2) / h / 2
    product = squares.prod(-1) / h**4
    spread = np.sqrt(np.maximum(mean**2 - product, 0.0))
    # The larger root is the sum, free of cancellation; the smaller follows from the product.
    return product / (mean + spread), mean + spread


def sphere(
    radius: ArrayLike, frequency: ArrayLike, method: Literal["go", "po", "mie"] = "mie"
) -> NDArray[np.complex128]:
    """Compute the monostatic far-field scattering length of a perfectly conducting sphere.

    The phase belongs to the path over the sphere's centre.

    Parameters
    ----------
    radius, frequency : array_like
        Radius of the sphere [m], and frequency of the wave [Hz]; the two broadcast.
    method : {"go", "po", "mie"}
        Geometric optics (:eq:`sphere-go`), physical optics, the closed form of its integral over
        the lit half (:eq:`sphere-po`), or Mie's exact series (:eq:`sphere-mie`).

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

    Examples
    --------
    >>> import rtradar as rt
    >>> for method in ("go", "po", "mie"):
    ...     print(method, f"{abs(rt.rcs.sphere(0.1, 12e9, method=method)) ** 2:.4f} m2")
    go 0.0314 m2
    po 0.0314 m2
    mie 0.0321 m2
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
        # exp(2jka) - 1 would cancel for small ka: expm1 keeps its digits.
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
    # Spherical Bessel functions without a factor that cancels in a_n and b_n. SciPy's own spherical
    # functions would start anew for each order.
    j, y = jv(orders + 0.5, ka), yv(orders + 0.5, ka)
    orders = orders[1:]
    # Derivatives by recurrence from the order below.
    dj, dy = j[:-1] - (orders + 1) / ka * j[1:], y[:-1] - (orders + 1) / ka * y[1:]
    j, y = j[1:], y[1:]
    # Y overflows at orders so high that their terms are negligible.
    known = np.isfinite(y) & np.isfinite(dy)
    orders, j, y, dj, dy = orders[known], j[known], y[known], dj[known], dy[known]
    a = (j + ka * dj) / (j + ka * dj - 1j * (y + ka * dy))
    b = j / (j - 1j * y)
    return complex(-1j * np.sum((-1.0) ** orders * (2 * orders + 1) * (a - b)))
