"""The shadow in the clutter of people and of what else moves, against integrals by brute force.

- What an ellipsoid takes of a specular path while it crosses it, chirp after chirp: Kirchhoff's
  integral over points in the plane across a leg, damped as rtradar has it and without damping.
- The same of a plate that moves: products of Fresnel integrals.
- How near such an integral comes to the field of a conducting cylinder between two line sources,
  the series of Bessel functions, near the edge and, with the reflected ray, beyond the edge.
- The samples of a room while a person moves: Kirchhoff's integral row by row over outlines, for
  every leg of four channels at five frequencies and at every chirp that is looked at, without
  keyframes. One point in eight of the room's clutter takes part.
- The shadow between keyframes: against that at keyframes 2.5 ms apart.

    python validation/other_methods/shadow.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.special import erf, hankel2, jv

import rtradar as rt
from rtradar.body.body import Poses
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.scatter.clutter import body_shadow
from rtradar.scatter.clutter.returns import RoomEchoes
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.echo_models import build_model
from rtradar.scene import Scene, Surface, Wall, material
from rtradar.signal.clutter import RoomIf
from rtradar.validate.rows import Row, judged, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import MovingEllipsoid, power_db

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
MOST_ERROR_DB = -25.0


FADE = 0.1
"""Damping of the integral that is rtradar's."""
LEAST_DB = -35.0
"""What is approximated may be in error so much below the person, by default."""
WINDOW_S = (1.25, 2.25)


def taken(offset: Array, zone: Array, across: Array, fade: float = 0.0) -> Field:
    """Fraction of a wave that an ellipse takes, whose middle is beside the leg.

    It is (fade - j) / zone^2 times the integral of exp((j - fade) pi rho^2 / zone^2) over it, in
    rings about its own middle; ``across`` are its semi-axes along the offset and upwards [m].
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
        found.append(((fade - 1j) / size**2 * np.exp((1j - fade) * np.pi * square) * area).sum())
    return np.array(found)


def taken_by_plate(offset: Array, zone: Array, across: Array, fade: float = 0.0) -> Field:
    """The same for a rectangle of half-widths ``across`` [m]."""
    root = np.sqrt(np.pi * (fade - 1j))
    sides = (offset, across[0]), (np.zeros_like(offset), across[1])
    parts = [
        (erf(root * (place + half) / zone) - erf(root * (place - half) / zone)) / 2
        for place, half in sides
    ]
    return np.asarray(parts[0] * parts[1])


def crossing_rows(quick: bool) -> Iterator[Row]:
    """An upright ellipsoid, and a plate, cross the legs of a path over a wall."""
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
    away = MovingEllipsoid((-40.0, -0.9, 1.2), axes)
    sheet = trimesh.Trimesh(
        [[0, y, z] for y in (-0.2, 0.2) for z in (-0.8, 0.8)], [[0, 1, 3], [0, 3, 2]]
    )
    path = rt.FollowingPath(velocity_mps=(0.0, speed, 0.0))
    plate = rt.Object("plate", sheet, "metal", position_m=(-0.5, -0.9, 1.2), motion=path)
    clutter = Clutter(radar, Scene(walls=(wall,)), order=1)
    [own] = clutter.objects
    chirps = np.arange(0, int(0.95 / radar.chirp_interval_s), 160 if quick else 20)
    still = RoomIf(radar, clutter.cycle()).clutter_if(chirps)
    middle = radar.samples_per_chirp // 2
    frequency = radar.start_frequency_hz + radar.slope_hz_per_s * middle / radar.sample_rate_hz
    centres = body.at(radar.centres_of(chirps)).centres[:, 0]
    point, length = own.points[0, 0, 0, 0], own.length[0, 0, 0]
    for what, shadow, integral in (
        ("an ellipsoid", body_shadow.ClutterShadow(clutter, body), taken),
        ("a plate", body_shadow.ClutterShadow(clutter, away, (plate,)), taken_by_plate),
    ):
        room = RoomIf(radar, clutter.cycle(), shadow)
        ours = 1 - (room.clutter_if(chirps) / still)[:, 0, middle]
        for fade, words in ((FADE, "damped as here"), (0.0, "without damping")):
            left = np.ones(len(chirps), dtype=np.complex128)
            for antenna in (radar.tx[0], radar.rx[0]):
                way = (point - antenna) / np.linalg.norm(point - antenna)
                along = (centres - antenna) @ way
                offset = np.linalg.norm(antenna + along[:, None] * way - centres, axis=1)
                wavelength = SPEED_OF_LIGHT_MPS / frequency
                zone = np.sqrt(wavelength * along * (length - along) / length)
                left *= 1 - integral(offset, zone, np.array(axes[1:]), fade)
            error = over_change(ours, 1 - left)
            claim, quantity = f"{what} crosses a path", f"the integral {words}, over its change"
            if fade:
                says = "shadow of an ellipsoid and of a plate that cross a path, over its change"
                yield judged(claim, quantity, "dB", error, MOST_ERROR_DB, says=says)
            else:
                yield reported(claim, quantity, "dB", error)


def over_change(ours: NDArray, expected: NDArray) -> float:
    """Error of what changes along the first axis, over that [dB]."""
    wrong, change = ours - expected, expected - expected.mean(axis=0)
    wrong = wrong - wrong.mean(axis=0)
    return power_db(float((np.abs(wrong) ** 2).sum() / (np.abs(change) ** 2).sum()))


def cylinder_rows() -> Iterator[Row]:
    """A conducting cylinder between two parallel line sources, 2 and 4 m away, at 12 GHz."""
    wavelength, before, after, radius = SPEED_OF_LIGHT_MPS / 12e9, 2.0, 4.0, 0.15
    k, zone = 2 * np.pi / wavelength, np.sqrt(wavelength * 8 / 6)
    offset = np.linspace(-1.2, 1.2, 241)
    order = np.arange(-int(k * radius + 40), int(k * radius + 41))
    away = [np.hypot(distance, offset) for distance in (before, after)]
    turn = np.arctan2(-offset, -before) - np.arctan2(-offset, after)
    field = jv(order, k * radius) / hankel2(order, k * radius) * np.exp(1j * order * turn[:, None])
    field = field * hankel2(order, k * away[0][:, None]) * hankel2(order, k * away[1][:, None])
    exact = field.sum(axis=1) / hankel2(0, k * (before + after))
    # The ray that the cylinder reflects, past its shadow boundary (geometrical optics).
    angle = np.linspace(0, 2 * np.pi, 20001)
    place = radius * np.stack([np.cos(angle), np.sin(angle)])
    ray = np.zeros(len(offset), dtype=np.complex128)
    for number in np.flatnonzero(np.abs(offset) > radius + 0.01):
        ends = np.array([[-before, -offset[number]], [after, -offset[number]]])
        legs = [np.hypot(*(place - end[:, None])) for end in ends]
        at = (legs[0] + legs[1]).argmin()
        cosine = (ends[0] - place[:, at]) @ place[:, at] / radius / legs[0][at]
        focus = 1 / (1 / legs[0][at] + 2 / (radius * cosine))
        size = np.sqrt(focus / (focus + legs[1][at]) / legs[0][at] * (before + after))
        ray[number] = size * np.exp(-1j * k * (legs[0][at] + legs[1][at] - before - after))
    near, far = np.abs(offset) < radius + 2 * zone, np.abs(offset) > radius + 3 * zone
    for fade in (0.0, FADE, 0.3):
        # Infinitely long, and of waves exp(-j k length).
        strip = taken_by_plate(offset, np.full_like(offset, zone), np.array([radius, 1e3]), fade)
        error = strip.conj() - exact
        for where, kept, own in (
            ("up to 2 Fresnel radii from the edge", near, error),
            ("beyond 3, with the reflected ray", far, error + ray),
        ):
            size = float((np.abs(own[kept]) ** 2).sum() / (np.abs(exact[kept]) ** 2).sum())
            claim = f"shadow of a cylinder, damping {fade:g}"
            yield reported(claim, f"against its series, {where}", "dB", power_db(size))


class Outlines:
    """Kirchhoff's integral, damped, over the outlines of a posed body, for legs from places."""

    def __init__(self, radar: rt.Radar, frequency: Array) -> None:
        self._wavelength = SPEED_OF_LIGHT_MPS / radar.centre_frequency_hz
        self._scale = np.sqrt(frequency / radar.centre_frequency_hz)
        grid = np.linspace(-6, 6, 60001)
        wave = np.exp((1j - FADE) * np.pi * grid**2) * (grid[1] - grid[0])
        self._grid, self._sums = grid, np.cumsum(wave) - wave / 2
        self._rows = np.linspace(-4, 4, 321)

    def _sum(self, u: Array) -> Field:
        place = np.clip((u - self._grid[0]) / (self._grid[1] - self._grid[0]), 0, 59999.5)
        low = place.astype(np.int64)
        rest = place - low
        return np.asarray((1 - rest) * self._sums[low] + rest * self._sums[low + 1])

    def lost(self, antenna: Array, points: Array, poses: Poses) -> Field:
        """Fraction lost (point, frequency)."""
        out = np.zeros((len(points), len(self._scale)), dtype=np.complex128)
        centres, frames, semi = poses.centres[0], poses.frames[0], poses.semi_axes
        length = np.linalg.norm(points - antenna, axis=1)
        way = (points - antenna) / length[:, None]
        side = np.cross(way, [0.0, 0.0, 1.0])
        side /= np.linalg.norm(side, axis=1)[:, None]
        plane = np.stack([side, np.cross(side, way)], axis=1)  # (point, 2, 3)
        along = (centres - antenna) @ way.T  # (part, point)
        between = (along > 0) & (along < length)
        offset = np.einsum("nij,pj->pni", plane, centres - antenna)
        axes = frames * semi[:, None, :]
        wide = np.einsum("nij,pjk->pnik", plane, axes)
        depth = np.einsum("nj,pjk->pnk", way, axes)
        form = wide @ np.swapaxes(wide, -1, -2)  # of the ellipse: offsets' squares [m^2]
        # Where along the leg the outline is nearest to it.
        solved = np.linalg.solve(form, offset[..., None])[..., 0]
        aside = np.sqrt(np.maximum((solved * offset).sum(axis=-1), 1.0))
        along = along - (np.einsum("pnik,pnk->pni", wide, depth) * solved).sum(axis=-1) / aside
        inside = np.clip(along, 1e-3, length - 1e-3)
        zone = np.sqrt(self._wavelength * inside * (length - inside) / length)
        middle, form = offset / zone[..., None], form / zone[..., None, None] ** 2
        heights = (self._rows[1:] + self._rows[:-1]) / 2
        # Chords of the ellipse at each height: mean and half of x given y.
        y = (heights - middle[..., 1:2]) / np.sqrt(form[..., 1, 1])[..., None]
        mean = middle[..., :1] + form[..., 0, 1, None] / np.sqrt(form[..., 1, 1])[..., None] * y
        least = np.linalg.det(form) / form[..., 1, 1]
        half = np.sqrt(least[..., None] * np.maximum(1 - y**2, 0))
        low, high = mean - half, mean + half
        none = (half == 0) | ~between[..., None] | (low > 4) | (high < -4)
        low, high = np.where(none, 9.0, low), np.where(none, 9.0, high)
        order = np.argsort(low, axis=0)
        low, high = (np.take_along_axis(ends, order, axis=0) for ends in (low, high))
        done = np.maximum.accumulate(np.concatenate([np.full_like(high[:1], -9), high[:-1]]))
        part, point, row = np.nonzero((high > done) & (low < 9))
        first, last = np.maximum(low, done)[part, point, row], high[part, point, row]
        for number, scale in enumerate(self._scale):
            of_rows = np.diff(self._sum(self._rows * scale))
            wave = (self._sum(last * scale) - self._sum(first * scale)) * of_rows[row]
            out[:, number] = np.bincount(point, wave.real, len(points))
            out[:, number] += 1j * np.bincount(point, wave.imag, len(points))
        return (FADE - 1j) * out


def thinned(own: RoomEchoes) -> RoomEchoes:
    """One point in eight of an object."""
    if own.kind == "mirror":
        return own
    some = slice(None, None, 8)
    arrays = {name: getattr(own, name)[..., some] for name in ("length", "amplitude", "bounces")}
    return replace(own, **arrays, points=own.points[:, :, some])


def room_rows(quick: bool) -> Iterator[Row]:
    """What a person takes from points of the living room, in the samples of some channels."""
    scene = rt.Scene.load("living-room")
    radar = scene.place(rt.Radar.preset("paper-12ghz"))
    clutter = Clutter(radar, scene, order=1)
    clutter.objects = tuple(thinned(own) for own in clutter.objects if own.kind != "mirror")
    tx, rx = np.array([2, 9])[: 1 if quick else 2], np.array([1, 6])[: 1 if quick else 2]
    frequency = radar.start_frequency_hz + radar.bandwidth_hz * np.array(
        [0.05, 0.275, 0.5, 0.725, 0.95]
    )
    times = np.arange(radar.samples_per_chirp) / radar.sample_rate_hz
    swept = radar.start_frequency_hz + radar.slope_hz_per_s * times
    outlines = Outlines(radar, frequency)
    over_sweep = lagrange(frequency, swept)
    for activity in ("kick",) if quick else ("walk", "kick", "punch", "jumping_jack"):
        motion = rt.synthetic_motion(activity, duration_s=3.0)
        body = rt.Body.from_motion(motion.shifted([*scene.person_position_m, 0.0]))
        moments = [
            round(start_s / radar.cycle_duration_s)
            + np.arange(0, radar.cycles_per_frame, 32 if quick else 16)
            for start_s in (WINDOW_S[:1] if quick else WINDOW_S)
        ]
        person = person_power(radar, body)
        rooms = {
            allowed: RoomIf(
                radar, clutter.cycle(), body_shadow.ClutterShadow(clutter, body, (), allowed)
            )
            for allowed in (person * 10 ** (LEAST_DB / 10), *(() if quick else (0.0,)))
        }
        wrong, changed = dict.fromkeys(rooms, 0.0), 0.0
        still = RoomIf(radar, clutter.cycle())
        for cycles in moments:
            given = clutter, radar, outlines, over_sweep, swept, body
            lost = [[samples_lost(*given, cycle, one, rx) for one in tx] for cycle in cycles]
            expected = np.array(lost)
            expected = expected - expected.mean(axis=0)
            changed += float((np.abs(expected) ** 2).mean()) / len(moments)
            chirps = (cycles[:, None] * radar.n_tx + tx).ravel()
            for allowed, room in rooms.items():
                ours = still.clutter_if(chirps) - room.clutter_if(chirps)
                ours = ours[:, rx].reshape(len(cycles), len(tx), len(rx), -1).astype(np.complex128)
                ours = ours - ours.mean(axis=0)
                wrong[allowed] += float((np.abs(ours - expected) ** 2).mean()) / len(moments)
        default, *exact = wrong.values()
        claim = f"shadow of a person in a room, {activity}"
        quantity = "error of the samples over their change in 0.1 s"
        for error in exact:
            yield reported(claim, f"{quantity}, tolerance off", "dB", power_db(error / changed))
        yield reported(claim, f"{quantity}, default tolerance", "dB", power_db(default / changed))
        says = "shadow of people in a room's clutter, default tolerance, over the person's power"
        quantity = "error of the samples over the person's power, default tolerance"
        yield judged(claim, quantity, "dB", power_db(default / person), LEAST_DB, says=says)


def lagrange(nodes: Array, places: Array) -> Array:
    """Weights (place, node) of the polynomial through values at nodes."""
    return np.stack(
        [
            np.prod([(places - other) / (node - other) for other in nodes if other != node], axis=0)
            for node in nodes
        ],
        axis=1,
    )


def person_power(radar: rt.Radar, body: rt.Body) -> float:
    """Mean power of a person's echoes [m^2]."""
    chirps = np.arange(0, int(3.0 / radar.chirp_interval_s), 997)
    amplitude = build_model("specular", radar, body).echoes(chirps).amplitude
    return float((np.abs(amplitude) ** 2).sum(axis=-1).mean())


def samples_lost(
    clutter: Clutter,
    radar: rt.Radar,
    outlines: Outlines,
    over_sweep: Array,
    swept: Array,
    body: rt.Body,
    cycle: int,
    tx: int,
    rx: NDArray[np.int64],
) -> Field:
    """Samples (rx, sample) that the body takes at one chirp, echo by echo."""
    poses = body.at(radar.centres_of(np.array([cycle * radar.n_tx + tx])))
    points = np.concatenate([own.points[0, 0, :, 0] for own in clutter.objects])
    some_at_once = np.array_split(points, len(points) // 250 + 1)
    antennas = [radar.tx[tx], *radar.rx[radar.rx_of_tx[tx, rx]]]
    left = [
        1 - np.concatenate([outlines.lost(antenna, some, poses) for some in some_at_once])
        for antenna in antennas
    ]
    found = np.zeros((len(rx), len(swept)), dtype=np.complex128)
    for column, one in enumerate(rx):
        lost = 1 - left[0] * left[1 + column]
        some = np.flatnonzero(np.abs(lost).max(axis=1) > 1e-5)
        first = 0
        for own in clutter.objects:
            which = some[(some >= first) & (some < first + own.n_echoes)]
            of_sweep = (
                lagrange(own.frequency, swept)
                if len(own.frequency) > 1
                else np.ones((len(swept), 1))
            )
            amplitude = of_sweep @ own.amplitude[:, tx, one][:, which - first]
            delay = own.length[tx, one, which - first] / SPEED_OF_LIGHT_MPS
            # The last term, which the paper neglects, turns a delay of 40 ns by 18 degrees.
            turns = np.outer(swept, delay) - radar.slope_hz_per_s * delay**2 / 2
            wave = amplitude * np.exp(2j * np.pi * turns) * (over_sweep @ lost[which].T)
            found[column] += wave.sum(axis=1)
            first += own.n_echoes
    return found


def walker_rows(quick: bool) -> Iterator[Row]:
    """The shadow between keyframes, for what people do in the living room."""
    scene = rt.Scene.load("living-room")
    radar = scene.place(rt.Radar.preset("paper-12ghz"))
    clutter = Clutter(radar, scene, order=1)
    for activity in ("walk",) if quick else ("walk", "kick", "punch", "jumping_jack"):
        motion = rt.synthetic_motion(activity, duration_s=3.0)
        body = rt.Body.from_motion(motion.shifted([*scene.person_position_m, 0.0]))
        wrong = changed = 0.0
        for start_s in (1.25,) if quick else (1.25, 2.25):
            first = round(start_s / radar.cycle_duration_s) * radar.n_tx
            chirps = np.arange(first, first + radar.chirps_per_frame)
            fields = []
            for apart_s in (2.5e-3, body_shadow.KEYFRAMES_S):
                # Of keyframes alone: points that are less exact on both sides serve.
                given = {"KEYFRAMES_S": apart_s, "EXACT": body_shadow.FINE}
                with mock.patch.multiple(body_shadow, **given):
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
        yield judged(
            claim, quantity, "dB", error, MOST_ERROR_DB, says=says, cases=1 if quick else 2
        )


def measure(quick: bool) -> list[Row]:
    return [*crossing_rows(quick), *cylinder_rows(), *walker_rows(quick), *room_rows(quick)]


if __name__ == "__main__":
    sys.exit(main("The shadow in the clutter, against Kirchhoff's integral.", measure))
