"""Rays along lines of sight past the parts of a body that they come near.

Each ray is in axes where that part is the unit sphere. A part is ruled out only where a line passes
outside a ball or an ellipsoid that is a tenth larger than the part. Whether a ray meets the part
itself is for Mitsuba to say.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined

NEAR = 1.1
"""Size of the bounding volumes over that of the parts: lines outside of them have no ray traced."""


def near_rays(
    origins: NDArray[np.float64],
    targets: NDArray[np.float64],
    own: NDArray[np.int64],
    centres: NDArray[np.float64],
    frames: NDArray[np.float64],
    semi_axes: NDArray[np.float64],
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return one ray for each line of sight and each part that this line comes near.

    Parameters
    ----------
    origins, targets : (line, 3) float64
        Ends of the lines in world coordinates [m].
    own : (line,) int64
        Part that the target lies on, which cannot occlude it; -1 where there is none.
    centres, frames, semi_axes : (part, 3), (part, 3, 3), (part, 3) float64
        Pose of the body [m].

    Returns
    -------
    rays : (7, ray) float32
        Start, at most two radii before the point nearest to the centre of the unit sphere; unit direction; length.
    line : (ray,) int64
        Index of the line of sight.
    """
    arrays = (origins, targets, centres, frames, semi_axes)
    starts, ends, places, turns, axes = (
        np.ascontiguousarray(array, dtype=np.float64) for array in arrays
    )
    of_part = np.ascontiguousarray(own, dtype=np.int64)
    near = _near_parts(starts, ends, of_part, places, axes.max(axis=1))
    return _near_rays(starts, ends, of_part, places, turns, axes, near)


@inlined()
def _bundle(places, own, counts, middle, radius):
    """Add up the mean (own, 3) of one end of the lines to each part, and the largest square from it."""
    for ray in range(len(own)):
        for i in range(3):
            middle[own[ray], i] += places[ray, i] / counts[own[ray]]
    for ray in range(len(own)):
        square = 0.0
        for i in range(3):
            square += (places[ray, i] - middle[own[ray], i]) ** 2
        radius[own[ray]] = max(radius[own[ray]], square)


@compiled()
def _near_parts(origins, targets, own, centres, longest):
    """Return which parts' bounding balls come near the bundle of lines to a part, (own, part)."""
    # The last row is that of targets on no part, -1.
    parts = len(centres)
    middles, radii, counts = (
        np.zeros((parts + 1, 2, 3)),
        np.zeros((parts + 1, 2)),
        np.zeros(parts + 1),
    )
    for ray in range(len(own)):
        counts[own[ray]] += 1
    _bundle(origins, own, counts, middles[:, 0], radii[:, 0])
    _bundle(targets, own, counts, middles[:, 1], radii[:, 1])
    near = np.zeros((parts + 1, parts), dtype=np.bool_)
    for part in range(parts + 1):
        a, b = middles[part, 0], middles[part, 1]
        way0, way1, way2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        first, last = math.sqrt(radii[part, 0]), math.sqrt(radii[part, 1])
        span = way0 * way0 + way1 * way1 + way2 * way2
        length = math.sqrt(span)
        for other in range(parts):
            if other != part and counts[part] > 0:
                c = centres[other]
                gap0, gap1, gap2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
                fraction = (gap0 * way0 + gap1 * way1 + gap2 * way2) / max(span, 1e-300)
                fraction = min(1.0, max(0.0, fraction))
                square = (gap0 - fraction * way0) ** 2 + (gap1 - fraction * way1) ** 2
                square += (gap2 - fraction * way2) ** 2
                # The bundle narrows from one end to the other; its width where it comes before this part.
                before = max(0.0, fraction - NEAR * longest[other] / max(length, 1e-300))
                wide = max(first + before * (last - first), last) if first > last else last
                near[part, other] = math.sqrt(square) < NEAR * longest[other] + wide
    return near


@compiled()
def _near_rays(origins, targets, own, centres, frames, axes, near):
    # First pass over the bounding balls alone, which says how much room the rays take.
    parts = len(centres)
    most = 0
    for line in range(len(origins)):
        for part in range(parts):
            most += near[own[line], part] and part != own[line]
    rays, whose, count = np.empty((7, most), dtype=np.float32), np.empty(most, dtype=np.int64), 0
    start, way = np.empty(3), np.empty(3)
    for line in range(len(origins)):
        for part in range(parts):
            if part == own[line] or not near[own[line], part]:
                continue
            # The line in axes where the part is the unit sphere.
            span, along = 0.0, 0.0
            for i in range(3):
                start[i], way[i] = 0.0, 0.0
                for j in range(3):
                    start[i] += frames[part, j, i] * (origins[line, j] - centres[part, j])
                    way[i] += frames[part, j, i] * (targets[line, j] - origins[line, j])
                start[i], way[i] = start[i] / axes[part, i], way[i] / axes[part, i]
                span += way[i] * way[i]
                along -= start[i] * way[i]
            nearest = min(1.0, max(0.0, along / span))
            square = 0.0
            for i in range(3):
                square += (start[i] + nearest * way[i]) ** 2
            if square > NEAR * NEAR:
                continue
            # float32 is too coarse for a far antenna: the ray starts two radii before the nearest point.
            distance = math.sqrt(span)
            ahead = max(nearest - 2 / distance, 0.0)
            for i in range(3):
                rays[i, count], rays[3 + i, count] = (start[i] + ahead * way[i], way[i] / distance)
            rays[6, count] = (1 - ahead) * distance
            whose[count] = line
            count += 1
    return rays[:, :count].copy(), whose[:count]
