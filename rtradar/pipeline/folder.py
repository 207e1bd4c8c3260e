"""An output folder that gets all the files of a run, or none."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rtradar.errors import InputError


@contextmanager
def all_or_nothing(out: Path) -> Iterator[Path]:
    """A folder to write into; at the end what is in it moves to ``out``, replacing what has the same name.

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
        work = Path(tempfile.mkdtemp(prefix=".rtradar-", dir=out))
    except OSError as error:
        raise InputError(f"cannot write to '{out}': {error.strerror}; give a folder that can be written (--out)") from None
    try:
        yield work
        for item in sorted(work.iterdir()):
            place = out / item.name
            if place.is_dir() and not place.is_symlink():
                # A folder cannot be replaced in one step: the old one steps aside first.
                os.replace(place, work / f".old-{item.name}")
            os.replace(item, place)
        shutil.rmtree(work)
    except BaseException:
        shutil.rmtree(work, ignore_errors=True)
        for folder in made:
            if folder.is_dir() and not any(folder.iterdir()):
                folder.rmdir()
        raise
