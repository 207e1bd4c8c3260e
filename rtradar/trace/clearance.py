"""How far a line of sight passes outside an ellipsoid, in closed form."""

from __future__ import annotations

import math

from rtradar.kernels.jit import inlined


@inlined()
def clearance(antenna, point, centre, frame, axes):
    """Least distance of the way from antenna to point from the ellipsoid's middle, in its own unit, less 1.

    Negative where the way goes through, or the point is inside. All in world axes (3,), columns of ``frame`` the directions
    of the semi-axes.
    """
    start_square, span, along = 0.0, 0.0, 0.0
    for i in range(3):
        start, way = 0.0, 0.0
        for j in range(3):
            start += frame[j, i] * (antenna[j] - centre[j])
            way += frame[j, i] * (point[j] - antenna[j])
        start, way = start / axes[i], way / axes[i]
        start_square += start * start
        span += way * way
        along += start * way
    return beside_ball(start_square, along, span)


@inlined()
def beside_ball(start_square, along, span):
    """Least distance of a way from the middle of the unit ball, less 1.

    Of where the way starts the square, of the way its own square (``span``), and the product of both (``along``).
    """
    nearest = min(1.0, max(0.0, -along / span))
    return math.sqrt(max(start_square + nearest * (2 * along + nearest * span), 0.0)) - 1


@inlined()
def into_ball(part, other, antenna, centres, frames, semi_axes, turn, shift, start):
    """From the axes of a part to those of another in which it is the unit ball; and the antenna in these."""
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
