"""``rtradar list``: what can be chosen by name, each with a line of its own words."""

from __future__ import annotations

import argparse
import inspect
import shutil
import textwrap
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from rtradar.errors import ExtensionError

if TYPE_CHECKING:
    from rtradar.system.registry import Registry

Described = Iterator[tuple[str, str]]
"""Names, each with its description."""


def show(options: argparse.Namespace) -> Mapping[str, Any]:
    """Do ``rtradar list``."""
    found = dict(KINDS[options.kind]())
    width = max(map(len, found)) + 2
    columns = max(shutil.get_terminal_size().columns, width + 40)
    for name, text in found.items():
        lines = textwrap.wrap(text, columns - width, break_on_hyphens=False) or [""]
        print(name.ljust(width) + f"\n{' ' * width}".join(lines))
    rows = [{"name": name, "description": text} for name, text in found.items()]
    return {options.kind: rows}


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


KINDS: Mapping[str, Callable[[], Described]] = {
    "scenes": _scenes,
    "radars": _radars,
    "materials": _materials,
    "fidelities": _fidelities,
    "detectors": _detectors,
    "activities": _activities,
}
"""What can be listed, and the function that gives the names."""
