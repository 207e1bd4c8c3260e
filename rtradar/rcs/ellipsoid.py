"""Radar cross-section of a perfectly conducting ellipsoid by geometric optics."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def ellipsoid(
    a: ArrayLike, b: ArrayLike, c: ArrayLike, theta: ArrayLike, phi: ArrayLike
) -> NDArray[np.float64]:
    """Monostatic radar cross-section of a conducting ellipsoid, far away, by geometric optics.

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
        Cross-section [m^2], pi R1 R2 with the principal radii of curvature at the specular point.

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

    Equation :eq:`rcs-ellipsoid` of the theory page.
    """
    a, b, c, theta, phi = (np.asarray(value, dtype=np.float64) for value in (a, b, c, theta, phi))
    if not all((axis > 0).all() for axis in (a, b, c)):
        raise ValueError("rcs.ellipsoid: semi-axes must be positive [m]")
    sine = np.sin(theta)
    # Scaled by the largest axis: squares of squares of tiny or huge axes would leave the range of
    # float64.
    largest = np.maximum(np.maximum(a, b), c)
    a, b, c = a / largest, b / largest, c / largest
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
    a, b, c, theta, phi : array_like
        Arguments of `ellipsoid`.

    Returns
    -------
    smaller, larger : ndarray of float64
        Radii [m]. Both optics need the wavenumber times the smaller one well above 1.

    Notes
    -----
    The inverse of the shape operator on the tangent plane is the Hessian of the support function
    h(n) = sqrt(n . A^2 n); its trace and determinant there are (tr A^2 - n.A^4 n / h^2) / h and
    (abc)^2 / h^4.

    Equation :eq:`radii` of the theory page.
    """
    a, b, c, theta, phi = np.broadcast_arrays(
        *(np.asarray(value, dtype=np.float64) for value in (a, b, c, theta, phi))
    )
    squares = np.stack([a, b, c], axis=-1) ** 2
    normal = np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )
    h = np.sqrt((squares * normal**2).sum(-1))
    mean = (squares.sum(-1) - (squares**2 * normal**2).sum(-1) / h**2) / h / 2
    product = squares.prod(-1) / h**4
    spread = np.sqrt(np.maximum(mean**2 - product, 0.0))
    # The larger root is the sum, free of cancellation; the smaller follows from the product.
    return product / (mean + spread), mean + spread
