"""The tables of a scene file: their keys, and what is made of them."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from rtradar.conventions import PERSON_LIMITS
from rtradar.errors import InputError, prefixed
from rtradar.recordings import SAID, SYNTHETIC, said_of
from rtradar.scene.materials import MATERIALS, Material, own_material
from rtradar.scene.moving import Object, motion_of
from rtradar.scene.objects import BOX, ROOM_SIDES, Furniture, Surface, Wall, room_walls
from rtradar.scene.random_rooms import RANDOM, random_room
from rtradar.system.checks import (
    Table,
    brief,
    check_keys,
    check_number,
    inside,
    table_at,
    tables_at,
)
from rtradar.system.fields import Angle, Limits, Point, keys_of, read_value

if TYPE_CHECKING:
    from rtradar.body import Person
    from rtradar.motion import Motion

_Place = Annotated[tuple[float, float], Limits(*PERSON_LIMITS["position_m"])]
_OF_PEOPLE = (
    "skeleton up unit rate_hz placement position_m heading_deg start_s body material breathing"
)
_OF_PEOPLE += " seed duration_s traits"
"""Keys that a person may have beside ``motion``."""

_OF_ACTORS = ("seed", "traits")
_ACTOR_S, _LONGEST_S = 10.0, 3600.0
"""How long a synthetic actor moves by default, and at most [s]."""

Piece = TypeVar("Piece", Wall, Furniture, Object)

ANGLES = ("yaw_deg", "pitch_deg", "roll_deg")


def _of_mesh(kind: type, *needed: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    own, others = keys_of(kind, without=("mesh", *needed))
    return (*own, *needed), ("mesh", "box", *others)


KEYS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "top": ((), ("name", "description")),
    "[random]": (("seed",), tuple(RANDOM)),
    "[radar]": ((), ("position_m", *ANGLES)),
    "[person]": ((), ("position_m", "heading_deg")),
    "[room]": (("size_m", "corner_m"), ()),
    "a side of a room": keys_of(Surface),
    "[[walls]]": keys_of(Wall),
    "[[furniture]]": _of_mesh(Furniture),
    "[[objects]]": _of_mesh(Object, "motion"),
    "[[people]]": (("motion",), tuple(_OF_PEOPLE.split())),
    "[materials.NAME]": (("source", "low_hz", "high_hz", "a"), ("b", "c", "d")),
}
"""Keys of each table of a scene file: those that must be given, and the others."""


def files_of(table: Table) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Yield where a table of a scene names files, under which key, and the table of that key."""
    for list_, keys in (
        ("furniture", ("mesh",)),
        ("objects", ("mesh",)),
        ("people", ("motion", "skeleton")),
    ):
        for where, entry in tables_at(list_, table):
            for key in keys:
                text = entry.get(key)
                named = isinstance(text, str) and (key != "mesh" or Path(text).suffix)
                if named and not str(text).startswith(SYNTHETIC) and isinstance(entry, dict):
                    yield where, key, entry


def rooted(table: Table, folder: Path) -> Table:
    """Return the table of a scene file with absolute paths of files, which must be in its folder.

    Or below: a scene may come from a stranger, and must not open files anywhere else.
    """
    table = copy.deepcopy(drawn(table))
    for where, key, entry in files_of(table):
        if inside(folder, entry[key]) is None:
            raise InputError(
                f"{where}{key} = {brief(entry[key])} leaves the folder of the scene file; put the "
                f"{'mesh' if key == 'mesh' else 'recording'} beside it or below"
            )
        entry[key] = str((folder / entry[key]).absolute())
    return table


def drawn(table: Table) -> Table:
    """Return a table with the room that its key ``random`` asks for; other keys replace its own."""
    if "random" not in table:
        return table
    rest = {key: value for key, value in table.items() if key != "random"}
    return {**random_room(table_at("random", table)), **rest}


def fields_of(table: Table) -> dict[str, Any]:
    """Turn the table of a file into the fields of a `Scene`."""
    texts = KEYS["top"][1]
    tables = ("radar", "person", "materials", "room", "walls", "furniture", "objects", "people")
    check_keys("", table, (), (*texts, *tables))
    materials = {**MATERIALS, **_own_materials(table_at("materials", table))}
    room = _room(table_at("room", table), materials) if "room" in table else ()
    fields: dict[str, Any] = {
        **{key: table[key] for key in texts if key in table},
        "walls": (*room, *_pieces("walls", Wall, table, materials)),
        "furniture": _pieces("furniture", Furniture, table, materials),
        "objects": _pieces("objects", Object, table, materials),
        "people": people_of(table),
    }
    if "radar" in table:
        radar = table_at("radar", table)
        check_keys("[radar] ", radar, *(KEYS["[radar]"] if radar else (("position_m",), ())))
        for key, value in radar.items():
            kind = Point if key == "position_m" else Angle
            fields[f"radar_{key}"] = read_value(kind, "[radar] ", key, value)
    if "person" in table:
        person = table_at("person", table)
        check_keys("[person] ", person, *KEYS["[person]"])
        if "position_m" in person:
            place = person["position_m"]
            fields["person_position_m"] = read_value(_Place, "[person] ", "position_m", place)
        if "heading_deg" in person:
            fields["heading_deg"] = person["heading_deg"]
    return fields


def _own_materials(table: Table) -> dict[str, Material]:
    found = {}
    for name in table:
        read_value(str, "[materials] ", "a name", name)
        constants = table_at(name, table, "materials.")
        check_keys(f"[materials.{name}] ", constants, *KEYS["[materials.NAME]"])
        found[name] = own_material(name, **constants)
    return found


def _room(table: Table, materials: Mapping[str, Material]) -> tuple[Wall, ...]:
    check_keys("[room] ", table, KEYS["[room]"][0], ("walls", *ROOM_SIDES))
    surfaces = {}
    for side in ROOM_SIDES:
        key = side if side in table or side in ("floor", "ceiling") else "walls"
        if key not in table:
            wanted = (
                f"[room.{side}]" if key == side else f"[room.{side}], or [room.walls] for all four"
            )
            raise InputError(f"[room]: {wanted} is missing; it needs material and thickness_m")
        surface = table_at(key, table, "room.")
        check_keys(f"[room.{key}] ", surface, *KEYS["a side of a room"])
        chosen = _material(f"[room.{key}] ", surface["material"], materials)
        surfaces[side] = Surface(**{**surface, "material": chosen})
    return room_walls(table["size_m"], table["corner_m"], surfaces)


def _pieces(
    key: str, kind: type[Piece], table: Table, materials: Mapping[str, Material]
) -> tuple[Piece, ...]:
    found = []
    for where, entry in tables_at(key, table):
        check_keys(where, entry, *KEYS[f"[[{key}]]"])
        own: dict[str, Any] = {}
        if kind is not Wall:
            own["mesh"] = _shape(where, entry)
            entry = {name: value for name, value in entry.items() if name != "box"}
        chosen = _material(where, entry["material"], materials)
        with prefixed(where):
            if "motion" in entry:
                own["motion"] = motion_of(entry["motion"])
            found.append(kind(**{**entry, **own, "material": chosen}))
    return tuple(found)


def _shape(where: str, entry: Table) -> Any:
    """Return the mesh of an entry, or the lengths of its box."""
    if ("mesh" in entry) == ("box" in entry):
        raise InputError(f"{where}give a mesh, or box = [x, y, z] in metres, one of them")
    if "mesh" in entry:
        return read_value(str, where, "mesh", entry["mesh"])
    return read_value(BOX, where, "box", entry["box"])


def _material(where: str, value: object, materials: Mapping[str, Material]) -> Material:
    if not isinstance(value, str) or value not in materials:
        allowed = ", ".join(sorted(materials))
        raise InputError(
            f"{where}material = {brief(value)} is unknown; allowed: {allowed}, or a table "
            "[materials.NAME] of your own"
        )
    return materials[value]


def people_of(table: Table, folder: Path = Path()) -> tuple[Person, ...]:
    """Read the people of a scene.

    Parameters
    ----------
    table : mapping
        Table of the scene file.
    folder : path
        Folder that relative paths start from.

    Returns
    -------
    tuple of Person

    Raises
    ------
    InputError
        Where a key or a value has no meaning, or a recording cannot be read.
    """
    entries = tables_at("people", table)
    if not entries:
        return ()
    from rtradar.body import Person  # which takes long to import

    found = []
    for where, entry in entries:
        check_keys(where, entry, *KEYS["[[people]]"])
        own = {
            key: value
            for key, value in entry.items()
            if key not in ("motion", "skeleton", "duration_s", *SAID, *_OF_ACTORS)
        }
        with prefixed(where):
            found.append(Person(_motion(entry, folder), **own))
    return tuple(found)


def _motion(entry: Table, folder: Path) -> Motion:
    from rtradar.motion import Motion, load_motion, synthetic_motion  # which takes long to import

    if isinstance(entry["motion"], Motion):
        return entry["motion"]
    name = read_value(str, "person: ", "motion", entry["motion"])
    if name.startswith(SYNTHETIC):
        for key in ("skeleton", *SAID):
            if key in entry:
                raise InputError(f"{name}: only a recording has it; leave {key} out")
        asked = entry.get("duration_s", _ACTOR_S)
        duration_s = check_number("person", "duration_s", asked, 0.0, _LONGEST_S)
        activity, traits = name.removeprefix(SYNTHETIC), table_at("traits", entry)
        given = {"seed": entry.get("seed", 0), "duration_s": duration_s, **traits}
        try:
            return synthetic_motion(activity, **given)
        except TypeError:  # a trait that is none, or of another kind
            raise InputError(f"traits = {brief(traits)}: no such traits of {name}") from None
    for key in _OF_ACTORS:
        if key in entry:
            raise InputError(f"{key} = {brief(entry[key])}: only a synthetic actor has it")
    paths = {
        key: folder / read_value(str, "people: ", key, entry[key])
        for key in ("motion", "skeleton")
        if key in entry
    }
    said = said_of("people", entry)
    recording = load_motion(paths["motion"], skeleton=paths.get("skeleton"), **said)
    if "duration_s" not in entry:
        return recording
    start_s = read_value(float, "person: ", "start_s", entry.get("start_s", 0.0))
    left_s = max(recording.duration_s - start_s, 0.0)
    duration_s = check_number("person", "duration_s", entry["duration_s"], 0.0, left_s)
    ended = dataclasses.replace(recording, length_s=start_s + duration_s)
    assert recording.source is not None  # it was read from a file
    keys = {**recording.source.keys, "duration_s": duration_s}
    return ended.made_from(recording.source._replace(keys=keys))
