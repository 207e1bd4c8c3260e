"""Make the meshes of this folder: closed bodies of furniture and open corner reflectors, in metres.

    python meshes/make.py            # writes them beside this script
    python meshes/make.py DIR        # or elsewhere

Furniture is a union of boxes or a body of revolution. It is placed on z = 0 with its footprint
centred on the z axis, and its front looks along +x; what hangs on a wall or leans against it has
its back in the plane x = 0 instead. A corner reflector has its corner at the origin and opens along
+x. The same script makes the same bytes everywhere.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Mesh = tuple[NDArray[np.float64], NDArray[np.int32]]
"""Vertices (vertex, 3) [m] and faces (face, 3), anticlockwise seen from outside."""

Box = tuple[float, float, float, float, float, float]
"""From x, to x, from y, to y, from z, to z [m]."""

EDGE_M = 0.4
"""Of the corner reflectors."""


def boxes(solid: Sequence[Box], hollow: Sequence[Box] = ()) -> Mesh:
    """Surface of a union of boxes less other boxes, on the lattice of the planes of all faces."""
    everything = np.round(np.array([*solid, *hollow]), 6).reshape(-1, 3, 2)
    planes = [np.unique(everything[:, axis]) for axis in range(3)]
    filled = np.zeros([len(plane) + 1 for plane in planes], dtype=bool)  # an empty cell all round
    for number, limits in enumerate(everything):
        low, high = (
            [int(np.searchsorted(plane, limits[axis, end])) for axis, plane in enumerate(planes)]
            for end in range(2)
        )
        cells = tuple(slice(first + 1, last + 1) for first, last in zip(low, high, strict=True))
        filled[cells] = number < len(solid)
    corners: list[tuple[int, int, int]] = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        before = np.moveaxis(filled, axis, 0)[:-1]
        after = np.moveaxis(filled, axis, 0)[1:]
        for cell in np.argwhere(before != after):
            index = np.insert(cell[1:], axis, 0)  # of the cell, in the order of the axes
            outward = bool(before[tuple(cell)])
            square = (
                [(0, 0), (1, 0), (1, 1), (0, 1)] if outward else [(0, 0), (0, 1), (1, 1), (1, 0)]
            )
            for first, second, third in ((0, 1, 2), (0, 2, 3)):
                for step in (square[first], square[second], square[third]):
                    corner = [0, 0, 0]
                    corner[axis] = int(cell[0])
                    corner[u] = int(index[u]) - 1 + step[0]
                    corner[v] = int(index[v]) - 1 + step[1]
                    corners.append((corner[0], corner[1], corner[2]))
    used, faces = np.unique(np.array(corners), axis=0, return_inverse=True)
    vertices = np.stack([planes[axis][used[:, axis]] for axis in range(3)], axis=1)
    return vertices, faces.reshape(-1, 3).astype(np.int32)


def turned(profile: Sequence[tuple[float, float]], sides: int) -> Mesh:
    """Body of revolution about the z axis.

    Its profile (radius, z) begins and ends on the axis, and goes upward on the outside.
    """
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rows = []
    for radius, z in profile[1:-1]:
        rows.append(np.column_stack([radius * ring, np.full(sides, z)]))
    ends = [(0.0, 0.0, profile[0][1]), (0.0, 0.0, profile[-1][1])]
    # Rounded, for the last bit of a cosine is not the same on every machine.
    vertices = np.round(np.concatenate([np.array(ends), *rows]), 6)
    faces = []
    last = len(rows) - 1
    for i in range(sides):
        j = (i + 1) % sides
        faces.append((0, 2 + j, 2 + i))
        for row in range(last):
            a, b = 2 + row * sides, 2 + (row + 1) * sides
            faces += [(a + i, a + j, b + j), (a + i, b + j, b + i)]
        faces.append((1, 2 + last * sides + i, 2 + last * sides + j))
    return vertices, np.array(faces, dtype=np.int32)


def legs(width: float, depth: float, height: float, thick: float) -> list[Box]:
    """Four square legs; width along y, depth along x."""
    x, y = depth / 2, width / 2
    along_x, along_y = (((-end, thick - end), (end - thick, end)) for end in (x, y))
    return [(*ends_x, *ends_y, 0.0, height) for ends_x in along_x for ends_y in along_y]


def bed() -> Mesh:
    """1.6 by 2.0 m, its headboard at the back."""
    return boxes(
        [
            (-1.0, 1.04, -0.82, 0.82, 0.1, 0.3),
            *((x, x + 0.08, y, y + 0.08, 0.0, 0.1) for x in (-0.9, 0.86) for y in (-0.78, 0.7)),
            (-1.0, 1.0, -0.8, 0.8, 0.3, 0.52),
            (-0.9, -0.5, -0.7, -0.1, 0.52, 0.62),
            (-0.9, -0.5, 0.1, 0.7, 0.52, 0.62),
            (-1.04, -1.0, -0.82, 0.82, 0.0, 1.05),
        ]
    )


def wardrobe() -> Mesh:
    """1.5 m wide, 0.6 m deep, 2.1 m high, three doors with bar handles."""
    doors: list[Box] = [
        (0.28, 0.3, -0.745 + 0.5 * k, -0.255 + 0.5 * k, 0.1, 2.06) for k in range(3)
    ]
    handles: list[Box] = [
        (0.3, 0.33, -0.31 + 0.5 * k, -0.29 + 0.5 * k, 0.95, 1.25) for k in range(3)
    ]
    return boxes(
        [
            (-0.3, 0.28, -0.75, 0.75, 0.08, 2.1),
            (-0.28, 0.24, -0.72, 0.72, 0.0, 0.08),
            *doors,
            *handles,
        ]
    )


def sofa() -> Mesh:
    """Three seats, 2.0 m wide, 0.9 m deep."""
    cushions: list[Box] = [
        (-0.2, 0.42, -0.79 + 0.54 * k, -0.29 + 0.54 * k, 0.36, 0.46) for k in range(3)
    ]
    feet: list[Box] = [
        (x, x + 0.06, y, y + 0.06, 0.0, 0.08) for x in (-0.4, 0.34) for y in (-0.95, 0.89)
    ]
    return boxes(
        [
            (-0.45, 0.45, -1.0, 1.0, 0.08, 0.36),
            (-0.45, -0.2, -1.0, 1.0, 0.36, 0.85),
            (-0.2, 0.45, -1.0, -0.82, 0.36, 0.62),
            (-0.2, 0.45, 0.82, 1.0, 0.36, 0.62),
            *cushions,
            *feet,
        ]
    )


def table() -> Mesh:
    """1.4 by 0.8 m, 0.74 m high."""
    return boxes([(-0.4, 0.4, -0.7, 0.7, 0.71, 0.74), *legs(1.36, 0.76, 0.71, 0.06)])


def coffee_table() -> Mesh:
    """1.0 by 0.6 m, 0.42 m high."""
    return boxes([(-0.3, 0.3, -0.5, 0.5, 0.39, 0.42), *legs(0.96, 0.56, 0.39, 0.05)])


def chair() -> Mesh:
    """Seat 0.46 m high, back at -x."""
    return boxes(
        [
            (-0.22, 0.22, -0.22, 0.22, 0.43, 0.46),
            *legs(0.44, 0.44, 0.43, 0.04),
            (-0.22, -0.18, -0.22, -0.18, 0.46, 0.9),
            (-0.22, -0.18, 0.18, 0.22, 0.46, 0.9),
            (-0.22, -0.2, -0.18, 0.18, 0.65, 0.88),
        ]
    )


def desk() -> Mesh:
    """1.4 by 0.7 m, a chest of drawers under its left end, a panel at the back."""
    return boxes(
        [
            (-0.35, 0.35, -0.7, 0.7, 0.71, 0.74),
            (-0.3, 0.3, 0.28, 0.68, 0.0, 0.71),
            (-0.3, 0.3, -0.68, -0.65, 0.0, 0.71),
            (-0.3, -0.28, -0.65, 0.28, 0.3, 0.71),
        ]
    )


def shelf() -> Mesh:
    """Open bookcase, 0.9 m wide, 0.3 m deep, 1.8 m high, a back and five boards."""
    boards: list[Box] = [
        (-0.14, 0.15, -0.43, 0.43, z, z + 0.02) for z in (0.06, 0.42, 0.78, 1.14, 1.46)
    ]
    return boxes(
        [
            (-0.15, -0.14, -0.43, 0.43, 0.0, 1.8),
            (-0.15, 0.15, -0.45, -0.43, 0.0, 1.8),
            (-0.15, 0.15, 0.43, 0.45, 0.0, 1.8),
            (-0.14, 0.15, -0.43, 0.43, 1.78, 1.8),
            *boards,
        ]
    )


def bathtub() -> Mesh:
    """1.7 m long (along y), 0.75 m wide, hollow."""
    return boxes(
        [(-0.375, 0.375, -0.85, 0.85, 0.0, 0.58)], hollow=[(-0.305, 0.305, -0.77, 0.77, 0.14, 0.58)]
    )


def toilet() -> Mesh:
    """Bowl with a seat, and a cistern at the back."""
    return boxes(
        [
            (-0.35, -0.17, -0.19, 0.19, 0.36, 0.78),
            (-0.35, 0.2, -0.11, 0.11, 0.0, 0.36),
            (-0.17, 0.33, -0.18, 0.18, 0.22, 0.4),
            (-0.17, 0.35, -0.19, 0.19, 0.4, 0.43),
        ],
        hollow=[(-0.08, 0.24, -0.11, 0.11, 0.28, 0.43)],
    )


def basin() -> Mesh:
    """Round basin of 0.5 m on a column, 0.85 m high."""
    outside = [
        (0.0, 0.0),
        (0.13, 0.0),
        (0.1, 0.05),
        (0.085, 0.6),
        (0.15, 0.68),
        (0.23, 0.75),
        (0.25, 0.85),
    ]
    inside = [(0.23, 0.85), (0.2, 0.78), (0.13, 0.73), (0.03, 0.71), (0.0, 0.71)]
    return turned([*outside, *inside], 24)


def lamp() -> Mesh:
    """Floor lamp, 1.6 m high: a foot, a pole, a shade closed all round."""
    profile = [
        (0.0, 0.0),
        (0.14, 0.0),
        (0.14, 0.02),
        (0.015, 0.03),
        (0.015, 1.3),
        (0.2, 1.3),
        (0.12, 1.6),
        (0.0, 1.6),
    ]
    return turned(profile, 24)


def door() -> Mesh:
    """Leaf of 0.9 by 2.0 m with a handle, in a frame; its back is the plane x = 0."""
    return boxes(
        [
            (0.0, 0.04, -0.45, 0.45, 0.0, 2.0),
            (0.0, 0.055, -0.52, -0.45, 0.0, 2.07),
            (0.0, 0.055, 0.45, 0.52, 0.0, 2.07),
            (0.0, 0.055, -0.45, 0.45, 2.0, 2.07),
            (0.04, 0.08, 0.37, 0.39, 1.04, 1.06),
            (0.08, 0.1, 0.26, 0.39, 1.04, 1.06),
        ]
    )


def door_leaf() -> Mesh:
    """Leaf of a door, 0.9 by 2.0 m and 0.04 m thick; its hinge is the z axis, it lies along +y."""
    return boxes(
        [
            (-0.02, 0.02, 0.0, 0.9, 0.0, 2.0),
            (0.02, 0.06, 0.82, 0.84, 1.04, 1.06),
            (0.06, 0.08, 0.71, 0.84, 1.04, 1.06),
        ]
    )


def fan() -> Mesh:
    """Three blades of 0.3 m on a hub that turns about the x axis, pitched by 20 degrees.

    A blade is a plate 0.1 m wide and 4 mm thick, from 0.05 m to 0.3 m off the axis, and the hub a
    drum of 12 sides: closed bodies that touch nowhere.
    """
    inner, outer, half, thick, pitch = 0.05, 0.3, 0.05, 0.002, np.radians(20.0)
    blade, faces = boxes([(-thick, thick, -half, half, inner, outer)])
    cosine, sine = np.round((np.cos(pitch), np.sin(pitch)), 12)
    pitched = blade @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    parts = []
    for third in range(3):
        cosine, sine = np.round((np.cos(2 * np.pi * third / 3), np.sin(2 * np.pi * third / 3)), 12)
        turn = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
        parts.append((pitched @ turn.T, faces))
    hub, hub_faces = turned([(0.0, -0.03), (0.04, -0.03), (0.04, 0.03), (0.0, 0.03)], 12)
    parts.append((hub[:, [2, 0, 1]], hub_faces))
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    every = [own + start for (_, own), start in zip(parts, starts[:-1], strict=True)]
    places = np.concatenate([vertices for vertices, _ in parts])
    return np.round(places, 9), np.concatenate(every)


def radiator() -> Mesh:
    """Radiator 1.0 m wide and 0.6 m high, 0.12 m above the floor; the wall is the plane x = 0."""
    ribs: list[Box] = [
        (0.09, 0.11, -0.475 + 0.1 * k, -0.425 + 0.1 * k, 0.15, 0.69) for k in range(10)
    ]
    return boxes([(0.03, 0.09, -0.5, 0.5, 0.12, 0.72), *ribs])


def trihedral() -> Mesh:
    """Triangular trihedral corner reflector: an open sheet of three triangles that face +x.

    Edges between two triangles are `EDGE_M` long; one of them leans up in the plane y = 0.
    """
    along, radius = EDGE_M / sqrt(3), EDGE_M * sqrt(2 / 3)
    tips = [
        (along, radius * y, radius * z)
        for y, z in ((0.0, 1.0), (-sqrt(3) / 2, -0.5), (sqrt(3) / 2, -0.5))
    ]
    return np.array([(0.0, 0.0, 0.0), *tips]), np.array(
        [(0, 1, 2), (0, 2, 3), (0, 3, 1)], dtype=np.int32
    )


def dihedral() -> Mesh:
    """Two square plates of `EDGE_M` at right angles, an open sheet whose normals look out of it.

    Their common edge is the z axis, its middle the origin.
    """
    side, half = EDGE_M / sqrt(2), EDGE_M / 2
    vertices = [
        (x, y, z) for x, y in ((0.0, 0.0), (side, side), (side, -side)) for z in (-half, half)
    ]
    faces = [(0, 3, 1), (0, 2, 3), (0, 5, 4), (0, 1, 5)]
    return np.array(vertices), np.array(faces, dtype=np.int32)


MAKERS: dict[str, Callable[[], Mesh]] = {
    "basin": basin,
    "bathtub": bathtub,
    "bed": bed,
    "chair": chair,
    "coffee-table": coffee_table,
    "desk": desk,
    "dihedral": dihedral,
    "door": door,
    "door-leaf": door_leaf,
    "fan": fan,
    "lamp": lamp,
    "radiator": radiator,
    "shelf": shelf,
    "sofa": sofa,
    "table": table,
    "toilet": toilet,
    "trihedral": trihedral,
    "wardrobe": wardrobe,
}


def ply(mesh: Mesh) -> bytes:
    """A binary PLY file; vertices in float64, for lengths are in wavelengths of millimetres."""
    vertices, faces = mesh
    head = (
        "ply\nformat binary_little_endian 1.0\ncomment metres\n"
        f"element vertex {len(vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corner", "<i4", 3)])
    rows["count"], rows["corner"] = 3, faces
    return head.encode("ascii") + (vertices + 0.0).astype("<f8").tobytes() + rows.tobytes()


def main(folder: Path) -> None:
    """Write every mesh into a folder."""
    for name, make in MAKERS.items():
        (folder / f"{name}.ply").write_bytes(ply(make()))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parent)
