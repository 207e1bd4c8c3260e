"""The picture of a radar: its array, and the ranges and velocities that it can measure."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from rtradar.radar.display import limit_rows, measured_angles
from rtradar.radar.radar import Radar
from rtradar.system.figure_style import (
    STYLE,
    axes_given,
    dress,
    figure_for,
    theme_of,
    write_heading,
)


def plot_radar(radar: Radar, ax: Axes | None) -> Axes:
    """Draw the array of a radar, and beside it the limits, as `Radar.plot` does."""
    _, ax = axes_given(None, ax)
    if ax is not None:
        _draw_array(radar, ax, f"{radar.name}: array, seen from behind")
        return ax
    figure = figure_for(4.3)
    array, limits = figure.subplots(1, 2)
    write_heading(figure, f"Radar {radar.name}")
    _draw_array(radar, array, "Array, seen from behind")
    _draw_limits(radar, limits)
    return array


def _draw_array(radar: Radar, axes: Axes, title: str) -> None:
    theme = theme_of(axes)
    tx, rx = (1e3 * places[:, 1:] for places in (radar.tx_m, radar.rx_m))
    kept = np.unique(radar.rx_of_tx)
    virtual = (tx[:, None] + rx[radar.rx_of_tx]).reshape(-1, 2)
    blue, orange = theme.cycle[:2]
    points: dict[str, Any] = {"linestyle": "none", "markerfacecolor": "none"}
    drawn = {"s": virtual, "o": rx[kept], "^": tx}
    styles: dict[str, dict[str, Any]] = {
        "s": {"color": theme.faint, "markersize": 3, "label": f"{len(virtual)} virtual (Tx + Rx)"},
        "o": {"color": blue, "markersize": 4.5, "label": f"{len(kept)} Rx"},
        "^": {"color": orange, "markersize": 8, "label": f"{len(tx)} Tx"},
    }
    for marker, places in drawn.items():
        axes.plot(*places.T, marker=marker, **points, **styles[marker])
    reach = 1.12 * max(5.0, *(float(np.abs(places).max()) for places in drawn.values()))
    upward = max(0.7 * reach, 1.12 * float(np.abs(virtual[:, 1]).max()))
    # The view is that of the radar, which has y at its left. The legend is above the array.
    axes.set(xlim=(reach, -reach), ylim=(-upward, upward + 0.75 * reach))
    axes.set(xlabel="y [mm]", ylabel="z [mm]")
    axes.set_aspect("equal")
    axes.legend(loc="upper center", handletextpad=0.2, borderpad=0.3)
    dress(axes, title=title)


def _draw_limits(radar: Radar, axes: Axes) -> None:
    theme, rows = theme_of(axes), limit_rows(radar)
    fastest, farthest = radar.max_velocity_mps, radar.max_range_m
    colour = theme.cycle[0]
    size: dict[str, Any] = {"width": 2 * fastest, "height": farthest}
    axes.add_patch(Rectangle((-fastest, 0), **size, facecolor=colour, alpha=0.18))
    axes.add_patch(Rectangle((-fastest, 0), **size, fill=False, edgecolor=colour))
    text = "\n\n".join(
        (
            f"{rows['Maximum range']} and {rows['Maximum velocity']}\nwithout ambiguity",
            f"one cell: {rows['Range resolution']}\nby {rows['Velocity resolution']}",
            f"angle: {rows['Maximum angle']}".replace(" and ", "\nand "),
            *([f"beam: {rows['Angular resolution']}"] if measured_angles(radar) else []),
        )
    )
    style: dict[str, Any] = {
        "ha": "center",
        "va": "center",
        "fontsize": STYLE["font.size"],
        "color": theme.text,
    }
    axes.text(0, farthest / 2, text, linespacing=1.2, **style)
    axes.set(xlim=(-1.2 * fastest, 1.2 * fastest), ylim=(0, 1.12 * farthest))
    axes.set(xlabel="Velocity [m/s]", ylabel="Range [m]")
    dress(axes, title="What it measures")
