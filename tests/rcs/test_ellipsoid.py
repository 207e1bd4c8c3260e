"""The cross-section of an ellipsoid: against curvature, symmetry, and limits known otherwise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtradar.rcs import ellipsoid, ellipsoid_radii

axis = st.floats(1e-3, 10.0)
theta = st.floats(0.0, np.pi)
phi = st.floats(-np.pi, np.pi)


@given(axis, theta, phi)
def test_a_sphere_is_its_disc(a: float, theta: float, phi: float) -> None:
    np.testing.assert_allclose(ellipsoid(a, a, a, theta, phi), np.pi * a**2, rtol=1e-13)


@given(st.tuples(*[st.floats(0.03, 1.0)] * 3), theta, phi)
def test_it_is_pi_times_both_radii_of_curvature(
    axes: tuple[float, float, float], theta: float, phi: float
) -> None:
    normal = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    squares = np.square(axes)
    point = squares * normal / np.sqrt(normal @ (squares * normal))
    # Shape operator of |A^-1 p| = 1 on its tangent plane: the curvatures are its eigenvalues, 0
    # belongs to the normal.
    across = np.eye(3) - np.outer(normal, normal)
    shape = across @ np.diag(1 / squares) @ across / np.linalg.norm(point / squares)
    curvatures = np.linalg.eigvalsh(shape)[1:]
    # Curvatures differ by up to (1/0.03)^3, and where both are alike the quadratic keeps half of
    # the digits.
    np.testing.assert_allclose(ellipsoid_radii(*axes, theta, phi), 1 / curvatures[::-1], rtol=1e-5)
    np.testing.assert_allclose(ellipsoid(*axes, theta, phi), np.pi / np.prod(curvatures), rtol=1e-8)


@given(axis, axis, axis, theta, phi, st.floats(1e-100, 1e100))
def test_it_grows_with_the_square_of_the_size(
    a: float, b: float, c: float, theta: float, phi: float, size: float
) -> None:
    # 1e-100 m squared four times would leave the range of float64: the code must scale before.
    grown = ellipsoid(a * size, b * size, c * size, theta, phi)
    np.testing.assert_allclose(grown, ellipsoid(a, b, c, theta, phi) * size * size, rtol=1e-11)


def test_everything_broadcasts() -> None:
    shape = ellipsoid(np.ones((4, 1)), 2.0, 3.0, np.zeros(5), 0.0).shape
    assert shape == (4, 5)
    assert [
        radius.shape for radius in ellipsoid_radii(np.ones((4, 1)), 2.0, 3.0, np.zeros(5), 0.0)
    ] == [(4, 5), (4, 5)]


@pytest.mark.parametrize("axes", [(0.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, np.nan)])
def test_an_axis_must_be_positive(axes: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="positive"):
        ellipsoid(*axes, 0.0, 0.0)
