"""How far from the other parts of a body of ellipsoids lines of sight pass, in closed form: most need no ray to be judged."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined
from rtradar.trace.clearance import clearance

DOUBTFUL = 0.005
"""Rays that pass nearer to a surface than this, in units where the ellipsoid is a unit sphere, are for the tracer.

Its triangles lie up to 0.0007 from the sphere (`rtradar.trace.unit_sphere`).
"""


_NEAR = 1.1
"""Of its longest semi-axis: a line that passes the middle of a part farther away than this clears it by a tenth or more."""


def _contiguous(*arrays: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    return tuple(np.ascontiguousarray(array, dtype=np.float64) for array in arrays)


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
        Part that the target is on, which does not count; -1: all do.
    centres, frames, semi_axes : (part, 3), (part, 3, 3), (part, 3) float64
        Pose [m].

    Returns
    -------
    (ray,) float64
        Below 0 where the line goes through another part; 1 where it passes all of them by a tenth or more.
    """
    starts, ends, places, turns, axes = _contiguous(origins, targets, centres, frames, semi_axes)
    out = np.empty(len(starts))
    of_part, longest = np.ascontiguousarray(own, dtype=np.int64), axes.max(axis=1)
    near = _near(starts, ends, of_part, places, longest)
    _clearances(starts, ends, of_part, places, turns, axes, longest, near, out)
    return out


@inlined()
def _bundle(places, own, counts, middle, reach):
    """Mean (own, 3) of one end of the lines to each part, and how far (own,) squared they stray from it; added to zeros."""
    for ray in range(len(own)):
        for i in range(3):
            middle[own[ray], i] += places[ray, i] / counts[own[ray]]
    for ray in range(len(own)):
        square = 0.0
        for i in range(3):
            square += (places[ray, i] - middle[own[ray], i]) ** 2
        reach[own[ray]] = max(reach[own[ray]], square)


@compiled()
def _near(origins, targets, own, centres, longest):
    """Which parts come near any of the lines to a part, (own, part)."""
    # One more than there are parts: targets that are on none come last.
    parts = len(centres)
    middles, reach, counts = (
        np.zeros((parts + 1, 2, 3)),
        np.zeros((parts + 1, 2)),
        np.zeros(parts + 1),
    )
    for ray in range(len(own)):
        counts[own[ray]] += 1
    _bundle(origins, own, counts, middles[:, 0], reach[:, 0])
    _bundle(targets, own, counts, middles[:, 1], reach[:, 1])
    near = np.zeros((parts + 1, parts), dtype=np.bool_)
    for part in range(parts + 1):
        a, b = middles[part, 0], middles[part, 1]
        way0, way1, way2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        first, last = math.sqrt(reach[part, 0]), math.sqrt(reach[part, 1])
        span = way0 * way0 + way1 * way1 + way2 * way2
        length = math.sqrt(span)
        for other in range(parts):
            if other != part and counts[part] > 0:
                c = centres[other]
                gap0, gap1, gap2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
                share = min(
                    1.0, max(0.0, (gap0 * way0 + gap1 * way1 + gap2 * way2) / max(span, 1e-300))
                )
                square = (
                    (gap0 - share * way0) ** 2
                    + (gap1 - share * way1) ** 2
                    + (gap2 - share * way2) ** 2
                )
                # The bundle of lines narrows from one end to the other; as wide as where it is before this part.
                before = max(0.0, share - _NEAR * longest[other] / max(length, 1e-300))
                wide = max(first + before * (last - first), last) if first > last else last
                near[part, other] = math.sqrt(square) < _NEAR * longest[other] + wide
    return near


@compiled()
def _clearances(origins, targets, own, centres, frames, axes, longest, near, out):
    for ray in range(len(origins)):
        least = 1.0
        o, t = origins[ray], targets[ray]
        d0, d1, d2 = t[0] - o[0], t[1] - o[1], t[2] - o[2]
        whole = d0 * d0 + d1 * d1 + d2 * d2
        for part in range(len(centres)):
            if not near[own[ray], part]:
                continue
            c = centres[part]
            w0, w1, w2 = c[0] - o[0], c[1] - o[1], c[2] - o[2]
            share = min(1.0, max(0.0, (w0 * d0 + w1 * d1 + w2 * d2) / whole))
            w0, w1, w2 = w0 - share * d0, w1 - share * d1, w2 - share * d2
            if w0 * w0 + w1 * w1 + w2 * w2 > (_NEAR * longest[part]) ** 2:
                continue
            least = min(least, clearance(o, t, c, frames[part], axes[part]))
        out[ray] = least


def outline_rays(
    origins: NDArray[np.float64],
    targets: NDArray[np.float64],
    own: NDArray[np.int64],
    centres: NDArray[np.float64],
    frames: NDArray[np.float64],
    semi_axes: NDArray[np.float64],
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Rays along lines of sight past each part that they come near, in axes where this part is the unit sphere.

    Parameters
    ----------
    As of `clearances`.

    Returns
    -------
    rays : (7, n) float32
        Start, two radii before what may be met; direction; how far to go.
    whose : (n,) int64
        Line of sight of each.
    """
    starts, ends, places, turns, axes = _contiguous(origins, targets, centres, frames, semi_axes)
    return _outline_rays(
        starts, ends, np.ascontiguousarray(own, dtype=np.int64), places, turns, axes
    )


@compiled()
def _outline_rays(origins, targets, own, centres, frames, axes):
    most = len(origins) * len(centres)
    rays, whose, count = np.empty((7, most), dtype=np.float32), np.empty(most, dtype=np.int64), 0
    start, way = np.empty(3), np.empty(3)
    for ray in range(len(origins)):
        for part in range(len(centres)):
            if part == own[ray]:
                continue
            span, along = 0.0, 0.0
            for i in range(3):
                start[i], way[i] = 0.0, 0.0
                for j in range(3):
                    start[i] += (
                        frames[part, j, i] * (origins[ray, j] - centres[part, j]) / axes[part, i]
                    )
                    way[i] += (
                        frames[part, j, i] * (targets[ray, j] - origins[ray, j]) / axes[part, i]
                    )
                span += way[i] * way[i]
                along -= start[i] * way[i]
            nearest = min(1.0, max(0.0, along / span))
            square = 0.0
            for i in range(3):
                square += (start[i] + nearest * way[i]) ** 2
            if square > (1 + DOUBTFUL) ** 2:
                continue
            distance = math.sqrt(span)
            ahead = max(nearest - 2 / distance, 0.0)
            for i in range(3):
                rays[i, count], rays[3 + i, count] = start[i] + ahead * way[i], way[i] / distance
            rays[6, count] = (1 - ahead) * distance
            whose[count] = ray
            count += 1
    return rays[:, :count].copy(), whose[:count]
