"""How much of a triangle lies on one side of an edge."""

from __future__ import annotations

from rtradar.kernels.jit import inlined


@inlined()
def positive_share(a, b, c):
    """Share of a triangle on which the linear function with these values at its corners is positive."""
    low, high = min(a, min(b, c)), max(a, max(b, c))
    if low >= 0:
        return 1.0
    if high <= 0:
        return 0.0
    # Quotients before products: squares of tiny numbers are 0.
    middle = a + b + c - low - high
    if middle <= 0:
        return high / (high - low) * (high / (high - middle))
    return 1 - low / (high - low) * (low / (middle - low))
