"""People, radar, scene and settings of the tables of a run file, or of names and paths."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from rtradar.body import Person
from rtradar.errors import InputError, prefixed
from rtradar.motion import Motion, load_motion, synthetic_motion
from rtradar.radar import Radar
from rtradar.recordings import ACTOR_S, SYNTHETIC
from rtradar.scene import Object, Scene
from rtradar.scene.tables import files_of, people_of, rooted
from rtradar.settings import RunSettings
from rtradar.system.checks import Table, brief, check_keys, printable, table_at, tables_at
from rtradar.system.fields import read_table
from rtradar.system.registries import scene_table

KEYS = ("people", "radar", "scene", "settings", "versions", "files", "missing")
"""Tables and lists of a run file."""

_POSE = ("position_m", "yaw_deg", "pitch_deg", "roll_deg")
_RADAR, _SCENE = "paper-12ghz", "free-space"
_UPRIGHT = ("near", "far", "right", "left")


class Parts(NamedTuple):
    """What `rtradar.run` takes: people, radar, scene and settings."""

    people: tuple[Person, ...]
    radar: Radar
    scene: Scene
    settings: RunSettings


def parts_of(table: Table, folder: Path) -> Parts:
    """Make people, radar, scene and settings of the tables of a run file.

    Parameters
    ----------
    table : mapping
        Tables, as `table_of` gives them or a person writes them.
    folder : path
        Folder that relative paths start from.

    Returns
    -------
    Parts

    Raises
    ------
    InputError
        Where a key or a value has no meaning, a file cannot be read, or something is missing that
        no file holds.
    """
    check_keys("", table, (), KEYS)
    for what in table.get("missing", ()):
        raise InputError(f"the run file lacks {what}: no file holds it; run it from Python again")
    settings = settings_of_table(table_at("settings", table), folder)
    scene = _scene(table, folder)
    radar = _radar(table_at("radar", table), folder)
    return Parts(_people(table, folder, scene, settings), radar, scene, settings)


def settings_of_table(table: Table, folder: Path = Path()) -> RunSettings:
    """Make the settings of the table ``[settings]``, whose paths start from a folder."""
    given = dict(table)
    if "breathing" in given:
        given["breathing"] = table_at("breathing", given, "settings.")
    if isinstance(background := given.get("background"), str):
        given["background"] = str((folder / background).absolute())
    with prefixed("[settings] "):
        return read_table(RunSettings, "", given)


def _radar(table: Table, folder: Path) -> Radar:
    # A table that has a name is whole.
    given = dict(table) if "name" in table else {"base": _RADAR, **table}
    base = given.get("base")
    if isinstance(base, str) and Path(base).suffix in (".toml", ".cfg"):
        given["base"] = str((folder / base).absolute())
    return Radar.load(given)


def _scene(table: Table, folder: Path) -> Scene:
    own = copy.deepcopy(dict(table_at("scene", table)))
    # The run file says where the radar is, whatever its own file or the scene says.
    radar = table_at("radar", table)
    if pose := {key: radar[key] for key in _POSE if key in radar}:
        own["radar"] = {**table_at("radar", own, "scene."), **pose}
    for _, key, entry in files_of(own):
        entry[key] = str((folder / entry[key]).absolute())
    # A table without a base that says more than places is a scene by itself.
    base = own.pop("base", None if own.keys() - {"radar", "person"} else _SCENE)
    if base is None:
        return Scene.of_table(own)
    if not isinstance(base, str):
        raise InputError(f"[scene] base = {brief(base)}; it must be a name or a path")
    # Otherwise it changes values of the base.
    path, below = scene_table(folder / base if Path(base).suffix else base)
    below = {"name": printable(path.stem), **rooted(below, path.parent)}
    return Scene.of_table(_merged(below, own))


def _merged(below: Any, over: Any) -> Any:
    """A table with the values of another over it, key by key."""
    if not (isinstance(below, Mapping) and isinstance(over, Mapping)):
        return over
    found = dict(below)
    for key, value in over.items():
        # A wall of a room of which only one key is said has the others of all four.
        under = found.get(key, found.get("walls") if key in _UPRIGHT else None)
        found[key] = _merged(under, value)
    return found


def _people(table: Table, folder: Path, scene: Scene, settings: RunSettings) -> tuple[Person, ...]:
    """People of the run file, those without a place where the scene has its person."""
    where = {"position_m": list(scene.person_position_m), "heading_deg": scene.heading_deg}
    entries: list[Table] = []
    # People without a place of their own stand where the scene has its person; actors take seed and
    # duration of the run.
    for number, (_, entry) in enumerate(tables_at("people", table)):
        placed = entry.get("placement", "standard") == "recorded" or "position_m" in entry
        own = dict(entry) if placed else {**where, **entry}
        actor = str(own.get("motion", "")).startswith(SYNTHETIC)
        if actor and settings.duration_s is not None:
            own.setdefault("duration_s", settings.start_s + settings.duration_s)
        if actor:
            own.setdefault("seed", settings.seed + number)
        entries.append(own)
    return people_of({"people": entries}, folder)


def with_value(table: Table, key: str, value: object) -> dict[str, Any]:
    """Return a table with another value under a dotted key, such as ``radar.pitch_deg``.

    Parameters
    ----------
    table : mapping
        Tables of a run file.
    key : str
        Names with dots between; of a list the number, from 0.
    value : object
        Value, as TOML has them.

    Returns
    -------
    dict
        A copy.

    Raises
    ------
    InputError
        Where the key leads through what is no table, or past the end of a list.
    """
    found: dict[str, Any] = copy.copy(dict(table))
    check_keys("", {key.partition(".")[0]: 0}, (), KEYS[:4])
    # Every table on the way is copied, so that the original stays as it is.
    at: Any = found
    *way, last = key.split(".")
    for name in way:
        below = copy.copy(_at(at, name, key))
        at[int(name) if isinstance(at, list) else name] = below
        at = below
    if isinstance(at, list):
        _at(at, last, key)
        at[int(last)] = value
    elif isinstance(at, dict):
        at[last] = value
    else:
        raise InputError(f"{key}: there is no table '{'.'.join(way)}'")
    return found


def _at(table: Any, name: str, key: str) -> Any:
    if isinstance(table, list):
        if not (name.isdecimal() and int(name) < len(table)):
            raise InputError(f"{key}: '{name}' is no number from 0 to {len(table) - 1}")
        return table[int(name)]
    if not isinstance(table, dict):
        raise InputError(f"{key}: '{name}' lies in no table")
    return table.get(name, {})


# -- what is given by a name or a path ------------------------------------------------------------

Movers: TypeAlias = Sequence[Motion | Person | Object]
"""Who and what moves, once files are read."""

Moving: TypeAlias = Motion | Person | str | Path | Sequence[Motion | Person | Object | str | Path]
"""Who and what moves: one or several; a bare motion is a person where the scene puts them."""


def given_parts(
    moving: Moving,
    radar: Radar | str | Path,
    scene: Scene | str | Path | None,
    settings: RunSettings,
) -> tuple[list[Motion | Person | Object], Radar, Scene]:
    """Load what is given by names and paths, and check what is given as it is.

    Parameters
    ----------
    moving : Motion, Person, str, path, or sequence of them and of Object
        Who and what moves; text is the path of a recording, or ``synthetic:`` and an activity.
    radar : Radar, str or path
        Radar, or what `Radar.load` takes.
    scene : Scene, str or path, optional
        Scene, or what `Scene.load` takes; free space if left out.
    settings : RunSettings
        Seed and interval, which actors by name follow.

    Returns
    -------
    tuple
        Those who and what move, the radar, and the scene.

    Raises
    ------
    InputError
        Where there is no such name, a file cannot be read, or something is none of these.
    """
    # A single one is a list of one; names and paths are loaded.
    several = (
        [moving] if isinstance(moving, str | Path) or not isinstance(moving, Sequence) else moving
    )
    found = [
        load_mover(one, number, settings) if isinstance(one, str | Path) else one
        for number, one in enumerate(several)
    ]
    radar = Radar.load(radar) if isinstance(radar, str | Path) else radar
    scene = Scene() if scene is None else scene
    scene = Scene.load(scene) if isinstance(scene, str | Path) else scene
    if not isinstance(radar, Radar):
        raise InputError(
            f"radar = {brief(radar)}; it must be a Radar, such as rt.Radar.preset('paper-12ghz'), "
            "or the name or path of one"
        )
    if not isinstance(scene, Scene):
        raise InputError(
            f"scene = {brief(scene)}; it must be a Scene, such as rt.Scene.load('living-room'), or "
            "the name or path of one"
        )
    return found, radar, scene


def load_mover(source: str | Path, number: int, settings: RunSettings, **reading: Any) -> Motion:
    """Load a motion by the path of a recording, or ``synthetic:`` and an activity.

    Parameters
    ----------
    source : str or path
        Recording or actor.
    number : int
        Number of the person, which makes actors differ.
    settings : RunSettings
        Seed and interval, which actors follow.
    **reading
        What `load_motion` takes.

    Returns
    -------
    Motion

    Raises
    ------
    InputError
        Where there is no such actor, or the recording cannot be read.
    """
    text = str(source)
    if not text.startswith(SYNTHETIC):
        return load_motion(source, **reading)
    duration_s = ACTOR_S if settings.duration_s is None else settings.duration_s
    return synthetic_motion(
        text.removeprefix(SYNTHETIC),
        seed=settings.seed + number,
        duration_s=settings.start_s + duration_s,
    )
