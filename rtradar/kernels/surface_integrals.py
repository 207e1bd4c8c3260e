"""Currents over the edges of flat triangles, and their fields on each other.

A current flows across each edge, from one triangle into the other (S. M. Rao, D. R. Wilton, A. W.
Glisson, IEEE Trans. Antennas Propag. 30, 1982). Triangles far apart are integrated over by one
product rule. Where they touch, the coordinates of S. A. Sauter and C. Schwab, *Boundary Element
Methods*, section 5.2, cancel the singularity. Where they are near without touching, both are
divided until their pieces are far apart.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rtradar.kernels.elementary import dot, fast_phasor, minus, plus, turned_back
from rtradar.kernels.jit import compiled, inlined

_LANES = 64
_FAST = {"reassoc", "contract", "nsz", "arcp"}

FAR = 1.3
"""Distance of two centroids over the sum of both radii beyond which one product rule serves."""

DEEPEST = 6
"""Largest number of times that near triangles are halved."""


class Triangles(NamedTuple):
    """Triangles, and the currents over their edges: edge i is opposite to corner i."""

    corners: Any  # (triangle, corner, 3) [m]
    faces: Any  # (triangle, corner) int64: which corners are one and the same
    normals: Any  # (triangle, 3), outward
    areas: Any  # (triangle,) [m^2]
    scales: Any  # (triangle, edge): length of the edge over twice the area, signed [1/m]


class Orbits(NamedTuple):
    """How the currents combine into currents of even or odd parity at the mirror planes."""

    tested: Any  # (tested,) int64: one triangle of each set of mirror images
    weights: Any  # (tested,): one over the number of reflections that keep it
    unknown: Any  # (triangle, edge) int64
    parity: Any  # (parity, triangle, edge): 1, -1, or 0 where there is no such current


class Rules(NamedTuple):
    """Quadrature over one triangle, and over pairs of triangles."""

    places: Any  # (point, corner): barycentric
    weights: Any  # (point,), their sum is 1
    pairs: Any  # four of (pair of points, 7): barycentric on both, and weights whose sum is 1, for
    # triangles that share nothing, a corner, an edge, or all


class Equation(NamedTuple):
    """Wavenumber [1/m], and the weight of the electric field beside the magnetic one."""

    wavenumber: float
    electric: float


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
            x, y, z = minus(turned_back(corners, rules.places[q]), centroids[s])
            places[q, 0, s], places[q, 1, s], places[q, 2, s] = x, y, z
    sums, block = np.empty((_ROWS, _LANES)), np.empty((3, 3), dtype=np.complex128)
    # A pair that is halved becomes 16 pairs, of which one is taken apart at a time: for each level
    # 15 more wait.
    stack = np.empty((15 * DEEPEST + 16, 2, 3, 3))
    for row in range(len(orbits.tested)):
        t = orbits.tested[row]
        # All triangles are taken as far ones first, in vector lanes. The sums of those that are
        # near are then computed anew.
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
    return dot(minus(a, b), minus(a, b))


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
def _add(sums, row, lane, real, imaginary):
    sums[2 * row, lane] += real
    sums[2 * row + 1, lane] += imaginary


@inlined(fastmath=_FAST)
def _add_times(sums, row, lane, real, imaginary, vector):
    """Add a number times a vector, which takes three pairs of rows."""
    _add(sums, row, lane, real * vector[0], imaginary * vector[0])
    _add(sums, row + 1, lane, real * vector[1], imaginary * vector[1])
    _add(sums, row + 2, lane, real * vector[2], imaginary * vector[2])


@inlined(fastmath=_FAST)
def _add_pair(sums, lane, tested, other, between, normal, weight, equation):
    """Add a pair of points, each given from the centroid of its triangle.

    R is the vector ``between`` them, from the other point to the tested one, and n is the normal at
    the latter. The rows are pairs of a real and an imaginary part: G; K = j k G - h n.R; K times
    the tested place t; K times the other place o; K t.o + h (R.t) (n.o); h R.t; h (n.o) R; and h R.
    Here h = (1 + jkR) G / R^2, and both parts of the equation have their weights.
    """
    # The Green's function of both points, and its gradient over R.
    k, electric = equation.wavenumber, equation.electric
    squared = dot(between, between)
    distance = math.sqrt(squared)
    cosine, sine = fast_phasor(-k * distance)
    g = weight / (4 * math.pi * distance)
    g_re, g_im = g * cosine, g * sine
    factor, turn = (1 - electric) / squared, k * distance
    h_re, h_im = factor * (g_re - turn * g_im), factor * (g_im + turn * g_re)
    # The part of the kernel that multiplies the product of both currents.
    along = dot(normal, between)
    k_re, k_im = -electric * k * g_im - h_re * along, electric * k * g_re - h_im * along
    product, up, across = dot(tested, other), dot(normal, other), dot(tested, between)
    # The sums from which the elements of all nine pairs of edges follow.
    _add(sums, 0, lane, g_re, g_im)
    _add(sums, 1, lane, k_re, k_im)
    _add_times(sums, 2, lane, k_re, k_im, tested)
    _add_times(sums, 5, lane, k_re, k_im, other)
    _add(sums, 8, lane, k_re * product + h_re * across * up, k_im * product + h_im * across * up)
    _add(sums, 9, lane, h_re * across, h_im * across)
    _add_times(sums, 10, lane, h_re * up, h_im * up, between)
    _add_times(sums, 13, lane, h_re, h_im, between)


@inlined()
def _term(sums, row, lane):
    return complex(sums[2 * row, lane], sums[2 * row + 1, lane])


@inlined()
def _vector(sums, row, lane):
    return _term(sums, row, lane), _term(sums, row + 1, lane), _term(sums, row + 2, lane)


@inlined()
def _block(t, s, triangles, centroids, sums, lane, equation, block):
    """Fill the block (edge, edge) of two triangles from the sums, without the scales."""
    # A current is a multiple of the place less the corner that is opposite to its edge, with a
    # constant divergence. So its product with another one is expanded about the centroids: corners
    # multiply sums that are the same for all edges.
    charge = complex(0.0, -4 * equation.electric / equation.wavenumber) * _term(sums, 0, lane)
    both = plus(_vector(sums, 5, lane), _vector(sums, 10, lane))
    for i in range(3):
        u = minus(triangles.corners[t, i], centroids[t])
        tested = charge + _term(sums, 8, lane) - dot(u, both)
        upward = dot(u, _vector(sums, 13, lane)) - _term(sums, 9, lane)
        for j in range(3):
            v = minus(triangles.corners[s, j], centroids[s])
            value = tested + dot(u, v) * _term(sums, 1, lane) - dot(v, _vector(sums, 2, lane))
            block[i, j] = value + dot(triangles.normals[t], v) * upward


@inlined()
def _add_own_field(t, triangles, centroids, equation, block):
    """Add half the current on the triangle itself: the magnetic field jumps by the whole of it."""
    # The mean product of two such currents over a triangle, by its second moments.
    corners, centroid = triangles.corners[t], centroids[t]
    spread = 0.0
    for i in range(3):
        spread += _squared_distance(corners[i], centroid) / 12
    for i in range(3):
        for j in range(3):
            product = dot(minus(corners[i], centroid), minus(corners[j], centroid))
            block[i, j] += (1 - equation.electric) / 2 * triangles.areas[t] * (spread + product)


@inlined(fastmath=_FAST)
def _far_sums(t, first, lanes, triangles, centroids, places, rules, equation, sums):
    """Fill the sums of the tested triangle with each triangle of the lanes, by one product rule."""
    normal, area = triangles.normals[t], triangles.areas[t]
    normal = normal[0], normal[1], normal[2]
    away = np.empty((3, _LANES))
    for lane in range(lanes):
        x, y, z = minus(centroids[t], centroids[first + lane])
        away[0, lane], away[1, lane], away[2, lane] = x, y, z
    # Clear the sums of the block before.
    for row in range(_ROWS):
        for lane in range(lanes):
            sums[row, lane] = 0.0
    for p in range(len(rules.weights)):
        # Every point of the tested triangle with every point of those in the lanes.
        tested = places[p, 0, t], places[p, 1, t], places[p, 2, t]
        for q in range(len(rules.weights)):
            weight = rules.weights[p] * rules.weights[q] * area
            for lane in range(lanes):
                s = first + lane
                other = places[q, 0, s], places[q, 1, s], places[q, 2, s]
                between = plus((away[0, lane], away[1, lane], away[2, lane]), minus(tested, other))
                both = weight * triangles.areas[s]
                _add_pair(sums, lane, tested, other, between, normal, both, equation)


# -- triangles that are near or touch --------------------------------------------------------------


@inlined()
def _near_sums(t, s, triangles, centroids, rules, equation, stack, sums, lane):
    """Fill the sums of two triangles near each other, by a rule for what they share."""
    one, other, middles = np.empty((3, 3)), np.empty((3, 3)), np.empty((2, 3))
    levels = np.zeros(len(stack), dtype=np.int64)
    for row in range(_ROWS):
        sums[row, lane] = 0.0
    # A stack of pairs of pieces that wait, first of which are both triangles whole.
    whole, held = triangles.areas[t] * triangles.areas[s], 1
    shared = _shared_first(triangles, t, s, stack[0, 0], stack[0, 1])
    while held > 0:
        held -= 1
        # Take the last pair from the stack: its place may be filled anew below.
        for i in range(3):
            for axis in range(3):
                one[i, axis], other[i, axis] = stack[held, 0, i, axis], stack[held, 1, i, axis]
        # Touching pairs have a rule of their own. Others need to be far enough apart for the
        # product rule, or have been halved often enough.
        level = levels[held]
        reach = FAR * (_middle(one, middles[0]) + _middle(other, middles[1]))
        far = _squared_distance(middles[0], middles[1]) > reach * reach
        if shared > 0 or far or level == DEEPEST:
            _add_places(
                one, other, rules.pairs[shared], whole * 0.0625**level, t, s, triangles, centroids,
                equation, sums, lane,
            )  # fmt: skip
            continue
        # Take both pieces apart into four each, and let all 16 pairs wait.
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
    for pair in range(len(pairs)):
        place = turned_back(one, pairs[pair, :3])
        beside = turned_back(other, pairs[pair, 3:6])
        ends = minus(place, centroids[t]), minus(beside, centroids[s]), minus(place, beside)
        _add_pair(sums, lane, *ends, triangles.normals[t], weight * pairs[pair, 6], equation)


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
    # Shared corners fill both orders from the front, the others from the back.
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
