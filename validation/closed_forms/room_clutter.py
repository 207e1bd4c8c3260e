"""Static clutter of a room: images, walls, corner reflectors in a scene, and stillness.

images      all specular paths of an empty box room, orders 1 and 2: their lengths against images
            that are computed here axis by axis
wall        the return of a large wall, bistatic, against physical optics of the rectangle: currents
            2 n x H times the slab's coefficient (Airy's sum, computed here), summed by the midpoint
            rule
reflectors  a dihedral and a triangular trihedral of 0.4 m in a scene, against 8 pi a^4 / lambda^2
            and 4 pi a^4 / (3 lambda^2)
still room  living room and corridor through IF samples and range-Doppler spectra with Chebyshev
            windows of 160 dB, without noise

    python validation/closed_forms/room_clutter.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from doppler_floor import ATTENUATION_DB, main_lobe_bins
from numpy.typing import NDArray

import rtradar as rt
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scene import Furniture, Surface, Wall, material, room_walls
from rtradar.signal.clutter import RoomIf
from rtradar.validate.rows import Row, judged, main, reported

Array = NDArray[np.float64]
C = 299_792_458.0
SIZE, CORNER = (6.0, 4.5, 2.6), (-4.8, -2.0)
PLACES = {
    "near": (0, -4.8),
    "far": (0, 1.2),
    "right": (1, -2.0),
    "left": (1, 2.5),
    "floor": (2, 0.0),
    "ceiling": (2, 2.6),
}


def image_rows() -> Iterator[Row]:
    """Every image of a convex box is received, at its distance."""
    metal = Surface(material=material("perfect-conductor"), thickness_m=0.1)
    scene = rt.Scene(name="box", walls=room_walls(SIZE, CORNER, dict.fromkeys(PLACES, metal)))
    radar = replace(rt.Radar.preset("paper-12ghz"), samples_per_chirp=1024)
    found = Clutter(radar, scene, order=2)
    rx = radar.rx[radar.rx_of_tx]
    worst, shares = {1: 0.0, 2: 0.0}, {1: {}, 2: {}}
    for echoes in found.objects:
        names = echoes.name.split(" + ")
        images = radar.tx[:, None].copy()
        for name in names:
            axis, place = PLACES[name]
            images[..., axis] = 2 * place - images[..., axis]
        strength = np.abs(echoes.amplitude[0, ..., 0]) * echoes.length[..., 0] / np.sqrt(4 * np.pi)
        error = np.abs(echoes.length[..., 0] - np.sqrt(((images - rx) ** 2).sum(axis=-1)))[
            strength > 0
        ]
        order = len(names)
        worst[order] = max(worst[order], float(error.max()))
        # Over an edge, both orders of the two walls share one image; between opposite walls they
        # are two images.
        key = (
            echoes.name
            if order == 2 and PLACES[names[0]][0] == PLACES[names[1]][0]
            else frozenset(names)
        )
        shares[order][key] = shares[order].get(key, 0.0) + strength
    for order, count in ((1, 6), (2, 6 + 12)):
        # Float32 would err by 0.3 um; the limit is the one asked for.
        yield judged(
            f"images, order {order}",
            "length, worst",
            "m",
            worst[order],
            1e-6,
            says="lengths of specular paths in a box room",
        )
        says = "specular paths in a box room: their number"
        yield judged(
            f"images, order {order}",
            "how many",
            "1",
            len(shares[order]),
            0,
            reference=count,
            says=says,
        )
        # A conductor reflects v into v exactly, whatever the angles: what is left is rounding.
        missing = max(float(np.abs(strength - 1).max()) for strength in shares[order].values())
        says = "specular paths in a box room of conductors: each once, with its whole field"
        yield judged(
            f"images, order {order}", "each once, of a conductor", "1", missing, 1e-9, says=says
        )


def airy(eta: complex, thickness: float, k: float, cosine: Array, te: bool) -> Array:
    """Reflection of a slab by Airy's sum r - r (1 - r^2) q^2 + ..., with a conductor's TM as +1."""
    inner = np.sqrt(eta - 1 + cosine**2 + 0j)
    r = (
        (cosine - inner) / (cosine + inner)
        if te
        else (eta * cosine - inner) / (eta * cosine + inner)
    )
    q = np.exp(-1j * k * thickness * inner)
    return r - (1 - r**2) * r * q**2 / (1 - r**2 * q**2)


def plate(wall: Wall, tx: Array, rx: Array, frequency: float, polarization: str) -> complex:
    """Scattering length over R1 R2 of a wall across x, by physical optics and the midpoint rule."""
    k = 2 * np.pi * frequency / C
    step = 2 * np.pi / k / 6
    (_, y0, z0), (_, y1, z1) = wall.corners.min(axis=0), wall.corners.max(axis=0)
    ys, zs = (
        np.linspace(a, b, int(np.ceil((b - a) / step)) * 2 + 1)[1::2]
        for a, b in ((y0, y1), (z0, z1))
    )
    area = (y1 - y0) * (z1 - z0) / (len(ys) * len(zs))
    x = float(wall.corners[0, 0])
    normal = np.array([-1.0, 0.0, 0.0])
    total = 0j
    for z in np.array_split(zs, max(1, len(zs) * len(ys) // 500_000)):
        places = np.stack(np.broadcast_arrays(x, ys[:, None], z), axis=-1).reshape(-1, 3)
        going, coming = places - tx, rx - places
        r1, r2 = (np.linalg.norm(way, axis=1) for way in (going, coming))
        d, s = going / r1[:, None], coming / r2[:, None]
        sent, received = (_vector(way, polarization) for way in (-d, s))
        cosine = -d @ normal
        # v is TE and h is TM for antennas in one horizontal plane, as these are.
        eta = complex(wall.material.eta(frequency))
        if np.isinf(eta):
            mirror = np.ones(len(d))
        else:
            mirror = airy(eta, wall.thickness_m, k, cosine, polarization == "v") * (
                -1 if polarization == "v" else 1
            )
        current = 2 * np.cross(normal, np.cross(d, sent)) * mirror[:, None]
        total += ((current * received).sum(axis=1) / (r1 * r2) * np.exp(-1j * k * (r1 + r2))).sum()
    # The field is -jk / (4 pi) of this; a conductor's reflection counts as a positive length.
    return complex(1j * k / np.sqrt(4 * np.pi) * total * area)


def _vector(way: Array, polarization: str) -> Array:
    side = np.cross([0.0, 0.0, 1.0], way)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return side if polarization == "h" else np.cross(way, side)


def wall_rows(quick: bool) -> Iterator[Row]:
    """A wall that is many Fresnel zones wide."""
    cases = [("perfect-conductor", "v"), ("plasterboard", "v"), ("concrete", "h")]
    for made, polarization in cases if not quick else cases[1:2]:
        wall = Wall(
            name="wall",
            corner_m=(0.0, -2.0, 0.0),
            edge_u_m=(0.0, 0.0, 3.0),
            edge_v_m=(0.0, 4.0, 0.0),
            material=material(made),
            thickness_m=0.0125,
        )
        # Antennas 3 m apart: 37 degrees at the wall.
        spacing = 3.0 / (C / 12e9)
        radar = rt.Radar(
            tx_y=2,
            tx_z=0,
            rx_y=2,
            rx_z=0,
            tx_spacing_wavelengths=spacing,
            rx_spacing_wavelengths=spacing / 3,
            position_m=(-2.0, 0.1, 1.4),
            polarization=polarization,
        )
        (own,) = Clutter(radar, rt.Scene(walls=(wall,)), order=1).objects
        frequency = np.linspace(12.05e9, 15.95e9, 9 if quick else 14)
        ours = own.at_nodes(frequency)[..., 0]
        worst, single = 0.0, 0.0
        for tx, rx in ((0, 0), (0, 1), (1, 0)):
            exact = np.array(
                [plate(wall, radar.tx[tx], radar.rx[rx], f, polarization) for f in frequency]
            )
            mean = 10 * np.log10(
                (np.abs(ours[:, tx, rx]) ** 2).mean() / (np.abs(exact) ** 2).mean()
            )
            phase = np.conj(ours[:, tx, rx]) * np.exp(
                -2j * np.pi * frequency / C * own.length[tx, rx, 0]
            )
            worst, single = (
                max(worst, abs(float(mean))),
                max(single, float(np.abs(phase / exact - 1).max())),
            )
        case = f"wall of {made}, {polarization}, bistatic"
        # The waves of the four edges, which images omit, are up to 3 % each at one frequency, and
        # they average out over the sweep.
        yield judged(
            case,
            "power over the sweep, worst channel",
            "dB",
            worst,
            0.4,
            says="a large wall against physical optics",
        )
        yield reported(case, "field at one frequency, worst, with its phase", "1", single)


def reflector_rows(quick: bool) -> Iterator[Row]:
    """Corner reflectors in a scene, far away."""
    closed = {"trihedral": (4 / 3, 0.3), "dihedral": (8.0, 0.1)}
    for frequency in (12e9,) if quick else (12e9, 24e9, 77e9):
        wavelength = C / frequency
        # Ten times 2 a^2 / lambda, because the closed forms are of plane waves.
        away = round(20 * 0.4**2 / wavelength) + 20.0
        radar = rt.Radar(
            start_frequency_hz=frequency - 0.05e9,
            bandwidth_hz=0.1e9,
            samples_per_chirp=4096,
            tx_y=1,
            tx_z=0,
            rx_y=1,
            rx_z=0,
            position_m=(-away, 0.0, 1.0),
        )
        for mesh, (factor, limit) in closed.items():
            piece = Furniture(
                name=mesh,
                mesh=mesh,
                material=material("perfect-conductor"),
                position_m=(0, 0, 1),
                yaw_deg=180,
            )
            (echoes,) = Clutter(radar, rt.Scene(furniture=(piece,))).cycle()
            middle = len(echoes.frequency) // 2
            turn = np.exp(2j * np.pi * echoes.frequency[middle] / C * (echoes.length - 2 * away))
            power = abs((echoes.amplitude[middle] * turn).sum()) ** 2 * away**4
            error = 10 * np.log10(power / (factor * np.pi * 0.4**4 / wavelength**2))
            case = f"{mesh} in a scene, {frequency / 1e9:.0f} GHz"
            yield judged(
                case,
                "echo against closed form",
                "dB",
                abs(error),
                limit,
                says=f"a {mesh} in a scene",
            )


def still_rows(quick: bool) -> Iterator[Row]:
    """Energy beside zero Doppler over that of the strongest cell."""
    for preset, name in (
        [("paper-12ghz", "living-room")]
        if quick
        else [("paper-12ghz", "living-room"), ("paper-77ghz", "corridor")]
    ):
        scene = rt.Scene.load(name)
        # Four Tx: frames of 400 and 2000 cycles with a third of the memory.
        radar = scene.place(replace(rt.Radar.preset(preset), tx_y=2, tx_z=2, rx_y=2, rx_z=2))
        n = min(radar.cycles_per_frame, 400)
        clutter = Clutter(radar, scene)
        samples = RoomIf(clutter.radar, clutter.cycle()).clutter_if(np.arange(n * radar.n_tx))
        chebyshev = rt.process.WindowFunctions(*2 * [("chebwin", ATTENUATION_DB)])
        spectra = rt.process.range_doppler(samples, radar, window_functions=chebyshev)
        power = (np.abs(spectra.values) ** 2).max(axis=(0, 2))
        beside = np.abs(np.arange(n) - n // 2) > np.ceil(main_lobe_bins(n + 1))
        floor = 10 * np.log10(max(power[beside].max(), 1e-300) / power.max())
        radio = f"{radar.start_frequency_hz / 1e9:.0f} GHz"
        case = f"still room: {name}, {radio}, {clutter.n_echoes} echoes"
        # The side lobes of the windows are at -160 dB, the rounding of complex64 spectra at -140.
        yield judged(
            case,
            "highest beside zero Doppler",
            "dB",
            floor,
            -100.0,
            says="a still room: energy beside zero Doppler",
        )


def measure(quick: bool) -> list[Row]:
    return [*image_rows(), *wall_rows(quick), *reflector_rows(quick), *still_rows(quick)]


if __name__ == "__main__":
    sys.exit(
        main("Static clutter of a room: images, walls, corner reflectors, stillness.", measure)
    )
