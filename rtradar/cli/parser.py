"""Parser of the command line, made from the table of commands and the settings of a run."""

from __future__ import annotations

import argparse
import difflib
import itertools
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from rtradar.cli import values
from rtradar.recordings import ACTOR_S, UNITS_M, UPWARD
from rtradar.system.registries import DETECTORS, MODELS, RADARS, scene_files

if TYPE_CHECKING:
    # argparse gives it no public name.
    Subcommands = argparse._SubParsersAction["OneLineParser"]

_CHOICES: Mapping[str, Callable[[], Sequence[str]]] = {
    "{radars}": lambda: list(RADARS),
    "{scenes}": lambda: list(scene_files()),
    "{axes}": lambda: UPWARD,
    "{units}": lambda: list(UNITS_M),
}
"""What the help of options lists."""

_TYPES: Mapping[str | None, Callable[[str], Any]] = {
    "S": values.seconds,
    "N": values.whole,
    "X": values.number,
    "DEG": values.number,
    "X|inf|physical": values.decibels,
    "X|-inf": values.decibels_below,
    "NAME[:X]": values.window,
    "AMPLITUDE_MM,RATE_HZ": values.breathing,
}
"""How the value of a setting is read, by what stands for it in the help."""

_NAMED = {"fidelity": ("echo model", MODELS), "detector": ("detector", DETECTORS)}


class OneLineParser(argparse.ArgumentParser):
    """Argument parser that reports an error in one line, and knows its options only once asked.

    Parameters
    ----------
    table : mapping
        What ``commands.toml`` says of its command, whose options are added before it parses or
        shows its help. Only the command that is typed pays for its options.
    examples : sequence of str
        Command lines that the help shows at its end.
    **options
        What `argparse.ArgumentParser` takes.
    """

    def __init__(
        self, *, table: Mapping[str, Any] = {}, examples: Sequence[str] = (), **options: Any
    ) -> None:
        self._table, self._intermixed = table, table.get("intermixed", False)
        if examples:
            options["epilog"] = "\n  ".join(["examples:", *examples])
        # The beginning of an option is none: "--snr" might as well be another one tomorrow.
        options |= {"allow_abbrev": False}
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **options)

    def add_commands(self, table: Mapping[str, Mapping[str, Any]], metavar: str) -> None:
        """Add commands; without a command, the help is shown."""
        self.set_defaults(command=lambda _: self.print_help())
        commands = self.add_subparsers(metavar=metavar, parser_class=OneLineParser)
        for name, own in table.items():
            text = own["help"]
            described = f"{text[0].upper()}{text[1:]}."
            more = {"help": text, "description": described, "examples": own.get("examples", ())}
            commands.add_parser(name, table=own, **more)

    def _filled(self) -> None:
        # The table is emptied first, so that a second call adds nothing twice.
        table, self._table = self._table, {}
        for group in table.get("uses", ()):
            self._add(_definitions()["shared"][group])
        if "settings" in table:
            self._add_settings(table["settings"], table.get("without", ()))
        self._add(table.get("options", {}))
        if "commands" in table:
            self.add_commands(table["commands"], table.get("metavar", "COMMAND"))
        if "does" in table:
            module, _, name = table["does"].partition(":")
            self.set_defaults(command=partial(_call, module, name), **table.get("set", {}))
        if "stopped" in table:
            self.set_defaults(stopped=table["stopped"])

    def _add(self, options: Mapping[str, Mapping[str, Any]]) -> None:
        """Add options of a table; one that has nothing but a help is a flag."""
        groups: dict[str, Any] = {}
        for name, own in options.items():
            # Two keys are ours and unknown to argparse: groups of options that exclude each other,
            # and options that leave no trace if they are not given.
            how = dict(own)
            either, unset = how.pop("either", None), how.pop("unset", False)
            for word, listed in _CHOICES.items():
                if word in how["help"]:
                    how["help"] = how["help"].replace(word, ", ".join(listed()))
            if "type" in how:
                how["type"] = getattr(values, how["type"])
            if how.keys() == {"help"} and name.startswith("--"):
                how["action"] = "store_true"
            if unset:
                how["default"] = argparse.SUPPRESS
            if either is not None and either not in groups:
                groups[either] = self.add_mutually_exclusive_group()
            groups.get(either, self).add_argument(name, **how)

    def _add_settings(self, options: str, without: Sequence[str]) -> None:
        """Add the options of those settings that a class of options has."""
        from rtradar import settings
        from rtradar.system.fields import Limits, annotations_of, found_in

        # A setting's type, default and text are those of `RunSettings` and settings.toml.
        usual, taken = settings.RunSettings(), getattr(settings, options).__annotations__
        hints = annotations_of(settings.RunSettings)
        for name, said in settings.setting_texts().items():
            if name not in taken or name in without or not said.get("option", True):
                continue
            limits, metavar = found_in(hints[name], Limits), said.get("value")
            default = getattr(usual, name)
            text = re.split(r"\.(?:\s|$)", said["text"])[0].replace("`", "")
            if name in _NAMED:
                noun, registry = _NAMED[name]
                text = f"{noun}: {', '.join(registry)}"
            # What is not given is left to the run file.
            how: dict[str, Any] = {"default": argparse.SUPPRESS, "dest": f"settings.{name}"}
            if default is False:
                how["action"] = "store_true"
            else:
                to_end = f"to the end; synthetic: {ACTOR_S:g}"
                text += f" (default: {to_end if name == 'duration_s' else default})"
                how |= {"metavar": metavar, "type": _TYPES.get(metavar)}
                how["choices"] = limits.allowed if limits and limits.allowed else None
            flag = name.removesuffix("_s").removesuffix("_deg").replace("_", "-")
            self.add_argument(f"--{flag}", help=text, **how)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse the arguments that are known, with options among the others where that is meant."""
        self._filled()
        if args is not None:
            args = _joined(args)
            if self._subparsers is None:
                self._refuse_unknown(args)
        if self._intermixed:
            self._intermixed = False  # for it calls this method
            return self.parse_known_intermixed_args(args, namespace)
        return super().parse_known_args(args, namespace)

    def _refuse_unknown(self, args: Sequence[str]) -> None:
        """Refuse the first option that is none, before anything else is missed."""
        for word in itertools.takewhile(lambda word: word != "--", args):
            name = word.partition("=")[0]
            if name.startswith("--") and name not in self._option_string_actions:
                known = [one for one in self._option_string_actions if one.startswith("--")]
                # The suggestion is an option that begins like the word, or else one that is spelt
                # alike.
                near = [one for one in known if one.startswith(name)]
                near = near or difflib.get_close_matches(name, known, 1)
                self.error(f"no option {name}{f'; did you mean {near[0]}?' if near else ''}")

    def error(self, message: str) -> NoReturn:
        """End with status 2."""
        said = " ".join(message.split())
        self.exit(2, f"{self.prog}: {said}; see '{self.prog} --help'\n")

    def format_help(self) -> str:
        """Return the help."""
        self._filled()
        return super().format_help()


def parser() -> OneLineParser:
    """Return the parser of the command line."""
    from rtradar import __version__

    made = OneLineParser(
        prog="rtradar",
        description="From motion capture to what a 4D MIMO FMCW radar would receive, "
        "and to point clouds.",
        examples=(
            "rtradar run synthetic:walk --out out/walk       # then open out/walk/report.html",
            "rtradar run walk.bvh --scene living-room --out out/room",
            "rtradar view out/walk                           # the run over time, in the browser",
            "rtradar compare synthetic:kick --out out/kick   # several models beside each other",
            "rtradar COMMAND --help                          # options of a command, with examples",
        ),
    )
    made.add_argument("--version", action="version", version=f"rtradar {__version__}")
    commands = {name: own for name, own in _definitions().items() if name != "shared"}
    made.add_commands(commands, "COMMAND")
    return made


@cache
def _definitions() -> Mapping[str, Mapping[str, Any]]:
    """Return the table of commands."""
    return tomllib.loads(Path(__file__).with_name("commands.toml").read_text(encoding="utf-8"))


def _call(module: str, name: str, options: argparse.Namespace) -> Any:
    return getattr(import_module(f"rtradar.cli.{module}"), name)(options)


def _joined(args: Sequence[str]) -> list[str]:
    """Join an option and a value that argparse takes for another one: ``--at -1,0.5``, ``-inf``."""
    found: list[str] = []
    for text in args:
        if found and found[-1].startswith("--") and re.match(r"-(inf$|\.?\d[^ ]*,)", text):
            found[-1] += "=" + text
        else:
            found.append(text)
    return found
