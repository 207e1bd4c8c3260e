"""Compiled Fresnel zones against their plain references."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.kernels.scatter.fresnel_zones import (
    CELLS,
    MERIDIANS,
    RIM,
    Edges,
    ZoneMaps,
    blend_fractions,
    blend_fractions_reference,
    lay_zones,
    lay_zones_reference,
    open_fractions,
    open_fractions_reference,
    zone_points,
    zone_points_reference,
    zone_sums,
    zone_sums_reference,
)
from rtradar.kernels.scatter.specular_point import Geometry
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
def test_a_zone_is_laid_as_by_the_reference(seed: int) -> None:
    zone = Zone(seed)
    tangents = lay_zones_reference(*zone.given, WAVENUMBER)
    ours = zone.maps.along[0] @ zone.maps.stretch[0].T
    np.testing.assert_allclose(ours, tangents, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_points_are_lit_and_on_the_surface_and_circles_are_fresnel_zones(seed: int) -> None:
    zone, rng = Zone(seed), np.random.default_rng(seed)
    m, part = rng.integers(MERIDIANS, size=200), np.sqrt(rng.uniform(size=200))
    rho, angle = part * zone.maps.rim[0, m], m * 2 * np.pi / MERIDIANS
    where = np.zeros(200, dtype=np.int64), rho * np.cos(angle), rho * np.sin(angle)
    points = np.empty((200, 3))
    zone_points(zone.maps, *where, points)
    np.testing.assert_allclose(points, zone_points_reference(zone.maps, *where), rtol=1e-12)
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


@pytest.mark.parametrize("bands", [3, 12, 48])
@pytest.mark.parametrize("distance", [0.3, 1.7, -2.6])
def test_a_straight_edge_opens_what_lies_on_one_side(bands: int, distance: float) -> None:
    maps = ZoneMaps.empty(1)
    maps.rim[0] = np.random.default_rng(0).uniform(5, 7, MERIDIANS)
    a, b, c = np.cos(0.4), np.sin(0.4), distance
    rho = maps.rim[0, :, None] * np.arange(bands + 1) / bands
    corners = rho * np.exp(2j * np.pi * np.arange(MERIDIANS)[:, None] / MERIDIANS)

    def value(place: NDArray[np.complex128]) -> Array:
        return a * place.real + b * place.imag + c

    def crossing(first: NDArray[np.complex128], last: NDArray[np.complex128]) -> Array:
        """Where the edge crosses a side, or somewhere if it does not."""
        with np.errstate(divide="ignore", invalid="ignore"):
            place = first + (last - first) * (value(first) / (value(first) - value(last)))
        return np.stack([place.real, place.imag], axis=-1)[None, None]

    edges = Edges(
        (value(corners) < 0)[None, None],
        crossing(corners[:, :-1], corners[:, 1:]),
        crossing(corners, np.roll(corners, -1, axis=0)),
    )
    found = np.empty((1, 1, MERIDIANS, CELLS))
    open_fractions(maps, edges, found)
    # The reference counts places; cells next to the specular point are far from parallelograms.
    counted = open_fractions_reference(maps.rim[0], (a, b, c))
    np.testing.assert_allclose(found[0, 0], counted, atol=0.06)
    assert 0.1 < (found == 1).mean() < 0.9


def test_sums_are_those_of_the_reference() -> None:
    zone, rng = Zone(3), np.random.default_rng(3)
    antennas = np.stack([zone.tx, zone.rx, zone.tx + 0.1])
    pairs = np.array([[0, 1], [2, 1]])
    fractions = np.clip(rng.uniform(-0.5, 1.5, (1, 3, MERIDIANS, CELLS)), 0, 1)
    found = np.empty((1, 2, 2), dtype=np.complex128)
    wavenumber = np.array([[WAVENUMBER, 1.1 * WAVENUMBER]])
    zone_sums(
        0, 1, zone.maps, zone.point[None], antennas[None], pairs, wavenumber, fractions, found
    )
    for f in range(2):
        given = antennas, pairs, wavenumber[0, f], fractions[0]
        expected = zone_sums_reference(zone.maps, 0, *given)
        # Rounding of some 1000 terms, over a free sum of a hundredth of their size.
        np.testing.assert_allclose(found[0, f], expected, rtol=1e-9)


def test_blends_are_those_of_the_reference() -> None:
    rng = np.random.default_rng(4)
    nodes, slopes = rng.normal(size=(2, 5, 2, 3, 4, 2)) @ [1, 1j]
    fine, where = np.array([True, False, True, False]), np.sort(rng.uniform(0, 4, 7))
    spread = rng.normal(size=(7, 2, 3))
    found = np.empty((2, 7, 2, 4), dtype=np.complex128)
    blend_fractions(nodes, slopes, fine, where, spread, np.arange(7), found)
    expected = blend_fractions_reference(nodes, slopes, fine, where, spread)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
