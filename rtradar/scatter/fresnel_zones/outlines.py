"""Where the outlines of other ellipsoids cut the Fresnel zones of one: clearances of rays, and shares of cells left open.

In closed form: the clearance of the ray from the unit sphere, in the occluder's own stretched axes. So a share changes
smoothly as an edge wanders over the zones.
"""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.jit import inlined
from rtradar.kernels.small_vectors import apply
from rtradar.scatter.facets.triangle_fraction import positive_share
from rtradar.scatter.fresnel_zones.grid import CELLS, MERIDIANS, from_centre, meridian


@inlined()
def outlines(
    part, centres, frames, semi_axes, antennas, occluders, cap_t, cap_r, stretch, pole, along
):
    """Least clearance of the rays from each antenna to the corners of the cells: (meridian, antenna, corner)."""
    n_antennas, n_others = len(antennas), 0
    others = np.empty(len(occluders), dtype=np.int64)
    for q in range(len(occluders)):
        if occluders[q]:
            others[n_others] = q
            n_others += 1
    inverse, o, u = np.empty((n_others, 3, 3)), np.empty((n_others, 3)), np.empty((n_others, 3))
    seen_from = np.empty((n_others, n_antennas, 3))
    up, side, way, other_side = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    apply(stretch, pole, up)
    for i in range(n_others):
        q = others[i]
        for row in range(3):
            for column in range(3):
                inverse[i, row, column] = frames[q, column, row] / semi_axes[q, row]
        from_centre(centres[part], centres[q], inverse[i], way, o[i])
        apply(inverse[i], up, u[i])
        for a in range(n_antennas):
            from_centre(antennas[a], centres[q], inverse[i], way, seen_from[i, a])
    step, cosine, sine = np.empty(3), np.empty(CELLS + 1), np.empty(CELLS + 1)
    clear = np.ones((MERIDIANS, n_antennas, CELLS + 1))
    for m in range(MERIDIANS):
        pace, end = meridian(m * 2 * math.pi / MERIDIANS, pole, along, cap_t, cap_r, step)
        turn = end * pace / CELLS
        for j in range(CELLS + 1):
            cosine[j], sine[j] = math.cos(j * turn), math.sin(j * turn)
        apply(stretch, step, side)
        for i in range(n_others):
            apply(inverse[i], side, other_side)
            for a in range(n_antennas):
                _clearance(seen_from[i, a], o[i], u[i], other_side, cosine, sine, clear[m, a])
    return clear


@inlined()
def _clearance(antenna, o, u, t, cosine, sine, clear):
    """Lower ``clear`` to how far outside the unit sphere the ray from ``antenna`` to each o + cos u + sin t passes."""
    a0, a1, a2 = antenna[0], antenna[1], antenna[2]
    for j in range(len(cosine)):
        d0 = o[0] + cosine[j] * u[0] + sine[j] * t[0] - a0
        d1 = o[1] + cosine[j] * u[1] + sine[j] * t[1] - a1
        d2 = o[2] + cosine[j] * u[2] + sine[j] * t[2] - a2
        # Nearest to the middle of the sphere on the way from antenna to point.
        share = -(a0 * d0 + a1 * d1 + a2 * d2) / (d0 * d0 + d1 * d1 + d2 * d2)
        share = min(1.0, max(0.0, share))
        n0, n1, n2 = a0 + share * d0, a1 + share * d1, a2 + share * d2
        clear[j] = min(clear[j], math.sqrt(n0 * n0 + n1 * n1 + n2 * n2) - 1)


@inlined()
def open_share(a, b, c, d):
    """Share of a cell where a function is positive, from its values a, b and c, d at the ends of two opposite sides.

    As triangles, cut along one diagonal and along the other: no value at a corner can pass 0 and the share jump.
    """
    if min(min(a, b), min(c, d)) >= 0:
        return 1.0
    if max(max(a, b), max(c, d)) <= 0:
        return 0.0
    return (
        positive_share(a, b, c)
        + positive_share(d, b, c)
        + positive_share(a, b, d)
        + positive_share(a, c, d)
    ) / 4
