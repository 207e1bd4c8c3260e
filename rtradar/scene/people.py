"""People of a scene: the tables ``[[people]]`` of its file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rtradar.errors import InputError, prefixed
from rtradar.recordings import SAID, SYNTHETIC, said_of
from rtradar.system.checks import (
    Table,
    brief,
    check_keys,
    check_number,
    table_at,
    tables_at,
)
from rtradar.system.fields import read_value

if TYPE_CHECKING:
    from rtradar.body import Person
    from rtradar.motion import Motion

KEYS = "skeleton up unit rate_hz placement position_m heading_deg start_s body material breathing"
KEYS += " seed duration_s traits"
"""Keys that a person may have beside ``motion``."""

_OF_ACTORS = ("seed", "duration_s", "traits")
_ACTOR_S, _LONGEST_S = 10.0, 3600.0
"""How long a synthetic actor moves by default, and at most [s]."""


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
        check_keys(where, entry, ("motion",), tuple(KEYS.split()))
        own = {
            key: value
            for key, value in entry.items()
            if key not in ("motion", "skeleton", *SAID, *_OF_ACTORS)
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
    return load_motion(paths["motion"], skeleton=paths.get("skeleton"), **said)
