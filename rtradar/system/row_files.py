"""Long arrays that come row by row, kept in an unnamed file so that memory does not grow with them.

The file is mapped and looks like any other read-only array. Pages that were read count as memory of
this process until they are released, which costs nothing: the system keeps them as long as nobody
needs the room.

Where the folder for temporary files is in memory itself, as ``/tmp`` is on some systems, so are the
files: the environment variable TMPDIR names another folder.
"""

from __future__ import annotations

import errno
import mmap
import tempfile
import weakref
from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError

_MOST_IN_MEMORY = 1_000_000
"""Bytes: about 10 s of a recording at 120 Hz."""

_MOST_FILES = 64
"""At once, because a process may open only so many (256 on macOS); arrays beyond stay in memory."""

_ROWS_AT_ONCE = 1024

_mapped: weakref.WeakSet[mmap.mmap] = weakref.WeakSet()


class FileBackedRows:
    """Collects rows of float64 and returns them as one array."""

    def __init__(self) -> None:
        self._waiting: list[NDArray[np.float64]] = []
        self._bytes = 0
        self._file: IO[bytes] | None = None

    def append(self, rows: NDArray[np.float64]) -> None:
        """Add rows (row, ...), which are not copied while they are few.

        Raises
        ------
        InputError
            Where the folder for temporary files has no room for them.
        """
        # Few rows stay in memory; many go into a file, as long as there may be one more.
        self._waiting.append(np.ascontiguousarray(rows, dtype=np.float64))
        self._bytes += rows.size * 8
        if self._bytes <= _MOST_IN_MEMORY or (self._file is None and len(_mapped) >= _MOST_FILES):
            return
        try:
            if self._file is None:
                # It is closed below, or when nobody wants the rows any more.
                self._file = tempfile.TemporaryFile()  # noqa: SIM115
                weakref.finalize(self, _close, self._file)
            for waiting in self._waiting:
                self._file.write(waiting.data)
            self._file.flush()
        except OSError as error:
            if self._file is None and error.errno in (errno.EMFILE, errno.ENFILE):
                return  # others have all the files that there may be
            raise InputError(
                f"a long recording, {self._bytes / 1e6:.0f} MB so far, finds no room in "
                f"{tempfile.tempdir or 'any folder'} for temporary files ({error.strerror}); "
                "let the environment variable TMPDIR name one that has some"
            ) from None
        # It keeps the shape of a row, and none of the memory.
        self._waiting = [np.empty((0, *rows.shape[1:]))]

    def rows(self) -> NDArray[np.float64]:
        """Return all rows, at least one block of them; can be called once."""
        if self._file is None:
            return self._waiting[0] if len(self._waiting) == 1 else np.concatenate(self._waiting)
        try:
            # The file is mapped and closed: it goes when nobody holds the array any more.
            mapping = mmap.mmap(self._file.fileno(), 0, access=mmap.ACCESS_READ)
            _mapped.add(mapping)
            flat = np.frombuffer(mapping, dtype=np.float64)
        except OSError:  # no file more, or no addresses: then in memory
            self._file.seek(0)
            flat = np.frombuffer(self._file.read(), dtype=np.float64)
        self._file.close()
        return flat.reshape(-1, *self._waiting[0].shape[1:])


def _close(file: IO[bytes]) -> None:
    with suppress(OSError):  # on a full disk, which was reported already
        file.close()


def file_backed(blocks: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return blocks of rows as one array, (row, ...)."""
    rows = FileBackedRows()
    for block in blocks:
        rows.append(block)
    return rows.rows()


def in_blocks(*arrays: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.float64], ...]]:
    """Yield blocks of rows of arrays of one length; their pages are released after use."""
    for first in range(0, len(arrays[0]), _ROWS_AT_ONCE):
        yield tuple(array[first : first + _ROWS_AT_ONCE] for array in arrays)
        release_pages(*arrays)


def column(array: NDArray[np.float64], number: int | list[int]) -> NDArray[np.float64]:
    """Return a copy of ``array[:, number]`` in memory."""
    return np.concatenate([rows[:, number].copy() for (rows,) in in_blocks(array)])


def release_pages(*arrays: NDArray[np.float64]) -> None:
    """Release the pages of arrays that are kept in a file; others stay as they are."""
    for array in arrays:
        # The mapping is at the bottom of all views of an array.
        owner: Any = array
        while isinstance(owner, np.ndarray):
            owner = owner.base
        if (
            isinstance(owner, memoryview)
            and isinstance(owner.obj, mmap.mmap)
            and hasattr(mmap, "MADV_DONTNEED")
        ):
            owner.obj.madvise(mmap.MADV_DONTNEED)
