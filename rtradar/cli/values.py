"""Values on the command line."""

from __future__ import annotations

import argparse
import math
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    Subcommands = argparse._SubParsersAction[
        argparse.ArgumentParser
    ]  # argparse gives it no public name


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong in one line, as everything else here does."""

    def error(self, message: str) -> NoReturn:
        """End with status 2."""
        self.exit(2, f"{self.prog}: {message}; see '{self.prog} --help'\n")


def fail(status: int, why: object) -> int:
    """Say in one line on stderr what went wrong; the exit status is returned."""
    print("rtradar: " + " ".join(str(why).split()), file=sys.stderr)
    return status


def number(text: str) -> float:
    """Finite."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError
    return value


def setting(text: str) -> tuple[str, bool | int | float | str]:
    """A name and its value: a number, true, false, or a word."""
    name, equals, value = text.partition("=")
    if not (name.isidentifier() and equals and value):
        raise argparse.ArgumentTypeError(f"{text!r} must be NAME=VALUE, such as shadow_rays=256")
    if value in ("true", "false"):
        return name, value == "true"
    for kind in (int, number):
        with suppress(ValueError):
            return name, kind(value)
    return name, value


def window(text: str) -> str | tuple[str, float]:
    """A window function: a name, or a name and its parameter."""
    name, colon, value = text.partition(":")
    return (name, number(value)) if colon else name


def seconds(text: str) -> float:
    """At least 0 [s]."""
    value = number(text)
    if value < 0:
        raise ValueError
    return value


def decibels(text: str) -> float | str:
    """May be inf [dB], or physical."""
    if text == "physical":
        return text
    value = float(text)
    if math.isnan(value) or value == -math.inf:
        raise ValueError
    return value


def whole(text: str) -> int:
    """At least 0."""
    value = int(text)
    if value < 0:
        raise ValueError
    return value


def numbers(text: str) -> list[int]:
    """At least 0 each, parted by commas."""
    return [whole(part) for part in text.split(",")]


def count(text: str) -> int:
    """At least 1."""
    value = int(text)
    if value < 1:
        raise ValueError
    return value


def path(text: str) -> Path:
    """Not empty: the path of nothing would be that of the current folder."""
    if not text:
        raise argparse.ArgumentTypeError("it is empty; give the name of a file or folder")
    return Path(text)


for _kind, _name in (
    (number, "finite number"),
    (seconds, "number of seconds, not negative"),
    (decibels, "number of decibels, inf or physical"),
    (whole, "whole number, not negative"),
    (numbers, "list of whole numbers, such as 1,2,3"),
    (count, "whole number, at least 1"),
):
    _kind.__name__ = _name  # argparse says "invalid <name> value"
