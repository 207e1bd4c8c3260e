"""A radar that is turned, in rooms and before objects: turned with the world, nothing changes."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import trimesh

import rtradar as rt
from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.radar_axes import BodyInRadarAxes, in_radar_axes
from rtradar.scatter.world import build_world
from rtradar.scene import Furniture, Object, Scene, Wall, material
from rtradar.scene.moving import RigidMotion
from rtradar.signal import synthesize

RADAR = Radar(
    name="upright", bandwidth_hz=1e9, tx_y=2, tx_z=2, rx_y=2, rx_z=2, samples_per_chirp=64
)
CENTRE = np.array(RADAR.position_m)
ANGLES = {"yaw_deg": 35.0, "pitch_deg": -12.0, "roll_deg": 20.0}
CHIRPS = np.arange(400, 408)


class TurnedMotion(RigidMotion):
    """A motion and the pose of the mesh, both turned."""

    def __init__(self, motion: RigidMotion, turn: np.ndarray) -> None:
        self._motion, self._turn = motion, turn

    def pose(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rotation, shift = self._motion.pose(times)
        return self._turn @ rotation, shift @ self._turn.T


def world(folder: Path, turn: np.ndarray) -> Scene:
    """A wall, a box and a corner reflector at rest, and a paddle and a cart that move, turned."""

    def along(vector: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = (turn @ vector).tolist()
        return x, y, z

    def place(point: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = (CENTRE + turn @ (point - CENTRE)).tolist()
        return x, y, z

    random = np.random.default_rng(4)

    def mesh(shape: trimesh.Trimesh) -> trimesh.Trimesh:
        # No two sides are equally long: which of them is halved first would be left to rounding.
        vertices = shape.vertices + random.normal(0.0, 0.01, shape.vertices.shape)
        return trimesh.Trimesh(vertices @ turn.T, shape.faces, process=False)

    box = mesh(trimesh.creation.box((0.4, 0.7, 0.5)))
    box.export(folder / "box.obj", digits=15)
    unit = np.eye(3) * 0.3
    corner = [np.zeros(3), *unit], [[0, 1, 2], [0, 2, 3], [0, 3, 1]]
    mesh(trimesh.Trimesh(*corner, process=False)).export(folder / "corner.obj", digits=15)
    own, wood, metal = {"metres_per_unit": 1.0}, material("wood"), material("metal")
    return Scene(
        walls=(
            Wall(
                name="floor",
                corner_m=place((-6.0, -3.0, 0.0)),
                edge_u_m=along((9.0, 0.0, 0.0)),
                edge_v_m=along((0.0, 8.0, 0.0)),
                material=material("concrete"),
                thickness_m=0.2,
                roughness_m=0.002,
            ),
        ),
        furniture=(
            Furniture("box", folder / "box.obj", wood, position_m=place((1.0, 2.2, 0.3)), **own),
            Furniture(
                "corner",
                folder / "corner.obj",
                metal,
                position_m=place((0.5, 0.0, 0.4)),
                sheet=True,
                **own,
            ),
        ),
        objects=(
            Object(
                "paddle",
                trimesh.creation.box((0.02, 0.3, 0.2)),
                metal,
                position_m=place((-1.0, 1.5, 1.2)),
                motion=TurnedMotion(rt.Turning(rate_hz=2.0), turn),
            ),
            Object(
                "cart",
                trimesh.creation.box((0.2, 0.2, 0.2)),
                metal,
                position_m=place((-1.5, 0.2, 0.6)),
                motion=TurnedMotion(rt.FollowingPath(velocity_mps=(0.5, 0.2, 0.0)), turn),
            ),
        ),
    )


def samples(echoes: Echoes) -> np.ndarray:
    return synthesize(echoes, RADAR, RADAR.chirp_times(len(echoes.tx)))


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Radar, Body, Scene]]:
    """The same world, upright and turned about the radar together with it."""
    radar = dataclasses.replace(RADAR, **ANGLES)
    body = Body.from_motion(rt.synthetic_motion("walk", duration_s=1.0))

    def back(times: object) -> tuple[np.ndarray, np.ndarray]:
        count = len(np.atleast_1d(times))
        return np.tile(radar.axes.T, (count, 1, 1)), np.tile(CENTRE, (count, 1))

    folders = [tmp_path_factory.mktemp(name) for name in ("upright", "turned")]
    return [
        (RADAR, body, world(folders[0], np.eye(3))),
        (radar, BodyInRadarAxes(body, back, CENTRE), world(folders[1], radar.axes)),
    ]


@pytest.mark.parametrize("fidelity", ["analytic", "specular"])
def test_people_and_objects(turned: list[tuple[Radar, Body, Scene]], fidelity: str) -> None:
    upright, other = (
        samples(build_world(fidelity, *one[:2], scene=one[2], variant="scalar").echoes(CHIRPS))
        for one in turned
    )
    assert np.abs(other - upright).max() < 1e-6 * np.abs(upright).max()


def test_static_clutter(turned: list[tuple[Radar, Body, Scene]]) -> None:
    found = []
    for one in turned:
        radar, _, scene = in_radar_axes(*one)
        clutter = Clutter(radar, scene, order=1, variant="scalar")
        assert {item.name for item in clutter.kept} == {"floor", "box", "corner"}
        found.append(sum(samples(echoes) for echoes in clutter.cycle()))
    assert np.abs(found[1] - found[0]).max() < 1e-6 * np.abs(found[0]).max()
