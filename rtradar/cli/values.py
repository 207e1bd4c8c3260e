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


def settings_in(options: argparse.Namespace) -> dict[str, Any]:
    """Return the settings of a run that are given."""
    keys = {key: key.removeprefix("settings.") for key in vars(options) if key.count(".") == 1}
    return {name: vars(options)[key] for key, name in keys.items() if name != key}


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


def _named(name: str, read: Callable[[str], Any]) -> Callable[[str], Any]:
    def named(text: str) -> Any:
        return read(text)

    named.__name__ = name
    return named


def _numbers(
    name: str, kind: Callable[[str], Any], least: float, most: float = math.inf
) -> Callable[[str], Any]:
    """A number within limits, infinite only where one is."""

    def read(text: str) -> Any:
        value = kind(text)
        if not least <= value <= most:
            raise ValueError
        return value

    return _named(name, read)


_LARGEST = sys.float_info.max
number = _numbers("finite number", float, -_LARGEST, _LARGEST)
seconds = _numbers("number of seconds, not negative", float, 0, _LARGEST)
decibels_below = _numbers("number of decibels, or -inf", float, -math.inf, _LARGEST)
whole = _numbers("whole number, not negative", int, 0)
count = _numbers("whole number, at least 1", int, 1)
numbers = _named(
    "list of whole numbers, such as 1,2,3", lambda text: [whole(part) for part in text.split(",")]
)
axis = _named(f"axis: {', '.join(UPWARD)}", lambda text: check_up("--up", text))
unit = _named(
    f"unit: {', '.join(UNITS_M)}, or the metres of one", lambda text: check_unit("--unit", text)
)
rate = _named(
    "number of frames a second, 1 to 100000", lambda text: check_rate("--rate", float(text))
)


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


def words(text: str) -> list[str]:
    """Read names, such as stand,sit."""
    return [name.strip() for name in text.split(",") if name.strip()]


words.__name__ = "list of names, such as stand,sit"


def classes(text: str) -> dict[str, list[str]]:
    """Read classes, each with the actors that show it."""
    found = {}
    for part in words(text):
        name, _, actors = part.partition("=")
        if not name or name in found:
            raise argparse.ArgumentTypeError(f"'{part}': each class needs a name, given once")
        found[name] = [actor for actor in actors.split("+") if actor] or [name]
    return found


classes.__name__ = "list of classes, such as walk,punch=punch+boxing"


def place_at(text: str) -> dict[str, Any]:
    """Read where a person is, x and y [m], and the heading [degree] if there is one."""
    x, y, *heading = (number(part) for part in text.split(","))
    if len(heading) > 1:
        raise ValueError
    return {"position_m": (x, y)} | ({"heading_deg": heading[0]} if heading else {})


place_at.__name__ = "place X,Y[,HEADING], such as -1,0.5 or 0,2,90"


def place_in_space(text: str) -> tuple[float, ...]:
    """Read a place, x, y and z [m]."""
    x, y, z = (number(part) for part in text.split(","))
    return x, y, z


place_in_space.__name__ = "place X,Y,Z [m]"


def breathing(text: str) -> Breathing:
    """Read the amplitude [mm] and the rate [Hz] of a person's breath, and perhaps of the heart."""
    from rtradar.settings import Breathing

    amplitude_mm, rate_hz, *heart = (number(part) for part in text.split(","))
    if len(heart) not in (0, 2):
        raise ValueError
    of_heart = dict(zip(("heart_mm", "heart_hz"), heart, strict=False))
    try:
        return Breathing(amplitude_mm, rate_hz, **of_heart)
    except InputError as wrong:
        raise argparse.ArgumentTypeError(str(wrong)) from None


breathing.__name__ = (
    "amplitude [mm] and rate [Hz], such as 3,0.25, or with the heart 3,0.25,0.3,1.2"
)


def decibels(text: str) -> float | str:
    """Read a number of decibels, inf, or physical."""
    if text == "physical":
        return text
    value = float(text)
    if math.isnan(value) or value == -math.inf:
        raise ValueError
    return value


decibels.__name__ = "number of decibels, inf or physical"


def shard(text: str) -> tuple[int, int]:
    """Read the number of a shard, from 1, and how many there are."""
    number, _, of = text.partition("/")
    found = int(number), int(of)
    if not 1 <= found[0] <= found[1]:
        raise ValueError
    return found


shard.__name__ = "shard I/N, such as 2/8"


def path(text: str) -> Path:
    """Read a path; an empty one is refused, because it would be the current folder."""
    if not text:
        raise argparse.ArgumentTypeError("it is empty; give the name of a file or folder")
    return Path(text)


def there(text: str) -> Path:
    """Read the path of a file or folder that exists."""
    if not os.path.lexists(path(text)):
        raise argparse.ArgumentTypeError(f"there is no '{text}'; check the path")
    return Path(text)
