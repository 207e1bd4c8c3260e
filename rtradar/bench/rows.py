"""Runs and floors as rows of plain values, ready for JSON, tables and the figure."""

from __future__ import annotations

from dataclasses import asdict
from statistics import median
from typing import Any

from rtradar.bench.floors import Rates, Work, floors
from rtradar.bench.paper import IF_STAGE, Baseline
from rtradar.bench.plan import CHEAPEST, Case
from rtradar.bench.runs import Run
from rtradar.bench.times import Spread, by_stage, paired_ratio
from rtradar.radar import Radar

Row = dict[str, Any]


def model_row(
    case: Case,
    runs: list[Run],
    *,
    first: Run | None,
    cheapest: list[Run] | None,
    rates: Rates,
    baseline: Baseline | None,
) -> Row:
    """What was measured of one model with one radar.

    Parameters
    ----------
    case : Case
    runs : list of Run
        Its repeats.
    first : Run, optional
        Its first use, with nothing compiled.
    cheapest : list of Run, optional
        The runs of `CHEAPEST` with the same radar, in the same order.
    rates : Rates
        Rates of this machine, measured with the lengths of the radar's transforms.
    baseline : Baseline, optional
        The paper's method, of the same radar.
    """
    radar, said = Radar.load(case.radar), runs[0].summary
    work = Work.of(
        radar,
        chirps=said["chirps"],
        windows=said["windows"],
        echoes=len(said["part_power_m2"]),
        detections=said["detections"],
    )
    least = floors(work, rates)
    to_cloud = [run.to_cloud_s for run in runs]
    row: Row = {
        "radar": radar.name,
        "fidelity": case.fidelity,
        "cores": "one" if case.one_core else "all",
        "capture_s": said["capture_s"],
        "work": asdict(work),
        "to_cloud_s": asdict(Spread.of(to_cloud)),
        "whole_s": asdict(Spread.of([run.whole_s for run in runs])),
        "process_s": asdict(Spread.of([run.process_s for run in runs])),
        "warmup_s": asdict(Spread.of([run.summary["warmup_s"] for run in runs])),
        "first_use": None if first is None else first_use(first, runs),
        "peak_memory_mb": max(run.peak_memory_mb for run in runs),
        f"over_{CHEAPEST}": None
        if cheapest is None
        else paired_ratio(to_cloud, [run.to_cloud_s for run in cheapest]),
        "stages": {
            name: asdict(seconds)
            | (
                {"floor": least[name].seconds, "rule": least[name].rule}
                if name in least
                else {"floor": None, "rule": ""}
            )
            for name, seconds in by_stage([run.stages for run in runs]).items()
        },
    }
    return row | {
        "paper_over": None if baseline is None else paper_over(baseline, radar, work.chirps, row)
    }


def first_use(first: Run, runs: list[Run]) -> dict[str, float]:
    """What the first process of a model takes, with nothing compiled and no cache filled.

    Returns
    -------
    dict of str to float
        ``adds_s``: how much longer it takes from its start to the cloud than the median of those after it;
        ``process_s``, ``warmup_s``: its own [s].
    """
    later = median(run.from_start_to_cloud_s for run in runs)
    return {
        "adds_s": first.from_start_to_cloud_s - later,
        "process_s": first.process_s,
        "warmup_s": first.summary["warmup_s"],
    }


def paper_over(baseline: Baseline, radar: Radar, chirps: int, row: Row) -> dict[str, float]:
    """How many times longer the paper's method takes for the same chirps, each synthesised once: medians.

    Returns
    -------
    dict of str to float
        ``to_cloud``: all of it, which ends at detections, over ours, which goes on to the cloud; ``if``: echoes and IF alone.
    """
    frames = chirps / radar.chirps_per_frame
    ours_if = sum(row["stages"][name]["median"] for name in ("scatter", "signal"))
    return {
        "to_cloud": frames * baseline.total.median / row["to_cloud_s"]["median"],
        "if": frames * baseline.stages[IF_STAGE].median / ours_if,
    }


def chirp_rows(models: list[Row]) -> list[Row]:
    """Radars with more chirps than the first, each model over its own with the first: chirps, time and peak memory as ratios."""
    base = {
        row["fidelity"]: row
        for row in models
        if row["radar"] == models[0]["radar"] and row["cores"] == "all"
    }
    return [
        {
            "radar": row["radar"],
            "of_radar": models[0]["radar"],
            "fidelity": row["fidelity"],
            "chirps": row["work"]["chirps"] / base[row["fidelity"]]["work"]["chirps"],
            "to_cloud": row["to_cloud_s"]["median"] / base[row["fidelity"]]["to_cloud_s"]["median"],
            "peak_memory": row["peak_memory_mb"] / base[row["fidelity"]]["peak_memory_mb"],
        }
        for row in models
        if row["radar"] != models[0]["radar"] and row["cores"] == "all"
    ]
