"""Rays along lines of sight past the parts of a body that they come near.

Each ray is in the axes where that part is the unit sphere. A part is ruled out only where a line
passes outside a ball or an ellipsoid that is a tenth larger than the part. Whether a ray meets the
part itself is for Mitsuba to say.
"""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.elementary import dot, minus, scaled, turned
from rtradar.kernels.jit import compiled, inlined

NEAR = 1.1
"""Size of the bounding volumes over that of the parts: lines outside of them have no ray traced."""


@inlined()
def _bundle(places, group, counts, middle, radius):
    """Add up the mean (group, 3) of one end of the lines, and the largest square from it."""
    for line in range(len(group)):
        for i in range(3):
            middle[group[line], i] += places[line, i] / counts[group[line]]
    for line in range(len(group)):
        away = minus(places[line], middle[group[line]])
        radius[group[line]] = max(radius[group[line]], dot(away, away))


@inlined()
def _near_parts(origins, targets, group, own, pose, centres, longest):
    """Return which parts' bounding balls come near the lines of a group, (group, part)."""
    groups, parts = len(own), centres.shape[1]
    middles, radii = np.zeros((groups, 2, 3)), np.zeros((groups, 2))
    counts = np.zeros(groups)
    for line in range(len(group)):
        counts[group[line]] += 1
    _bundle(origins, group, counts, middles[:, 0], radii[:, 0])
    _bundle(targets, group, counts, middles[:, 1], radii[:, 1])
    near = np.zeros((groups, parts), dtype=np.bool_)
    for g in range(groups):
        a, b = middles[g, 0], middles[g, 1]
        way = minus(b, a)
        first, last = math.sqrt(radii[g, 0]), math.sqrt(radii[g, 1])
        span = dot(way, way)
        length = math.sqrt(span)
        for part in range(parts):
            if part != own[g] and counts[g] > 0:
                gap = minus(centres[pose[g], part], a)
                fraction = min(1.0, max(0.0, dot(gap, way) / max(span, 1e-300)))
                aside = minus(gap, scaled(way, fraction))
                # The bundle narrows towards one end: its width is taken before this part.
                before = max(0.0, fraction - NEAR * longest[part] / max(length, 1e-300))
                wide = max(first + before * (last - first), last) if first > last else last
                near[g, part] = math.sqrt(dot(aside, aside)) < NEAR * longest[part] + wide
    return near


@inlined()
def unit_sphere_maps(frames, semi_axes):
    """Maps (pose, part, 3, 3) from world axes to those in which a part is the unit sphere."""
    maps = np.empty(frames.shape)
    for pose in range(len(frames)):
        for part in range(len(semi_axes)):
            for i in range(3):
                for j in range(3):
                    maps[pose, part, i, j] = frames[pose, part, j, i] / semi_axes[part, i]
    return maps


@inlined()
def longest_axes(semi_axes):
    """Return the longest semi-axis of each part (part,) [m]."""
    longest = np.zeros(len(semi_axes))
    for part in range(len(semi_axes)):
        for i in range(3):
            longest[part] = max(longest[part], semi_axes[part, i])
    return longest


@compiled()
def near_rays(origins, targets, group, own, pose, centres, frames, semi_axes):
    """Return one ray for each line of sight and each part that this line comes near.

    Lines (line, 3) go from ``origins`` to ``targets`` [m]. Those of one ``group (line,)`` end on
    the part ``own (group,)``, -1 for none, which cannot occlude them, of the body in one of its
    poses, ``pose (group,)``: ``centres (pose, part, 3)``, ``frames (pose, part, 3, 3)``, and
    ``semi_axes (part, 3)``.

    Returned are rays (7, ray) float32, and of each its line and that part (2, ray): the start, at
    most two radii before the point nearest to the centre of the unit sphere; the unit direction;
    the length.
    """
    parts = len(semi_axes)
    longest = longest_axes(semi_axes)
    # First pass over the bounding balls alone, which says how much room the rays take.
    near = _near_parts(origins, targets, group, own, pose, centres, longest)
    near_count, near_part = np.zeros(len(own), dtype=np.int64), np.empty(near.shape, dtype=np.int64)
    for g in range(len(own)):
        for part in range(parts):
            if near[g, part]:
                near_part[g, near_count[g]] = part
                near_count[g] += 1
    most = 0
    for line in range(len(group)):
        most += near_count[group[line]]
    maps = unit_sphere_maps(frames, semi_axes)
    rays, whose = np.empty((7, most), dtype=np.float32), np.empty((2, most), dtype=np.int64)
    count = 0
    for line in range(len(group)):
        g = group[line]
        origin = origins[line]
        way = minus(targets[line], origin)
        for n in range(near_count[g]):
            part = near_part[g, n]
            m = maps[pose[g], part]
            start, along = turned(m, minus(origin, centres[pose[g], part])), turned(m, way)
            span, back = dot(along, along), -dot(start, along)
            # The least square of the distance along the line, times its span: no division.
            square = dot(start, start)
            least = (
                square * span - back * back if back < span else (square - 2 * back + span) * span
            )
            if (least if back > 0 else square * span) > NEAR * NEAR * span:
                continue
            # float32 is too coarse for a far antenna: the ray starts two radii before that point.
            scale = 1 / math.sqrt(span)
            ahead = max(min(1.0, max(0.0, back * scale * scale)) - 2 * scale, 0.0)
            for i in range(3):
                rays[i, count] = start[i] + ahead * along[i]
                rays[3 + i, count] = along[i] * scale
            rays[6, count] = (1 - ahead) * span * scale
            whose[0, count], whose[1, count] = line, part
            count += 1
    return rays[:, :count].copy(), whose[:, :count].copy()
