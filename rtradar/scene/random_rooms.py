"""Rooms that are drawn at random, as tables of a scene file.

A room has six sides, at times a window, and furniture along its walls. The radar stands before the
near wall. What a person needs to walk toward it stays free, and so does half a metre round it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np

from rtradar.scene.mesh_files import read_mesh
from rtradar.system.checks import Table, check_keys
from rtradar.system.fields import read_value, within
from rtradar.system.files import shipped_folder
from rtradar.system.seeds import check_seed

FURNITURE, LENGTH_M, WIDTH_M, HEIGHT_M = (2, 7), (5.5, 8.0), (3.4, 6.5), (2.3, 3.0)
"""Ranges from which a room is drawn: pieces of furniture, and sizes along x, y and z [m]."""

RANDOM: Mapping[str, tuple[tuple[float, float], tuple[float, float]]] = {
    "furniture": (FURNITURE, (0, 20)),
    "length_m": (LENGTH_M, (5.5, 30.0)),
    "width_m": (WIDTH_M, (3.0, 30.0)),
    "height_m": (HEIGHT_M, (2.2, 10.0)),
}
"""Keys of ``[random]`` beside the seed, with these ranges and what they must be within."""

_WALLS = {"plasterboard": (0.0125, 0.03), "concrete": (0.1, 0.25), "chipboard": (0.016, 0.04)}
_FLOORS = {"concrete": (0.1, 0.25), "wood": (0.015, 0.03)}
_CEILINGS = {"concrete": (0.1, 0.25), "plasterboard": (0.0125, 0.025)}
"""Materials of the sides, known from 1 to 100 GHz, with the least and largest thickness [m]."""

_PIECES = {
    "bed": "wood", "chair": "wood", "coffee-table": "wood", "desk": "chipboard", "door": "wood",
    "lamp": "metal", "radiator": "metal", "shelf": "chipboard", "sofa": "wood", "table": "wood",
    "wardrobe": "chipboard",
}  # fmt: skip
"""Furniture, which are meshes that come along, and the material of each."""

_SIDES = {"near": 0, "right": 90, "far": 180, "left": -90}
"""Walls that furniture stands at, and how it is turned to look into the room [deg]."""

_FREE_M = np.array([[-1.9, 1.9], [-0.8, 0.8]])
_RADAR_M, _GAP_M, _TRIES = 0.5, 0.05, 30


def random_room(table: Table) -> dict[str, Any]:
    """Draw the table of a scene from a seed and ranges, the values under ``[random]``.

    An `InputError` is raised where a key is unknown or a range has no meaning.
    """
    check_keys("[random] ", table, ("seed",), tuple(RANDOM))
    check_seed("[random] ", table["seed"])
    ranges = {
        key: read_value(
            Annotated[tuple[int, int], within(*limits, "whole numbers")]
            if key == "furniture"
            else Annotated[tuple[float, float], within(*limits)],
            "[random] ",
            key,
            table.get(key, usual),
        )
        for key, (usual, limits) in RANDOM.items()
    }
    draw = np.random.default_rng(table["seed"])

    def between(low: float, high: float, digits: int = 2) -> float:
        return round(float(draw.uniform(low, high)), digits)

    def side(materials: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
        material = str(draw.choice(list(materials)))
        thickness_m = between(*materials[material], digits=4)
        rough_m = between(1e-4, 5e-4, digits=5)
        return {"material": material, "thickness_m": thickness_m, "roughness_m": rough_m}

    size = [between(*ranges[key]) for key in ("length_m", "width_m", "height_m")]
    radar = [-between(2.6, 3.2), between(-0.5, 0.5), between(0.9, 1.5)]
    low = np.array([radar[0] - between(0.3, 0.4), between(-0.1, 0.1) - size[1] / 2])
    low = np.round(low, 2)
    high = np.round(low + size[:2], 2)
    walls = []
    if draw.random() < 0.5:
        wide, sill = between(0.8, 2.0), between(0.7, 1.0)
        # 1 cm before the left wall.
        left = round(float(high[1]) - 0.01, 2)
        corner = [between(low[0] + 0.2, high[0] - wide - 0.2), left, sill]
        up = min(between(0.9, 1.4), round(size[2] - sill - 0.2, 2))
        walls.append(
            {
                "name": "window",
                "corner_m": corner,
                "edge_u_m": [wide, 0.0, 0.0],
                "edge_v_m": [0.0, 0.0, up],
                "material": "glass",
                "thickness_m": 0.006,
            }
        )
    least, most = ranges["furniture"]
    furniture = []
    taken = [_FREE_M, np.stack([np.subtract(radar[:2], _RADAR_M), np.add(radar[:2], _RADAR_M)], 1)]
    for number in range(1, 1 + int(draw.integers(int(least), int(most) + 1))):
        for _ in range(_TRIES):
            mesh, at = str(draw.choice(list(_PIECES))), str(draw.choice(list(_SIDES)))
            place, box = _against(mesh, at, low, high, draw.random())
            if _fits(box, low, high, taken):
                taken.append(box)
                piece = {"name": f"{mesh} {number}", "mesh": mesh, "material": _PIECES[mesh]}
                furniture.append({**piece, "position_m": [*place, 0.0], "yaw_deg": _SIDES[at]})
                break
    sides = {name: side(_WALLS) for name in _SIDES}
    sides |= {"floor": side(_FLOORS), "ceiling": side(_CEILINGS)}
    return {
        "description": f"{' by '.join(f'{length:g}' for length in size)} m, drawn at random",
        "radar": {"position_m": radar},
        "room": {"size_m": size, "corner_m": low.tolist(), **sides},
        **({"walls": walls} if walls else {}),
        **({"furniture": furniture} if furniture else {}),
    }


def _against(mesh: str, side: str, low: Any, high: Any, along: float) -> tuple[list[float], Any]:
    """Put a piece with its back to a wall: its place [x, y] and the box (2, 2) it covers [m]."""
    vertices = read_mesh(shipped_folder("meshes") / f"{mesh}.ply").vertices[:, :2]
    turn = np.radians(_SIDES[side])
    vertices = vertices @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    own = np.stack([vertices.min(axis=0), vertices.max(axis=0)], axis=1)
    axis, first = (0 if side in ("near", "far") else 1), side in ("near", "right")
    place = low - own[:, 0] + along * (high - low - (own[:, 1] - own[:, 0]))
    place[axis] = (low - own[:, 0] + 0.02)[axis] if first else (high - own[:, 1] - 0.02)[axis]
    place = np.round(place, 2)
    return place.tolist(), own + place[:, None]


def _fits(box: Any, low: Any, high: Any, taken: list[Any]) -> bool:
    """Tell whether a box is inside the room, and clear of all others."""
    inside = (box[:, 0] >= low + 0.01).all() and (box[:, 1] <= high - 0.01).all()
    apart = ((box[:, 0] >= own[:, 1] + _GAP_M) | (box[:, 1] <= own[:, 0] - _GAP_M) for own in taken)
    return bool(inside and all(one.any() for one in apart))
