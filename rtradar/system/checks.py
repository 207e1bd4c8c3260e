"""Checks of values and of tables from TOML files, each with a one-line error."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Callable, Iterable, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard, TypeVar

from rtradar.errors import InputError, InputErrors
from rtradar.system.files import read_bytes

if TYPE_CHECKING:
    from numpy.typing import DTypeLike, NDArray

Vector = tuple[float, float, float]
Table = Mapping[str, Any]

_MAX_TOML_BYTES = 1_000_000
_MAX_TABLES = 1000
_MOST_LINES = 50  # of complaints about one file
_T = TypeVar("_T")


def brief(value: object) -> str:
    """Return a short representation of a value for a message, in one line."""
    if isinstance(value, int) and abs(value) >= 10**20:
        return "a number of more than 20 digits"
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer of very many digits, a table nested very deep
        text = f"a {type(value).__name__}"
    text = printable(" ".join(text.split()))
    return text if len(text) <= 60 else f"{text[:57]}..."


def printable(text: str) -> str:
    """Replace what no page can hold by ``?``: line ends, and bytes of a name that are not UTF-8."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def inside(folder: Path, name: str) -> Path | None:
    """Return the path of a name in or below ``folder``, links followed; None if it is elsewhere."""
    try:
        if not Path(name).is_absolute() and (folder / name).resolve().is_relative_to(
            folder.resolve()
        ):
            return folder / name
    except (OSError, RuntimeError, ValueError):  # a circle of links, a null character
        pass
    return None


def is_real(value: object) -> TypeGuard[float]:
    """Whether a value is a real number of Python or of NumPy, and not a truth value."""
    return _is_of(Real, (int, float), value)


def is_whole(value: object) -> TypeGuard[int]:
    """Whether a value is a whole number of Python or of NumPy, and not a truth value."""
    return _is_of(Integral, (int,), value)


def _is_of(kind: type, own: tuple[type, ...], value: object) -> bool:
    # NumPy's numbers are known by their type of data: to import NumPy takes longer than a refusal.
    numpys = isinstance(value, kind) and hasattr(value, "dtype")
    return (numpys or isinstance(value, own)) and not isinstance(value, bool)


def check_number(where: str, key: str, value: object, least: float, most: float) -> float:
    """Return a finite number from ``least`` to ``most`` as a float."""
    if not is_real(value) or not least <= value <= most:
        raise InputError(
            f"{where}: {key} = {brief(value)}; it must be a number from {least:g} to {most:g}"
        )
    return float(value)


def check_path(what: str, value: object, *, or_name: bool = False) -> Path:
    """Return a path that a file may have; of a name whatever there may be in it."""
    if isinstance(value, str | Path) and (or_name or "\0" not in str(value)):
        return Path(value)
    raise InputError(f"{what} = {brief(value)}; it must be the path of a file or a name")


def check_order(order: object) -> None:
    """Refuse what is no number of reflections at walls on a path."""
    if not is_whole(order) or order not in range(4):
        raise InputError(
            f"order = {brief(order)} of reflections at walls; it must be a whole number from 0 to 3"
        )


def array_to_fill(
    where: str, out: NDArray[Any] | None, shape: tuple[int, ...], dtype: DTypeLike
) -> NDArray[Any]:
    """Return the array given to be filled, or a new one."""
    import numpy as np  # a refusal on the command line does not need it

    if out is None:
        return np.empty(shape, dtype=dtype)
    if out.shape == shape and out.dtype == dtype and out.flags.carray:
        return out
    raise ValueError(
        f"{where}: out has shape {out.shape}, type {out.dtype}; "
        f"it must have {shape}, {np.dtype(dtype)}, C-contiguous, writeable"
    )


# -- tables of TOML files --------------------------------------------------------------------------


def read_toml(path: Path, what: str, cure: str) -> Table:
    """Return the table of a TOML file; InputError if it cannot be read, is too large or no TOML.

    Messages call it a ``what`` file, and tell the ``cure`` if it cannot be read.
    """
    where = f"{what} file '{path}'"
    try:
        content = read_bytes(path, _MAX_TOML_BYTES)
    except OSError as error:
        raise InputError(f"{where}: {error.strerror}; {cure}") from None
    except ValueError:
        raise InputError(
            f"{where} is larger than {_MAX_TOML_BYTES / 1e6:g} MB: it is no {what}"
        ) from None
    try:
        # Windows' editors begin a file with a byte order mark, which is no part of its text.
        return tomllib.loads(content.decode("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{where} is not TOML: {brief(str(error))[1:-1]}") from None
    except ValueError as error:  # an integer of too many digits
        raise InputError(f"{where} cannot be used: {brief(str(error))[1:-1]}") from None


def table_at(key: str, table: Table, parent: str = "") -> Table:
    """Return the table under a key; empty if there is none."""
    value = table.get(key, {})
    if not isinstance(value, dict):
        raise InputError(
            f"{parent}{brief(key)[1:-1]} = {brief(value)}; "
            f"it must be a table: [{parent}{brief(key)[1:-1]}]"
        )
    return value


def tables_at(key: str, table: Table, most: int = _MAX_TABLES) -> list[tuple[str, Table]]:
    """Return the tables of a list, at most so many, each with its place in the file."""
    value = table.get(key, [])
    if not isinstance(value, list) or not all(isinstance(piece, dict) for piece in value):
        raise InputError(
            f"{key} = {brief(value)}; it must be a list of tables: [[{key}]] once for each"
        )
    if len(value) > most:
        raise InputError(f"[[{key}]] is there {len(value)} times; {most} are allowed")
    return [(f"[[{key}]] number {number} ", piece) for number, piece in enumerate(value, start=1)]


def check_keys(
    where: str, table: Table, needed: tuple[str, ...], optional: tuple[str, ...]
) -> None:
    """Refuse unknown and missing keys; ``where`` ends with a blank if it is not empty."""
    for complaint in wrong_keys(where, table, needed, optional):
        raise InputError(complaint)


def wrong_keys(
    where: str, table: Table, needed: tuple[str, ...], optional: tuple[str, ...]
) -> list[str]:
    """Return a message about each key that is unknown or missing; see `check_keys`."""
    allowed = (*needed, *optional)
    unknown = [
        f"{where}unknown key {brief(key)}{meant(key, allowed)}; allowed: {', '.join(allowed)}"
        for key in table
        if key not in allowed
    ]
    return unknown + [
        f"{where}{key} is missing; needed: {', '.join(needed)}"
        for key in needed
        if key not in table
    ]


def meant(word: object, allowed: Iterable[str]) -> str:
    """Return the question whether the nearest of some words was meant; empty if none is near."""
    near = difflib.get_close_matches(str(word), allowed, 1)
    return f" (did you mean {near[0]}?)" if near else ""


class Complaints:
    """Errors of parts of a file that do not depend on each other, told all at once.

    Attributes
    ----------
    lines : list of str
        Message about each.
    """

    def __init__(self) -> None:
        self.lines: list[str] = []

    def of(self, read: Callable[..., _T], *values: Any) -> _T | None:
        """Return what a function gives for some values; None if it complains about them."""
        try:
            return read(*values)
        except InputErrors as error:
            self.lines += error.lines
        except InputError as error:
            self.lines.append(str(error))
        return None

    def check(self) -> None:
        """Raise InputError if there is a complaint, InputErrors if there are several."""
        lines = list(dict.fromkeys(self.lines))
        if len(lines) == 1:
            raise InputError(lines[0])
        if len(lines) > _MOST_LINES:
            lines[_MOST_LINES:] = [f"and {len(lines) - _MOST_LINES} more"]
        if lines:
            raise InputErrors(lines)
