"""``rtradar view``: the results of a run, to look at."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from rtradar.cli.values import add_command, add_files, path, seconds, show_page, there
from rtradar.errors import InputError
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import OneLineParser, Subcommands


def add(commands: Subcommands) -> None:
    """Add the command."""
    add_command(
        commands,
        "view",
        "show body, room, paths, echoes, maps and cloud of a run over time, in the browser",
        _add_view,
        ("rtradar view out/walk", "rtradar view out/walk --still picture.png --time 1.2"),
    )


def _add_view(view: OneLineParser) -> None:
    view.option("folder", "DIR", "folder that 'rtradar run --out DIR' made", type=there)
    view.option(
        "--out",
        "FILE.html",
        "write the page there, and open nothing (default: DIR/view.html, opened)",
        type=path,
    )
    view.flag("--no-browser", "write the page, but do not open it")
    view.add_argument(
        "--colour",
        choices=("person", "part", "power", "velocity"),
        help="quantity that colours show at first (default: person of several, part of one)",
    )
    view.option(
        "--still", "FILE.png", "draw one snapshot; without --out there is no page then", type=path
    )
    view.option("--time", "S", "time of the still [s] (default: the middle)", type=seconds)
    add_files(view, json="write what was shown and written there")
    view.set_defaults(command=_view)


def _view(options: argparse.Namespace) -> int:
    check_place(options.json)
    if options.time is not None and options.still is None:
        raise InputError("--time: it is of a still; give --still FILE.png too, or leave it out")
    from rtradar.pipeline.output.view import view

    page = options.out or (None if options.still else _own_page(options.folder))
    shown = view(
        options.folder, page=page, still=options.still, time_s=options.time, colour=options.colour
    )
    if options.json is not None:
        write_json(options.json, shown)
    for kind in ("page", "still"):
        if kind in shown:
            verb = "open" if kind == "page" else "see"
            print(f"{verb} {shown[kind]['path']} ({shown[kind]['bytes'] / 1e6:.1f} MB)")
    if page is not None and options.out is None and not options.no_browser:
        show_page(page)
    return 0


def _own_page(folder: Path) -> Path:
    """Return the default place of the page; InputError if a file of others is there."""
    from rtradar.report.pages.html import is_page

    page = folder / "view.html"
    if os.path.lexists(page) and not is_page(page):
        raise InputError(
            f"'{page}' is there, and no page of rtradar view; name another file (--out)"
        )
    return page
