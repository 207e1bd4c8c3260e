"""People of a scene: the tables ``[[people]]`` of its file."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtradar.errors import InputError
from rtradar.recordings import SAID, said_of
from rtradar.settings import Breathing
from rtradar.system.checks import (
    Table,
    brief,
    check_keys,
    check_number,
    check_text,
    inside,
    table_at,
    tables_at,
)

if TYPE_CHECKING:
    from rtradar.body import Person
    from rtradar.motion import Motion

KEYS = "skeleton up unit rate_hz position_m heading_deg start_s body material breathing seed"
KEYS += " duration_s"
"""Keys that a person may have beside ``motion``."""

SYNTHETIC = "synthetic:"
"""How the name of a synthetic motion begins."""

_OF_ACTORS = ("seed", "duration_s")
_ACTOR_S, _LONGEST_S = 10.0, 3600.0
"""How long a synthetic actor moves by default, and at most [s]."""


def checked(where: str, people: Iterable[Person]) -> tuple[Person, ...]:
    """Return the people of a scene as a tuple; InputError if one is none."""
    given: object = people
    found: tuple[Any, ...] = tuple(people) if isinstance(given, Iterable) else (None,)
    if found:
        from rtradar.body import Person  # which takes long to import

        if not all(isinstance(one, Person) for one in found):
            raise InputError(f"{where}: people must be a tuple of Person")
    return found


def people_of(table: Table, folder: Path) -> tuple[Person, ...]:
    """Read the people of a scene.

    Parameters
    ----------
    table : mapping
        Table of the scene file.
    folder : path
        Folder of the file, in which recordings must lie, or below: a scene may come from a
        stranger, and must not open files anywhere else.

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
            if key not in ("motion", "skeleton", "breathing", *SAID, *_OF_ACTORS)
        }
        try:
            if "breathing" in entry:
                breath = table_at("breathing", entry)
                check_keys("breathing: ", breath, ("amplitude_mm", "rate_hz"), ("phase_deg",))
                own["breathing"] = Breathing(**breath)
            found.append(Person(_motion(entry, folder), **own))
        except InputError as error:
            raise InputError(f"{where}{error}") from None
    return tuple(found)


def _motion(entry: Table, folder: Path) -> Motion:
    from rtradar.motion import load_motion, synthetic_motion  # which takes long to import

    name = check_text("person", "motion", entry["motion"])
    if name.startswith(SYNTHETIC):
        for key in ("skeleton", *SAID):
            if key in entry:
                raise InputError(f"{name}: only a recording has it; leave {key} out")
        asked = entry.get("duration_s", _ACTOR_S)
        duration_s = check_number("person", "duration_s", asked, 0.0, _LONGEST_S)
        activity = name.removeprefix(SYNTHETIC)
        return synthetic_motion(activity, seed=entry.get("seed", 0), duration_s=duration_s)
    for key in _OF_ACTORS:
        if key in entry:
            raise InputError(f"{key} = {brief(entry[key])}: only a synthetic actor has it")
    paths = {}
    for key in ("motion", "skeleton"):
        if key in entry:
            text = check_text("people", key, entry[key])
            if inside(folder, text) is None:
                raise InputError(
                    f"{key} = {brief(text)} leaves the folder of the scene file; put the "
                    "recording beside it or below"
                )
            paths[key] = folder / text
    said = said_of("people", entry)
    return load_motion(paths["motion"], skeleton=paths.get("skeleton"), **said)
