"""Matrix elements of the combined field between currents over the edges of flat triangles.

A current flows across each edge, from one triangle into the other (S. M. Rao, D. R. Wilton, A. W.
Glisson, IEEE Trans. Antennas Propag. 30, 1982). Triangles far apart have one product rule. Where
they touch, the coordinates of S. A. Sauter and C. Schwab, *Boundary Element Methods*, section 5.2,
cancel what is singular; where they are near without touching, both are divided until they are far.
"""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.elementary import fast_phasor
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.surface_currents import place_on

_LANES = 64
_FAST = {"reassoc", "contract", "nsz", "arcp"}

FAR = 1.3
"""Distance of two centroids over the sum of both radii beyond which one product rule serves."""

DEEPEST = 6
"""Largest number of times that near triangles are halved."""


@compiled(fastmath=_FAST)
def fill_matrices(triangles, orbits, rules, equation, out):
    """Add the matrix elements to ``out (parity, unknown, unknown)``, tests along the first axis.

    The unknown is the current times the impedance of free space.
    """
    count, points = len(triangles.areas), len(rules.weights)
    centroids, radii = np.empty((count, 3)), np.empty(count)
    # The points of all triangles from their centroids, side by side for the lanes.
    places = np.empty((points, 3, count))
    for s in range(count):
        corners = triangles.corners[s]
        radii[s] = _middle(corners, centroids[s])
        for q in range(points):
            for axis in range(3):
                places[q, axis, s] = place_on(corners, rules.places[q], axis) - centroids[s, axis]
    sums, block = np.empty((_ROWS, _LANES)), np.empty((3, 3), dtype=np.complex128)
    stack = np.empty((15 * DEEPEST + 16, 2, 3, 3))
    for row in range(len(orbits.tested)):
        t = orbits.tested[row]
        for first in range(0, count, _LANES):
            lanes = min(_LANES, count - first)
            _far_sums(t, first, lanes, triangles, centroids, places, rules, equation, sums)
            for lane in range(lanes):
                s = first + lane
                reach = FAR * (radii[s] + radii[t])
                if _squared_distance(centroids[s], centroids[t]) <= reach * reach:
                    _near_sums(t, s, triangles, centroids, rules, equation, stack, sums, lane)
                _block(t, s, triangles, centroids, sums, lane, equation, block)
                if s == t:
                    _add_own_field(t, triangles, centroids, equation, block)
                _scatter(t, s, orbits, orbits.weights[row], triangles.scales, block, out)


@inlined()
def _scatter(t, s, orbits, weight, scales, block, out):
    """Add the block of two triangles to the elements of the unknowns."""
    for i in range(3):
        for j in range(3):
            value = block[i, j] * (scales[t, i] * scales[s, j] * weight)
            one, other = orbits.unknown[t, i], orbits.unknown[s, j]
            for parity in range(len(out)):
                sign = orbits.parity[parity, t, i] * orbits.parity[parity, s, j]
                out[parity, one, other] += sign * value


# -- geometry --------------------------------------------------------------------------------------


@inlined()
def _squared_distance(a, b):
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


@inlined()
def _middle(corners, centroid):
    """Fill the centroid of a triangle; its largest distance from a corner is returned."""
    for axis in range(3):
        centroid[axis] = (corners[0, axis] + corners[1, axis] + corners[2, axis]) / 3
    largest = 0.0
    for i in range(3):
        largest = max(largest, _squared_distance(corners[i], centroid))
    return math.sqrt(largest)


# -- sums over pairs of points ---------------------------------------------------------------------

_ROWS = 32


@inlined(fastmath=_FAST)
def _add_pair(sums, lane, x, y, z, ox, oy, oz, rx, ry, rz, n0, n1, n2, weight, k, electric):
    """Add a pair of points: (x, y, z) from the centroid of the tested triangle, o of the other.

    R = (rx, ry, rz) goes from the other point to the tested one, n is the normal at the latter. The
    rows are pairs of real and imaginary part: G; K = j k G - h n.R; K times the tested place; K
    times the other place o; K times their product; h times the product of R and the tested place,
    times n.o and times 1; h R times n.o, and h R; with h = (1 + jkR) G / R^2, and both parts of the
    equation by their weights.
    """
    squared = rx * rx + ry * ry + rz * rz
    distance = math.sqrt(squared)
    cosine, sine = fast_phasor(-k * distance)
    g = weight / (4 * math.pi * distance)
    g_re, g_im = g * cosine, g * sine
    factor, turn = (1 - electric) / squared, k * distance
    h_re, h_im = factor * (g_re - turn * g_im), factor * (g_im + turn * g_re)
    along = n0 * rx + n1 * ry + n2 * rz
    k_re, k_im = -electric * k * g_im - h_re * along, electric * k * g_re - h_im * along
    product = x * ox + y * oy + z * oz
    up = n0 * ox + n1 * oy + n2 * oz
    across = x * rx + y * ry + z * rz
    sums[0, lane] += g_re
    sums[1, lane] += g_im
    sums[2, lane] += k_re
    sums[3, lane] += k_im
    sums[4, lane] += k_re * x
    sums[5, lane] += k_im * x
    sums[6, lane] += k_re * y
    sums[7, lane] += k_im * y
    sums[8, lane] += k_re * z
    sums[9, lane] += k_im * z
    sums[10, lane] += k_re * ox
    sums[11, lane] += k_im * ox
    sums[12, lane] += k_re * oy
    sums[13, lane] += k_im * oy
    sums[14, lane] += k_re * oz
    sums[15, lane] += k_im * oz
    sums[16, lane] += k_re * product + h_re * across * up
    sums[17, lane] += k_im * product + h_im * across * up
    sums[18, lane] += h_re * across
    sums[19, lane] += h_im * across
    sums[20, lane] += h_re * rx * up
    sums[21, lane] += h_im * rx * up
    sums[22, lane] += h_re * ry * up
    sums[23, lane] += h_im * ry * up
    sums[24, lane] += h_re * rz * up
    sums[25, lane] += h_im * rz * up
    sums[26, lane] += h_re * rx
    sums[27, lane] += h_im * rx
    sums[28, lane] += h_re * ry
    sums[29, lane] += h_im * ry
    sums[30, lane] += h_re * rz
    sums[31, lane] += h_im * rz


@inlined()
def _term(sums, row, lane):
    return complex(sums[2 * row, lane], sums[2 * row + 1, lane])


@inlined()
def _block(t, s, triangles, centroids, sums, lane, equation, block):
    """Fill the block (edge, edge) of two triangles from the sums, but for the scales."""
    normal = triangles.normals[t]
    charge = complex(0.0, -4 * equation.electric / equation.wavenumber) * _term(sums, 0, lane)
    for i in range(3):
        u0 = triangles.corners[t, i, 0] - centroids[t, 0]
        u1 = triangles.corners[t, i, 1] - centroids[t, 1]
        u2 = triangles.corners[t, i, 2] - centroids[t, 2]
        tested = charge + _term(sums, 8, lane)
        tested -= u0 * (_term(sums, 5, lane) + _term(sums, 10, lane))
        tested -= u1 * (_term(sums, 6, lane) + _term(sums, 11, lane))
        tested -= u2 * (_term(sums, 7, lane) + _term(sums, 12, lane))
        upward = u0 * _term(sums, 13, lane) + u1 * _term(sums, 14, lane)
        upward += u2 * _term(sums, 15, lane) - _term(sums, 9, lane)
        for j in range(3):
            v0 = triangles.corners[s, j, 0] - centroids[s, 0]
            v1 = triangles.corners[s, j, 1] - centroids[s, 1]
            v2 = triangles.corners[s, j, 2] - centroids[s, 2]
            value = tested + (u0 * v0 + u1 * v1 + u2 * v2) * _term(sums, 1, lane)
            value -= v0 * _term(sums, 2, lane)
            value -= v1 * _term(sums, 3, lane)
            value -= v2 * _term(sums, 4, lane)
            height = normal[0] * v0 + normal[1] * v1 + normal[2] * v2
            block[i, j] = value + height * upward


@inlined()
def _add_own_field(t, triangles, centroids, equation, block):
    """Add half the current on the triangle itself: what the magnetic field jumps by, in halves."""
    corners, centroid = triangles.corners[t], centroids[t]
    spread = 0.0
    for i in range(3):
        spread += _squared_distance(corners[i], centroid) / 12
    for i in range(3):
        for j in range(3):
            product = 0.0
            for axis in range(3):
                product += (corners[i, axis] - centroid[axis]) * (corners[j, axis] - centroid[axis])
            block[i, j] += (1 - equation.electric) / 2 * triangles.areas[t] * (spread + product)


@inlined(fastmath=_FAST)
def _far_sums(t, first, lanes, triangles, centroids, places, rules, equation, sums):
    """Fill the sums of the tested triangle with each one of the lanes, by one product rule."""
    k, electric = equation.wavenumber, equation.electric
    n0, n1, n2 = triangles.normals[t, 0], triangles.normals[t, 1], triangles.normals[t, 2]
    area = triangles.areas[t]
    away = np.empty((3, _LANES))
    for axis in range(3):
        for lane in range(lanes):
            away[axis, lane] = centroids[t, axis] - centroids[first + lane, axis]
    for row in range(_ROWS):
        for lane in range(lanes):
            sums[row, lane] = 0.0
    for p in range(len(rules.weights)):
        x, y, z = places[p, 0, t], places[p, 1, t], places[p, 2, t]
        for q in range(len(rules.weights)):
            weight = rules.weights[p] * rules.weights[q] * area
            for lane in range(lanes):
                s = first + lane
                ox, oy, oz = places[q, 0, s], places[q, 1, s], places[q, 2, s]
                rx, ry, rz = away[0, lane] + x - ox, away[1, lane] + y - oy, away[2, lane] + z - oz
                both = weight * triangles.areas[s]
                _add_pair(
                    sums, lane, x, y, z, ox, oy, oz, rx, ry, rz, n0, n1, n2, both, k, electric
                )  # fmt: skip


# -- triangles that are near or touch --------------------------------------------------------------


@inlined()
def _near_sums(t, s, triangles, centroids, rules, equation, stack, sums, lane):
    """Fill the sums of two triangles near each other, by a rule for what they share."""
    one, other, middles = np.empty((3, 3)), np.empty((3, 3)), np.empty((2, 3))
    levels = np.zeros(len(stack), dtype=np.int64)
    for row in range(_ROWS):
        sums[row, lane] = 0.0
    whole, held = triangles.areas[t] * triangles.areas[s], 1
    shared = _shared_first(triangles, t, s, stack[0, 0], stack[0, 1])
    while held > 0:
        held -= 1
        for i in range(3):
            for axis in range(3):
                one[i, axis], other[i, axis] = stack[held, 0, i, axis], stack[held, 1, i, axis]
        level = levels[held]
        reach = FAR * (_middle(one, middles[0]) + _middle(other, middles[1]))
        far = _squared_distance(middles[0], middles[1]) > reach * reach
        if shared > 0 or far or level == DEEPEST:
            _add_places(
                one, other, rules.pairs[shared], whole * 0.0625**level, t, s, triangles, centroids,
                equation, sums, lane,
            )  # fmt: skip
            continue
        for a in range(4):
            for b in range(4):
                _quarter(one, a, stack[held, 0])
                _quarter(other, b, stack[held, 1])
                levels[held] = level + 1
                held += 1


@inlined()
def _add_places(
    one, other, pairs, weight, t, s, triangles, centroids, equation, sums, lane
):  # fmt: skip
    """Add pairs of points, given by barycentric coordinates on parts of both triangles."""
    normal, centroid, middle = triangles.normals[t], centroids[t], centroids[s]
    for pair in range(len(pairs)):
        place, beside = pairs[pair, :3], pairs[pair, 3:6]
        a0, a1, a2 = place_on(one, place, 0), place_on(one, place, 1), place_on(one, place, 2)
        b0, b1, b2 = (
            place_on(other, beside, 0),
            place_on(other, beside, 1),
            place_on(other, beside, 2),
        )
        _add_pair(
            sums, lane, a0 - centroid[0], a1 - centroid[1], a2 - centroid[2],
            b0 - middle[0], b1 - middle[1], b2 - middle[2], a0 - b0, a1 - b1, a2 - b2,
            normal[0], normal[1], normal[2], weight * pairs[pair, 6], equation.wavenumber,
            equation.electric,
        )  # fmt: skip


@inlined()
def _quarter(corners, which, out):
    """Fill one of the four triangles between the corners and the middles of the edges."""
    for i in range(3):
        for axis in range(3):
            if which < 3:
                out[i, axis] = (corners[which, axis] + corners[i, axis]) / 2
            else:
                out[i, axis] = (corners[i, axis] + corners[(i + 1) % 3, axis]) / 2


@inlined()
def _shared_first(triangles, t, s, one, other):
    """Fill the corners of both triangles, shared ones first; their number is returned."""
    faces, corners = triangles.faces, triangles.corners
    ones, others = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    shared, own, left = 0, 2, 2
    for i in range(3):
        same = -1
        for j in range(3):
            if faces[t, i] == faces[s, j]:
                same = j
        if same >= 0:
            ones[shared], others[shared] = i, same
            shared += 1
        else:
            ones[own] = i
            own -= 1
    for j in range(3):
        if faces[s, j] != faces[t, 0] and faces[s, j] != faces[t, 1] and faces[s, j] != faces[t, 2]:
            others[left] = j
            left -= 1
    for i in range(3):
        for axis in range(3):
            one[i, axis] = corners[t, ones[i], axis]
            other[i, axis] = corners[s, others[i], axis]
    return shared
