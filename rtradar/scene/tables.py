"""The tables of a scene file: their keys, what is made of them, and rooms drawn at random."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np

from rtradar.conventions import PERSON_LIMITS
from rtradar.errors import InputError, prefixed
from rtradar.recordings import SAID, SYNTHETIC, said_of
from rtradar.scene.materials import MATERIALS, Material, material, own_material
from rtradar.scene.mesh_files import read_mesh
from rtradar.scene.moving import Object, motion_of
from rtradar.scene.objects import BOX, ROOM_SIDES, Furniture, Surface, Wall, room_walls
from rtradar.system.checks import (
    Table,
    brief,
    check_keys,
    check_number,
    inside,
    printable,
    table_at,
    tables_at,
)
from rtradar.system.fields import (
    Angle,
    Limits,
    Point,
    check_fields,
    keys_of,
    read_table,
    read_value,
    within,
)
from rtradar.system.files import shipped_folder
from rtradar.system.seeds import Seed

if TYPE_CHECKING:
    from rtradar.body import Person
    from rtradar.motion import Motion

_OF_PEOPLE = """\
skeleton up unit rate_hz placement position_m heading_deg start_s body material breathing seed
duration_s traits"""
"""Keys that a person may have beside ``motion``."""

_OF_ACTORS = ("seed", "traits")
_ACTOR_S, _LONGEST_S = 10.0, 3600.0
"""How long a synthetic actor moves by default, and at most [s].

An actor of a run moves as long as the run asks, 3 s by default (`rtradar.recordings.ACTOR_S`). A
scene does not know the run: its actors move longer, since the shortest motion ends a capture."""

Piece = TypeVar("Piece", Wall, Furniture, Object)

ANGLES = ("yaw_deg", "pitch_deg", "roll_deg")

_PLACES = {
    ("radar", "position_m"): Point,
    ("person", "position_m"): Annotated[tuple[float, float], Limits(*PERSON_LIMITS["position_m"])],
    ("person", "heading_deg"): Annotated[float, Limits(*PERSON_LIMITS["heading_deg"])],
}
"""What the keys of the tables of radar and person are, of those that are no angles of the radar."""

_SHAPES = {"mesh": str, "box": BOX}
"""Keys that say the shape of furniture or of an object, which has one of them."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class RandomRoom:
    """Ranges from which a room is drawn, of pieces of furniture and of sizes along the axes [m]."""

    seed: Seed
    furniture: Annotated[tuple[int, int], within(0, 20, "whole numbers")] = (2, 7)
    length_m: Annotated[tuple[float, float], within(5.5, 30.0)] = (5.5, 8.0)
    width_m: Annotated[tuple[float, float], within(3.0, 30.0)] = (3.4, 6.5)
    height_m: Annotated[tuple[float, float], within(2.2, 10.0)] = (2.3, 3.0)

    def __post_init__(self) -> None:
        check_fields(self, "[random] ")


def _of_mesh(kind: type, *needed: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    own, others = keys_of(kind, without=("mesh", *needed))
    return (*own, *needed), (*_SHAPES, *others)


KEYS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "top": ((), ("name", "description")),
    "[random]": keys_of(RandomRoom),
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
    for kind in ("furniture", "objects", "people"):
        for where, entry in tables_at(kind, table):
            for key in ("motion", "skeleton") if kind == "people" else ("mesh",):
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
    # Materials first, because everything else names them.
    materials = {**MATERIALS, **_own_materials(table_at("materials", table))}
    room = _room(table_at("room", table), materials) if "room" in table else ()
    fields: dict[str, Any] = {
        **{key: table[key] for key in texts if key in table},
        "walls": (*room, *_pieces("walls", Wall, table, materials)),
        "furniture": _pieces("furniture", Furniture, table, materials),
        "objects": _pieces("objects", Object, table, materials),
        "people": people_of(table),
    }
    # Places of radar and person, under the names of the fields.
    for kind in ("radar", "person"):
        own = table_at(kind, table)
        # A table of the radar says where it is.
        nowhere = kind == "radar" and kind in table and not own
        check_keys(f"[{kind}] ", own, *((("position_m",), ()) if nowhere else KEYS[f"[{kind}]"]))
        for key, value in own.items():
            read = read_value(_PLACES.get((kind, key), Angle), f"[{kind}] ", key, value)
            fields[key if key == "heading_deg" else f"{kind}_{key}"] = read
    return fields


def _own_materials(table: Table) -> dict[str, Material]:
    found = {}
    for name in table:
        read_value(str, "[materials] ", "a name", name)
        constants = table_at(name, table, "materials.")
        check_keys(f"[materials.{printable(name)}] ", constants, *KEYS["[materials.NAME]"])
        found[name] = own_material(name, **constants)
    return found


def _room(table: Table, materials: Mapping[str, Material]) -> tuple[Wall, ...]:
    check_keys("[room] ", table, KEYS["[room]"][0], ("walls", *ROOM_SIDES))
    surfaces = {}
    # The four walls may share a table; floor and ceiling have their own.
    for side in ROOM_SIDES:
        key = side if side in table or side in ("floor", "ceiling") else "walls"
        if key not in table:
            wanted = f"[room.{side}]{', or [room.walls] for all four' * (key != side)}"
            raise InputError(f"[room]: {wanted} is missing; it needs material and thickness_m")
        surface = table_at(key, table, "room.")
        with prefixed(f"[room.{key}] "):
            check_keys("", surface, *KEYS["a side of a room"])
            chosen = material(surface["material"], materials)
        surfaces[side] = Surface(**{**surface, "material": chosen})
    return room_walls(table["size_m"], table["corner_m"], surfaces)


def _pieces(
    key: str, kind: type[Piece], table: Table, materials: Mapping[str, Material]
) -> tuple[Piece, ...]:
    found = []
    for where, entry in tables_at(key, table):
        own = dict(entry)
        with prefixed(where):
            check_keys("", own, *KEYS[f"[[{key}]]"])
            # A mesh by name or file, or the sizes of a box.
            if kind is not Wall:
                given = [name for name in _SHAPES if name in own]
                if len(given) != 1:
                    raise InputError("give a mesh, or box = [x, y, z] in metres, one of them")
                own["mesh"] = read_value(_SHAPES[given[0]], "", given[0], own.pop(given[0]))
            if "motion" in own:
                own["motion"] = motion_of(own["motion"])
            own["material"] = material(own["material"], materials)
            found.append(kind(**own))
    return tuple(found)


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
        of_motion = ("motion", "skeleton", "duration_s", *SAID, *_OF_ACTORS)
        own = {key: value for key, value in entry.items() if key not in of_motion}
        with prefixed(where):
            found.append(Person(_motion(entry, folder), **own))
    return tuple(found)


def _motion(entry: Table, folder: Path) -> Motion:
    from rtradar.motion import Motion, load_motion, synthetic_motion  # which takes long to import

    if isinstance(entry["motion"], Motion):
        return entry["motion"]
    name = read_value(str, "person: ", "motion", entry["motion"])
    # A recording has no traits, and an actor no file.
    acted = name.startswith(SYNTHETIC)
    for key in ("skeleton", *SAID) if acted else _OF_ACTORS:
        if key in entry:
            only = f"only {'a recording' if acted else 'a synthetic actor'} has it"
            raise InputError(f"{key} = {brief(entry[key])} of {name}: {only}; leave {key} out")
    if acted:
        asked = entry.get("duration_s", _ACTOR_S)
        duration_s = check_number("person", "duration_s", asked, 0.0, _LONGEST_S)
        activity, traits = name.removeprefix(SYNTHETIC), table_at("traits", entry)
        given = {"seed": entry.get("seed", 0), "duration_s": duration_s, **traits}
        try:
            return synthetic_motion(activity, **given)
        except TypeError:  # a trait that is none, or of another kind
            raise InputError(f"traits = {brief(traits)}: no such traits of {name}") from None
    given = said_of("people", entry)
    if "skeleton" in entry:
        given["skeleton"] = folder / read_value(str, "people: ", "skeleton", entry["skeleton"])
    # A duration ends a recording early; the run file keeps it, so that the same is made again.
    recording = load_motion(folder / name, **given)
    if "duration_s" not in entry:
        return recording
    start_s = read_value(float, "person: ", "start_s", entry.get("start_s", 0.0))
    left_s = max(recording.duration_s - start_s, 0.0)
    duration_s = check_number("person", "duration_s", entry["duration_s"], 0.0, left_s)
    ended = dataclasses.replace(recording, length_s=start_s + duration_s)
    assert recording.source is not None  # it was read from a file
    keys = {**recording.source.keys, "duration_s": duration_s}
    return ended.made_from(recording.source._replace(keys=keys))


# -- rooms that are drawn at random ----------------------------------------------------------------
#
# A room has six sides, at times a window, and furniture along its walls. The radar stands before
# the near wall. What a person needs to walk toward it stays free, and half a metre about it.

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
    ranges = read_table(RandomRoom, "[random] ", table)
    draw = np.random.default_rng(ranges.seed)

    def between(low: float, high: float, digits: int = 2) -> float:
        return round(float(draw.uniform(low, high)), digits)

    def side(materials: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
        material = str(draw.choice(list(materials)))
        thickness_m = between(*materials[material], digits=4)
        rough_m = between(1e-4, 5e-4, digits=5)
        return {"material": material, "thickness_m": thickness_m, "roughness_m": rough_m}

    # The size of the room, the radar, and where the room is: the near wall is just behind the
    # radar.
    size = [between(*own) for own in (ranges.length_m, ranges.width_m, ranges.height_m)]
    radar = [-between(2.6, 3.2), between(-0.5, 0.5), between(0.9, 1.5)]
    low = np.array([radar[0] - between(0.3, 0.4), between(-0.1, 0.1) - size[1] / 2])
    low = np.round(low, 2)
    high = np.round(low + size[:2], 2)
    # Half of the rooms have a window, a pane of glass before the left wall.
    walls = []
    if draw.random() < 0.5:
        wide, sill = between(0.8, 2.0), between(0.7, 1.0)
        # 1 cm before the left wall.
        left = round(float(high[1]) - 0.01, 2)
        corner = [between(low[0] + 0.2, high[0] - wide - 0.2), left, sill]
        up = min(between(0.9, 1.4), round(size[2] - sill - 0.2, 2))
        edges = {"corner_m": corner, "edge_u_m": [wide, 0.0, 0.0], "edge_v_m": [0.0, 0.0, up]}
        walls.append({"name": "window", **edges, "material": "glass", "thickness_m": 0.006})
    # Pieces along the walls, each tried at some places until it is clear of all others; one that
    # never is is left out.
    least, most = ranges.furniture
    furniture = []
    taken = [_FREE_M, np.stack([np.subtract(radar[:2], _RADAR_M), np.add(radar[:2], _RADAR_M)], 1)]
    for number in range(1, 1 + int(draw.integers(least, most + 1))):
        for _ in range(_TRIES):
            mesh, at = str(draw.choice(list(_PIECES))), str(draw.choice(list(_SIDES)))
            place, box = _against(mesh, at, low, high, draw.random())
            if _fits(box, low, high, taken):
                taken.append(box)
                piece = {"name": f"{mesh} {number}", "mesh": mesh, "material": _PIECES[mesh]}
                furniture.append({**piece, "position_m": [*place, 0.0], "yaw_deg": _SIDES[at]})
                break
    # Materials and thicknesses of all sides.
    sides = {name: side(_WALLS) for name in _SIDES}
    sides |= {"floor": side(_FLOORS), "ceiling": side(_CEILINGS)}
    found = {
        "description": f"{' by '.join(f'{length:g}' for length in size)} m, drawn at random",
        "radar": {"position_m": radar},
        "room": {"size_m": size, "corner_m": low.tolist(), **sides},
    }
    return found | {key: own for key, own in (("walls", walls), ("furniture", furniture)) if own}


def _against(mesh: str, side: str, low: Any, high: Any, along: float) -> tuple[list[float], Any]:
    """Put a piece with its back to a wall: its place [x, y] and the box (2, 2) it covers [m]."""
    vertices = read_mesh(shipped_folder("meshes") / f"{mesh}.ply").vertices[:, :2]
    # Turned to look into the room, and the box that it covers about its own origin.
    turn = np.radians(_SIDES[side])
    vertices = vertices @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    own = np.stack([vertices.min(axis=0), vertices.max(axis=0)], axis=1)
    # Along its wall anywhere that is inside, and 2 cm before it.
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
