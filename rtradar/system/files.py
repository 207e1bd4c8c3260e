"""Files that are written whole or not at all, and readers of files that may be anybody's."""

from __future__ import annotations

import csv
import errno
import hashlib
import io
import json
import math
import os
import re
import shutil
import stat
import sys
import tempfile
import threading
import zipfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal, TextIO

from rtradar.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_MOST_JSON_BYTES = 100_000_000
_TOKEN_BYTES = 6
_OTHER_KINDS = {
    stat.S_IFDIR: "a directory",
    stat.S_IFIFO: "a pipe (FIFO)",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}

_FORMULA = re.compile(r"[=@\t\r]|[+-](?![\d.]+$)")  # its beginning, and of no number
_PATIENCE_S = 1.0  # at the end of the process, for a file that is just taking its name

DISK_ERRORS = frozenset(
    getattr(errno, name)
    for name in ("ENOSPC", "EDQUOT", "EFBIG", "EIO", "EROFS")
    if hasattr(errno, name)
)
"""Error numbers of a disk that takes no more."""

_lock = threading.RLock()
_unfinished: list[Callable[[], object]] = []


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a binary file that gets its name, or replaces one of it, only if no error occurs.

    It yields a file for writing and reading, in the same folder under another name. InputError is
    raised if the folder cannot be written, or something other than a file has the name.
    """
    target = Path(path)
    with suppress(OSError):
        if not stat.S_ISREG(target.stat().st_mode):
            raise InputError(
                f"cannot write '{target}': what has that name is no file; give another path"
            )
    # Not by the process alone: on a shared disk another machine may write the same file.
    beside = target.with_name(f".{target.name}.{os.urandom(_TOKEN_BYTES).hex()}.part")
    # The file grows under a name of its own and takes its place in one step; whatever fails, the
    # part is removed.
    with cleanup_on_exit(lambda: beside.unlink(missing_ok=True)):
        try:
            file = open(beside, "w+b")  # noqa: SIM115 - closed below, before the file is moved
        except OSError as error:
            raise InputError(
                f"cannot write '{target}': {error.strerror}; "
                "give a folder that exists and can be written"
            ) from None
        try:
            with file:
                yield file
            with uninterruptible():
                os.replace(beside, target)
        except OSError as error:
            raise InputError(
                f"cannot write '{target}': {error.strerror}; give another path or make room"
            ) from error
        finally:
            beside.unlink(missing_ok=True)


def shipped_folder(name: str) -> Path:
    """Find a folder of rtradar: in the installed package, or at the top of a checkout."""
    installed = Path(str(resources.files("rtradar"))) / name
    return installed if installed.is_dir() else Path(__file__).resolve().parents[2] / name


def remove_parts(folder: Path, names: str) -> None:
    """Remove what a killed `atomic_file` left of files with these names (a pattern).

    No other command may write into the folder.
    """
    part = re.compile(rf"\.({names})\.[0-9a-f]{{{2 * _TOKEN_BYTES}}}\.part")
    for path in folder.iterdir():
        if part.fullmatch(path.name) and stat.S_ISREG(path.lstat().st_mode):
            path.unlink(missing_ok=True)


def check_place(path: Path | None, option: str = "--json") -> None:
    """Raise InputError, which names the ``option``, before the work if no file can be written."""
    if path is None:
        return
    # Links that lead in a circle stay as they are, and are replaced.
    folder = Path(os.path.realpath(path)).parent
    try:
        if not folder.is_dir():
            raise InputError(f"{option} {path}: there is no folder '{folder}'; make it first")
        if path.is_dir():
            raise InputError(f"{option} {path}: that is a folder; name a file")
    except OSError as error:
        raise InputError(f"{option} {path}: {error.strerror}; give another file") from None


def write_json(path: str | os.PathLike[str], content: Mapping[str, Any]) -> None:
    """Write plain values as JSON, whole or not at all; InputError, for ``--json``, if it fails."""
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    try:
        # Streams and pipes are written to; only a file can be replaced as a whole.
        if (stream := _standard_stream(path)) is not None:
            stream.write(text)
            stream.flush()
            return
        if Path(path).exists() and not Path(path).is_file():  # a pipe
            Path(path).write_text(text, encoding="utf-8")
            return
        with atomic_file(path) as file:
            file.write(text.encode())
    except OSError as error:
        raise InputError(
            f"cannot write '{path}': {error.strerror}; give another file (--json)"
        ) from None
    except InputError as error:
        raise InputError(f"{error} (--json)") from None


def _standard_stream(path: str | os.PathLike[str]) -> TextIO | None:
    """Return the stream that a path such as /dev/stdout names; a file behind it has to stay."""
    for stream in (sys.stdout, sys.stderr):
        # No such path; a closed stream; no stream, or one that is no file.
        with suppress(OSError, ValueError, AttributeError):
            if os.path.samestat(os.stat(path), os.fstat(stream.fileno())):
                return stream
    return None


def read_json(path: Path) -> Any:
    """Read a JSON file that may be anybody's.

    Raises OSError if it cannot be read, and ValueError if it is no JSON, nested too deep, or larger
    than 100 MB.
    """
    try:
        return json.loads(read_bytes(path, _MOST_JSON_BYTES).decode("utf-8-sig"))
    except RecursionError:
        raise ValueError("nested too deep") from None


def read_arrays(
    path: Path,
    most_bytes: int = 1_000_000_000,
    names: Collection[str] | None = None,
    comment: int | None = None,
) -> dict[str, NDArray[Any]]:
    """Read the arrays of a NumPy archive that may be anybody's; none of Python objects.

    Without ``names`` all are read. ``comment`` is the length of the comment of an archive that is
    not compressed: what is cut off there nobody else sees. Raises OSError if it cannot be read, and
    ValueError if it is no such archive, is damaged, claims more than it holds, or is larger than
    ``most_bytes`` when unpacked.
    """
    import numpy as np  # the command line refuses input before it takes that long

    found = {}
    # Every size is checked before memory is reserved for it, because a header may claim anything.
    with _archive(path, most_bytes, comment) as archive:
        for entry in archive.infolist():
            name = entry.filename.removesuffix(".npy")
            if name != entry.filename and (names is None or name in names):
                with archive.open(entry) as member:
                    shape, order, kind = _read_header(member, entry.file_size)
                    data = bytearray()  # so that the array may be changed
                    while part := member.read(2**20):
                        data += part
                found[name] = np.ndarray(shape, kind, data, order=order)
                _check_text(found[name])
    return found


def array_header(
    path: Path, name: str, most_bytes: int, comment: int
) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Read shape and type of an array of a NumPy archive; errors as of `read_arrays`."""
    with _archive(path, most_bytes, comment) as archive, archive.open(f"{name}.npy") as member:
        shape, _, kind = _read_header(member, archive.getinfo(f"{name}.npy").file_size)
        return shape, kind


@contextmanager
def _archive(path: Path, most_bytes: int, comment: int | None) -> Iterator[zipfile.ZipFile]:
    """Open an archive; OSError, or ValueError if it is none, is damaged or larger than that."""
    with open_regular(path) as file:
        try:
            # An archive without compression cannot hold more than its file has.
            if comment is not None:
                most_bytes = min(most_bytes, os.fstat(file.fileno()).st_size)
            with zipfile.ZipFile(file) as archive:
                if sum(entry.file_size for entry in archive.infolist()) > most_bytes:
                    raise ValueError(f"it claims more than {most_bytes / 1e6:g} MB")
                if comment not in (None, len(archive.comment)):
                    raise ValueError("it is cut off")
                yield archive
        except OSError:
            raise
        except Exception as error:  # readers raise errors of any type at damaged archives
            raise ValueError(" ".join(str(error).split())[:100] or type(error).__name__) from None


def _read_header(
    member: Any, size: int
) -> tuple[tuple[int, ...], Literal["C", "F"], np.dtype[Any]]:
    """Read shape, order and type of an array; ValueError if its file of that size has less."""
    import numpy as np

    version = np.lib.format.read_magic(member)
    if version == (1, 0):
        shape, fortran, kind = np.lib.format.read_array_header_1_0(member)
    elif version == (2, 0):
        shape, fortran, kind = np.lib.format.read_array_header_2_0(member)
    else:
        raise ValueError("it is of a version that no array of numbers has")
    if min(shape, default=1) < 0 or math.prod(shape) * max(kind.itemsize, 1) > size:
        raise ValueError("it claims more than it holds")
    if kind.hasobject:
        raise ValueError("it holds Python objects")
    return shape, "F" if fortran else "C", kind


def _check_text(array: NDArray[Any]) -> None:
    """Raise if a text holds a number that is no character, which Python cannot show."""
    import numpy as np

    if array.dtype.kind == "U" and array.dtype.itemsize:
        letters = (
            np.ascontiguousarray(array.astype(array.dtype.newbyteorder("=")))
            .reshape(-1, 1)
            .view(np.uint32)
        )
        if ((letters > sys.maxunicode) | ((letters >= 0xD800) & (letters < 0xE000))).any():
            raise ValueError("a text holds what is no character")


@contextmanager
def temporary_folder(prefix: str = "rtradar-", inside: Path | None = None) -> Iterator[Path]:
    """Make a folder that is removed at the end, also if a signal ends the process."""
    with (
        tempfile.TemporaryDirectory(prefix=prefix, dir=inside) as name,
        cleanup_on_exit(lambda: shutil.rmtree(name, ignore_errors=True)),
    ):
        yield Path(name)


@contextmanager
def cleanup_on_exit(remove: Callable[[], object]) -> Iterator[None]:
    """Call ``remove`` if a signal ends the process meanwhile."""
    with _lock:
        _unfinished.append(remove)
    try:
        yield
    finally:
        with _lock:
            _unfinished.remove(remove)


@contextmanager
def uninterruptible() -> Iterator[None]:
    """Let a short step end, or not begin, if a signal ends the process."""
    with _lock:
        yield


def discard_unfinished() -> None:
    """Remove what is unfinished; other threads neither begin nor finish a file from now on."""
    _lock.acquire(timeout=_PATIENCE_S)  # and never given back
    for remove in reversed(_unfinished):
        with suppress(Exception):
            remove()


def open_regular(path: str | os.PathLike[str]) -> io.BufferedReader:
    """Open a regular file for reading; OSError if it is a folder, pipe, socket or device.

    Links are followed. Opening a pipe would wait for somebody to write to it, and opening a device
    may move it, so the kind is checked before; and after, because the name may have changed its
    file.
    """
    try:
        _check_regular(path, os.stat(path))
        # O_NONBLOCK means nothing to regular files. Windows has neither flag.
        descriptor = os.open(
            path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        )
    except ValueError as error:  # a null character, or half of one that UTF-16 writes as two
        raise OSError(
            errno.EINVAL, f"no file can have this name ({' '.join(str(error).split())})"
        ) from None
    try:
        _check_regular(path, os.fstat(descriptor))
        return open(descriptor, "rb")
    except BaseException:
        os.close(descriptor)
        raise


def special_kind(path: str | os.PathLike[str]) -> str:
    """Name the kind of a pipe, socket or device, at which a reader may wait; else empty."""
    try:
        kind = stat.S_IFMT(os.stat(path).st_mode)
    except (OSError, ValueError):
        return ""
    return (
        "" if kind in (stat.S_IFREG, stat.S_IFDIR) else _OTHER_KINDS.get(kind, "of an unknown kind")
    )


def _check_regular(path: str | os.PathLike[str], status: os.stat_result) -> None:
    """Raise OSError if the status is not that of a regular file."""
    kind = stat.S_IFMT(status.st_mode)
    if kind != stat.S_IFREG:
        said = _OTHER_KINDS.get(kind, "of an unknown kind")
        number = errno.EISDIR if kind == stat.S_IFDIR else errno.EINVAL
        raise OSError(number, f"it is {said}, not a file", os.fspath(path))


def read_bytes(path: str | os.PathLike[str], most_bytes: int) -> bytes:
    """Read a regular file that may be anybody's.

    Raises OSError as `open_regular` does, and ValueError if it is larger than ``most_bytes``.
    """
    with open_regular(path) as file:
        # The size is checked first, so that reading takes no more memory than allowed.
        if (
            os.fstat(file.fileno()).st_size > most_bytes
            or len(content := file.read(most_bytes + 1)) > most_bytes
        ):
            raise ValueError(f"more than {most_bytes / 1e6:g} MB")
        return content


def digest_of(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 digest of a regular file that may be anybody's; errors of `read_bytes`."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def csv_text(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table as text, with what a spreadsheet would run as a formula quoted."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(map(_inert, (head, *rows)))
    return text.getvalue()


def _inert(row: Sequence[object]) -> list[object]:
    return [f"'{cell}" if isinstance(cell, str) and _FORMULA.match(cell) else cell for cell in row]
