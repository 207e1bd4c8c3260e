"""Specular points against the shortest path over the ellipsoid, and against plain references."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from references.specular_point import nearby_echoes_reference
from rtradar.kernels.scatter.nearby_points import Ellipsoids, Images, Nearby, nearby_echoes

Array = NDArray[np.float64]

AXES = np.array([0.11, 0.07, 0.24])
CENTRE = np.array([3.5, 0.4, 1.1])
FRAME = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
TX = np.array([0.0, -0.2, 1.0])
RX = np.array([0.0, 1.5, 0.8]) + np.linspace(-0.1, 0.1, 8)[:, None] * [0.0, 1.0, 0.0]


def shortest(rx: Array) -> tuple[float, Array]:
    """Length over the surface, and the point in the axes of the part [m]."""

    def length(angles: Array) -> float:
        point = on_surface(angles)
        return float(np.linalg.norm(TX - point) + np.linalg.norm(rx - point))

    def on_surface(angles: Array) -> Array:
        return np.asarray(CENTRE + FRAME @ local(angles))

    def local(angles: Array) -> Array:
        theta, phi = angles
        return AXES * [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]

    towards = FRAME.T @ ((TX + rx) / 2 - CENTRE) / AXES
    towards /= np.linalg.norm(towards)
    begin = [np.arccos(towards[2]), np.arctan2(towards[1], towards[0])]
    found = minimize(
        length,
        begin,
        method="Nelder-Mead",
        options={"xatol": 1e-8, "fatol": 1e-14, "maxiter": 4000},
    )
    return found.fun, local(found.x)


@pytest.mark.parametrize("off", [[0, 0, 0], [0.01, 0, 0], [0, -0.01, 0.02], [-0.01, 0.01, -0.02]])
def test_a_start_beside_the_specular_point_leads_to_it(off: list[float]) -> None:
    middle = RX.mean(axis=0)
    near = np.broadcast_to((shortest(middle)[1] + off).astype(np.float32), (1, 1, 2, 1, 3)).copy()
    wanted = np.ones((1, 1, 1), dtype=bool)
    zero = np.zeros(1, dtype=np.int64)
    start = Nearby(near, near, wanted, zero, zero, np.zeros(1), np.array([[1.0, 0.0]]))
    body = Ellipsoids(CENTRE[None, None], FRAME[None, None], AXES[None])
    length, amplitude = np.empty((1, len(RX), 1)), np.empty((1, len(RX), 1))
    antennas = TX[None, None], np.ascontiguousarray(RX.T)[None, None], middle[None, None]
    images = Images(*antennas, zero, zero, zero)
    # None is searched for, which would take eight times as long.
    assert nearby_echoes(0, 1, images, zero, body, start, length, amplitude) == 0
    assert length[0, :, 0] == pytest.approx([shortest(rx)[0] for rx in RX], abs=1e-6)
    expected = nearby_echoes_reference(images, zero, body)
    np.testing.assert_allclose(length, expected[0], rtol=0, atol=1e-6)
    # All receivers are given the curvature at the specular point of their middle.
    np.testing.assert_allclose(amplitude, expected[1], rtol=0.025)
    assert amplitude[0, 3:5].mean() == pytest.approx(expected[1][0, 3:5].mean(), rel=0.005)


def test_what_does_not_settle_is_searched_for_and_what_is_not_wanted_returns_nothing() -> None:
    # The first start is on the far side of the body, the second echo is not wanted.
    near = np.zeros((1, 1, 2, 2, 3), dtype=np.float32)
    near[..., :] = -shortest(RX.mean(axis=0))[1]
    wanted, zero, two = np.array([[[True, False]]]), np.zeros(1, dtype=np.int64), np.zeros(2, int)
    start = Nearby(near, near, wanted, zero, zero, np.zeros(1), np.array([[1.0, 0.0]]))
    body = Ellipsoids(CENTRE[None, None], FRAME[None, None], AXES[None])
    antennas = TX[None, None], np.ascontiguousarray(RX.T)[None, None], RX.mean(axis=0)[None, None]
    images = Images(*antennas, two, two, two)
    length, amplitude = np.empty((1, len(RX), 2)), np.empty((1, len(RX), 2))
    assert nearby_echoes(0, 1, images, zero, body, start, length, amplitude) == 1
    expected = nearby_echoes_reference(images, zero, body)
    np.testing.assert_allclose(length[..., 0], expected[0][..., 0], rtol=1e-13)
    np.testing.assert_allclose(amplitude[..., 0], expected[1][..., 0], rtol=1e-6)
    over_centre = np.linalg.norm(TX - CENTRE) + np.linalg.norm(RX.mean(axis=0) - CENTRE)
    np.testing.assert_allclose(length[..., 1], over_centre, rtol=1e-13)
    assert not amplitude[..., 1].any()
