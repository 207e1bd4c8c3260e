"""From a TOML file to a scene: which tables and keys it may have, and one line of complaint about anything else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

from rtradar.errors import InputError
from rtradar.scene.furniture import Furniture
from rtradar.scene.materials import MATERIALS, Material, own_material
from rtradar.scene.mesh_files import MESH_ENDINGS
from rtradar.scene.scene import Scene
from rtradar.scene.walls import ROOM_SIDES, Surface, Wall, room_walls
from rtradar.system.checks import check_text, inside, printable, shown
from rtradar.system.toml_tables import Table, check_keys, read_toml, table_at, tables_at

Made = TypeVar("Made")

_TEXTS = ("name", "description")
_TABLES = ("radar", "person", "materials", "room", "walls", "furniture")
_SURFACE = ("material", "thickness_m"), ("roughness_m",)
_WALL = ("name", "corner_m", "edge_u_m", "edge_v_m", "material", "thickness_m"), ("roughness_m",)
_FURNITURE = (
    ("name", "mesh", "material", "position_m"),
    ("yaw_deg", "scale", "metres_per_unit", "sheet"),
)
_MATERIAL = ("source", "low_hz", "high_hz", "a"), ("b", "c", "d")


def read_scene(path: Path) -> Scene:
    """The scene that a TOML file describes; its meshes are read, and judged, at once.

    Raises
    ------
    InputError
        Where the file cannot be read, is not TOML, or anything in it has no meaning.
    """
    table = read_toml(path, "scene", "give a TOML file or the name of a scene")
    try:
        return _scene(table, path)
    except InputError as error:
        raise InputError(f"scene file '{path}': {error}") from None


def _scene(table: Table, path: Path) -> Scene:
    check_keys("", table, (), (*_TEXTS, *_TABLES))
    for key in _TEXTS:
        if key in table and not (isinstance(table[key], str) and table[key].isprintable()):
            raise InputError(f"{key} = {shown(table[key])}; it must be a string of one line")
    materials = {**MATERIALS, **_own_materials(table_at("materials", table))}
    walls = [
        *(_room(table["room"], materials) if "room" in table else ()),
        *_walls(table, materials),
    ]
    furniture = _furniture(table, materials, path.parent)
    fields: dict[str, Any] = {}
    if "radar" in table:
        radar = table_at("radar", table)
        check_keys("[radar] ", radar, ("position_m",), ())
        fields["radar_position_m"] = radar["position_m"]
    if "person" in table:
        person = table_at("person", table)
        check_keys("[person] ", person, (), ("position_m", "heading_deg"))
        fields |= {
            "person_" + key if key == "position_m" else key: value for key, value in person.items()
        }
    texts = {key: table[key] for key in _TEXTS if key in table}
    scene = Scene(
        **{"name": printable(path.stem), **texts},
        walls=tuple(walls),
        furniture=tuple(furniture),
        **fields,
    )
    for piece in scene.furniture:
        piece.triangles()
    return scene


def _own_materials(table: Table) -> dict[str, Material]:
    found = {}
    for name in table:
        check_text("[materials]", "a name", name)
        constants = table_at(name, table, "materials.")
        check_keys(f"[materials.{name}] ", constants, *_MATERIAL)
        found[name] = own_material(name, **constants)
    return found


def _room(table: object, materials: Mapping[str, Material]) -> tuple[Wall, ...]:
    if not isinstance(table, dict):
        raise InputError(f"room = {shown(table)}; it must be a table: [room]")
    check_keys("[room] ", table, ("size_m", "corner_m"), ("walls", *ROOM_SIDES))
    surfaces = {}
    for side in ROOM_SIDES:
        key = side if side in table or side in ("floor", "ceiling") else "walls"
        if key not in table:
            wanted = (
                f"[room.{side}]" if key == side else f"[room.{side}], or [room.walls] for all four"
            )
            raise InputError(f"[room]: {wanted} is missing; it needs material and thickness_m")
        surface = table_at(key, table, "room.")
        check_keys(f"[room.{key}] ", surface, *_SURFACE)
        chosen = _material(f"[room.{key}] ", surface["material"], materials)
        surfaces[side] = Surface(**{**surface, "material": chosen})
    return room_walls(table["size_m"], table["corner_m"], surfaces)


def _walls(table: Table, materials: Mapping[str, Material]) -> list[Wall]:
    def wall(where: str, piece: Table) -> Wall:
        check_keys(where, piece, *_WALL)
        return _within(
            where,
            lambda: Wall(**{**piece, "material": _material("", piece["material"], materials)}),
        )

    return [wall(where, piece) for where, piece in tables_at("walls", table)]


def _furniture(table: Table, materials: Mapping[str, Material], folder: Path) -> list[Furniture]:
    def furniture(where: str, piece: Table) -> Furniture:
        check_keys(where, piece, *_FURNITURE)
        mesh = _mesh(where, piece["mesh"], folder)
        chosen = _material(where, piece["material"], materials)
        return _within(where, lambda: Furniture(**{**piece, "mesh": mesh, "material": chosen}))

    return [furniture(where, piece) for where, piece in tables_at("furniture", table)]


def _mesh(where: str, value: object, folder: Path) -> str | Path:
    """A name as it is; a file only from the folder of the scene file or below: a scene may come from a stranger."""
    text = check_text(where.strip(), "mesh", value)
    if not Path(text).suffix:
        return text
    if Path(text).suffix.lower() not in MESH_ENDINGS:
        raise InputError(f"{where}mesh = {shown(text)}; allowed endings: {', '.join(MESH_ENDINGS)}")
    if inside(folder, text) is None:
        raise InputError(
            f"{where}mesh = {shown(text)} leaves the folder of the scene file; put the mesh beside it or below"
        )
    return folder / text


def _material(where: str, value: object, materials: Mapping[str, Material]) -> Material:
    if not isinstance(value, str) or value not in materials:
        allowed = ", ".join(sorted(materials))
        raise InputError(
            f"{where}material = {shown(value)} is unknown; allowed: {allowed}, or a table [materials.NAME] of your own"
        )
    return materials[value]


def _within(where: str, make: Callable[[], Made]) -> Made:
    try:
        return make()
    except InputError as error:
        raise InputError(f"{where}{error}") from None
