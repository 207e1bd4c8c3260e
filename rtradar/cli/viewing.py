"""``rtradar view``: what a run left, to look at."""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import TYPE_CHECKING

from rtradar.cli.values import path, seconds
from rtradar.errors import InputError
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import Subcommands


def add(commands: Subcommands) -> None:
    """Add the command."""
    view = commands.add_parser(
        "view", help="body, room, paths, echoes, maps and cloud of a run over time, in the browser"
    )
    view.add_argument("folder", type=path, metavar="DIR", help="what 'rtradar run --out DIR' left")
    view.add_argument(
        "--out",
        type=path,
        metavar="FILE.html",
        help="write the page there, and open nothing (default: DIR/view.html, opened)",
    )
    view.add_argument(
        "--no-browser", action="store_true", help="write the page, but do not open it"
    )
    view.add_argument(
        "--colour",
        choices=("part", "power", "velocity"),
        default="part",
        help="what colours mean at first (default: part)",
    )
    view.add_argument(
        "--still",
        type=path,
        metavar="FILE.png",
        help="draw one moment; without --out there is no page then",
    )
    view.add_argument(
        "--time", type=seconds, metavar="S", help="of the still [s] (default: the middle)"
    )
    view.add_argument(
        "--json", type=path, metavar="FILE", help="write what was shown and written there"
    )
    view.set_defaults(command=_view)


def _view(options: argparse.Namespace) -> int:
    check_place(options.json)
    if options.time is not None and options.still is None:
        raise InputError("--time: it is of a still; give --still FILE.png too, or leave it out")
    from rtradar.pipeline.view import view

    page = options.out or (None if options.still else _own_page(options.folder))
    told = view(
        options.folder, page=page, still=options.still, time_s=options.time, colour=options.colour
    )
    if options.json is not None:
        write_json(options.json, told)
    for kind in ("page", "still"):
        if kind in told:
            print(f"see {told[kind]['path']} ({told[kind]['bytes'] / 1e6:.1f} MB)")
    if page is not None and options.out is None and not options.no_browser:
        import webbrowser

        if not webbrowser.open(page.resolve().as_uri()):
            print("no browser was found here; open the page by hand")
    return 0


def _own_page(folder: Path) -> Path:
    """Where the page goes unless told otherwise; InputError where that would replace what rtradar did not write."""
    from rtradar.report.pages.html import is_page

    page = folder / "view.html"
    if os.path.lexists(page) and not is_page(page):
        raise InputError(
            f"'{page}' is there, and no page of rtradar view; name another file (--out)"
        )
    return page
