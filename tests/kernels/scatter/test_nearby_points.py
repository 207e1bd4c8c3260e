"""Echoes over specular points that are nearly known, against the plain reference."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from references.specular_point import bisected, nearby_echoes_reference
from rtradar.kernels.scatter.nearby_points import Ellipsoids, Images, nearby_echoes
from rtradar.kernels.scatter.specular_point import Geometry

Array = NDArray[np.float64]

TX = np.array([0.0, -0.2, 1.0])
RX = np.array([0.0, 1.5, 0.8]) + np.linspace(-0.1, 0.1, 8)[:, None] * [0.0, 1.0, 0.0]
MIDDLE = RX.mean(axis=0)
BODY = Ellipsoids(
    np.array([[[3.5, 0.4, 1.1]]]),
    Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()[None, None],
    np.array([[0.11, 0.07, 0.24]]),
)
POINT = bisected(Geometry(TX[None], MIDDLE[None, None], *BODY))[0][0, 0, 0]
"""Specular point for the middle of the receivers, in the axes of the part."""


def nearby(start: Array, *wanted: bool) -> tuple[int, Array, Array]:
    """Number of searches, and lengths and returns (2, rx, echo), found and expected."""
    near = (start * np.array(wanted)[:, None])[None].astype(np.float32)
    zero, each = np.zeros(1, dtype=np.int64), np.zeros(len(wanted), dtype=np.int64)
    antennas = TX[None, None], np.ascontiguousarray(RX.T)[None, None], MIDDLE[None, None]
    images = Images(*antennas, each, each, each)
    out = np.empty((2, 1, len(RX), len(wanted)))
    searched = nearby_echoes(0, 1, images, zero, BODY, near, *out)
    return searched, out[:, 0], np.array(nearby_echoes_reference(images, zero, BODY))[:, 0]


@pytest.mark.parametrize("off", [[0, 0, 0], [0.01, 0, 0], [0, -0.01, 0.02], [-0.01, 0.01, -0.02]])
def test_a_start_beside_the_specular_point_leads_to_it(off: list[float]) -> None:
    # None is searched for, which would take eight times as long.
    searched, (length, amplitude), expected = nearby(POINT + off, True)
    assert searched == 0
    np.testing.assert_allclose(length, expected[0], rtol=0, atol=1e-6)
    # All receivers are given the curvature at the specular point of their middle.
    np.testing.assert_allclose(amplitude, expected[1], rtol=0.025)
    assert amplitude[3:5].mean() == pytest.approx(expected[1, 3:5].mean(), rel=0.005)


def test_what_does_not_settle_is_searched_for_and_what_is_not_wanted_returns_nothing() -> None:
    # The start is on the far side of the body, and the second echo is not wanted.
    searched, (length, amplitude), expected = nearby(-POINT, True, False)
    assert searched == 1
    np.testing.assert_allclose(length[:, 0], expected[0, :, 0], rtol=1e-13)
    np.testing.assert_allclose(amplitude[:, 0], expected[1, :, 0], rtol=1e-6)
    over_centre = sum(np.linalg.norm(place - BODY.centres[0, 0]) for place in (TX, MIDDLE))
    np.testing.assert_allclose(length[:, 1], over_centre, rtol=1e-13)
    assert not amplitude[:, 1].any()
