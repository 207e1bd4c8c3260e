"""TOML files to tables, and one line of complaint about keys and kinds that have no business there."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rtradar.errors import InputError
from rtradar.system.checks import brief
from rtradar.system.files import read_bytes

Table = Mapping[str, Any]

_MOST_BYTES = 1_000_000
_MOST_PIECES = 1000


def read_toml(path: Path, what: str, cure: str) -> Table:
    """The table of a TOML file.

    Parameters
    ----------
    path : path
    what : str
        Kind of file, for messages: "scene".
    cure : str
        What to give instead of a file that cannot be read.

    Raises
    ------
    InputError
        Where it cannot be read, is too large to be meant, or is not TOML.
    """
    where = f"{what} file '{path}'"
    try:
        content = read_bytes(path, _MOST_BYTES)
    except OSError as error:
        raise InputError(f"{where}: {error.strerror}; {cure}") from None
    except ValueError:
        raise InputError(
            f"{where} is larger than {_MOST_BYTES / 1e6:g} MB: it is no {what}"
        ) from None
    try:
        # Windows' editors begin a file with a byte order mark, which is no part of its text.
        return tomllib.loads(content.decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{where} is not TOML: {brief(str(error))[1:-1]}") from None
    except ValueError as error:  # an integer of too many digits
        raise InputError(f"{where} cannot be used: {brief(str(error))[1:-1]}") from None


def table_at(key: str, table: Table, parent: str = "") -> Table:
    """The table of that key; empty where there is none."""
    value = table.get(key, {})
    if not isinstance(value, dict):
        raise InputError(
            f"{parent}{brief(key)[1:-1]} = {brief(value)}; it must be a table: [{parent}{brief(key)[1:-1]}]"
        )
    return value


def tables_at(key: str, table: Table) -> list[tuple[str, Table]]:
    """Tables of a list, each with its place in the file; none where there is no such key."""
    value = table.get(key, [])
    if not isinstance(value, list) or not all(isinstance(piece, dict) for piece in value):
        raise InputError(
            f"{key} = {brief(value)}; it must be a list of tables: [[{key}]] once for each"
        )
    if len(value) > _MOST_PIECES:
        raise InputError(f"[[{key}]] stands there {len(value)} times; {_MOST_PIECES} are allowed")
    return [(f"[[{key}]] number {number} ", piece) for number, piece in enumerate(value, start=1)]


def check_keys(
    where: str, table: Table, needed: tuple[str, ...], optional: tuple[str, ...]
) -> None:
    """Refuse keys that are unknown, and tables that lack one; ``where`` ends with a blank if it is not empty."""
    allowed = (*needed, *optional)
    for key in table:
        if key not in allowed:
            raise InputError(f"{where}unknown key {brief(key)}; allowed: {', '.join(allowed)}")
    for key in needed:
        if key not in table:
            raise InputError(f"{where}{key} is missing; needed: {', '.join(needed)}")
