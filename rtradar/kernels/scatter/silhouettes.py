"""Kirchhoff's diffraction by silhouettes of ellipsoids and triangles across straight legs.

Every ellipsoid is a screen across the leg at the place where it comes nearest to the leg, and every
corner of a triangle is at its own place along the leg. Offsets from the leg are in units of
sqrt(wavelength * before * after / length), the radius of the first Fresnel zone there, and all
silhouettes together are one set S of such offsets. The occluded fraction of the field is

    F = (eps - j) integral over S of exp((j - eps) pi (x^2 + y^2)) dx dy,

as for a wave exp(+j k length), the convention of IF samples. Along lines through the leg, the
integral over the radius has a closed form, and so have the crossings with outlines. The small
``eps`` lets silhouettes that are many Fresnel zones aside fade: what a round body sends there are
echoes of its own.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import cross, dot, least_axis, minus, scaled, turned, with_length
from rtradar.kernels.jit import compiled, inlined

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.int64]
Field = NDArray[np.complex128]

_FAR = 4.0
_STEPS = 64
"""Entries of the table of the integrand for each unit of a squared radius."""
_LEAST_M2 = 1e-6


class Posed(NamedTuple):
    """What casts a shadow, at one time.

    Ellipsoids have ``centres (part, 3)`` [m], ``maps (part, 3, 3)`` to the axes where each is the
    unit sphere, and the largest semi-axes ``longest (part,)`` [m]. Triangles have ``corners (face,
    3, 3)`` [m]. Triangles that are ``closed (face,)`` belong to a closed surface and are wound
    anticlockwise seen from outside: half of them are behind the others.
    """

    centres: Array
    maps: Array
    longest: Array
    corners: Array
    closed: Bools


class Shadow(NamedTuple):
    """What moves takes from static clutter at one keyframe.

    ``echo (n,)`` are ascending numbers of echoes, counted through the objects of the clutter one
    after the other. Each of them loses ``fraction (node, tx, rx, n)`` complex, at one frequency or
    three. ``mirror (m,)`` are numbers of objects, whose echoes all lose ``of_mirror (m, tx, rx,
    node)`` complex, at frequencies over the sweep.
    """

    echo: Indices
    fraction: Field
    mirror: Indices
    of_mirror: Field


def wave_table(fade):
    """Table of exp((j - fade) pi x) for x from 0 on, in steps of 1 / `_STEPS`."""
    x = np.arange(int(_FAR**2 * _STEPS) + 2) / _STEPS
    return np.exp((1j - fade) * np.pi * x)


@inlined(fastmath={"contract"})
def _crossing(rho, scales, table, sign, out):
    """Add sign(rho) (1 - exp((j - eps) pi rho^2)) at every frequency, times ``sign``."""
    side = sign if rho > 0 else -sign
    # The exponential at the squared radius, read from the table linearly.
    square = rho * rho * _STEPS
    for node in range(len(scales)):
        x = square * scales[node]
        n = int(x)
        if n + 1 < len(table):
            rest = x - n
            out[node] += side * (1 - (1 - rest) * table[n] - rest * table[n + 1])
        else:
            out[node] += side


@inlined(fastmath={"contract"})
def _across(way):
    """Two unit vectors across a leg, a right-handed frame with its direction."""
    axis = least_axis(way)
    side, _ = with_length(minus(axis, scaled(way, dot(way, axis))))
    return side, cross(way, side)


@inlined(fastmath={"contract"})
def _near_parts(start, way, side, up, size, before, length, wavelength, reach, body, near):
    """Find the parts near a leg: their silhouettes' quadratic forms (part, 6); return how many."""
    centres, maps, longest = body[0], body[1], body[2]
    widest = 0.5 * reach * math.sqrt(wavelength * length)
    count = 0
    for part in range(len(centres)):
        # A part whose ball is before the start or behind the end of the leg casts no shadow on it.
        g = minus(centres[part], start)
        along = dot(g, way)
        if along < -longest[part] or along > size + longest[part]:
            continue
        square = dot(g, g) - along * along
        # No zone is wider than the one in the middle of the path, which rules out most parts.
        if square > (longest[part] + widest) ** 2:
            continue
        # Then by the Fresnel zone where the part is.
        gap = math.sqrt(max(square, 0.0))
        past = before + min(max(along, 0.0), size)
        zone = math.sqrt(wavelength * past * max(length - past, 0.0) / length)
        if gap > longest[part] + reach * zone:
            continue
        # In the axes where the part is the unit sphere: its centre, the leg and both axes across.
        m = maps[part]
        x, y, u, v = turned(m, g), turned(m, way), turned(m, side), turned(m, up)
        yy, xy, uy, vy = dot(y, y), dot(x, y), dot(u, y), dot(v, y)
        # Where along the leg the silhouette's screen is: there the leg is nearest in those axes.
        nearest = xy / yy
        # A part beside an end of the leg shrinks to the fraction of its diameter before that end.
        inside = 0.5 + 0.5 * min(nearest, size - nearest) * math.sqrt(yy)
        if inside <= 0:
            continue
        inside = min(inside, 1.0)
        # The place along the leg of the outline's nearest point, if the leg is outside.
        aside = math.sqrt(max(dot(x, x) - xy * nearest, 1.0))
        past = before + min(max(along + (nearest - along) / aside, 0.0), size)
        square = max(wavelength * past * max(length - past, 0.0) / length, _LEAST_M2)
        zone = math.sqrt(square)
        # An offset o is covered where a o.o - 2 b.o + c < 0: lines along the leg pass within the
        # sphere.
        form = near[count]
        form[0] = square * (dot(u, u) - uy * uy / yy)
        form[1] = square * (dot(u, v) - uy * vy / yy)
        form[2] = square * (dot(v, v) - vy * vy / yy)
        form[3] = zone * (dot(x, u) - xy * uy / yy)
        form[4] = zone * (dot(x, v) - xy * vy / yy)
        form[5] = dot(x, x) - xy * xy / yy - inside * inside
        count += 1
    return count


@inlined(fastmath={"contract"})
def _near_faces(start, way, side, up, size, before, length, wavelength, reach, body, flat):
    """Find the triangles near a leg: the offsets of their corners (face, 3, 2); return how many."""
    corners, closed = body[3], body[4]
    count = 0
    for face in range(len(corners)):
        own = flat[count]
        behind = beyond = 0
        least = np.inf
        largest = 0.0
        # The corners' offsets, each in Fresnel radii at its own place along the leg.
        for i in range(3):
            g = minus(corners[face, i], start)
            along = dot(g, way)
            behind += along < 0
            beyond += along > size
            past = before + min(max(along, 0.0), size)
            zone = math.sqrt(max(wavelength * past * max(length - past, 0.0) / length, _LEAST_M2))
            own[i, 0], own[i, 1] = dot(g, side) / zone, dot(g, up) / zone
            least = min(least, math.hypot(own[i, 0], own[i, 1]))
            edge0, edge1 = own[i, 0] - own[0, 0], own[i, 1] - own[0, 1]
            largest = max(largest, math.hypot(edge0, edge1))
        # Nothing of the triangle is between the ends, or it is too far aside.
        if behind == 3 or beyond == 3 or least > reach + largest:
            continue
        # The faces of one orientation make the whole silhouette of a closed surface.
        turn = (own[1, 0] - own[0, 0]) * (own[2, 1] - own[0, 1])
        turn -= (own[1, 1] - own[0, 1]) * (own[2, 0] - own[0, 0])
        if closed[face] and turn <= 0:
            continue
        count += 1
    return count


@inlined(fastmath={"contract"})
def _merged(low, high, n, lows, highs):
    """Add an interval to ``n`` disjoint ones, merged with those that it meets; return how many."""
    low, high = max(low, -_FAR), min(high, _FAR)
    if low >= high:
        return n
    # What does not meet the new interval is kept; what meets it widens it.
    kept = 0
    for i in range(n):
        if lows[i] <= high and highs[i] >= low:
            low, high = min(low, lows[i]), max(high, highs[i])
        else:
            lows[kept], highs[kept] = lows[i], highs[i]
            kept += 1
    lows[kept], highs[kept] = low, high
    return kept + 1


@inlined(fastmath={"contract"})
def _chords(cosines, sines, half, near, count, begins, ends):
    """Fill in what lines through the leg cover of ellipses: ``begins`` and ``ends (part, line)``.

    A line stands for all lines within the angle ``half`` on either side of it, and its chord is the
    mean of theirs; else the chord of a silhouette that a line just touches would come out of
    nothing. Where the line meets none, the end comes before the beginning. There are no branches,
    so that the loop over lines runs in vector lanes.
    """
    for part in range(count):
        a0, a1, a2, b0, b1, c = near[part]
        for line in range(len(cosines)):
            cosine, sine = cosines[line], sines[line]
            # The quadratic in the radius along this line, a r^2 - 2 b r + c.
            both0, both1, both2 = cosine * cosine, 2 * cosine * sine, sine * sine
            a = a0 * both0 + a1 * both1 + a2 * both2
            b = b0 * cosine + b1 * sine
            turned = b1 * cosine - b0 * sine
            wider = (a2 - a0) * both1 + 2 * a1 * (both0 - both2)
            # Its discriminant, and by how much that changes within the cell on either side of the
            # line.
            under, slope = b * b - a * c, abs(half * (2 * b * turned - wider * c))
            # The mean of its square root over the cell, where it changes linearly; 0 below 0.
            high, low = under + slope, under - slope
            high, low = high if high > 0 else 0.0, low if low > 0 else 0.0
            mean = (high * math.sqrt(high) - low * math.sqrt(low)) / (3 * slope)
            # Where the discriminant hardly changes, its root serves, to 0.05 %.
            root = math.sqrt(high - slope) if slope < 0.1 * under else mean
            missed = high <= 0
            begins[part, line] = 1.0 if missed else (b - root) / a
            ends[part, line] = -1.0 if missed else (b + root) / a


@inlined(fastmath={"contract"})
def _over_faces(cosine, sine, flat, count, n, lows, highs):
    """Add what triangles cover of a line through the leg to ``n`` intervals; return how many."""
    for face in range(count):
        own = flat[face]
        low, high = np.inf, -np.inf
        # Where the line crosses the sides of the triangle.
        for i in range(3):
            j = (i + 1) % 3
            here = own[i, 1] * cosine - own[i, 0] * sine
            there = own[j, 1] * cosine - own[j, 0] * sine
            if (here > 0) != (there > 0):
                part = here / (here - there)
                x = own[i, 0] + part * (own[j, 0] - own[i, 0])
                y = own[i, 1] + part * (own[j, 1] - own[i, 1])
                place = x * cosine + y * sine
                low, high = min(low, place), max(high, place)
        n = _merged(low, high, n, lows, highs)
    return n


@compiled(fastmath={"contract"})
def occluded_fractions(legs, wavelength, body, reach, lines, scales, table, out):
    """Fill in the occluded fraction (leg, node) complex of legs past a posed body.

    ``legs`` are starts and ends (leg, 3), the path before the start, and the length of the whole
    path (leg,) [m]; ``body`` is a `Posed`. Parts that are farther from a leg than ``reach`` Fresnel
    radii are left out. The integral is taken over ``lines`` lines through each leg; ``scales
    (node,)`` are frequencies over the one of the wavelength, ``table`` is made by `wave_table`.
    """
    starts, ends, before, length = legs
    parts, faces = len(body[0]), len(body[3])
    near, flat = np.empty((parts, 6)), np.empty((faces, 3, 2))
    lows, highs = np.empty(parts + faces), np.empty(parts + faces)
    begins, stops = np.empty((parts, lines)), np.empty((parts, lines))
    cosines, sines = np.empty(lines), np.empty(lines)
    # Lines at equal angles over half a turn; each covers both directions from the leg.
    half = 0.5 * math.pi / lines
    for line in range(lines):
        angle = (line + 0.5) * math.pi / lines
        cosines[line], sines[line] = math.cos(angle), math.sin(angle)
    for leg in range(len(starts)):
        way, size = with_length(minus(ends[leg], starts[leg]))
        side, up = _across(way)
        own = out[leg]
        own[:] = 0
        # The start of the leg, the path before it, and the length of the whole path.
        start, past, whole = starts[leg], before[leg], length[leg]
        # The silhouettes near this leg, as ellipses and as triangles.
        count = _near_parts(start, way, side, up, size, past, whole, wavelength, reach, body, near)
        count_flat = _near_faces(
            start, way, side, up, size, past, whole, wavelength, reach, body, flat
        )
        if count + count_flat == 0:
            continue
        # Along each line the parts that silhouettes cover are merged, because what two of them
        # cover is lost once.
        _chords(cosines, sines, half, near, count, begins, stops)
        for line in range(lines):
            n = 0
            for part in range(count):
                n = _merged(begins[part, line], stops[part, line], n, lows, highs)
            n = _over_faces(cosines[line], sines[line], flat, count_flat, n, lows, highs)
            for i in range(n):
                _crossing(highs[i], scales, table, 0.5 / lines, own)
                _crossing(lows[i], scales, table, -0.5 / lines, own)
