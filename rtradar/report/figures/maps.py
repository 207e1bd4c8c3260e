"""What pictures of maps and clouds have in common, those of one run and those of several."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.process import measured_angles
from rtradar.radar import Radar
from rtradar.report.figures.canvas import VELOCITY_LABEL
from rtradar.report.figures.fitting import fitted_limits
from rtradar.system.figure_style import DIVERGING

_COLUMNS = 600
"""Time steps in a picture, those of 3 s; longer maps are averaged, so that memory does not grow."""

_ROWS = 1024
"""Time steps of a map that are read at once."""

_NOISY = 0.02  # fraction of the detected ranges whose strongest angle may be one of noise


def angle_label(name: str, radar: Radar) -> str:
    """Label of the axis; without an array along z, azimuth is the angle of a cone."""
    if name == "azimuth" and measured_angles(radar) == ("azimuth",):
        return "Azimuth [°] (cone angle; elevation is not measured)"
    return f"{name.capitalize()} [°]"


def angle_view(
    power: NDArray[np.floating],
    angles: NDArray[np.float64],
    radar: Radar,
    ghosts: Sequence[tuple[float, float]] = (),
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the limits of angle and range that show what is detected, and ghosts.

    ``power`` (range, angle) is zero in ranges without a detection. Angles are fitted to where each
    range is strongest, for sidelobes of the array fill all angles. ``ghosts`` are their angles and
    ranges.
    """
    detected: NDArray[np.bool_] = np.asarray(power.any(axis=1))
    near = detected[:, None] & (power > power.max(axis=1, keepdims=True) / 4)
    counts = near.sum(axis=0)
    wide = fitted_limits(
        counts, angles, include=[one for one, _ in ghosts], handful=_NOISY * counts.sum()
    )
    return wide, fitted_limits(detected, radar.range_m, include=[one for _, one in ghosts])


def rdt_points(axes: Any, points: NDArray[np.float64], *, fastest: float, s: float) -> Any:
    """Draw points (point, 3) [s, m, m/s] in 3D, coloured by velocity up to ``fastest`` [m/s]."""
    axes.set(xlabel="Time [s]", ylabel="Range [m]", zlabel=VELOCITY_LABEL)
    few_ticks(axes, 5)
    colours = {"c": points[:, 2], "cmap": DIVERGING, "vmin": -fastest, "vmax": fastest}
    return axes.scatter(*points.T, s=s, **colours)


def few_ticks(axes: Any, most: int) -> None:
    """Leave axes in 3D so many steps at most between their ticks."""
    from matplotlib.ticker import MaxNLocator

    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(most))


def thinned(
    data: Any, times: NDArray[np.float64]
) -> tuple[NDArray[np.floating], NDArray[np.float64]]:
    """Return a map (time, ...) and its times [s], averaged to a few hundred steps.

    Parameters
    ----------
    data : (time, ...) xarray.DataArray or h5py.Dataset
        Map, of which a part at a time is read.
    times : (time,) float64
        Times of the map [s].

    Returns
    -------
    power : (step, ...) float
        Mean of the map in each step.
    times : (step,) float64
        Mean time of each step [s].
    """
    every = max(1, math.ceil(len(data) / _COLUMNS))
    if every == 1:
        return np.asarray(data), times
    at_once = every * max(1, _ROWS // every)  # each access to a file takes its time
    power = np.concatenate(
        [
            _means(np.asarray(data[first : first + at_once]), every)
            for first in range(0, len(data), at_once)
        ]
    )
    return power, _means(times, every)


def _means(values: NDArray[Any], every: int) -> NDArray[Any]:
    """Means of so many steps each, the last of what is left."""
    return np.stack([values[k : k + every].mean(axis=0) for k in range(0, len(values), every)])
