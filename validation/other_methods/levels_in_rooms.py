"""Levels of fidelity in rooms: a wall's bounce by brute force, and the living room path by path.

Brute force: a person beside a conducting sheet, by vector physical optics of both, without images.
The antenna's wave drives currents on the sheet, sampled up to five times a wavelength and
tapered to its edges; these radiate to every point of the body, where they drive the currents of
physical optics on what faces both ways and is not behind another ellipsoid; and those are received
by reciprocity, directly or over the sheet. `physical-optics` over its wall must give the same.

Living room: a walk by each level that knows diffraction, path by path, over `specular` there.

    python validation/other_methods/levels_in_rooms.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from math import pi
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.motion import place
from rtradar.scatter import build_model
from rtradar.scatter.common.interpolation import interpolation_weights
from rtradar.scene import Scene, Wall, material
from rtradar.validate.rows import Row, judged, main, reported

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
SPEED_OF_LIGHT = 299_792_458.0
ANTENNA = np.array([-2.2, 0.4, 1.2])
SHEET_Y, SHEET_HALF_M, SHEET_MIDDLE = 1.9, 1.4, (-1.1, 1.1)
"""The sheet stands beside the way to the person; in its middle is where it reflects to them."""
LARGEST_DEG = 120.0
"""Angle at the body between the ways to both antennas up to which the living room is judged."""


class Waves(NamedTuple):
    """Electric and magnetic field (point, 3) at some points, in units of 1 at a metre."""

    electric: Field
    magnetic: Field

    @property
    def direction(self) -> Array:
        """Unit vectors (point, 3) along which the power flows."""
        flow = np.cross(self.electric, self.magnetic.conj()).real
        return np.asarray(flow / np.linalg.norm(flow, axis=1, keepdims=True))


def straight(points: Array, k: float) -> Waves:
    """Wave of the antenna, vertical, at points (point, 3) [m]."""
    way = points - ANTENNA
    distance = np.linalg.norm(way, axis=1, keepdims=True)
    way = way / distance
    up = np.array([0.0, 0.0, 1.0]) - way[:, 2:] * way
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    electric = up * np.exp(-1j * k * distance) / distance
    return Waves(electric, np.cross(way, electric))


@numba.njit(parallel=True, fastmath=True)
def _radiate(places: Array, current: Field, points: Array, k: float, out: Field) -> None:
    """Electric and magnetic field, ``out (2, point, 3)``, of currents at places."""
    for n in numba.prange(len(points)):
        e, h = np.zeros(3, np.complex128), np.zeros(3, np.complex128)
        for m in range(len(places)):
            x, y, z = points[n] - places[m]
            r = np.sqrt(x * x + y * y + z * z)
            x, y, z = x / r, y / r, z / r
            jx, jy, jz = current[m]
            along = jx * x + jy * y + jz * z
            wave = -1j * k / (4 * np.pi * r) * (np.cos(k * r) - 1j * np.sin(k * r))
            ex, ey, ez = (jx - along * x) * wave, (jy - along * y) * wave, (jz - along * z) * wave
            e[0] += ex
            e[1] += ey
            e[2] += ez
            h[0] += y * ez - z * ey
            h[1] += z * ex - x * ez
            h[2] += x * ey - y * ex
        out[0, n], out[1, n] = e, h


def over_sheet(points: Array, k: float, per_wavelength: float) -> Waves:
    """Wave that the sheet, in y = `SHEET_Y`, radiates to points (point, 3) [m]."""
    step = 2 * pi / k / per_wavelength
    along = np.arange(-SHEET_HALF_M + step / 2, SHEET_HALF_M, step)
    u, v = np.meshgrid(along, along, indexing="ij")
    # Full in the middle half, and smoothly down to the edges, which then diffract nothing.
    taper = np.cos(pi / 2 * np.clip(2 * np.abs([u, v]) / SHEET_HALF_M - 1, 0, 1)) ** 2
    x, z = u + SHEET_MIDDLE[0], v + SHEET_MIDDLE[1]
    places = np.stack([x, np.full_like(x, SHEET_Y), z], axis=-1).reshape(-1, 3)
    normal = np.array([0.0, -1.0, 0.0])
    weight = (taper[0] * taper[1]).reshape(-1, 1) * step**2
    current = 2 * np.cross(normal, straight(places, k).magnetic) * weight
    out = np.empty((2, len(points), 3), dtype=np.complex128)
    _radiate(places, np.ascontiguousarray(current), np.ascontiguousarray(points), k, out)
    return Waves(out[0], out[1])


class Skin(NamedTuple):
    """Points of a body's surface (point, 3) [m], normals, areas [m^2], and their parts."""

    points: Array
    normals: Array
    areas: Array
    part: NDArray[np.int64]


def skin(bodies: rt.Ellipsoids, step: float) -> Skin:
    """Cover ellipsoids by points this far apart [m], without those inside of others."""
    kinds: list[list[Array]] = []
    for number, (centre, frame, axes) in enumerate(
        zip(bodies.centres, bodies.frames, bodies.semi_axes, strict=True)
    ):
        count = int(4 * pi * np.prod(axes) ** (2 / 3) * 1.2 / step**2)
        # Points of a spiral, alike in area on the sphere.
        z = 1 - (2 * np.arange(count) + 1) / count
        turn = np.arange(count) * pi * (3 - 5**0.5)
        ring = np.sqrt(1 - z**2)
        ball = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
        normal = ball / axes
        stretch = np.linalg.norm(normal, axis=1)
        area = 4 * pi / count * np.prod(axes) * stretch
        places = centre + (ball * axes) @ frame.T
        kinds.append([places, (normal / stretch[:, None]) @ frame.T, area, np.full(count, number)])
    points, normals, areas, part = (np.concatenate(arrays) for arrays in zip(*kinds, strict=True))
    free = np.ones(len(points), dtype=bool)
    for number in range(len(bodies.centres)):
        local = _stretched(bodies, number, points - bodies.centres[number])
        free &= ((local**2).sum(axis=1) > 1) | (part == number)
    return Skin(points[free], normals[free], areas[free], part[free])


def _stretched(bodies: rt.Ellipsoids, number: int, vectors: Array) -> Array:
    """Vectors in the axes in which that ellipsoid is the unit sphere."""
    return np.asarray(vectors @ bodies.frames[number] / bodies.semi_axes[number])


def unobstructed(bodies: rt.Ellipsoids, surface: Skin, direction: Array) -> NDArray[np.bool_]:
    """Whether no other ellipsoid is before points, for waves along directions (point, 3)."""
    free = np.ones(len(surface.points), dtype=bool)
    for number in range(len(bodies.centres)):
        o = _stretched(bodies, number, surface.points - bodies.centres[number])
        d = _stretched(bodies, number, -direction)
        half, square, rest = (o * d).sum(1), (d * d).sum(1), (o * o).sum(1) - 1
        hits = (half < 0) & (half**2 > square * rest)
        free &= ~hits | (surface.part == number)
    return np.asarray(free)


def brute_force(
    bodies: rt.Ellipsoids, k: float, per_wavelength: float, on_sheet: float
) -> dict[str, complex]:
    """Field of each path, as amplitudes of echoes: straight, over the sheet, and both ways.

    Points are so many a wavelength on the body and on the sheet.
    """
    surface = skin(bodies, 2 * pi / k / per_wavelength)
    waves = {"": straight(surface.points, k), "left": over_sheet(surface.points, k, on_sheet)}
    free = {name: unobstructed(bodies, surface, wave.direction) for name, wave in waves.items()}

    def answer(out: str, back: str) -> complex:
        """What the currents on all that is lit on the way out radiate, through their own part."""
        current = 2 * np.cross(surface.normals, waves[out].magnetic)
        reaction = (current * waves[back].electric).sum(axis=1) * surface.areas
        lit = free[out] & ((surface.normals * waves[out].direction).sum(axis=1) < 0)
        return complex(1j * k / np.sqrt(4 * pi) * reaction[lit & free[back]].sum())

    return {
        "body": answer("", ""),
        "left > body": answer("left", ""),
        "body > left": answer("", "left"),
        "left > body > left": answer("left", "left"),
    }


def bounce_rows(quick: bool) -> Iterator[Row]:
    """A person beside a sheet by `physical-optics` and by brute force."""
    radar = rt.Radar(
        tx_y=1, tx_z=0, rx_y=1, rx_z=0, position_m=tuple(ANTENNA.tolist()),
        start_frequency_hz=5.5e9, bandwidth_hz=1e9,
    )  # fmt: skip
    wall = Wall(
        name="left", corner_m=(-50.0, SHEET_Y, -50.0), edge_u_m=(100.0, 0.0, 0.0),
        edge_v_m=(0.0, 0.0, 100.0), material=material("perfect-conductor"), thickness_m=0.1,
    )  # fmt: skip
    frequency, errors = radar.centre_frequency_hz, dict[str, list[float]]()
    activities = ("walk",) if quick else ("walk", "kick", "sit")
    for activity in activities:
        body = Body.from_motion(rt.synthetic_motion(activity, duration_s=0.1))
        model: Any = build_model(
            "physical-optics", radar, body, scene=Scene(walls=(wall,)), order=2, facets=20480
        )
        echoes = model.echoes(np.array([0]))
        names = np.array(model.path_names)[echoes.path]
        found = field_of(echoes, np.array([frequency]))[0, 0, 0]
        at = body.at(np.array([0.5 * radar.chirp_interval_s]))
        bodies = rt.Ellipsoids(at.centres[0], at.frames[0], at.semi_axes)
        points = (6.0, 2.5) if quick else (8.0, 5.0)
        truth = brute_force(bodies, 2 * pi * frequency / SPEED_OF_LIGHT, *points)
        for name, expected in truth.items():
            ratio = found[names == name].sum() / np.conj(expected)
            errors.setdefault(name, []).append(abs(ratio - 1))
    for name, worst in errors.items():
        says = "a person beside a conducting sheet by `physical-optics`, against currents on both"
        quantity = f"{name}: complex error, worst of {len(activities)}"
        yield judged("beside a sheet", quantity, "", max(worst), 0.05, says=says, cases=len(worst))


def field_of(echoes: Echoes, frequency: Array) -> Field:
    """Field (frequency, chirp, rx, echo), of IF samples, at some frequencies [Hz]."""
    weights = interpolation_weights(echoes.frequency, frequency)
    turns = frequency[:, None, None, None] / SPEED_OF_LIGHT * echoes.length
    return np.asarray(np.tensordot(weights, echoes.amplitude, axes=1) * np.exp(2j * pi * turns))


# -- the living room -------------------------------------------------------------------------------


ROOM_LEVELS: dict[str, tuple[str, dict[str, Any]]] = {
    "specular": ("specular", {}),
    "specular, gradual": ("specular", {"visibility": "gradual"}),
    "physical-optics": ("physical-optics", {}),
    "rays": ("rays", {"rays_per_wavelength": 2.5}),
}


def room_rows(quick: bool) -> Iterator[Row]:
    """A walk in the living room: power by path over that of `specular` there."""
    scene = rt.Scene.load("living-room")
    preset = rt.Radar.preset("paper-12ghz")
    radar = scene.place(replace(preset, tx_y=2, tx_z=1, rx_y=2, rx_z=2))
    duration_s = 0.1 if quick else 0.6
    motion = rt.synthetic_motion("walk", duration_s=duration_s)
    body = Body.from_motion(place(motion, heading_deg=scene.heading_deg))
    chirps = np.arange(0, int(duration_s / radar.chirp_interval_s), 801)
    sweep = radar.start_frequency_hz + radar.bandwidth_hz * np.linspace(0, 1, 5)
    middle = body.at(np.array([duration_s / 2])).centres[0].mean(axis=0)
    powers: dict[str, dict[str, float]] = {}
    angles: dict[str, float] = {"all paths": 0.0}
    for level, (fidelity, options) in ROOM_LEVELS.items():
        model: Any = build_model(fidelity, radar, body, scene=scene, **options)
        echoes = model.echoes(chirps)
        field, names = field_of(echoes, sweep), np.array(model.path_names)[echoes.path]
        own = powers[level] = {"all paths": power(field)}
        for name in sorted(set(names.tolist())):
            # Out over a wall or back over it: by reciprocity the same.
            way = " > ".join(sorted(set(name.split(" > ")) - {"body"})) or "direct"
            own[way] = own.get(way, 0.0) + power(field[..., names == name])
            angles[way] = bistatic_deg(model.course(name, middle, radar), middle)
    optics = powers.pop("specular")
    strong = [name for name in optics if optics[name] > optics["direct"] * 10**-3.5]
    for level, found in powers.items():
        by_path = {name: 10 * np.log10(found[name] / optics[name]) for name in strong}
        claim = f"living room, {level} over specular"
        for name, ratio in by_path.items():
            strength = 10 * np.log10(optics[name] / optics["direct"])
            quantity = (
                f"{name}: {strength:.0f} dB of the direct, {angles[name]:.0f} deg between both ways"
            )
            yield reported(claim, quantity, "dB", float(ratio))
        # Where a wave hardly turns at the body, optics has no return to speak of.
        sure = [abs(ratio) for name, ratio in by_path.items() if angles[name] < LARGEST_DEG]
        says = "a walk in the living room by levels with diffraction, over `specular`, by path"
        quantity = f"worst path of up to {LARGEST_DEG:g} deg between both ways"
        yield judged(claim, quantity, "dB", float(max(sure)), 1.0, says=says, cases=len(sure))


def power(field: Field) -> float:
    """Mean power of the sum of echoes (..., echo)."""
    return float((np.abs(field.sum(axis=-1)) ** 2).mean())


def bistatic_deg(course: Array, middle: Array) -> float:
    """Angle at the body between the ways to both antennas, of the corners of a path [deg]."""
    body = int(np.linalg.norm(course - middle, axis=1).argmin())
    ways = course[[body - 1, body + 1]] - middle
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return float(np.degrees(np.arccos(np.clip(ways[0] @ ways[1], -1, 1))))


def measure(quick: bool) -> list[Row]:
    return [*bounce_rows(quick), *room_rows(quick)]


if __name__ == "__main__":
    sys.exit(main("Levels of fidelity in rooms, against brute force and specular.", measure))
