"""The run file: what was simulated, from which files, by which version.

Its tables of people, radar, scene and settings hold every value. What no file holds, such as a mesh
that was made in Python, is listed under ``missing``: a run file that has this key cannot be run
again.
"""

from __future__ import annotations

import copy
import dataclasses
import math
import os
import platform
import re
from collections.abc import Iterable, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from rtradar.body import Person
from rtradar.errors import InputError
from rtradar.motion import Motion
from rtradar.motion.formats import load_saved, save_motion
from rtradar.motion.synthetic import ACTORS
from rtradar.radar import Radar
from rtradar.recordings import SYNTHETIC
from rtradar.scene import MATERIALS, Material, Object, Scene
from rtradar.scene.materials import PowerLaw
from rtradar.scene.moving import kind_of
from rtradar.scene.objects import Furniture
from rtradar.scene.tables import files_of
from rtradar.settings import RunSettings
from rtradar.system.checks import Table, brief, check_keys, read_toml, tables_at
from rtradar.system.fields import read_value
from rtradar.system.files import digest_of

_PACKAGES = (
    "rtradar", "mitsuba", "drjit", "numpy", "scipy", "numba", "scikit-image", "trimesh", "torch",
)  # fmt: skip

MOST_FILES = 5000
"""Most files whose digests are listed; a table of them has less than a megabyte."""

_HEAD = """\
# What was simulated: `rtradar run run.toml --out DIR` gives it again. Paths start from this folder;
# a file that has changed since is refused.

"""


def versions() -> dict[str, str]:
    """Return versions of Python, packages and actors, and the commit where there is one."""
    found = {"python": platform.python_version()}
    for name in _PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    found["cores"] = str(os.cpu_count())
    commit = _commit(Path(__file__).parents[2] / ".git")
    return found | {"actors": str(ACTORS)} | ({"commit": commit} if commit else {})


def made_from(*files: Path) -> dict[str, Any]:
    """Return the ``files`` that there are, with their digests, and the `versions`, for JSON."""
    there = [path for path in files if path.is_file()]
    listed = [{"path": str(path.absolute()), "sha256": digest_of(path)} for path in there]
    return {"files": listed, "versions": versions()}


def _commit(git: Path) -> str:
    """Commit that is checked out, read from the folder of Git; empty where there is none."""
    try:
        head = (git / "HEAD").read_text().strip()
        # HEAD names a commit, or a branch whose commit is in a file of its own or among the packed
        # ones.
        name = head.removeprefix("ref: ")
        if name == head:
            return head
        if (git / name).is_file():
            return (git / name).read_text().strip()
        lines = (git / "packed-refs").read_text().splitlines()
    except OSError:
        return ""
    return next((line.split()[0] for line in lines if line.endswith(f" {name}")), "")


def write_run_file(folder: Path, place: Path, table: Table) -> dict[str, Any]:
    """Write ``run.toml`` into a folder, and what no other file holds beside it.

    Parameters
    ----------
    folder : path
        Folder, which may be another one until it is complete.
    place : path
        Where it will be, from which relative paths start.
    table : mapping
        What `table_of` returns.

    Returns
    -------
    dict
        Contents of the file.
    """
    import tomli_w  # only who writes needs it

    found = copy.copy(dict(table))
    found["people"] = [dict(entry) for entry in table["people"]]
    # What they were when they were read.
    digests = {path_from(place, entry["path"]): entry["sha256"] for entry in table.get("files", ())}
    # A motion that no file holds is saved beside the run file.
    for number, entry in enumerate(found["people"], start=1):
        if isinstance(motion := entry["motion"], Motion):
            entry["motion"] = f"person-{number}.motion"
            save_motion(folder / entry["motion"], motion)
            digests[entry["motion"]] = digest_of(folder / entry["motion"])
    # Paths become relative to the folder, and each file that was read has its digest.
    found["scene"] = copy.deepcopy(found["scene"])
    for tables in (found, found["scene"]):
        for _, key, entry in files_of(tables):
            path, entry[key] = entry[key], path_from(place, entry[key])
            if entry[key] not in digests and os.path.isabs(path) and os.path.isfile(path):
                digests[entry[key]] = digest_of(path)
    if background := found["settings"].get("background"):
        found["settings"] = {**found["settings"], "background": path_from(place, background)}
        # For a folder the run file counts, because its samples follow from that.
        for path in (background, os.path.join(background, "run.toml")):
            if os.path.isfile(path):
                digests[path_from(place, path)] = digest_of(path)
    files = [{"path": path, "sha256": digest} for path, digest in sorted(digests.items())]
    found |= {"versions": versions()} | ({"files": files} if files else {})
    (folder / "run.toml").write_text(_HEAD + tomli_w.dumps(found), encoding="utf-8")
    return found


def path_from(place: Path, path: str) -> str:
    """Return an absolute path from a folder on, where there is a way."""
    if not os.path.isabs(path):
        return path
    try:
        return Path(os.path.relpath(path, place.absolute())).as_posix()
    except ValueError:  # another drive
        return path


def in_words(table: Table) -> dict[str, Any]:
    """Return the tables of a run, with words for motions that no file holds, and the versions."""
    people = [
        entry | {"motion": f"{motion.name}, in memory"}
        if isinstance(motion := entry["motion"], Motion)
        else entry
        for entry in table["people"]
    ]
    return {**table, "people": people, "versions": versions()}


def refuse_another(out: Path, motions: Iterable[Motion]) -> None:
    """Raise `InputError` where a folder holds a run of other recordings or actors than these.

    Of a run of the same with other settings only the results are replaced.
    """
    try:
        entries = tables_at("people", read_toml(out / "run.toml", "run", ""))
        before = [_who(str(entry.get("motion")), entry, out) for _, entry in entries]
    except InputError:  # there is none, or nobody can tell
        return
    # Who moves tells one run from another.
    now = [
        _who(str(own.source.keys["motion"]), own.source.keys, out) if own.source else own.name
        for own in motions
    ]
    if before != now:
        raise InputError(
            f"'{out}' holds a run of {_names(before)}, and this is one of {_names(now)}; give "
            "another folder, or replace it (--overwrite)"
        )


def _who(motion: str, keys: Table, folder: Path) -> str:
    """An actor with its seed, the path of a recording, or the name of a motion that was kept."""
    if motion.startswith(SYNTHETIC):
        return f"{motion} of seed {keys.get('seed')}"
    path = folder.absolute() / motion
    return load_saved(path).name if KEPT_MOTION.fullmatch(path.name) else os.path.normpath(path)


def _names(who: list[str]) -> str:
    return " and ".join(Path(name).name for name in who) or "nobody"


def read_run_file(path: Path, *, changed: bool = False) -> dict[str, Any]:
    """Read a run file, and compare the files that it names with their digests.

    Parameters
    ----------
    path : path
        Run file.
    changed : bool
        Whether files may have changed.

    Returns
    -------
    dict
        Its tables.

    Raises
    ------
    InputError
        Where it cannot be read, or a file has changed.
    """
    table = read_toml(path, "run", "give a run file, such as the run.toml of a folder")
    check_files(f"run file '{path}'", path.parent, table, changed=changed)
    return dict(table)


def check_files(told: str, folder: Path, table: Table, *, changed: bool = False) -> set[Path]:
    """Compare the files that a table lists with their digests.

    Parameters
    ----------
    told : str
        Name of the table in errors.
    folder : path
        Folder that paths start from.
    table : mapping
        Table whose list ``files`` has the ``path`` and the ``sha256`` of each.
    changed : bool
        Whether files may be missing or have changed.

    Returns
    -------
    set of Path
        The files.

    Raises
    ------
    InputError
        Where an entry has no meaning, or a file is missing or has changed.
    """
    found = set()
    for where, entry in tables_at("files", table, most=MOST_FILES):
        check_keys(f"{told}: {where}", entry, ("path", "sha256"), ())
        text = read_value(str, f"{told}: {where}", "path", entry["path"])
        found.add((folder / text).resolve())
        if changed:
            continue
        cure = "give the one that it was, or go on with this one (--changed)"
        try:
            digest = digest_of(folder / text)
        except OSError as error:
            raise InputError(f"{told}: {brief(text)}: {error.strerror}; {cure}") from None
        if digest != entry["sha256"]:
            raise InputError(f"{told}: {brief(text)} has changed since; {cure}")
    return found


# -- tables of a run ------------------------------------------------------------------------------

Plain = dict[str, Any]

KEPT_MOTION = re.compile(r"person-\d+\.motion")
"""Name of the file of a motion that no other file holds."""


def table_of(people: Sequence[Person], radar: Radar, scene: Scene, settings: RunSettings) -> Plain:
    """Describe a run, which gives the same again.

    Parameters
    ----------
    people : sequence of Person
        Everyone in the scene, those of the scene too.
    radar : Radar
        Radar.
    scene : Scene
        Scene, whose people are left out.
    settings : RunSettings
        Settings.

    Returns
    -------
    dict
        Tables ``people``, ``radar``, ``scene`` and ``settings`` with absolute paths, and the
        ``files`` that motions were read from. The motion of a person that no file holds is a
        `Motion`.
    """
    missing: list[str] = []
    found = {
        "people": [_person(person) for person in people],
        "radar": plain(radar),
        "scene": _scene(scene, missing),
        "settings": _settings(settings),
    }
    # Digests from when the motions were read: a file may have changed since.
    sources = [source for person in people if (source := person.motion.source) is not None]
    digests = {path: digest for source in sources for path, digest in source.files.items()}
    files = [{"path": path, "sha256": digest} for path, digest in digests.items()]
    found |= {"files": files} if files else {}
    return {"missing": missing, **found} if missing else found


def _settings(settings: RunSettings) -> Plain:
    found: Plain = plain(settings)
    # TOML has no word for nothing, which here is not what is left out.
    return found | ({"path_tolerance_db": -math.inf} if settings.path_tolerance_db is None else {})


def plain(value: Any) -> Any:
    """Return a dataclass as a table, without what is None, and its arrays and tuples as lists."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        given = ((field.name, getattr(value, field.name)) for field in dataclasses.fields(value))
        return {name: plain(own) for name, own in given if own is not None}
    if isinstance(value, dict):
        return {str(name): plain(own) for name, own in value.items() if own is not None}
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(own) for own in value]
    # A count that follows another field is a kind of int, which TOML does not know.
    return next((kind(value) for kind in (bool, int, float, str) if isinstance(value, kind)), value)


def _person(person: Person) -> Plain:
    source = person.motion.source
    # What was kept beside another run is kept beside this one, too.
    lost = source is None or KEPT_MOTION.fullmatch(Path(source.keys["motion"]).name)
    made = {"motion": person.motion} if source is None or lost else copy.deepcopy(dict(source.keys))
    rest = (field for field in dataclasses.fields(person) if field.name != "motion")
    own = {field.name: plain(getattr(person, field.name)) for field in rest}
    return made | {name: value for name, value in own.items() if value is not None}


def _scene(scene: Scene, missing: list[str]) -> Plain:
    if scene.source is not None:
        found = copy.deepcopy(dict(scene.source))
        # People and radar have tables of their own, with their places.
        return {key: value for key, value in found.items() if key not in ("people", "radar")}
    # A scene that was made in Python is described piece by piece; what has no form in a file is
    # noted as missing.
    person = {"position_m": plain(scene.person_position_m), "heading_deg": scene.heading_deg}
    found = {"name": scene.name, "description": scene.description, "person": person}
    materials: Plain = {}
    for key in ("walls", "furniture", "objects"):
        pieces = []
        for piece in getattr(scene, key):
            own = plain({field.name: getattr(piece, field.name) for field in _fields(piece)})
            own["material"] = _material(piece.material, materials, missing)
            if isinstance(piece, Furniture):
                own |= _shape(piece, missing)
            if isinstance(piece, Object) and piece.motion is not None:
                own["motion"] = {"kind": kind_of(piece.motion), **plain(piece.motion)}
                if own["motion"]["kind"] is None:
                    missing.append(f"the motion of object '{piece.name}'")
            pieces.append(own)
        found |= {key: pieces} if pieces else {}
    return found | ({"materials": materials} if materials else {})


def _fields(piece: Any) -> list[dataclasses.Field[Any]]:
    apart = ("material", "mesh", "motion")
    return [field for field in dataclasses.fields(piece) if field.name not in apart]


def _shape(piece: Furniture, missing: list[str]) -> Plain:
    if isinstance(piece.mesh, tuple | list):
        return {"box": plain(piece.mesh)}
    if piece.in_memory:
        missing.append(f"the mesh of '{piece.name}', which was made in Python")
        return {"mesh": "in memory"}
    built_in = isinstance(piece.mesh, str) and piece.metres_per_unit is None
    return {"mesh": piece.mesh if built_in else str(piece.path.absolute())}


def _material(material: Material, materials: Plain, missing: list[str]) -> str:
    if MATERIALS.get(material.name) != material:
        (law, *others) = material.bands
        if others or not isinstance(law, PowerLaw):
            missing.append(f"material '{material.name}', which was made in Python")
        else:
            materials[material.name] = {"source": material.source, **plain(law)}
    return material.name
