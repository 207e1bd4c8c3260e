"""Laws of a radar that is turned or moves: only how it and the world are to one another counts."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import rtradar as rt
from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.echoes import Echoes
from rtradar.front_end import Antenna
from rtradar.radar import Radar
from rtradar.scatter import build_model
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.people_and_objects import build_model_of_all
from rtradar.scene import Furniture, Object, Scene, Wall, material
from rtradar.scene.moving import RigidMotion
from rtradar.signal import synthesize

RADAR = Radar(
    name="upright",
    bandwidth_hz=1e9,
    tx_y=2,
    tx_z=2,
    rx_y=2,
    rx_z=2,
    samples_per_chirp=64,
    tx_antenna=Antenna(pattern="dipole"),
    rx_antenna=Antenna(pattern="cosine", exponent=2.0),
)
CENTRE = np.array(RADAR.position_m)
ANGLES = {"yaw_deg": 35.0, "pitch_deg": -12.0, "roll_deg": 20.0}
PATH = {
    "path_times_s": (0.0, 0.06, 0.3),
    "path_m": ((0.0, 0.0, 0.0), (0.1, -0.05, 0.08), (0.3, 0.2, 0.1)),
    "path_angles_deg": ((0.0, 0.0, 0.0), (5.0, -2.0, 1.0), (25.0, -9.0, 5.0)),
}
CHIRPS = np.arange(400, 408)
Pose = Callable[[Any], tuple[np.ndarray, np.ndarray]]


class SeenBody(Body):
    """A body whose places are those that a radar sees which is turned or moves, about `CENTRE`."""

    def __init__(self, body: Body, pose: Pose) -> None:
        kept = "motion", "semi_axes", "breathing", "material", "mesh"
        found = "names", "owner", "materials", "part_names", "duration_s"
        given = {name: getattr(body, name) for name in (*kept, *found)}
        for name, value in {**given, "seen": body, "pose": pose}.items():
            object.__setattr__(self, name, value)

    seen: Body
    pose: Pose

    @property
    def people(self) -> tuple[Body, ...]:
        return (self,)

    def at(self, times: Any) -> Poses:
        centres, frames, semi_axes = self.seen.at(times)
        axes, places = self.pose(times)
        centres = np.einsum("tji,tpj->tpi", axes, centres - places[:, None]) + CENTRE
        return Poses(centres, np.einsum("tji,tpjk->tpik", axes, frames), semi_axes)


class SeenMotion(RigidMotion):
    """The same of what moves an object, whose position is `CENTRE` and a rest."""

    def __init__(self, motion: RigidMotion, rest: np.ndarray, pose: Pose) -> None:
        self._motion, self._rest, self._pose = motion, rest, pose

    def pose(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rotation, shift = self._motion.pose(times)
        axes, places = self._pose(times)
        moved = np.einsum("tji,tj->ti", axes, CENTRE + self._rest + shift - places)
        return np.swapaxes(axes, 1, 2) @ rotation, moved - self._rest


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


def walker() -> Body:
    return Body.from_motion(rt.synthetic_motion("walk", duration_s=1.0))


@pytest.fixture(scope="module")
def turned(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Radar, Body, Scene]]:
    """The same world, upright and turned about the radar together with it."""
    radar = dataclasses.replace(RADAR, **ANGLES)

    def back(times: Any) -> tuple[np.ndarray, np.ndarray]:
        count = len(np.atleast_1d(times))
        return np.tile(radar.axes.T, (count, 1, 1)), np.tile(CENTRE, (count, 1))

    folders = [tmp_path_factory.mktemp(name) for name in ("upright", "turned")]
    return [
        (RADAR, walker(), world(folders[0], np.eye(3))),
        (radar, SeenBody(walker(), back), world(folders[1], radar.axes)),
    ]


@pytest.mark.parametrize(("fidelity", "polarization"), [("analytic", "v"), ("specular", "h")])
def test_a_turned_radar_sees_people_and_objects_of_a_world_that_is_turned_as_well(
    turned: list[tuple[Radar, Body, Scene]], fidelity: str, polarization: str
) -> None:
    upright, other = (
        samples(
            build_model_of_all(
                fidelity,
                dataclasses.replace(radar, polarization=polarization),
                body,
                scene=scene,
                variant="scalar",
            ).echoes(CHIRPS)
        )
        for radar, body, scene in turned
    )
    assert np.abs(other - upright).max() < 1e-6 * np.abs(upright).max()


def test_it_sees_its_clutter(turned: list[tuple[Radar, Body, Scene]]) -> None:
    found = []
    for radar, _, scene in turned:
        clutter = Clutter(radar, scene, order=1, variant="scalar")
        assert {item.name for item in clutter.kept} == {"floor", "box", "corner"}
        found.append((sum(samples(echoes) for echoes in clutter.cycle()), clutter.behind()))
    (upright, behind), (other, behind_other) = found
    assert np.abs(other - upright).max() < 1e-6 * np.abs(upright).max()
    assert behind_other[0] == pytest.approx(behind[0], rel=1e-6)


LEVELS: dict[str, dict[str, Any]] = {
    "analytic": {},
    "analytic-paper": {},
    "specular": {"bounces": 2, "terms": 2},
    "physical-optics": {},
    "rays": {"rays_per_wavelength": 0.5},
    "reference": {"facets": 320},
}


@pytest.mark.parametrize(
    ("level", "polarization"),
    [*((level, "v") for level in LEVELS), ("specular", "h"), ("rays", "h")],
)
def test_a_radar_that_moves_sees_what_one_at_rest_sees_of_a_world_that_moves_the_other_way(
    level: str, polarization: str
) -> None:
    moving = dataclasses.replace(RADAR, **ANGLES, **PATH, polarization=polarization)
    still = dataclasses.replace(RADAR, polarization=polarization)
    chirps = np.array([0, 5, 163, 406, 1601, 3202])
    found = [
        build_model(level, radar, body, variant="cpu", materials=["skin"] * 21, **LEVELS[level])
        for radar, body in ((moving, walker()), (still, SeenBody(walker(), moving.poses_at)))
    ]
    here, there = (model.echoes(chirps) for model in found)
    np.testing.assert_allclose(there.length, here.length, rtol=0, atol=1e-9)
    largest = np.abs(here.amplitude).max()
    np.testing.assert_allclose(there.amplitude, here.amplitude, rtol=0, atol=1e-9 * largest)


def test_so_it_does_of_objects() -> None:
    moving, shape = (
        dataclasses.replace(RADAR, **ANGLES, **PATH),
        trimesh.creation.box((0.1, 0.3, 0.2)),
    )
    place, turning = (-1.0, 1.5, 1.2), rt.Turning(rate_hz=2.0)
    against = SeenMotion(turning, np.array(place) - CENTRE, moving.poses_at)
    metal, empty = material("metal"), SeenBody(walker(), moving.poses_at)
    here, there = (
        build_model_of_all(
            "specular",
            radar,
            body,
            scene=Scene(objects=(Object("box", shape, metal, position_m=place, motion=motion),)),
            variant="cpu",
        ).echoes(np.arange(1600, 1608))
        for radar, body, motion in ((moving, walker(), turning), (RADAR, empty, against))
    )
    assert np.abs(samples(there) - samples(here)).max() < 1e-9 * np.abs(samples(here)).max()


def test_a_radar_on_its_side_has_the_other_polarisation() -> None:
    # Antennas at one place, so that only polarisation and pattern are turned. Exactly so it is on
    # the boresight; over the floor v and h differ.
    one = {"tx_positions_m": [(0, 0, 0)], "rx_positions_m": [(0, 0, 0)]}
    radar = dataclasses.replace(RADAR, **one, rx_antenna=RADAR.tx_antenna)
    floor = Wall(
        name="floor",
        corner_m=(-6.0, -3.0, 0.0),
        edge_u_m=(9.0, 0.0, 0.0),
        edge_v_m=(0.0, 8.0, 0.0),
        material=material("concrete"),
        thickness_m=0.2,
    )
    h, rolled, v = (
        build_model(
            "specular",
            dataclasses.replace(radar, polarization=kind, roll_deg=roll),
            walker(),
            scene=Scene(walls=(floor,)),
            variant="cpu",
        ).echoes(np.array([400]))
        for kind, roll in (("h", 0.0), ("v", 90.0), ("v", 0.0))
    )
    near, far = (np.abs(one.amplitude - h.amplitude).max() for one in (rolled, v))
    assert near < 0.03 * far
