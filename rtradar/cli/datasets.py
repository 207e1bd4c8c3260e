"""``rtradar dataset``: labelled clouds of many recordings."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from rtradar.cli.values import OneLineParser, count, path
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import Subcommands


def add(commands: Subcommands) -> None:
    """Add the command."""
    dataset = commands.add_parser(
        "dataset", help="labelled point clouds of many recordings, radars, scenes and fidelities"
    )
    build = dataset.add_subparsers(
        required=True, metavar="COMMAND", parser_class=OneLineParser
    ).add_parser(
        "build",
        help="make the samples of a collection that are missing or damaged; started again it goes on",
    )
    build.add_argument(
        "spec", type=path, metavar="SPEC.toml", help="what the collection shall hold"
    )
    build.add_argument(
        "--out", type=path, required=True, metavar="DIR", help="folder of the collection"
    )
    build.add_argument(
        "--plan",
        action="store_true",
        help="make a sample of each kind, and say how long the others will take",
    )
    place = build.add_mutually_exclusive_group()
    place.add_argument(
        "--workers",
        type=count,
        metavar="N",
        help="processes that share the cores (default: one a core)",
    )
    place.add_argument(
        "--scheduler", metavar="ADDRESS", help="a Dask scheduler to use, such as tcp://host:8786"
    )
    build.add_argument(
        "--json", type=path, metavar="FILE", help="write what was made there as JSON"
    )
    build.set_defaults(
        command=_dataset_build,
        stopped="the same command goes on with the samples that '{out}' has not yet",
    )


def _dataset_build(options: argparse.Namespace) -> int:
    check_place(options.json)
    from rtradar.campaign import build_dataset, in_words

    report = build_dataset(
        options.spec,
        options.out,
        plan_only=options.plan,
        workers=options.workers,
        scheduler=options.scheduler,
    )
    if options.json is not None:
        write_json(options.json, report)
    print(in_words(report))
    print(f"see {options.out}")
    return 0
