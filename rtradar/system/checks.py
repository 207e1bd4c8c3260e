"""Checks of single values from files and from Python, each with its one line of complaint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rtradar.errors import InputError

Vector = tuple[float, float, float]


def brief(value: object) -> str:
    """A value as messages show it: one line, not too long."""
    if isinstance(value, int) and abs(value) >= 10**20:
        return "a number of more than 20 digits"
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer of very many digits, a table nested very deep
        text = f"a {type(value).__name__}"
    text = " ".join(text.split())
    text = printable(text)
    return text if len(text) <= 60 else f"{text[:57]}..."


def printable(text: str) -> str:
    """The same with ``?`` for what no page can hold: line ends, and bytes of a file's name that are not UTF-8."""
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def inside(folder: Path, name: str) -> Path | None:
    """A file or folder in ``folder`` or below, links followed; None where the name leads elsewhere, or nowhere at all."""
    try:
        if not Path(name).is_absolute() and (folder / name).resolve().is_relative_to(
            folder.resolve()
        ):
            return folder / name
    except (OSError, RuntimeError, ValueError):  # a circle of links, a null character
        pass
    return None


def check_number(where: str, key: str, value: object, least: float, most: float) -> float:
    """A finite number from ``least`` to ``most``, as a float."""
    number = _number(value)
    if number is None or not least <= number <= most:
        raise InputError(
            f"{where}: {key} = {brief(value)}; it must be a number from {least:g} to {most:g}"
        )
    return number


def check_vector(
    where: str, key: str, value: object, size: int, most: float = 1000.0
) -> tuple[float, ...]:
    """So many finite numbers, none larger than ``most`` in size, as a tuple of floats."""
    if (
        isinstance(value, Sequence | np.ndarray)
        and not isinstance(value, str | bytes)
        and len(value) == size
    ):
        numbers = [
            number for number in map(_number, value) if number is not None and abs(number) <= most
        ]
        if len(numbers) == size:
            return tuple(numbers)
    raise InputError(
        f"{where}: {key} = {brief(value)}; it must be {size} numbers from {-most:g} to {most:g}"
    )


def check_text(where: str, key: str, value: object) -> str:
    """One line of text, not empty."""
    if isinstance(value, str) and value.strip() and value.isprintable():
        return value
    raise InputError(f"{where}: {key} = {brief(value)}; it must be a string of one line, not empty")


def array_to_fill(
    where: str, out: NDArray[Any] | None, shape: tuple[int, ...], dtype: DTypeLike
) -> NDArray[Any]:
    """The array that was given to be filled; where none was, a new one."""
    if out is None:
        return np.empty(shape, dtype=dtype)
    if out.shape == shape and out.dtype == dtype and out.flags.carray:
        return out
    raise ValueError(
        f"{where}: out has shape {out.shape}, type {out.dtype}; it must have {shape}, {np.dtype(dtype)}, C-contiguous, writeable"
    )


def _number(value: object) -> float | None:
    """A finite number as a float, None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return None
    try:
        number = float(value)
    except OverflowError:  # an integer that no float can hold
        return None
    return number if math.isfinite(number) else None
