"""Walls of any thickness against exact slabs: a sphere behind them, ghosts, clutter, and a walk.

The slab is solved here, by the transfer matrix of its tangential fields, at 401 frequencies of the
sweep; materials enter by their permittivity alone. A conducting sphere has one specular point,
found by iterating on the bisector of its legs, and the curvature of what it reflects has a closed
form. Fields are vectors: each slab multiplies their TE and TM parts. A leg goes straight on through
a wall, as in the package; waves from edges, or from the curvature of the wavefront, are not judged.

Errors of a complex spectrum are the largest over the sweep and all channels, over the rms of the
exact spectrum; those of clutter are over its largest magnitude, as promised. The range of the
sphere is read from the range spectrum, as a user would.

    python validation/closed_forms/thick_walls.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.errors import InputError
from rtradar.scatter import build_model
from rtradar.scatter.clutter.returns import RoomEchoes
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scene import Furniture, Material, Scene, Wall, material, own_material
from rtradar.signal import synthesize
from rtradar.validate.rows import Row, judged, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import MovingEllipsoid

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
C = 299_792_458.0
FREQUENCIES = 401
RADIUS_M = 0.12
LOSS_DB = 40.0
FIELD_LIMIT, RANGE_LIMIT, CLUTTER_LIMIT = 0.02, 0.05, 1e-3
THICK = (
    ("brick", 0.10),
    ("brick", 0.24),
    ("concrete", 0.10),
    ("wood", 0.10),
    ("glass", 0.02),
    ("chipboard", 0.05),
)
MIRRORS = (
    ("brick", 0.11),
    ("brick", 0.24),
    ("plasterboard", 0.025),
    ("plasterboard", 0.0125),
    ("glass", 0.02),
)
PRESETS = ("paper-12ghz", "paper-77ghz")


def made_of(name: str, radar: rt.Radar) -> Material:
    """Material by name; beyond 40 GHz brick keeps the constants of ITU-R P.2040-3 for 40 GHz."""
    if name == "brick" and radar.start_frequency_hz > 40e9:
        constants = {"a": 3.91, "c": 0.0238, "d": 0.16}
        return own_material(
            "brick-beyond-40-ghz",
            source="constants of below 40 GHz",
            low_hz=1e9,
            high_hz=100e9,
            **constants,
        )
    return material(name)


def across_x(name: str, made: Material, thickness: float, x: float) -> Wall:
    """A large wall whose front, at x, faces the radar."""
    edges = {"edge_u_m": (0.0, 0.0, 40.0), "edge_v_m": (0.0, 40.0, 0.0)}
    return Wall(
        name=name, corner_m=(x, -20.0, -20.0), material=made, thickness_m=thickness, **edges
    )


def across_y(name: str, made: Material, thickness: float, y: float) -> Wall:
    """A large wall whose front, at y, faces right, where the radar is."""
    edges = {"edge_u_m": (40.0, 0.0, 0.0), "edge_v_m": (0.0, 0.0, 40.0)}
    return Wall(
        name=name, corner_m=(-20.0, y, -20.0), material=made, thickness_m=thickness, **edges
    )


# -- the exact slab --------------------------------------------------------------------------------


def exact_slab(
    eta: Field, thickness: float, frequency: Array, cosine: float, te: bool
) -> tuple[Field, Field]:
    """Reflection (frequency,), and transmission in place of air, by the transfer matrix."""
    k = 2 * np.pi * frequency / C
    normal = np.sqrt(eta - (1 - cosine**2) + 0j)
    normal = np.where(normal.imag > 0, -normal, normal)
    depth = k * thickness * normal
    # Ratio of magnetic to electric tangential field, in air and inside, in units of air's.
    air, inner = (cosine, normal) if te else (1 / cosine, eta / normal)
    a, b, c = np.cos(depth), 1j * np.sin(depth) / inner, 1j * np.sin(depth) * inner
    total = (a + b * air) * air + c + a * air
    reflected = ((a + b * air) * air - c - a * air) / total
    transmitted = 2 * air / total * np.exp(1j * k * thickness * cosine)
    # TM unit vectors follow the wave: the reflected one has the opposite tangential field.
    return (reflected if te else -reflected), transmitted


def unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def sent(way: Array) -> Array:
    """Vertical polarisation: world z, projected across the direction."""
    up = np.array([0.0, 0.0, 1.0])
    return unit(up - way[2] * way)


def met(
    wall: Wall, field: Field, way: Array, frequency: Array, mirrored: bool
) -> tuple[Field, Array]:
    """Field (frequency, 3) behind a wall or reflected by it, and its direction."""
    normal = unit(np.cross(wall.edge_u_m, wall.edge_v_m))
    cosine = abs(float(way @ normal))
    if wall.material.conducts:
        coefficients: Any = (-1.0, 1.0) if mirrored else (0.0, 0.0)
    else:
        eta = wall.material.eta(frequency)
        coefficients = [
            exact_slab(eta, wall.thickness_m, frequency, cosine, te)[0 if mirrored else 1]
            for te in (True, False)
        ]
    onward = way - 2 * (way @ normal) * normal if mirrored else way
    side = np.cross(way, normal)
    side = unit(side if np.linalg.norm(side) > 1e-9 else np.array(wall.edge_u_m))
    te, tm = (
        (field @ axis) * factor
        for axis, factor in zip((side, np.cross(side, way)), coefficients, strict=True)
    )
    return te[:, None] * side + tm[:, None] * np.cross(side, onward), onward


def over(wall: Wall, point: Array) -> Array:
    """Image of a point in the front."""
    normal = unit(np.cross(wall.edge_u_m, wall.edge_v_m))
    return point - 2 * ((point - np.array(wall.corner_m)) @ normal) * normal


def arrived(
    antenna: Array, point: Array, wall: Wall, mirrored: bool, frequency: Array
) -> tuple[Field, Array, float]:
    """Field at a point, the direction in which it arrives, and the distance that it went."""
    source = over(wall, antenna) if mirrored else antenna
    onward = unit(point - source)
    normal = unit(np.cross(wall.edge_u_m, wall.edge_v_m))
    way = onward - 2 * (onward @ normal) * normal if mirrored else onward
    field, _ = met(wall, np.tile(sent(way) + 0j, (len(frequency), 1)), way, frequency, mirrored)
    return field, onward, float(np.linalg.norm(point - source))


NOTHING = across_x("none", material("vacuum"), 0.1, -100.0)


def exact_echo(
    tx: Array,
    rx: Array,
    centre: Array,
    out: tuple[Wall, bool],
    back: tuple[Wall, bool],
    frequency: Array,
) -> Field:
    """Spectrum (frequency,) of the sphere's specular echo; each leg through a wall, or over it."""
    starts = [
        over(wall, antenna) if mirrored else antenna
        for antenna, (wall, mirrored) in ((tx, out), (rx, back))
    ]
    point = centre
    for _ in range(200):
        point = centre + RADIUS_M * unit(sum(unit(start - point) for start in starts))
    (field, way, r1), (received, _, r2) = (
        arrived(antenna, point, wall, mirrored, frequency)
        for antenna, (wall, mirrored) in ((tx, out), (rx, back))
    )
    normal = unit(point - centre)
    cosine = -float(way @ normal)
    spread, bend = 1 / r1 + 1 / r2, 2 * cosine / RADIUS_M
    strength = (
        2
        * np.sqrt(np.pi)
        * cosine
        / np.sqrt((cosine**2 * spread + bend) * (spread + bend))
        / (r1 * r2)
    )
    turned = 2 * (field @ normal)[:, None] * normal - field
    # A conductor that returns the field straight back counts as +1.
    share = -(turned * received).sum(axis=1)
    return np.asarray(strength * share * np.exp(-2j * np.pi * frequency / C * (r1 + r2)))


# -- the package's ---------------------------------------------------------------------------------


def through_nodes(nodes: Array, places: Array) -> Array:
    """Values (place, node) of the polynomials that are 1 at one node and 0 at the others."""
    weights = np.ones((len(places), len(nodes)))
    for column, node in enumerate(nodes):
        for other in np.delete(nodes, column):
            weights[:, column] *= (places - other) / (node - other)
    return weights


def spectrum(length: Array, amplitude: Field, nodes: Array, frequency: Array) -> Field:
    """Spectrum (frequency, ...) of echoes, lengths (..., echo) and amplitudes (node, ..., echo)."""
    values = np.tensordot(through_nodes(nodes, frequency), amplitude, axes=1)
    k = (2 * np.pi * frequency / C).reshape(-1, *(1,) * length.ndim)
    return np.asarray((np.conj(values) * np.exp(-1j * k * length)).sum(axis=-1))


def sweep(radar: rt.Radar) -> Array:
    return np.linspace(
        radar.start_frequency_hz, radar.start_frequency_hz + radar.bandwidth_hz, FREQUENCIES
    )


def at_walls(name: str, **changes: Any) -> rt.Radar:
    return replace(rt.Radar.preset(name), position_m=(-2.0, 0.0, 1.0), **changes)


def relative(ours: Field, exact: Field) -> float:
    """Largest error over the sweep and all channels, over the rms of the channel."""
    return float((np.abs(ours - exact) / np.sqrt((np.abs(exact) ** 2).mean(axis=0))).max())


# -- a sphere behind a wall ------------------------------------------------------------------------


def peak_m(samples: NDArray[np.complexfloating], radar: rt.Radar) -> float:
    """Range of the highest peak of a channel [m], between bins by zero-padding and a parabola."""
    n, finer = len(samples), 32
    power = np.log(np.abs(np.fft.fft(samples * np.hanning(n + 1)[:-1], n * finer)) + 1e-300)
    top = int(power.argmax())
    left, middle, right = power[[top - 1, top, (top + 1) % len(power)]]
    return (top + 0.5 * (left - right) / (left - 2 * middle + right)) / finer * radar.range_bin_m


def behind_rows(quick: bool) -> Iterator[Row]:
    """Every Tx, in the middle of the 20 ms between which walls are evaluated; oblique flight."""
    places = {"straight on": (2.0, 0.0, 1.0), "35 degrees": (1.6, 2.6, 0.7)}
    for preset in PRESETS:
        radar = at_walls(preset)
        first = round(0.03 / radar.cycle_duration_s) * radar.n_tx
        frequency, chirps = sweep(radar), first + np.arange(radar.n_tx)
        times = radar.chirp_times(len(chirps), first)
        fast = (
            radar.start_frequency_hz
            + radar.slope_hz_per_s * np.arange(radar.samples_per_chirp) / radar.sample_rate_hz
        )
        for name, thickness in THICK if not quick else THICK[1:5:3]:
            wall = across_x("wall", made_of(name, radar), thickness, 0.0)
            for where, centre in (
                places.items() if not quick else [("35 degrees", places["35 degrees"])]
            ):
                body = MovingEllipsoid(centre, (RADIUS_M,) * 3, (0.5, 1.5, 0.0))
                model = build_model("specular", radar, body, scene=Scene(walls=(wall,)), order=0)
                echoes = model.echoes(chirps)
                ours = spectrum(echoes.length, echoes.amplitude, echoes.frequency, frequency)
                rx = radar.rx[radar.rx_of_tx]
                channels = [(i, j) for i in range(radar.n_tx) for j in range(0, radar.n_rx, 3)]
                legs = ((wall, False), (wall, False))
                exact, mine, shift = [], [], 0.0
                samples = synthesize(echoes, radar, times)
                for i, j in channels:
                    ends = (radar.tx[i], rx[i, j], body.at(times[i : i + 1]).centres[0, 0], *legs)
                    exact.append(exact_echo(*ends, frequency))
                    mine.append(ours[:, i, j])
                    peaks = (
                        peak_m(samples[i, j], radar),
                        peak_m(exact_echo(*ends, fast).conj(), radar),
                    )
                    shift = max(shift, abs(peaks[0] - peaks[1]) / radar.range_bin_m)
                free = [
                    abs(
                        exact_echo(
                            radar.tx[0],
                            rx[0, 0],
                            np.array(centre),
                            *((NOTHING, False),) * 2,
                            frequency,
                        )
                    )
                ]
                loss = float(
                    -20 * np.log10(np.sqrt((np.abs(exact[0]) ** 2).mean()) / free[0].mean())
                )
                claim = f"{preset}, behind {name} of {1e2 * thickness:g} cm, {where}"
                yield reported(claim, "two-way loss", "dB", loss)
                error = relative(np.array(mine).T, np.array(exact).T)
                quantity = "a sphere behind a thick wall: complex error"
                if loss < LOSS_DB:
                    yield judged(
                        claim, quantity, "", error, FIELD_LIMIT, says=quantity, cases=len(channels)
                    )
                    quantity = "a sphere behind a thick wall: range"
                    yield judged(
                        claim,
                        quantity,
                        "bin",
                        shift,
                        RANGE_LIMIT,
                        says=quantity,
                        cases=len(channels),
                    )
                else:
                    yield reported(claim, f"{quantity}, above {LOSS_DB:g} dB of loss", "", error)
                    yield reported(claim, f"range, above {LOSS_DB:g} dB of loss", "bin", shift)
                yield reported(
                    claim, "echoes", "", float((echoes.amplitude != 0).any(axis=(0, 1, 2)).sum())
                )


# -- its ghosts off a wall -------------------------------------------------------------------------


def ghost_rows(quick: bool) -> Iterator[Row]:
    for preset in PRESETS:
        radar = at_walls(preset)
        frequency, chirps = sweep(radar), np.arange(radar.n_tx)
        rx = radar.rx[radar.rx_of_tx]
        for name, thickness in MIRRORS if not quick else MIRRORS[:3:2]:
            wall = across_y("left", made_of(name, radar), thickness, 1.6)
            for where, centre in {
                "53 degrees": (2.0, -0.3, 1.2),
                "32 degrees": (0.0, 0.1, 0.8),
            }.items():
                ball = MovingEllipsoid(centre, (RADIUS_M,) * 3)
                model = build_model("specular", radar, ball, scene=Scene(walls=(wall,)), order=2)
                echoes = model.echoes(chirps)
                names = np.array(model.path_names)[echoes.path]
                for path, sides in {
                    "left > body": (True, False),
                    "left > body > left": (True, True),
                }.items():
                    own = names == path
                    ours = spectrum(
                        echoes.length[..., own],
                        echoes.amplitude[..., own],
                        echoes.frequency,
                        frequency,
                    )
                    mine, exact = [], []
                    for i in range(radar.n_tx):
                        for j in range(0, radar.n_rx, 3):
                            ends = (
                                radar.tx[i],
                                rx[i, j],
                                np.array(centre),
                                (wall if sides[0] else NOTHING, sides[0]),
                            )
                            exact.append(
                                exact_echo(
                                    *ends, (wall if sides[1] else NOTHING, sides[1]), frequency
                                )
                            )
                            mine.append(ours[:, i, j])
                    claim = f"{preset}, off {name} of {1e3 * thickness:g} mm at {where}, {path}"
                    quantity = "a ghost off a wall whose back answers: complex error"
                    error = relative(np.array(mine).T, np.array(exact).T)
                    yield judged(
                        claim, quantity, "", error, FIELD_LIMIT, says=quantity, cases=len(mine)
                    )
                    count = float((echoes.amplitude[..., own] != 0).any(axis=(0, 1, 2)).sum())
                    yield reported(claim, "echoes", "", count)


# -- static clutter --------------------------------------------------------------------------------


def mirrored_field(walls: list[tuple[Wall, bool]], tx: Array, rx: Array, frequency: Array) -> Field:
    """Spectrum of one specular path: each wall of a list is passed, or reflects where True."""
    source = tx
    for wall, mirrored in walls:
        source = over(wall, source) if mirrored else source
    way = unit(rx - source)
    # Back to the direction in which the wave set out.
    for wall, mirrored in reversed(walls):
        normal = unit(np.cross(wall.edge_u_m, wall.edge_v_m))
        way = way - 2 * (way @ normal) * normal if mirrored else way
    field: Field = np.tile(sent(way) + 0j, (len(frequency), 1))
    for wall, mirrored in walls:
        field, way = met(wall, field, way, frequency, mirrored)
    length = float(np.linalg.norm(rx - source))
    return np.asarray(
        -2
        * np.sqrt(np.pi)
        * (field @ sent(-way))
        / length
        * np.exp(-2j * np.pi * frequency / C * length)
    )


def of_strongest(ours: Field, exact: Field) -> float:
    return float(np.abs(ours - exact).max() / np.abs(exact).max())


def received(
    radar: rt.Radar, walls: tuple[Wall, ...], furniture: tuple[Furniture, ...] = ()
) -> tuple[RoomEchoes, ...] | str:
    """Clutter of a room, or the one-line message by which it is refused."""
    try:
        return Clutter(radar, Scene(walls=walls, furniture=furniture), order=1).objects
    except InputError as refusal:
        return str(refusal)


def clutter_row(claim: str, kind: str, error: float | str) -> Row:
    says = f"static clutter, {kind}: error over the strongest, or refused"
    if isinstance(error, str):
        return judged(
            claim,
            f"{kind}, refused in one line",
            "",
            float("\n" in error or len(error) > 300),
            0.0,
            says=says,
        )
    return judged(claim, kind, "", error, CLUTTER_LIMIT, says=says)


def clutter_rows(quick: bool) -> Iterator[Row]:
    few = {"tx_y": 2, "tx_z": 2, "rx_y": 1, "rx_z": 1}
    for preset in PRESETS:
        # As many samples as it takes to reach what is behind 24 cm of brick.
        radar = at_walls(preset, samples_per_chirp=512, **few)
        frequency = sweep(radar)
        kept = radar.rx[radar.rx_of_tx]
        channels = [(i, j) for i in range(radar.n_tx) for j in range(radar.n_rx)]
        metal = material("perfect-conductor")
        walls = [*MIRRORS, ("concrete", 0.10), ("wood", 0.10), ("chipboard", 0.05)]
        for name, thickness in walls if not quick else MIRRORS[:2]:
            pane = across_x("pane", made_of(name, radar), thickness, 0.0)
            side = across_y("side", made_of(name, radar), thickness, 1.6)
            far = across_x("far", metal, 0.1, 1.5)
            behind = [(pane, False), (far, True), (pane, False)]
            # A loss of over 60 dB in the wall is not judged.
            for label, room, object_name, course in (
                ("a specular reflection off a wall", (side,), "side", [(side, True)]),
                ("a conductor behind a wall", (pane, far), "far", behind),
            ):
                claim = f"{preset}, {name} of {1e3 * thickness:g} mm"
                exact = np.array(
                    [
                        mirrored_field(course, radar.tx[i], kept[i, j], frequency)
                        for i, j in channels
                    ]
                ).T
                if np.abs(exact).max() < 1e-3:
                    continue
                objects = received(radar, room)
                if isinstance(objects, str):
                    yield clutter_row(claim, label, objects)
                    continue
                (own,) = (echoes for echoes in objects if echoes.name == object_name)
                ours = spectrum(own.length, own.amplitude, own.frequency, frequency).reshape(
                    FREQUENCIES, -1
                )
                yield clutter_row(claim, label, of_strongest(ours, exact))
                yield reported(
                    claim,
                    f"{label}, echoes at {len(own.frequency)} frequencies",
                    "",
                    float(own.n_echoes),
                )
    yield from furniture_rows(quick)


def passed(antennas: Array, points: Array, wall: Wall, frequency: Array) -> Field:
    """Co-polar transmission of a wall from antennas to points, (frequency, antenna, point)."""
    out = np.empty((len(frequency), len(antennas), len(points)), dtype=np.complex128)
    for i, antenna in enumerate(antennas):
        for j, point in enumerate(points):
            way = unit(point - antenna)
            field, _ = met(
                wall, np.tile(sent(way) + 0j, (len(frequency), 1)), way, frequency, False
            )
            out[:, i, j] = field @ sent(way)
    return out


def furniture_rows(quick: bool) -> Iterator[Row]:
    """Furniture and rough walls behind a pane: their return without it, times the pane's loss."""
    few = {"tx_y": 2, "tx_z": 0, "rx_y": 1, "rx_z": 0}
    for preset in PRESETS[: 1 if quick else 2]:
        radar = at_walls(preset, samples_per_chirp=512, **few)
        frequency = sweep(radar)
        metal = material("perfect-conductor")
        box = Furniture(
            name="box", mesh="trihedral", material=metal, position_m=(1.0, 0.2, 1.0), yaw_deg=180.0
        )
        edges = {"edge_u_m": (0.0, 0.0, 0.3), "edge_v_m": (0.0, 0.3, 0.0)}
        rough = Wall(
            name="rough",
            corner_m=(1.2, 0.2, 1.0),
            material=metal,
            thickness_m=0.1,
            roughness_m=5e-4,
            **edges,
        )
        for name, thickness in (
            (("brick", 0.24), ("glass", 0.02), ("plasterboard", 0.0125))
            if not quick
            else (("brick", 0.24),)
        ):
            pane = across_x("pane", made_of(name, radar), thickness, 0.0)
            claim = f"{preset}, {name} of {1e3 * thickness:g} mm"
            for label, kind, walls, furniture in (
                ("a reflector behind a wall", "reflector", (), (box,)),
                ("a rough conductor behind a wall", "rough", (rough,), ()),
            ):
                objects = received(radar, (*walls, pane), furniture)
                if isinstance(objects, str):
                    yield clutter_row(claim, label, objects)
                    continue
                rooms = objects, received(radar, walls, furniture)
                ours, exact = (next(own for own in room if own.kind == kind) for room in rooms)
                mine = spectrum(ours.length, ours.amplitude, ours.frequency, frequency)
                points = exact.points[0, 0, :, 0]
                legs = (
                    passed(radar.tx, points, pane, frequency),
                    passed(radar.rx, points, pane, frequency),
                )
                through = legs[0][:, :, None] * legs[1][:, radar.rx_of_tx]
                bare = np.tensordot(
                    through_nodes(exact.frequency, frequency), exact.amplitude, axes=1
                )
                k = (2 * np.pi * frequency / C)[:, None, None, None]
                truth = (np.conj(bare) * through * np.exp(-1j * k * exact.length)).sum(axis=-1)
                yield clutter_row(claim, label, of_strongest(mine, truth))
                yield reported(
                    claim,
                    f"{label}, echoes over those without it",
                    "",
                    ours.n_echoes / exact.n_echoes,
                )


# -- a walk behind brick ---------------------------------------------------------------------------


def walk_rows(quick: bool) -> Iterator[Row]:
    """Whole runs with and without a brick wall, clutter removed: where the person's power is."""
    radar = rt.Radar.preset("paper-12ghz")
    radar = replace(
        radar, tx_y=2, tx_z=0, rx_y=2, rx_z=0, chirp_duration_s=radar.cycle_duration_s / 2
    )
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.6 if quick else 1.5)
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in ("free", "brick"):
            walls = (
                (across_x("brick", material("brick"), 0.24, radar.position_m[0] + 0.8),)
                if name == "brick"
                else ()
            )
            out = Path(folder, name)
            rt.run(
                motion,
                radar,
                Scene(walls=walls),
                out=out,
                snr_db=np.inf,
                clutter_removal="mean",
                order=0,
            )
            with h5py.File(out / "maps.h5") as maps:
                power, ranges = maps["range_doppler"][:], maps["range_doppler"].dims[1][0][:]
            profile = power.sum(axis=2)
            found[name] = (profile * ranges).sum(axis=1) / profile.sum(axis=1)
    shift = 1e2 * float(np.median(found["brick"] - found["free"]))
    quantity = "a walk behind 24 cm of brick appears farther by"
    yield judged(
        "a walk, 12 GHz, straight on", quantity, "cm", shift, 1.0, reference=24.0, says=quantity
    )


def measure(quick: bool) -> list[Row]:
    return [*behind_rows(quick), *ghost_rows(quick), *clutter_rows(quick), *walk_rows(quick)]


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
