"""How far from the other parts of a body of ellipsoids lines of sight pass, in closed form: most need no ray to be judged."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

DOUBTFUL = 0.005
"""Rays that pass nearer to a surface than this, in units where the ellipsoid is a unit sphere, are for the tracer.

Its triangles lie up to 0.0007 from the sphere (`rtradar.trace.body_tracer`).
"""


def clearances(
    origins: NDArray[np.float64],
    targets: NDArray[np.float64],
    own: NDArray[np.int64],
    centres: NDArray[np.float64],
    frames: NDArray[np.float64],
    semi_axes: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Least distance of each line of sight from the other parts, each stretched to a unit sphere.

    Parameters
    ----------
    origins, targets : (ray, 3) float64
        Ends, world [m].
    own : (ray,) int64
        Part that the target is on, which does not count.
    centres, frames, semi_axes : (part, 3), (part, 3, 3), (part, 3) float64
        Pose [m].

    Returns
    -------
    (ray,) float64
        Below 0 where the line goes through another part; at most 1, where none is near.
    """
    arrays = (np.ascontiguousarray(a, dtype=np.float64) for a in (origins, targets, centres, frames, semi_axes))
    starts, ends, places, turns, axes = arrays
    out = np.empty(len(starts))
    inverse = np.ascontiguousarray(np.swapaxes(turns, 1, 2) / axes[:, :, None])
    _clearances(starts, ends, np.ascontiguousarray(own, dtype=np.int64), places, inverse, axes.max(axis=1), out)
    return out


@njit(cache=True, error_model="numpy", parallel=True)
def _clearances(origins, targets, own, centres, inverse, longest, out):  # type: ignore[no-untyped-def]
    for ray in prange(len(origins)):
        least = 1.0
        o, t = origins[ray], targets[ray]
        d0, d1, d2 = t[0] - o[0], t[1] - o[1], t[2] - o[2]
        whole = d0 * d0 + d1 * d1 + d2 * d2
        for part in range(len(centres)):
            if part == own[ray]:
                continue
            c = centres[part]
            # Farther than twice the longest semi-axis from the centre: nothing to look at.
            w0, w1, w2 = c[0] - o[0], c[1] - o[1], c[2] - o[2]
            share = min(1.0, max(0.0, (w0 * d0 + w1 * d1 + w2 * d2) / whole))
            w0, w1, w2 = w0 - share * d0, w1 - share * d1, w2 - share * d2
            if w0 * w0 + w1 * w1 + w2 * w2 > 4 * longest[part] * longest[part]:
                continue
            m = inverse[part]
            a0 = m[0, 0] * (o[0] - c[0]) + m[0, 1] * (o[1] - c[1]) + m[0, 2] * (o[2] - c[2])
            a1 = m[1, 0] * (o[0] - c[0]) + m[1, 1] * (o[1] - c[1]) + m[1, 2] * (o[2] - c[2])
            a2 = m[2, 0] * (o[0] - c[0]) + m[2, 1] * (o[1] - c[1]) + m[2, 2] * (o[2] - c[2])
            b0 = m[0, 0] * d0 + m[0, 1] * d1 + m[0, 2] * d2
            b1 = m[1, 0] * d0 + m[1, 1] * d1 + m[1, 2] * d2
            b2 = m[2, 0] * d0 + m[2, 1] * d1 + m[2, 2] * d2
            share = min(1.0, max(0.0, -(a0 * b0 + a1 * b1 + a2 * b2) / (b0 * b0 + b1 * b1 + b2 * b2)))
            a0, a1, a2 = a0 + share * b0, a1 + share * b1, a2 + share * b2
            least = min(least, math.sqrt(a0 * a0 + a1 * a1 + a2 * a2) - 1)
        out[ray] = least
