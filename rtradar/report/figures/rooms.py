"""Pictures of a room: its plan with echo paths, and maps before and after clutter removal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from numpy.typing import NDArray

from rtradar.process import WindowFunctions
from rtradar.process.window_functions import DEFAULT_WINDOWS, noise_bandwidth_bins
from rtradar.radar import Radar
from rtradar.report.figures import canvas
from rtradar.report.figures.canvas import VELOCITY_LABEL, draw_levels, field_unit
from rtradar.report.figures.maps import angle_label
from rtradar.scene import Scene, plan
from rtradar.system.figure_labels import Label, around
from rtradar.system.figure_style import STYLE, dress, new_figure, theme_of

_LEGEND: dict[str, Any] = {"fontsize": 8, "facecolor": "dimgrey", "labelcolor": "white"}
_BOX = {"facecolor": "black", "alpha": 0.6, "edgecolor": "none", "pad": 1}
_ARROW = {"arrowstyle": "-", "color": "red", "linewidth": 0.6, "shrinkA": 0, "shrinkB": 4}
_GHOST: dict[str, Any] = {"markerfacecolor": "none", "markeredgecolor": "red", "markersize": 9}


def draw_plan(
    path: Path,
    scene: Scene,
    radar: Radar,
    track: NDArray[np.float64],
    paths: Mapping[str, NDArray[np.float64]],
    title: str,
) -> None:
    """Draw the room from above: walls, furniture, radar, the person's track and paths of echoes.

    ``track`` (time, 2) are positions of the person's root [m], ``paths`` the corners (point, 3) of
    each path from Tx to Rx [m] by its name.
    """
    place = radar.position_m[:2]
    limits = plan.plan_limits(scene, [place, *track])
    figure = new_figure(plan.height_of_plan(limits) + 0.2 * math.ceil((len(paths) + 1) / 2))
    axes = figure.add_subplot()
    plan.draw_plan(axes, scene, limits)
    # There may be more than ten paths.
    axes.set_prop_cycle(color=[colormaps["tab20"](number) for number in range(20)])
    for name, corners in paths.items():
        axes.plot(corners[:, 0], corners[:, 1], linewidth=1, label=name)
    theme = theme_of(axes)
    axes.plot(track[:, 0], track[:, 1], color=theme.person, linewidth=2.5, label="person")
    plan.draw_radar(axes, place)
    words = figure.legend(loc="outside lower center", ncols=2, fontsize=STYLE["legend.fontsize"])
    for text in words.get_texts():
        text.set_parse_math(False)
    dress(axes, title=title, note=plan.plan_note(scene))
    plan.name_parts(axes, scene, [Label("radar", around(place, 12.0), theme.radar)])
    canvas.save_figure(figure, path)


def draw_before_after(
    path: Path,
    maps: Mapping[str, tuple[NDArray[np.floating], NDArray[np.bool_]]],
    ghosts: Sequence[tuple[str, float, float]],
    radar: Radar,
    title: str,
) -> None:
    """Draw range-Doppler maps with their detections, and ghosts where they are predicted.

    ``maps`` are, by the title of the panel, power summed over all channels [m^2] and detections,
    (range, velocity); ``ghosts`` path over walls, range [m] and velocity [m/s] of each ghost.
    """
    figure = canvas.new_figure(1 + 5.5 * len(maps), 5)
    panels = figure.subplots(1, len(maps), sharex=True, sharey=True, squeeze=False)[0]
    unit = field_unit(radar, range_m=radar.range_m[:, None])
    levels = [unit.level(power / radar.n_channels) for power, _ in maps.values()]
    low, high = zip(*map(canvas.colour_limits, levels), strict=True)
    for axes, (name, (_, mask)), level in zip(panels, maps.items(), levels, strict=True):
        velocity = radar.velocity_mps(level.shape[1])
        image = draw_levels(axes, level, velocity, radar.range_m, (min(low), max(high)))
        rows, columns = np.nonzero(mask)
        style = {"s": 1, "color": "white", "alpha": 0.5, "label": "detected"}
        axes.scatter(velocity[columns], radar.range_m[rows], **style)
        axes.set(xlabel=VELOCITY_LABEL, title=f"{name}\n{len(rows)} detections")
        axes.set(xlim=canvas.bin_edges(velocity), ylim=canvas.bin_edges(radar.range_m))
        _mark(axes, ghosts, radar)
    panels[0].set_ylabel("Range [m]")
    panels[0].legend(loc="upper right", **_LEGEND)
    figure.colorbar(image, ax=list(panels), label=unit.label("mean of channels"))
    figure.suptitle(title, wrap=True)
    canvas.save_figure(figure, path)


def _mark(axes: Axes, ghosts: Sequence[tuple[str, float, float]], radar: Radar) -> None:
    """Draw circles at (name, range [m], horizontal coordinate) within the radar's range.

    Names stand beside them toward the middle of the axes, far enough apart to be read.
    """
    label = "ghost over a wall, predicted"
    inside = (ghost for ghost in ghosts if ghost[1] < radar.max_range_m)
    (left, right), gap = axes.get_xlim(), 0.035 * radar.max_range_m
    placed: list[tuple[float, float]] = []
    for name, distance, across in sorted(inside, key=lambda ghost: ghost[1]):
        axes.plot(across, distance, "o", label=label, **_GHOST)
        label = ""
        toward = 1 if across < (left + right) / 2 else -1
        beside, place = across + 0.08 * toward * (right - left), distance
        for other, taken in placed:
            if abs(other - beside) < 0.25 * (right - left):
                place = max(place, taken + gap)
        placed.append((beside, place))
        style: dict[str, Any] = {"fontsize": 7, "color": "white", "bbox": _BOX, "va": "center"}
        style |= {"ha": "left" if toward > 0 else "right", "arrowprops": _ARROW}
        axes.annotate(name, (across, distance), (beside, place), **style)


def draw_range_azimuth_with_walls(
    path: Path,
    power: NDArray[np.floating],
    azimuth: NDArray[np.float64],
    scene: Scene,
    radar: Radar,
    ghosts: Sequence[tuple[str, float, float]],
    title: str,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
) -> None:
    """Draw power over azimuth and range, with upright walls where they are.

    ``power`` (range, azimuth) is summed over detected cells [m^2], ``azimuth`` are the angles of
    its columns [rad], and ``ghosts`` path over walls, range [m] and azimuth [rad] of each ghost.
    The ``window_functions`` are those of the transforms that gave the power.
    """
    figure = canvas.new_figure(8, 5.5)
    axes = figure.subplots()
    unit = field_unit(radar, range_m=radar.range_m[:, None])
    velocities = noise_bandwidth_bins(window_functions.doppler, radar.cycles_per_frame)
    values = unit.level(power / velocities)  # one echo is spread over as many velocities
    limits = canvas.colour_limits(values, 50)  # cells that were not detected have no decibels
    left, right = canvas.bin_edges(np.degrees(azimuth))
    image = draw_levels(axes, values, np.degrees(azimuth), radar.range_m, limits)
    place = np.asarray(radar.position_m)[:2]
    for first, last, wall in plan.feet_of_walls(scene):
        along = first + np.linspace(0, 1, 200)[:, None] * (last - first) - place
        angle, distance = np.degrees(np.arctan2(along[:, 1], along[:, 0])), np.hypot(*along.T)
        axes.plot(angle, distance, color="white", linewidth=1.2, linestyle="--")
        shown = (angle > left) & (angle < right) & (distance < radar.max_range_m)
        inside = np.flatnonzero(shown)
        if len(inside):
            near = inside[len(inside) // 6]  # beside the middle, where names of ghosts stand
            axes.annotate(wall.name, (angle[near], distance[near]), fontsize=8, color="white")
    axes.set(xlabel=angle_label("azimuth", radar), ylabel="Range [m]", title=title)
    axes.set(xlim=(left, right), ylim=canvas.bin_edges(radar.range_m))
    _mark(axes, [(name, distance, np.degrees(angle)) for name, distance, angle in ghosts], radar)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper right", **_LEGEND)
    figure.colorbar(image, label=unit.label("detected cells"))
    canvas.save_figure(figure, path)
