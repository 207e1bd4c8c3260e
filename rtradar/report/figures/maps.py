"""What pictures of maps and clouds have in common, those of one run and those of several."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.process import measured_angles
from rtradar.radar import Radar
from rtradar.report.figures.canvas import VELOCITY_LABEL
from rtradar.system.figure_style import DIVERGING


def angle_label(name: str, radar: Radar) -> str:
    """Label of the axis; without an array along z, azimuth is the angle of a cone."""
    if name == "azimuth" and measured_angles(radar) == ("azimuth",):
        return "Azimuth [°] (cone angle; elevation is not measured)"
    return f"{name.capitalize()} [°]"


def rdt_points(
    axes: Any, points: NDArray[np.float64], title: str, *, fastest: float | None = None, s: float
) -> Any:
    """Draw points (point, 3) [s, m, m/s] in 3D, coloured by velocity up to ``fastest`` [m/s]."""
    if fastest is None:
        fastest = float(np.abs(points[:, 2]).max(initial=1e-9))
    axes.set(xlabel="Time [s]", ylabel="Range [m]", zlabel=VELOCITY_LABEL, title=title)
    colours = {"c": points[:, 2], "cmap": DIVERGING, "vmin": -fastest, "vmax": fastest}
    return axes.scatter(*points.T, s=s, **colours)
