"""Walls in closed form: specular points by Fermat, slab coefficients by hand, energy."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.scatter.multipath import image_paths
from rtradar.scatter.multipath import slabs as rw
from rtradar.scatter.multipath.slabs import WHOLE, whole_walls
from rtradar.scatter.multipath.wall_edges import WallEdges
from rtradar.scene import Scene, Wall, material, own_material

reflect, transmit = (partial(rw.after_slab, term=term) for term in WHOLE)

# A tilted front, so that no axis is special.
WALL = Wall(
    name="wall",
    corner_m=(1.0, -2.0, 0.0),
    edge_u_m=(0.6, 2.8, 0.0),
    edge_v_m=(0.0, 0.0, 2.5),
    material=material("plasterboard"),
    thickness_m=0.0125,
)
METAL = replace(WALL, name="metal", material=material("perfect-conductor"), thickness_m=0.01)
MIDDLE = WALL.corners.mean(axis=0)
coordinate = st.floats(-1.0, 1.0)


def wave(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    field = np.cross(direction, rng.normal(size=3)) + 1j * np.cross(direction, rng.normal(size=3))
    return direction, field


@pytest.mark.parametrize("back", [False, True])
def test_the_specular_point_is_the_shortest_way_over_the_face(back: bool) -> None:
    side = -1 if back else 1
    tx, rx = (
        MIDDLE + side * away * WALL.normal + [0.1 * away, 0.2, shift]
        for away, shift in ((1.5, 0.4), (0.7, -0.3))
    )
    point, valid = image_paths.specular_point(WALL, tx, rx, back=back)
    corner = WALL.corners[0] - (WALL.thickness_m if back else 0) * WALL.normal
    u, v = np.array(WALL.edge_u_m), np.array(WALL.edge_v_m)

    def way(fraction: np.ndarray) -> float:
        place = corner + fraction[0] * u + fraction[1] * v
        return float(np.linalg.norm(tx - place) + np.linalg.norm(rx - place))

    found = minimize(
        way, [0.5, 0.5], method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-15}
    )
    assert valid
    # The least way is known to 1e-15 m, its place to the root of that.
    np.testing.assert_allclose(point, corner + found.x[0] * u + found.x[1] * v, atol=1e-6)
    length = np.linalg.norm(image_paths.image(WALL, tx, back=back) - rx)
    np.testing.assert_allclose(length, found.fun, rtol=0, atol=1e-12)


def test_no_specular_point_on_the_other_side_or_beside_the_rectangle() -> None:
    before, behind = MIDDLE + WALL.normal, MIDDLE - WALL.normal
    up = np.array([0, 0, 6.0])
    _, valid = image_paths.specular_point(
        WALL, np.stack([before, behind, before]), np.stack([behind, behind, before + up])
    )
    np.testing.assert_array_equal(valid, [False, False, False])
    _, valid = image_paths.specular_point(
        WALL, np.stack([before, behind, before]), np.stack([before, behind, behind]), back=True
    )
    np.testing.assert_array_equal(valid, [False, True, False])


def test_legs_cross_where_they_end_on_both_sides_of_the_slab() -> None:
    before, behind, front = MIDDLE + WALL.normal, MIDDLE - WALL.normal, MIDDLE
    beside = np.array([0, 0, 6.0])
    origins = np.stack([before, behind, before, before, before + beside, behind])
    targets = np.stack([behind, before, before + 0.1, front, behind + beside, front])
    across, met = WallEdges([WALL], 0.02, 0.08).passage(0, origins, targets)
    np.testing.assert_array_equal(across, [True, True, False, False, False, True])
    # A metre from any edge is 12 zones of 8 cm: nothing is left of the edges at this resolution.
    np.testing.assert_array_equal(met, 1)


@given(seed=st.integers(0, 1000))
def test_a_conductor_turns_the_field_as_its_image(seed: int) -> None:
    direction, field = wave(seed)
    expected = 2 * (METAL.normal @ field) * METAL.normal - field
    np.testing.assert_allclose(reflect(METAL, field, direction, [14e9])[0], expected, atol=1e-12)
    np.testing.assert_array_equal(transmit(METAL, field, direction, [14e9])[0], 0)


def test_a_rough_wall_reflects_less_and_passes_as_much() -> None:
    direction, field = wave(0)
    rough = replace(WALL, roughness_m=1e-3)
    turn = 2 * np.pi * 14e9 / SPEED_OF_LIGHT_MPS * 1e-3 * (direction @ WALL.normal)
    for act, kept in ((reflect, np.exp(-2 * turn**2)), (transmit, 1.0)):
        smooth = act(WALL, field, direction, [14e9])
        np.testing.assert_allclose(act(rough, field, direction, [14e9]), kept * smooth, rtol=1e-12)


@given(seed=st.integers(0, 1000))
def test_a_wall_without_loss_keeps_the_energy(seed: int) -> None:
    glass = own_material("glass without loss", source="made up", low_hz=1e9, high_hz=1e11, a=6.0)
    wall = Wall(
        name="pane",
        corner_m=(0, 0, 0),
        edge_u_m=(0, 1, 0),
        edge_v_m=(0.6, 0, 0.8),
        material=glass,
        thickness_m=0.004,
    )
    direction, field = wave(seed)
    powers = [
        (np.abs(part) ** 2).sum(axis=-1)
        for part in (reflect(wall, field, direction, [12e9, 14e9]), field)
    ]
    powers.append((np.abs(transmit(wall, field, direction, [12e9, 14e9])) ** 2).sum(axis=-1))
    np.testing.assert_allclose(powers[0] + powers[2], powers[1], rtol=1e-12)


def test_walls_on_the_way_multiply_and_shapes_broadcast() -> None:
    second = replace(WALL, corner_m=(2.0, -2.0, 0.0), name="b")
    scene = Scene(walls=(WALL, second))
    origins = np.array([[-4.0, 0.0, 1.0], [-4.0, 0.3, 1.2]])
    targets = np.array([[0.0, 0.0, 1.0], [1.7, 0.0, 1.0], [6.0, 0.0, 1.0]])
    field, frequency = np.array([0.0, 0, 1.0]), np.array([12e9, 16e9])
    edges = WallEdges(scene.walls, 0.02, 0.08)
    walls = rw.WallResponse(edges, whole_walls(scene.walls), frequency)
    start = walls.start(np.broadcast_to(field, (2, 3, 3)))
    (wave,) = walls.transmitted(0, start, origins[:, None], targets)
    got = wave.field
    assert wave.passages == ()
    assert not wave.extra_m.any()
    assert got.shape == (2, 2, 3, 3)
    np.testing.assert_array_equal(got[:, :, 0], np.broadcast_to(field, (2, 2, 3)))
    for index, origin in enumerate(origins):
        for place, walls in ((1, (WALL,)), (2, (WALL, second))):
            way = (targets[place] - origin) / np.linalg.norm(targets[place] - origin)
            expected = np.broadcast_to(field, (2, 3))
            for wall in walls:
                expected = transmit(wall, expected, way, frequency)
            np.testing.assert_allclose(got[:, index, place], expected, rtol=1e-12)
