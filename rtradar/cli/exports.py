"""``rtradar export``: what a run left, for other tools."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from rtradar.cli.values import path
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import Subcommands


def add(commands: Subcommands) -> None:
    """Add the command."""
    export = commands.add_parser(
        "export", help="IF samples for MATLAB, xarray or as int16, clouds as PLY or PCD"
    )
    export.add_argument(
        "source",
        type=path,
        metavar="SOURCE",
        help="folder of rtradar run --save-if, or a cloud: .npz, .ply or .pcd",
    )
    export.add_argument(
        "--out",
        type=path,
        required=True,
        metavar="FILE",
        help="its suffix says the format: .mat, .nc or .bin of IF samples; .ply, .pcd or .npz of a cloud",
    )
    export.add_argument(
        "--json", type=path, metavar="FILE", help="write there as JSON what was written"
    )
    export.set_defaults(command=_export)


def _export(options: argparse.Namespace) -> int:
    check_place(options.json)
    from rtradar.exchange import export

    said = export(options.source, options.out)
    if options.json is not None:
        write_json(options.json, said)
    lengths = ", ".join(
        f"{axis} {length}" for axis, length in zip(said["axes"], said["shape"], strict=False)
    )
    shown = (
        lengths
        if len(said["axes"]) == len(said["shape"])
        else f"{said['shape'][0]} points: {', '.join(said['axes'])}"
    )
    print(f"{shown}; {said['type']}; see {options.out}")
    return 0
