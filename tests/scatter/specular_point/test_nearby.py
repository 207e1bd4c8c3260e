"""Echoes from specular points that are nearly known, held against the shortest path over the ellipsoid."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from rtradar.scatter.common.polarization import copolar
from rtradar.scatter.specular_point.nearby import Nearby, nearby_echoes
from rtradar.scatter.specular_point.solver import mirror

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
    body = CENTRE[None, None], FRAME[None, None], AXES[None]
    length, amplitude, known = (
        np.empty((1, len(RX), 1)),
        np.empty((1, len(RX), 1)),
        np.zeros((1, 1), dtype=bool),
    )
    antennas = TX[None, None], np.ascontiguousarray(RX.T)[None, None], middle[None, None]
    nearby_echoes(*antennas, zero, zero, zero, zero, *body, start, length, amplitude, known)
    assert known.all()  # else it would be found again, eight times as slowly
    assert length[0, :, 0] == pytest.approx([shortest(rx)[0] for rx in RX], abs=1e-6)
    _, returned, points = mirror(TX[None], RX[None], *body, polarization="v", points=True)
    ways = TX - points[0, :, 0], RX - points[0, :, 0]
    # All receivers are given the curvature at the specular point of their middle.
    assert amplitude[0, :, 0] == pytest.approx(returned[0, :, 0] / copolar(*ways, "v"), rel=0.025)
    assert amplitude[0, 3:5, 0].mean() == pytest.approx(
        (returned[0, :, 0] / copolar(*ways, "v"))[3:5].mean(), rel=0.005
    )
