"""What rays meet on a posed body, against closed forms of ellipsoids, on each backend here."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from rtradar.body import Ellipsoids
from rtradar.trace.backends.backend import Backend, use
from rtradar.trace.bounces import BodySurfaces

Array = NDArray[np.float64]
CHEST = np.array([0.0, 0.0, 1.0])
# The triangles' middles lie 0.03 % of the radius inside a sphere and their corners 0.07 % outside;
# alike for each semi-axis.
SAGITTA = 8e-4


class Hits(NamedTuple):
    """Part (ray,) met first, -1 for none, and distance (ray,) [m]."""

    part: NDArray[np.int64]
    distance: Array


def first_hits(backend: Backend, body: Ellipsoids, origins: ArrayLike, targets: ArrayLike) -> Hits:
    surfaces = BodySurfaces(use(backend), body.semi_axes)
    surfaces.pose(body.centres, body.frames)
    return through(surfaces, np.asarray(origins, float), np.asarray(targets, float))


def through(surfaces: BodySurfaces, origins: Array, targets: Array) -> Hits:
    """What rays from origins through targets meet."""
    directions = targets - origins
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return Hits(*surfaces.first_parts(origins, directions))


def clearances(body: Ellipsoids, origins: Array, targets: Array) -> tuple[Array, Array]:
    """Distance to the first crossing, and the least |A^-1 p| - 1 along the ray, (ray, part)."""
    directions = targets - origins
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    o = np.einsum("pji,rpj->rpi", body.frames, origins[:, None] - body.centres) / body.semi_axes
    d = np.einsum("pji,rj->rpi", body.frames, directions / length) / body.semi_axes
    square, half = (d * d).sum(-1), (o * d).sum(-1)
    nearest = np.sqrt(np.maximum((o * o).sum(-1) - half**2 / square, 0))
    root = np.maximum(1 - nearest**2, 0) * square
    return np.where(nearest < 1, (-half - np.sqrt(root)) / square, np.inf), nearest - 1


@pytest.fixture
def crowd() -> Ellipsoids:
    rng = np.random.default_rng(0)
    centres = rng.uniform(-0.8, 0.8, (15, 3)) + CHEST
    return Ellipsoids(
        centres, Rotation.random(15, random_state=0).as_matrix(), rng.uniform(0.04, 0.25, (15, 3))
    )


def test_the_first_part_is_that_of_the_smooth_ellipsoids(
    backend: Backend, crowd: Ellipsoids
) -> None:
    rng = np.random.default_rng(1)
    origins = np.array([-4.0, 1.0, 1.0]) + rng.normal(0, 0.2, (3000, 3))
    targets = rng.uniform(-1, 1, (3000, 3)) + CHEST
    hits = first_hits(backend, crowd, origins, targets)
    distance, clearance = clearances(crowd, origins, targets)
    expected = np.where(np.isfinite(distance.min(axis=1)), distance.argmin(axis=1), -1)
    # Near an outline, or where two parts cross, triangles may answer otherwise than ellipsoids.
    first, second = np.sort(np.minimum(distance, 1e3), axis=1)[:, :2].T
    sure = (np.abs(clearance).min(axis=1) > 2 * SAGITTA) & (
        (second - first > 2e-3) | (expected < 0)
    )
    assert sure.mean() > 0.9
    np.testing.assert_array_equal(hits.part[sure], expected[sure])
    assert 0.2 < (expected >= 0).mean() < 0.9


def test_the_distance_is_that_to_the_ellipsoid(backend: Backend, crowd: Ellipsoids) -> None:
    rng = np.random.default_rng(2)
    origins = np.array([-4.0, 1.0, 1.0]) + rng.normal(0, 0.2, (500, 3))
    targets = crowd.centres[rng.integers(15, size=500)]
    hits = first_hits(backend, crowd, origins, targets)
    assert (hits.part >= 0).all()
    distance, _ = clearances(crowd, origins, targets)
    # Off the triangle onto the ellipsoid along its radius: a sagitta of the largest semi-axis,
    # times a grazing slope.
    exact = distance[np.arange(500), hits.part]
    np.testing.assert_allclose(hits.distance, exact, atol=20 * SAGITTA * 0.25)


def test_nothing_met_is_told(backend: Backend, crowd: Ellipsoids) -> None:
    origins = np.array([[-4.0, 1.0, 1.0], [-4.0, 1.0, 1.0], [5.0, 0.0, 1.0]])
    # Past the body, away from it, and from behind it outward.
    hits = first_hits(
        backend, crowd, origins, np.array([[0.0, 9.0, 1.0], [-9.0, 1.0, 1.0], [9.0, 0.0, 1.0]])
    )
    np.testing.assert_array_equal(hits.part, -1)
    assert np.isinf(hits.distance).all()


def test_the_ray_goes_through_its_target_and_beyond(backend: Backend) -> None:
    body = Ellipsoids([[0.0, 0, 0]], [np.eye(3)], [[0.1, 0.1, 0.1]])
    hits = first_hits(backend, body, [[-4.0, 0, 0]], [[-3.9, 0, 0]])
    assert hits.part[0] == 0
    assert hits.distance[0] == pytest.approx(
        3.9, abs=0.1 * SAGITTA
    )  # head-on: a corner or a middle of a triangle


def test_posed_again_it_is_as_posed_first(backend: Backend, crowd: Ellipsoids) -> None:
    rng = np.random.default_rng(3)
    origins, targets = np.tile([-4.0, 1.0, 1.0], (200, 1)), rng.uniform(-1, 1, (200, 3)) + CHEST
    surfaces = BodySurfaces(use(backend), crowd.semi_axes)
    surfaces.pose(crowd.centres + np.array([3.0, 1.0, 0.5]), crowd.frames[::-1])
    elsewhere = through(surfaces, origins, targets)
    surfaces.pose(crowd.centres, crowd.frames)
    again, fresh = through(surfaces, origins, targets), first_hits(backend, crowd, origins, targets)
    np.testing.assert_array_equal(again.part, fresh.part)
    np.testing.assert_array_equal(again.distance, fresh.distance)
    assert (elsewhere.part != fresh.part).any()


@pytest.mark.parametrize("distance", [0.3, 50.0, 1000.0])
def test_far_away_rays_lose_nothing(backend: Backend, distance: float) -> None:
    # 0.01 mm beside what the outline of the triangles can be at most.
    body = Ellipsoids([[distance + 0.1, 0, 0]], [np.eye(3)], [[0.1, 0.1, 0.1]])
    angle = np.linspace(0, 2 * np.pi, 100)[:-1]
    outline = np.arcsin(0.1 / (distance + 0.1))
    for sign, expected in ((-1, 0), (1, -1)):
        spread = np.tan(outline) * (1 + sign * (SAGITTA + 1e-4))
        targets = np.column_stack([np.ones(99), spread * np.cos(angle), spread * np.sin(angle)])
        hits = first_hits(backend, body, np.zeros((99, 3)), targets)
        np.testing.assert_array_equal(hits.part, expected)


def test_thin_needles_are_met(backend: Backend) -> None:
    frame = Rotation.random(random_state=1).as_matrix()
    body = Ellipsoids([[0.0, 0, 1]], [frame], [[0.003, 0.003, 0.3]])
    along = np.linspace(-0.29, 0.29, 50)[:, None] * frame[:, 2] + [0, 0, 1]
    hits = first_hits(backend, body, np.tile([-4.0, 1.0, 1.0], (50, 1)), along)
    np.testing.assert_array_equal(hits.part, 0)


def test_many_parts_keep_their_numbers(backend: Backend) -> None:
    # The parts are in a row: rays must meet what they aim at, however the scene orders its shapes.
    n = 130
    centres = np.column_stack([np.zeros(n), np.arange(n) * 0.3, np.ones(n)])
    body = Ellipsoids(centres, np.tile(np.eye(3), (n, 1, 1)), np.full((n, 3), 0.1))
    hits = first_hits(backend, body, centres - [4.0, 0, 0], centres)
    np.testing.assert_array_equal(hits.part, np.arange(n))


def test_no_rays_meet_nothing(backend: Backend, crowd: Ellipsoids) -> None:
    hits = first_hits(backend, crowd, np.empty((0, 3)), np.empty((0, 3)))
    assert hits.part.shape == hits.distance.shape == (0,)
