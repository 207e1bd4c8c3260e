"""What shows names, files and runs, and examines rtradar itself.

``rtradar list``, ``inspect`` and ``view``: what can be chosen, what a file means, what a run is.
``rtradar doctor``, ``validate``, ``bench`` and ``paper``: does it work, is it right, how fast.
"""

from __future__ import annotations

import argparse
import dataclasses
import inspect
import os
import shutil
import textwrap
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from rtradar.cli.values import say, show_page
from rtradar.errors import ExtensionError, InputError
from rtradar.system.checks import read_toml
from rtradar.system.registries import DETECTORS, MODELS, RADARS, READERS, Registry, scene_files

Described = Iterator[tuple[str, str]]
"""Names, each with its description."""


def list_names(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar list``."""
    found = dict(KINDS[options.kind]())
    yield {options.kind: [{"name": name, "description": text} for name, text in found.items()]}
    # Descriptions are wrapped in a column that fits the terminal.
    width = max(map(len, found)) + 2
    columns = max(shutil.get_terminal_size().columns, width + 40)
    for name, text in found.items():
        lines = textwrap.wrap(text, columns - width, break_on_hyphens=False) or [""]
        print(name.ljust(width) + f"\n{' ' * width}".join(lines))


def _scenes() -> Described:
    from rtradar.scene import Scene

    for name in scene_files():
        yield name, Scene.load(name).description


def _radars() -> Described:
    from rtradar.radar import Radar
    from rtradar.radar.display import brief_rows

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


def _activities() -> Described:
    from rtradar.motion.synthetic import ACTIVITIES
    from rtradar.motion.synthetic.figure import STYLES

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
    "fidelities": lambda: _documented(MODELS),
    "detectors": lambda: _documented(DETECTORS),
    "activities": _activities,
}
"""What can be listed, and the function that gives the names."""


_OF_RADARS = ("range_bin_m", "max_range_m", "velocity_bin_mps", "max_velocity_mps", "n_tx", "n_rx")


def inspect_file(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar inspect``."""
    file = Path(options.file)
    # Warnings are part of what was found, and are shown with the rest.
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        kind, found, text = _look(file, options)
    said = [str(warning.message) for warning in caught]
    yield {"file": str(file), "kind": kind, **found, "warnings": said}
    print("\n".join([text, *(f"warning: {line}" for line in said)]))


def _look(file: Path, options: argparse.Namespace) -> tuple[str, dict[str, Any], str]:
    """Return the kind of a file, values of what was found, and text about it."""
    suffix = file.suffix.lower()
    if suffix in (".cfg", ".toml"):
        return _described(file, options)
    if suffix.removeprefix(".") not in READERS:
        from rtradar.exchange import IF_FORMATS

        if suffix in IF_FORMATS:
            return _samples(file, options)
    return _motion(file, options)


def _described(file: Path, options: argparse.Namespace) -> tuple[str, dict[str, Any], str]:
    """Look at a radar or a scene, of which a radar has fields beside its name."""
    from rtradar.radar import Radar

    fields = {field.name for field in dataclasses.fields(Radar)} - {"name"} | {"base", "board"}
    if file.suffix.lower() == ".cfg" or fields & read_toml(file, "file", "check the path").keys():
        radar = Radar.load(file, board=options.board)
        values = {name: getattr(radar, name) for name in _OF_RADARS}
        return "radar", {"name": radar.name, **values}, repr(radar)
    from rtradar.scene import Scene

    scene = Scene.load(file)
    counts = {n: len(getattr(scene, n)) for n in ("walls", "furniture", "objects", "people")}
    return "scene", {"name": scene.name, **counts}, repr(scene)


def _samples(file: Path, options: argparse.Namespace) -> tuple[str, dict[str, Any], str]:
    from rtradar.exchange import open_samples
    from rtradar.radar import Radar

    given = None if options.radar is None else Radar.load(options.radar, board=options.board)
    samples = open_samples(file, given)
    chirps, rx, of_chirp = samples.shape
    radar = None if samples.radar is None else samples.radar.name
    tx = "" if samples.tx_per_cycle is None else f", {samples.tx_per_cycle} Tx a cycle"
    whose = "which does not tell of its radar (--radar)" if radar is None else f"of radar {radar}"
    text = f"IF samples {whose}: {chirps} chirps, {rx} Rx, {of_chirp} samples a chirp{tx}"
    found = {"radar": radar, "chirps": chirps, "rx": rx, "samples_per_chirp": of_chirp}
    return "samples", found | {"tx_per_cycle": samples.tx_per_cycle, "unit": samples.unit}, text


def _motion(file: Path, options: argparse.Namespace) -> tuple[str, dict[str, Any], str]:
    from rtradar.motion import load_motion
    from rtradar.motion.skeleton import to_nodes

    motion = load_motion(
        file, options.skeleton, up=options.up, unit=options.unit, rate_hz=options.rate
    )
    to_nodes(motion)  # which names a joint that lacks
    found: dict[str, Any] = {one.name: one.value for one in motion.findings}
    found |= {"frames": len(motion.root_positions), "duration_s": motion.duration_s}
    found["joints"] = list(motion.joints)
    lines = [f"  {one.text}" for one in motion.findings]
    return "motion", found, "\n".join([repr(motion).rstrip(), *lines])


def view(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar view``."""
    if options.time is not None and options.still is None:
        raise InputError("--time: it is of a still; give --still FILE.png too, or leave it out")
    from rtradar.pipeline.output import view as views

    # A page is written into the folder of the run, unless only a still is asked for.
    page = options.out or (None if options.still else _own_page(options.folder))
    shown = views.view(
        options.folder, page=page, still=options.still, time_s=options.time, colour=options.colour
    )
    yield shown
    for kind in ("page", "still"):
        if kind in shown:
            verb = "open" if kind == "page" else "see"
            print(f"{verb} {shown[kind]['path']} ({shown[kind]['bytes'] / 1e6:.1f} MB)")
    if page is not None and options.out is None and not options.no_browser:
        show_page(page)


def _own_page(folder: Path) -> Path:
    """Return the default place of the page; InputError if a file of others is there."""
    from rtradar.report.html import is_page

    page = folder / "view.html"
    if os.path.lexists(page) and not is_page(page):
        raise InputError(
            f"'{page}' is there, and no page of rtradar view; name another file (--out)"
        )
    return page


# -- rtradar itself --------------------------------------------------------------------------------


def doctor(options: argparse.Namespace) -> int:
    """Do ``rtradar doctor``."""
    from rtradar.doctor import report

    return report(options.json)


def validate(options: argparse.Namespace) -> int:
    """Do ``rtradar validate``."""
    from rtradar import validate as claims

    return claims.validate(
        quick=options.quick,
        only=options.only,
        json_path=options.json,
        figures=options.figure,
        readme=options.readme,
    )


def bench(options: argparse.Namespace) -> int:
    """Do ``rtradar bench``."""
    from rtradar import bench as measured

    plan = measured.plan_of(
        quick=options.quick,
        radars=options.radar,
        fidelities=options.fidelity,
        repeats=options.repeats,
        duration_s=options.duration,
        parts=None if options.only is None else (options.only,),
    )
    return measured.bench(plan, json_path=options.json, figure=options.figure)


def paper(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar paper``."""
    if options.mocap is not None and not options.mocap.is_dir():
        raise InputError(f"--mocap {options.mocap}: it is no folder; give that of the recordings")
    from rtradar.paper import make_paper

    content = make_paper(
        options.out,
        quick=options.quick,
        full=options.full,
        mocap=options.mocap,
        overwrite=options.overwrite,
    )
    yield content
    seconds = sum(part["wall_s"] for part in content["parts"].values())
    say(options, f"{len(content['items'])} items of the paper, measured in {seconds:.0f} s")
    page = options.out / "paper.html"
    say(options, f"open {page}")
    if options.open:
        show_page(page)
