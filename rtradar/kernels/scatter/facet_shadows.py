"""Fractions of facets that an antenna sees past other parts, exact at edges of shadows.

A tracer says which part occludes which vertex. Where it occludes some vertices of a facet and not
others, the edge of the shadow runs through that facet, and the fraction that it leaves is taken
from how far the rays to its vertices pass outside the occluding ellipsoids, in float64, as linear
over the facet. So a shadow moves over the body without jumps.
"""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.elementary import dot, minus, plus, turned
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.triangles import positive_fraction


@inlined()
def into_ball(part, other, antenna, centres, frames, semi_axes, turn, shift, start):
    """From a part's axes to those in which another is the unit ball, and the antenna in these."""
    for i in range(3):
        shift[i], start[i] = 0.0, 0.0
        for j in range(3):
            shift[i] += (
                frames[other, j, i] * (centres[part, j] - centres[other, j]) / semi_axes[other, i]
            )
            start[i] += frames[other, j, i] * (antenna[j] - centres[other, j]) / semi_axes[other, i]
            turn[i, j] = 0.0
            for k in range(3):
                turn[i, j] += frames[other, k, i] * frames[part, k, j] / semi_axes[other, i]


@inlined()
def _clearance(ball, vertex):
    """Least distance of the way to a vertex from the unit ball's middle, less 1."""
    start = ball[4]
    way = minus(plus(turned(ball, vertex), ball[3]), start)
    start_square, along, span = dot(start, start), dot(start, way), dot(way, way)
    nearest = min(1.0, max(0.0, -along / span))
    return math.sqrt(max(start_square + nearest * (2 * along + nearest * span), 0.0)) - 1


@inlined()
def _cut(occluders, corner, antenna, part, pose, vertices, balls):
    """Fraction of a facet, with these corners, that occluders of some of them leave.

    ``balls (part, 5, 3)`` are from the part's axes to those in which another one is the unit ball,
    and the antenna in these; NaN where they are not known yet.
    """
    centres, frames, semi_axes = pose
    first, second, _ = occluders
    v0, v1, v2 = math.inf, math.inf, math.inf
    for n in range(3):
        other = occluders[n]
        if other < 0 or (n > 0 and other == first) or (n > 1 and other == second):
            continue
        ball = balls[other]
        if math.isnan(ball[3, 0]):
            into_ball(part, other, antenna, centres, frames, semi_axes, ball[:3], ball[3], ball[4])
        v0 = min(v0, _clearance(ball, vertices[corner[0]]))
        v1 = min(v1, _clearance(ball, vertices[corner[1]]))
        v2 = min(v2, _clearance(ball, vertices[corner[2]]))
    return positive_fraction(v0, v1, v2)


@compiled()
def shade(hidden_by, antennas, parts, pose, vertices, corners, row, out):
    """Fill in what antennas see of the facets of some parts; return the number of rows filled.

    ``hidden_by (antenna, n, vertex)`` is the part that occludes a vertex, or -1; ``antennas
    (antenna, 3)`` world [m]; ``parts (n,)``; ``pose`` centres, frames and semi-axes of the body;
    ``vertices (part, vertex, 3)`` in the axes of the parts; ``corners (3, facet)`` uint32. Filled
    are ``out (row, facet)`` float32, its first row for parts in full view, and ``row (antenna,
    n)``, which of them is whose.
    """
    out[0] = 1.0
    count, (first, second, third) = 1, corners
    balls = np.empty((len(pose[0]), 5, 3))
    for a in range(len(antennas)):
        for n in range(len(parts)):
            row[a, n], occluder, part = 0, hidden_by[a, n], parts[n]
            if not (occluder >= 0).any():
                continue
            balls[:] = math.nan
            own = out[count]
            for f in range(len(own)):
                corner = first[f], second[f], third[f]
                by = occluder[corner[0]], occluder[corner[1]], occluder[corner[2]]
                hidden = (by[0] >= 0) + (by[1] >= 0) + (by[2] >= 0)
                own[f] = 1.0 if hidden == 0 else 0.0
                if hidden == 1 or hidden == 2:
                    own[f] = _cut(by, corner, antennas[a], part, pose, vertices[part], balls)
            row[a, n] = count
            count += 1
    return count
