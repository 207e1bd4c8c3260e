"""Smooth functions of time (C2) that synthetic actors move by."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def smooth(u: Array) -> Array:
    """Minimum-jerk step from 0 (u <= 0) to 1 (u >= 1), at rest at both ends (Flash, Hogan 1985)."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10 - 15 * u + 6 * u**2)


def bump(u: Array) -> Array:
    """Curve from 0 (u <= 0) over 1 (u = 1/2) to 0 (u >= 1), with derivatives of 0 at the ends."""
    u = np.clip(u, 0.0, 1.0)
    return 64 * (u * (1 - u)) ** 3


def keyed(t: Array, times: ArrayLike, values: ArrayLike) -> Array:
    """Minimum-jerk moves (time, ...) between values (key, ...), at rest at each key and outside."""
    at, keys = np.asarray(times, dtype=np.float64), np.asarray(values, dtype=np.float64)
    moves = np.diff(keys, axis=0)
    reached = np.cumsum(np.concatenate([keys[:1], moves[:-1]]), axis=0)
    under_way = np.clip(np.searchsorted(at, t, side="right") - 1, 0, len(moves) - 1)
    fraction = smooth((t - at[under_way]) / np.diff(at)[under_way])
    return np.asarray(
        reached[under_way] + moves[under_way] * fraction.reshape(-1, *(1,) * (keys.ndim - 1))
    )


def hermite(
    t: Array, interval: tuple[float, float], begin: Sequence[ArrayLike], end: Sequence[ArrayLike]
) -> Array:
    """Quintic with given positions, velocities and accelerations at both ends of an interval.

    Each of them is a scalar or (3,).
    """
    span = interval[1] - interval[0]
    p0, v0, a0 = (np.asarray(value, dtype=np.float64) for value in begin)
    p1, v1, a1 = (np.asarray(value, dtype=np.float64) for value in end)
    u = ((t - interval[0]) / span).reshape(-1, *(1,) * p0.ndim)
    p, v, a = (
        p1 - p0 - (v0 + a0 * span / 2) * span,
        (v1 - v0 - a0 * span) * span,
        (a1 - a0) * span**2,
    )
    cubic, quartic, quintic = 10 * p - 4 * v + a / 2, -15 * p + 7 * v - a, 6 * p - 3 * v + a / 2
    free = p0 + v0 * span * u + a0 * span**2 / 2 * u**2
    return free + u**3 * (cubic + u * (quartic + u * quintic))


def state(function: Callable[[Array], Array], t: float) -> tuple[Array, Array, Array]:
    """Value, velocity and acceleration of ``function(times)`` at a time, by differences."""
    # Truncation, h^2/12 of the fourth derivative, and rounding, 1e-16/h^2, stay below 1e-5 m/s^2.
    h = 1e-4
    before, here, after = function(np.array([t - h, t, t + h]))
    return here, (after - before) / (2 * h), (after - 2 * here + before) / h**2
