"""Windows of RDT clouds, as the recogniser sees them, and what describes them in few numbers."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

WINDOW_S, HOP_S = 1.4, 0.35
"""Length of a window of a cloud, and the largest step to the next [s].

The clouds of a data set are of captures of 1.6 s. What lies within 0.1 s of their ends is left out,
because the surface of which clouds are made is closed there."""

EDGE_S = 0.1
"""Time at each end of a capture that no window reaches [s], twice that of a frame."""

SCALES = (0.5, 0.5, 2.5)
"""Time [s], range [m] and velocity [m/s] that are one for the network."""


def cut_windows(points: NDArray[np.float64], length_s: float) -> list[NDArray[np.float64]]:
    """Cut an RDT cloud (point, 3) of a capture of this length [s] into windows.

    A shorter capture is one window. Windows may be empty.
    """
    first, last = EDGE_S, max(length_s - EDGE_S, EDGE_S)
    rest = max(last - first - WINDOW_S, 0.0)
    count = 1 + math.ceil(rest / HOP_S - 1e-6)
    starts = first + (rest * np.arange(count) / (count - 1) if count > 1 else np.zeros(1))
    times = points[:, 0]
    return [points[(times >= start) & (times < start + WINDOW_S)] for start in starts]


def normalised(
    points: NDArray[np.float64], n_points: int, random: np.random.Generator
) -> NDArray[np.float64]:
    """Scale ``n_points`` of a window (point, 3), or all that it has, for the network."""
    if len(points) > n_points:
        points = points[random.choice(len(points), n_points, replace=False)]
    middle = np.array([points[:, 0].mean(), points[:, 1].mean(), 0.0])
    return (points - middle) / SCALES


def describe(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Describe a window (point, 3) in the numbers by which an unusual one is known, (8,).

    The spreads of time, range and velocity, the 5th, 50th and 95th percentile of velocity, the
    correlation of range and velocity, and the fraction of points slower than 0.5 m/s.
    """
    spread = points.std(axis=0)
    centred = points - points.mean(axis=0)
    together = float(np.mean(centred[:, 1] * centred[:, 2]) / max(spread[1] * spread[2], 1e-9))
    slow = float(np.mean(np.abs(points[:, 2]) < 0.5))
    return np.array([*spread, *np.percentile(points[:, 2], (5, 50, 95)), together, slow])
