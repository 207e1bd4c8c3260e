"""Cells of range-Doppler maps: the directions of what is in them, and what is expected there.

A line of antennas has beams, whose power has maxima. Echoes over a frame are expected on its map by
their ranges and fields cycle by cycle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import hermite_weights, phasor
from rtradar.kernels.jit import compiled


class Steering(NamedTuple):
    """Weights that bring the echo of a point into phase on all elements of a line, for every sine.

    ``weights (place, element, sine)`` are conjugate phases, times the weights of the elements; a
    place is a range bin. ``runs (run, 4)`` int64 say where each element is read: element, offset,
    first sine, sine after the last; the offset counts range bins from the first that any element
    is read in. The runs of one place follow those of the place before, from ``starts (place + 1,)``
    on.
    """

    weights: NDArray[np.complex64]
    runs: NDArray[np.int64]
    starts: NDArray[np.int64]


# Written by hand, because for products of this size the threads of BLAS wait longer than they work.
@compiled(fastmath=True)
def beam_power(begin, end, values, still, place, channels, steering, power):
    """Fill power (cell, sine) of the cells from begin to end.

    Values (cell, offset, channel) are multiplied by ``still (cell, channel)``, which takes out the
    motion between the transmitters of a cycle, and by the steering weights of the cell's place, run
    by run of sines that read an element at the same offset.
    """
    weights, runs, starts = steering
    n_sines = weights.shape[2]
    real, imaginary = np.empty(n_sines, dtype=np.float32), np.empty(n_sines, dtype=np.float32)
    for cell in range(begin, end):
        for sine in range(n_sines):
            real[sine], imaginary[sine] = 0.0, 0.0
        # Near the array the path over an element changes with the direction, and with it the range
        # bin that holds the echo: a run is a stretch of directions that read the same bin.
        for run in range(starts[place[cell]], starts[place[cell] + 1]):
            element, offset, first, last = runs[run, 0], runs[run, 1], runs[run, 2], runs[run, 3]
            channel = channels[element]
            value = values[cell, offset, channel] * still[cell, channel]
            # Slices counted from 0: an index that may be negative keeps the compiler from vectors.
            run_weights = weights[place[cell], element, first:last]
            run_real, run_imaginary = real[first:last], imaginary[first:last]
            for i in range(last - first):
                w = run_weights[i]
                run_real[i] += value.real * w.real - value.imag * w.imag
                run_imaginary[i] += value.real * w.imag + value.imag * w.real
        # Only the power of each beam is needed, so the complex sum is never stored.
        for sine in range(n_sines):
            power[cell, sine] = real[sine] ** 2 + imaginary[sine] ** 2


@compiled()
def highest_maxima(power, below, above, index, count):
    """Fill index (cell, peak) with the maxima of power (cell, sine), and count (cell,) of them.

    The strongest comes first, and fills the places that are left over. A maximum counts if it is at
    least ``below`` times the highest. Unless it is the highest, more than half of the spectrum must
    also be at least ``above`` times weaker.
    """
    sines, peaks = power.shape[1], index.shape[1]
    for cell in range(len(power)):
        own, best, found = power[cell], index[cell], 0
        # Both thresholds are relative to the highest value, whose place also fills the list up.
        top = 0
        for sine in range(1, sines):
            if own[sine] > own[top]:
                top = sine
        highest = own[top]
        best[:] = top
        # Of equal neighbours the first may count, where the spectrum falls after the last. At an
        # end of the grid one neighbour is enough.
        for sine in range(sines):
            value, after = own[sine], sine + 1
            rises = sine == 0 or value > own[sine - 1]
            if not (value > 0 and value >= highest * below and rises):
                continue
            while after < sines and own[after] == value:
                after += 1
            if after < sines and own[after] > value:
                continue
            # Any other maximum has to stand out of the median of the spectrum as well.
            if value < highest:
                lower = 0
                for other in range(sines):
                    lower += own[other] * above <= value
                if 2 * lower <= sines:
                    continue
            # Insert it among those found, the strongest first.
            place = found
            while place > 0 and value > own[best[place - 1]]:
                place -= 1
            if place < peaks:
                for later in range(peaks - 1, place, -1):
                    best[later] = best[later - 1]
                best[place] = sine
                found = min(found + 1, peaks)
        # Places that are left over repeat the strongest maximum.
        for none in range(found, peaks):
            best[none] = best[0]
        count[cell] = found


@compiled()
def add_interpolated(power, sines, first, step, bins, total):
    """Add power (cell, sine), read at sines (cell, angle) on its uniform grid, to (bin, angle)."""
    last = power.shape[1] - 2
    for cell in range(len(power)):
        for angle in range(sines.shape[1]):
            # Interpolate linearly; the last interval begins one place before the end of the grid.
            place = (sines[cell, angle] - first) / step
            left = min(max(math.floor(place), 0), last)
            part = place - left
            read = (1 - part) * power[cell, left] + part * power[cell, left + 1]
            total[bins[cell], angle] += read


Array = NDArray[np.float64]


class EchoesAtInstants(NamedTuple):
    """Echoes at some instants of a frame.

    ``at (instant,)`` are the numbers of their cycles and ``cycle_s`` the duration of a cycle [s].
    Ranges [m], range rates [m/s] and mean powers [m^2] are (instant, echo).
    """

    at: NDArray[np.int64]
    cycle_s: float
    range_m: Array
    rate_mps: Array
    power_m2: Array


@compiled(fastmath={"contract"})
def follow_echoes(start, stop, first, looks, turns_per_m, steps_per_m, steps, fields):
    """Fill ``steps`` int32 and ``fields`` complex64 (cycle, echo) from cycle ``first`` on.

    Between two instants the range is the cubic through the ranges and rates at both, and the power
    changes linearly. An echo that is not seen at one instant keeps its rate from the other. Steps
    are ranges times ``steps_per_m``; fields are square roots of powers, whose phase turns by
    ``turns_per_m`` with the range.
    """
    at, cycle_s, range_m, rate_mps, power_m2 = looks
    for row in range(start, stop):
        # The interval between instants that holds the cycle; the last instant ends the last
        # interval.
        interval = min(np.searchsorted(at, first + row, side="right"), len(at) - 1) - 1
        # Two instants on the same cycle must not divide by zero.
        apart = max(at[interval + 1] - at[interval], 1)
        t, apart_s = (first + row - at[interval]) / apart, apart * cycle_s
        w0, w1, s0, s1 = hermite_weights(t, apart_s)
        for echo in range(range_m.shape[1]):
            power, after = power_m2[interval, echo], power_m2[interval + 1, echo]
            r0, r1 = range_m[interval, echo], range_m[interval + 1, echo]
            v0, v1 = rate_mps[interval, echo], rate_mps[interval + 1, echo]
            # An echo has no range where it is not seen: from the other instant it goes on at
            # constant rate.
            gone, lost = power == 0, after == 0
            q0, u0 = (r1 - apart_s * v1, v1) if gone else (r0, v0)
            q1, u1 = (r0 + apart_s * v0, v0) if lost else (r1, v1)
            place = w0 * q0 + w1 * q1 + s0 * u0 + s1 * u1
            # The field has the phase of the range, and an amplitude whose square changes linearly.
            across, up = phasor(turns_per_m * place)
            size = np.sqrt((1 - t) * power + t * after)
            # The nearest step of the table that holds the response of a range bin.
            steps[row, echo] = np.int32(np.rint(steps_per_m * place))
            fields[row, echo] = complex(size * across, size * up)


@compiled()
def fields_in_bins(echo, away, steps, fields, spread, out):
    """Fill ``out (cycle, n)`` with the fields of some ``echo (n,)``, each in one bin.

    ``spread`` is the field that an echo of amplitude 1 leaves in a bin, by the number of steps
    between them: ``away (n,)`` less the step of the echo. Beyond both ends of it the field is 0.
    """
    for row in range(len(out)):
        for n in range(len(echo)):
            step = away[n] - steps[row, echo[n]]
            inside = 0 <= step < len(spread)
            out[row, n] = fields[row, echo[n]] * spread[step] if inside else 0
