"""The built-in scenes are usable at 12 and 77 GHz, with room for the person and the radar."""

from __future__ import annotations

import numpy as np
import pytest

from rtradar.radar import Radar
from rtradar.scene import Scene
from rtradar.scene.objects import ROOM_SIDES
from rtradar.system.registries import scene_files

NAMES = list(scene_files())
ROOMS = [name for name in NAMES if Scene.load(name).walls]

# Walks keep within 1.5 m of the origin along x; an arm reaches 0.4 m ahead and 0.5 m to the side.
LANE = np.array([[-1.9, -0.5, 0.01], [1.9, 0.5, 2.0]])


def box(scene: Scene) -> np.ndarray:
    corners = np.concatenate([wall.corners for wall in scene.walls if wall.name in ROOM_SIDES])
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def test_the_scenes_promised_are_there() -> None:
    promised = {
        "free-space",
        "anechoic-with-corner-reflectors",
        "living-room",
        "bedroom",
        "corridor",
        "bathroom",
    }
    assert promised <= set(NAMES)


@pytest.mark.parametrize("radar", ["paper-12ghz", "paper-77ghz"])
@pytest.mark.parametrize("name", NAMES)
def test_it_loads_and_holds_the_radar(name: str, radar: str) -> None:
    scene = Scene.load(name)
    # Refuses materials outside their limits, antennas in a wall, and furniture within 0.3 m of one.
    placed = scene.place(Radar.preset(radar))
    for made in scene.materials:
        eta = made.eta([placed.start_frequency_hz, placed.start_frequency_hz + placed.bandwidth_hz])
        assert made.name == "perfect-conductor" or np.isfinite(eta).all()
    for piece in scene.furniture:
        mesh = piece.triangles()
        # Corner reflectors are open sheets, all else is closed.
        assert mesh.closed == (piece.mesh not in ("trihedral", "dihedral"))
    antennas = np.concatenate([placed.tx, placed.rx])
    if scene.walls and name != "behind-plasterboard":
        low, high = box(scene)
        assert np.all((antennas > low) & (antennas < high))


@pytest.mark.parametrize("name", NAMES)
def test_the_person_has_room(name: str) -> None:
    scene = Scene.load(name)
    place = np.array([*scene.person_position_m, 0.0])
    low, high = LANE + place
    for piece in scene.furniture:
        # The box around a triangle keeps clear of the lane, so the triangle does.
        corners = piece.triangles().corners
        apart = np.any((corners.min(axis=1) >= high) | (corners.max(axis=1) <= low), axis=1)
        assert apart.all(), piece.name
    if scene.walls:
        inside = box(scene)
        assert np.all(low >= inside[0])
        assert np.all(high <= inside[1])


@pytest.mark.parametrize("name", ROOMS)
def test_all_stands_inside_the_room(name: str) -> None:
    scene = Scene.load(name)
    assert [wall.name for wall in scene.walls][:6] == list(ROOM_SIDES)
    low, high = box(scene)
    for piece in scene.furniture:
        vertices = piece.triangles().vertices
        # A turn by 90 degrees moves a corner by a rounding error.
        assert np.all(vertices >= low - 1e-9), piece.name
        assert np.all(vertices <= high + 1e-9), piece.name
        if piece.mesh != "radiator":  # which hangs
            assert vertices[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    for wall in scene.walls[6:]:
        back = wall.corners - wall.thickness_m * wall.normal
        assert np.all(np.concatenate([wall.corners, back]) >= low)
        assert np.all(np.concatenate([wall.corners, back]) <= high)


@pytest.mark.parametrize("name", ROOMS)
def test_no_two_pieces_stand_in_each_other(name: str) -> None:
    pieces = [(piece.name, piece.triangles().vertices) for piece in Scene.load(name).furniture]
    boxes = [(title, vertices.min(axis=0), vertices.max(axis=0)) for title, vertices in pieces]
    for k, (first, low, high) in enumerate(boxes):
        for second, low2, high2 in boxes[k + 1 :]:
            assert np.any((low >= high2 - 1e-9) | (low2 >= high - 1e-9)), (first, second)


def test_behind_plasterboard_the_radar_is_outside() -> None:
    scene = Scene.load("behind-plasterboard")
    placed = scene.place(Radar.preset("paper-12ghz"))
    near = scene.walls[0]
    assert near.material.name == "plasterboard"
    assert np.all((placed.tx - near.corners[0]) @ near.normal < -near.thickness_m)
