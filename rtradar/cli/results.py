"""``rtradar view``: the results of a run, to look at."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rtradar.cli.values import show_page
from rtradar.errors import InputError


def view(options: argparse.Namespace) -> Mapping[str, Any]:
    """Do ``rtradar view``."""
    if options.time is not None and options.still is None:
        raise InputError("--time: it is of a still; give --still FILE.png too, or leave it out")
    from rtradar.pipeline.output import view as views

    page = options.out or (None if options.still else _own_page(options.folder))
    shown = views.view(
        options.folder, page=page, still=options.still, time_s=options.time, colour=options.colour
    )
    for kind in ("page", "still"):
        if kind in shown:
            verb = "open" if kind == "page" else "see"
            print(f"{verb} {shown[kind]['path']} ({shown[kind]['bytes'] / 1e6:.1f} MB)")
    if page is not None and options.out is None and not options.no_browser:
        show_page(page)
    return shown


def _own_page(folder: Path) -> Path:
    """Return the default place of the page; InputError if a file of others is there."""
    from rtradar.report.pages.html import is_page

    page = folder / "view.html"
    if os.path.lexists(page) and not is_page(page):
        raise InputError(
            f"'{page}' is there, and no page of rtradar view; name another file (--out)"
        )
    return page
