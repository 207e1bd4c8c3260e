"""The run file: what was simulated, from which files, by which version."""

from __future__ import annotations

import copy
import os
import platform
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rtradar.description.tables import KEPT_MOTION
from rtradar.errors import InputError
from rtradar.motion import Motion
from rtradar.motion.formats import load_saved, save_motion
from rtradar.motion.synthetic import ACTORS
from rtradar.recordings import SYNTHETIC
from rtradar.scene.tables import files_of
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
    for number, entry in enumerate(found["people"], start=1):
        if isinstance(motion := entry["motion"], Motion):
            entry["motion"] = f"person-{number}.motion"
            save_motion(folder / entry["motion"], motion)
            digests[entry["motion"]] = digest_of(folder / entry["motion"])
    found["scene"] = copy.deepcopy(found["scene"])
    for tables in (found, found["scene"]):
        for _, key, entry in files_of(tables):
            path, entry[key] = entry[key], path_from(place, entry[key])
            if entry[key] not in digests and os.path.isabs(path) and os.path.isfile(path):
                digests[entry[key]] = digest_of(path)
    if background := found["settings"].get("background"):
        found["settings"] = {**found["settings"], "background": path_from(place, background)}
        # Of a folder what it was made from, for its samples follow from that.
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
