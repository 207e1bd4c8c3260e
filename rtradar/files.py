"""Files that are whole or not there, also where the process is told to end while it writes them."""

from __future__ import annotations

import json
import os
import secrets
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

from rtradar.errors import InputError

_MOST_JSON_BYTES = 100_000_000
_PATIENCE_S = 1.0
"""Waited, at the end, for a file that is just taking its name."""

_lock = threading.RLock()
_unfinished: list[Callable[[], object]] = []


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """A binary file to write; it takes its name when all went well, and leaves nothing otherwise.

    Parameters
    ----------
    path : path
        Where the file shall be; one that is there already is replaced.

    Yields
    ------
    binary file
        Open for writing and reading, in the same folder under another name.

    Raises
    ------
    InputError
        Where the folder is missing or cannot be written.
    """
    target = Path(path)
    # Not by the process alone: on a shared disk another machine may write the same file.
    beside = target.with_name(f".{target.name}.{secrets.token_hex(6)}.part")
    with unfinished(lambda: beside.unlink(missing_ok=True)):
        try:
            file = open(beside, "w+b")  # noqa: SIM115 - closed below, before the file is moved
        except OSError as error:
            raise InputError(f"cannot write '{target}': {error.strerror}; give a folder that exists and can be written") from None
        try:
            with file:
                yield file
            with not_to_be_parted():
                os.replace(beside, target)
        except OSError as error:
            raise InputError(f"cannot write '{target}': {error.strerror}; give another path or make room") from error
        finally:
            beside.unlink(missing_ok=True)


def write_json(path: str | os.PathLike[str], content: Mapping[str, Any]) -> None:
    """Write plain values as indented JSON, whole or not at all.

    Raises
    ------
    InputError
        Where it cannot be written; the message names the command line's ``--json``.
    """
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    try:
        if Path(path).exists() and not Path(path).is_file():  # a pipe, /dev/stdout
            Path(path).write_text(text, encoding="utf-8")
            return
        with atomic_file(path) as file:
            file.write(text.encode())
    except OSError as error:
        raise InputError(f"cannot write '{path}': {error.strerror}; give another file (--json)") from None
    except InputError as error:
        raise InputError(f"{error} (--json)") from None


def read_json(path: Path) -> Any:
    """Plain values of a JSON file that may be anybody's.

    Raises
    ------
    OSError
        Where it cannot be read.
    ValueError
        Where it is no JSON, is nested deeper than Python goes, or is larger than 100 MB.
    """
    if path.stat().st_size > _MOST_JSON_BYTES:
        raise ValueError(f"more than {_MOST_JSON_BYTES / 1e6:g} MB")
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise ValueError("nested too deep") from None


@contextmanager
def temporary_folder(prefix: str = "rtradar-", inside: Path | None = None) -> Iterator[Path]:
    """A folder that is gone at the end, also where the process is told to end before."""
    with (
        tempfile.TemporaryDirectory(prefix=prefix, dir=inside) as name,
        unfinished(lambda: shutil.rmtree(name, ignore_errors=True)),
    ):
        yield Path(name)


@contextmanager
def unfinished(remove: Callable[[], object]) -> Iterator[None]:
    """While this lasts there is something that ``remove`` takes away, should the process have to end meanwhile."""
    with _lock:
        _unfinished.append(remove)
    try:
        yield
    finally:
        with _lock:
            _unfinished.remove(remove)


@contextmanager
def not_to_be_parted() -> Iterator[None]:
    """What is done here is short, and is done to its end or not begun, should the process have to end."""
    with _lock:
        yield


def discard_unfinished() -> None:
    """Take away all that is unfinished; from now on other threads of this process neither begin nor finish a file."""
    _lock.acquire(timeout=_PATIENCE_S)  # and never given back
    for remove in reversed(_unfinished):
        with suppress(Exception):
            remove()
