"""Linear functions and linear phases over triangles, and the radiation of ray tubes that end there.

The mean of exp(j phi) over a triangle with phases phi_i at its corners is twice the divided
difference of exp at j phi_1, j phi_2, j phi_3 (Hermite and Genocchi), the formula of Gordon (1975)
and Ludwig (1968) in a form without small denominators: about the mean phase a series,
2 sum_n j^n h_n / (n + 2)!, whose h_n = p h_(n-2) + q h_(n-3) are the complete symmetric polynomials
of phases with sum 0, p = (u^2 + v^2 + w^2) / 2, q = u v w; for large phases the differences
themselves, divided by the largest of the three.

The footprints of ray tubes are those of `rtradar.scatter.ray_tubes`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import (
    cross,
    dot,
    fast_phasor,
    minus,
    phasor,
    scaled,
    sine,
    with_length,
)
from rtradar.kernels.jit import compiled, inlined

FAST = {"reassoc", "contract", "nsz", "arcp"}
"""Sums may be reordered; NaN and infinity keep their meaning."""

SERIES = 4.0
"""Largest p for the series. It leaves out up to 2.5 p^6 2 / 14!, here 2.4e-7 of a triangle."""

_EXACT_SERIES = 1.0
"""The same for a single triangle, whose mean is to be exact to 1e-9."""

_LEAST = 1e-4
"""Least spread of phases in the formula for large ones; less is taken for it, to 1e-9."""


@inlined(fastmath=FAST)
def excess_paths(antenna, x, y, z, out):
    """Fill in paths from the antenna to vertices less the one to the origin; return the latter."""
    a, b, c = antenna[0], antenna[1], antenna[2]
    distance = math.sqrt(a * a + b * b + c * c)
    for i in range(len(x)):
        p, q, r = x[i], y[i], z[i]
        away = math.sqrt((p - a) ** 2 + (q - b) ** 2 + (r - c) ** 2)
        # |T - p| - |T| as a quotient: the difference itself would lose digits for a far antenna.
        out[i] = (p * (p - 2 * a) + q * (q - 2 * b) + r * (r - 2 * c)) / (away + distance)
    return distance


@inlined()
def positive_fraction(a, b, c):
    """Fraction of a triangle on which the linear function with these corner values is positive."""
    low, high = min(a, min(b, c)), max(a, max(b, c))
    if low >= 0:
        return 1.0
    if high <= 0:
        return 0.0
    # The quotients come before the products, because squares of tiny numbers would be 0.
    middle = a + b + c - low - high
    if middle <= 0:
        return high / (high - low) * (high / (high - middle))
    return 1 - low / (high - low) * (low / (middle - low))


@inlined(fastmath=FAST)
def by_series(a, b):
    """Mean of exp(j phase), real and imaginary, for phases a, b and -a - b that differ little."""
    p = a * a + a * b + b * b
    q = -a * b * (a + b)
    square = q * q
    real = 1 + p * (-1 / 12 + p * (1 / 360 + p * (-1 / 20160 + p * (1 / 1814400 - p / 239500800))))
    real += square * (-1 / 20160 + p * (3 / 1814400 - p * 6 / 239500800))
    imaginary = -1 / 60 + p * (
        1 / 1260 + p * (-1 / 60480 + p * (4 / 19958400 - p * 5 / 3113510400))
    )
    return real, q * (imaginary + square * (1 / 19958400 - p * 4 / 3113510400))


@inlined(fastmath=FAST)
def _by_differences(turn, a, b, strength):
    """Strength exp(j turn) times the mean of exp(j phase) for any phases a, b and -a - b.

    Between phases x and y the divided difference of exp is exp(j (x + y) / 2) sin(h) / h, with h =
    (y - x) / 2. Two of these meet at the middle one of the three phases: their difference, over the
    largest spread, gives the mean.
    """
    # The phases in ascending order; a least spread keeps the denominators from 0.
    c = -a - b
    low, high = min(-_LEAST, min(a, min(b, c))), max(_LEAST, max(a, max(b, c)))
    middle = -low - high
    # Half the difference between neighbouring phases, and twice the strength over all denominators.
    above, below = max(0.5 * (high - middle), 1e-30), max(0.5 * (middle - low), 1e-30)
    size = 2 * strength / (above * below * (high - low))
    # Both differences, each a sinc times the phasor in the middle of its two phases.
    upper, lower = size * sine(above) * below, size * sine(below) * above
    upper_re, upper_im = fast_phasor(turn - 0.5 * low)
    lower_re, lower_im = fast_phasor(turn - 0.5 * high)
    return upper * upper_im - lower * lower_im, lower * lower_re - upper * upper_re


@inlined()
def mean_of_phasor(a, b, c):
    """Mean of exp(-j phase), real and imaginary, over a triangle with phases a, b, c at corners.

    The phases add up to 0: the caller takes out their mean.
    """
    if a * a + a * b + b * b < _EXACT_SERIES:
        return by_series(-a, -b)
    return _by_differences(0.0, -a, -b, 1.0)


@inlined(fastmath=FAST)
def sum_small(mean, u, v, strength, k):
    """Sum of strength exp(-jk mean) times the mean of exp(-jk deviation), small u, v and -u - v."""
    real, imaginary = 0.0, 0.0
    for i in range(len(mean)):
        mean_re, mean_im = by_series(-k * u[i], -k * v[i])
        turn_re, turn_im = fast_phasor(-k * mean[i])
        real += strength[i] * (turn_re * mean_re - turn_im * mean_im)
        imaginary += strength[i] * (turn_re * mean_im + turn_im * mean_re)
    return complex(real, imaginary)


@inlined(fastmath=FAST)
def sum_large(mean, u, v, strength, k):
    """Do the same as `sum_small` for any deviations."""
    real, imaginary = 0.0, 0.0
    for i in range(len(mean)):
        re, im = _by_differences(-k * mean[i], -k * u[i], -k * v[i], strength[i])
        real += re
        imaginary += im
    return complex(real, imaginary)


@inlined()
def large_last(mean, u, v, strength, limit):
    """Put terms whose p, for k = 1, exceeds the limit after all others, in place.

    Returned is the number of the others.
    """
    small = 0
    for i in range(len(mean)):
        if u[i] * u[i] + u[i] * v[i] + v[i] * v[i] <= limit:
            mean[small], mean[i] = mean[i], mean[small]
            u[small], u[i] = u[i], u[small]
            v[small], v[i] = v[i], v[small]
            strength[small], strength[i] = strength[i], strength[small]
            small += 1
    return small


_STEEP = 1e-9
"""Sine of the angle from up below which the boresight takes the place of up."""


class Tubes(NamedTuple):
    """Where tubes of rays end: `Footprints` as plain arrays.

    ``places (tube, 4, 3)`` [m] and ``path (tube, 4)`` [m] are those of the three corners and the
    middle; ``direction``, ``normal`` and ``field (tube, 3)`` those of the middle ray; ``group
    (tube,)`` is the sum that each adds to.
    """

    places: NDArray[np.float64]
    path: NDArray[np.float64]
    direction: NDArray[np.float64]
    normal: NDArray[np.float64]
    field: NDArray[np.float64]
    group: NDArray[np.int64]


@inlined()
def _copolar(s, axes, horizontal):
    """Polarisation of a receiver, whose axes are columns: h = up x s, v = s x h."""
    # Along the receiver's up there is no horizontal: the boresight takes the place of up.
    h, size = with_length(cross(axes[:, 2], s))
    if size < _STEEP:
        h, size = with_length(cross(axes[:, 0], s))
    return h if horizontal else cross(s, h)


@inlined()
def _amplitude(tubes, tube, s, axes, horizontal, tapered):
    """Amplitude a of a footprint towards a receiver, times its area."""
    corners, d, e = tubes.places[tube], tubes.direction[tube], tubes.field[tube]
    # Normal of the triangle times its area, on the lit side.
    twice = cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]))
    n = scaled(twice, -0.5 if dot(twice, tubes.normal[tube]) < 0 else 0.5)
    q = _copolar(s, axes, horizontal)
    # What the currents on the triangle send along s, from the incident field e and its direction d.
    n_s, n_d = dot(n, s), dot(n, d)
    weight = (dot(e, q) * (n_s - n_d) + dot(d, q) * dot(n, e) - dot(e, s) * dot(n, q)) / 2
    if tapered:
        weight *= max(-4 * n_s * n_d, 0.0) / (n_s - n_d) ** 2
    return weight


@compiled()
def radiate_tubes(
    start, stop, tubes, visible, rx, axes, wavenumber, length, horizontal, spreading, tapered, out
):
    """Add what tubes send to receivers to ``out (chunk, node, rx, group)``, a part in each chunk.

    Tasks ``start`` to ``stop`` are done, one for each chunk and receiver. ``visible (rx, tube)``,
    ``rx (rx, 3)`` [m] and their axes (3, 3), ``wavenumber (node,)`` [1/m], and the path ``length
    (rx, group)`` whose phase is taken out [m].
    """
    count, receivers, chunks = len(tubes.group), len(rx), len(out)
    for task in range(start, stop):
        chunk, receiver = task // receivers, task % receivers
        here, u = rx[receiver], np.empty(3)
        # Chunks are interleaved, because occluded tubes come in runs.
        for tube in range(chunk, count, chunks):
            if not visible[receiver, tube]:
                continue
            # The amplitude of the tube, by its middle ray.
            own, middle = tubes.group[tube], tubes.places[tube, 3]
            way, leg = with_length(minus(here, middle))
            weight = _amplitude(tubes, tube, way, axes, horizontal, tapered)
            if spreading:
                weight /= leg
            # Paths over the corners, and their mean.
            mean = 0.0
            for corner in range(3):
                _, away = with_length(minus(here, tubes.places[tube, corner]))
                u[corner] = tubes.path[tube, corner] - length[receiver, own] + away
                mean += u[corner] / 3
            # The path bows quadratically across the triangle: the mean bow is 3/4 of the middle's.
            bow = 0.75 * (tubes.path[tube, 3] + leg - length[receiver, own] - mean)
            # The mean phasor over the triangle, turned by the mean path with its bow.
            for node in range(len(wavenumber)):
                k = wavenumber[node]
                a, b, c = k * (u[0] - mean), k * (u[1] - mean), k * (u[2] - mean)
                real, imaginary = mean_of_phasor(a, b, c)
                cosine, sine = phasor(k * (mean + bow) / (2 * math.pi))
                out[chunk, node, receiver, own] += weight * complex(
                    real * cosine + imaginary * sine, imaginary * cosine - real * sine
                )
