"""Weights of what is blended from one keyframe to the next."""

from __future__ import annotations

from rtradar.kernels.jit import inlined


@inlined()
def smoothstep(fraction):
    """Cubic from 0 to 1 that is level at both ends, at a fraction of the interval from 0 to 1."""
    return fraction * fraction * (3 - 2 * fraction)


@inlined()
def hermite_weights(fraction, width):
    """Weights of both values, then of both slopes, in the cubic through an interval of a width."""
    x, y = fraction, 1 - fraction
    return y * y * (1 + 2 * x), smoothstep(x), x * y * y * width, -x * x * y * width
