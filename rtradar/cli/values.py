"""Parser of the command line, and the values that options take."""

from __future__ import annotations

import argparse
import difflib
import itertools
import math
import os
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from rtradar.errors import InputError
from rtradar.recordings import UNITS_M, UPWARD, check_rate, check_unit, check_up

if TYPE_CHECKING:
    from rtradar.settings import Breathing

    # argparse gives it no public name.
    Subcommands = argparse._SubParsersAction["OneLineParser"]


class OneLineParser(argparse.ArgumentParser):
    """Argument parser that reports an error in one line, and knows its options only once asked.

    Parameters
    ----------
    fill : callable, optional
        Function that adds the options to the parser, called before it parses or shows its help.
        Only the command that is typed pays for its options.
    examples : sequence of str
        Command lines that the help shows at its end.
    **options
        What `argparse.ArgumentParser` takes.
    """

    def __init__(
        self,
        *,
        fill: Callable[[OneLineParser], None] | None = None,
        examples: Sequence[str] = (),
        **options: Any,
    ) -> None:
        self._fill, self.intermixed = fill, False
        if examples:
            options["epilog"] = "\n  ".join(["examples:", *examples])
        # The beginning of an option is none: "--snr" might as well be another one tomorrow.
        options |= {"allow_abbrev": False}
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **options)

    def commands(self, metavar: str = "COMMAND") -> Subcommands:
        """Return what commands are added to; without a command, the help is shown."""

        def show_help(_: argparse.Namespace) -> int:
            self.print_help()
            return 0

        self.set_defaults(command=show_help)
        return self.add_subparsers(metavar=metavar, parser_class=OneLineParser)

    def _filled(self) -> None:
        fill, self._fill = self._fill, None
        if fill is not None:
            fill(self)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse the arguments that are known, with options among the others if `intermixed`."""
        self._filled()
        if args is not None:
            args = _joined(args)
            if self._subparsers is None:
                self._refuse_unknown(args)
        if self.intermixed:
            self.intermixed = False  # for it calls this method
            return self.parse_known_intermixed_args(args, namespace)
        return super().parse_known_args(args, namespace)

    def _refuse_unknown(self, args: Sequence[str]) -> None:
        """Refuse the first option that is none, before anything else is missed."""
        for word in itertools.takewhile(lambda word: word != "--", args):
            name = word.partition("=")[0]
            if name.startswith("--") and name not in self._option_string_actions:
                self._unknown(name)

    def _unknown(self, word: str) -> NoReturn:
        """Say that there is no such option, and which one is near."""
        known = [name for name in self._option_string_actions if name.startswith("--")]
        near = [name for name in known if name.startswith(word)]
        near = near or difflib.get_close_matches(word, known, 1)
        self.error(f"no option {word}{f'; did you mean {near[0]}?' if near else ''}")

    def error(self, message: str) -> NoReturn:
        """End with status 2."""
        said = " ".join(message.split())
        self.exit(2, f"{self.prog}: {said}; see '{self.prog} --help'\n")

    def option(self, name: str, metavar: str, text: str, **more: Any) -> None:
        """Add an option, or an argument, that takes a value; ``text`` is its help."""
        self.add_argument(name, metavar=metavar, help=text, **more)

    def flag(self, name: str, text: str) -> None:
        """Add an option without a value; ``text`` is its help."""
        self.add_argument(name, action="store_true", help=text)

    def format_help(self) -> str:
        """Return the help."""
        self._filled()
        return super().format_help()


def _joined(args: Sequence[str]) -> list[str]:
    """Join an option and a value that argparse takes for another one: ``--at -1,0.5``, ``-inf``."""
    found: list[str] = []
    for text in args:
        if found and found[-1].startswith("--") and re.match(r"-(inf$|\.?\d[^ ]*,)", text):
            found[-1] += "=" + text
        else:
            found.append(text)
    return found


def add_command(
    commands: Subcommands,
    name: str,
    text: str,
    fill: Callable[[OneLineParser], None],
    examples: Sequence[str],
) -> None:
    """Add a command: what it does in a phrase, its options, and examples of its use."""
    described = f"{text[0].upper()}{text[1:]}."
    commands.add_parser(name, help=text, description=described, fill=fill, examples=examples)


def add_files(command: OneLineParser, *, out: str = "", json: str) -> None:
    """Add ``--json``, and ``--out`` with ``--overwrite`` where ``out`` says what goes there."""
    if out:
        command.option("--out", "DIR", out, type=path, required=True)
        command.flag("--overwrite", OVERWRITE_HELP)
    command.option("--json", "FILE", json, type=path)


def add_radar(command: OneLineParser, text: str, *, default: str | None = None) -> None:
    """Add the radar, and the board of its .cfg file."""
    command.option("--radar", "NAME|TOML|CFG", text, default=default)
    command.option(
        "--board",
        "NAME",
        "preset whose antennas are those of a .cfg file (default: the one that the file names)",
    )


def add_pose(command: OneLineParser) -> None:
    """Add where the radar is and how it is turned."""
    command.option(
        "--radar-position",
        "X,Y,Z",
        "position of the radar [m] (default: the scene's, else the radar's own)",
        type=place_in_space,
    )
    for name, how in (("yaw", "to the left"), ("pitch", "up"), ("roll", "anticlockwise")):
        command.option(
            f"--{name}",
            "DEGREES",
            f"angle by which the radar is turned {how} (default: the scene's, else its own)",
            type=number,
        )


def add_reading(command: OneLineParser) -> None:
    """Add what may be said of a recording whose file does not say it."""
    command.option(
        "--up",
        "AXIS",
        f"axis of recordings that is up: {', '.join(UPWARD)} (default: found from who stands)",
        type=axis,
    )
    command.option(
        "--unit",
        "NAME|X",
        f"length unit of recordings: {', '.join(UNITS_M)}, or metres (default: the file's, or "
        "found from the person's stature)",
        type=unit,
    )
    command.option(
        "--rate",
        "HZ",
        "frames a second of recordings (default: the file's; 120 of an .amc)",
        type=rate,
    )


def say(options: argparse.Namespace, text: str) -> None:
    """Print a result, unless ``--quiet`` asks for errors only."""
    if not options.quiet:
        print(text)


def show_page(page: Path) -> None:
    """Open a page in the browser, or say that there is none."""
    import webbrowser

    if not webbrowser.open(page.resolve().as_uri()):
        print("no browser was found here; open the page by hand", file=sys.stderr)


QUIET_HELP = "print nothing but errors: no progress, no warnings, no results"
OVERWRITE_HELP = "replace files of others that have the names of new ones"


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
