"""Pictures of angles: range-azimuth and range-elevation maps, and the cloud in the room."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar
from rtradar.report.figures import bin_edges, decibels, new_figure, save_figure


def draw_range_angle(
    path: Path, maps: Mapping[str, tuple[NDArray[np.floating], NDArray[np.float64]]], radar: Radar, title: str
) -> None:
    """Power over range and angle, a panel each.

    Parameters
    ----------
    path : path
        PNG file.
    maps : mapping of str to ((range, angle) float, (angle,) float64)
        By the name of the angle: power [m^2], and the angles [rad].
    radar : Radar
    title : str
    """
    figure = new_figure(1 + 5 * len(maps), 4.5)
    panels = figure.subplots(1, len(maps), sharey=True, squeeze=False)[0]
    for axes, (name, (power, angles)) in zip(panels, maps.items(), strict=True):
        values, low, high = decibels(power)
        extent = (*bin_edges(np.degrees(angles)), *bin_edges(radar.range_m))
        low = max(low, high - 40)  # cells that were not detected are zero, and zero has no decibels
        image = axes.imshow(values, origin="lower", aspect="auto", cmap="viridis", vmin=low, vmax=high, extent=extent)
        axes.set(xlabel=f"{name.capitalize()} [°]", title=f"Range-{name}")
        figure.colorbar(image, ax=axes, label="Power of detected cells [dB re 1 m²]")
    panels[0].set_ylabel("Range [m]")
    figure.suptitle(title)
    save_figure(figure, path)


def draw_spatial_cloud(path: Path, points: NDArray[np.float64], velocity: NDArray[np.float64], radar: Radar, title: str) -> None:
    """Points in the room from the side and from above, coloured by velocity.

    Parameters
    ----------
    path : path
        PNG file.
    points : (point, 3) float64
        World [m].
    velocity : (point,) float64
        [m/s].
    radar : Radar
        Drawn where it stands.
    title : str
    """
    figure = new_figure(11, 4.8)
    largest = float(np.abs(velocity).max(initial=1e-9))
    for axes, (across, up) in zip(figure.subplots(1, 2), ((0, 2), (0, 1)), strict=True):
        dots = axes.scatter(
            points[:, across], points[:, up], c=velocity, s=2, alpha=0.6, cmap="coolwarm", vmin=-largest, vmax=largest
        )
        axes.plot(radar.position_m[across], radar.position_m[up], "k^", label="radar")
        axes.set(xlabel=f"{'xyz'[across]} [m]", ylabel=f"{'xyz'[up]} [m]", title="From the side" if up == 2 else "From above")
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(alpha=0.3)
        axes.legend(loc="upper right")
    figure.colorbar(dots, ax=figure.axes, label="Velocity [m/s], positive receding")
    figure.suptitle(f"{title}: {len(points)} points")
    save_figure(figure, path)
