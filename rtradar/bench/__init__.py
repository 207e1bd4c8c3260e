"""``rtradar bench``: what every stage takes and the whole, beside other models, the paper's method and floors measured here."""

from __future__ import annotations

import os
import platform
import sys
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rtradar.bench.figure import draw
from rtradar.bench.growth import with_channels, with_duration, with_echoes
from rtradar.bench.kernels import measure_kernels
from rtradar.bench.paper import Baseline, measure_baseline
from rtradar.bench.plan import CHEAPEST, Plan, model_cases, plan_of
from rtradar.bench.rates import measure_rates
from rtradar.bench.rows import chirp_rows, model_row
from rtradar.bench.runs import MOTION, RunError, Runner, can_pin
from rtradar.bench.tables import tables
from rtradar.radar import Radar
from rtradar.system.files import atomic_file, check_place, temporary_folder, write_json

__all__ = ["Plan", "bench", "plan_of"]

_VERSIONS = ("rtradar", "mitsuba", "drjit", "numpy", "scipy", "numba")


def bench(plan: Plan, *, json_path: Path | None = None, figure: Path | None = None) -> int:
    """Measure, print the tables, and return the exit status.

    Parameters
    ----------
    plan : Plan
    json_path : path, optional
        All that was measured is written there.
    figure : path, optional
        A picture of it is drawn there, as PNG.

    Returns
    -------
    int
        0, or 1 where a run fails.

    Raises
    ------
    InputError
        Where a file cannot be written; nothing has run then.
    """
    for option, path in (("--json", json_path), ("--figure", figure)):
        check_place(path, option)
    try:
        found = measure(plan)
    except RunError as error:
        print(f"rtradar: {error}", file=sys.stderr)
        return 1
    print(tables(found))
    if json_path is not None:
        write_json(json_path, found)
    if figure is not None:
        with atomic_file(figure) as file:
            draw(found, file)
    return 0


def measure(plan: Plan) -> dict[str, Any]:
    """Measure all that the plan asks for, and give it as plain values.

    Returns
    -------
    dict
        With keys ``settings``, ``machine``, ``rates``, ``models``, ``paper``, ``growth`` and
        ``kernels``.

    Raises
    ------
    RunError
        Where a run fails.
    """
    found: dict[str, Any] = {
        "settings": asdict(plan) | {"motion": MOTION},
        "machine": {
            "system": platform.platform(),
            "cores": os.cpu_count(),
            "versions": {"python": platform.python_version()}
            | {name: version(name) for name in _VERSIONS},
        },
        "rates": {},
        "models": [],
        "paper": {"trouble": "", "radars": {}},
        "growth": {
            "fidelity": plan.growing_fidelity,
            "chirps": [],
            "duration": [],
            "channels": [],
            "echoes": [],
        },
        "kernels": measure_kernels() if "kernels" in plan.parts else [],
    }
    with temporary_folder("rtradar-bench-") as folder:
        runner = Runner(folder)
        if "models" in plan.parts:
            _measure_models(plan, runner, found)
        if "growth" in plan.parts:
            found["growth"]["duration"] = with_duration(plan, runner)
            found["growth"]["channels"] = with_channels(plan, runner, folder)
            found["growth"]["echoes"] = with_echoes(Radar.load(plan.radars[0]))
    return found


def _measure_models(plan: Plan, runner: Runner, found: dict[str, Any]) -> None:
    rates = {radar: measure_rates(Radar.load(radar)) for radar in plan.radars}
    baselines: dict[str, Baseline | None] = {
        radar: measure_baseline(radar, plan.repeats, quick=plan.quick) for radar in plan.radars
    }
    runs = runner.measure(model_cases(plan, one_core=can_pin()), plan.repeats, "models")
    cheapest = {
        case.radar: own
        for case, own in runs.items()
        if case.fidelity == CHEAPEST and not case.one_core
    }
    found["models"] = [
        model_row(
            case,
            own,
            first=runner.first[case.fidelity]
            if case.radar == plan.radars[0] and not case.one_core
            else None,
            cheapest=None if case.one_core else cheapest.get(case.radar),
            rates=rates[case.radar],
            baseline=baselines[case.radar],
        )
        for case, own in runs.items()
    ]
    found["rates"] = {Radar.load(radar).name: asdict(own) for radar, own in rates.items()}
    known = {
        Radar.load(radar).name: asdict(own) for radar, own in baselines.items() if own is not None
    }
    trouble = (
        ""
        if known
        else "there is no paper_numpy.py among the validation scripts; use a checkout, or install rtradar again"
    )
    found["paper"] = {"trouble": trouble, "radars": known}
    found["growth"]["chirps"] = chirp_rows(found["models"])
