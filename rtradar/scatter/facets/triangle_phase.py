"""Linear phase over triangles, integrated exactly and added up.

The mean of exp(j phi) over a triangle with phases phi_i at its corners is twice the divided difference of exp at
j phi_1, j phi_2, j phi_3 (Hermite and Genocchi), the formula of Gordon (1975) and Ludwig (1968) in a form without small
denominators: about the mean phase a series, 2 sum_n j^n h_n / (n + 2)!, whose h_n = p h_(n-2) + q h_(n-3) are the complete
symmetric polynomials of phases with sum 0, p = (u^2 + v^2 + w^2) / 2, q = u v w; for large phases the differences themselves,
divided by the largest of the three.
"""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.jit import inlined

SERIES = 4.0
"""Largest p for the series: what it leaves out, up to 2.5 p^6 2 / 14!, is then 2.4e-7 of a facet."""

# Sums may be reordered; NaN and infinity keep their meaning.
FAST = {"reassoc", "contract", "nsz", "arcp"}


_LEAST = 1e-4
"""Least spread of the phases over a facet in the formula for large ones: what is less is taken for it, 1e-9 of a facet."""


@inlined(fastmath=FAST)
def _phasor(angle):
    """Cosine and sine by Taylor's series of half the angle, within 3e-11: branch-free, and so in vector lanes."""
    turns = angle * (0.5 / math.pi)
    half = math.pi * (turns - np.floor(turns + 0.5))
    x = half * half
    sine = -1 / 1307674368000 * x + 1 / 6227020800
    sine = half * (
        1
        + x
        * (
            -1 / 6
            + x * (1 / 120 + x * (-1 / 5040 + x * (1 / 362880 + x * (-1 / 39916800 + x * sine))))
        )
    )
    cosine = 1 / 20922789888000 * x - 1 / 87178291200
    cosine = 1 / 40320 + x * (-1 / 3628800 + x * (1 / 479001600 + x * cosine))
    cosine = 1 + x * (-1 / 2 + x * (1 / 24 + x * (-1 / 720 + x * cosine)))
    return 1 - 2 * sine * sine, 2 * sine * cosine


@inlined(fastmath=FAST)
def _sine(angle):
    """Sine of an angle from 0 on, within 1e-12 of itself where it is small."""
    halves = np.floor(angle * (1 / math.pi) + 0.5)
    rest = angle - halves * math.pi
    x = rest * rest
    sine = 1 / 362880 + x * (
        -1 / 39916800 + x * (1 / 6227020800 + x * (-1 / 1307674368000 + x / 355687428096000))
    )
    sine = rest * (1 + x * (-1 / 6 + x * (1 / 120 + x * (-1 / 5040 + x * sine))))
    return sine * (1 - 2 * (halves - 2 * np.floor(0.5 * halves)))


@inlined(fastmath=FAST)
def sum_small(mean, u, v, strength, k):
    """Sum of strength exp(-jk mean) times the mean of exp(-jk deviation), of facets with small deviations."""
    real, imaginary = 0.0, 0.0
    for i in range(len(mean)):
        a, b = -k * u[i], -k * v[i]
        p = a * a + a * b + b * b
        q = -a * b * (a + b)
        square = q * q
        mean_re = 1 + p * (
            -1 / 12 + p * (1 / 360 + p * (-1 / 20160 + p * (1 / 1814400 - p / 239500800)))
        )
        mean_re += square * (-1 / 20160 + p * (3 / 1814400 - p * 6 / 239500800))
        mean_im = -1 / 60 + p * (
            1 / 1260 + p * (-1 / 60480 + p * (4 / 19958400 - p * 5 / 3113510400))
        )
        mean_im = q * (mean_im + square * (1 / 19958400 - p * 4 / 3113510400))
        turn_re, turn_im = _phasor(-k * mean[i])
        real += strength[i] * (turn_re * mean_re - turn_im * mean_im)
        imaginary += strength[i] * (turn_re * mean_im + turn_im * mean_re)
    return complex(real, imaginary)


@inlined(fastmath=FAST)
def sum_large(mean, u, v, strength, k):
    """The same for any deviations, by differences.

    Between phases x and y the difference of exp is exp(j (x + y) / 2) sin(h) / h, h = (y - x) / 2; of the two that meet at
    the middle one of the three phases the difference again, over the largest spread, is the mean.
    """
    real, imaginary = 0.0, 0.0
    for i in range(len(mean)):
        a, b = -k * u[i], -k * v[i]
        c = -a - b
        low, high = min(-_LEAST, min(a, min(b, c))), max(_LEAST, max(a, max(b, c)))
        middle = -low - high
        above, below = max(0.5 * (high - middle), 1e-30), max(0.5 * (middle - low), 1e-30)
        size = 2 * strength[i] / (above * below * (high - low))
        upper, lower = size * _sine(above) * below, size * _sine(below) * above
        turn = -k * mean[i]
        upper_re, upper_im = _phasor(turn - 0.5 * low)
        lower_re, lower_im = _phasor(turn - 0.5 * high)
        real += upper * upper_im - lower * lower_im
        imaginary -= upper * upper_re - lower * lower_re
    return complex(real, imaginary)


@inlined(fastmath=FAST)
def largest_spread(u, v, room):
    """The largest p, for k = 1; ``room`` is longer by one.

    Numbers from 0 on are in the order of their bits, and the largest of integers is found in vector lanes.
    """
    for i in range(len(u)):
        room[i] = max(u[i] * u[i] + u[i] * v[i] + v[i] * v[i], 0.0)
    bits, largest = room.view(np.int64), 0
    for i in range(len(u)):
        largest = max(largest, bits[i])
    bits[len(u)] = largest
    return room[len(u)]
