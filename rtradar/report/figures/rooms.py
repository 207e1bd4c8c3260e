"""Pictures of a room: its plan with echo paths, and maps before and after clutter removal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from numpy.typing import NDArray

from rtradar.radar import Radar
from rtradar.report.figures.angles import angle_label
from rtradar.report.figures.field_units import HANN_BINS, VELOCITY_LABEL, field_unit
from rtradar.report.figures.maps import bin_edges, colour_limits, new_figure, save_figure
from rtradar.scene import Scene

_UPRIGHT = 0.5
"""Largest vertical component of the normals of walls in a plan; others are floor or ceiling."""


def draw_plan(
    path: Path,
    scene: Scene,
    radar: Radar,
    track: NDArray[np.float64],
    paths: Mapping[str, NDArray[np.float64]],
    title: str,
) -> None:
    """The room from above: walls, furniture, radar, the person's way, and paths of echoes.

    Parameters
    ----------
    path : path
        PNG file.
    scene : Scene
    radar : Radar
        Where it stands.
    track : (time, 2) float64
        Where the person's root goes [m].
    paths : mapping of str to (point, 3) float64
        Corners of each path from Tx to Rx [m].
    title : str
    """
    figure = new_figure(10, 6)
    axes = figure.subplots()
    walls = walls_in_plan(scene)
    corners = np.array([corner for first, last, _ in walls for corner in (first, last)])
    for first, last, name in walls:
        axes.plot(*zip(first, last, strict=True), color="black", linewidth=2.5)
        middle = (first + last) / 2
        # Outside the room, where no furniture has its name.
        across = np.abs(last - first) < np.abs(last - first).max()
        outward = 9 * across * np.sign(middle - corners.mean(axis=0))
        text = axes.annotate(
            name,
            tuple(middle),
            xytext=tuple(outward),
            textcoords="offset points",
            fontsize=7,
            color="dimgrey",
        )
        text.set(ha="center", va="center")
    for piece in scene.furniture:
        triangles = piece.triangles()
        corners = triangles.corners[..., :2]
        (ax, ay), (bx, by) = ((corners[:, k] - corners[:, 0]).T for k in (1, 2))
        # Faces that look up cover a closed body; upright ones cover nothing.
        seen = ax * by - ay * bx
        covering = corners[seen > 0 if triangles.closed else seen != 0]
        axes.add_collection(PolyCollection(list(covering), color="tan", alpha=0.5, linewidth=0))
        axes.annotate(
            piece.name,
            tuple(corners.reshape(-1, 2).mean(axis=0)),
            fontsize=7,
            color="saddlebrown",
            ha="center",
        )
    axes.set_prop_cycle(
        color=[colormaps["tab20"](number) for number in range(20)]
    )  # more than ten paths
    for name, corners in paths.items():
        axes.plot(corners[:, 0], corners[:, 1], linewidth=1, label=name)
    axes.plot(track[:, 0], track[:, 1], color="crimson", linewidth=2.5, label="person")
    axes.plot(*radar.position_m[:2], "k^", markersize=9, label="radar")
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
    axes.set_aspect("equal")
    axes.grid(alpha=0.3)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), fontsize=7)
    save_figure(figure, path)


def walls_in_plan(scene: Scene) -> list[tuple[NDArray[np.float64], NDArray[np.float64], str]]:
    """Feet of the upright walls: both ends (2,) [m] and the name."""
    found = []
    for wall in scene.walls:
        if abs(float(wall.normal[2])) < _UPRIGHT:
            corners = wall.corners[:, :2]
            gaps = np.linalg.norm(corners[:, None] - corners[None], axis=-1)
            one, other = np.unravel_index(int(gaps.argmax()), gaps.shape)
            found.append((corners[one], corners[other], wall.name))
    return found


def draw_before_after(
    path: Path,
    maps: Mapping[str, tuple[NDArray[np.floating], NDArray[np.bool_]]],
    ghosts: Sequence[tuple[str, float, float]],
    radar: Radar,
    title: str,
) -> None:
    """Range-Doppler maps with their detections, and ghosts where they are predicted.

    Parameters
    ----------
    path : path
        PNG file.
    maps : mapping of str to ((range, velocity) float, (range, velocity) bool)
        Power summed over all channels [m^2], and detections, by panel.
    ghosts : sequence of (str, float, float)
        Path over walls, range [m] and velocity [m/s].
    radar : Radar
    title : str
    """
    figure = new_figure(1 + 5.5 * len(maps), 5)
    panels = figure.subplots(1, len(maps), sharex=True, sharey=True, squeeze=False)[0]
    unit = field_unit(radar, range_m=radar.range_m[:, None])
    levels = {name: unit.level(power / radar.n_channels) for name, (power, _) in maps.items()}
    limits = [colour_limits(level) for level in levels.values()]
    low, high = min(low for low, _ in limits), max(high for _, high in limits)
    for axes, (name, (power, mask)) in zip(panels, maps.items(), strict=True):
        velocity = radar.velocity_mps(power.shape[1])
        extent = (*bin_edges(velocity), *bin_edges(radar.range_m))
        image = axes.imshow(
            levels[name],
            origin="lower",
            aspect="auto",
            cmap="viridis",
            vmin=low,
            vmax=high,
            extent=extent,
        )
        rows, columns = np.nonzero(mask)
        axes.scatter(
            velocity[columns], radar.range_m[rows], s=1, color="white", alpha=0.5, label="detected"
        )
        axes.set(xlabel=VELOCITY_LABEL, title=f"{name}\n{len(rows)} detections")
        axes.set(xlim=bin_edges(velocity), ylim=bin_edges(radar.range_m))
        _mark(axes, ghosts, radar)
    panels[0].set_ylabel("Range [m]")
    panels[0].legend(loc="upper right", fontsize=8, facecolor="dimgrey", labelcolor="white")
    figure.colorbar(image, ax=list(panels), label=unit.label("mean of channels"))
    figure.suptitle(title, wrap=True)
    save_figure(figure, path)


def _mark(axes: Axes, ghosts: Sequence[tuple[str, float, float]], radar: Radar) -> None:
    """Draw circles at (name, range [m], horizontal coordinate) within the radar's range.

    Names stand beside them toward the middle of the axes, far enough apart to be read.
    """
    label = "ghost over a wall, predicted"
    inside = sorted(
        (ghost for ghost in ghosts if ghost[1] < radar.max_range_m), key=lambda ghost: ghost[1]
    )
    (left, right), gap = axes.get_xlim(), 0.035 * radar.max_range_m
    placed: list[tuple[float, float]] = []
    for name, distance, across in inside:
        axes.plot(
            across,
            distance,
            "o",
            markerfacecolor="none",
            markeredgecolor="red",
            markersize=9,
            label=label,
        )
        label = ""
        toward = 1 if across < (left + right) / 2 else -1
        beside, place = across + 0.08 * toward * (right - left), distance
        for other, taken in placed:
            if abs(other - beside) < 0.25 * (right - left):
                place = max(place, taken + gap)
        placed.append((beside, place))
        axes.annotate(
            name,
            (across, distance),
            xytext=(beside, place),
            fontsize=7,
            color="white",
            ha="left" if toward > 0 else "right",
            va="center",
            bbox={"facecolor": "black", "alpha": 0.6, "edgecolor": "none", "pad": 1},
            arrowprops={
                "arrowstyle": "-",
                "color": "red",
                "linewidth": 0.6,
                "shrinkA": 0,
                "shrinkB": 4,
            },
        )


def draw_range_azimuth_with_walls(
    path: Path,
    power: NDArray[np.floating],
    azimuth: NDArray[np.float64],
    scene: Scene,
    radar: Radar,
    ghosts: Sequence[tuple[str, float, float]],
    title: str,
) -> None:
    """Power over azimuth and range, with upright walls drawn where they are.

    Parameters
    ----------
    path : path
        PNG file.
    power : (range, azimuth) float
        [m^2].
    azimuth : (azimuth,) float64
        [rad].
    scene : Scene
    radar : Radar
    ghosts : sequence of (str, float, float)
        Path over walls, range [m] and azimuth [rad].
    title : str
    """
    figure = new_figure(8, 5.5)
    axes = figure.subplots()
    unit = field_unit(radar, range_m=radar.range_m[:, None])
    values = unit.level(power / HANN_BINS)
    extent = (*bin_edges(np.degrees(azimuth)), *bin_edges(radar.range_m))
    low, high = colour_limits(
        values, 50
    )  # cells that were not detected are zero, and zero has no decibels
    image = axes.imshow(
        values, origin="lower", aspect="auto", cmap="viridis", vmin=low, vmax=high, extent=extent
    )
    place = np.asarray(radar.position_m)
    for first, last, name in walls_in_plan(scene):
        along = first + np.linspace(0, 1, 200)[:, None] * (last - first) - place[:2]
        angle, distance = (
            np.degrees(np.arctan2(along[:, 1], along[:, 0])),
            np.hypot(along[:, 0], along[:, 1]),
        )
        axes.plot(angle, distance, color="white", linewidth=1.2, linestyle="--")
        inside = np.flatnonzero(
            (angle > extent[0]) & (angle < extent[1]) & (distance < radar.max_range_m)
        )
        if len(inside):
            near = inside[len(inside) // 6]  # beside the middle, where names of ghosts stand
            axes.annotate(name, (angle[near], distance[near]), fontsize=8, color="white")
    axes.set(
        xlabel=angle_label("azimuth", radar),
        ylabel="Range [m]",
        title=title,
        xlim=extent[:2],
        ylim=extent[2:],
    )
    _mark(axes, [(name, distance, np.degrees(angle)) for name, distance, angle in ghosts], radar)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper right", fontsize=8, facecolor="dimgrey", labelcolor="white")
    figure.colorbar(image, label=unit.label("detected cells"))
    save_figure(figure, path)
