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

_PERCENTILES = (5, 25, 50, 75, 95)
_TIME_BINS = 8


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


def describe(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Describe a window (point, 3) in 36 numbers, of which none says when points lie in it.

    The statistics of range from its mean, and of velocity (`statistics`), the three correlations,
    the fraction of points slower than 0.5 m/s, and the course of velocity (`course`).
    """
    centred = points - [points[:, 0].mean(), points[:, 1].mean(), 0.0]
    together, slow = correlations(centred), np.mean(np.abs(points[:, 2]) < 0.5)
    return np.concatenate(
        [statistics(centred[:, 1:]).ravel(), together, [slow], course(centred).ravel()]
    )


def statistics(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation, extremes and five percentiles of each column, (8, column)."""
    extremes = points.min(axis=0), points.max(axis=0)
    return np.stack([points.std(axis=0), *extremes, *np.percentile(points, _PERCENTILES, axis=0)])


def correlations(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Correlations of the three pairs of columns; 0 where one does not vary."""
    spread = points.std(axis=0)
    unit = (points - points.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    return np.array([np.mean(unit[:, a] * unit[:, b]) for a, b in ((0, 1), (0, 2), (1, 2))])


def course(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean and spread of velocity in each eighth of the time, (8, 2); 0 where no point lies."""
    time, velocity = points[:, 0], points[:, 2]
    edges = np.linspace(time.min(), time.max(), _TIME_BINS + 1)
    place = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, _TIME_BINS - 1)
    parts = [velocity[place == number] for number in range(_TIME_BINS)]
    return np.array([(part.mean(), part.std()) if len(part) else (0.0, 0.0) for part in parts])
