"""Ghosts over faces of furniture and in doorways, against physical optics of the faces.

A small sphere goes past. The judge sums over the triangles of the mesh itself, in cells of a sixth
of a wavelength: the sphere sends each cell what geometric optics has of a conducting sphere, with
its two radii of curvature, over the shortest way, found cell by cell; the cell reflects TE and TM
by Fresnel's coefficients, and sends Huygens' currents n x H and E x n of that to the receiver.

sheet      a thin sheet of metal, 0.8 m by 1 m
wardrobe   the three doors of the shipped wardrobe, of wood
doorway    a sphere behind a wall of metal with a doorway, direct: the judge sums over the opening
           on both legs

Errors are over the field of an endless mirror, or of a leg without the wall: the sphere goes from
the lit side into the dark.

    python validation/other_methods/furniture_ghosts.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import trimesh
from numpy.typing import NDArray

import rtradar as rt
from rtradar.scatter.echo_models import build_model
from rtradar.scene import Furniture, Wall, material
from rtradar.validate.rows import Row, judged, main

sys.path.insert(0, str(Path(__file__).parents[1]))
from helpers import MovingEllipsoid, rms

Array = NDArray[np.float64]
C = 299_792_458.0
FREQUENCY = 12e9
K = 2 * np.pi * FREQUENCY / C
RADIUS = 0.05
PLACE = np.array([-4.0, 1.0, 1.0])
UP = np.array([0.0, 0.0, 1.0])
RADAR = rt.Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, start_frequency_hz=FREQUENCY, bandwidth_hz=1e6)
"""One Tx and one Rx, without a sweep to speak of: edges count alike at any detour."""


def unit(way: Array) -> Array:
    return way / np.linalg.norm(way, axis=-1, keepdims=True)


def antenna(way: Array) -> Array:
    """Field of an upright antenna along unit vectors."""
    return unit(UP - (way @ UP)[..., None] * way)


def off_sphere(centre: Array, targets: Array) -> tuple[Array, Array]:
    """Field (target, 3) complex at targets, and where from (target, 3), sent by the antenna."""
    normal = unit(unit(PLACE - centre) + unit(targets - centre))
    for _ in range(30):
        point = centre + RADIUS * normal
        normal = unit(unit(PLACE - point) + unit(targets - point))
    point = centre + RADIUS * normal
    first, last = (np.linalg.norm(end - point, axis=1) for end in (PLACE, targets))
    going = unit(point - PLACE)
    cosine = -(going * normal).sum(axis=1)
    bent = [1 / (1 / first + 2 / (RADIUS * cosine)), 1 / (1 / first + 2 * cosine / RADIUS)]
    spread = np.sqrt(bent[0] * bent[1] / ((bent[0] + last) * (bent[1] + last))) / first
    sent = antenna(going)
    turned = 2 * (sent * normal).sum(axis=1, keepdims=True) * normal - sent
    return turned * (spread * np.exp(-1j * K * (first + last)))[:, None], point


def cells(corners: Array) -> tuple[Array, Array]:
    """Middles (cell, 3) of triangles (face, 3, 3) halved to a sixth of a wavelength; areas."""
    done = []
    while len(corners):
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        small = sides.max(axis=1) <= C / FREQUENCY / 4
        done.append(corners[small])
        corners, sides = corners[~small], sides[~small]
        order = (sides.argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(corners, order[..., None], axis=1), 1, 0)
        half = (a + b) / 2
        corners = np.concatenate([np.stack([a, half, c], 1), np.stack([half, b, c], 1)])
    every = np.concatenate(done)
    across = np.cross(every[:, 1] - every[:, 0], every[:, 2] - every[:, 0])
    return every.mean(axis=1), np.linalg.norm(across, axis=1) / 2


def coefficients(eta: complex, cosine: Array) -> tuple[Array, Array]:
    """TE and TM of a half-space by Fresnel, with a conductor's TM as +1."""
    if np.isinf(eta):
        return -np.ones_like(cosine) + 0j, np.ones_like(cosine) + 0j
    inner = np.sqrt(eta - 1 + cosine**2)
    return (cosine - inner) / (cosine + inner), (eta * cosine - inner) / (eta * cosine + inner)


def radiated(places: Array, areas: Array, normal: Array, field: Array, ways: Array) -> complex:
    """Huygens' currents of a field that leaves along unit vectors, at the receiver, co-polar."""
    electric = np.cross(normal, np.cross(ways, field))
    magnetic = np.cross(field, normal)
    away = PLACE - places
    far = np.linalg.norm(away, axis=1)
    on = away / far[:, None]
    sent = electric - (electric * on).sum(axis=1, keepdims=True) * on + np.cross(magnetic, on)
    sent = sent * (np.exp(-1j * K * far) / far * areas)[:, None]
    return complex(-1j * K / (4 * np.pi) * (sent * antenna(-on)).sum())


def over_face(centre: Array, corners: Array, normal: Array, eta: complex) -> complex:
    """H of antenna, sphere, face and back, by physical optics of the face."""
    places, areas = cells(corners)
    field, point = off_sphere(centre, places)
    way = unit(places - point)
    cosine = -(way @ normal)
    te, tm = coefficients(eta, cosine)
    across = unit(np.cross(way, normal))
    on = way - 2 * (way @ normal)[:, None] * normal
    down, up = np.cross(across, way), np.cross(across, on)
    reflected = (te * (field * across).sum(axis=1))[:, None] * across
    reflected = reflected + (tm * (field * down).sum(axis=1))[:, None] * up
    return -2 * np.sqrt(np.pi) * radiated(places, areas, normal, reflected, on)


def simulated(scene: rt.Scene, centre: Array, name: str, order: int = 1) -> complex:
    """H of the echoes that come back over faces whose names begin so; "" for the direct one."""
    body = MovingEllipsoid(tuple(centre), (RADIUS,) * 3)
    model = build_model("specular", RADAR, body, scene=scene, variant="llvm", order=order)
    echoes = model.echoes(np.arange(1))
    names = getattr(model, "path_names", ("body",))
    paths = [names[path] for path in echoes.path]
    wanted = [path.startswith(f"body > {name}") if name else path == "body" for path in paths]
    middle = len(echoes.frequency) // 2
    turned = np.conj(echoes.amplitude[middle, 0, 0]) * np.exp(-1j * K * echoes.length[0, 0])
    return complex(turned[np.array(wanted)].sum())


def mirror_rows(quick: bool, folder: Path) -> Iterator[Row]:
    """A sphere goes by, so that the point of reflection crosses the face."""
    sheet = trimesh.Trimesh(
        [[-0.4, 0, -0.5], [0.4, 0, -0.5], [0.4, 0, 0.5], [-0.4, 0, 0.5]], [[0, 2, 1], [0, 3, 2]]
    )
    sheet.export(folder / "sheet.ply")
    of_metal = Furniture(
        "sheet", folder / "sheet.ply", material("metal"), metres_per_unit=1.0, sheet=True,
        position_m=(-2.0, 2.5, 1.1),
    )  # fmt: skip
    wardrobe = Furniture(
        "wardrobe", "wardrobe", material("wood"), position_m=(-2.0, 2.8, 0.0), yaw_deg=-90
    )
    says = "ghosts of a sphere over {}, against physical optics of it: rms complex error"
    for piece, thing in (
        (of_metal, "a sheet of metal"),
        (wardrobe, "the doors of a wooden wardrobe"),
    ):
        triangles = piece.triangles()
        corners = triangles.corners
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        looks = np.abs(unit(normals)[:, 1]) > 0.99
        front = corners[looks, :, 1].mean(axis=1)
        # The doors are the frontmost faces that are large; handles are before them.
        sizes = np.linalg.norm(normals[looks], axis=1) / 2
        plane = min(y for y in np.unique(front.round(4)) if sizes[front.round(4) == y].sum() > 0.3)
        face = corners[looks][np.abs(front - plane) < 1e-3]
        # Everything that is crossed later: from the sphere far on the lit side to the dark.
        eta = complex(piece.material.eta(FREQUENCY))
        scene = rt.Scene(name=thing, furniture=(piece,))
        ours, theirs, endless = [], [], []
        for x in np.linspace(-2.2, 2.6, 5 if quick else 25):
            centre = np.array([x, 0.3, 1.8])
            theirs.append(over_face(centre, face, np.array([0.0, -1.0, 0.0]), eta))
            ours.append(simulated(scene, centre, piece.name))
            image = np.array([1.0, -1.0, 1.0]) * PLACE + [0.0, 2 * plane, 0.0]
            # An endless conductor, by the lengths of the legs alone.
            legs = np.linalg.norm(centre - PLACE) * np.linalg.norm(centre - image)
            cosine = (plane - PLACE[1] + plane - centre[1]) / np.linalg.norm(centre - image)
            te = coefficients(eta, np.array([cosine]))[0]
            endless.append(np.sqrt(np.pi) * RADIUS / legs * abs(te[0]))
        error = (np.array(ours) - theirs) / np.array(endless)
        yield judged(
            f"{thing}, {len(ours)} places",
            "rms complex error over an endless mirror",
            "1",
            rms(error),
            0.1,
            says=says.format(thing),
        )


def door_rows(quick: bool) -> Iterator[Row]:
    """A sphere behind a conducting wall with a doorway: what comes through, on both legs."""
    door = (19.0, 18.8, 0.9, 2.0)
    wall = Wall(
        name="wall",
        corner_m=(-2.0, -19.5, -18.8),
        edge_u_m=(0.0, 40.0, 0.0),
        edge_v_m=(0.0, 0.0, 40.0),
        material=material("perfect-conductor"),
        thickness_m=1e-4,
        openings=(door,),
    )
    y, z = np.array([-0.5, 0.4]), np.array([0.0, 2.0])
    opening = np.array([[[-2, y[0], z[0]], [-2, y[1], z[0]], [-2, y[1], z[1]]],
                        [[-2, y[0], z[0]], [-2, y[1], z[1]], [-2, y[0], z[1]]]])  # fmt: skip
    places, areas = cells(opening)
    first = np.linalg.norm(places - PLACE, axis=1)
    scene, free = rt.Scene(name="door", walls=(wall,)), rt.Scene()
    error = []
    for place in np.linspace(-2.6, -0.4, 5 if quick else 23):
        centre = np.array([0.0, place, 1.2])
        # By reciprocity both legs lose alike: Kirchhoff's sum over the opening, squared. The leg
        # ends at the point of the sphere that looks at the radar.
        point = centre + RADIUS * unit(PLACE - centre)
        last = np.linalg.norm(places - point, axis=1)
        straight = np.linalg.norm(point - PLACE)
        slant = ((places - PLACE)[:, 0] / first + (point - places)[:, 0] / last) / 2
        sent = slant * np.exp(-1j * K * (first + last - straight)) / (first * last)
        left = 1j * K / (2 * np.pi) * (sent * areas).sum() * straight
        alone = simulated(free, centre, "", order=0)
        error.append(simulated(scene, centre, "", order=0) / alone - left**2)
    yield judged(
        f"a doorway, {len(error)} places",
        "rms complex error over no wall",
        "1",
        rms(error),
        0.1,
        says="a sphere through a doorway, against Kirchhoff's sum over it: rms complex error",
    )


def measure(quick: bool) -> list[Row]:
    with TemporaryDirectory() as folder:
        return [*mirror_rows(quick, Path(folder)), *door_rows(quick)]


if __name__ == "__main__":
    sys.exit(main("Ghosts over faces of furniture and in doorways, against sums.", measure))
