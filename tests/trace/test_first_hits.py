"""What rays meet on a posed body, against closed forms of ellipsoids, on each backend here."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from rtradar.body import Ellipsoids
from rtradar.trace.backends.backend import Backend, use
from rtradar.trace.body_tracer import BodyTracer

Array = NDArray[np.float64]
CHEST = np.array([0.0, 0.0, 1.0])
# Nearer to an outline than this fraction of the radius, float32 decides.
EDGE = 1e-6


class Hits(NamedTuple):
    """Part (ray,) met first, -1 for none, and distance (ray,) [m]."""

    part: NDArray[np.int64]
    distance: Array


def first_hits(backend: Backend, body: Ellipsoids, origins: ArrayLike, targets: ArrayLike) -> Hits:
    tracer = BodyTracer(use(backend), body.semi_axes)
    tracer.pose(body.centres, body.frames)
    return through(tracer, np.asarray(origins, float), np.asarray(targets, float))


def through(tracer: BodyTracer, origins: Array, targets: Array) -> Hits:
    """What rays from origins through targets meet."""
    directions = targets - origins
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return Hits(*tracer.meets(origins, directions, directions, np.full(len(origins), -1)))


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
    sure = np.abs(clearance).min(axis=1) > EDGE
    assert sure.mean() > 0.99
    np.testing.assert_array_equal(hits.part[sure], expected[sure])
    assert 0.2 < (expected >= 0).mean() < 0.9


def test_the_distance_is_that_to_the_ellipsoid(backend: Backend, crowd: Ellipsoids) -> None:
    rng = np.random.default_rng(2)
    origins = np.array([-4.0, 1.0, 1.0]) + rng.normal(0, 0.2, (500, 3))
    targets = crowd.centres[rng.integers(15, size=500)]
    hits = first_hits(backend, crowd, origins, targets)
    assert (hits.part >= 0).all()
    distance, _ = clearances(crowd, origins, targets)
    exact = distance[np.arange(500), hits.part]
    np.testing.assert_allclose(hits.distance, exact, rtol=1e-13)


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
    assert hits.distance[0] == pytest.approx(3.9, rel=1e-14)


def test_posed_again_it_is_as_posed_first(backend: Backend, crowd: Ellipsoids) -> None:
    rng = np.random.default_rng(3)
    origins, targets = np.tile([-4.0, 1.0, 1.0], (200, 1)), rng.uniform(-1, 1, (200, 3)) + CHEST
    tracer = BodyTracer(use(backend), crowd.semi_axes)
    tracer.pose(crowd.centres + np.array([3.0, 1.0, 0.5]), crowd.frames[::-1])
    elsewhere = through(tracer, origins, targets)
    tracer.pose(crowd.centres, crowd.frames)
    again, fresh = through(tracer, origins, targets), first_hits(backend, crowd, origins, targets)
    np.testing.assert_array_equal(again.part, fresh.part)
    np.testing.assert_array_equal(again.distance, fresh.distance)
    assert (elsewhere.part != fresh.part).any()


@pytest.mark.parametrize("distance", [0.3, 50.0, 1000.0])
def test_far_away_rays_lose_nothing(backend: Backend, distance: float) -> None:
    # 0.01 mm beside the outline.
    body = Ellipsoids([[distance + 0.1, 0, 0]], [np.eye(3)], [[0.1, 0.1, 0.1]])
    angle = np.linspace(0, 2 * np.pi, 100)[:-1]
    outline = np.arcsin(0.1 / (distance + 0.1))
    for sign, expected in ((-1, 0), (1, -1)):
        spread = np.tan(outline) * (1 + sign * 1e-4)
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
    # The parts are in a row: rays must meet what they aim at.
    n = 130
    centres = np.column_stack([np.zeros(n), np.arange(n) * 0.3, np.ones(n)])
    body = Ellipsoids(centres, np.tile(np.eye(3), (n, 1, 1)), np.full((n, 3), 0.1))
    hits = first_hits(backend, body, centres - [4.0, 0, 0], centres)
    np.testing.assert_array_equal(hits.part, np.arange(n))


def test_no_rays_meet_nothing(backend: Backend, crowd: Ellipsoids) -> None:
    hits = first_hits(backend, crowd, np.empty((0, 3)), np.empty((0, 3)))
    assert hits.part.shape == hits.distance.shape == (0,)
