"""Comparison of several models: pictures side by side, and the page ``compare.html``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.report.figures import canvas
from rtradar.report.figures.canvas import FieldUnit, draw_levels
from rtradar.report.figures.maps import rdt_points
from rtradar.report.pages.html import Titles, mapping_table, picture, table, write_page

_DIFFERENCES = Template("""<section><h2>What differs</h2>$measures
<p class="note">Differences are to the reference, $reference. Maps are compared in decibels:
range-Doppler in the cells that either model detects, spectrograms in the cells 10 dB above the
median of either. All models have the same noise, sample by sample. Echo power is of one chirp every
10 ms, each from another Tx, which makes it saw.</p></section>""")
_TABLES = Template("""<div class="tables"><section><h2>Seconds a stage</h2>$stages</section>
<section><h2>Mean echo power by part: $unit</h2>$parts</section>
<section><h2>Parameters</h2>$parameters</section></div>
""")


def draw_power_over_time(
    path: Path,
    times: NDArray[np.float64],
    power: Mapping[str, NDArray[np.float64]],
    unit: FieldUnit,
    reference: str,
    title: str,
) -> None:
    """Draw the echo power [m^2] of each model over time [s], and differences to the reference."""
    figure = canvas.new_figure(9, 5.5)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for name, values in power.items():
        level = unit.level(values)
        above.plot(times, level, label=name, linewidth=1.2)
        below.plot(times, level - unit.level(power[reference]), linewidth=1.2)
    above.set(ylabel=unit.label("all parts"), title=title)
    above.legend()
    below.set(xlabel="Time [s]", ylabel=f"Less {reference} [dB]")
    for axes in (above, below):
        axes.grid(alpha=0.3)
    canvas.save_figure(figure, path)


def draw_part_power(
    path: Path,
    parts: Sequence[str],
    power: Mapping[str, NDArray[np.float64]],
    hidden: Mapping[str, NDArray[np.float64]],
    unit: FieldUnit,
    title: str,
) -> None:
    """Draw the mean echo power of each body part by model, and the occluded fraction of time.

    ``power`` (part,) [m^2] and ``hidden`` (part,), a fraction of time and channels, are by model.
    """
    figure = canvas.new_figure(11, 6.5)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(2, 1))
    places, height = np.arange(len(parts)), 0.8 / len(power)
    for number, name in enumerate(power):
        seen = power[name] > 0
        level = unit.level(power[name])
        offset = places + (number - (len(power) - 1) / 2) * height
        left.plot(level[seen], offset[seen], "o", markersize=4, label=name)
        right.barh(offset, 100 * hidden[name], height)
    left.set(yticks=places, yticklabels=parts, xlabel=unit.label("mean over time"), title=title)
    left.invert_yaxis()
    left.legend()
    right.set(xlabel="Occluded [% of time and channels]", xlim=(0, 100))
    for axes in (left, right):
        axes.grid(alpha=0.3)
    canvas.save_figure(figure, path)


def draw_maps(
    path: Path,
    maps: Mapping[str, NDArray[np.float64]],
    label: str,
    across: tuple[str, NDArray[np.float64]],
    up: tuple[str, NDArray[np.float64]],
    title: str,
) -> None:
    """Draw the same map (up, across) [dB] of each model in the same colours.

    ``label`` is that of the colour bar, with its unit; ``across`` and ``up`` are the label and the
    values (n,) of an axis.
    """
    figure = canvas.new_figure(1.5 + 4.2 * len(maps), 4.6)
    columns = figure.subplots(1, len(maps), sharex=True, sharey=True, squeeze=False)[0]
    limits = canvas.colour_limits(np.concatenate([np.ravel(level) for level in maps.values()]))
    for axes, (name, level) in zip(columns, maps.items(), strict=True):
        image = draw_levels(axes, level, across[1], up[1], limits, interpolation="nearest")
        axes.set(xlabel=across[0], title=name)
    columns[0].set_ylabel(up[0])
    figure.colorbar(image, ax=list(columns), label=label)
    figure.suptitle(title, wrap=True)
    canvas.save_figure(figure, path)


def draw_rdt_clouds(path: Path, clouds: Mapping[str, NDArray[np.float64]], title: str) -> None:
    """Draw RDT clouds (point, 3), time [s], range [m] and velocity [m/s], on the same axes."""
    figure = canvas.new_figure(1 + 4.6 * len(clouds), 4.8)
    every = np.concatenate(list(clouds.values()))
    largest = float(np.abs(every[:, 2]).max(initial=1e-9))
    for number, (name, points) in enumerate(clouds.items(), start=1):
        axes = figure.add_subplot(1, len(clouds), number, projection="3d")
        rdt_points(axes, points, f"{name}: {len(points)} points", fastest=largest, s=3)
        if len(every):
            low, high = every.min(axis=0), every.max(axis=0)
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect((1.5, 1, 1), zoom=0.85)  # room for the labels at its right
    figure.suptitle(title, wrap=True)
    canvas.save_figure(figure, path)


def write_comparison(
    path: Path,
    summary: Mapping[str, Any],
    rows: Sequence[Sequence[str]],
    pictures: Mapping[str, Path],
    unit: FieldUnit,
) -> None:
    """Write a comparison as a page with its table and its pictures.

    ``summary`` is the content of ``compare.json``; ``rows`` are a heading row and one row for each
    measure; ``pictures`` are PNG files by their titles; ``unit`` is that of the power of parts.
    """
    models = summary["fidelities"]
    stages = {stage: None for found in models.values() for stage in found["stages"]}
    parts = next(iter(models.values()))["part_power_m2"]
    parameters = {key: value for key, value in summary["parameters"].items() if key != "radar"}
    columns = ["", *models]
    times, levels = [], []
    for stage in stages:
        seconds = [model["stages"].get(stage) for model in models.values()]
        times.append([stage, *("-" if value is None else f"{value:.3f}" for value in seconds)])
    for part in parts:
        powers = np.array([model["part_power_m2"][part] for model in models.values()])
        shown = zip(powers, unit.level(powers), strict=True)
        levels.append(
            [part, *(f"{level:.1f}" if power > 0 else "occluded" for power, level in shown)]
        )
    subtitle = f"{summary['parameters']['radar']['name']}: {', '.join(models)}"
    drawn = "\n".join(picture(title, file) for title, file in pictures.items())
    figures = f'<div class="pictures">{drawn}</div>'
    by_part = {"parts": table(levels, columns), "unit": escape(unit.label())}
    tables = _TABLES.substitute(
        by_part, stages=table(times, columns), parameters=mapping_table(parameters)
    )
    top = {"measures": table(rows[1:], rows[0]), "reference": escape(summary["reference"])}
    titles = Titles("rtradar compare", str(summary["parameters"]["motion"]), subtitle)
    body = f'<section id="maps"><h2>Side by side</h2>{figures}</section>', tables
    write_page(path, titles, _DIFFERENCES.substitute(top), body)
