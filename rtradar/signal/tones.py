"""Tones added up one by one: samples side by side in vector lanes, phases in float64."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.jit import compiled, inlined, on_cache_lines

LANES = 32
"""Samples that are made side by side."""

_TOGETHER = 6
"""Tones added up at once, so that sums are read and written a sixth as often."""

_NEXT = 2 * LANES
"""From the lanes of one tone to those of the next."""

_TERMS = 8
"""Of the series of sine and cosine, for up to an eighth of a turn: the next are (pi / 4)^16 / 16! = 1e-15 at most."""

MIDDLE = 0.5
"""Share of the sweep about which powers of the sample number are taken, where they cancel least."""

_GRID = 4096
"""Steps from sample to sample of which the first powers are kept in a table, 1 / 4096 turn apart."""


@lru_cache(maxsize=2)
def series(kind: type[np.floating]) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Coefficients of sine and cosine, over the odd and the even powers of the angle, in the precision they are to be used in."""
    signed = [(-1) ** n for n in range(_TERMS)]
    return (
        tuple(kind(sign / math.factorial(2 * n + 1)) for n, sign in enumerate(signed)),
        tuple(kind(sign / math.factorial(2 * n)) for n, sign in enumerate(signed)),
    )


@lru_cache(maxsize=2)
def first_powers(kind: type[np.floating]) -> NDArray[np.floating]:
    """Phasors (step on the grid, real or imaginary, lane) of lane + 1/2 samples, for steps from 0 to 1 turn a sample."""
    turns = np.outer(np.arange(_GRID + 1) / _GRID, np.arange(LANES) + 0.5)
    table = np.hstack([np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)]).astype(kind)
    table.flags.writeable = False
    return table


# Compared in float32, so that float32 stays what it is.
_HALF, _ONE, _TWO, _THREE = np.float32(0.5), np.float32(1), np.float32(2), np.float32(3)


@inlined(fastmath={"contract"})
def _reduce(turns, angle, quadrant, place):
    """Whole quarters taken out in float64, of which the quadrant is told; the rest is an angle of up to an eighth of a turn."""
    quarters = np.floor(4 * turns + 0.5)
    angle[place] = (turns - 0.25 * quarters) * (2 * math.pi)
    quadrant[place] = quarters - 4 * np.floor(0.25 * quarters)


@inlined(fastmath={"contract"})
def _phasors(count, angle, quadrant, sines, cosines, re, im):
    """exp(j angle) of what `_reduce` left, side by side, in the precision of the arrays."""
    for i in range(count):
        x = angle[i] * angle[i]
        sine = sines[3] + x * (sines[4] + x * (sines[5] + x * (sines[6] + x * sines[7])))
        sine = angle[i] * (sines[0] + x * (sines[1] + x * (sines[2] + x * sine)))
        cosine = cosines[3] + x * (
            cosines[4] + x * (cosines[5] + x * (cosines[6] + x * cosines[7]))
        )
        cosine = cosines[0] + x * (cosines[1] + x * (cosines[2] + x * cosine))
        odd = quadrant[i] == _ONE or quadrant[i] == _THREE
        across, up = (sine, cosine) if odd else (cosine, sine)
        re[i] = -across if quadrant[i] == _ONE or quadrant[i] == _TWO else across
        im[i] = -up if quadrant[i] >= _TWO else up


@inlined(fastmath={"contract"})
def _lanes(row, rest, ramp, sines, cosines, out):
    """Powers of a tone side by side: those of the next step on the grid, turned by the rest [rad a sample] times each.

    That is up to 0.024 rad in the last lane: of either series the next terms are 0.024^8 / 8! = 3e-18 at most.
    """
    for lane in range(LANES):
        angle = rest * ramp[lane]
        x = angle * angle
        sine = angle * (sines[0] + x * (sines[1] + x * (sines[2] + x * sines[3])))
        cosine = cosines[0] + x * (cosines[1] + x * (cosines[2] + x * cosines[3]))
        out[lane] = row[lane] * cosine - row[lane + LANES] * sine
        out[lane + LANES] = row[lane] * sine + row[lane + LANES] * cosine


@inlined(fastmath={"contract"})
def _together(w, x, i):
    """The sum over `_TOGETHER` tones of their weights times what ``x`` has of each at a place ``i`` of its lanes."""
    first = w[0] * x[i] + w[1] * x[i + _NEXT] + w[2] * x[i + 2 * _NEXT]
    return first + w[3] * x[i + 3 * _NEXT] + w[4] * x[i + 4 * _NEXT] + w[5] * x[i + 5 * _NEXT]


@inlined(fastmath={"contract"})
def _add_constants(pairs, lanes, middle_re, middle_im, sums, out_re, out_im):
    """Add tones to ``out``, two blocks at a time, of which ``middle (pair * tone,)`` are the values in their middle.

    ``lanes (tone * (real, imaginary) * lane,)``. As far before the middle as after it a power is the conjugate: ``sums`` of the
    products of real and imaginary parts serve both. All of them are one array, and the lanes another, for before each loop it is
    asked whether arrays overlap.
    """
    tones = len(middle_re) // pairs
    for pair in range(pairs):
        sums[:] = 0.0
        for tone in range(0, tones, _TOGETHER):
            at = pair * tones + tone
            re, im = middle_re[at : at + _TOGETHER], middle_im[at : at + _TOGETHER]
            real, imaginary = (
                (re[0], re[1], re[2], re[3], re[4], re[5]),
                (im[0], im[1], im[2], im[3], im[4], im[5]),
            )
            some = lanes[tone * _NEXT : (tone + _TOGETHER) * _NEXT]
            for i in range(LANES):
                sums[i] += _together(real, some, i)
                sums[i + LANES] += _together(imaginary, some, i)
                sums[i + 2 * LANES] += _together(real, some, i + LANES)
                sums[i + 3 * LANES] += _together(imaginary, some, i + LANES)
        # Slices, for what is counted from their beginning is surely not counted from an end: lanes would be taken one by one.
        early, late, end = 2 * pair * LANES, (2 * pair + 1) * LANES, 2 * (pair + 1) * LANES
        early_re, early_im, late_re, late_im = (
            out_re[early:late],
            out_im[early:late],
            out_re[late:end],
            out_im[late:end],
        )
        for i in range(LANES):
            late_re[i] += sums[i] - sums[i + 3 * LANES]
            late_im[i] += sums[i + LANES] + sums[i + 2 * LANES]
        for i in range(LANES):
            early_re[i] += sums[LANES - 1 - i] + sums[4 * LANES - 1 - i]
            early_im[i] += sums[2 * LANES - 1 - i] - sums[3 * LANES - 1 - i]


@inlined()
def _weigh(
    power, powers, first_re, first_im, change_re, change_im, weight_re, weight_im, now_re, now_im
):
    """Coefficients ``now (tone,)`` of a power of the sample number, and whether any is other than 0.

    ``change (node * tone,)`` is what amplitudes at the other frequencies are more than those at the ``first``: 0 where they are
    constant, and so are then the coefficients of all powers but the first, whose weights add up to 0 over the nodes.
    """
    tones = len(first_re)
    for i in range(tones):
        weight_re[i], weight_im[i] = (first_re[i], first_im[i]) if power == 0 else (0.0, 0.0)
    for node in range(1, powers.shape[1]):
        share = powers[power, node]
        own_re, own_im = (
            change_re[(node - 1) * tones : node * tones],
            change_im[(node - 1) * tones : node * tones],
        )
        for i in range(tones):
            weight_re[i] += share * own_re[i]
            weight_im[i] += share * own_im[i]
    any_there = False
    for i in range(tones):
        now_re[i], now_im[i] = weight_re[i], weight_im[i]
        any_there |= weight_re[i] != 0 or weight_im[i] != 0
    return any_there


@inlined()
def _heard(length, amplitude, beat_per_metre, sample_rate, heard):
    """Which echoes (echo,) are in the band and not hidden; ``amplitude (node, echo)``. Their count."""
    count = 0
    for echo in range(len(length)):
        beat = beat_per_metre * length[echo]
        if beat >= 0 and beat < sample_rate:
            for node in range(amplitude.shape[0]):
                if amplitude[node, echo] != 0:
                    heard[count] = echo
                    count += 1
                    break
    return count


@compiled(fastmath={"contract"})
def add_tones(
    begin,
    end,
    length,
    amplitude,
    powers,
    start_frequency,
    slope,
    sample_rate,
    table,
    ramp,
    sines,
    cosines,
    out,
):
    """Fill ``out (chirp, rx, sample)`` from chirp ``begin`` to ``end``, in the precision of ``ramp``, which counts the lanes.

    ``sines`` and ``cosines`` are those of `series`, ``table`` that of `first_powers`, in this precision.
    """
    receivers, samples = out.shape[1:]
    nodes, echoes = amplitude.shape[0], length.shape[2]
    # The last pair of blocks may reach past the last sample, the last tones added together past the last tone: these are silent.
    pairs, tones = (
        (samples + 2 * LANES - 1) // (2 * LANES),
        (echoes + _TOGETHER - 1) // _TOGETHER * _TOGETHER,
    )
    sum_re, sum_im = (
        np.empty(pairs * 2 * LANES, dtype=ramp.dtype),
        np.empty(pairs * 2 * LANES, dtype=ramp.dtype),
    )
    lanes, sums = on_cache_lines(tones * _NEXT, ramp), on_cache_lines(2 * _NEXT, ramp)
    middle_re, middle_im = (
        np.empty(pairs * tones, dtype=ramp.dtype),
        np.empty(pairs * tones, dtype=ramp.dtype),
    )
    angle, quadrant = (
        np.empty(pairs * tones, dtype=ramp.dtype),
        np.empty(pairs * tones, dtype=ramp.dtype),
    )
    first_re, first_im, weight_re, weight_im = (
        np.zeros(tones),
        np.zeros(tones),
        np.empty(tones),
        np.empty(tones),
    )
    now_re, now_im = np.empty(tones, dtype=ramp.dtype), np.empty(tones, dtype=ramp.dtype)
    change_re, change_im = np.zeros((nodes - 1) * tones), np.zeros((nodes - 1) * tones)
    weighed_re, weighed_im = (
        np.empty(pairs * tones, dtype=ramp.dtype),
        np.empty(pairs * tones, dtype=ramp.dtype),
    )
    rest, middles, share = (
        np.empty(tones, dtype=ramp.dtype),
        ramp + _HALF,
        np.empty(samples, dtype=ramp.dtype),
    )
    start, step, heard = np.empty(tones), np.empty(tones), np.empty(echoes, np.int64)
    for sample in range(samples):
        share[sample] = sample / samples - MIDDLE
    # What is not filled for a chirp is of the one before, and silent.
    lanes[:], start[:], step[:] = 0.0, 0.0, 0.0
    for chirp in range(begin, end):
        for receiver in range(receivers):
            own = amplitude[:, chirp, receiver]
            count = _heard(
                length[chirp, receiver], own, slope / SPEED_OF_LIGHT_MPS, sample_rate, heard
            )
            for i in range(count):
                delay = length[chirp, receiver, heard[i]] / SPEED_OF_LIGHT_MPS
                # Turns at the first sample, and from one to the next.
                start[i], step[i] = (
                    delay * (start_frequency - 0.5 * slope * delay),
                    slope * delay / sample_rate,
                )
            for i in range(tones):
                here = own[0, heard[i]] if i < count else 0j
                first_re[i], first_im[i] = here.real, here.imag
                for node in range(1, nodes):
                    there = own[node, heard[i]] - here if i < count else 0j
                    change_re[(node - 1) * tones + i], change_im[(node - 1) * tones + i] = (
                        there.real,
                        there.imag,
                    )
            for i in range(count):
                row = int(step[i] * _GRID + 0.5)
                rest[i] = (step[i] - row / _GRID) * (2 * math.pi)
                _lanes(
                    table[row], rest[i], middles, sines, cosines, lanes[i * _NEXT : (i + 1) * _NEXT]
                )
            for pair in range(pairs):
                for i in range(tones):
                    _reduce(
                        start[i] + step[i] * ((2 * pair + 1) * LANES - 0.5),
                        angle,
                        quadrant,
                        pair * tones + i,
                    )
            _phasors(pairs * tones, angle, quadrant, sines, cosines, middle_re, middle_im)
            sum_re[:] = 0.0
            sum_im[:] = 0.0
            # Horner's scheme over powers of the sample number from the middle: for each a sum of tones that do not change.
            for power in range(nodes - 1, -1, -1):
                for sample in range(samples if power < nodes - 1 else 0):
                    sum_re[sample] *= share[sample]
                    sum_im[sample] *= share[sample]
                if not _weigh(
                    power,
                    powers,
                    first_re,
                    first_im,
                    change_re,
                    change_im,
                    weight_re,
                    weight_im,
                    now_re,
                    now_im,
                ):
                    continue
                for pair in range(pairs):
                    for i in range(tones):
                        re, im = middle_re[pair * tones + i], middle_im[pair * tones + i]
                        weighed_re[pair * tones + i] = re * now_re[i] - im * now_im[i]
                        weighed_im[pair * tones + i] = re * now_im[i] + im * now_re[i]
                _add_constants(pairs, lanes, weighed_re, weighed_im, sums, sum_re, sum_im)
            heard_there = out[chirp, receiver]
            for sample in range(samples):
                heard_there[sample] = complex(sum_re[sample], sum_im[sample])
