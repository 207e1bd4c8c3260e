"""The shadow of a walker in the clutter, against Kirchhoff's integral by brute force.

Over points in the plane across a leg, without damping: what an ellipsoid takes of a specular path
while it crosses it, chirp after chirp. And how far cubics between keyframes are from the shadow at
keyframes 2.5 ms apart, over what changes of it in 0.1 s.

    python validation/other_methods/shadow.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.scatter.clutter import body_shadow
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scene import Scene, Surface, Wall, material
from rtradar.signal.static_clutter import RoomIf
from rtradar.validate.rows import Row, judged, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import MovingEllipsoid, power_db

Array = NDArray[np.float64]
MOST_ERROR_DB = -25.0


def taken(offset: Array, zone: Array, across: Array) -> NDArray[np.complex128]:
    """Fraction of a wave that an ellipse takes, whose middle is beside the leg.

    It is -j / zone^2 times the integral of exp(j pi rho^2 / zone^2) over it, in rings about its own
    middle; ``across`` are its semi-axes along the offset and upwards [m].
    """
    rings = (np.arange(120) + 0.5) / 120
    turns = (np.arange(360) + 0.5) / 360 * 2 * np.pi
    x, y = (
        size * rings[:, None] * wave(turns)
        for size, wave in zip(across, (np.cos, np.sin), strict=True)
    )
    area = across.prod() * rings[:, None] / 120 * (2 * np.pi / 360)
    found = []
    for middle, size in zip(offset, zone, strict=True):
        square = ((x + middle) ** 2 + y**2) / size**2
        found.append((-1j / size**2 * np.exp(1j * np.pi * square) * area).sum())
    return np.array(found)


def ellipsoid_rows(quick: bool) -> Iterator[Row]:
    """An upright ellipsoid crosses the legs of a path over a wall, at the sweep's centre."""
    axes, speed = (0.15, 0.2, 0.8), 1.9
    surface = Surface(material=material("perfect-conductor"), thickness_m=0.1)
    wall = Wall(
        name="far",
        corner_m=(2.0, 4.0, -3.0),
        edge_u_m=(0.0, -8.0, 0.0),
        edge_v_m=(0.0, 0.0, 8.0),
        material=surface.material,
        thickness_m=0.1,
    )
    radar = rt.Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, position_m=(-4.0, 0.0, 1.2))
    body = MovingEllipsoid((-0.5, -0.9, 1.2), axes, (0.0, speed, 0.0))
    clutter = Clutter(radar, Scene(walls=(wall,)), order=1)
    [own] = clutter.objects
    chirps = np.arange(0, int(0.95 / radar.chirp_interval_s), 80 if quick else 20)
    room = RoomIf(radar, clutter.cycle(), body_shadow.ClutterShadow(clutter, body))
    still = RoomIf(radar, clutter.cycle()).clutter_if(chirps)
    middle = radar.samples_per_chirp // 2
    ours = 1 - (room.clutter_if(chirps) / still)[:, 0, middle]
    frequency = radar.start_frequency_hz + radar.slope_hz_per_s * middle / radar.sample_rate_hz
    centres = body.at(radar.centres_of(chirps)).centres[:, 0]
    left = np.ones(len(chirps), dtype=np.complex128)
    point, length = own.points[0, 0, 0, 0], own.length[0, 0, 0]
    for antenna in (radar.tx[0], radar.rx[0]):
        way = (point - antenna) / np.linalg.norm(point - antenna)
        along = (centres - antenna) @ way
        offset = np.linalg.norm(antenna + along[:, None] * way - centres, axis=1)
        wavelength = SPEED_OF_LIGHT_MPS / frequency
        zone = np.sqrt(wavelength * along * (length - along) / length)
        left *= 1 - taken(offset, zone, np.array(axes[1:]))
    expected = 1 - left
    change = np.abs(expected - expected.mean()) ** 2
    error = power_db((np.abs(ours - expected) ** 2).sum() / change.sum())
    quantity = "against the integral without damping, over its change"
    yield reported("an ellipsoid crosses a path", quantity, "dB", error)


def walker_rows(quick: bool) -> Iterator[Row]:
    """The shadow between keyframes, for what people do in the living room."""
    scene = rt.Scene.load("living-room")
    radar = scene.place(rt.Radar.preset("paper-12ghz"))
    clutter = Clutter(radar, scene, order=1)
    for activity in ("walk",) if quick else ("walk", "kick", "punch", "jumping_jack"):
        motion = rt.synthetic_motion(activity, duration_s=3.0)
        body = rt.Body.from_motion(motion.shifted([*scene.person_position_m, 0.0]))
        wrong = changed = 0.0
        for start_s in (1.25, 2.25):
            first = round(start_s / radar.cycle_duration_s) * radar.n_tx
            chirps = np.arange(first, first + radar.chirps_per_frame)
            fields = []
            for apart_s in (2.5e-3, body_shadow.KEYFRAMES_S):
                with mock.patch.object(body_shadow, "KEYFRAMES_S", apart_s):
                    shadow = body_shadow.ClutterShadow(clutter, body)
                room = RoomIf(radar, clutter.cycle(), shadow).clutter_if(chirps)
                cycles = room[: len(chirps) // radar.n_tx * radar.n_tx]
                cycles = cycles.reshape(-1, radar.n_tx, *room.shape[1:])
                fields.append(cycles - cycles.mean(axis=0))
            wrong += float((np.abs(fields[1] - fields[0]) ** 2).sum())
            changed += float((np.abs(fields[0]) ** 2).sum())
        error, quantity = power_db(wrong / changed), f"{activity}, over the change in 0.1 s"
        claim = f"shadow at keyframes {shadow.step * radar.chirp_interval_s * 1e3:.3g} ms apart"
        says = f"shadow in the clutter between keyframes, {activity}, over its change"
        yield judged(claim, quantity, "dB", error, MOST_ERROR_DB, says=says, cases=2)


def measure(quick: bool) -> list[Row]:
    return [*ellipsoid_rows(quick), *walker_rows(quick)]


if __name__ == "__main__":
    sys.exit(main("The shadow in the clutter, against Kirchhoff's integral.", measure))
