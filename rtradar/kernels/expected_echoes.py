"""Echoes over a frame, as they are expected on its map: their ranges and fields cycle by cycle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import hermite_weights, phasor
from rtradar.kernels.jit import compiled

Array = NDArray[np.float64]


class EchoesAtInstants(NamedTuple):
    """Echoes at the instants at which they are looked at.

    ``at (instant,)`` are cycles and ``cycle_s`` the duration of one [s]. Ranges [m], range rates
    [m/s] and mean powers [m^2] are (instant, echo).
    """

    at: NDArray[np.int64]
    cycle_s: float
    range_m: Array
    rate_mps: Array
    power_m2: Array


@compiled(fastmath={"contract"})
def follow_echoes(start, stop, first, looks, turns_per_m, steps_per_m, steps, fields):
    """Fill ``steps`` int32 and ``fields`` complex64 (cycle, echo) from cycle ``first`` on.

    Between instants a range is a cubic, by ranges and rates at both, and the power a line. Where an
    echo is not seen at one of them, it goes on as at the other. Steps are ranges times
    ``steps_per_m``; fields are roots of powers, turned by ``turns_per_m`` of the range.
    """
    at, cycle_s, range_m, rate_mps, power_m2 = looks
    for row in range(start, stop):
        interval = min(np.searchsorted(at, first + row, side="right"), len(at) - 1) - 1
        apart = max(at[interval + 1] - at[interval], 1)
        t, apart_s = (first + row - at[interval]) / apart, apart * cycle_s
        w0, w1, s0, s1 = hermite_weights(t, apart_s)
        for echo in range(range_m.shape[1]):
            power, after = power_m2[interval, echo], power_m2[interval + 1, echo]
            r0, r1 = range_m[interval, echo], range_m[interval + 1, echo]
            v0, v1 = rate_mps[interval, echo], rate_mps[interval + 1, echo]
            gone, lost = power == 0, after == 0
            q0, u0 = (r1 - apart_s * v1, v1) if gone else (r0, v0)
            q1, u1 = (r0 + apart_s * v0, v0) if lost else (r1, v1)
            place = w0 * q0 + w1 * q1 + s0 * u0 + s1 * u1
            across, up = phasor(turns_per_m * place)
            size = np.sqrt((1 - t) * power + t * after)
            steps[row, echo] = np.int32(np.rint(steps_per_m * place))
            fields[row, echo] = complex(size * across, size * up)


@compiled()
def fields_in_bins(echo, away, steps, fields, spread, out):
    """Fill ``out (cycle, n)`` with the fields of some ``echo (n,)`` in a bin each.

    ``spread`` is the field of an echo of 1 by the steps from it, which number ``away (n,)`` less
    its own; beyond both ends it is 0.
    """
    for row in range(len(out)):
        for n in range(len(echo)):
            step = away[n] - steps[row, echo[n]]
            inside = 0 <= step < len(spread)
            out[row, n] = fields[row, echo[n]] * spread[step] if inside else 0
