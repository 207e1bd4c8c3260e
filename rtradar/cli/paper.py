"""``rtradar paper``: the paper that this package stands on, item by item, beside ours."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from rtradar.cli.values import QUIET_HELP, add_command, add_files, path, say, show_page
from rtradar.errors import InputError
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import OneLineParser, Subcommands


def add(commands: Subcommands) -> None:
    """Add the command."""
    add_command(
        commands,
        "paper",
        "put every figure, table, equation and number of the paper beside ours; may be run again",
        _add_paper,
        (
            "rtradar paper --out out/paper --quick",
            "rtradar paper --out out/paper --mocap HDM05",
        ),
    )


def _add_paper(paper: OneLineParser) -> None:
    amount = paper.add_mutually_exclusive_group()
    amount.add_argument(
        "--quick", action="store_true", help="measure table 3 and 77 GHz with fewer cases"
    )
    amount.add_argument(
        "--full",
        action="store_true",
        help="train for table 4 anew, for about 18 hours, in place of the stored result",
    )
    paper.option(
        "--mocap",
        "FOLDER",
        "recordings of HDM05 (HDM_*.amc and .asf), such as the paper's four (default: synthetic "
        "actors)",
        type=path,
    )
    add_files(paper, out="folder for page, figures and numbers", json="write the numbers there too")
    paper.flag("--open", "open the page in the browser")
    paper.flag("--quiet", QUIET_HELP)
    paper.set_defaults(
        command=_paper, stopped="the same command goes on with what '{out}' has not yet"
    )


def _paper(options: argparse.Namespace) -> int:
    check_place(options.json)
    if options.mocap is not None and not options.mocap.is_dir():
        raise InputError(f"--mocap {options.mocap}: it is no folder; give that of the recordings")
    from rtradar.paper.make import make_paper

    content = make_paper(
        options.out,
        quick=options.quick,
        full=options.full,
        mocap=options.mocap,
        overwrite=options.overwrite,
    )
    if options.json is not None:
        write_json(options.json, content)
    seconds = sum(part["wall_s"] for part in content["parts"].values())
    say(options, f"{len(content['items'])} items of the paper, measured in {seconds:.0f} s")
    page = options.out / "paper.html"
    say(options, f"open {page}")
    if options.open:
        show_page(page)
    return 0
