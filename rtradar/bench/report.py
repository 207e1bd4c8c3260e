"""What was measured as Markdown tables, and as a picture of stages, their bounds and growth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np

from rtradar.bench.plan import CHEAPEST
from rtradar.bench.runs import NOT_TO_CLOUD
from rtradar.system.figure_style import dress, new_figure, save_figure

Row = dict[str, Any]

# -- tables ----------------------------------------------------------------------------------------


def tables(found: dict[str, Any]) -> str:
    """All tables of what `rtradar.bench.bench` found."""
    return "\n\n".join(_blocks(found))


def _blocks(found: dict[str, Any]) -> Iterator[str]:
    models = found["models"]
    yield (
        f"{found['settings']['motion']}, {found['machine']['cores']} cores, each run a process of "
        f"its own, medians of {found['settings']['repeats']} after warm-up. To the cloud: all "
        f"stages but {', '.join(NOT_TO_CLOUD)}. The paper's method goes to detections; IF: its "
        "echoes and IF over ours."
    )
    if models:
        own = next(iter(found["rates"].values()))
        yield (
            f"A second here: {own['copied_bytes'] / 1e9:.1f} GB read and written, "
            f"{own['random_words'] / 1e6:.0f} million random words, "
            f"{own['multiply_adds'] / 1e9:.0f} thousand million multiply-adds."
        )
        yield _filled(_MODELS, models)
        trouble = found["paper"]["trouble"]
        missing = f"the paper's method was not timed: {trouble}"
        yield missing if trouble else _paper(found["paper"]["radars"])
        for radar in dict.fromkeys(row["radar"] for row in models):
            yield _stages(radar, [row for row in models if row["radar"] == radar])
    yield from _growth(found["growth"])


_MODELS = {
    "radar": "{radar}",
    "model": "`{fidelity}`",
    "to the cloud: best": "{to_cloud_s[best]:.2f} s",
    "median": "{to_cloud_s[median]:.2f} s",
    "whole run": "{whole_s[median]:.2f} s",
    "first use adds": "{first_use[adds_s]:.1f} s",
    "peak memory": "{peak_memory_mb:.0f} MB",
    f"over `{CHEAPEST}`": f"{{over_{CHEAPEST}:.2f}}",
    "paper's method over it": "{paper_over[to_cloud]:.3g} (IF {paper_over[if]:.3g})",
}
_CHIRPS = {
    "radars": "{radar} / {of_radar}",
    "model": "`{fidelity}`",
    "chirps": "{chirps:.2f}",
    "to the cloud": "{to_cloud:.2f}",
    "peak memory": "{peak_memory:.2f}",
}
_DURATIONS = {
    "to the cloud": "{to_cloud_s[median]:.2f} s",
    "whole run": "{whole_s[median]:.2f} s",
    "to the cloud a second, over the first": "{growth:.3f}",
    "peak memory": "{peak_memory_mb:.0f} MB",
}


def _filled(columns: Mapping[str, str], rows: Sequence[Row]) -> str:
    """Fill in the templates of the columns for each row, with a dash for what it lacks."""
    lines = []
    for row in rows:
        cells = []
        for template in columns.values():
            try:
                cells.append(template.format(**row))
            except TypeError:  # None has no keys and no digits
                cells.append("-")
        lines.append(cells)
    return table(list(columns), lines)


def _paper(radars: dict[str, Any]) -> str:
    names = dict.fromkeys(name for baseline in radars.values() for name in baseline["stages"])
    lines = []
    for radar, baseline in radars.items():
        stages = [f"{baseline['stages'][name]['median']:.3f} s" for name in names]
        lines.append([radar, *stages, f"{baseline['total']['median']:.2f} s"])
    return table(["the paper's method in NumPy, one thread, a frame", *names, "all"], lines)


def _stages(radar: str, models: Sequence[Row]) -> str:
    """Medians of every stage, the bound, and in brackets how many times it they are."""
    lines = []
    for name in dict.fromkeys(name for row in models for name in row["stages"]):
        own = [row["stages"].get(name) for row in models]
        known = next(stage for stage in own if stage is not None)
        label = f"{name} (not to the cloud)" if name in NOT_TO_CLOUD else name
        times = ["-" if stage is None else _over(stage["median"], stage["floor"]) for stage in own]
        floor = "-" if known["floor"] is None else f"{known['floor']:.3f} s"
        lines.append([label, *times, floor, known["rule"]])
    # The bounds of all stages to the cloud, as if nothing else took time.
    sums = [
        sum(own["floor"] or 0 for name, own in row["stages"].items() if name not in NOT_TO_CLOUD)
        for row in models
    ]
    medians = [row["to_cloud_s"]["median"] for row in models]
    whole = [_over(own, least) for own, least in zip(medians, sums, strict=True)]
    lines.append(["all to the cloud", *whole, f"{sums[0]:.3f} s", "sum of the floors"])
    names = [f"`{row['fidelity']}`" for row in models]
    return table([f"{radar}: stage", *names, "floor", "floor's work"], lines)


def _growth(growth: dict[str, Any]) -> Iterator[str]:
    if growth["chirps"]:
        yield _filled(_CHIRPS, growth["chirps"])
    rows = growth["duration"]
    seconds = [row["to_cloud_s"]["median"] / row["capture_s"] for row in rows]
    if rows:
        head = {f"recording, `{growth['fidelity']}`": "{duration_s:g} s"}
        grown = zip(rows, seconds, strict=True)
        yield _filled(head | _DURATIONS, [row | {"growth": s / seconds[0]} for row, s in grown])


def _over(seconds: float, floor: float | None) -> str:
    return f"{seconds:.3f} s" + (f" ({seconds / floor:.3g}x)" if floor else "")


def table(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """Cells in aligned columns, as Markdown."""
    widths = [max(map(len, column)) for column in zip(head, *lines, strict=True)]
    rows = [
        " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        for line in (head, *lines)
    ]
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    first, *others = (f"| {row} |" for row in rows)
    return "\n".join([first, rule, *others])


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
