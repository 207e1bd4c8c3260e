"""People and objects in one world: who hides whom, and which ghosts of objects are left out."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import trimesh

import rtradar as rt
from rtradar.body import Body
from rtradar.motion import place
from rtradar.scatter.people_and_objects import build_model_of_all
from rtradar.scene import Wall, material

RADAR = dataclasses.replace(
    rt.Radar.preset("paper-12ghz"), tx_y=2, tx_z=1, rx_y=2, rx_z=2, position_m=(0.0, 0.0, 1.0)
)


def test_people_and_objects_hide_each_other() -> None:
    radar = dataclasses.replace(RADAR, position_m=(-3.0, 0.0, 1.0))
    standing = place(rt.synthetic_motion("punch", seed=0), duration_s=0.1)
    body = Body.from_motion(standing)
    sheet = trimesh.creation.box((0.02, 1.0, 2.2))
    chirps, power = np.arange(2), {}
    for name, x in (("before", -1.0), ("behind", 1.0), ("beside", 1.0)):
        y = 3.0 if name == "beside" else 0.0
        screen = rt.Object("screen", sheet, "metal", position_m=(x, y, 1.1))
        scene = rt.Scene(objects=(screen,))
        model = build_model_of_all("specular", radar, body, scene=scene)
        echoes = model.echoes(chirps)
        every = (np.abs(echoes.amplitude[1]) ** 2).sum(axis=(0, 1))
        own = echoes.part == len(body.part_names)
        power[name] = every[~own].sum(), every[own].sum()
    # The screen before the person leaves little of them; behind, they leave less of it.
    assert power["before"][0] < 0.02 * power["beside"][0]
    assert power["behind"][0] == pytest.approx(power["beside"][0])
    assert power["behind"][1] < 0.5 * power["before"][1]


def test_ghosts_below_the_noise_or_far_below_their_object_are_left_out() -> None:
    body = Body.from_motion(place(rt.synthetic_motion("punch", seed=0), duration_s=0.05))
    radar = dataclasses.replace(RADAR, position_m=(-2.0, 1.0, 1.0))
    mesh = trimesh.creation.box((0.03, 0.3, 0.2))
    plate = rt.Object("plate", mesh, "metal", position_m=(0.5, 1.0, 1.0))
    behind = Wall(
        name="wall",
        corner_m=(2.0, -10.0, -10.0),
        edge_u_m=(0.0, 0.0, 20.0),
        edge_v_m=(0.0, 20.0, 0.0),
        material=material("perfect-conductor"),
        thickness_m=0.0125,
    )
    scene = rt.Scene(walls=(behind,), objects=(plate,))
    world = build_model_of_all("specular", radar, body, scene=scene)
    (found,) = world.prune(radar, 300, 0.0)
    # The wall behind it: over it the object is seen from its other side.
    names = [row["path"] for row in found["paths"]]
    assert names == ["object", "object > wall", "wall > object"]
    powers = [row["power_m2"] for row in found["paths"]]
    assert powers[1] == pytest.approx(powers[2], rel=0.05)
    assert len(world.objects[0]) == sum(power > 0 for power in powers)
    world.prune(radar, 300, 1e9)
    assert [path.path.name for path in world.objects[0]] == ["body"]
