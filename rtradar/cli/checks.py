"""``rtradar doctor``, ``validate``, ``bench``, ``paper``: does it work, is it right, how fast."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from typing import Any

from rtradar.cli.values import say, show_page
from rtradar.errors import InputError


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
