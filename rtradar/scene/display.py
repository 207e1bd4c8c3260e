"""What a scene shows of itself: its room, walls and furniture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rtradar.scene.objects import ROOM_SIDES

if TYPE_CHECKING:
    from rtradar.body import Person
    from rtradar.scene.objects import Furniture, Wall
    from rtradar.scene.scene import Scene

_MOST_ROWS = 9
"""Most walls and most pieces of furniture that a card lists."""


def brief_rows(scene: Scene) -> dict[str, str]:
    """Return the rows of a scene's ``repr``."""
    rows = room_rows(scene)
    kinds: list[tuple[str, Sequence[Wall | Furniture]]]
    kinds = [("Walls", scene.walls), ("Furniture", scene.furniture)]
    # Few scenes have objects: the others need not say so.
    kinds += [("Objects", scene.objects)] if scene.objects else []
    for kind, parts in kinds:
        rows[kind] = f"{len(parts)}: {_names(parts)}" if parts else "none"
    if scene.people:
        rows["People"] = f"{len(scene.people)}: {', '.join(map(_person, scene.people))}"
    if scene.materials:
        rows["Materials"] = ", ".join(material.name for material in scene.materials)
    return {label.lower(): value for label, value in rows.items()}


def tables(scene: Scene) -> dict[str, dict[str, str]]:
    """Return the tables of a scene's card by their headings."""
    walls = {
        wall.name: f"{wall.material.name}, {1e3 * wall.thickness_m:g} mm, {_faces(wall)}"
        for wall in scene.walls
    }
    furniture = {piece.name: _piece(piece) for piece in scene.furniture}
    objects = {piece.name: _piece(piece) for piece in scene.objects}
    found = {"": room_rows(scene)}
    if scene.people:
        found[""]["People"] = ", ".join(map(_person, scene.people))
    for kind, rows in (("Walls", walls), ("Furniture", furniture), ("Objects", objects)):
        count = len(rows)
        if len(rows) > _MOST_ROWS:
            left_out = count - _MOST_ROWS
            rows = {**dict(list(rows.items())[:_MOST_ROWS]), "...": f"and {left_out} more"}
        if rows:
            found[f"{kind} ({count})"] = rows
    return found


def room_rows(scene: Scene) -> dict[str, str]:
    """Return what the scene is as a whole, as texts with units by their labels."""
    rows = {"Description": scene.description}
    sides = [wall.corners for wall in scene.walls if wall.name in ROOM_SIDES]
    if len(sides) == len(ROOM_SIDES):
        size_m = np.ptp(np.concatenate(sides), axis=0)
        rows["Room"] = f"{' × '.join(f'{length:.4g}' for length in size_m)} m"
    place = scene.radar_position_m
    rows["Radar"] = "at its own position" if place is None else f"at {_point(place)}"
    if place is not None and scene.is_outside(place):
        rows["Radar"] += ", outside of the room"
    for name in ("yaw", "pitch", "roll"):
        if (angle := getattr(scene, f"radar_{name}_deg")) is not None:
            rows["Radar"] += f", {name} {angle:g}°"
    turned = f", turned by {scene.heading_deg:g}°" if scene.heading_deg else ""
    rows["Person"] = f"at {_point(scene.person_position_m)}{turned}"
    return rows


def _names(parts: Iterable[Wall | Furniture]) -> str:
    return ", ".join(part.name for part in parts)


def _person(person: Person) -> str:
    turned = f", turned by {person.heading_deg:g}°" if person.heading_deg else ""
    return f"{person.motion.name} at {_point(person.position_m)}{turned}"


def _point(position_m: Iterable[float]) -> str:
    return f"({', '.join(f'{value:g}' for value in position_m)}) m"


def _faces(wall: Wall) -> str:
    height_m, width_m = sorted(map(float, map(np.linalg.norm, (wall.edge_u_m, wall.edge_v_m))))
    return f"{width_m:.4g} × {height_m:.4g} m"


def _piece(piece: Furniture) -> str:
    turned = f", turned by {piece.yaw_deg:g}°" if piece.yaw_deg else ""
    return f"{piece.material.name}, at {_point(piece.position_m)}{turned}"
