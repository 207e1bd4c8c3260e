"""The person over walls: lengths and returns against other methods, and ghosts in the maps.

Lengths: the body is mirrored in the walls instead of the antennas, and the shortest path over its
surface is found by a general minimiser. Returns: an ellipsoid beside a conducting plane against
vector physical optics, with image source and image receiver written out. Maps: a sphere moves in a
box room of conducting walls, without noise, and every isolated ghost must be found at the range,
the range rate and the angles that its path predicts. Tolerance: IF samples of a furnished room with
the default one beside those with every ghost at every chirp.

    python validation/other_methods/multipath.py [--quick] [--json FILE]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import numpy as np
from numpy.typing import NDArray
from physical_optics import lit_points, wave_number
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.process import angle, power_map, range_spectrum
from rtradar.scatter import build_model
from rtradar.scatter.multipath import keyframes
from rtradar.scatter.multipath.image_paths import WallPath
from rtradar.scene import Scene, Surface, Wall, material, room_walls
from rtradar.signal import synthesize
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import MovingEllipsoid, power_db

Array = NDArray[np.float64]
judged, reported = (partial(kind, key="multipath") for kind in (rows.judged, rows.reported))
LEAST_K_RHO = 10.0  # as in specular.py
TOLERANCE_DB = -35.0
SHAPES = {
    "torso": (0.12, 0.17, 0.25),
    "thigh": (0.08, 0.08, 0.24),
    "forearm": (0.05, 0.05, 0.14),
    "head": (0.1, 0.1, 0.12),
}


def box() -> tuple[Wall, ...]:
    """Conducting walls: x from -4.5 to 2.5 m, y from -2.2 to 3 m, z from 0 to 2.6 m."""
    surface = Surface(material=material("perfect-conductor"), thickness_m=0.1)
    return room_walls(
        (7.0, 5.2, 2.6),
        (-4.5, -2.2),
        dict.fromkeys(("near", "far", "right", "left", "floor", "ceiling"), surface),
    )


PLANES = {
    "near": (0, -4.5),
    "far": (0, 2.5),
    "right": (1, -2.2),
    "left": (1, 3.0),
    "floor": (2, 0.0),
    "ceiling": (2, 2.6),
}


def mirrored(points: Array, leg: tuple[str, ...]) -> Array:
    """Images of the body's points in the walls of a leg; the wall that is met last comes first."""
    out = np.array(points, dtype=np.float64)
    for name in reversed(leg):
        axis, place = PLANES[name]
        out[..., axis] = 2 * place - out[..., axis]
    return out


def walls_of(path: WallPath) -> tuple[tuple[str, ...], tuple[str, ...]]:
    out, back = (tuple(face.wall.name for face in leg) for leg in (path.out, path.back))
    return out, back


def shortest(
    tx: Array,
    rx: Array,
    pose: tuple[Array, Array, Array],
    legs: tuple[tuple[str, ...], tuple[str, ...]],
) -> float:
    """Shortest path [m] from Tx over one mirrored body, and from that point of the other, to Rx."""
    centre, frame, axes = pose

    def length(angles: Array) -> float:
        theta, phi = angles
        local = axes * np.array(
            [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
        )
        point = centre + frame @ local
        return float(
            np.linalg.norm(mirrored(point, legs[0]) - tx)
            + np.linalg.norm(mirrored(point, legs[1]) - rx)
        )

    grid = [
        np.array([theta, phi])
        for theta in np.linspace(0.2, 2.9, 9)
        for phi in np.linspace(0, 6.1, 16)
    ]
    start = min(grid, key=length)
    return float(
        minimize(
            length,
            start,
            method="Nelder-Mead",
            options={"xatol": 1e-10, "fatol": 1e-15, "maxiter": 2000},
        ).fun
    )


# -- lengths ---------------------------------------------------------------------------------------


def length_rows(quick: bool) -> Iterator[Row]:
    rng = np.random.default_rng(0)
    for preset in ("paper-12ghz", "paper-77ghz"):
        radar = rt.Radar.preset(preset)
        worst, count = {1: 0.0, 2: 0.0}, {1: 0, 2: 0}
        for seed, axes in enumerate(SHAPES.values()):
            frame = Rotation.random(random_state=seed).as_matrix()
            body = MovingEllipsoid((0.0, 0.4, 1.2), axes, (-1.2, 0.6, 0.1), frame)
            model = build_model("specular", radar, body, scene=Scene(walls=box()), order=2)
            # Between two keyframes, where the specular point is not known beforehand.
            chirps = np.sort(rng.integers(0, 4000, 2 if quick else 6))
            echoes = model.echoes(chirps)
            poses = body.at((chirps + 0.5) * radar.chirp_duration_s)
            for number, path in enumerate(model.paths):
                if path.order == 0:
                    continue
                for i, chirp in enumerate(chirps):
                    receiver = int(rng.integers(radar.n_rx))
                    if echoes.amplitude[0, i, receiver, number] == 0:
                        continue
                    tx, rx = (
                        radar.tx[chirp % radar.n_tx],
                        radar.rx[radar.rx_of_tx[chirp % radar.n_tx, receiver]],
                    )
                    pose = (poses.centres[i, 0], poses.frames[i, 0], np.array(axes))
                    error = abs(
                        echoes.length[i, receiver, number] - shortest(tx, rx, pose, walls_of(path))
                    )
                    worst[path.order], count[path.order] = (
                        max(worst[path.order], error),
                        count[path.order] + 1,
                    )
        for order, error in worst.items():
            says = "lengths of the person's paths over one and two walls, against the mirrored body"
            quantity = f"worst length, order {order}, {count[order]} paths"
            yield judged(
                f"box room, {preset}",
                quantity,
                "um",
                error * 1e6,
                1.0,
                says=says,
                cases=count[order],
            )


# -- returns ---------------------------------------------------------------------------------------


class Plane(NamedTuple):
    """A conducting plane, and the reflection of the half-space before it."""

    name: str
    turn: Array
    shift: Array

    def image(self, points: Array) -> Array:
        return points @ self.turn + self.shift


FLOOR = Plane("floor", np.diag([1.0, 1.0, -1.0]), np.zeros(3))
LEFT = Plane("left", np.diag([1.0, -1.0, 1.0]), np.array([0.0, 6.0, 0.0]))


def sent(ways: Array, polarization: str) -> Array:
    up = np.array([0.0, 0.0, 1.0])
    field = up - ways[:, 2:] * ways if polarization == "v" else np.cross(ways, up)
    return np.asarray(field / np.linalg.norm(field, axis=1, keepdims=True))


def vector_optics(
    plane: Plane,
    over: tuple[bool, bool],
    antenna: Array,
    body: MovingEllipsoid,
    polarization: str,
    sweep: Array,
) -> Array:
    """Co-polar scattering length over R1 R2 (frequency,), by currents 2 n x H on what is lit."""
    pose = body.at(np.zeros(1))
    centre, frame, axes = pose.centres[0, 0], pose.frames[0, 0], np.array(body.axes)
    tx, rx = (plane.image(antenna) if image else antenna for image in over)
    quadrature = lit_points(
        frame.T @ (tx - centre), frame.T @ (rx - centre), axes, float(sweep.max())
    )
    points = centre + quadrature.points @ frame.T
    normal = quadrature.points / axes**2 @ frame.T
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    fields, facing, ranges = [], 0.0, []
    for source, image in zip((tx, rx), over, strict=True):
        ways = points - source
        ranges.append(np.linalg.norm(ways, axis=1))
        ways = ways / ranges[-1][:, None]
        # The image of a source has its field mirrored and reversed, so that the tangential field on
        # the plane vanishes.
        fields.append(
            (
                ways,
                -sent(ways @ plane.turn, polarization) @ plane.turn
                if image
                else sent(ways, polarization),
            )
        )
        facing = facing - np.sum(normal * ways, axis=1) / 2
    (way, field), (_, received) = fields
    current = np.cross(normal, np.cross(way, field))
    # The reference's weights have scalar obliquity and spreading about the centre; those of the
    # vectors take their place.
    area = quadrature.weight / facing / (np.linalg.norm(tx - centre) * np.linalg.norm(rx - centre))
    copolar = np.sum(received * current, axis=1)
    k = np.array([wave_number(f) for f in sweep])[:, None]
    return np.asarray(
        1j
        * k[:, 0]
        / np.sqrt(np.pi)
        * np.sum(area * copolar * np.exp(-1j * k * (ranges[0] + ranges[1])), axis=1)
    )


def ours(
    plane: Plane, antenna: Array, body: MovingEllipsoid, polarization: str, sweep: Array
) -> dict[tuple[bool, bool], Array]:
    """The same by `RoomModel`, path by path."""
    u, v = (
        ((20.0, 0.0, 0.0), (0.0, 20.0, 0.0))
        if plane is FLOOR
        else ((20.0, 0.0, 0.0), (0.0, 0.0, 20.0))
    )
    corner = (-10.0, -10.0, 0.0) if plane is FLOOR else (-10.0, 3.0, -10.0)
    wall = Wall(
        name=plane.name,
        corner_m=corner,
        edge_u_m=u,
        edge_v_m=v,
        material=material("perfect-conductor"),
        thickness_m=0.1,
    )
    radar = rt.Radar(
        tx_y=1, tx_z=0, rx_y=1, rx_z=0, position_m=tuple(antenna), polarization=polarization
    )
    model = build_model("specular", radar, body, scene=Scene(walls=(wall,)), order=2)
    # Chirp 0 is 31 us late, a time in which nobody moves far.
    echoes = model.echoes(np.zeros(1, dtype=np.int64))
    found = {}
    for number, path in enumerate(model.paths):
        phase = np.exp(-2j * np.pi * sweep / 299_792_458.0 * echoes.length[0, 0, number])
        found[bool(path.out), bool(path.back)] = np.conj(echoes.amplitude[0, 0, 0, number]) * phase
    return found


def k_rho(plane: Plane, antenna: Array, body: MovingEllipsoid, sweep: Array) -> float:
    """Wave number at the sweep's middle times the smaller radius at the one-way specular point."""
    ways = [place - np.array(body.centre) for place in (antenna, plane.image(antenna))]
    normal = body.frame.T @ sum(way / np.linalg.norm(way) for way in ways)
    normal /= np.linalg.norm(normal)
    smaller, _ = rt.rcs.ellipsoid_radii(
        *body.axes, np.arccos(normal[2]), np.arctan2(normal[1], normal[0])
    )
    return wave_number(float(sweep.mean())) * float(smaller)


def optics_rows(quick: bool) -> Iterator[Row]:
    sweep = np.linspace(12e9, 16e9, 9 if quick else 33)
    antenna = np.array([-4.0, 1.0, 1.0])
    ghosts: dict[str, list[float]] = {
        "one leg over the plane": [],
        "both legs over the plane": [],
        "all four together": [],
    }
    tight: list[float] = []
    places = ((0.0, 0.0, 1.1),) if quick else ((0.0, 0.0, 1.1), (-1.0, 1.6, 0.8), (1.0, -0.5, 1.5))
    for plane, polarization, (seed, axes), place in product(
        (FLOOR, LEFT), "vh", enumerate(SHAPES.values()), places
    ):
        frame = Rotation.random(random_state=10 + seed).as_matrix()
        body = MovingEllipsoid(place, axes, frame=frame)
        mine = ours(plane, antenna, body, polarization, sweep)
        if any((values == 0).all() for values in mine.values()):
            continue
        optics = {
            over: vector_optics(plane, over, antenna, body, polarization, sweep) for over in mine
        }
        power = {
            over: (np.mean(np.abs(mine[over]) ** 2), np.mean(np.abs(optics[over]) ** 2))
            for over in mine
        }
        one_way = [power_db(np.divide(*power[over])) for over in ((True, False), (False, True))]
        if k_rho(plane, antenna, body, sweep) < LEAST_K_RHO:
            tight += one_way
            continue
        ghosts["one leg over the plane"] += one_way
        ghosts["both legs over the plane"].append(power_db(np.divide(*power[True, True])))
        total = [np.mean(np.abs(sum(fields.values())) ** 2) for fields in (mine, optics)]
        ghosts["all four together"].append(power_db(total[0] / total[1]))
    for name, errors in ghosts.items():
        # Power is averaged over the sweep, because the terminator wave of physical optics makes it
        # ripple.
        says = "image method against bistatic vector PO, an ellipsoid beside a conducting plane"
        worst = float(np.abs(errors).max())
        claim = "beside a conducting plane"
        yield judged(
            claim,
            f"{name}: worst |dB|, {len(errors)} cases",
            "dB",
            worst,
            0.4,
            says=says,
            cases=len(errors),
        )
        yield reported(claim, f"{name}: rms", "dB", float(np.sqrt(np.mean(np.square(errors)))))
    if tight:
        # This is tighter than the limit of `specular` itself; physical optics is not reciprocal
        # there, and v and h differ by 0.2 dB.
        quantity = f"one leg, k rho below {LEAST_K_RHO:g}: worst |dB|, {len(tight)} cases"
        yield reported("beside a conducting plane", quantity, "dB", float(np.abs(tight).max()))


# -- maps ------------------------------------------------------------------------------------------


def map_rows(quick: bool) -> Iterator[Row]:
    radar = rt.Radar.preset("paper-12ghz")
    found: dict[str, list[float]] = {"range": [], "velocity": [], "azimuth": [], "elevation": []}
    starts = (
        ((0.2, -0.4, 1.2), (-1.5, 0.6, 0.0)),
        ((0.8, 0.9, 1.0), (-1.0, -1.2, 0.3)),
        ((-0.8, 0.2, 1.5), (1.3, 1.0, -0.3)),
    )
    # All walls once, and the same one twice.
    rooms = [(box(), 1), *(((wall,), 2) for wall in box() if wall.name not in ("near", "far"))]
    for (walls, order), (start, velocity) in product(rooms, starts[: 1 if quick else 3]):
        mover = MovingEllipsoid(start, (0.12,) * 3, velocity)
        for name, errors in ghosts_of(radar, mover, walls, order).items():
            found[name] += errors
    limits = {
        "range": ("range bin", 1.0),
        "velocity": ("Doppler bin", 1.0),
        "azimuth": ("beam", 1.0),
        "elevation": ("beam", 1.0),
    }
    for name, errors in found.items():
        unit, limit = limits[name]
        says = "ghosts of a moving sphere in a box room, at their predicted places"
        quantity = f"worst {name}, {len(errors)} ghosts"
        yield judged(
            "box room, 12 GHz",
            quantity,
            unit,
            float(np.max(errors)),
            limit,
            says=says,
            cases=len(errors),
        )


class Ghost(NamedTuple):
    """Prediction of a path for the middle of a frame."""

    legs: tuple[tuple[str, ...], tuple[str, ...]]
    range_m: float
    velocity: float
    lengths: Array
    strength: float


def ghosts_of(
    radar: rt.Radar, body: MovingEllipsoid, walls: tuple[Wall, ...], order: int
) -> dict[str, list[float]]:
    model = build_model("specular", radar, body, scene=Scene(walls=walls), order=order)
    chirps = np.arange(radar.chirps_per_frame)
    echoes = model.echoes(chirps)
    x = synthesize(echoes, radar, radar.chirp_times(len(chirps)), dtype=np.complex64)
    spectra = range_spectrum(x, radar).reshape(-1, radar.n_tx, radar.n_rx, radar.samples_per_chirp)
    power = np.asarray(power_map(spectra, radar))
    middle = radar.chirps_per_frame * radar.chirp_duration_s / 2
    strength = (np.abs(echoes.amplitude[0]) ** 2).mean(axis=(0, 1))
    # A wall on the way out or on the way back gives the same ghost.
    ghosts = [
        predicted(radar, body, walls_of(model.paths[i]), middle, strength[i])
        for i in np.flatnonzero(strength)
        if walls_of(model.paths[i]) <= walls_of(model.paths[i])[::-1]
    ]
    axis = radar.velocity_mps(radar.cycles_per_frame)
    found: dict[str, list[float]] = {"range": [], "velocity": [], "azimuth": [], "elevation": []}
    for ghost in ghosts:
        if ghost.legs == ((), ()) or not alone(ghost, ghosts, radar):
            continue
        row, column = (
            round(ghost.range_m / radar.range_bin_m),
            int(np.abs(axis - ghost.velocity).argmin()),
        )
        rows_, columns = slice(row - 3, row + 4), slice(column - 3, column + 4)
        near = power[rows_, columns]
        # The centroid of its peak, because a ghost may cross more than a bin in 0.1 s.
        weight = near * (near > near.max() / 10)
        found["range"].append(
            abs(float((weight.sum(axis=1) @ radar.range_m[rows_]) / weight.sum()) - ghost.range_m)
            / radar.range_bin_m
        )
        seen = float((weight.sum(axis=0) @ axis[columns]) / weight.sum())
        found["velocity"].append(abs(seen - ghost.velocity) / radar.velocity_bin_mps)
        azimuth, elevation = angle(x, radar, ghost.range_m, ghost.velocity)
        for name, sine, peaks in zip(
            ("azimuth", "elevation"),
            (np.sin(azimuth) * np.cos(elevation), np.sin(elevation)),
            apparent(radar, ghost),
            strict=True,
        ):
            # Sines are ambiguous by the wavelength over the spacing of the virtual array.
            period = 2 * np.sin(np.radians(radar.max_angle_deg))
            apart = np.abs((sine - peaks + period / 2) % period - period / 2).min()
            found[name].append(float(apart / np.radians(radar.angle_resolution_deg)))
    return found


def predicted(
    radar: rt.Radar,
    body: MovingEllipsoid,
    legs: tuple[tuple[str, ...], tuple[str, ...]],
    middle: float,
    strength: float,
) -> Ghost:
    place = np.asarray(radar.position_m)
    step = 0.02
    ways = []
    for time in (middle - step, middle, middle + step):
        pose = body.at(np.array([time]))
        local = (pose.centres[0, 0], pose.frames[0, 0], np.array(body.axes))
        ways.append(shortest(place, place, local, legs))
    centre = body.at(np.array([middle])).centres[0, 0]
    # Of a sphere, less its radius and a little; over (two, tx, rx), out and back.
    lengths = np.array(
        [
            paths_over(radar, *(mirrored(centre, leg) for leg in order))
            for order in (legs, legs[::-1])
        ]
    )
    return Ghost(legs, ways[1] / 2, (ways[2] - ways[0]) / (4 * step), lengths, strength)


def paths_over(radar: rt.Radar, out: Array, back: Array) -> Array:
    received = radar.rx[radar.rx_of_tx]
    return np.asarray(
        np.linalg.norm(radar.tx - out, axis=1)[:, None] + np.linalg.norm(received - back, axis=2)
    )


def alone(ghost: Ghost, others: list[Ghost], radar: rt.Radar) -> bool:
    """Whether nothing that matters is within four cells: Hann's side lobes are at -31 dB."""
    for other in others:
        if other is ghost:
            continue
        apart = max(
            abs(ghost.range_m - other.range_m) / radar.range_bin_m,
            abs(ghost.velocity - other.velocity) / radar.velocity_bin_mps,
        )
        if apart < 5 and other.strength > ghost.strength * 1e-3:
            return False
    return ghost.range_m < radar.max_range_m - 0.3


def apparent(radar: rt.Radar, ghost: Ghost) -> tuple[Array, Array]:
    """Sines along y and z at which the lengths over the channels fit one place best, to half power.

    With a wall on one leg only, Tx and Rx see the ghost in different directions. It then appears
    where the beam of the one meets a grating lobe of the other, and there may be two such places,
    one for each order of the legs.
    """
    sines = np.linspace(-0.9, 0.9, 7201)
    found = []
    for axis, line in ((1, slice(0, radar.tx_y)), (2, slice(radar.tx_y, None))):
        across = [
            antennas[..., axis] - radar.position_m[axis]
            for antennas in (radar.tx[line], radar.rx[radar.rx_of_tx[line]])
        ]
        # |place - antenna| for a place at that range, in a plane with the line.
        r = ghost.range_m
        ways = [
            np.sqrt(r * r - 2 * r * sines * offset[..., None] + offset[..., None] ** 2)
            for offset in across
        ]
        steered = ways[0][:, None] + ways[1]
        turns = (ghost.lengths[:, line, :, None] - steered) / radar.wavelength_m
        power = np.abs(np.exp(2j * np.pi * turns).sum(axis=(0, 1, 2))) ** 2
        peak = (
            (power[1:-1] >= power[:-2])
            & (power[1:-1] >= power[2:])
            & (power[1:-1] > power.max() / 2)
        )
        found.append(sines[1:-1][peak])
    return found[0], found[1]


def keyframe_rows(quick: bool) -> Iterator[Row]:
    """Error of the interpolation between keyframes of ghosts, for a person in a living room.

    It is reported, not judged, so --quick leaves it out.
    """
    if quick:
        return
    scene = Scene.load("living-room")
    radar = scene.place(rt.Radar.preset("paper-12ghz"))
    motion = rt.motion.place(
        rt.synthetic_motion("walk", seed=0, duration_s=3.0), heading_deg=scene.heading_deg
    )
    body = rt.Body.from_motion(motion.shifted([*scene.person_position_m, 0.0]))
    # A tenth of a second from the middle of the capture on.
    chirps = np.arange(radar.chirps_per_frame) + 20_000 // radar.n_tx * radar.n_tx
    fields = {}
    for apart_s in (2.5e-3, keyframes.KEYFRAMES_S):
        with mock.patch.object(keyframes, "KEYFRAMES_S", apart_s):
            model = build_model("specular", radar, body, scene=scene)
            echoes = model.echoes(chirps)
        phase = 2 * np.pi * radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS * echoes.length
        field = echoes.amplitude[len(echoes.frequency) // 2] * np.exp(1j * phase)
        # The delays of slabs make several echoes of one path and part.
        owned = list(zip(echoes.path.tolist(), echoes.part.tolist(), strict=True))
        paths = sorted(
            {own for own, bounces in zip(owned, echoes.bounces, strict=True) if bounces > 1}
        )
        of_path = np.array([[own == path for path in paths] for own in owned], dtype=np.float64)
        fields[apart_s] = field @ of_path
    first, last = fields.values()
    error = power_db((np.abs(last - first) ** 2).sum() / (np.abs(first) ** 2).sum())
    yield reported(
        "living room, walk",
        f"ghosts at keyframes {keyframes.KEYFRAMES_S * 1e3:g} ms apart against 2.5 ms",
        "dB",
        error,
    )


def tolerance_rows(quick: bool) -> Iterator[Row]:
    """Samples of a furnished room with the default tolerance beside those with every ghost.

    Without a tolerance ghosts are found at every chirp, and so is the shadow in the clutter.
    """
    duration_s = 0.2 if quick else 1.0
    paper, room = rt.Radar.preset("paper-12ghz"), Scene.load("living-room")
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.2 if quick else 3.0)
    radars = {"": paper} | ({} if quick else {", two Rx": replace(paper, rx_y=1, rx_z=1)})
    for which, radar in radars.items():

        def samples(scene: Scene, radar: rt.Radar = radar, **options: Any) -> Array:
            given = {"snr_db": math.inf, "duration_s": duration_s} | options
            return np.asarray(rt.simulate(motion, radar, scene, **given).samples.values)

        exact = samples(room, path_tolerance_db=None)
        error = samples(room, path_tolerance_db=TOLERANCE_DB) - exact
        person = samples(Scene())
        error_db = power_db((np.abs(error) ** 2).mean() / (np.abs(person) ** 2).mean())
        claim = f"living room, {duration_s:g} s of a walk{which}"
        says = "ghosts of a furnished room at anchors: power of the error over the tolerance"
        yield reported(claim, "error of ghosts over the person's power", "dB", error_db)
        if not which:
            yield judged(
                claim, "error of ghosts over what is tolerated", "1",
                10 ** ((error_db - TOLERANCE_DB) / 10), 1.0,
                says=says,
            )  # fmt: skip


def measure(quick: bool) -> list[Row]:
    parts = (length_rows, optics_rows, map_rows, keyframe_rows, tolerance_rows)
    return [row for rows in parts for row in rows(quick)]


if __name__ == "__main__":
    sys.exit(main("The person over walls, against mirrored bodies and physical optics.", measure))
