"""``rtradar doctor``, ``validate`` and ``bench``: does it work, is it right, how fast is it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from rtradar.cli.values import add_command, path, seconds, whole
from rtradar.system.files import check_place

if TYPE_CHECKING:
    from rtradar.cli.values import OneLineParser, Subcommands


def add(commands: Subcommands) -> None:
    """Add the three commands."""
    add_command(
        commands,
        "doctor",
        "say which ray-tracing backends work here and what to install",
        _add_doctor,
        ("rtradar doctor", "rtradar doctor --json doctor.json"),
    )
    add_command(
        commands,
        "validate",
        "hold every claim against its reference, with status 1 where one fails",
        _add_validate,
        ("rtradar validate --quick", "rtradar validate --only doppler --figure out/figures"),
    )
    add_command(
        commands,
        "bench",
        "measure the time of every stage, beside other models, the paper's method and bounds",
        _add_bench,
        ("rtradar bench --quick", "rtradar bench --only growth --json growth.json"),
    )


def _add_doctor(doctor: OneLineParser) -> None:
    doctor.option("--json", "FILE", "write the findings there as JSON", type=path)
    doctor.set_defaults(command=_doctor)


def _add_validate(validate: OneLineParser) -> None:
    validate.flag("--quick", "check fewer cases of each claim")
    validate.option(
        "--only", "NAME", "one claim by its key (sphere, path, doppler, ...), or one script"
    )
    validate.option("--json", "FILE", "write all rows there as JSON", type=path)
    validate.option("--figure", "DIR", "draw one picture a script there", type=path)
    validate.option(
        "--readme", "FILE", "replace the table of figures in this markdown file", type=path
    )
    validate.set_defaults(command=_validate)


def _add_bench(bench: OneLineParser) -> None:
    bench.option(
        "--radar",
        "A,B,...",
        "presets or TOML files (default: both presets; with --quick the first)",
    )
    bench.option(
        "--fidelity",
        "A,B,...",
        "models (default: analytic-paper,analytic,specular,physical-optics; "
        "with --quick without the last two)",
    )
    bench.option(
        "--repeats", "N", "repeats of each measurement (default: 3; with --quick 1)", type=whole
    )
    bench.option(
        "--duration", "S", "length of the capture [s] (default: 3; with --quick 0.5)", type=seconds
    )
    bench.option("--only", "PART", "models (with the paper's method and floors), or growth")
    bench.flag("--quick", "measure little of everything, in some minutes")
    bench.option("--json", "FILE", "write all that is measured there as JSON", type=path)
    bench.option("--figure", "FILE", "draw it there, as PNG", type=path)
    bench.set_defaults(command=_bench)


def _doctor(options: argparse.Namespace) -> int:
    check_place(options.json)
    from rtradar.doctor import report

    return report(options.json)


def _validate(options: argparse.Namespace) -> int:
    from rtradar.validate import validate

    return validate(
        quick=options.quick,
        only=options.only,
        json_path=options.json,
        figures=options.figure,
        readme=options.readme,
    )


def _bench(options: argparse.Namespace) -> int:
    from rtradar.bench import bench, plan_of

    plan = plan_of(
        quick=options.quick,
        radars=options.radar,
        fidelities=options.fidelity,
        repeats=options.repeats,
        duration_s=options.duration,
        parts=None if options.only is None else (options.only,),
    )
    return bench(plan, json_path=options.json, figure=options.figure)
