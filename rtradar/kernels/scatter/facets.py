"""The physical-optics integral over facets: linear phase integrated exactly over each triangle.

    F = jk / sqrt(pi) * sum over lit facets of  o w / (R_T R_R)  Int exp(-jk (R_T + R_R - L)) dS

For a radar, whose Tx and Rx are near each other, the sum is over facets that face both, and o is
the reciprocal obliquity (n.s_T + n.s_R) / 2: the Fresnel-Kirchhoff factor (Born and Wolf,
*Principles of Optics*, section 8.3.2). For antennas anywhere, the sum is over all facets that Tx
lights, and o = (e_R.e_T)(n.s_T) - (e_R.s_T)(n.e_T) is what the current 2 n x H radiates to Rx,
where e are the polarisations (Knott, Shaeffer and Tuley, *Radar Cross Section*, section 5.3). For
one antenna both are n.s. Path lengths are exact at the three vertices, in float64, and taken as
linear between them.

The integral is computed at some places of each interval between keyframes. Cubics go through its
envelope, which is known there (`fill_envelope`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import hermite_weights
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.triangles import (
    FAST,
    SERIES,
    excess_paths,
    large_last,
    positive_fraction,
    sum_large,
    sum_small,
)

Array = NDArray[np.float64]


class Facets(NamedTuple):
    """Triangles of one or more parts, one part after the other; each in its own axes.

    ``vertices (vertex, 3)`` float64 [m]; ``faces (facet, 3)`` int32, anticlockwise seen from
    outside; ``normals (facet, 3)``, outward; ``areas (facet,)`` [m^2]. ``bend (facet,)`` is how far
    n.s swings to either side of its mean over the curved surface that a facet represents, 0 where
    it is flat: the terminator is softened over it. ``rise (facet,)`` is how far that surface stands
    out of the facet in the mean [m]. ``ends (part + 1, 2)`` int64 are the first vertex and the
    first facet of each part, and last the numbers of all. With ``both_sides`` they are a thin
    sheet, lit from either side. ``semi_axes (part, 3)`` are those of the ellipsoids that facets
    stand for [m], whose terminator cuts the currents sharply; without them, (0, 3), it is softened.
    """

    vertices: Array
    faces: NDArray[np.int32]
    normals: Array
    areas: Array
    bend: Array
    rise: Array
    ends: NDArray[np.int64]
    both_sides: bool = False
    semi_axes: Array = np.empty((0, 3))


class Views(NamedTuple):
    """Tasks, each of which is one part in one pose, and what the antennas see of it.

    ``part (task,)`` int64; ``antennas (task, antenna, 3)`` float64 in the axes of that part [m];
    ``seen (row, facet)`` float32, the fraction of each facet that is not occluded, where the facets
    of the part begin at ``first (task,)`` int64; ``row (task, antenna)`` int64, the row of ``seen``
    that belongs to each antenna. For facets that are seen in part, ``edge (row, facet, 3)`` float32
    are values at the corners of a linear function that is positive where they are seen; without it,
    (0, 0, 3), they radiate by that fraction.
    """

    part: NDArray[np.int64]
    antennas: Array
    row: NDArray[np.int64]
    first: NDArray[np.int64]
    seen: NDArray[np.float32]
    edge: NDArray[np.float32] = np.empty((0, 0, 3), dtype=np.float32)


class Waves(NamedTuple):
    """Pairs of antennas, and the waves between them.

    ``pairs (pair, 2)`` int64, Tx and Rx among the antennas of a task; ``carrier (task, pair)`` the
    path whose phase is taken out [m]; ``wavenumber (task, node)`` [rad/m]; ``spreading``, whether
    each facet's field is divided by R_T R_R, normalised to 1 m. ``currents (task, pair, 6)`` are,
    with 0 <= w <= 1 the weight of the currents: w e_R.e_T; the vector -w (e_R.s_T) e_T in the axes
    of the part; what multiplies the reciprocal obliquity; and w. Without any, (0, 0, 6), the
    obliquity is the reciprocal one.
    """

    pairs: NDArray[np.int64]
    carrier: Array
    wavenumber: Array
    spreading: bool
    currents: Array = np.empty((0, 0, 6))


class _Chosen(NamedTuple):
    """Facets (n,) that may be lit: ``corners (3, n)``, normals and planes ``facing (4, n)``.

    ``facet (n,)`` is the column of each in `Views.seen`, ``corners`` are numbers of vertices of the
    part.
    """

    facet: NDArray[np.uint32]
    corners: NDArray[np.uint32]
    facing: Array
    areas: Array
    bend: Array
    rise: Array


class _Terms(NamedTuple):
    """Mean path, two deviations from it and strength of facets under two views."""

    mean: Array
    u: Array
    v: Array
    strength: Array


@inlined()
def _may_be_lit(antennas, planes, normals, bend, both, size, seen, row, start, chosen):
    """Fill ``chosen`` with facets that any of the antennas may light; their number is returned.

    ``bend`` is how far lit facets may face away. The row of what is seen has the first facet at
    ``start``.
    """
    count_antennas = len(antennas)
    # A ball that holds all antennas.
    x, y, z = antennas[:, 0].mean(), antennas[:, 1].mean(), antennas[:, 2].mean()
    spread = 0.0
    for antenna in antennas:
        spread = max(
            spread, math.sqrt((antenna[0] - x) ** 2 + (antenna[1] - y) ** 2 + (antenna[2] - z) ** 2)
        )
    # No antenna is farther than this from any vertex of the part.
    farthest = math.sqrt(x * x + y * y + z * z) + spread + size
    count = 0
    for f in range(len(planes)):
        # The height of the ball's middle over the facet's plane: none of the antennas is in front,
        # not even with the softened terminator, if the whole ball is below it.
        height = normals[f, 0] * x + normals[f, 1] * y + normals[f, 2] * z - planes[f]
        if both or height > -spread - bend[f] * farthest:
            # Nor does a facet count that no antenna sees.
            for antenna in range(count_antennas):
                if seen[row[antenna], start + f] > 0:
                    chosen[count] = f
                    count += 1
                    break
    return count


@inlined()
def _choose(facets, own, antennas, row, start, seen, bends, x, y, z):
    """Facets of a part that may be lit; its vertices' coordinates are filled in.

    Facets that face away by more than ``bends`` times their bend are not.
    """
    (first, begin), (last, end) = facets.ends[own], facets.ends[own + 1]
    vertices, faces = facets.vertices[first:last], facets.faces[begin:end]
    normals, every_bend = facets.normals[begin:end], facets.bend[begin:end]
    n_facets, size = len(faces), 0.0
    # The coordinates side by side, and the size of the part.
    for i in range(len(vertices)):
        x[i], y[i], z[i] = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        size = max(size, x[i] * x[i] + y[i] * y[i] + z[i] * z[i])
    # The plane of each facet, n.x = plane.
    planes = np.empty(n_facets)
    for f in range(n_facets):
        i = faces[f, 0] - first
        planes[f] = normals[f, 0] * x[i] + normals[f, 1] * y[i] + normals[f, 2] * z[i]
    lit, both = np.empty(n_facets, dtype=np.uint32), facets.both_sides
    reach = math.sqrt(size)
    away = bends * every_bend
    count = _may_be_lit(antennas, planes, normals, away, both, reach, seen, row, start, lit)
    # Coordinate by coordinate, with unsigned indices: an index that may be negative, and so count
    # from the end of an array, keeps a loop from vector lanes.
    corners, facing = np.empty((3, count), dtype=np.uint32), np.empty((4, count))
    areas, bend, rise = np.empty(count), np.empty(count), np.empty(count)
    for i in range(count):
        f = lit[i]
        for axis in range(3):
            corners[axis, i], facing[axis, i] = faces[f, axis] - first, normals[f, axis]
        facing[3, i] = planes[f]
        areas[i], bend[i], rise[i] = facets.areas[begin + f], every_bend[f], facets.rise[begin + f]
        lit[i] = start + f
    return _Chosen(lit[:count], corners, facing, areas, bend, rise)


@inlined(fastmath=FAST)
def _see(antenna, distance, excess, chosen, seen, view):
    """Rows of ``view``: mean path, two deviations from it, n.s, and the fraction that is seen."""
    a, b, c = antenna[0], antenna[1], antenna[2]
    first_of, second_of, third_of = chosen.corners[0], chosen.corners[1], chosen.corners[2]
    n0, n1, n2, plane = chosen.facing[0], chosen.facing[1], chosen.facing[2], chosen.facing[3]
    means, first_less, second_less, along, open_ = view[0], view[1], view[2], view[3], view[4]
    facet, rise = chosen.facet, chosen.rise
    for i in range(len(facet)):
        # The path to the three corners, as its mean and two deviations from it.
        first, second, third = excess[first_of[i]], excess[second_of[i]], excess[third_of[i]]
        mean = (first + second + third) / 3
        means[i], first_less[i], second_less[i] = mean, first - mean, second - mean
        open_[i] = seen[facet[i]]
    # In a loop of its own without gathered values, so that it runs in vector lanes.
    for i in range(len(facet)):
        along[i] = (n0[i] * a + n1[i] * b + n2[i] * c - plane[i]) / (distance + means[i])
        # The surface stands out of the facet toward the antenna, which shortens the path.
        means[i] -= rise[i] * along[i]


@inlined(fastmath=FAST)
def _facing_both(tx_facing, rx_facing, bend, both, out):
    """Fill in the reciprocal obliquity of facets that face Tx and Rx, 0 for the others."""
    for i in range(len(out)):
        # The side of the facet is that of the antenna which is lower over it; both faces of a sheet
        # count.
        low, high = min(tx_facing[i], rx_facing[i]), max(tx_facing[i], rx_facing[i])
        behind = both and high < 0
        low, high = (-high, -low) if behind else (low, high)
        # The lower value falls to 0 at the terminator by itself. The difference between Tx and Rx
        # does not: it is faded out over the bend of the facet.
        h = max(bend[i], 1e-300)
        over = min(1.0, max(0.0, (low + h) / (2 * h)))
        out[i] = max(low, 0.0) + over * (high - low) / 2


@inlined(fastmath=FAST)
def _polar_plane(antenna, semi_axes, x, y, z, out):
    """Fill in a function of vertices that is positive where an antenna lights an ellipsoid.

    It is linear, and 0 in the plane of :eq:`terminator` of the theory page.
    """
    a, b, c = (antenna / semi_axes) / semi_axes
    for i in range(len(x)):
        out[i] = a * x[i] + b * y[i] + c * z[i] - 1


@inlined(fastmath=FAST)
def _lit_by_tx(tx_facing, chosen, both, level, currents, lit, out):
    """Multiply the reciprocal obliquity by its weight, and add that of the currents Tx drives.

    ``level (vertex,)`` is that of `_polar_plane`, whose lit fraction of each facet is filled into
    ``lit``; without any, (0,), the terminator is softened.
    """
    first_of, second_of, third_of = chosen.corners[0], chosen.corners[1], chosen.corners[2]
    n0, n1, n2, bend = chosen.facing[0], chosen.facing[1], chosen.facing[2], chosen.bend
    along, x, y, z, reciprocal = currents[0], currents[1], currents[2], currents[3], currents[4]
    for i in range(len(out)):
        side = -1.0 if both and tx_facing[i] < 0 else 1.0
        facing = side * tx_facing[i]
        # The term across does not fall to 0 at the terminator by itself: it is cut or faded out.
        if len(level) > 0:
            over = positive_fraction(level[first_of[i]], level[second_of[i]], level[third_of[i]])
            lit[i] = over
        else:
            h = max(bend[i], 1e-300)
            over = min(1.0, max(0.0, (facing + h) / (2 * h)))
        across = x * n0[i] + y * n1[i] + z * n2[i]
        out[i] = reciprocal * out[i] + along * max(facing, 0.0) + over * side * across


@inlined(fastmath=FAST)
def _light(tx, rx, chosen, far_t, far_r, carrier, spreading, terms):
    """Fill in the terms of facets under two views; before, their strength is the obliquity."""
    tx_mean, tx_u, tx_v, tx_seen = tx[0], tx[1], tx[2], tx[4]
    rx_mean, rx_u, rx_v, rx_seen = rx[0], rx[1], rx[2], rx[4]
    areas = chosen.areas
    mean, u, v, strength = terms
    for i in range(len(mean)):
        # A facet returns no more than the antenna that sees less of it.
        size = strength[i] * min(tx_seen[i], rx_seen[i]) * areas[i]
        if spreading:
            size /= (far_t + tx_mean[i]) * (far_r + rx_mean[i])
        mean[i] = tx_mean[i] + rx_mean[i] - carrier
        u[i], v[i] = tx_u[i] + rx_u[i], tx_v[i] + rx_v[i]
        strength[i] = size


@inlined()
def _cut(tx, rx, edges, rows, chosen, level, lit, weight, terms):
    """Replace each facet on the edge of a shadow by its lit piece; return the number of terms.

    The ``rows`` of ``edges``, see `Views`, are those of Tx and of Rx. The terminator is an edge,
    too: ``level`` and ``lit`` are those of `_lit_by_tx`. It cuts no more of a facet's strength than
    the ``weight`` of the currents, because the reciprocal form has a soft terminator.

    The edge cuts a triangle off. If that is lit, it takes the place of the facet; if not, the whole
    facet stays, and the triangle is appended to the ``terms`` with a negative strength.
    """
    mean, u, v, strength = terms
    facet, corners = chosen.facet, chosen.corners
    count = len(facet)
    for i in range(len(facet)):
        # The edge of a shadow comes before the terminator.
        seen = min(tx[4, i], rx[4, i])
        fraction, share = (lit[i], weight) if seen >= 1 and weight > 0 else (seen, 1.0)
        if fraction <= 0 or fraction >= 1:
            continue
        if seen < 1:
            edge = edges[rows[0] if tx[4, i] <= rx[4, i] else rows[1], facet[i]]
            a, b, c = edge[0], edge[1], edge[2]
        else:
            a, b, c = level[corners[0, i]], level[corners[1, i]], level[corners[2, i]]
        # The paths over the three corners, from mean and deviations.
        first, second, third = mean[i] + u[i], mean[i] + v[i], mean[i] - u[i] - v[i]
        # Put first the corner that is alone on its side of the edge.
        single = (a > 0) + (b > 0) + (c > 0) == 1
        if (b > 0) == single and (a > 0) != single:
            a, b, c, first, second, third = b, c, a, second, third, first
        elif (a > 0) != single:
            a, b, c, first, second, third = c, a, b, third, first, second
        # The edge crosses both sides that meet at that corner, at these fractions of them.
        along, beside = a / (a - b), a / (a - c)
        second, third = along * (second - first), beside * (third - first)
        # The strength of the whole facet: the fraction that is seen was in it.
        place, whole = i, share * strength[i] / fraction
        size = whole * along * beside
        if not single or share < 1:
            strength[i] = (1 - share) * strength[i] + (0.0 if single else whole)
            place, size, count = count, size if single else -size, count + 1
        # The same terms for the triangle, whose corners are that one and both crossings.
        middle = first + (second + third) / 3
        mean[place], strength[place] = middle, size
        u[place], v[place] = first - middle, first + second - middle
    return count


@compiled()
def integrate(begin, end, facets, views, waves, out):
    """Fill ``out (task, pair, node)`` with F [m] for the tasks from begin to end."""
    count_antennas = views.antennas.shape[1]
    far = np.empty(count_antennas)
    for task in range(begin, end):
        antennas, row, own = views.antennas[task], views.row[task], views.part[task]
        # Coordinate by coordinate: loops over vertices run in vector lanes.
        count_vertices = facets.ends[own + 1, 0] - facets.ends[own, 0]
        x, y, z = np.empty(count_vertices), np.empty(count_vertices), np.empty(count_vertices)
        excess = np.empty(count_vertices)
        # A corner may face an antenna while its facet faces away by up to thrice its bend.
        wide, first = len(waves.currents) > 0, views.first[task]
        bends = 3.0 if wide else 1.0
        chosen = _choose(facets, own, antennas, row, first, views.seen, bends, x, y, z)
        count = len(chosen.facet)
        sharp = wide and len(facets.semi_axes) > 0
        level, lit = np.empty(count_vertices if sharp else 0), np.ones(count)
        # What each antenna sees of them.
        view = np.empty((count_antennas, 5, count))
        for antenna in range(count_antennas):
            far[antenna] = excess_paths(antennas[antenna], x, y, z, excess)
            seen = views.seen[row[antenna]]
            _see(antennas[antenna], far[antenna], excess, chosen, seen, view[antenna])
        # Pair by pair, the sum over facets at each frequency.
        rows, edges = np.empty((4, 2 * count)), len(views.edge) > 0
        for pair in range(len(waves.pairs)):
            t, r = waves.pairs[pair, 0], waves.pairs[pair, 1]
            offset = waves.carrier[task, pair] - far[t] - far[r]
            terms = _Terms(rows[0, :count], rows[1, :count], rows[2, :count], rows[3, :count])
            strength = terms.strength
            both, facing = facets.both_sides, view[t][3]
            _facing_both(facing, view[r][3], chosen.bend, both, strength)
            weight = 0.0
            if wide:
                currents = waves.currents[task, pair]
                weight = currents[5]
                if sharp:
                    _polar_plane(antennas[t], facets.semi_axes[own], x, y, z, level)
                _lit_by_tx(facing, chosen, both, level, currents, lit, strength)
            _light(view[t], view[r], chosen, far[t], far[r], offset, waves.spreading, terms)
            pieces = count
            if edges or sharp:
                given = views.edge, (row[t], row[r]), chosen, level, lit, weight
                pieces = _cut(view[t], view[r], *given, rows)
            mean, u, v = rows[0, :pieces], rows[1, :pieces], rows[2, :pieces]
            strength = rows[3, :pieces]
            # The series is for small phases: others go last, by the phase at the highest frequency.
            small = large_last(mean, u, v, strength, SERIES / waves.wavenumber[task].max() ** 2)
            for node in range(waves.wavenumber.shape[1]):
                k = waves.wavenumber[task, node]
                total = sum_small(mean[:small], u[:small], v[:small], strength[:small], k)
                total += sum_large(mean[small:], u[small:], v[small:], strength[small:], k)
                out[task, pair, node] = total * complex(0.0, k / math.sqrt(math.pi))


@inlined()
def stretch(known, place):
    """Return the nearest known places (place,) on either side of a place between both ends."""
    left = min(int(place), len(known) - 2)
    right = left + 1
    while not known[left]:
        left -= 1
    while not known[right]:
        right += 1
    return left, right


@compiled()
def fill_envelope(chirps, fraction, tx, weights, course, strength, amplitude):
    """Fill the amplitude (node, chirp, rx, part) at chirps, given by the fraction of the interval.

    ``tx (chirp,)`` and ``weights (tx, rx, pair)`` say what receivers take of each pair of nodes.
    ``course`` is the ratio and its slope (place, node, pair, part), and where these are known
    (place, part). The ratio is multiplied by ``strength (chirp, rx, part)``.
    """
    ratio, slope, known = course
    nodes, pairs, parts = ratio.shape[1:]
    receivers = weights.shape[1]
    for i in range(len(chirps)):
        # Weights of the cubic of each part.
        chirp, place = chirps[i], fraction[i] * (len(ratio) - 1)
        ends, cubic = np.empty((2, parts), dtype=np.int64), np.empty((4, parts))
        for part in range(parts):
            left, right = stretch(known[:, part], place)
            ends[0, part], ends[1, part] = left, right
            cubic[0, part], cubic[1, part], cubic[2, part], cubic[3, part] = hermite_weights(
                (place - left) / (right - left), right - left
            )
        own = weights[tx[chirp]]
        value = np.empty(parts, dtype=np.complex128)
        amplitude[:, chirp] = 0
        for pair in range(pairs):
            # Where the nodes are at antennas, a transmitter needs only a few of the pairs.
            used = False
            for receiver in range(receivers):
                used |= own[receiver, pair] != 0
            if not used:
                continue
            # Each pair's value, added to the receivers.
            for node in range(nodes):
                for part in range(parts):
                    left, right = ends[0, part], ends[1, part]
                    value[part] = (
                        cubic[0, part] * ratio[left, node, pair, part]
                        + cubic[1, part] * ratio[right, node, pair, part]
                        + cubic[2, part] * slope[left, node, pair, part]
                        + cubic[3, part] * slope[right, node, pair, part]
                    )
                for receiver in range(receivers):
                    weight, out = own[receiver, pair], amplitude[node, chirp, receiver]
                    for part in range(parts):
                        out[part] += weight * value[part] * strength[chirp, receiver, part]
