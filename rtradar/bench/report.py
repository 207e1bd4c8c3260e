"""What was measured as Markdown tables, and as a picture of stages, their bounds and growth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rtradar.bench.runs import CHEAPEST
from rtradar.pipeline.timing import NOT_TO_CLOUD
from rtradar.system.figure_style import dress, new_figure, save_figure
from rtradar.system.templates import aligned, templates

Row = dict[str, Any]

# -- tables ----------------------------------------------------------------------------------------


def tables(found: dict[str, Any]) -> str:
    """All tables of what `rtradar.bench.bench` found."""
    template = templates(Path(__file__).parent, escaped=False).get_template("tables.md")
    radars = dict.fromkeys(row["radar"] for row in found["models"])
    stages = [
        _stages(radar, [row for row in found["models"] if row["radar"] == radar])
        for radar in radars
    ]
    given = {"not_to_cloud": NOT_TO_CLOUD, "cheapest": CHEAPEST, "stages": stages}
    return aligned(template.render(found | given)).rstrip()


def _stages(radar: str, models: Sequence[Row]) -> tuple[str, list[str], list[Any]]:
    """Radar, models, and for each stage its label, medians with bounds, bound, and rule."""
    lines: list[Any] = []
    missing = {"median": None, "floor": None}
    for name in dict.fromkeys(name for row in models for name in row["stages"]):
        own = [row["stages"].get(name, missing) for row in models]
        known = next(row["stages"][name] for row in models if name in row["stages"])
        label = f"{name} (not to the cloud)" if name in NOT_TO_CLOUD else name
        times = [(stage["median"], stage["floor"]) for stage in own]
        lines.append((label, times, known["floor"], known["rule"]))
    # The bounds of all stages to the cloud, as if nothing else took time.
    sums = [
        sum(own["floor"] or 0 for name, own in row["stages"].items() if name not in NOT_TO_CLOUD)
        for row in models
    ]
    medians = [row["to_cloud_s"]["median"] for row in models]
    whole = list(zip(medians, sums, strict=True))
    lines.append(("all to the cloud", whole, sums[0], "sum of the floors"))
    return radar, [row["fidelity"] for row in models], lines


# -- figure ----------------------------------------------------------------------------------------


def draw(found: dict[str, Any], file: BinaryIO) -> None:
    """Draw what `rtradar.bench.bench` found, as PNG."""
    models, growth = found["models"], found["growth"]
    radars = list(dict.fromkeys(row["radar"] for row in models))
    rows = max(1, len(radars) + bool(growth["duration"]))
    figure = new_figure(3.4 * rows, width_in=11)
    places = list(figure.subplots(rows, 1, squeeze=False)[:, 0])
    for axes, radar in zip(places, radars, strict=False):
        _bars(axes, [row for row in models if row["radar"] == radar], radar)
    if growth["duration"]:
        _growing(places[-1], growth["duration"], growth["fidelity"])
    save_figure(figure, file)


def _bars(axes: Any, models: Sequence[Row], radar: str) -> None:
    """Stages side by side, hatched unless they lead to the cloud; bounds as black bars in them."""
    from matplotlib import colormaps

    colours = colormaps["tab20"]
    names = list(dict.fromkeys(name for row in models for name in row["stages"]))
    names.sort(key=lambda name: name in NOT_TO_CLOUD)  # stays in order otherwise
    rows, left = range(len(models)), np.zeros(len(models))
    for place, name in enumerate(names):
        own = [row["stages"].get(name, {"median": 0.0, "floor": 0.0}) for row in models]
        style = {"color": colours(place % colours.N), "label": name}
        style |= {"hatch": "//"} if name in NOT_TO_CLOUD else {}
        axes.barh(rows, [stage["median"] for stage in own], 0.7, left, **style)
        axes.barh(rows, [stage["floor"] or 0.0 for stage in own], 0.15, left, color="black")
        left += [stage["median"] for stage in own]
    axes.barh([0], [0], color="black", label="floor")
    axes.set_yticks(rows, [row["fidelity"] for row in models])
    axes.invert_yaxis()
    capture_s = models[0]["capture_s"]
    axes.set(ylabel="model", xlabel=f"time of a run of {capture_s:.2f} s of radar, median [s]")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    dress(axes, title=f"{radar} (hatched: does not lead to the cloud)", grid=False)


def _growing(axes: Any, rows: Sequence[Row], fidelity: str) -> None:
    """Time and peak memory over the length of the recording."""
    x = [row["duration_s"] for row in rows]
    for name, label in (("to_cloud_s", "to the cloud"), ("whole_s", "whole run")):
        axes.plot(x, [row[name]["median"] for row in rows], "o-", label=label)
    axes.set(xlabel="recording [s]", ylabel="time [s]", xlim=(0, None), ylim=(0, None))
    axes.legend(loc="upper left")
    dress(axes, title=f"`{fidelity}`")
    memory, beside = [row["peak_memory_mb"] for row in rows], axes.twinx()
    beside.plot(x, memory, "s--", color="0.5", markersize=4)
    beside.set(ylabel="peak memory [MB], dashed", ylim=(0, 1.3 * max(memory)))
