"""Fractions of facets that an antenna sees past other parts, exact at edges of shadows.

A tracer says which part occludes which vertex. Where it occludes some vertices of a facet and not
others, the edge of the shadow runs through that facet, and the fraction that it leaves is taken
from how far the rays to its vertices pass outside the occluding ellipsoids, in float64, as linear
over the facet. So a shadow moves over the body without jumps.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import dot, minus, plus, turned
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.triangles import positive_fraction


class _Room(NamedTuple):
    """Arrays that serve one part and antenna after the other.

    ``balls (part, 5, 3)``: from the part's axes to those in which another one is the unit ball, and
    the antenna in these. ``clear, of (vertex,)``: how far the ray to a vertex passes outside of
    which occluder. ``hidden (vertex,)`` and ``counts (facet,)``: occluded vertices, and how many a
    facet has.
    """

    balls: NDArray[np.float64]
    clear: NDArray[np.float64]
    of: NDArray[np.int64]
    hidden: NDArray[np.int32]
    counts: NDArray[np.int32]


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
def _cut(occluder, antenna, part, pose, vertices, corner, room):
    """Fraction of a facet, with these corners, that occluders of some of them leave."""
    centres, frames, semi_axes = pose
    c0, c1, c2 = corner
    h0, h1, h2 = occluder[c0], occluder[c1], occluder[c2]
    v0, v1, v2 = math.inf, math.inf, math.inf
    for n in range(3):
        other = h0 if n == 0 else h1 if n == 1 else h2
        if other < 0 or (n > 0 and other == h0) or (n > 1 and other == h1):
            continue
        ball = room.balls[other]
        if math.isnan(ball[3, 0]):
            into_ball(part, other, antenna, centres, frames, semi_axes, ball[:3], ball[3], ball[4])
        # Facets that meet at a vertex ask for the same way one after the other.
        for k in range(3):
            vertex = c0 if k == 0 else c1 if k == 1 else c2
            if room.of[vertex] != other:
                room.clear[vertex], room.of[vertex] = _clearance(ball, vertices[vertex]), other
        clear = room.clear
        v0, v1, v2 = min(v0, clear[c0]), min(v1, clear[c1]), min(v2, clear[c2])
    return positive_fraction(v0, v1, v2)


@inlined()
def _shade_part(occluder, antenna, part, pose, vertices, corners, room, out):
    """Fractions of the facets of one part for one antenna; whether any of it is occluded."""
    _, _, of, hidden, counts = room
    any_hidden = 0
    for vertex in range(len(occluder)):
        hidden[vertex] = occluder[vertex] >= 0
        any_hidden |= hidden[vertex]
    if not any_hidden:
        return False
    for vertex in range(len(of)):
        of[vertex] = -1
    for other in range(len(room.balls)):
        room.balls[other, 3, 0] = math.nan  # not known yet
    first, second, third = corners[0], corners[1], corners[2]
    for f in range(len(first)):
        counts[f] = hidden[first[f]] + hidden[second[f]] + hidden[third[f]]
    for f in range(len(first)):
        out[f] = 1.0 if counts[f] == 0 else 0.0
    for f in range(len(first)):
        if counts[f] == 1 or counts[f] == 2:
            corner = (first[f], second[f], third[f])
            out[f] = _cut(occluder, antenna, part, pose, vertices, corner, room)
    return True


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
    count, n_vertices, n_facets = 1, vertices.shape[1], corners.shape[1]
    room = _Room(
        np.empty((len(pose[0]), 5, 3)),
        np.empty(n_vertices),
        np.empty(n_vertices, dtype=np.int64),
        np.empty(n_vertices, dtype=np.int32),
        np.empty(n_facets, dtype=np.int32),
    )
    for a in range(len(antennas)):
        for n in range(len(parts)):
            part = parts[n]
            row[a, n] = 0
            given = (hidden_by[a, n], antennas[a], part, pose, vertices[part], corners, room)
            if _shade_part(*given, out[count]):
                row[a, n] = count
                count += 1
    return count
