"""Comparison of several models: pictures side by side, and the page ``compare.html``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.report.canvas import FieldUnit, add_colour_bar, rdt_points
from rtradar.report.html import write_page
from rtradar.report.maps import ShownMap, colour_limits, draw_levels
from rtradar.report.run_view import RunView
from rtradar.report.three_d import posed_figure
from rtradar.system.figure_style import LIGHT, dress, new_figure, save_figure, write_heading

MOST_STEPS = 60
"""Largest number of moments that the page shows."""

_STEPS_HZ = 20.0


def draw_power_over_time(
    path: Path,
    times: NDArray[np.float64],
    power: Mapping[str, NDArray[np.float64]],
    unit: FieldUnit,
    reference: str,
    title: str,
) -> None:
    """Draw the echo power [m^2] of each model over time [s], and differences to the reference."""
    figure = new_figure(5.2)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    # Both axes begin the cycle of colours anew, so that a model has one colour in both.
    for axes in (above, below):
        axes.set_prop_cycle(color=LIGHT.cycle)
    for name, values in power.items():
        level = unit.level(values)
        above.plot(times, level, label=name, linewidth=1.2)
        below.plot(times, level - unit.level(power[reference]), linewidth=1.2)
    above.set_ylabel(unit.label("all parts"))
    above.legend()
    below.set(xlabel="Time [s]", ylabel=f"Less {reference} [dB]")
    dress(above, title=title)
    dress(below)
    save_figure(figure, path, pdf=path.with_suffix(".pdf"))


def draw_part_power(
    path: Path,
    parts: Sequence[str],
    power: Mapping[str, NDArray[np.float64]],
    occluded: Mapping[str, NDArray[np.float64]],
    unit: FieldUnit,
    title: str,
) -> None:
    """Draw the mean echo power of each body part by model, and what other parts occlude of it.

    ``power`` (part,) [m^2] and ``occluded`` (part,), a fraction of the power, are by model.
    """
    figure = new_figure(6.5)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(2, 1))
    for axes in (left, right):
        axes.set_prop_cycle(color=LIGHT.cycle)
    places, height = np.arange(len(parts)), 0.8 / len(power)
    # Models have places beside each other at each part; a part that returns nothing has no point.
    for number, name in enumerate(power):
        seen = power[name] > 0
        level = unit.level(power[name])
        offset = places + (number - (len(power) - 1) / 2) * height
        left.plot(level[seen], offset[seen], "o", markersize=4, label=name)
        right.barh(offset, 100 * occluded[name], height)
    left.set(yticks=places, yticklabels=parts, xlabel=unit.label("mean over time"))
    left.invert_yaxis()
    left.legend()
    right.set(xlabel="Occluded [% of\nthe part's power]", xlim=(0, 100))
    dress(left, title=title, across=1.4)
    dress(right)
    save_figure(figure, path, pdf=path.with_suffix(".pdf"))


def draw_maps(
    path: Path, maps: Mapping[str, ShownMap], title: str, reference: str | None = None
) -> None:
    """Draw the same map of each model in the same colours and limits, one above another.

    They are in the unit and within the limits of the ``reference``; without one each is below its
    own maximum, and all are within limits that hold all.
    """
    # The level of the power itself, whatever the unit of each map.
    levels = {name: one.level_db - 10 * np.log10(one.unit.scale) for name, one in maps.items()}
    if reference is None:
        unit = FieldUnit("dB re maximum", 1.0)
        levels = {name: level - level.max() for name, level in levels.items()}
        ends = np.array([one.limits for one in maps.values()])
        limits_of = np.stack([ends[..., 0].min(axis=0), ends[..., 1].max(axis=0)], axis=1)
    else:
        # All in the unit of the reference, so that colours mean the same.
        unit, limits_of = maps[reference].unit, np.array(maps[reference].limits)
        levels = {name: level + 10 * np.log10(unit.scale) for name, level in levels.items()}
    # One panel for each, with common axes and one colour bar; what all have in common is said once.
    figure = new_figure(1.0 + 2.6 * len(maps))
    panels = figure.subplots(len(maps), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    limits = colour_limits(np.concatenate([np.ravel(level) for level in levels.values()]))
    alike = len({one.made for one in maps.values()}) == 1
    for axes, (name, one) in zip(panels, maps.items(), strict=True):
        image = draw_levels(axes, levels[name], one.across, one.up, limits)
        axes.set_ylabel(one.labels[1])
        shown = f"{name}: {one.title}".replace("\n", " ")
        made = one.made if axes is panels[0] or not alike else ""
        lines = (title, made, shown) if axes is panels[0] else (made, shown)
        dress(axes, title="\n".join(filter(None, lines)), grid=False)
    panels[-1].set(xlabel=one.labels[0], xlim=limits_of[0], ylim=limits_of[1])
    add_colour_bar(image, list(panels), unit.label(one.qualifier))
    save_figure(figure, path, pdf=path.with_suffix(".pdf"))


def draw_rdt_clouds(path: Path, clouds: Mapping[str, NDArray[np.float64]], title: str) -> None:
    """Draw RDT clouds (point, 3), time [s], range [m] and velocity [m/s], on the same axes."""
    figure = new_figure(0.6 + 3.6 * len(clouds))
    # Common limits and colours, so that clouds can be compared by eye.
    every = np.concatenate(list(clouds.values()))
    largest = float(np.abs(every[:, 2]).max(initial=1e-9))
    for number, (name, points) in enumerate(clouds.items(), start=1):
        axes: Any = figure.add_subplot(len(clouds), 1, number, projection="3d")
        rdt_points(axes, points, fastest=largest, s=3)
        if len(every):
            low, high = every.min(axis=0), every.max(axis=0)
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect((1.6, 1, 1), zoom=0.95)
        dress(axes, title=f"{name}: {len(points)} points")
    write_heading(figure, title)
    save_figure(figure, path, pdf=path.with_suffix(".pdf"))


def write_comparison(
    path: Path,
    summary: Mapping[str, Any],
    rows: Sequence[Sequence[str]],
    pictures: Mapping[str, Path],
    unit: FieldUnit | None = None,
    views: Mapping[str, RunView] | None = None,
) -> None:
    """Write a comparison of models or of folders as a page: tables and pictures.

    ``summary`` is the content of ``compare.json``; ``rows`` are a heading row and one row for each
    measure; ``pictures`` are PNG files by their titles. Of models, ``unit`` is that of the power of
    parts, and ``views`` are the data of the maps of each, the reference last, which the page shows
    side by side with one slider.
    """
    values = {"summary": summary, "rows": rows, "pictures": pictures, "unit": unit}
    # Folders that were compared: a table of the settings in which their runs differ.
    if views is None:
        folders = summary["folders"]
        differ = [
            (key, *(str(values.get(name, "")) for name in folders))
            for key, values in summary["differ"].items()
        ]
        write_page(path, "compare.html", values | {"folders": folders, "differ": differ})
        return
    values |= {"fidelities": summary["fidelities"], "models": [*views]}
    scripts = ("plots.js", "figure.js", "compare.js")
    write_page(path, "compare.html", values, data=comparison_data(views), scripts=scripts)


def comparison_data(views: Mapping[str, RunView]) -> dict[str, Any]:
    """Return the data of the page: body and maps, on the same axes and in the same colours.

    ``limits_db`` are the highest floor and the highest peak of all maps, and ``difference_db`` the
    colours' limit of differences, which a twentieth of the cells exceed that are 20 dB above the
    highest floor by either model: where neither has an echo nothing differs, and deep fades do by
    tens of decibels, which would hide all else.
    """
    thinned = {name: view.thinned(MOST_STEPS, _STEPS_HZ) for name, view in views.items()}
    maps = {name: view.range_doppler for name, view in thinned.items()}
    low = max(levels.low_db for levels in maps.values())
    high = max(levels.high_db for levels in maps.values())
    # A frame that holds what any of the models shows.
    boxes = np.array([view.shown_box() for view in thinned.values()])
    # Levels below the highest floor count as that floor, because below it one of the models shows
    # nothing.
    decibels = [np.maximum(one.low_db + one.step_db * one.level, low) for one in maps.values()]
    most = max(_spread(one, decibels[-1], low + 20) for one in decibels[:-1])
    snapshots = next(iter(thinned.values())).snapshots
    radar = next(iter(thinned.values())).radar
    # The body moves alike in all models, and is sent once.
    parts = snapshots.part_names.tolist()
    return {
        "figure": posed_figure(parts, snapshots.times, snapshots.poses, radar, alone=True),
        "models": [{"name": name, "map": levels.packed()} for name, levels in maps.items()],
        "limits_db": [low, high],
        "difference_db": max(float(np.ceil(most)), 1.0),
        "box": np.stack([boxes[..., 0].min(axis=0), boxes[..., 1].max(axis=0)], axis=1).tolist(),
    }


def _spread(one: NDArray[np.float64], other: NDArray[np.float64], floor_db: float) -> float:
    """Return what a twentieth of the differences exceed, where either is above the floor [dB]."""
    differences = np.abs(one - other)[np.maximum(one, other) > floor_db]
    return float(np.percentile(differences, 95)) if len(differences) else 0.0
