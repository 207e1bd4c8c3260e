"""What an antenna sees of facets past other parts, and where edges of shadows cut them.

A tracer says which part occludes which vertex. Where a part occludes some vertices of a facet and
not others, the edge of its shadow runs through that facet. The distance by which the ray to each
vertex clears the occluding ellipsoids, in float64, is taken as linear over the facet; the edge is
where it is 0. So a shadow moves over the body without jumps.
"""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.elementary import dot, minus, plus, turned
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.triangles import positive_fraction


@inlined()
def into_ball(part, other, antenna, centres, frames, semi_axes, turn, shift, start):
    """Fill in the map from a part's axes to those where another part is the unit ball.

    It is ``turn (3, 3)`` and ``shift (3,)``; ``start (3,)`` is the antenna in the axes of the ball.
    """
    # Rotate into the axes of the other part, and divide by its semi-axes.
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
    """Least distance of the line to a vertex from the middle of the unit ball, less 1."""
    start = ball[4]
    # The line from the antenna to the vertex, where the other part is the unit ball.
    way = minus(plus(turned(ball, vertex), ball[3]), start)
    start_square, along, span = dot(start, start), dot(start, way), dot(way, way)
    # Only the piece between both counts, not the line beyond them.
    nearest = min(1.0, max(0.0, -along / span))
    return math.sqrt(max(start_square + nearest * (2 * along + nearest * span), 0.0)) - 1


@inlined()
def _clearances(occluders, corner, antenna, part, pose, vertices, balls):
    """By how much the rays to the corners of a facet clear the parts that occlude any of these.

    ``balls (part, 5, 3)`` are the maps of `into_ball` to every other part, with the antenna last;
    NaN where they are not known yet.
    """
    centres, frames, semi_axes = pose
    first, second, _ = occluders
    # A corner is clear if it clears all of these parts: the least clearance counts.
    v0, v1, v2 = math.inf, math.inf, math.inf
    for n in range(3):
        other = occluders[n]
        # Each occluding part once.
        if other < 0 or (n > 0 and other == first) or (n > 1 and other == second):
            continue
        ball = balls[other]
        # The axes of another part are the same for all facets, and computed when first needed.
        if math.isnan(ball[3, 0]):
            into_ball(part, other, antenna, centres, frames, semi_axes, ball[:3], ball[3], ball[4])
        v0 = min(v0, _clearance(ball, vertices[corner[0]]))
        v1 = min(v1, _clearance(ball, vertices[corner[1]]))
        v2 = min(v2, _clearance(ball, vertices[corner[2]]))
    return v0, v1, v2


@compiled()
def shade(hidden_by, antennas, parts, pose, vertices, corners, ends, start, out, edge):
    """Fill in what antennas see of the facets of some parts.

    ``hidden_by (antenna, vertex)`` is the part that occludes a vertex, or -1; ``antennas (antenna,
    3)`` world [m]; ``parts (n,)``; ``pose`` centres, frames and semi-axes of the body; ``vertices
    (vertex, 3)`` of all parts in their axes; ``corners (3, facet)`` uint32; ``ends (part + 1, 2)``
    as in `Facets`. Filled are ``out (antenna, facet)`` float32, except for parts in full view, and
    for facets that are cut ``edge (antenna, facet, 3)`` float32, as in `Views`. The facets of each
    part begin at ``start (n,)``.
    """
    first, second, third = corners
    balls = np.empty((len(pose[0]), 5, 3))
    for a in range(len(antennas)):
        occluder, own = hidden_by[a], out[a]
        for n in range(len(parts)):
            part = parts[n]
            (vertex, begin), (last, end) = ends[part], ends[part + 1]
            # Parts in full view are left as the caller has them.
            if not (occluder[vertex:last] >= 0).any():
                continue
            balls[:] = math.nan
            for f in range(begin, end):
                corner = first[f], second[f], third[f]
                # Facets with no corner occluded are seen whole, those with all of them not at all.
                by = occluder[corner[0]], occluder[corner[1]], occluder[corner[2]]
                hidden = (by[0] >= 0) + (by[1] >= 0) + (by[2] >= 0)
                place = start[n] + f - begin
                own[place] = 1.0 if hidden == 0 else 0.0
                # The edge of a shadow runs through the others.
                if hidden == 1 or hidden == 2:
                    u, v, w = _clearances(by, corner, antennas[a], part, pose, vertices, balls)
                    own[place] = positive_fraction(u, v, w)
                    edge[a, place, 0], edge[a, place, 1], edge[a, place, 2] = u, v, w
