"""The values that options of the command line take, and what commands print."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtradar.errors import InputError
from rtradar.recordings import UNITS_M, UPWARD, check_rate, check_unit, check_up

if TYPE_CHECKING:
    from rtradar.settings import Breathing


def say(options: argparse.Namespace, text: str) -> None:
    """Print a result, unless ``--quiet`` asks for errors only."""
    if not options.quiet:
        print(text)


def show_page(page: Path) -> None:
    """Open a page in the browser, or say that there is none."""
    import webbrowser

    if not webbrowser.open(page.resolve().as_uri()):
        print("no browser was found here; open the page by hand", file=sys.stderr)


def fail(status: int, why: object) -> int:
    """Print on stderr what went wrong, each thing in one line, and return the exit status."""
    for line in getattr(why, "lines", None) or [why]:
        print("rtradar: " + " ".join(str(line).split()), file=sys.stderr)
    return status


# -- values; argparse says "invalid <name of the function> value" ----------------------------------


def _named(name: str) -> Callable[[Callable[[str], Any]], Callable[[str], Any]]:
    def rename(read: Callable[[str], Any]) -> Callable[[str], Any]:
        read.__name__ = name
        return read

    return rename


@_named("finite number")
def number(text: str) -> float:
    """Read a finite number."""
    value = float(text)
    if not math.isfinite(value):
        raise ValueError
    return value


def setting(text: str) -> tuple[str, bool | int | float | str]:
    """Read a name and its value: a number, true, false, or a word."""
    name, equals, value = text.partition("=")
    if not (name.isidentifier() and equals and value):
        raise argparse.ArgumentTypeError(f"{text!r} must be NAME=VALUE, such as shadow_rays=256")
    if value in ("true", "false"):
        return name, value == "true"
    for kind in (int, number):
        with suppress(ValueError):
            return name, kind(value)
    return name, value


def assignment(text: str) -> tuple[str, Any]:
    """Read a dotted key and its value, as TOML has it; what is none there is a word."""
    import tomllib

    key, equals, value = text.partition("=")
    if not (key and equals and value):
        raise argparse.ArgumentTypeError(f"{text!r} must be KEY=VALUE, such as radar.pitch_deg=-15")
    try:
        return key.strip(), tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return key.strip(), value.strip()


def window(text: str) -> str | tuple[str, float]:
    """Read a window function: a name, or a name and its parameter."""
    name, colon, value = text.partition(":")
    return (name, number(value)) if colon else name


@_named("place X,Y[,HEADING], such as -1,0.5 or 0,2,90")
def place_at(text: str) -> dict[str, Any]:
    """Read where a person is, x and y [m], and the heading [degree] if there is one."""
    x, y, *heading = (number(part) for part in text.split(","))
    if len(heading) > 1:
        raise ValueError
    return {"position_m": (x, y)} | ({"heading_deg": heading[0]} if heading else {})


@_named("place X,Y,Z [m]")
def place_in_space(text: str) -> tuple[float, ...]:
    """Read a place, x, y and z [m]."""
    x, y, z = (number(part) for part in text.split(","))
    return x, y, z


@_named(f"axis: {', '.join(UPWARD)}")
def axis(text: str) -> str | None:
    """Read the axis of a file that is up."""
    return check_up("--up", text)


@_named(f"unit: {', '.join(UNITS_M)}, or the metres of one")
def unit(text: str) -> float | None:
    """Read a length unit [m]."""
    return check_unit("--unit", text)


@_named("number of frames a second, 1 to 100000")
def rate(text: str) -> float | None:
    """Read the rate of a recording [Hz]."""
    return check_rate("--rate", float(text))


@_named("amplitude [mm] and rate [Hz], such as 3,0.25")
def breathing(text: str) -> Breathing:
    """Read the amplitude [mm] and the rate [Hz] of a person's breath."""
    from rtradar.settings import Breathing

    amplitude_mm, rate_hz = (number(part) for part in text.split(","))
    try:
        return Breathing(amplitude_mm, rate_hz)
    except InputError as wrong:
        raise argparse.ArgumentTypeError(str(wrong)) from None


@_named("number of seconds, not negative")
def seconds(text: str) -> float:
    """Read a time of at least 0 [s]."""
    return _at_least(0, number(text))


@_named("number of decibels, inf or physical")
def decibels(text: str) -> float | str:
    """Read a number of decibels, inf, or physical."""
    if text == "physical":
        return text
    value = float(text)
    if math.isnan(value) or value == -math.inf:
        raise ValueError
    return value


@_named("number of decibels, or -inf")
def decibels_below(text: str) -> float:
    """Read a number of decibels that may be -inf."""
    value = float(text)
    if math.isnan(value) or value == math.inf:
        raise ValueError
    return value


@_named("whole number, not negative")
def whole(text: str) -> int:
    """Read a whole number of at least 0."""
    return _at_least(0, int(text))


@_named("whole number, at least 1")
def count(text: str) -> int:
    """Read a whole number of at least 1."""
    return _at_least(1, int(text))


@_named("list of whole numbers, such as 1,2,3")
def numbers(text: str) -> list[int]:
    """Read whole numbers separated by commas."""
    return [whole(part) for part in text.split(",")]


@_named("shard I/N, such as 2/8")
def shard(text: str) -> tuple[int, int]:
    """Read the number of a shard, from 1, and how many there are."""
    number, _, of = text.partition("/")
    found = int(number), int(of)
    if not 1 <= found[0] <= found[1]:
        raise ValueError
    return found


def path(text: str) -> Path:
    """Read a path; an empty one is refused, for it would be the current folder."""
    if not text:
        raise argparse.ArgumentTypeError("it is empty; give the name of a file or folder")
    return Path(text)


def there(text: str) -> Path:
    """Read the path of a file or folder that exists."""
    if not os.path.lexists(path(text)):
        raise argparse.ArgumentTypeError(f"there is no '{text}'; check the path")
    return Path(text)


def _at_least(least: int, value: Any) -> Any:
    if value < least:
        raise ValueError
    return value
