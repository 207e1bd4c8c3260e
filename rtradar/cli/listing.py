"""``rtradar list``: what can be chosen by name, each with a line of its own words."""

from __future__ import annotations

import argparse
import inspect
import shutil
import textwrap
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from rtradar.cli.values import add_command, add_files
from rtradar.errors import ExtensionError
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import OneLineParser, Subcommands
    from rtradar.system.registry import Registry

Described = Iterator[tuple[str, str]]
"""Names, each with its description."""


def add(commands: Subcommands) -> None:
    """Add the command."""
    add_command(
        commands,
        "list",
        "list the scenes, radars, materials, fidelity levels, detectors or activities by name",
        _add_list,
        ("rtradar list scenes", "rtradar list fidelities --json levels.json"),
    )


def _add_list(command: OneLineParser) -> None:
    lists = command.commands("KIND")
    for kind, (text, _) in _KINDS.items():
        add_command(lists, kind, text, _add_kind, (f"rtradar list {kind}",))
        lists.choices[kind].set_defaults(kind=kind)


def _add_kind(kind: OneLineParser) -> None:
    add_files(kind, json="write names and descriptions there as JSON")
    kind.set_defaults(command=_list)


def _list(options: argparse.Namespace) -> int:
    check_place(options.json)
    found = dict(_KINDS[options.kind][1]())
    if options.json is not None:
        rows = [{"name": name, "description": text} for name, text in found.items()]
        write_json(options.json, {options.kind: rows})
    width = max(map(len, found)) + 2
    columns = max(shutil.get_terminal_size().columns, width + 40)
    for name, text in found.items():
        lines = textwrap.wrap(text, columns - width, break_on_hyphens=False) or [""]
        print(name.ljust(width) + f"\n{' ' * width}".join(lines))
    return 0


def _scenes() -> Described:
    from rtradar.scene import Scene
    from rtradar.system.registries import scene_files

    for name in scene_files():
        yield name, Scene.load(name).description


def _radars() -> Described:
    from rtradar.radar import Radar
    from rtradar.radar.display import brief_rows
    from rtradar.system.registries import RADARS

    for name in RADARS:
        try:
            rows = brief_rows(Radar.preset(name))
        except ExtensionError as error:
            yield name, str(error)
        else:
            shown = ("sweep", "channels", "range", "velocity")
            yield name, "; ".join(f"{label} {rows[label]}" for label in shown)


def _materials() -> Described:
    from rtradar.scene import MATERIALS

    for name, material in MATERIALS.items():
        bands = " and ".join(
            f"{band.low_hz / 1e9:g} to {band.high_hz / 1e9:g} GHz" for band in material.bands
        )
        yield name, f"from {bands.replace('to inf GHz', 'GHz on')} ({material.source})"


def _fidelities() -> Described:
    from rtradar.system.registries import MODELS

    return _documented(MODELS)


def _detectors() -> Described:
    from rtradar.system.registries import DETECTORS

    return _documented(DETECTORS)


def _activities() -> Described:
    from rtradar.motion.synthetic import ACTIVITIES, STYLES

    for name, function in ACTIVITIES.items():
        first = (inspect.getdoc(function) or "").partition("\n\n")[0]
        styles = f" Styles: {', '.join(STYLES[name])}." if name in STYLES else ""
        yield name, " ".join(first.split()) + styles


def _documented(registry: Registry) -> Described:
    """Describe functions and classes by the first paragraph of their docstrings."""
    for name in registry:
        try:
            first = (inspect.getdoc(registry[name]) or "").partition("\n\n")[0]
        except ExtensionError as error:
            first = str(error)
        yield name, " ".join(first.split()).removeprefix(f"`{name}`: ").replace("`", "")


_KINDS: dict[str, tuple[str, Callable[[], Described]]] = {
    "scenes": ("list the scenes that come with rtradar, for --scene", _scenes),
    "radars": ("list the radars that have a name, for --radar", _radars),
    "materials": ("list the materials of walls, furniture and bodies", _materials),
    "fidelities": ("list the echo models, cheapest first, for --fidelity", _fidelities),
    "detectors": ("list the detectors, for --detector", _detectors),
    "activities": ("list what synthetic actors do, for synthetic:NAME", _activities),
}
"""What can be listed: its help text, and the function that gives the names."""
