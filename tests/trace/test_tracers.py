"""Bodies of ellipsoids and meshes: Mitsuba's answers against closed forms in float64."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body import Body, Ellipsoids
from rtradar.body.body import Poses
from rtradar.scatter import build_model
from rtradar.trace.backend import Backend, use
from rtradar.trace.rays import Shapes
from rtradar.trace.tracers import BodyTracer, MeshTracer

Array = NDArray[np.float64]


CHEST = np.array([0.0, 0.0, 1.0])
# Nearer to an outline than this fraction of the radius, float32 decides.
EDGE = 1e-6


@pytest.fixture
def crowd() -> Ellipsoids:
    rng = np.random.default_rng(0)
    centres = rng.uniform(-0.8, 0.8, (15, 3)) + CHEST
    return Ellipsoids(
        centres, Rotation.random(15, random_state=0).as_matrix(), rng.uniform(0.04, 0.25, (15, 3))
    )


def distances(origins: Array, targets: Array, centres: Array, frames: Array, axes: Array) -> Array:
    """Least distance (line, part) of each line from each part's centre, as a unit sphere."""
    starts = np.einsum("pji,lpj->lpi", frames, origins[:, None] - centres) / axes
    lines = np.einsum("pji,lj->lpi", frames, targets - origins) / axes
    along = -np.sum(starts * lines, axis=2) / np.sum(lines * lines, axis=2)
    return np.linalg.norm(starts + np.clip(along, 0, 1)[..., None] * lines, axis=2)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_mitsuba_says_what_the_closed_form_says(
    seed: int, crowd: Ellipsoids, backend: Backend
) -> None:
    tracer = BodyTracer(use(backend), crowd.semi_axes)
    tracer.pose(crowd.centres, crowd.frames)
    rng = np.random.default_rng(seed)
    origins = np.array([-4.0, 0.5, 1.3]) + rng.uniform(-0.3, 0.3, (600, 3))
    targets, own = rng.uniform(-0.9, 0.9, (600, 3)) + CHEST, rng.integers(-1, 15, 600)
    least = distances(origins, targets, crowd.centres, crowd.frames, crowd.semi_axes)
    lines = np.flatnonzero(own >= 0)
    least[lines, own[lines]] = np.inf
    clear = np.abs(least.min(axis=1) - 1) > 1e-6  # float32 decides nearer to the surface
    seen = tracer.sees(origins, targets, own)
    assert 0.2 < seen.mean() < 0.9
    np.testing.assert_array_equal(seen[clear], (least.min(axis=1) > 1)[clear])


class BesideADisc:
    """A walker, and a vast thin disc that all lines of sight pass at 1.03 to 1.07 of its radius."""

    def __init__(self, body: Body) -> None:
        self._body, self.duration_s = body, body.duration_s
        self.part_names = (*body.part_names, "disc")
        self.semi_axes = np.concatenate([body.semi_axes, [[0.5, 100.0, 100.0]]])
        self.owner = np.zeros(len(self.semi_axes), dtype=np.int64)

    def at(self, times: Array) -> Poses:
        poses = self._body.at(times)
        n = len(poses.centres)
        centres = np.broadcast_to([-2.0, 105.0, 0.0], (n, 1, 3))
        frames = np.broadcast_to(np.eye(3), (n, 1, 3, 3))
        return Poses(
            np.concatenate([poses.centres, centres], axis=1),
            np.concatenate([poses.frames, frames], axis=1),
            self.semi_axes,
        )


@pytest.mark.parametrize(
    ("fidelity", "options"),
    [
        ("specular", {}),
        ("specular", {"visibility": "gradual"}),
        ("physical-optics", {"facets": 320}),
        ("reference", {"facets": 320}),
        ("auto", {}),
        ("rays", {"rays_per_wavelength": 0.5}),
    ],
)
def test_the_tracer_decides(
    fidelity: str, options: dict[str, Any], backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disc beside all lines of sight occludes nothing, but everything once every ray hits."""
    walker = Body.from_motion(rt.synthetic_motion("walk", seed=0))
    # The disc would take minutes of tubes, or of rays along its edge; the parts next to each hide
    # some of it, too.
    without = fidelity == "rays" or "visibility" in options
    body = walker if without else BesideADisc(walker)
    radar = rt.Radar(name="small", tx_y=1, tx_z=0, rx_y=1, rx_z=0, samples_per_chirp=64)

    def power() -> Array:
        model = build_model(fidelity, radar, body, variant=backend.kind, **options)  # type: ignore[arg-type]
        echoes = model.echoes(np.arange(2))
        each = (np.abs(echoes.amplitude) ** 2).sum(axis=(0, 1, 2))
        return np.bincount(echoes.part, each, len(body.part_names))[:-1]

    before = power()
    assert (before > 0).sum() > 15

    def every_ray_hits(_: Shapes, rays: NDArray[np.float32]) -> NDArray[np.bool_]:
        return np.ones(rays.shape[1], dtype=bool)

    monkeypatch.setattr(Shapes, "any_met", every_ray_hits)
    if without:
        assert (power() != before).sum() > 15
    else:
        np.testing.assert_array_equal(power(), 0)


# -- what rays meet first -------------------------------------------------------------------------


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
    np.testing.assert_array_equal(np.isinf(hits.distance), hits.part < 0)
    assert (first_hits(backend, crowd, origins, 2 * origins - targets).part == -1).all()  # behind


def test_the_distance_is_that_to_the_ellipsoid(backend: Backend, crowd: Ellipsoids) -> None:
    rng = np.random.default_rng(2)
    origins = np.array([-4.0, 1.0, 1.0]) + rng.normal(0, 0.2, (500, 3))
    targets = crowd.centres[rng.integers(15, size=500)]
    hits = first_hits(backend, crowd, origins, targets)
    assert (hits.part >= 0).all()
    distance, _ = clearances(crowd, origins, targets)
    exact = distance[np.arange(500), hits.part]
    np.testing.assert_allclose(hits.distance, exact, rtol=1e-13)


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


# -- bounces --------------------------------------------------------------------------------------

# Face 0 in the plane x = 0, face 1 in y = 0, face 2 parallel to face 0, half a metre behind it.
VERTICES = np.array(
    [[0, 0, -1], [0, 2, 0], [0, 0, 1], [2, 0, 0], [-0.5, 0, -1], [-0.5, 2, 0], [-0.5, 0, 1.0]]
)
FACES = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6]])


def body(backend: Backend) -> BodyTracer:
    surfaces = BodyTracer(use(backend), np.array([[0.1, 0.1, 0.3], [0.2, 0.1, 0.1]]))
    frames = np.stack([np.eye(3), Rotation.from_euler("z", 30, degrees=True).as_matrix()])
    surfaces.pose(np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), frames)
    return surfaces


def mesh(backend: Backend) -> MeshTracer:
    return MeshTracer(use(backend), VERTICES[FACES])


def rows(*vectors: object) -> Array:
    return np.array(vectors, dtype=float)


def test_a_ray_that_leaves_a_part_meets_the_other_and_not_its_own(backend: Backend) -> None:
    surfaces = body(backend)
    # Along the tangent too.
    points, normals = (
        rows([0, 0.1, 0], [0, 0.1, 0], [0.1, 0, 0]),
        rows([0, 1, 0], [0, 1, 0], [1, 0, 0]),
    )
    directions = rows([0, 1, 0], [1, 0, 0], [1, 0, 0])
    met, distance = surfaces.meets(points, normals, directions, np.zeros(3, dtype=np.int64))
    np.testing.assert_array_equal(met, [1, -1, -1])
    exact = surfaces.distance(np.array([1]), points[:1], directions[:1])
    # In its own axes the ray is (sin 30, cos 30): 1 m less the radius of the ellipse in that
    # direction, less 0.1 m.
    radius = 1 / np.hypot(np.sin(np.pi / 6) / 0.2, np.cos(np.pi / 6) / 0.1)
    np.testing.assert_allclose(exact, 0.9 - radius, rtol=1e-13)
    np.testing.assert_array_equal(distance[:1], exact)


def test_places_on_a_part_are_exact_and_normals_point_outward(backend: Backend) -> None:
    surfaces = body(backend)
    rng = np.random.default_rng(0)
    origins = rng.normal(size=(20, 4, 3))
    origins *= 3 / np.linalg.norm(origins, axis=-1, keepdims=True)
    directions = -origins / 3 + rng.normal(0, 0.01, origins.shape)
    part = np.zeros((20, 4), dtype=np.int64)
    distance = surfaces.distance(part, origins, directions)
    places = origins + distance[..., None] * directions
    np.testing.assert_allclose(((places / [0.1, 0.1, 0.3]) ** 2).sum(-1), 1, rtol=1e-12)
    normals = surfaces.normal(part, places, directions)
    gradient = places / np.array([0.1, 0.1, 0.3]) ** 2
    np.testing.assert_allclose(
        normals, gradient / np.linalg.norm(gradient, axis=-1, keepdims=True), atol=1e-12
    )
    assert np.isnan(surfaces.distance(np.array([0]), rows([1, 0, 0]), rows([0, 1, 0])))


def test_faces_keep_their_numbers_and_their_planes_have_no_border(backend: Backend) -> None:
    surfaces = mesh(backend)
    points, normals = (
        rows([1, 0, 0.1], [1, 0, 0.1], [1, 0, 0.1]),
        rows([0, 1, 0], [0, 1, 0], [0, -1, 0]),
    )
    directions = rows([-1, 1, 0], [-1, 5, 0], [-1, -1, 0]) / np.sqrt([[2], [26], [2]])
    met, distance = surfaces.meets(points, normals, directions, np.ones(3, dtype=np.int64))
    np.testing.assert_array_equal(met, [0, -1, -1])
    assert distance[0] == pytest.approx(np.sqrt(2), abs=1e-4)
    assert np.isinf(distance[1:]).all()
    exact = surfaces.distance(np.array([0, 0, 0]), points, directions)
    np.testing.assert_allclose(exact, np.sqrt([2, 26, 2]), rtol=1e-14)


def test_normals_of_a_sheet_face_the_ray(backend: Backend) -> None:
    surfaces = mesh(backend)
    normals = surfaces.normal(np.array([0, 0]), np.zeros((2, 3)), rows([1, 0, 0], [-1, 0, 0]))
    np.testing.assert_array_equal(normals, rows([-1, 0, 0], [1, 0, 0]))


@pytest.mark.parametrize("far", [4.0, 1000.0, 1e6])
def test_a_face_hides_what_is_behind_it_however_far_the_antenna(
    backend: Backend, far: float
) -> None:
    surfaces = mesh(backend)
    points = rows([0, 1, 0], [-0.5, 1, 0], [-0.5, 1, 0])
    antennas = rows([far, 1, 0], [far, 1, 0], [-far, 1, 0])
    np.testing.assert_array_equal(
        surfaces.sees(antennas, points, np.array([0, 2, 2])), [True, False, True]
    )


def test_no_rays_meet_nothing(backend: Backend) -> None:
    none, nowhere = np.empty((0, 3)), np.empty(0, dtype=np.int64)
    for surfaces in (body(backend), mesh(backend)):
        assert surfaces.sees(none, none, nowhere).shape == (0,)
        met, distance = surfaces.meets(none, none, none, nowhere)
        assert met.shape == distance.shape == (0,)
