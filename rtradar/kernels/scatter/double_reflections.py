"""Reflections over two ellipsoids, from one to the other, by Newton's method on both surfaces.

The path |T - p| + |p - q| + |q - R| over a point p of the first ellipsoid and q of the second is
stationary, and least, where both reflect. With H the 4 x 4 matrix of its second derivatives along
the tangents of both surfaces, stationary phase gives the return

    |F| = 2 sqrt(pi) cos(i_p) cos(i_q) / (|p - q| sqrt(det H)),

divided by |T - p| |q - R| for the spreading of the other two legs. Each surface reflects a field E
as 2 (n.E) n - E. Both are unit spheres in axes in which Newton's steps are taken: a step t along
the tangent moves u to the unit vector along u + t. Everything is float64.

Source: Born and Wolf, *Principles of Optics*, appendix III, for four variables in place of two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import (
    cross,
    dot,
    minus,
    plus,
    scaled,
    stretched,
    turned,
    turned_back,
    with_length,
)
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.specular_point import ROOT_PI

Array = NDArray[np.float64]

_MAX_STEPS = 40
_STEP_TOLERANCE = 1e-3
"""Length of the last step on the unit sphere. What it takes off the path is known to the cube of
it, 1e-9 of the ellipsoid's size; the amplitude is off by about as much."""

_LONGEST_STEP = 0.5
"""Longest step of Newton's method, on the unit sphere."""

_MOST_ADDED = 1e6
"""Most that is added to the diagonal of the matrix [m]."""


class Reflector(NamedTuple):
    """One ellipsoid: ``centre (3,)``, ``frame (3, 3)`` and ``axes (3,)`` [m]."""

    centre: Array
    frame: Array
    axes: Array


@inlined()
def _place(body, u):
    """Point of an ellipsoid at a unit vector, and its derivatives along two tangents of the sphere.

    The tangents (Duff et al., 2017) come last.
    """
    # Tangents of the unit sphere that never degenerate.
    sign = math.copysign(1.0, u[2])
    a = -1 / (sign + u[2])
    b = u[0] * u[1] * a
    one = 1 + sign * u[0] * u[0] * a, sign * b, -sign * u[0]
    other = b, sign + u[1] * u[1] * a, -u[1]
    # The ellipsoid is the sphere stretched along its axes, rotated and moved.
    point = plus(body.centre, turned(body.frame, stretched(body.axes, u)))
    along = (
        turned(body.frame, stretched(body.axes, one)),
        turned(body.frame, stretched(body.axes, other)),
    )
    return point, along, (one, other)


@inlined()
def _normal(body, u):
    """Outward unit normal at a unit vector, and the area there over that of the sphere."""
    # The gradient of the ellipsoid's equation; its length gives how a patch of the sphere is
    # stretched.
    steep = u[0] / body.axes[0], u[1] / body.axes[1], u[2] / body.axes[2]
    normal, size = with_length(turned(body.frame, steep))
    return normal, body.axes[0] * body.axes[1] * body.axes[2] * size


@inlined()
def _bisecting(body, first, second):
    """Unit vector at which an ellipsoid's normal bisects the ways to two places."""
    # In its own axes the normal at u is along A^-1 u, so u is along A times the bisector.
    one, _ = with_length(minus(first, body.centre))
    other, _ = with_length(minus(second, body.centre))
    between = turned_back(body.frame, plus(one, other))
    u, size = with_length(stretched(body.axes, between))
    return u if size > 0 else (1.0, 0.0, 0.0)


@inlined()
def _factor(matrix, lower):
    """Cholesky factor of a 4 x 4 matrix; whether it is positive definite."""
    for i in range(4):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                if not total > 0:
                    return False
                lower[i, i] = math.sqrt(total)
            else:
                lower[i, j] = total / lower[j, j]
    return True


@inlined()
def _solved(lower, right, out):
    """Solve L L^T x = right for the factor L."""
    for i in range(4):
        out[i] = right[i]
        for k in range(i):
            out[i] -= lower[i, k] * out[k]
        out[i] /= lower[i, i]
    for i in range(3, -1, -1):
        for k in range(i + 1, 4):
            out[i] -= lower[k, i] * out[k]
        out[i] /= lower[i, i]


@inlined()
def _moved(u, tangents, e, f):
    """A unit vector after a step along its tangents."""
    step = plus(scaled(tangents[0], e), scaled(tangents[1], f))
    return with_length(plus(u, step))[0]


@inlined()
def _polarised(direction, above, horizontal):
    """Polarisation that an antenna sends or receives along a unit vector; 0 along its up."""
    upright = minus(above, scaled(direction, dot(direction, above)))
    field, size = with_length(cross(direction, above) if horizontal else upright)
    return field if size > 1e-9 else (0.0, 0.0, 0.0)


@inlined()
def _reflected(field, normal):
    """What a conductor reflects of a field."""
    return minus(scaled(normal, 2 * dot(field, normal)), field)


@inlined()
def _derivatives(along_p, along_q, legs, ranges, lean_p, lean_q, slope, matrix):
    """Fill in the first and the second derivatives of the path, ``slope (4,), matrix (4, 4)``."""
    # The unit vectors of the legs are from Tx to p, from p to q, and from Rx to q.
    s1, s2, s3 = legs
    r1, r2, r3 = ranges
    for i in range(2):
        a, b = along_p[i], along_q[i]
        slope[i] = dot(a, s1) - dot(a, s2)
        slope[2 + i] = dot(b, s2) + dot(b, s3)
        # A leg of length r curves by (1 - s s^T) / r. On a sphere a step along the tangent also
        # falls back toward the centre, which is what ``lean`` stands for.
        for j in range(2):
            c, d = along_p[j], along_q[j]
            same = 1.0 if i == j else 0.0
            matrix[i, j] = (
                (dot(a, c) - dot(a, s1) * dot(c, s1)) / r1
                + (dot(a, c) - dot(a, s2) * dot(c, s2)) / r2
                - same * lean_p
            )
            matrix[2 + i, 2 + j] = (
                (dot(b, d) - dot(b, s2) * dot(d, s2)) / r2
                + (dot(b, d) - dot(b, s3) * dot(d, s3)) / r3
                - same * lean_q
            )
            matrix[2 + i, j] = -(dot(b, c) - dot(b, s2) * dot(c, s2)) / r2
            matrix[j, 2 + i] = matrix[2 + i, j]


@inlined()
def _search(tx, rx, above, first, second, options, u, v, square):
    """Find the path of one pair from the unit vectors ``u, v``.

    Returned are its length and its amplitude, 0 where there is no such reflection; the unit vectors
    and the points on both ellipsoids. ``square (10, 4)`` is room to work in.
    """
    matrix, lower, slope, step = square[0:4], square[4:8], square[8], square[9]
    found, definite, more, drop, length = False, True, 0.0, 0.0, 0.0
    for _ in range(_MAX_STEPS):
        # The path over the present points.
        p, along_p, tangents_p = _place(first, u)
        q, along_q, tangents_q = _place(second, v)
        s1, r1 = with_length(minus(p, tx))
        s2, r2 = with_length(minus(q, p))
        s3, r3 = with_length(minus(q, rx))
        # How fast the path would change if the ellipsoids grew: the part of their curvature.
        lean_p = dot(minus(p, first.centre), minus(s1, s2))
        lean_q = dot(minus(q, second.centre), plus(s2, s3))
        legs, ranges = (s1, s2, s3), (r1, r2, r3)
        # Newton's matrix. Where it is not positive definite, a step could lead to a saddle or a
        # maximum.
        _derivatives(along_p, along_q, legs, ranges, lean_p, lean_q, slope, matrix)
        definite, more = _factor(matrix, lower), 0.0
        while not definite and more < _MOST_ADDED:
            # Toward steepest descent, until the matrix is positive definite.
            more = max(2 * more, 1e-3)
            for i in range(4):
                matrix[i, i] += more
            definite = _factor(matrix, lower)
        if not definite:
            break  # not a number, as where both points are one
        # The step, and what it takes off the path to second order.
        _solved(lower, slope, step)
        size, drop = 0.0, 0.0
        for i in range(4):
            size += step[i] * step[i]
            drop += 0.5 * slope[i] * step[i]
        size = math.sqrt(size)
        # A long step would leave the tangent plane too far behind.
        shorter = min(1.0, _LONGEST_STEP / size) if size > 0 else 1.0
        u = _moved(u, tangents_p, -shorter * step[0], -shorter * step[1])
        v = _moved(v, tangents_q, -shorter * step[2], -shorter * step[3])
        if size < _STEP_TOLERANCE:
            # With something added to the diagonal, the point is not a minimum of the path.
            found = more == 0.0
            break
    # The path after the last step; where the search has failed, that over both points.
    length, amplitude = (r1 + r2 + r3 - drop if definite else r1 + r3), 0.0
    # Normals after the step and the rest before it: with all of it before the step, amplitudes are
    # off by up to ten times as much.
    normal_p, area_p = _normal(first, u)
    normal_q, area_q = _normal(second, v)
    cosine_p, cosine_q = -dot(s1, normal_p), -dot(s3, normal_q)
    # Each surface faces both ends of its legs.
    least = min(min(cosine_p, dot(s2, normal_p)), min(cosine_q, -dot(s2, normal_q)))
    if found and least > 0:
        # Stationary phase. The matrix belongs to steps on the unit spheres, so areas there are
        # converted to areas on the ellipsoids.
        root = lower[0, 0] * lower[1, 1] * lower[2, 2] * lower[3, 3]
        sent = _polarised(s1, above, options.horizontal)
        received = _polarised(s3, above, options.horizontal)
        copolar = dot(_reflected(_reflected(sent, normal_p), normal_q), received)
        amplitude = -2 * ROOT_PI * cosine_p * cosine_q * area_p * area_q / (r2 * root) * copolar
        if options.spreading:
            amplitude /= r1 * r3
    return length, amplitude, u, v, p, q


@compiled()
def solve_double(begin, end, at, above, pairs, start, options, length, amplitude, points):
    """Fill length, amplitude (chirp, rx, pair) and points (chirp, rx, pair, 2, 3) [m].

    The chirps from ``begin`` to ``end`` of a `Geometry` are computed; ``above (chirp, 3)`` is the
    antennas' up. ``pairs (pair, 2)`` are the parts that reflect first and last. The search begins
    at the unit vectors ``start (chirp, pair, 2, 3)``, NaN where nothing is known, which are
    replaced by those of the last receiver.
    """
    tx, rx, centres, frames, semi_axes = at
    square = np.empty((10, 4))
    for chirp in range(begin, end):
        for pair in range(len(pairs)):
            a, b = pairs[pair, 0], pairs[pair, 1]
            first = Reflector(centres[chirp, a], frames[chirp, a], semi_axes[a])
            second = Reflector(centres[chirp, b], frames[chirp, b], semi_axes[b])
            known = not math.isnan(start[chirp, pair, 0, 0])
            for receiver in range(rx.shape[1]):
                here = rx[chirp, receiver]
                # Begin where the last receiver, or the caller, had the reflection; else where the
                # normals bisect the ways to the antenna and to the other part.
                if known:
                    begins = start[chirp, pair]
                    u = begins[0, 0], begins[0, 1], begins[0, 2]
                    v = begins[1, 0], begins[1, 1], begins[1, 2]
                else:
                    u = _bisecting(first, tx[chirp], second.centre)
                    v = _bisecting(second, first.centre, here)
                given = first, second, options, u, v, square
                found = _search(tx[chirp], here, above[chirp], *given)
                length[chirp, receiver, pair], amplitude[chirp, receiver, pair] = found[:2]
                # A failed search is no beginning for the next receiver.
                known = found[1] != 0
                for i in range(3):
                    points[chirp, receiver, pair, 0, i] = found[4][i]
                    points[chirp, receiver, pair, 1, i] = found[5][i]
                    if known:
                        start[chirp, pair, 0, i] = found[2][i]
                        start[chirp, pair, 1, i] = found[3][i]
