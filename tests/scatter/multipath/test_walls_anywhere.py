"""Walls that stand free, lean, have doorways, or are between the radar and the room."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

from rtradar.radar import Radar
from rtradar.scatter.echo_models import build_model
from rtradar.scatter.multipath.image_paths import Face, corners, wall_paths
from rtradar.scene import Surface, Wall, material, room_walls

SIDES = ("near", "far", "right", "left", "floor", "ceiling")
ROOM = room_walls(
    (5.5, 4.4, 2.5),
    (-3.0, -2.2),
    dict.fromkeys(SIDES, Surface(material=material("plasterboard"), thickness_m=0.0125)),
)
RADAR = Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0)
PARTITION = Wall(
    name="partition",
    corner_m=(-2.0, -20.0, -20.0),
    edge_u_m=(0.0, 40.0, 0.0),
    edge_v_m=(0.0, 0.0, 40.0),
    material=material("brick"),
    thickness_m=0.115,
)


@pytest.mark.parametrize("place", [(-4.0, 1.0, 1.0), (-4.0, -3.5, 1.0), (0.0, 0.3, 4.0)])
def test_from_outside_the_faces_listed_are_all_that_reflect(place: tuple[float, ...]) -> None:
    antenna = np.array(place)
    listed = {path.back for path in wall_paths(ROOM, antenna, 2) if not path.out}
    rng = np.random.default_rng(0)
    points = rng.uniform([-3, -2.2, 0], [2.5, 2.2, 2.5], (300, 3))
    faces = [Face(wall, back) for wall in ROOM for back in (False, True)]
    pairs = [pair for pair in product(faces, faces) if pair[0].wall is not pair[1].wall]
    found = {leg for leg in [*((face,) for face in faces), *pairs] if _valid(leg, antenna, points)}
    # Some reflect into the room, none of them from behind, and none is missing.
    assert found
    assert found <= listed
    assert not any(face.back for leg in found for face in leg)


def _valid(leg: Any, antenna: np.ndarray, points: np.ndarray) -> bool:
    return bool(corners(leg, antenna, points)[1].any())


def test_over_a_wall_that_is_not_parallel_to_others_an_echo_is_that_of_a_turned_radar(
    make: Any,
) -> None:
    # A mirror turned by 25 degrees about the vertical: v stays v. Its image of the radar by hand.
    turn = np.radians(25)
    along, normal = (
        np.array([np.cos(turn), np.sin(turn), 0]),
        np.array([np.sin(turn), -np.cos(turn), 0]),
    )
    corner = np.array([-20.0, 2.0, -10]) - 10 * along
    mirror = Wall(
        name="leaning",
        corner_m=tuple(corner),
        edge_u_m=tuple(60 * along),
        edge_v_m=(0.0, 0.0, 20.0),
        material=material("perfect-conductor"),
        thickness_m=0.01,
    )
    np.testing.assert_allclose(mirror.normal, normal, atol=1e-12)
    body = make.one((0.1, 0.1, 0.1), (0.0, 0.3, 1.2))
    model = make.room(RADAR, body, mirror, order=2)
    echoes = model.echoes(np.arange(1))
    index = model.path_names.index("leaning > body > leaning")
    middle = np.array(RADAR.position_m)
    image = middle - 2 * ((middle - corner) @ normal) * normal
    seen = replace(RADAR, position_m=tuple(image))
    alone = build_model("specular", seen, body).echoes(np.arange(1))
    assert echoes.length[0, 0, index] == pytest.approx(alone.length[0, 0, 0], abs=1e-12)
    assert echoes.amplitude[0, 0, 0, index] == pytest.approx(alone.amplitude[0, 0, 0, 0], rel=1e-5)


@pytest.mark.parametrize(("aside_m", "through"), [(0.0, True), (2.0, False)])
def test_a_person_is_seen_through_a_doorway_and_behind_the_wall_beside_it(
    aside_m: float, through: bool, make: Any
) -> None:
    # The leg from y = 1 to 0.6 meets the wall at 0.8 m, in the middle of a doorway 1.2 m wide.
    doorway = replace(PARTITION, openings=((20.2 - aside_m, 19.0, 1.2, 3.0),))
    body = make.one((0.1, 0.1, 0.1), (0.0, 0.6, 1.0))
    scenes = (), (PARTITION,), (doorway,)
    free, behind, got = (
        make.room(RADAR, body, *walls, order=0).echoes(np.arange(1)) for walls in scenes
    )
    expected = free if through else behind
    own = np.abs(got.amplitude[..., 0, :]).max(axis=0)
    want = np.abs(expected.amplitude[..., 0, :]).max(axis=0)
    np.testing.assert_allclose(own[own > 0], want[want > 0], rtol=1e-5)
