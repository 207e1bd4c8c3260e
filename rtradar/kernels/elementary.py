"""What many kernels need: the phasor of an angle, blends of keyframes, and vectors of three.

NumPy's functions for such small vectors take seconds to compile.
"""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.jit import compiled, inlined


@inlined()
def dot(a, b):
    """Product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined()
def apply(matrix, vector, out):
    """Fill ``out`` with the matrix times the vector."""
    x, y, z = vector[0], vector[1], vector[2]
    for i in range(3):
        out[i] = matrix[i, 0] * x + matrix[i, 1] * y + matrix[i, 2] * z


@inlined()
def subtract(a, b, out):
    """Fill ``out`` with a - b."""
    for i in range(3):
        out[i] = a[i] - b[i]


# -- phasors --


@inlined(fastmath={"reassoc", "contract", "nsz", "arcp"})
def fast_phasor(angle):
    """Cosine and sine of an angle [rad], to 3e-11: Taylor's series of its half, without branches.

    It has no quadrants to tell apart, and so fewer operations than `phasor`.
    """
    turns = angle * (0.5 / math.pi)
    half = math.pi * (turns - np.floor(turns + 0.5))
    x = half * half
    sine = -1 / 1307674368000 * x + 1 / 6227020800
    sine = 1 / 362880 + x * (-1 / 39916800 + x * sine)
    sine = half * (1 + x * (-1 / 6 + x * (1 / 120 + x * (-1 / 5040 + x * sine))))
    cosine = 1 / 20922789888000 * x - 1 / 87178291200
    cosine = 1 / 40320 + x * (-1 / 3628800 + x * (1 / 479001600 + x * cosine))
    cosine = 1 + x * (-1 / 2 + x * (1 / 24 + x * (-1 / 720 + x * cosine)))
    return 1 - 2 * sine * sine, 2 * sine * cosine


@inlined(fastmath={"contract"})
def phasor(turns):
    """Cosine and sine of a phase [turns], to 2e-16: Taylor's series of an eighth, no branches."""
    quarters = np.floor(4 * turns + 0.5)
    angle = (turns - 0.25 * quarters) * (2 * math.pi)
    x = angle * angle
    sine = 1 / 362880 + x * (-1 / 39916800 + x * (1 / 6227020800 - x / 1307674368000))
    sine = angle * (1 + x * (-1 / 6 + x * (1 / 120 + x * (-1 / 5040 + x * sine))))
    cosine = 1 / 40320 + x * (
        -1 / 3628800 + x * (1 / 479001600 + x * (-1 / 87178291200 + x / 20922789888000))
    )
    cosine = 1 + x * (-1 / 2 + x * (1 / 24 + x * (-1 / 720 + x * cosine)))
    quadrant = quarters - 4 * np.floor(0.25 * quarters)
    odd = quadrant == 1 or quadrant == 3
    across, up = (sine, cosine) if odd else (cosine, sine)
    return -across if quadrant == 1 or quadrant == 2 else across, -up if quadrant >= 2 else up


# -- blends of keyframes --


@inlined()
def smoothstep(fraction):
    """Cubic from 0 to 1 that is level at both ends, at a fraction of the interval from 0 to 1."""
    return fraction * fraction * (3 - 2 * fraction)


@inlined()
def hermite_weights(fraction, width):
    """Weights of both values, then of both slopes, in the cubic through an interval of a width."""
    x, y = fraction, 1 - fraction
    return y * y * (1 + 2 * x), smoothstep(x), x * y * y * width, -x * x * y * width


@compiled(fastmath={"contract"})
def add_blended(tx, weights, keyframes, whole, out):
    """Add what is at rest, less a blend of four keyframes, to ``out (chirp, value)`` complex64.

    Of ``whole (tx, value)`` complex64 is taken off the sum over keyframes of ``weights (chirp,
    keyframe)`` float32 times ``keyframes (keyframe, tx, value)``; ``tx (chirp,)`` transmits.
    """
    for chirp in range(len(tx)):
        own, kept = out[chirp], whole[tx[chirp]]
        a, b = keyframes[0, tx[chirp]], keyframes[1, tx[chirp]]
        c, d = keyframes[2, tx[chirp]], keyframes[3, tx[chirp]]
        of_a, of_b, of_c, of_d = weights[chirp]
        for i in range(len(own)):
            own[i] += kept[i] - (of_a * a[i] + of_b * b[i] + of_c * c[i] + of_d * d[i])


def cubic_weights(fraction):
    """Weights (chirp, 4) of keyframes before, at, after and past an interval's ``fraction``.

    They are those of the cubic through the middle two, with the slopes of the chords beside them
    (Catmull and Rom, 1974): no keyframe makes a kink.
    """
    f = np.asarray(fraction)[:, None]
    rows = ((0, -0.5, 1, -0.5), (1, 0, -2.5, 1.5), (0, 0.5, 2, -1.5), (0, 0, -0.5, 0.5))
    return np.concatenate([a + f * (b + f * (c + f * d)) for a, b, c, d in rows], axis=1)
