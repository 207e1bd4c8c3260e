"""Mean of a phasor over one triangle, for any phases at its corners: `triangle_phase` has sums over many."""

from __future__ import annotations

import math

from rtradar.kernels.jit import inlined
from rtradar.kernels.phasor import phasor

_SERIES = 3.4
"""Phases that differ by less take the series: what it leaves out is then 1e-8."""
_TERMS = 16
_ODD = tuple(2.0 * (-1) ** ((m - 3) // 2) / math.factorial(m + 2) for m in range(_TERMS))
_EVEN = tuple(2.0 * (-1) ** ((m + 1) // 2) / math.factorial(m + 3) for m in range(_TERMS))


@inlined()
def mean_of_phasor(a: float, b: float, c: float) -> tuple[float, float]:
    """Mean of exp(-j phase) over a triangle on which the phase is linear, a, b and c at its corners.

    The phases at the corners add up to 0: the caller takes out their mean. Real and imaginary part.
    """
    low, high = min(a, min(b, c)), max(a, max(b, c))
    if high - low < _SERIES:
        # 2 sum (-j)^m h_m / (m + 2)!, h_m the complete homogeneous polynomials: the series of the divided difference.
        two, three = a * b + b * c + c * a, a * b * c
        third_last, second_last, last = 1.0, 0.0, -two
        real, imaginary = 1 + two / 12, 0.0
        for m in range(3, _TERMS, 2):
            odd = -two * second_last + three * third_last
            even = -two * last + three * second_last
            imaginary += _ODD[m] * odd
            real += _EVEN[m] * even
            third_last, second_last, last = last, odd, even
        return real, imaginary
    # 2 (E(low, mid) - E(mid, high)) / (-j (low - high)), E the mean over a side. What it takes of sines and cosines are those
    # of half of low and of half of high: half of mid - low is -(low + high / 2), and so on.
    cos_low, sin_low = phasor(low / (4 * math.pi))
    cos_high, sin_high = phasor(high / (4 * math.pi))
    left, right = -(low + high / 2), high + low / 2
    left_sine = -(2 * sin_low * cos_low * cos_high + (1 - 2 * sin_low * sin_low) * sin_high)
    right_sine = 2 * sin_high * cos_high * cos_low + (1 - 2 * sin_high * sin_high) * sin_low
    left_size = left_sine / left if left > 1e-8 else 1.0
    right_size = right_sine / right if right > 1e-8 else 1.0
    real = cos_high * left_size - cos_low * right_size
    imaginary = sin_high * left_size - sin_low * right_size
    scale = 2 / (high - low)
    return imaginary * scale, -real * scale
