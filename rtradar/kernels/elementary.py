"""What many kernels need: the phasor of an angle, blends of keyframes, and vectors of three.

NumPy's functions for such small vectors take seconds to compile.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from rtradar.kernels.jit import compiled, inlined

# -- vectors of three, as tuples: an array would cost as much as the sums ------------------------


@inlined(fastmath={"contract"})
def dot(a, b):
    """Scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined(fastmath={"contract"})
def cross(a, b):
    """Cross product of two vectors."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined(fastmath={"contract"})
def plus(a, b):
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined(fastmath={"contract"})
def minus(a, b):
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined(fastmath={"contract"})
def scaled(a, factor):
    """Product of a vector and a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor


@inlined(fastmath={"contract"})
def stretched(a, b):
    """Product of two vectors, coordinate by coordinate."""
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@inlined(fastmath={"contract"})
def with_length(a):
    """Unit vector along a vector, and its length; the zero vector has no direction and stays 0."""
    size = math.sqrt(dot(a, a))
    return scaled(a, 1 / size if size > 0 else 0.0), size


@inlined(fastmath={"contract"})
def turned(matrix, a):
    """Product of a matrix (3, 3) and a vector: from the axes in its columns outward."""
    return dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a)


@inlined(fastmath={"contract"})
def turned_back(matrix, a):
    """Product of the transposed matrix and a vector: into the axes in its columns."""
    return (
        matrix[0, 0] * a[0] + matrix[1, 0] * a[1] + matrix[2, 0] * a[2],
        matrix[0, 1] * a[0] + matrix[1, 1] * a[1] + matrix[2, 1] * a[2],
        matrix[0, 2] * a[0] + matrix[1, 2] * a[1] + matrix[2, 2] * a[2],
    )


@inlined()
def least_axis(a):
    """Unit vector of the coordinate axis along which a vector is least, the first of equal ones."""
    x, y, z = abs(a[0]), abs(a[1]), abs(a[2])
    first = x <= y and x <= z
    second = not first and y <= z
    return 1.0 if first else 0.0, 1.0 if second else 0.0, 0.0 if first or second else 1.0


# -- phasors --


def _series(first, terms, kind):
    """Coefficients of sin(x) / x (``first`` 1) or cos(x) (0) in powers of x^2, |x| up to pi / 2.

    The first two are Taylor's, so that sines of small angles are exact. The rest is the polynomial
    through the Chebyshev nodes, which needs fewer terms.
    """
    # Taylor's coefficients in powers of x^2.
    taylor = [(-1) ** n / math.factorial(2 * n + first) for n in range(16)]
    rest = Chebyshev.interpolate(Polynomial(taylor[2:]), terms - 3, (0, math.pi**2 / 4))
    return tuple(kind(value) for value in (*taylor[:2], *rest.convert(kind=Polynomial).coef))


SINE, COSINE = _series(1, 9, np.float64), _series(0, 9, np.float64)
SINE_32, COSINE_32 = _series(1, 6, np.float32), _series(0, 6, np.float32)


@inlined(fastmath={"contract"})
def horner(x, coefficients):
    """A polynomial of x; the constant comes first."""
    total = coefficients[-1]
    for n in range(len(coefficients) - 2, -1, -1):
        total = coefficients[n] + x * total
    return total


@inlined(fastmath={"contract"})
def _turned(turns, pi, sines, cosines):
    """Cosine and sine from those of half the angle, so that no quadrant needs a branch."""
    # Whole turns do not matter. Half of what is left is within pi / 2, where both series hold.
    half = pi * (turns - np.rint(turns))
    x = half * half
    # Then the angle is doubled.
    sine, cosine = half * horner(x, sines), horner(x, cosines)
    return cosine * cosine - sine * sine, (sine + sine) * cosine


@inlined()
def phasor(turns):
    """Cosine and sine of a phase [turns], to 1e-15."""
    return _turned(turns, math.pi, SINE, COSINE)


@inlined()
def phasor_float32(turns):
    """Cosine and sine of a phase [turns] in float32, to 1e-6."""
    return _turned(turns, np.float32(math.pi), SINE_32, COSINE_32)


@inlined()
def fast_phasor(angle):
    """Cosine and sine of an angle [rad], to 1e-15 and the rounding of its turns."""
    return phasor(angle * (0.5 / math.pi))


@inlined(fastmath={"contract"})
def sine(angle):
    """Sine of an angle [rad], within 1e-15 of itself where it is small."""
    # Half turns are taken out; each of them changes the sign.
    halves = np.rint(angle * (1 / math.pi))
    rest = angle - halves * math.pi
    return rest * horner(rest * rest, SINE) * (1 - 2 * (halves - 2 * np.floor(0.5 * halves)))


# -- blends of keyframes --


@inlined()
def smoothstep(fraction):
    """Cubic from 0 to 1 that is level at both ends, at a fraction of the interval from 0 to 1."""
    return fraction * fraction * (3 - 2 * fraction)


@inlined()
def hermite_weights(fraction, width):
    """Weights of both values, then of both slopes, in the cubic over an interval of a width."""
    x, y = fraction, 1 - fraction
    return y * y * (1 + 2 * x), smoothstep(x), x * y * y * width, -x * x * y * width


@compiled(fastmath={"contract"})
def add_blended(tx, weights, keyframes, whole, out):
    """Add what is at rest, less a blend of four keyframes, to ``out (chirp, value)`` complex64.

    The sum over keyframes of ``weights (chirp, keyframe)`` float32 times ``keyframes (keyframe, tx,
    value)`` is subtracted from ``whole (tx, value)`` complex64; ``tx (chirp,)`` transmits.
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

    They are those of the cubic through the middle two, whose slopes there are those of the chords
    between both neighbours (Catmull and Rom, 1974): no keyframe makes a kink.
    """
    # For each keyframe the coefficients of the powers 0 to 3 of the fraction.
    f = np.asarray(fraction)[:, None]
    rows = ((0, -0.5, 1, -0.5), (1, 0, -2.5, 1.5), (0, 0.5, 2, -1.5), (0, 0, -0.5, 0.5))
    return np.concatenate([a + f * (b + f * (c + f * d)) for a, b, c, d in rows], axis=1)
