"""An output folder that gets all the files of a run, or none."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rtradar.errors import InputError
from rtradar.files import not_to_be_parted, unfinished

_PREFIX = ".rtradar-"


@contextmanager
def all_or_nothing(out: Path) -> Iterator[Path]:
    """A folder to write into; at the end what is in it moves to ``out``, replacing what has the same name.

    What a run that was killed left there is removed first.

    Parameters
    ----------
    out : path
        Made if it is not there; other files in it are left alone.

    Yields
    ------
    path
        A folder inside ``out``. After an error it is removed with all in it, and ``out`` too where it was made here.

    Raises
    ------
    InputError
        Where ``out`` cannot be made or written.
    """
    made = [folder for folder in (out, *out.parents) if not folder.exists()]
    try:
        out.mkdir(parents=True, exist_ok=True)
        _sweep(out)
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
                for item in sorted(work.iterdir()):
                    place = out / item.name
                    if place.is_dir() and not place.is_symlink():
                        # A folder cannot be replaced in one step: the old one steps aside first.
                        os.replace(place, work / f".old-{item.name}")
                    os.replace(item, place)
            shutil.rmtree(work)
        except BaseException:
            give_up()
            raise
        finally:
            _let_go(lock)


def _own_folder(out: Path) -> tuple[Path, int | None]:
    """A new folder in ``out``, and the lock that says that its run still lives."""
    while True:
        work = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=out))
        lock = _lock(work)
        if work.exists():  # another run may have swept it before it was locked
            return work, lock
        _let_go(lock)


def _sweep(out: Path) -> None:
    """Remove the folders of runs into ``out`` that were killed: the system took their locks back."""
    for folder in out.glob(f"{_PREFIX}*") if sys.platform != "win32" else ():
        with suppress(OSError):  # it is held, or gone
            lock = _lock(folder)
            shutil.rmtree(folder, ignore_errors=True)
            _let_go(lock)


def _lock(folder: Path) -> int | None:
    """Lock a folder until `_let_go`, or the end of the process; BlockingIOError where another has it. Not on Windows."""
    if sys.platform == "win32":
        return None
    import fcntl

    place = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(place)
        raise
    return place


def _let_go(lock: int | None) -> None:
    if lock is not None:
        os.close(lock)
