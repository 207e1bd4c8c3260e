"""Clutter before a radar that moves: that of one at rest wherever it is, and where it belongs."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import Body
from rtradar.errors import InputError
from rtradar.process import range_doppler
from rtradar.radar import Radar
from rtradar.scatter import build_model
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.people_and_objects import build_model_of_all
from rtradar.scene import Furniture, Object, Scene, Wall, material
from rtradar.signal.clutter import MovingRoomIf, RoomIf, keyframe_times

RADAR = Radar(
    name="moving",
    start_frequency_hz=24e9,
    bandwidth_hz=1e9,
    tx_y=2,
    tx_z=0,
    rx_y=2,
    rx_z=0,
    samples_per_chirp=64,
    chirps_per_frame=256,
    position_m=(0.0, 0.0, 1.0),
)
ROOM = Scene(
    walls=tuple(
        Wall(
            name=name,
            corner_m=corner,
            edge_u_m=u,
            edge_v_m=(0.0, 0.0, 3.0),
            material=material("metal"),
            thickness_m=0.01,
        )
        for name, corner, u in (
            ("far", (3.0, 4.0, 0.0), (0.0, -8.0, 0.0)),
            ("left", (-2.0, 4.0, 0.0), (5.0, 0.0, 0.0)),
        )
    )
)
CORNER = Scene(
    furniture=(
        Furniture(
            "corner", "trihedral", material("metal"), position_m=(3.0, 0.8, 1.3), yaw_deg=180
        ),
    )
)


def moving(*way: tuple[float, float, float], turn: tuple[float, float, float] = (0, 0, 0)) -> Radar:
    path = {"path_times_s": [0.0, 0.1], "path_m": [(0, 0, 0), *way]}
    return dataclasses.replace(RADAR, **path, path_angles_deg=[(0, 0, 0), turn], yaw_deg=5.0)


def room_of(radar: Radar, scene: Scene) -> tuple[MovingRoomIf, Any]:
    def trace(still: Radar) -> Clutter:
        return Clutter(still, scene, order=2, variant="scalar")

    return MovingRoomIf(radar, 0.1, trace), trace


@pytest.mark.parametrize("scene", [ROOM, CORNER], ids=["walls", "reflector"])
def test_a_radar_at_rest_has_the_clutter_of_one_that_does_not_move(scene: Scene) -> None:
    radar = moving((0, 0, 0))
    room, trace = room_of(radar, scene)
    assert room.times.tolist() == [0.0, 0.1]
    chirps = np.arange(100, 104)
    still = RoomIf(radar, trace(radar.at(0.0)).cycle()).clutter_if(chirps)
    np.testing.assert_allclose(room.clutter_if(chirps), still, atol=2e-6 * np.abs(still).max())


@pytest.mark.parametrize(("scene", "apart_db"), [(ROOM, -60), (CORNER, -30)])
def test_each_chirp_is_that_of_a_radar_at_rest_where_it_is(scene: Scene, apart_db: float) -> None:
    radar = moving((0.05, 0.03, -0.02), turn=(3, 2, 1))
    room, trace = room_of(radar, scene)
    assert len(room.times) >= 4
    for chirp in (0, 333, 700):
        there = radar.at(float(radar.centres_of(np.array([chirp]))[0]))
        still = RoomIf(there, trace(there).cycle()).clutter_if(np.array([chirp]))
        away = np.linalg.norm(room.clutter_if(np.array([chirp])) - still) / np.linalg.norm(still)
        assert 20 * np.log10(away) < apart_db


@pytest.mark.parametrize("scene", [Scene(walls=ROOM.walls[:1]), CORNER], ids=["wall", "reflector"])
def test_range_and_doppler_are_those_of_the_closed_form(scene: Scene) -> None:
    velocity = np.array([2.0, 0.5, 0.0])
    radar = moving(tuple(0.1 * velocity))
    room, _ = room_of(radar, scene)
    chirps = np.arange(RADAR.chirps_per_frame)
    place = np.array(RADAR.position_m) + velocity * radar.centres_of(chirps).mean()
    way = np.array([3.0 - place[0], 0, 0])
    if scene is CORNER:
        way = np.array(CORNER.furniture[0].position_m) - place
    far = float(np.linalg.norm(way))
    rate = -float(velocity @ way) / far
    power = (np.abs(range_doppler(room.clutter_if(chirps), radar).values) ** 2).sum(axis=2)
    row, column = np.unravel_index(power.argmax(), power.shape)
    bins = [np.arange(at - 3, at + 4) for at in (row, column)]
    there = power[np.ix_(*bins)]
    read = [bins[axis] @ there.sum(axis=1 - axis) / there.sum() for axis in (0, 1)]
    assert abs(read[0] - far / radar.range_bin_m) < 0.1
    assert abs(read[1] - power.shape[1] // 2 - rate / radar.velocity_bin_mps) < 0.1


def test_keyframes_are_near_each_other_on_the_way_and_few_at_rest() -> None:
    path = {"path_times_s": [0.5, 1.5, 2.0], "path_m": [(0, 0, 0), (0.1, 0, 0), (0.1, 0, 0)]}
    radar = dataclasses.replace(RADAR, **path, path_angles_deg=[(0, 0, 0)] * 2 + [(10, 0, 0)])
    times = keyframe_times(radar, 3.0)
    _, places = radar.poses_at(times)
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 2.001 * radar.wavelength_m
    assert np.histogram(times, [-0.1, 0.4, 0.51, 1.49, 1.99, 2.1, 3.1])[0].tolist() == [
        1, 1, 4, 10, 1, 1,
    ]  # fmt: skip


def test_echoes_over_walls_are_those_of_a_radar_at_rest_where_it_is() -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", duration_s=0.2))
    radar = dataclasses.replace(moving((0.2, -0.1, 0.05), turn=(8, 3, 2)), position_m=(-2.5, 0, 1))
    model = build_model("specular", radar, body, scene=ROOM, variant="scalar")
    chirp = np.array([320])  # a keyframe
    time = RADAR.centres_of(chirp)
    (place,) = radar.poses_at(time)[1]
    yaw, pitch, roll = (5, 0, 0) + np.array([8, 3, 2]) * time[0] / 0.1
    still = dataclasses.replace(
        RADAR, position_m=tuple(place), yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll
    )
    wanted = build_model("specular", still, body, scene=ROOM, variant="scalar").echoes(chirp)
    found = model.echoes(chirp)
    seen = np.abs(wanted.amplitude).max(axis=(0, 1, 2)) > 0
    assert seen.sum() > 10
    np.testing.assert_allclose(found.length[..., seen], wanted.length[..., seen], atol=1e-6)
    largest = np.abs(wanted.amplitude).max()
    np.testing.assert_allclose(found.amplitude, wanted.amplitude, atol=1e-3 * largest)


def test_what_is_not_simulated_is_refused_in_one_line() -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", duration_s=0.1))
    radar = dataclasses.replace(moving((0.1, 0, 0)), position_m=(-2.5, 0, 1))
    with pytest.raises(InputError, match=r"radar 'moving' moves; echoes over walls .* order = 0$"):
        build_model("physical-optics", radar, body, scene=ROOM, variant="scalar")
    fan = Object("fan", "fan", "metal", position_m=(1, 1, 1))
    with pytest.raises(InputError, match="leave out 'fan', the walls and furniture, or path_times"):
        build_model_of_all("analytic", radar, body, scene=dataclasses.replace(ROOM, objects=(fan,)))
