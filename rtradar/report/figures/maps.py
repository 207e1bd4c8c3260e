"""Pictures of maps and clouds of a run, with axes and units, as PNG files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.process import WindowFunctions, measured_angles
from rtradar.process.window_functions import DEFAULT_WINDOWS, noise_bandwidth_bins
from rtradar.radar import Radar
from rtradar.report.figures import canvas
from rtradar.report.figures.canvas import VELOCITY_LABEL, draw_levels, field_unit


def draw_range_time(
    path: Path,
    power: NDArray[np.floating],
    slow_time: NDArray[np.float64],
    radar: Radar,
    title: str,
    *,
    spreading: bool = True,
) -> None:
    """Draw power over time and range.

    ``power`` (slow_time, range) is the mean of the channels [m^2] at evenly spaced times
    ``slow_time`` [s]; ``spreading`` tells whether amplitudes include the spreading loss.
    """
    figure = canvas.new_figure(8, 4.5)
    axes = figure.subplots()
    unit = field_unit(radar, spreading=spreading, range_m=radar.range_m)
    image = draw_levels(axes, unit.level(power).T, slow_time, radar.range_m)
    axes.set(xlabel="Time [s]", ylabel="Range [m]", title=title)
    figure.colorbar(image, label=unit.label("mean of channels"))
    canvas.save_figure(figure, path)


def draw_range_doppler(
    path: Path,
    power: NDArray[np.floating],
    mask: NDArray[np.bool_],
    radar: Radar,
    title: str,
    *,
    spreading: bool = True,
) -> None:
    """Draw a range-Doppler map, and beside it the map with its detections.

    ``power`` (range, velocity) is summed over all channels [m^2]; ``mask`` is True where a cell is
    detected.
    """
    figure = canvas.new_figure(11, 4.5)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    unit = field_unit(radar, spreading=spreading, range_m=radar.range_m[:, None])
    values = unit.level(power / radar.n_channels)
    velocity, distance = radar.velocity_mps(power.shape[1]), radar.range_m
    image = draw_levels(left, values, velocity, distance)
    draw_levels(right, values, velocity, distance, cmap="Greys")
    rows, columns = np.nonzero(mask)
    label = f"{len(rows)} detections"
    right.scatter(velocity[columns], distance[rows], s=3, color="crimson", label=label)
    right.legend(loc="upper right")
    for axes, name in ((left, "Range-Doppler map"), (right, "Detections, over the map in grey")):
        axes.set(xlabel=VELOCITY_LABEL, title=name)
    left.set_ylabel("Range [m]")
    figure.colorbar(image, ax=[left, right], label=unit.label("mean of channels"))
    figure.suptitle(title, wrap=True)
    canvas.save_figure(figure, path)


def draw_spectrogram(
    path: Path,
    power: NDArray[np.floating],
    time: NDArray[np.float64],
    velocity: NDArray[np.float64],
    radar: Radar,
    title: str,
    *,
    spreading: bool = True,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
) -> None:
    """Draw a spectrogram, time across and velocity up.

    ``power`` (time, velocity), of at least one row, is that of one channel summed over range [m^2],
    at evenly spaced times [s] and ascending velocities [m/s]. The ``window_functions`` are those of
    the transforms that gave the power.
    """
    figure = canvas.new_figure(8, 4.5)
    axes = figure.subplots()
    # One echo is spread over as many range bins.
    power = power / noise_bandwidth_bins(window_functions.range, radar.samples_per_chirp)
    unit = field_unit(radar, spreading=spreading, strongest_m2=float(power.max()))
    image = draw_levels(axes, unit.level(power).T, time, velocity)
    axes.set(xlabel="Time [s]", ylabel=VELOCITY_LABEL, title=title)
    figure.colorbar(image, label=unit.label("one channel"))
    canvas.save_figure(figure, path)


def draw_range_angle(
    path: Path,
    maps: Mapping[str, tuple[NDArray[np.floating], NDArray[np.float64]]],
    radar: Radar,
    title: str,
    *,
    spreading: bool = True,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
) -> None:
    """Draw power over range and angle, with a panel for each angle.

    ``maps`` are power summed over detected cells (range, angle) [m^2] and the angles (angle,) [rad]
    by the name of the angle. The ``window_functions`` are as for `draw_spectrogram`.
    """
    figure = canvas.new_figure(1 + 5 * len(maps), 4.5)
    panels = figure.subplots(1, len(maps), sharey=True, squeeze=False)[0]
    unit = field_unit(radar, spreading=spreading, range_m=radar.range_m[:, None])
    # One echo is spread over as many velocities.
    velocities = noise_bandwidth_bins(window_functions.doppler, radar.cycles_per_frame)
    for axes, (name, (power, angles)) in zip(panels, maps.items(), strict=True):
        values = unit.level(power / velocities)
        # Cells that were not detected are zero, which has no decibels.
        limits = canvas.colour_limits(values, 40)
        image = draw_levels(axes, values, np.degrees(angles), radar.range_m, limits)
        axes.set(xlabel=angle_label(name, radar), title=f"Range-{name}")
        figure.colorbar(image, ax=axes, label=unit.label("detected cells"))
    panels[0].set_ylabel("Range [m]")
    figure.suptitle(title, wrap=True)
    canvas.save_figure(figure, path)


def angle_label(name: str, radar: Radar) -> str:
    """Label of the axis; without an array along z, azimuth is the angle of a cone."""
    if name == "azimuth" and measured_angles(radar) == ("azimuth",):
        return "Azimuth [°] (cone angle; elevation is not measured)"
    return f"{name.capitalize()} [°]"


def draw_rdt_cloud(path: Path, points: NDArray[np.float64], title: str) -> None:
    """Draw the range-Doppler-time cloud (point, 3) [s, m, m/s], coloured by velocity."""
    figure = canvas.new_figure(8, 6.5)
    axes = figure.add_subplot(projection="3d")
    dots = rdt_points(axes, points, f"{title}\n{len(points)} points", s=4)
    axes.set_box_aspect((1.6, 1, 1))
    figure.colorbar(dots, label=VELOCITY_LABEL, shrink=0.6, pad=0.1)
    canvas.save_figure(figure, path)


def rdt_points(
    axes: Any, points: NDArray[np.float64], title: str, *, fastest: float | None = None, s: float
) -> Any:
    """Draw points (point, 3) [s, m, m/s] in 3D, coloured by velocity up to ``fastest`` [m/s]."""
    if fastest is None:
        fastest = float(np.abs(points[:, 2]).max(initial=1e-9))
    axes.set(xlabel="Time [s]", ylabel="Range [m]", zlabel=VELOCITY_LABEL, title=title)
    colours = {"c": points[:, 2], "cmap": "coolwarm", "vmin": -fastest, "vmax": fastest}
    return axes.scatter(*points.T, s=s, **colours)


def draw_spatial_cloud(
    path: Path, points: NDArray[np.float64], velocity: NDArray[np.float64], radar: Radar, title: str
) -> None:
    """Draw points from the side and from above, coloured by their ``velocity`` (point,) [m/s].

    ``points`` (point, 3) are world coordinates [m], NaN in one that is not measured: for a linear
    array only the view that it measures is drawn.
    """
    names = measured_angles(radar)
    views = [axis for axis, name in ((2, "elevation"), (1, "azimuth")) if name in names]
    figure = canvas.new_figure(1 + 5 * len(views), 4.8)
    largest = float(np.abs(velocity).max(initial=1e-9))
    colours = {"c": velocity, "cmap": "coolwarm", "vmin": -largest, "vmax": largest}
    x_label = "x [m]" if len(views) == 2 else "x [m], by the distance from the line of the array"
    for axes, up in zip(figure.subplots(1, len(views), squeeze=False)[0], views, strict=True):
        dots = axes.scatter(points[:, 0], points[:, up], s=2, alpha=0.6, **colours)
        axes.plot(radar.position_m[0], radar.position_m[up], "k^", label="radar")
        view, other = ("From the side", "azimuth") if up == 2 else ("From above", "elevation")
        missing = "" if len(views) == 2 else f"; {other} is not measured"
        axes.set(xlabel=x_label, ylabel=f"{'xyz'[up]} [m]", title=view + missing)
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(alpha=0.3)
        axes.legend(loc="upper right")
    figure.colorbar(dots, ax=figure.axes, label=VELOCITY_LABEL)
    figure.suptitle(f"{title}\n{len(points)} points", wrap=True)
    canvas.save_figure(figure, path)
