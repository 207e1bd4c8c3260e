"""Windows of RDT clouds, as the recogniser sees them."""

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
