"""An output folder that gets all the files of a run, or none.

They are written in a folder of their own inside it, and moved when all are there. Not even a process that is killed can part
what belongs together for long: from the first move on the name of that folder says that it is whole, and whoever comes next to
the output folder, to write or to read, goes on with the moves. What is not whole is removed.
"""

from __future__ import annotations

import errno
import json
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rtradar.errors import InputError
from rtradar.files import not_to_be_parted, unfinished

_PREFIX = ".rtradar-"
_WHOLE = f"{_PREFIX}whole-"
_ASIDE = ".old-"
_TO_GO = ".to-go.json"

_OF_DISK = {getattr(errno, name, None) for name in ("ENOSPC", "EDQUOT", "EFBIG", "EIO", "EROFS")} - {None}
_HDF5_ERRNO = re.compile(r"\berrno = (\d+)")


@contextmanager
def all_or_nothing(out: Path, pictures: tuple[str, ...] = ()) -> Iterator[Path]:
    """A folder to write into; at the end what is in it moves to ``out``, replacing what has the same name.

    What a run that was killed left there is settled first.

    Parameters
    ----------
    out : path
        Made if it is not there; other files in it are left alone.
    pictures : tuple of str
        Names, or patterns of names, of files that not every run makes: those of an earlier run go, for they would be taken for
        this one's.

    Yields
    ------
    path
        A folder inside ``out``. After an error it is removed with all in it, and ``out`` too where it was made here.

    Raises
    ------
    InputError
        Where ``out`` cannot be made or written, or the disk is full.
    """
    try:
        made = [folder for folder in (out, *out.parents) if not folder.exists()]
        out.mkdir(parents=True, exist_ok=True)
        settle(out)
        work, lock = _own_folder(out)
    except OSError as error:
        raise InputError(f"cannot write to '{out}': {error.strerror}; give a folder that can be written (--out)") from None

    def give_up() -> None:
        gone = work.with_name(f"{work.name}-gone")
        with suppress(OSError):
            work.rename(gone)  # nobody who still writes finds the way into it
        shutil.rmtree(gone, ignore_errors=True)
        for folder in made:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()

    with unfinished(give_up):
        try:
            yield work
            with not_to_be_parted():
                if pictures:
                    own = [item.name for item in work.iterdir()]
                    (work / _TO_GO).write_text(json.dumps({"pictures": pictures, "but": own}), encoding="utf-8")
                whole = work.with_name(work.name.replace(_PREFIX, _WHOLE, 1))
                try:
                    work.rename(whole)
                    _move(whole, out)
                    whole.rename(work)  # what is left in it is of no use
                except OSError as error:
                    raise InputError(
                        f"cannot put the files of '{whole}' into '{out}': {error.strerror}; mend that: the next rtradar command "
                        "that uses the folder goes on with it"
                    ) from None
            shutil.rmtree(work)
        except BaseException as error:
            give_up()
            if why := _trouble_of_disk(error):
                raise InputError(f"cannot write to '{out}': {why}; make room, or give another folder (--out)") from None
            raise
        finally:
            _let_go(lock)


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """While this lasts no other process of this machine does the same in the folder; after the end of a process it may.

    Parameters
    ----------
    folder : path
        One that is there.

    Raises
    ------
    InputError
        Where another is in it.
    """
    try:
        lock = _lock(folder)
    except BlockingIOError:
        raise InputError(f"another command writes into '{folder}'; wait for its end, or give another folder (--out)") from None
    except OSError as error:
        raise InputError(f"cannot write to '{folder}': {error.strerror}; give a folder that can be written (--out)") from None
    try:
        yield
    finally:
        _let_go(lock)


def _trouble_of_disk(error: BaseException) -> str:
    """What the disk has against more files, in few words; empty where something else went wrong."""
    number = error.errno if isinstance(error, OSError) else None
    if number is None and isinstance(error, OSError | RuntimeError) and (told := _HDF5_ERRNO.search(str(error))):
        number = int(told[1])
    return os.strerror(number) if number is not None and number in _OF_DISK else ""


def _own_folder(out: Path) -> tuple[Path, int | None]:
    """A new folder in ``out``, and the lock that says that its run still lives."""
    while True:
        work = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=out))
        # Another run may sweep it before it is locked.
        with suppress(BlockingIOError, FileNotFoundError):
            lock = _lock(work)
            if work.exists():
                return work, lock
            _let_go(lock)


def settle(out: Path) -> None:
    """End what runs into ``out`` that were killed had begun: the system took their locks back.

    Files of one that was moving them take their places; folders of others are removed. To be called before such a folder is
    read. Nothing is done where ``out`` is not there, or while a run still writes into it.

    Parameters
    ----------
    out : path

    Raises
    ------
    InputError
        Where the files cannot be moved.
    """
    for folder in out.glob(f"{_PREFIX}*") if sys.platform != "win32" else ():
        whole = folder.name.startswith(_WHOLE)
        try:
            lock = _lock(folder)
        except (BlockingIOError, FileNotFoundError):  # its run still lives, or another command was first
            continue
        except OSError as error:
            if whole:
                raise _parted(folder, error) from None
            continue
        try:
            if whole and folder.exists():
                _move(folder, out)
        except OSError as error:
            raise _parted(folder, error) from None
        else:
            shutil.rmtree(folder, ignore_errors=True)
        finally:
            _let_go(lock)


def _parted(folder: Path, error: OSError) -> InputError:
    return InputError(
        f"'{folder.parent}' holds files of two runs, for the second was killed as it put them there; the rest in '{folder.name}' "
        f"cannot be moved: {error.strerror}; run this once as somebody who may write there"
    )


def _move(work: Path, out: Path) -> None:
    """Everything in ``work`` to its place; may be begun again at any point."""
    # Of two runs that end at once in one folder, one waits: what lies there is of one run.
    alone = _lock(out, wait=True)
    try:
        if (work / _TO_GO).exists():
            told = json.loads((work / _TO_GO).read_text(encoding="utf-8"))
            for old in sorted({old for pattern in told["pictures"] for old in out.glob(pattern) if old.name not in told["but"]}):
                os.replace(old, work / f"{_ASIDE}{old.name}")
        for item in sorted(work.iterdir()):
            if item.name.startswith(_ASIDE) or item.name == _TO_GO:
                continue
            place = out / item.name
            if item.is_dir() or (place.is_dir() and not place.is_symlink()):
                # A folder is not replaced, and replaces nothing, in one step: the old one steps aside first.
                with suppress(FileNotFoundError):
                    os.replace(place, work / f"{_ASIDE}{item.name}")
            os.replace(item, place)
    finally:
        _let_go(alone)


def _lock(folder: Path, *, wait: bool = False) -> int | None:
    """Lock a folder until `_let_go`, or the end of the process; BlockingIOError where another has it. Not on Windows."""
    if sys.platform == "win32":
        return None
    import fcntl

    place = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(place, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        os.close(place)
        raise
    return place


def _let_go(lock: int | None) -> None:
    if lock is not None:
        os.close(lock)
