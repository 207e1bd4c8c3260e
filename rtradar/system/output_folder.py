"""Output folders: all files of a command appear together or none does, and others stay untouched.

A command writes into a work folder inside the output folder, and moves its files when all of them
are there. What an output folder already holds may be anybody's. So a file is replaced or removed
only if it is a regular file, has a name that this command gives to its files, and is in the list
that an earlier command left in the folder (``files`` in ``summary.json``). A folder that holds
anything else of such a name is refused.

A process that is killed while it moves its files leaves a list that says ``unfinished``: readers of
the folder refuse it, and the next command that writes there replaces what the list names. A process
that is killed earlier leaves its work folder, which the next command that writes there removes.
Commands that only read change nothing.
"""

from __future__ import annotations

import json
import os
import re
import secrets
import stat
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from rtradar.errors import InputError
from rtradar.system.directory import Directory
from rtradar.system.files import DISK_ERRORS, cleanup_on_exit, uninterruptible

_PREFIX, _NEW_PREFIX = ".rtradar-", ".rtradar-new-"  # of work folders, and those of `new_folder`
_DIGITS = r"[0-9a-f]{16}"
_MARKER = ".made-by-rtradar"
_UNFINISHED = ".unfinished"
_MOST_LIST_BYTES = 100_000_000
_STORE = re.compile(r"(.*\.zarr/)")


@dataclass(frozen=True)
class OutputFiles:
    """Files that a command may leave in its output folder.

    Parameters
    ----------
    listing : str
        JSON file, one of the files, whose entry ``files`` lists their relative names; an entry that
        ends with a slash means all files of a store.
    files : str
        Regular expression of the whole relative name of each file, with ``/`` between its parts.
    folders : str
        Regular expression of the whole relative name of each folder that may hold such files.
    """

    listing: str
    files: str
    folders: str = r"(?!)"

    def is_file(self, name: str) -> bool:
        """Tell whether a file of the command may have this relative name."""
        return re.fullmatch(self.files, name) is not None

    def is_folder(self, name: str) -> bool:
        """Tell whether a folder of the command may have this relative name."""
        return re.fullmatch(self.folders, name) is not None

    def list_of(self, folder: Path) -> list[str]:
        """Return the entry ``files`` of a folder that holds all files but, perhaps, the listing."""
        with Directory.at(folder) as directory:
            return _entries([self.listing, *_all_files(directory)])


@contextmanager
def atomic_folder(out: Path, kind: OutputFiles, *, overwrite: bool = False) -> Iterator[Path]:
    """Make a folder to write into; at the end its files move to ``out``, all of them or none.

    Parameters
    ----------
    out : path
        Output folder, which is made if it does not exist. Files of an earlier command of this kind
        are replaced or removed; all others stay as they are.
    kind : OutputFiles
        Files of the command. The listing must be written into the folder, with
        `OutputFiles.list_of` as its entry ``files``.
    overwrite : bool
        Whether files under names of this command's files are replaced though no list names them.

    Yields
    ------
    path
        Folder inside ``out``. After an error it is removed, and ``out`` too if it was made here.

    Raises
    ------
    InputError
        If ``out`` cannot be written, holds files of others or is moved, or the disk is full.
    """
    with ExitStack() as stack:
        try:
            # Folders that are made here go again after an error; files of others under names of
            # ours are refused before the work.
            made = [folder for folder in (out, *out.parents) if not folder.exists()]
            out.mkdir(parents=True, exist_ok=True)
            place = stack.enter_context(Directory.at(out))
            _refuse_foreign(place, kind, overwrite)
            _remove_leftovers(place, but=_read_list(place, kind)[1])
            work = stack.enter_context(_new_work_folder(place))
        except OSError as error:
            raise _no_folder(out, error) from None

        moving = False

        def abandon() -> None:
            if moving:
                return  # what is moved and what is not belong together
            # The work folder goes, and folders that were made for it if nothing else is in them.
            _discard(place, work)
            for folder in made if place.is_in_place() else ():
                with suppress(OSError):
                    folder.rmdir()  # an empty one only

        with cleanup_on_exit(abandon):
            try:
                yield work.path
                with uninterruptible():
                    _check_made(work, kind)
                    place.lock(wait=True)  # against others who move files there
                    _refuse_foreign(place, kind, overwrite)
                    moving = True
                    _move(work, place, kind)
                    place.remove_tree(work.path.name)
                    # Files that a killed command had still to move are replaced now.
                    _remove_leftovers(place)
            except BaseException as error:
                # Once files have begun to move nothing can be undone: the user is told where the
                # rest is.
                if moving and isinstance(error, OSError):
                    raise InputError(
                        f"cannot move the files of '{work.path}' into '{out}': {error.strerror}; "
                        "mend that and run it again into that folder, or move what is left by hand"
                    ) from None
                if moving:
                    raise
                moved_away = not work.is_in_place()
                abandon()
                if moved_away and isinstance(error, Exception):
                    raise InputError(
                        f"'{out}' was renamed, moved or removed while the command wrote into it; "
                        "give a folder that stays (--out)"
                    ) from None
                if isinstance(error, OSError) and error.errno in DISK_ERRORS:
                    raise InputError(
                        f"cannot write to '{out}': {error.strerror}; "
                        "make room, or give another folder (--out)"
                    ) from None
                raise


@contextmanager
def new_folder(out: Path) -> Iterator[Path]:
    """Make a folder that takes the name ``out`` at the end, if nothing has it, or is removed.

    It yields a folder beside ``out`` to write into. InputError is raised if the name is taken, or
    the disk takes no more. What killed commands of this kind left there is removed first.
    """
    with ExitStack() as stack:
        try:
            place = stack.enter_context(Directory.at(out.parent))
            _remove_leftovers(place, prefix=_NEW_PREFIX)
            work = stack.enter_context(_new_work_folder(place, _NEW_PREFIX))
            # At the end, or if a signal ends the process, whatever is left of the work folder goes.
            stack.callback(_discard, place, work)
            stack.enter_context(cleanup_on_exit(lambda: _discard(place, work)))
            made = work.path / "made"
            made.mkdir()
            yield made
            with uninterruptible():
                if place.mode(out.name):
                    raise InputError(f"'{out}' was made meanwhile; give another name (--out)")
                work.move(made.name, place, out.name)
        except OSError as error:
            raise InputError(
                f"cannot write '{out}': {error.strerror}; make room, or give another name (--out)"
            ) from None


@contextmanager
def exclusive_lock(folder: Path) -> Iterator[Directory]:
    """Make or open a folder and lock it; InputError if another process has it, or it cannot be."""
    with ExitStack() as stack:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            place = stack.enter_context(Directory.at(folder))
        except OSError as error:
            raise _no_folder(folder, error) from None
        if not place.lock():
            raise InputError(
                f"another command writes into '{folder}'; "
                "wait for its end, or give another folder (--out)"
            )
        yield place


@contextmanager
def resumable_folder(out: Path, kind: OutputFiles, *, overwrite: bool = False) -> Iterator[None]:
    """Make or open a folder that a command fills file by file, and lock it meanwhile.

    The command writes its listing first, with all files that it will make, so that it goes on after
    it was killed. InputError if the folder cannot be written, another command has it, or it holds
    files under names of this command's files that the listing there does not name, unless
    ``overwrite`` allows that they are replaced.
    """
    with exclusive_lock(out) as place:
        _refuse_foreign(place, kind, overwrite)
        yield


def _no_folder(folder: Path, error: OSError) -> InputError:
    return InputError(
        f"cannot write to '{folder}': {error.strerror}; give a folder that can be written (--out)"
    )


def check_whole(folder: Path, listing: str = "summary.json") -> None:
    """Raise InputError if the list of a folder says that a killed run left files of two runs."""
    try:
        with Directory.at(folder) as place:
            content = _read_json(place, listing)
    except OSError:
        return
    if isinstance(content, dict) and isinstance(rest := content.get("unfinished"), str):
        raise InputError(
            f"'{folder}' holds files of two runs, for the second was killed as it moved its files "
            f"there; run it again into that folder, or move what is left in '{rest[:40]}' by hand"
        )


# -- what a folder holds ---------------------------------------------------------------------------


def _existing(directory: Directory, kind: OutputFiles, prefix: str = "") -> dict[str, int]:
    """Return the mode of each entry under a name of the command's files and folders."""
    found: dict[str, int] = {}
    names = directory.names()
    # Only names that this command gives to its files are looked at; all others are not its
    # business.
    for name in sorted(names):
        path, own = prefix + name, name.lower()
        if kind.is_file(path) or kind.is_folder(path):
            mode = directory.mode(name)
            if kind.is_folder(path) and stat.S_ISDIR(mode):
                with directory.open(name) as inner:
                    found |= _existing(inner, kind, f"{path}/")
            elif mode:
                found[path] = mode
        elif kind.is_file(prefix + own) and own not in names and directory.mode(own):
            # The same file to a file system that ignores case.
            found[path] = directory.mode(name)
    return found


def _all_files(directory: Directory, prefix: str = "") -> Iterator[str]:
    """Yield the relative names of all files of a work folder, but its marker and its list."""
    for name in sorted(directory.names()):
        if stat.S_ISDIR(directory.mode(name)):
            with directory.open(name) as inner:
                yield from _all_files(inner, f"{prefix}{name}/")
        elif prefix or name not in (_MARKER, _UNFINISHED):
            yield prefix + name


def _entries(names: Iterable[str]) -> list[str]:
    """Return the names for a list: of a store of thousands of files, its folder alone."""
    return sorted({store[1] if (store := _STORE.match(name)) else name for name in names})


def _read_list(directory: Directory, kind: OutputFiles) -> tuple[frozenset[str], object]:
    """Return ``files`` and ``unfinished`` of the list of a folder, if there is one."""
    content = _read_json(directory, kind.listing)
    files = content.get("files") if isinstance(content, dict) else None
    if not isinstance(files, list) or kind.listing not in files:
        return frozenset(), None
    names = frozenset(name for name in files if isinstance(name, str))
    return names, content.get("unfinished")


def _read_json(directory: Directory, name: str) -> Any:
    """Return the content of a regular JSON file of bounded size; None for anything else."""
    with suppress(OSError, ValueError, RecursionError), directory.open_file(name) as file:
        return json.loads(file.read(_MOST_LIST_BYTES))
    return None


def _held(place: Directory, kind: OutputFiles) -> tuple[dict[str, int], set[str]]:
    """Return what `_existing` does, and the names among it that the command may replace.

    It may replace the regular files that the list names.
    """
    found, (listed, _) = _existing(place, kind), _read_list(place, kind)
    stores = tuple(name for name in listed if name.endswith("/"))
    files = [name for name, mode in found.items() if stat.S_ISREG(mode)]
    in_stores = {name for name in files if name.startswith(stores) and _STORE.match(name)}
    return found, in_stores | listed.intersection(files)


def _refuse_foreign(place: Directory, kind: OutputFiles, overwrite: bool) -> None:
    found, owned = _held(place, kind)
    foreign = sorted(found.keys() - owned)
    # Even with `overwrite` only files and links are replaced, never folders or devices.
    odd = [
        name
        for name in foreign
        if kind.is_folder(name) or not (stat.S_ISREG(found[name]) or stat.S_ISLNK(found[name]))
    ]
    if overwrite and odd:
        is_not = "no folder" if kind.is_folder(odd[0]) else "no file"
        raise InputError(
            f"'{place.path}' holds '{odd[0]}', which is {is_not}; "
            "move it away, or give another folder (--out)"
        )
    if foreign and not overwrite:
        more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        raise InputError(
            f"'{place.path}' holds '{foreign[0]}'{more}, which its {kind.listing} does not list "
            "as made by rtradar; give another folder (--out), or replace what has the names of new "
            "files (--overwrite)"
        )


def _check_made(work: Directory, kind: OutputFiles) -> None:
    """Raise if a file is not foreseen: the next command would take it for somebody else's."""
    made = list(_all_files(work))
    unforeseen = [name for name in made if not kind.is_file(name)]
    if unforeseen or kind.listing not in made:
        raise AssertionError(
            f"{[*unforeseen, kind.listing][0]}: not foreseen, or a listing that was not written"
        )


# -- moving ----------------------------------------------------------------------------------------


def _move(work: Directory, place: Directory, kind: OutputFiles) -> None:
    """Move all files to their place; the list comes last, and says ``unfinished`` until then."""
    # From here on the folder says that it is unfinished, with the names of old and new files.
    made, owned = list(_all_files(work)), _held(place, kind)[1]
    said = {"unfinished": work.path.name, "files": _entries({kind.listing, *owned, *made})}
    with work.open_file(_UNFINISHED, write=True) as file:
        file.write((json.dumps(said, indent=1) + "\n").encode())
    work.move(_UNFINISHED, place, kind.listing)
    # Old files that have no successor go, then new ones come, then folders that are empty now go.
    for name in sorted(owned - {*made, kind.listing}):
        with place.parent_of(name) as folder:
            folder.remove(name.rpartition("/")[2])
    for name in made:
        if name != kind.listing:
            with work.parent_of(name) as source, place.parent_of(name, make=True) as target:
                own = name.rpartition("/")[2]
                source.move(own, target, own)
    above = {str(path) for name in owned for path in PurePosixPath(name).parents} - {"."}
    for name in sorted(above, reverse=True):
        with suppress(OSError), place.parent_of(name) as folder:
            folder.remove_folder(name.rpartition("/")[2])  # an empty one only
    work.move(kind.listing, place, kind.listing)


def _new_work_folder(place: Directory, prefix: str = _PREFIX) -> Directory:
    """Make a work folder, locked as long as its command lives, with a marker of its owner."""
    name = f"{prefix}{secrets.token_hex(8)}"
    place.make(name)
    work = place.open(name)
    work.lock()
    with work.open_file(_MARKER, write=True) as file:
        file.write(str(work.status().st_ino).encode())
    return work


def _discard(place: Directory, work: Directory) -> None:
    gone = f"{work.path.name}-gone"
    with suppress(OSError):
        # So that no thread that still writes finds the way into it.
        place.move(work.path.name, place, gone)
    place.remove_tree(gone)


def _remove_leftovers(place: Directory, but: object = None, *, prefix: str = _PREFIX) -> None:
    """Remove work folders of killed commands: those whose marker holds their own inode number.

    A folder that came from elsewhere, or that the user made, has no such marker, and stays.
    """
    if sys.platform == "win32":  # no locks, and no numbers that tell
        return
    for name in place.names():
        if not re.fullmatch(re.escape(prefix) + _DIGITS, name) or name == but:
            continue
        # Ours, of this user, and of a command that lives no more: a living one holds the lock.
        with suppress(OSError), place.open(name) as folder:
            status = folder.status()
            with folder.open_file(_MARKER) as file:
                is_marked = file.read(100) == str(status.st_ino).encode()
            if status.st_uid == os.geteuid() and is_marked and folder.lock():
                place.remove_tree(name)


def one_of(names: Sequence[str]) -> str:
    """Return a regular expression that matches any of these names."""
    return "|".join(re.escape(name) for name in names)
