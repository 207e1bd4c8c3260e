"""Scene files: where they are, and which tables and keys they may have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

from rtradar.errors import InputError
from rtradar.scene.furniture import Furniture
from rtradar.scene.materials import MATERIALS, Material, own_material
from rtradar.scene.mesh_files import MESH_ENDINGS
from rtradar.scene.walls import ROOM_SIDES, Surface, Wall, room_walls
from rtradar.system.checks import check_text, inside, printable, shown
from rtradar.system.toml_tables import Table, check_keys, table_at, tables_at

_TEXTS = ("name", "description")
_TABLES = ("radar", "person", "materials", "room", "walls", "furniture")
_SURFACE = ("material", "thickness_m"), ("roughness_m",)
_WALL = ("name", "corner_m", "edge_u_m", "edge_v_m", "material", "thickness_m"), ("roughness_m",)
_FURNITURE = (
    ("name", "mesh", "material", "position_m"),
    ("yaw_deg", "scale", "metres_per_unit", "sheet"),
)
_MATERIAL = ("source", "low_hz", "high_hz", "a"), ("b", "c", "d")


def scenes_folder() -> Path:
    """Find the scenes of rtradar: inside the installed package, or at the top of a checkout."""
    installed = Path(str(resources.files("rtradar"))) / "scenes"
    return installed if installed.is_dir() else Path(__file__).resolve().parents[2] / "scenes"


def scene_path(source: str | Path) -> Path:
    """Find the file of a scene that is given by its name, or as a ``.toml`` file."""
    if Path(source).suffix == ".toml":
        return Path(source)
    folder = scenes_folder()
    path = folder / f"{source}.toml"
    try:
        found = path.is_file()
    except ValueError:  # a null character
        found = False
    if not found:
        known = ", ".join(sorted(file.stem for file in folder.glob("*.toml")))
        raise InputError(
            f"scene {shown(str(source))} is unknown; allowed: {known}, or the path of a TOML file"
        )
    return path


def scene_fields(table: Table, path: Path) -> dict[str, Any]:
    """Turn the table of the file at ``path`` into the fields of a `Scene`.

    An `InputError` names the table and key that has no meaning.
    """
    check_keys("", table, (), (*_TEXTS, *_TABLES))
    for key in _TEXTS:
        if key in table and not (isinstance(table[key], str) and table[key].isprintable()):
            raise InputError(f"{key} = {shown(table[key])}; it must be a string of one line")
    materials = {**MATERIALS, **_own_materials(table_at("materials", table))}
    room = _room(table["room"], materials) if "room" in table else ()
    fields: dict[str, Any] = {
        "name": printable(path.stem),
        **{key: table[key] for key in _TEXTS if key in table},
        "walls": (*room, *_walls(table, materials)),
        "furniture": tuple(_furniture(table, materials, path.parent)),
    }
    if "radar" in table:
        radar = table_at("radar", table)
        check_keys("[radar] ", radar, ("position_m",), ())
        fields["radar_position_m"] = radar["position_m"]
    if "person" in table:
        person = table_at("person", table)
        check_keys("[person] ", person, (), ("position_m", "heading_deg"))
        for key, value in person.items():
            fields["person_position_m" if key == "position_m" else key] = value
    return fields


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
    found = []
    for where, entry in tables_at("walls", table):
        check_keys(where, entry, *_WALL)
        with _prefixed(where):
            chosen = _material("", entry["material"], materials)
            found.append(Wall(**{**entry, "material": chosen}))
    return found


def _furniture(table: Table, materials: Mapping[str, Material], folder: Path) -> list[Furniture]:
    found = []
    for where, entry in tables_at("furniture", table):
        check_keys(where, entry, *_FURNITURE)
        mesh = _mesh(where, entry["mesh"], folder)
        chosen = _material(where, entry["material"], materials)
        with _prefixed(where):
            found.append(Furniture(**{**entry, "mesh": mesh, "material": chosen}))
    return found


def _mesh(where: str, value: object, folder: Path) -> str | Path:
    """Check a mesh; a file must lie in the folder of the scene file or below.

    A scene may come from a stranger, and must not open files anywhere else.
    """
    text = check_text(where.strip(), "mesh", value)
    if not Path(text).suffix:
        return text
    if Path(text).suffix.lower() not in MESH_ENDINGS:
        raise InputError(f"{where}mesh = {shown(text)}; allowed endings: {', '.join(MESH_ENDINGS)}")
    if inside(folder, text) is None:
        raise InputError(
            f"{where}mesh = {shown(text)} leaves the folder of the scene file; put the mesh beside "
            "it or below"
        )
    return folder / text


def _material(where: str, value: object, materials: Mapping[str, Material]) -> Material:
    if not isinstance(value, str) or value not in materials:
        allowed = ", ".join(sorted(materials))
        raise InputError(
            f"{where}material = {shown(value)} is unknown; allowed: {allowed}, or a table "
            "[materials.NAME] of your own"
        )
    return materials[value]


@contextmanager
def _prefixed(where: str) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise InputError(f"{where}{error}") from None
