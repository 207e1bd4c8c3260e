"""Reflections over two ellipsoids, from one to the other, by Newton's method on both surfaces.

The path |T - p| + |p - q| + |q - R| over a point p of the first ellipsoid and q of the second is
stationary, and least, where both are mirrors. With H the 4 x 4 matrix of its second derivatives
along the tangents of both surfaces, stationary phase gives the return

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

from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.specular_point import ROOT_PI, dot

Array = NDArray[np.float64]

_MAX_STEPS = 40
_STEP_TOLERANCE = 1e-3
"""Last step on the unit sphere: what it takes off the path is known to its cube, 1e-9 of the
ellipsoid's size; it leaves about as much in the amplitude."""

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
def _tangents(u, both):
    """Fill in two unit vectors across a unit vector ``u (3,)``, ``both (2, 3)``."""
    sign = math.copysign(1.0, u[2])
    a = -1 / (sign + u[2])
    b = u[0] * u[1] * a
    both[0, 0], both[0, 1], both[0, 2] = 1 + sign * u[0] * u[0] * a, sign * b, -sign * u[0]
    both[1, 0], both[1, 1], both[1, 2] = b, sign + u[1] * u[1] * a, -u[1]


@inlined()
def _place(body, u, tangents, point, along):
    """Point (3,) of an ellipsoid at a unit vector, and its derivatives ``along (2, 3)``."""
    for i in range(3):
        point[i], along[0, i], along[1, i] = body.centre[i], 0.0, 0.0
        for j in range(3):
            scale = body.frame[i, j] * body.axes[j]
            point[i] += scale * u[j]
            along[0, i] += scale * tangents[0, j]
            along[1, i] += scale * tangents[1, j]


@inlined()
def _normal(body, u, normal):
    """Outward unit normal (3,) at a unit vector, and the area there over that of the sphere."""
    size = 0.0
    for j in range(3):
        size += (u[j] / body.axes[j]) ** 2
    size = math.sqrt(size)
    for i in range(3):
        normal[i] = 0.0
        for j in range(3):
            normal[i] += body.frame[i, j] * u[j] / (body.axes[j] * size)
    return body.axes[0] * body.axes[1] * body.axes[2] * size


@inlined()
def _way(start, end, out):
    """Unit vector (3,) from one point to another, and how far that is."""
    for i in range(3):
        out[i] = end[i] - start[i]
    size = math.sqrt(dot(out, out))
    for i in range(3):
        out[i] /= size
    return size


@inlined()
def _bisecting(body, first, second, u):
    """Unit vector (3,) at which an ellipsoid's normal bisects the ways to two places."""
    one, other = np.empty(3), np.empty(3)
    _way(body.centre, first, one)
    _way(body.centre, second, other)
    size = 0.0
    for j in range(3):
        u[j] = 0.0
        for i in range(3):
            u[j] += body.axes[j] * body.frame[i, j] * (one[i] + other[i])
        size += u[j] * u[j]
    size = math.sqrt(size)
    for j in range(3):
        u[j] = u[j] / size if size > 0 else (1.0 if j == 0 else 0.0)


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
def _stretch(u, along, step):
    """Move a unit vector by a step (2,) along its tangents."""
    size = 0.0
    for i in range(3):
        u[i] += along[0, i] * step[0] + along[1, i] * step[1]
        size += u[i] * u[i]
    size = math.sqrt(size)
    for i in range(3):
        u[i] /= size


@inlined()
def _polarised(direction, above, horizontal, out):
    """Field (3,) that an antenna sends or receives along a unit vector; 0 along its up."""
    x, y, z = direction[0], direction[1], direction[2]
    u, v, w = above[0], above[1], above[2]
    if horizontal:
        out[0], out[1], out[2] = y * w - z * v, z * u - x * w, x * v - y * u
    else:
        along = dot(direction, above)
        out[0], out[1], out[2] = u - along * x, v - along * y, w - along * z
    size = math.sqrt(dot(out, out))
    for i in range(3):
        out[i] = out[i] / size if size > 1e-9 else 0.0


@inlined()
def _reflected(field, normal):
    """Turn a field (3,) into what a conductor reflects of it."""
    along = 2 * dot(field, normal)
    for i in range(3):
        field[i] = along * normal[i] - field[i]


@inlined()
def _leaning(body, point, one, other, sign):
    """How fast the path would change if the ellipsoid grew about its centre: its curvature's part.

    The path changes along ``one + sign other`` as the point moves.
    """
    total = 0.0
    for i in range(3):
        total += (point[i] - body.centre[i]) * (one[i] + sign * other[i])
    return total


@inlined()
def _derivatives(along_p, along_q, legs, ranges, lean_p, lean_q, slope, matrix):
    """Fill in the first and the second derivatives of the path, ``slope (4,), matrix (4, 4)``."""
    s1, s2, s3 = legs
    r1, r2, r3 = ranges
    for i in range(2):
        a, b = along_p[i], along_q[i]
        slope[i] = dot(a, s1) - dot(a, s2)
        slope[2 + i] = dot(b, s2) + dot(b, s3)
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
def _search(tx, rx, above, first, second, options, u, v, points, rows, square):
    """Find the path of one pair from the unit vectors ``u, v (3,)``; they and ``points`` are set.

    Returned are its length and its amplitude, 0 where there is no such reflection. ``rows (15, 3)``
    and ``square (10, 4)`` are room to work in.
    """
    p, q = points[0], points[1]
    tangent_p, tangent_q, along_p, along_q = rows[0:2], rows[2:4], rows[4:6], rows[6:8]
    s1, s2, s3 = rows[8], rows[9], rows[10]
    matrix, lower, slope, step = square[0:4], square[4:8], square[8], square[9]
    r1 = r2 = r3 = 0.0
    found, drop = False, 0.0
    for _ in range(_MAX_STEPS):
        _tangents(u, tangent_p)
        _tangents(v, tangent_q)
        _place(first, u, tangent_p, p, along_p)
        _place(second, v, tangent_q, q, along_q)
        r1, r2, r3 = _way(tx, p, s1), _way(p, q, s2), _way(rx, q, s3)
        legs, ranges = (s1, s2, s3), (r1, r2, r3)
        lean_p, lean_q = _leaning(first, p, s1, s2, -1.0), _leaning(second, q, s2, s3, 1.0)
        _derivatives(along_p, along_q, legs, ranges, lean_p, lean_q, slope, matrix)
        definite = _factor(matrix, lower)
        more = 0.0
        while not definite and more < _MOST_ADDED:
            # Toward steepest descent, until the matrix is positive definite.
            more = max(2 * more, 1e-3)
            for i in range(4):
                matrix[i, i] += more
            definite = _factor(matrix, lower)
        if not definite:
            # Not a number, as where both points are one.
            return r1 + r3, 0.0
        _solved(lower, slope, step)
        size = 0.0
        for i in range(4):
            size += step[i] * step[i]
        size = math.sqrt(size)
        drop = 0.0
        for i in range(4):
            drop += 0.5 * slope[i] * step[i]
        shorter = min(1.0, _LONGEST_STEP / size) if size > 0 else 1.0
        for i in range(4):
            step[i] *= -shorter
        _stretch(u, tangent_p, step[:2])
        _stretch(v, tangent_q, step[2:])
        if size < _STEP_TOLERANCE:
            found = more == 0.0
            break
    length = r1 + r2 + r3 - drop
    if not found:
        return length, 0.0
    normal_p, normal_q, sent, received = rows[11], rows[12], rows[13], rows[14]
    area = _normal(first, u, normal_p) * _normal(second, v, normal_q)
    cosine_p, cosine_q = -dot(s1, normal_p), -dot(s3, normal_q)
    # Each surface faces both ends of its legs.
    if min(min(cosine_p, dot(s2, normal_p)), min(cosine_q, -dot(s2, normal_q))) <= 0:
        return length, 0.0
    root = lower[0, 0] * lower[1, 1] * lower[2, 2] * lower[3, 3]
    _polarised(s1, above, options.horizontal, sent)
    _polarised(s3, above, options.horizontal, received)
    _reflected(sent, normal_p)
    _reflected(sent, normal_q)
    value = -2 * ROOT_PI * cosine_p * cosine_q * area / (r2 * root) * dot(sent, received)
    return length, value / (r1 * r3) if options.spreading else value


@compiled()
def solve_double(begin, end, at, above, pairs, start, options, length, amplitude, points):
    """Fill length, amplitude (chirp, rx, pair) and points (chirp, rx, pair, 2, 3) [m].

    For chirps from ``begin`` to ``end`` of a `Geometry`, with the antennas' up ``above (chirp,
    3)``; ``pairs (pair, 2)`` are the parts that reflect first and last; ``start (chirp, pair, 2,
    3)`` unit vectors where the search begins, NaN where nothing is known, are replaced by those of
    the last receiver.
    """
    tx, rx, centres, frames, semi_axes = at
    u, v, rows, square = np.empty(3), np.empty(3), np.empty((15, 3)), np.empty((10, 4))
    for chirp in range(begin, end):
        for pair in range(len(pairs)):
            a, b = pairs[pair, 0], pairs[pair, 1]
            first = Reflector(centres[chirp, a], frames[chirp, a], semi_axes[a])
            second = Reflector(centres[chirp, b], frames[chirp, b], semi_axes[b])
            known = not math.isnan(start[chirp, pair, 0, 0])
            for receiver in range(rx.shape[1]):
                if known:
                    for i in range(3):
                        u[i], v[i] = start[chirp, pair, 0, i], start[chirp, pair, 1, i]
                else:
                    _bisecting(first, tx[chirp], second.centre, u)
                    _bisecting(second, first.centre, rx[chirp, receiver], v)
                ends = tx[chirp], rx[chirp, receiver], above[chirp]
                given = first, second, options, u, v, points[chirp, receiver, pair]
                found = _search(*ends, *given, rows, square)
                length[chirp, receiver, pair], amplitude[chirp, receiver, pair] = found
                known = found[1] != 0
                if known:
                    for i in range(3):
                        start[chirp, pair, 0, i], start[chirp, pair, 1, i] = u[i], v[i]
