"""What was measured as a picture: where the time of each model goes beside its floors, and how it grows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, BinaryIO

from rtradar.bench.times import FILES, OTHER_PRODUCTS

Row = dict[str, Any]


def draw(found: dict[str, Any], file: BinaryIO) -> None:
    """Draw what `rtradar.bench.bench` found, as PNG."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    models = [row for row in found["models"] if row["cores"] == "all"]
    growth = found["growth"]
    radars = list(dict.fromkeys(row["radar"] for row in models))
    grown = [name for name in ("duration", "channels", "echoes") if growth[name]]
    rows = len(radars) + bool(grown)
    figure = plt.figure(figsize=(11, 3.4 * rows), layout="constrained")
    places = figure.add_gridspec(rows, max(1, len(grown)))
    for number, radar in enumerate(radars):
        _bars(
            figure.add_subplot(places[number, :]),
            [row for row in models if row["radar"] == radar],
            radar,
        )
    for column, name in enumerate(grown):
        axes = figure.add_subplot(places[-1, column])
        if name == "echoes":
            _lines(
                axes,
                growth[name],
                "echoes",
                "echoes of a chirp and receiver",
                [("signal_s", "IF of a block")],
            )
        else:
            label = "recording [s]" if name == "duration" else "channels"
            key = "duration_s" if name == "duration" else "channels"
            _lines(
                axes,
                growth[name],
                key,
                label,
                [("to_cloud_s", "to the cloud"), ("whole_s", "whole run")],
            )
            _memory(axes.twinx(), growth[name], key)
            axes.set_title(f"`{growth['fidelity']}`", fontsize=9)
    figure.savefig(file, format="png", dpi=110)
    plt.close(figure)


def _bars(axes: Any, models: Sequence[Row], radar: str) -> None:
    """Stages beside each other, those that do not lead to the cloud hatched; the floor of each as a black bar in it."""
    import matplotlib as mpl

    colours = mpl.colormaps["tab20"]
    names = list(dict.fromkeys(name for row in models for name in row["stages"]))
    names.sort(key=lambda name: name in (*OTHER_PRODUCTS, *FILES))  # stays in order otherwise
    for number, row in enumerate(models):
        left = 0.0
        for name in names:
            stage = row["stages"].get(name)
            if stage is None:
                continue
            label = name if not number else None
            hatch = "//" if name in (*OTHER_PRODUCTS, *FILES) else None
            place = names.index(name)
            axes.barh(
                number,
                stage["median"],
                left=left,
                color=colours(place % colours.N),
                hatch=hatch,
                label=label,
                height=0.7,
            )
            if stage["floor"]:
                axes.barh(number, stage["floor"], left=left, color="black", height=0.15)
            left += stage["median"]
    axes.barh([0], [0], color="black", label="floor")
    axes.set_yticks(range(len(models)), [row["fidelity"] for row in models])
    axes.invert_yaxis()
    axes.set(
        ylabel="model",
        xlabel=f"time of a run of {models[0]['capture_s']:.2f} s of radar, median [s]",
    )
    axes.set_title(f"{radar} (hatched: does not lead to the cloud)", fontsize=9)
    axes.legend(fontsize=6.5, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _lines(
    axes: Any, rows: Sequence[Row], key: str, label: str, series: Sequence[tuple[str, str]]
) -> None:
    x = [row[key] for row in rows]
    for name, said in series:
        y = [row[name] if isinstance(row[name], float) else row[name]["median"] for row in rows]
        axes.plot(x, y, "o-", label=said)
    axes.set(xlabel=label, ylabel="time [s]", xlim=(0, None), ylim=(0, None))
    axes.legend(fontsize=7, loc="upper left")
    axes.grid(alpha=0.2)


def _memory(axes: Any, rows: Sequence[Row], key: str) -> None:
    axes.plot(
        [row[key] for row in rows],
        [row["peak_memory_mb"] for row in rows],
        "s--",
        color="0.5",
        markersize=4,
    )
    axes.set(
        ylabel="peak memory [MB], dashed",
        ylim=(0, 1.3 * max(row["peak_memory_mb"] for row in rows)),
    )
