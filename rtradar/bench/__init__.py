"""``rtradar bench``: time of every stage, beside other models and the paper's method."""

from __future__ import annotations

import os
import platform
import sys
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from statistics import median
from typing import Any, BinaryIO

import numpy as np

from rtradar.bench.runs import (
    CHEAPEST,
    IF_STAGE,
    MOTION,
    Case,
    Run,
    RunError,
    Runner,
    by_stage,
    measure_baseline,
    paired_ratio,
    spread,
)
from rtradar.errors import InputError
from rtradar.pipeline.timing import NOT_TO_CLOUD
from rtradar.radar import Radar
from rtradar.scatter import MODELS
from rtradar.scatter.echo_models import affordable_models
from rtradar.system.figure_style import dress, new_figure, save_figure
from rtradar.system.files import atomic_file, check_place, temporary_folder, write_json
from rtradar.system.templates import aligned, templates

__all__ = ["Plan", "bench", "plan_of"]

Row = dict[str, Any]

PARTS = ("models", "growth")
"""Parts that may be measured alone: models with their baseline, and growth with the size of the
problem."""

_VERSIONS = ("rtradar", "mitsuba", "drjit", "numpy", "scipy", "numba")


@dataclass(frozen=True)
class Plan:
    """What to measure.

    Parameters
    ----------
    radars : tuple of str
        Presets or TOML files, the first for what is measured with one only: first use, growth.
    fidelities : tuple of str
        Names of models; by default those that take less than minutes for seconds of radar.
    repeats : int
        Number of runs of everything except the first use.
    duration_s : float
        Length of the capture [s].
    quick : bool
        Whether growth is shorter, and the baseline a part of a frame.
    parts : tuple of str
        Names from `PARTS` that are measured.

    Raises
    ------
    InputError
        Where a part, radar or model is unknown, a name is given twice, a number has no meaning, or
        the capture holds no frame.
    """

    radars: tuple[str, ...] = ("paper-12ghz", "paper-77ghz")
    fidelities: tuple[str, ...] = tuple(affordable_models(12.0))
    repeats: int = 3
    duration_s: float = 3.0
    quick: bool = False
    parts: tuple[str, ...] = PARTS

    def __post_init__(self) -> None:
        for option, names in (("--radar", self.radars), ("--fidelity", self.fidelities)):
            if not all(names) or len(set(names)) < len(names):
                raise InputError(f"{option} {','.join(names)}: name each once, with commas between")
        for name in self.fidelities:
            MODELS.check(name)
        for radar in map(Radar.load, self.radars):
            if self.duration_s < radar.frame_duration_s:
                raise InputError(
                    f"--duration {self.duration_s:g}: it holds no whole frame of radar "
                    f"'{radar.name}'; give at least {radar.frame_duration_s:g} s"
                )

    @property
    def growing_fidelity(self) -> str:
        """Model whose growth is measured: `specular`, or the last named."""
        return "specular" if "specular" in self.fidelities else self.fidelities[-1]

    @property
    def growing_durations_s(self) -> tuple[float, ...]:
        """Lengths of recording over which growth is measured [s]."""
        few = self.duration_s, 2 * self.duration_s
        return few if self.quick else (3.0, 6.0, 12.0, 30.0, 60.0)


def model_cases(plan: Plan) -> list[Case]:
    """Every model with every radar."""
    return [Case(one, own, plan.duration_s) for one in plan.radars for own in plan.fidelities]


def plan_of(*, quick: bool, **options: Any) -> Plan:
    """The plan of the options of the command line, by the names of `Plan`.

    Radars and models are separated by commas; None leaves a value to `Plan` or to ``quick``.
    InputError where `Plan` refuses a value.
    """
    given = {name: value for name, value in options.items() if value is not None}
    for name in given.keys() & {"radars", "fidelities"}:
        given[name] = tuple(one.strip() for one in given[name].split(","))
    # The models of a quick measurement: the paper's, the cheapest, and the one that runs take.
    models = ("analytic-paper", CHEAPEST, "specular")
    less = Plan(Plan.radars[:1], models, repeats=1, duration_s=0.5, quick=True)
    return replace(less if quick else Plan(), **given)


def bench(plan: Plan, *, json_path: Path | None = None, figure: Path | None = None) -> int:
    """Measure, print the tables, and return the exit status.

    Parameters
    ----------
    plan : Plan
        What is measured.
    json_path : path, optional
        File for all that was measured.
    figure : path, optional
        File for a picture of it, as PNG.

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

    The keys are ``settings``, ``machine``, ``models``, ``paper`` and ``growth``.
    `RunError` where a run fails.
    """
    versions = {"python": platform.python_version()} | {name: version(name) for name in _VERSIONS}
    found: dict[str, Any] = {
        "settings": asdict(plan) | {"motion": MOTION},
        "machine": {"system": platform.platform(), "cores": os.cpu_count(), "versions": versions},
        "models": [],
        "paper": {"trouble": "", "radars": {}},
        "growth": {"fidelity": plan.growing_fidelity, "chirps": [], "duration": []},
    }
    # The caches begin empty, so that the first use of each model is that of a new user.
    with temporary_folder("rtradar-bench-") as folder:
        runner = Runner(folder)
        if "models" in plan.parts:
            _measure_models(plan, runner, found)
        if "growth" in plan.parts:
            found["growth"]["duration"] = with_duration(plan, runner)
    return found


def _measure_models(plan: Plan, runner: Runner, found: dict[str, Any]) -> None:
    radars = {name: Radar.load(name) for name in plan.radars}
    baselines = {
        name: measure_baseline(name, plan.repeats, quick=plan.quick) for name in plan.radars
    }
    # The cases are run in turn, so that a slow minute of the machine affects all of them alike.
    runs = runner.measure(model_cases(plan), plan.repeats, "models")
    # Each model is compared with the cheapest one run by run, and with the method of the paper.
    cheapest = {case.radar: own for case, own in runs.items() if case.fidelity == CHEAPEST}
    for case, own in runs.items():
        row = _row(case, own, radars[case.radar])
        first = case.radar == plan.radars[0]
        row["first_use"] = _first_use(runner.first[case.fidelity], own) if first else None
        reference = cheapest.get(case.radar)
        row[f"over_{CHEAPEST}"] = reference and paired_ratio(
            [run.to_cloud_s for run in own], [run.to_cloud_s for run in reference]
        )
        row["paper_over"] = _paper_over(baselines[case.radar], radars[case.radar], row)
        found["models"].append(row)
    known = {radars[name].name: own for name, own in baselines.items() if own is not None}
    missing = "there is no paper_numpy.py among the validation scripts; use a checkout, or install "
    found["paper"] = {"trouble": "" if known else missing + "rtradar again", "radars": known}
    found["growth"]["chirps"] = _chirp_rows(found["models"])


def _row(case: Case, runs: list[Run], radar: Radar) -> Row:
    """What was measured of one model with one radar, without comparisons."""
    summary = runs[0].summary
    return {
        "radar": radar.name,
        "fidelity": case.fidelity,
        "duration_s": case.duration_s,
        "capture_s": summary["capture_s"],
        "chirps": summary["chirps"],
        "process_s": spread([run.process_s for run in runs]),
        "warmup_s": spread([run.summary["warmup_s"] for run in runs]),
        "to_cloud_s": spread([run.to_cloud_s for run in runs]),
        "whole_s": spread([run.whole_s for run in runs]),
        "peak_memory_mb": max(float(run.summary["peak_memory_mb"]) for run in runs),
        "stages": by_stage([run.stages for run in runs]),
    }


def _first_use(first: Run, runs: list[Run]) -> dict[str, float]:
    """What the first process of a model takes, with nothing compiled and no cache filled [s].

    ``adds_s`` is how much longer it takes from its start to the cloud than the later median.
    """
    later = median(run.from_start_to_cloud_s for run in runs)
    return {
        "adds_s": first.from_start_to_cloud_s - later,
        "process_s": first.process_s,
        "warmup_s": first.summary["warmup_s"],
    }


def _paper_over(baseline: Row | None, radar: Radar, row: Row) -> dict[str, float] | None:
    """How many times longer the paper's method takes for the same chirps: medians.

    ``to_cloud`` is all of it, which ends at detections, over ours, which goes on to the cloud;
    ``if`` echoes and IF alone.
    """
    if baseline is None:
        return None
    # The paper's method is timed per frame; this is how many frames the chirps would fill without
    # overlap.
    frames = row["chirps"] / radar.chirps_per_frame
    ours_if = sum(row["stages"][name]["median"] for name in ("scatter", "signal"))
    return {
        "to_cloud": frames * baseline["total"]["median"] / row["to_cloud_s"]["median"],
        "if": frames * baseline["stages"][IF_STAGE]["median"] / ours_if,
    }


def _chirp_rows(models: list[Row]) -> list[Row]:
    """Radars with more chirps than the first: each model's cost over its own with the first."""
    base = {row["fidelity"]: row for row in models if row["radar"] == models[0]["radar"]}
    pairs = ((row, base[row["fidelity"]]) for row in models)
    return [
        {
            "radar": row["radar"],
            "of_radar": of["radar"],
            "fidelity": row["fidelity"],
            "chirps": row["chirps"] / of["chirps"],
            "to_cloud": row["to_cloud_s"]["median"] / of["to_cloud_s"]["median"],
            "peak_memory": row["peak_memory_mb"] / of["peak_memory_mb"],
        }
        for row, of in pairs
        if row["radar"] != of["radar"]
    ]


def with_duration(plan: Plan, runner: Runner) -> list[Row]:
    """Runs of growing length, a row each."""
    fixed, radar = (plan.radars[0], plan.growing_fidelity), Radar.load(plan.radars[0])
    cases = [Case(*fixed, duration) for duration in plan.growing_durations_s]
    runs = runner.measure(cases, plan.repeats, "length")
    return [_row(case, own, radar) for case, own in runs.items()]


# -- tables and figure -----------------------------------------------------------------------------


def tables(found: dict[str, Any]) -> str:
    """All tables of what `measure` found."""
    template = templates(Path(__file__).parent, escaped=False).get_template("tables.md")
    given = {"not_to_cloud": NOT_TO_CLOUD, "cheapest": CHEAPEST, "by_radar": _by_radar(found)}
    return aligned(template.render(found | given)).rstrip()


def draw(found: dict[str, Any], file: BinaryIO) -> None:
    """Draw what `measure` found, as PNG."""
    growth = found["growth"]
    radars = _by_radar(found)
    rows = max(1, len(radars) + bool(growth["duration"]))
    figure = new_figure(3.4 * rows, width_in=11)
    places = list(figure.subplots(rows, 1, squeeze=False)[:, 0])
    for axes, (radar, models) in zip(places, radars.items(), strict=False):
        _bars(axes, models, radar)
    if growth["duration"]:
        _growing(places[-1], growth["duration"], growth["fidelity"])
    save_figure(figure, file)


def _by_radar(found: dict[str, Any]) -> dict[str, list[Row]]:
    """Rows of models by radar, in their order."""
    return {radar: [*own] for radar, own in groupby(found["models"], itemgetter("radar"))}


def _bars(axes: Any, models: list[Row], radar: str) -> None:
    """Stages side by side, hatched unless they lead to the cloud."""
    from matplotlib import colormaps

    colours = colormaps["tab20"]
    names = list(dict.fromkeys(name for row in models for name in row["stages"]))
    names.sort(key=lambda name: name in NOT_TO_CLOUD)  # stays in order otherwise
    rows, left = range(len(models)), np.zeros(len(models))
    for place, name in enumerate(names):
        medians = [row["stages"].get(name, {"median": 0.0})["median"] for row in models]
        style = {"color": colours(place % colours.N), "label": name}
        style |= {"hatch": "//"} if name in NOT_TO_CLOUD else {}
        axes.barh(rows, medians, 0.7, left, **style)
        left += medians
    axes.set_yticks(rows, [row["fidelity"] for row in models])
    axes.invert_yaxis()
    capture_s = models[0]["capture_s"]
    axes.set(ylabel="model", xlabel=f"time of a run of {capture_s:.2f} s of radar, median [s]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    dress(axes, title=f"{radar} (hatched: does not lead to the cloud)", grid=False)


def _growing(axes: Any, rows: list[Row], fidelity: str) -> None:
    """Time and peak memory over the length of the recording."""
    x = [row["duration_s"] for row in rows]
    for name, label in (("to_cloud_s", "to the cloud"), ("whole_s", "whole run")):
        axes.plot(x, [row[name]["median"] for row in rows], "o-", label=label)
    axes.set(xlabel="recording [s]", ylabel="time [s]", xlim=(0, None), ylim=(0, None))
    axes.legend(loc="upper left")
    dress(axes, title=f"`{fidelity}`")
    # Memory has another unit, so it gets an axis of its own.
    memory, beside = [row["peak_memory_mb"] for row in rows], axes.twinx()
    beside.plot(x, memory, "s--", color="0.5", markersize=4)
    beside.set(ylabel="peak memory [MB], dashed", ylim=(0, 1.3 * max(memory)))
