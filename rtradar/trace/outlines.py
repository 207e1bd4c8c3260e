"""Outlines of ellipsoids as an antenna sees them: which part may stand before which, before any line of sight is looked at."""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.jit import inlined

VIEWS = 8
"""Directions across the line of sight in which two outlines are compared."""


@inlined()
def _normalize(vector):
    length = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    for i in range(3):
        vector[i] /= length


@inlined()
def _cross(a, b, out):
    out[0], out[1], out[2] = (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@inlined()
def outlines(antenna, centres, frames, semi_axes, low, high, near, far):
    """How parts stand before an antenna: from where to where (part, view) across the view, and along it (part,).

    Across: the slopes x.d / x.w of the planes through the antenna that touch the ellipsoid, w the way to the middle of the
    body and d a direction across it; infinite where a part reaches beside the antenna.
    """
    # Number by number: operations on whole small arrays take seconds to compile.
    way, side, first, second, place, w = (
        np.zeros(3),
        np.zeros(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
    )
    for part in range(len(centres)):
        for i in range(3):
            way[i] += centres[part, i] / len(centres)
    for i in range(3):
        way[i] -= antenna[i]
    _normalize(way)
    least = 0
    for i in range(1, 3):
        if abs(way[i]) < abs(way[least]):
            least = i
    side[least] = 1.0
    _cross(way, side, first)
    _normalize(first)
    _cross(way, first, second)
    for part in range(len(centres)):
        along = 0.0
        for i in range(3):
            place[i], w[i] = centres[part, i] - antenna[i], 0.0
            along += place[i] * way[i]
            for j in range(3):
                w[i] += semi_axes[part, i] * frames[part, j, i] * way[j]
        ww = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
        near[part], far[part] = along - math.sqrt(ww), along + math.sqrt(ww)
        for view in range(VIEWS):
            cosine, sine = math.cos(math.pi * view / VIEWS), math.sin(math.pi * view / VIEWS)
            across, dd, dw = 0.0, 0.0, 0.0
            for i in range(3):
                d = 0.0
                for j in range(3):
                    d += (
                        semi_axes[part, i]
                        * frames[part, j, i]
                        * (cosine * first[j] + sine * second[j])
                    )
                across += place[i] * (cosine * first[i] + sine * second[i])
                dd += d * d
                dw += d * w[i]
            # A plane with normal d - t w touches where (across - t along)^2 = |d - t w|^2, in axes of the unit ball.
            square = along * along - ww
            if along <= 0 or square <= 0:
                low[part, view], high[part, view] = -math.inf, math.inf
                continue
            middle = (across * along - dw) / square
            half = math.sqrt(max(middle * middle - (across * across - dd) / square, 0.0))
            low[part, view], high[part, view] = middle - half, middle + half


@inlined()
def may_hide(part, other, low, high, near, far):
    """Whether one part may stand before another: it begins before that ends, and no view shows a gap between them."""
    if near[other] >= far[part]:
        return False
    apart = False
    for view in range(VIEWS):
        apart |= low[other, view] > high[part, view] or high[other, view] < low[part, view]
    return not apart
