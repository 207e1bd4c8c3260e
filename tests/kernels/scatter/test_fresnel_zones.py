"""Points on Fresnel zones."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.kernels.scatter.zones.fresnel_zones import (
    MERIDIANS,
    RIM,
    ZoneMaps,
    lay_zones,
    zone_points,
)
from rtradar.scatter.specular_point.solver import solve_specular_points

Array = NDArray[np.float64]
WAVENUMBER = 2 * np.pi * 14e9 / 299_792_458.0


class Zone:
    """One zone on a random ellipsoid 4 m from the radar."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.axes = rng.uniform(0.03, 0.3, 3)
        self.frame = Rotation.random(random_state=seed).as_matrix()
        self.centre = rng.normal(0, 0.3, 3)
        self.tx = np.array([-4.0, 0.0, 0.0]) + rng.normal(0, 0.3, 3)
        self.rx = self.tx + rng.normal(0, 0.2, 3)
        pose = self.centre[None, None], self.frame[None, None], self.axes[None]
        length, _, point = solve_specular_points(
            Geometry(self.tx[None], self.rx[None, None], *pose), points=True
        )
        self.length, self.point = length[0, 0, 0], point[0, 0, 0]
        self.given = self.tx, self.rx, self.centre, self.frame, self.axes, self.point
        self.maps = ZoneMaps.empty(1)
        lay_zones(*(a[None] for a in self.given), np.array([WAVENUMBER]), self.maps)
        assert self.maps.exists.all()


@pytest.mark.parametrize("seed", range(5))
def test_points_are_lit_and_on_the_surface_and_circles_are_fresnel_zones(seed: int) -> None:
    zone, rng = Zone(seed), np.random.default_rng(seed)
    m, part = rng.integers(MERIDIANS, size=200), np.sqrt(rng.uniform(size=200))
    rho, angle = part * zone.maps.rim[0, m], m * 2 * np.pi / MERIDIANS
    where = np.zeros(200, dtype=np.int64), rho * np.cos(angle), rho * np.sin(angle)
    points = np.empty((200, 3))
    zone_points(zone.maps, *where, points)
    local = (points - zone.centre) @ zone.frame
    np.testing.assert_allclose(np.sum((local / zone.axes) ** 2, axis=1), 1, rtol=1e-9)
    normal = (local / zone.axes**2) @ zone.frame.T
    legs = [antenna - points for antenna in (zone.tx, zone.rx)]
    assert all((np.sum(normal * leg, axis=1) > -1e-9).all() for leg in legs)
    excess = sum(np.linalg.norm(leg, axis=1) for leg in legs) - zone.length
    assert (excess > -1e-12).all()
    # Circles of rho hold to second order; on a needle the great circles leave them by their third.
    inner = rho < 0.3
    np.testing.assert_allclose(WAVENUMBER * excess[inner], rho[inner] ** 2, rtol=0.1, atol=1e-3)
    assert np.median(WAVENUMBER * excess) < RIM**2
