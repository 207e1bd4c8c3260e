"""Reading the text of motion files, with errors that name the file and the line."""

from __future__ import annotations

import math
import re
from pathlib import Path

from rtradar.errors import InputError

_MOST_BYTES = 100_000_000
_MOST_JOINTS = 1000
_MOST_POSES = 10_000_000
_LARGEST = 1e9
"""In whatever unit: a thousand kilometres in millimetres, a million turns in degrees."""

_LINE_END = re.compile(r"\r\n|\r|\n")


def read_lines(path: Path, kind: str) -> list[str]:
    """Lines of a text file, without their ends.

    Latin-1, for every byte is a character there and only comments use more than ASCII; line ends may be mixed.

    Raises
    ------
    InputError
        Where the file is not there, is a directory, is empty, is binary, or is larger than 100 MB (half an hour at 120 Hz).
    """
    if path.is_dir():
        raise InputError(f"{path}: a directory; give one {kind} file")
    try:
        size = path.stat().st_size
        if size > _MOST_BYTES:
            raise InputError(
                f"{path}: {size / 1e6:.0f} MB; a {kind} file may have {_MOST_BYTES / 1e6:.0f} MB: cut it into shorter ones"
            )
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot read this {kind} file ({error.strerror}); check the path") from None
    if not data.strip():
        raise InputError(f"{path}: empty; expected {kind} text")
    if b"\0" in data:
        raise InputError(f"{path}: binary data; expected {kind} text")
    return _LINE_END.split(data.decode("latin-1"))


def check_size(path: Path, joints: int, frames: int = 1) -> None:
    """Refuse what would take more memory than a person's motion does: 1000 joints, or ten million poses of one."""
    if joints > _MOST_JOINTS:
        raise InputError(f"{path}: more than {_MOST_JOINTS} joints; a person has some dozens: leave the others out")
    if joints * frames > _MOST_POSES:
        raise InputError(
            f"{path}: {frames} frames of {joints} joints; frames times joints may be {_MOST_POSES}: cut it into shorter ones"
        )


def fail(path: Path, line: int, what: str) -> InputError:
    """An error at a line, counted from 1."""
    return InputError(f"{path}, line {line}: {what}")


def numbers(words: list[str], path: Path, line: int) -> list[float]:
    """Finite floats of a size that motion can have, or an error that names the word."""
    try:
        values = [float(word) for word in words]
    except ValueError:
        wrong = next(word for word in words if not _is_float(word))
        raise fail(path, line, f"{wrong[:40]!r} is not a number") from None
    if not all(map(math.isfinite, values)):
        wrong = next(word for word, value in zip(words, values, strict=True) if not math.isfinite(value))
        raise fail(path, line, f"{wrong[:40]!r}: values must be finite; repair or cut this frame")
    if any(abs(value) > _LARGEST for value in values):
        wrong = next(word for word, value in zip(words, values, strict=True) if abs(value) > _LARGEST)
        raise fail(path, line, f"{wrong[:40]!r}: values may be {_LARGEST:g} at most; repair or cut this frame")
    return values


def _is_float(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
