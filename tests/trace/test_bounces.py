"""What rays meet between bounces, by Mitsuba with places in float64, on each backend here."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.trace.backend import Backend, use
from rtradar.trace.body_tracer import BodyTracer
from rtradar.trace.mesh_tracer import MeshTracer

Array = NDArray[np.float64]
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
