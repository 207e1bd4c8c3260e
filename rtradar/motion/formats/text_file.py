"""Reading the text of motion files, with errors that name the file and the line."""

from __future__ import annotations

import codecs
import io
import math
import os
from collections.abc import Generator
from pathlib import Path

from tqdm import tqdm

from rtradar.errors import InputError
from rtradar.system.files import open_regular

FRAMES_AT_ONCE = 512
"""Frames that are held as Python's numbers, which take four times the memory of an array's."""

_MOST_BYTES = 2_000_000_000
_MOST_CHARACTERS = 1_000_000
"""In a line."""

_MOST_JOINTS = 1000
_MOST_POSES = 100_000_000
_LARGEST = 1e9
"""In whatever unit: a thousand kilometres in millimetres, a million turns in degrees."""

_LOOKED_AT_FIRST = 65_536
_LONG_BYTES = 20_000_000
_CHARACTERS_A_STEP = 1_000_000


def read_lines(path: Path, kind: str) -> Generator[str]:
    """Yield the lines of a text file, with a progress bar where it takes long.

    The generator must be closed before an error message is written.

    Latin-1, for every byte is a character there and only comments use more than ASCII; line ends
    may be mixed, and a byte order mark is passed over.

    Raises
    ------
    InputError
        Where the file is not there, is no regular file, is empty, is binary, or is larger than 2 GB
        (some six hours at 120 Hz).
    """
    try:
        with io.TextIOWrapper(open_regular(path), encoding="latin-1") as file:
            size = os.fstat(file.fileno()).st_size
            if size > _MOST_BYTES:
                raise InputError(
                    f"{path}: {size / 1e6:.0f} MB; a {kind} file may have {_MOST_BYTES / 1e6:.0f} "
                    "MB: cut it into shorter ones"
                )
            start = file.buffer.read(_LOOKED_AT_FIRST)
            if b"\0" in start:
                raise InputError(f"{path}: binary data; expected {kind} text")
            file.seek(len(codecs.BOM_UTF8) if start.startswith(codecs.BOM_UTF8) else 0)
            # On a terminal; a bar starts a thread, which small files are not worth.
            silent = None if size > _LONG_BYTES else True
            with tqdm(
                total=size,
                desc=f"reading {path.name}",
                unit="B",
                unit_scale=True,
                leave=False,
                disable=silent,
            ) as bar:
                blank, behind = True, 0
                while line := file.readline(_MOST_CHARACTERS + 1):
                    if "\0" in line:
                        raise InputError(f"{path}: binary data; expected {kind} text")
                    if len(line) > _MOST_CHARACTERS:
                        raise InputError(
                            f"{path}: a line of more than {_MOST_CHARACTERS} characters; expected "
                            f"{kind} text"
                        )
                    blank = blank and not line.strip()
                    behind += len(line)
                    if behind > _CHARACTERS_A_STEP:
                        bar.update(behind)
                        behind = 0
                    yield line
    except OSError as error:
        raise InputError(
            f"{path}: cannot read this {kind} file ({error.strerror}); check the path"
        ) from None
    if blank:
        raise InputError(f"{path}: empty; expected {kind} text")


def check_size(path: Path, joints: int, frames: int = 1) -> None:
    """Refuse files larger than a person's motion: 1000 joints, or 100 million poses of a joint."""
    if joints > _MOST_JOINTS:
        raise InputError(
            f"{path}: more than {_MOST_JOINTS} joints; a person has some dozens: leave the others "
            "out"
        )
    if joints * frames > _MOST_POSES:
        raise InputError(
            f"{path}: {frames} frames of {joints} joints; frames times joints may be "
            f"{_MOST_POSES}: cut it into shorter ones"
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
        wrong = next(
            word for word, value in zip(words, values, strict=True) if not math.isfinite(value)
        )
        raise fail(path, line, f"{wrong[:40]!r}: values must be finite; repair or cut this frame")
    if any(abs(value) > _LARGEST for value in values):
        wrong = next(
            word for word, value in zip(words, values, strict=True) if abs(value) > _LARGEST
        )
        raise fail(
            path,
            line,
            f"{wrong[:40]!r}: values may be {_LARGEST:g} at most; repair or cut this frame",
        )
    return values


def _is_float(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
