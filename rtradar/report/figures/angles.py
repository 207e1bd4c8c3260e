"""Pictures of angles: range-azimuth and range-elevation maps, and the cloud in the room."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rtradar.process import measured_angles
from rtradar.radar import Radar
from rtradar.report.figures.field_units import HANN_BINS, VELOCITY_LABEL, field_unit
from rtradar.report.figures.maps import bin_edges, colour_limits, new_figure, save_figure


def draw_range_angle(
    path: Path,
    maps: Mapping[str, tuple[NDArray[np.floating], NDArray[np.float64]]],
    radar: Radar,
    title: str,
    *,
    spreading: bool = True,
) -> None:
    """Power over range and angle, a panel each.

    Parameters
    ----------
    path : path
        PNG file.
    maps : mapping of str to ((range, angle) float, (angle,) float64)
        By the name of the angle: power summed over detected cells [m^2], and the angles [rad].
    radar : Radar
    title : str
    spreading : bool
        Whether amplitudes hold the loss over distance.
    """
    figure = new_figure(1 + 5 * len(maps), 4.5)
    panels = figure.subplots(1, len(maps), sharey=True, squeeze=False)[0]
    unit = field_unit(radar, spreading=spreading, range_m=radar.range_m[:, None])
    for axes, (name, (power, angles)) in zip(panels, maps.items(), strict=True):
        values = unit.level(
            power / HANN_BINS
        )  # what one echo gives is spread over as many velocities
        extent = (*bin_edges(np.degrees(angles)), *bin_edges(radar.range_m))
        low, high = colour_limits(
            values, 40
        )  # cells that were not detected are zero, and zero has no decibels
        image = axes.imshow(
            values,
            origin="lower",
            aspect="auto",
            cmap="viridis",
            vmin=low,
            vmax=high,
            extent=extent,
        )
        axes.set(xlabel=angle_label(name, radar), title=f"Range-{name}")
        figure.colorbar(image, ax=axes, label=unit.label("detected cells"))
    panels[0].set_ylabel("Range [m]")
    figure.suptitle(title, wrap=True)
    save_figure(figure, path)


def angle_label(name: str, radar: Radar) -> str:
    """Label of the axis; without an array along z, azimuth is the angle of a cone."""
    cone = name == "azimuth" and measured_angles(radar) == ("azimuth",)
    return (
        "Azimuth [°] (cone angle; elevation is not measured)"
        if cone
        else f"{name.capitalize()} [°]"
    )


def draw_spatial_cloud(
    path: Path, points: NDArray[np.float64], velocity: NDArray[np.float64], radar: Radar, title: str
) -> None:
    """Draw points from the side and from above, coloured by velocity.

    For a linear array only the view that it measures is drawn.

    Parameters
    ----------
    path : path
        PNG file.
    points : (point, 3) float64
        World [m]; NaN in a coordinate that is not measured.
    velocity : (point,) float64
        [m/s].
    radar : Radar
        Drawn where it stands.
    title : str
    """
    names = measured_angles(radar)
    views = [axis for axis, name in ((2, "elevation"), (1, "azimuth")) if name in names]
    figure = new_figure(1 + 5 * len(views), 4.8)
    largest = float(np.abs(velocity).max(initial=1e-9))
    x_label = "x [m]" if len(views) == 2 else "x [m], by the distance from the line of the array"
    for axes, up in zip(figure.subplots(1, len(views), squeeze=False)[0], views, strict=True):
        dots = axes.scatter(
            points[:, 0],
            points[:, up],
            c=velocity,
            s=2,
            alpha=0.6,
            cmap="coolwarm",
            vmin=-largest,
            vmax=largest,
        )
        axes.plot(radar.position_m[0], radar.position_m[up], "k^", label="radar")
        view = "From the side" if up == 2 else "From above"
        missing = (
            "" if len(views) == 2 else f"; {'azimuth' if up == 2 else 'elevation'} is not measured"
        )
        axes.set(xlabel=x_label, ylabel=f"{'xyz'[up]} [m]", title=view + missing)
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(alpha=0.3)
        axes.legend(loc="upper right")
    figure.colorbar(dots, ax=figure.axes, label=VELOCITY_LABEL)
    figure.suptitle(f"{title}\n{len(points)} points", wrap=True)
    save_figure(figure, path)
