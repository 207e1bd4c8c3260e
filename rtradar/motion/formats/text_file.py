"""Text of motion files, with errors that name the file and the line."""

from __future__ import annotations

import codecs
import io
import math
import os
import re
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Self

from tqdm import tqdm

from rtradar.errors import InputError
from rtradar.system.files import open_regular

_MOST_BYTES, _MOST_CHARACTERS = 2_000_000_000, 1_000_000
"""Limits of the size of a file, some six hours at 120 Hz, and of the length of a line."""

_MOST_JOINTS, _MOST_POSES = 1000, 100_000_000
_LARGEST = 1e9
"""Largest value in whatever unit: 1000 km in millimetres, a million rotations in degrees."""

_FIRST_BYTES, _LONG_BYTES, _CHARACTERS_A_STEP = 65_536, 20_000_000, 1_000_000


class TextFile:
    """Lines of a text file, one after the other, with a progress bar where reading takes long.

    The text is Latin-1, because every byte is a character there and only comments use more than
    ASCII. Line ends may be mixed, and a byte order mark is left out. The file is used in a ``with``
    statement, so that it is closed before an error message is written.
    """

    def __init__(self, path: Path, kind: str) -> None:
        self.path, self.kind, self.line = path, kind, 0
        self._lines = self._read()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._lines.close()

    def __iter__(self) -> Iterator[str]:
        return self._lines

    def fail(self, what: str, line: int | None = None) -> InputError:
        """Make an error at a line, counted from 1; by default at the one that was read last."""
        return InputError(f"{self.path}, line {self.line if line is None else line}: {what}")

    def numbers(self, words: list[str], line: int | None = None) -> list[float]:
        """Convert words to finite floats of a size that motion can have."""
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = [math.nan]
        if not sum(map(abs, values)) <= _LARGEST:  # which NaN and infinity are not, either
            for complaint in filter(None, map(_complaint, words)):
                raise self.fail(complaint, line)
        return values

    def cells(self, words: list[str]) -> list[float]:
        """Numbers of a row of a table, NaN where a cell is empty."""
        seen = [k for k, word in enumerate(words) if word.lower() not in ("", "nan")]
        row = [math.nan] * len(words)
        for k, value in zip(seen, self.numbers([words[k] for k in seen]), strict=True):
            row[k] = value
        return row

    def check_size(self, joints: int, frames: int = 1) -> None:
        """Refuse more than a person's motion has: 1000 joints, or 100 million poses of a joint."""
        if joints > _MOST_JOINTS:
            raise InputError(
                f"{self.path}: more than {_MOST_JOINTS} joints; a person has some dozens: leave "
                "the others out"
            )
        if joints * frames > _MOST_POSES:
            raise InputError(
                f"{self.path}: {frames} frames of {joints} joints; frames times joints may be "
                f"{_MOST_POSES}: cut it into shorter ones"
            )

    def _read(self) -> Generator[str]:
        path, kind, blank = self.path, self.kind, True
        try:
            with io.TextIOWrapper(open_regular(path), encoding="latin-1") as file:
                size = os.fstat(file.fileno()).st_size
                if size > _MOST_BYTES:
                    raise InputError(
                        f"{path}: {size / 1e6:.0f} MB; a {kind} file may have "
                        f"{_MOST_BYTES / 1e6:.0f} MB: cut it into shorter ones"
                    )
                # The first bytes show a binary file, and a byte order mark, before any line is
                # taken.
                start = file.buffer.read(_FIRST_BYTES)
                if b"\0" in start:
                    raise InputError(f"{path}: binary data; expected {kind} text")
                file.seek(len(codecs.BOM_UTF8) if start.startswith(codecs.BOM_UTF8) else 0)
                # None shows the bar on a terminal; a bar starts a thread, for large files alone.
                silent = None if size > _LONG_BYTES else True
                what, units = f"reading {path.name}", {"unit": "B", "unit_scale": True}
                with tqdm(total=size, desc=what, leave=False, disable=silent, **units) as bar:
                    behind = 0
                    while line := file.readline(_MOST_CHARACTERS + 1):
                        if "\0" in line:
                            raise InputError(f"{path}: binary data; expected {kind} text")
                        # A file without line ends would otherwise be read into memory whole.
                        if len(line) > _MOST_CHARACTERS:
                            raise InputError(
                                f"{path}: a line of more than {_MOST_CHARACTERS} characters; "
                                f"expected {kind} text"
                            )
                        blank = blank and not line.strip()
                        behind += len(line)
                        if behind > _CHARACTERS_A_STEP:
                            bar.update(behind)
                            behind = 0
                        self.line += 1
                        yield line
        except OSError as error:
            raise InputError(
                f"{path}: cannot read this {kind} file ({error.strerror}); check the path"
            ) from None
        if blank:
            raise InputError(f"{path}: empty; expected {kind} text")


def _complaint(word: str) -> str:
    try:
        value = float(word)
    except ValueError:
        if re.fullmatch(r"[-+]?\d*,\d+", word):
            return f"{word[:40]!r} has a decimal comma; export the file with decimal points"
        return f"{word[:40]!r} is not a number"
    if not math.isfinite(value):
        return f"{word[:40]!r}: values must be finite; repair or cut this frame"
    if abs(value) > _LARGEST:
        return f"{word[:40]!r}: values may be {_LARGEST:g} at most; repair or cut this frame"
    return ""
