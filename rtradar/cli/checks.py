"""``rtradar doctor``, ``validate`` and ``bench``: does it work, is it right, how fast is it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from rtradar.cli.values import path, seconds, whole
from rtradar.system.files import check_place

if TYPE_CHECKING:
    from rtradar.cli.values import Subcommands


def add(commands: Subcommands) -> None:
    """Add the three commands."""
    doctor = commands.add_parser(
        "doctor", help="which ray-tracing backends work on this machine, and what to install"
    )
    doctor.add_argument(
        "--json", type=path, metavar="FILE", help="write the findings there as JSON"
    )
    doctor.set_defaults(command=_doctor)

    validate = commands.add_parser(
        "validate", help="hold every claim against its reference; 1 where one fails"
    )
    validate.add_argument("--quick", action="store_true", help="fewer cases of each claim")
    validate.add_argument(
        "--only",
        metavar="NAME",
        help="one claim by its key (sphere, path, doppler, ...), or one script",
    )
    validate.add_argument("--json", type=path, metavar="FILE", help="write all rows there as JSON")
    validate.add_argument(
        "--figure", type=path, metavar="DIR", help="draw one picture a script there"
    )
    validate.add_argument(
        "--readme",
        type=path,
        metavar="FILE",
        help="replace the table of figures in this markdown file",
    )
    validate.set_defaults(command=_validate)

    bench = commands.add_parser(
        "bench",
        help="how long every stage takes, beside other models, the paper's method and floors",
    )
    bench.add_argument(
        "--radar",
        metavar="A,B,...",
        help="presets or TOML files (default: both presets; with --quick the first)",
    )
    bench.add_argument(
        "--fidelity",
        metavar="A,B,...",
        help="models (default: analytic-paper,analytic,specular,fresnel,physical-optics; "
        "with --quick without the last two)",
    )
    bench.add_argument(
        "--repeats",
        type=whole,
        metavar="N",
        help="repeats of each measurement (default: 3; with --quick 1)",
    )
    bench.add_argument(
        "--duration",
        type=seconds,
        metavar="S",
        help="length of the capture [s] (default: 3; with --quick 0.5)",
    )
    bench.add_argument(
        "--only",
        metavar="PART",
        help="models (with the paper's method and floors), growth, or kernels",
    )
    bench.add_argument("--quick", action="store_true", help="little of everything, in some minutes")
    bench.add_argument(
        "--json", type=path, metavar="FILE", help="write all that is measured there as JSON"
    )
    bench.add_argument("--figure", type=path, metavar="FILE", help="draw it there, as PNG")
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
        radar=options.radar,
        fidelity=options.fidelity,
        repeats=options.repeats,
        duration_s=options.duration,
        quick=options.quick,
        only=options.only,
    )
    return bench(plan, json_path=options.json, figure=options.figure)
