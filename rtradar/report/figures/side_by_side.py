"""Pictures of several models side by side, with axes and units, as PNG files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rtradar.report.figures.field_units import VELOCITY_LABEL, FieldUnit
from rtradar.report.figures.maps import bin_edges, colour_limits, new_figure, save_figure


def draw_power_over_time(
    path: Path,
    times: NDArray[np.float64],
    power: Mapping[str, NDArray[np.float64]],
    unit: FieldUnit,
    reference: str,
    title: str,
) -> None:
    """Echo power of each model over time, and how far it is from the reference.

    Parameters
    ----------
    path : path
        PNG file.
    times : (time,) float64
        [s].
    power : mapping of str to (time,) float64
        By model [m^2].
    unit : FieldUnit
        In which they are drawn.
    reference : str
        One of the models.
    title : str
    """
    figure = new_figure(9, 5.5)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for name, values in power.items():
        level = unit.level(values)
        above.plot(times, level, label=name, linewidth=1.2)
        if name != reference:
            below.plot(times, level - unit.level(power[reference]), linewidth=1.2)
        else:
            below.plot(times, np.zeros(len(times)), linewidth=1.2)
    above.set(ylabel=unit.label("all parts"), title=title)
    above.legend()
    below.set(xlabel="Time [s]", ylabel=f"Less {reference} [dB]")
    for axes in (above, below):
        axes.grid(alpha=0.3)
    save_figure(figure, path)


def draw_part_power(
    path: Path,
    parts: Sequence[str],
    power: Mapping[str, NDArray[np.float64]],
    hidden: Mapping[str, NDArray[np.float64]],
    unit: FieldUnit,
    title: str,
) -> None:
    """Mean echo power of each body part by model, and how much of the time it is hidden.

    Parameters
    ----------
    path : path
        PNG file.
    parts : sequence of str
        Names.
    power : mapping of str to (part,) float64
        By model [m^2].
    hidden : mapping of str to (part,) float64
        By model: share of time and channels, 0 to 1.
    unit : FieldUnit
        In which power is drawn.
    title : str
    """
    figure = new_figure(11, 6.5)
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
    right.set(xlabel="Hidden [% of time and channels]", xlim=(0, 100))
    for axes in (left, right):
        axes.grid(alpha=0.3)
    save_figure(figure, path)


def draw_maps(
    path: Path,
    maps: Mapping[str, NDArray[np.float64]],
    label: str,
    across: tuple[str, NDArray[np.float64]],
    up: tuple[str, NDArray[np.float64]],
    title: str,
) -> None:
    """The same map of each model in the same colours.

    Parameters
    ----------
    path : path
        PNG file.
    maps : mapping of str to (up, across) float64
        By model: levels [dB].
    label : str
        Of their colour bar, with its unit.
    across, up : (str, (n,) float64)
        Label with its unit, and values, of the two axes.
    title : str
    """
    figure = new_figure(1.5 + 4.2 * len(maps), 4.6)
    columns = figure.subplots(1, len(maps), sharex=True, sharey=True, squeeze=False)[0]
    low, high = colour_limits(np.concatenate([np.ravel(level) for level in maps.values()]))
    extent = (*bin_edges(across[1]), *bin_edges(up[1]))
    for axes, (name, level) in zip(columns, maps.items(), strict=True):
        image = axes.imshow(
            level,
            origin="lower",
            aspect="auto",
            interpolation="nearest",
            cmap="viridis",
            vmin=low,
            vmax=high,
            extent=extent,
        )
        axes.set(xlabel=across[0], title=name)
    columns[0].set_ylabel(up[0])
    figure.colorbar(image, ax=list(columns), label=label)
    figure.suptitle(title, wrap=True)
    save_figure(figure, path)


def draw_rdt_clouds(path: Path, clouds: Mapping[str, NDArray[np.float64]], title: str) -> None:
    """RDT clouds on the same axes.

    Parameters
    ----------
    path : path
        PNG file.
    clouds : mapping of str to (point, 3) float64
        By model: time [s], range [m], velocity [m/s].
    title : str
    """
    figure = new_figure(1 + 4.6 * len(clouds), 4.8)
    every = np.concatenate(list(clouds.values()))
    largest = float(np.abs(every[:, 2]).max(initial=1e-9))
    for number, (name, points) in enumerate(clouds.items(), start=1):
        axes = figure.add_subplot(1, len(clouds), number, projection="3d")
        axes.scatter(*points.T, c=points[:, 2], s=3, cmap="coolwarm", vmin=-largest, vmax=largest)
        axes.set(
            xlabel="Time [s]",
            ylabel="Range [m]",
            zlabel=VELOCITY_LABEL,
            title=f"{name}: {len(points)} points",
        )
        if len(every):
            low, high = every.min(axis=0), every.max(axis=0)
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
        axes.set_box_aspect((1.5, 1, 1), zoom=0.85)  # room for the labels at its right
    figure.suptitle(title, wrap=True)
    save_figure(figure, path)
