"""Open fractions of the cells of Fresnel zones, from the edges that rays have found.

Rays are traced to the corners of wide cells, each of which is one or several cells along a
meridian: one near the specular point, more farther out. Where some corners of
such a cell are blocked, the edge through it is the straight line in the plane of rho between the
two places at which it crosses the sides of the cell; see
`rtradar.kernels.scatter.zones.fresnel_zones`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.triangles import positive_fraction
from rtradar.kernels.scatter.zones.fresnel_zones import CELLS, MERIDIANS


class Edges(NamedTuple):
    """What rays say about the wide cells, as each antenna sees them.

    ``blocked (zone, antenna, meridian, corner)`` bool, corners from the specular point outwards;
    places (x, y) at which edges cross the sides whose ends differ: ``radial (zone, antenna,
    meridian, band, 2)`` of sides along meridians, and ``ring (zone, antenna, meridian, corner, 2)``
    of those from each meridian to the next.
    """

    blocked: NDArray[np.bool_]
    radial: NDArray[np.float64]
    ring: NDArray[np.float64]


@inlined()
def _line(first, second, x, y, is_open):
    """Return a, b, c of a x + b y + c, which is 0 on both places and positive on the open side."""
    a, b = first[1] - second[1], second[0] - first[0]
    c = -a * first[0] - b * first[1]
    sign = 1.0 if (a * x + b * y + c > 0) == is_open else -1.0
    return sign * a, sign * b, sign * c


@inlined()
def _open_quadrilateral(a, b, c, d):
    """Fraction of a cell where a function is positive, from its values a, b and c, d at two sides.

    The cell is cut into triangles along one diagonal and along the other: no value at a corner can
    pass 0 and the fraction jump.
    """
    if min(min(a, b), min(c, d)) >= 0:
        return 1.0
    if max(max(a, b), max(c, d)) <= 0:
        return 0.0
    first = positive_fraction(a, b, c) + positive_fraction(d, b, c)
    return (first + positive_fraction(a, b, d) + positive_fraction(a, c, d)) / 4


@inlined()
def _open_cell(line, j, here, after, cosine, sine):
    """Fraction of the cell from j to j + 1 on the positive side of a line.

    ``here`` and ``after`` are the rho of one cell on its two meridians.
    """
    a, b, c = line
    first, last = c + a * here * j, c + a * here * (j + 1)
    across = (a * cosine + b * sine) * after
    other_first, other_last = c + across * j, c + across * (j + 1)
    if j == 0:  # the innermost cell has three corners
        return positive_fraction(first, last, other_last)
    return _open_quadrilateral(first, last, other_first, other_last)


@compiled()
def open_fractions(maps, edges, bounds, out):
    """Fill in the fraction of each cell that is open, ``out (zone, antenna, meridian, cell)``.

    The cells between a meridian and the next are counted with that meridian. Wide cells go from
    one of the ``bounds (band + 1,)`` int64 to the next, counted in cells.
    """
    angle = 2 * math.pi / MERIDIANS
    cosine, sine = math.cos(angle), math.sin(angle)
    zones, antennas, _, bands = edges.radial.shape[:4]
    found = np.empty((4, 2))
    for zone in range(zones):
        for a in range(antennas):
            for m in range(MERIDIANS):
                after = (m + 1) % MERIDIANS
                own, its = edges.blocked[zone, a, m], edges.blocked[zone, a, after]
                # In axes that begin at this meridian.
                here, there = maps.rim[zone, m] / CELLS, maps.rim[zone, after] / CELLS
                east_x, east_y = math.cos(m * angle), math.sin(m * angle)
                for band in range(bands):
                    begin, end = bounds[band], bounds[band + 1]
                    cells = out[zone, a, m, begin:end]
                    b00, b01, b10, b11 = own[band], own[band + 1], its[band], its[band + 1]
                    if b00 == b01 and b00 == b10 and b00 == b11:
                        cells[:] = 0.0 if b00 else 1.0
                        continue
                    # Where edges cross its sides: radial ones first, then rings.
                    n = 0
                    for side in range(4):
                        if side == 0 and b00 != b01:
                            place = edges.radial[zone, a, m, band]
                        elif side == 1 and b10 != b11:
                            place = edges.radial[zone, a, after, band]
                        elif side == 2 and b00 != b10:
                            place = edges.ring[zone, a, m, band]
                        elif side == 3 and b01 != b11:
                            place = edges.ring[zone, a, m, band + 1]
                        else:
                            continue
                        found[n, 0] = east_x * place[0] + east_y * place[1]
                        found[n, 1] = east_x * place[1] - east_y * place[0]
                        n += 1
                    inner = here * begin
                    outer = there * end
                    # Four crossings are two edges, each round a corner, opposite to one another.
                    second = found[1] if n == 2 else found[2]
                    line = _line(found[0], second, inner, 0.0, not b00)
                    for j in range(end - begin):
                        cells[j] = _open_cell(line, begin + j, here, there, cosine, sine)
                    if n == 4:
                        x, y = outer * cosine, outer * sine
                        line = _line(found[1], found[3], x, y, not b11)
                        for j in range(end - begin):
                            more = _open_cell(line, begin + j, here, there, cosine, sine)
                            both = cells[j] + more
                            cells[j] = max(both - 1, 0.0) if b00 else min(both, 1.0)
