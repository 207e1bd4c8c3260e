"""The sum of few tones, one by one: samples side by side in vector lanes, phases in float64."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.elementary import COSINE, COSINE_32, SINE, SINE_32, horner, phasor
from rtradar.kernels.jit import compiled, inlined, on_cache_lines

LANES = 32
"""Samples that are computed side by side."""

_TOGETHER = 6
"""Tones added in one loop, so that sums are read and written a sixth as often."""

_NEXT = 2 * LANES
"""Distance from the lanes of one tone to those of the next."""

_GRID = 4096
"""Steps from sample to sample whose first powers are in a table, 1 / 4096 turn apart."""

_TERMS = 4
"""Terms of the series that turn these powers by the rest of a step, at most 0.024 rad in the last
lane: the next term is 0.024^8 / 8! = 3e-18."""


class Tones(NamedTuple):
    """Echoes of a block of chirps, and the sweep that makes tones of them.

    ``length (chirp, rx, echo)`` are path lengths [m]; echoes whose beat frequency lies outside [0,
    sample rate) add nothing. ``amplitude (node, chirp, rx, echo)`` are given at some frequencies
    [m]. ``weights (term, node)`` turn them into coefficients of polynomials in the place in the
    sweep, x = 2 (n - n_samples // 2) / n_samples: of its powers for `add_tones`, of Legendre's
    polynomials for `sum_by_nufft`. The sweep has a start frequency [Hz], a slope [Hz/s] and a
    sample rate [Hz].
    """

    length: NDArray[np.float64]
    amplitude: NDArray[np.complexfloating]
    weights: NDArray[np.floating]
    start_frequency: float
    slope: float
    sample_rate: float


class ToneTables(NamedTuple):
    """Tables in the precision of the sum.

    ``first (step, real or imaginary * lane)`` are the phasors after lane + 1/2 samples, for steps
    from 0 to 1 turn per sample. ``middles (lane,)`` are lane + 1/2. ``sines`` and ``cosines
    (term,)`` are the coefficients of the odd and the even powers of the angle.
    """

    first: NDArray[np.floating]
    middles: NDArray[np.floating]
    sines: tuple[Any, ...]
    cosines: tuple[Any, ...]


@lru_cache(maxsize=2)
def tone_tables(kind: type[np.floating]) -> ToneTables:
    """Tables in float32 or float64."""
    middles = np.arange(LANES) + 0.5
    turns = np.outer(np.arange(_GRID + 1) / _GRID, middles)
    first = np.hstack([np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)]).astype(kind)
    sines, cosines = (SINE_32, COSINE_32) if kind == np.float32 else (SINE, COSINE)
    return ToneTables(first, middles.astype(kind), sines[:_TERMS], cosines[:_TERMS])


@inlined(fastmath={"contract"})
def _lanes(row, rest, tables, out):
    """Powers of a tone side by side: those of the nearest step on the grid, rotated by the rest."""
    for lane in range(LANES):
        angle = rest * tables.middles[lane]
        x = angle * angle
        sine, cosine = angle * horner(x, tables.sines), horner(x, tables.cosines)
        out[lane] = row[lane] * cosine - row[lane + LANES] * sine
        out[lane + LANES] = row[lane] * sine + row[lane + LANES] * cosine


@inlined(fastmath={"contract"})
def _together(w, x, i):
    """Sum of `_TOGETHER` tones: weights times the values ``x`` of each at place ``i``."""
    first = w[0] * x[i] + w[1] * x[i + _NEXT] + w[2] * x[i + 2 * _NEXT]
    return first + w[3] * x[i + 3 * _NEXT] + w[4] * x[i + 4 * _NEXT] + w[5] * x[i + 5 * _NEXT]


@inlined(fastmath={"contract"})
def _add_constants(pairs, weighted, lanes, sums, total):
    """Add tones of constant amplitude to the total, two blocks of lanes at a time.

    The sums ``total (sample,)`` and the values of the tones in the middle of each pair of blocks,
    ``weighted (pair * tone,)``, are given as real and imaginary parts. A power as far before the
    middle as another is after it is the conjugate of that, so the ``sums`` of the products of real
    and imaginary parts serve both. All sums are one array and the lanes another, because each loop
    first checks whether its arrays overlap.
    """
    tones = len(weighted[0]) // pairs
    for pair in range(pairs):
        # Tones in groups, each with its powers about a middle side by side in the lanes: the
        # products of real and imaginary parts are added up apart.
        sums[:] = 0.0
        for tone in range(0, tones, _TOGETHER):
            at = pair * tones + tone
            re, im = weighted[0][at : at + _TOGETHER], weighted[1][at : at + _TOGETHER]
            real = re[0], re[1], re[2], re[3], re[4], re[5]
            imaginary = im[0], im[1], im[2], im[3], im[4], im[5]
            some = lanes[tone * _NEXT : (tone + _TOGETHER) * _NEXT]
            for i in range(LANES):
                sums[i] += _together(real, some, i)
                sums[i + LANES] += _together(imaginary, some, i)
                sums[i + 2 * LANES] += _together(real, some, i + LANES)
                sums[i + 3 * LANES] += _together(imaginary, some, i + LANES)
        # Slices, because the compiler must see that indices are not negative to use vectors.
        early, late, end = 2 * pair * LANES, (2 * pair + 1) * LANES, 2 * (pair + 1) * LANES
        early_re, early_im = total[0][early:late], total[1][early:late]
        late_re, late_im = total[0][late:end], total[1][late:end]
        # After the middle the power itself is taken; before it the conjugate, in reverse order.
        for i in range(LANES):
            late_re[i] += sums[i] - sums[i + 3 * LANES]
            late_im[i] += sums[i + LANES] + sums[i + 2 * LANES]
        for i in range(LANES):
            early_re[i] += sums[LANES - 1 - i] + sums[4 * LANES - 1 - i]
            early_im[i] += sums[2 * LANES - 1 - i] - sums[3 * LANES - 1 - i]


@inlined()
def _weigh(power, powers, first, change, weight, now):
    """Fill ``now``, the coefficients of a power of the sample number; return if any is not 0.

    ``first (real and imaginary * tone,)`` are amplitudes at the first node, ``change (node, real
    and imaginary * tone)`` are how much more they are at the others, and ``weight`` is room for
    sums. The weights of all powers but the first add up to 0 over the nodes, so constant amplitudes
    have no part in them.
    """
    # The first node carries the constant; each other node adds what it differs by.
    for i in range(len(first)):
        weight[i] = first[i] if power == 0 else 0.0
    for node in range(1, powers.shape[1]):
        own = change[node - 1]
        for i in range(len(first)):
            weight[i] += powers[power, node] * own[i]
    any_there = False
    for i in range(len(first)):
        now[i] = weight[i]
        any_there |= weight[i] != 0
    return any_there


@inlined(fastmath={"contract"})
def _take(tones, chirp, receiver, received, start, step, first, change):
    """Fill in what `_weigh` reads about the visible tones in the band, and count these.

    ``start`` and ``step (tone,)`` are turns at the first sample and per sample.
    """
    length, amplitude = tones.length[chirp, receiver], tones.amplitude[:, chirp, receiver]
    size, count = len(start), 0
    # The tones that the low-pass filter lets through, and that are not silent at all nodes.
    for echo in range(len(length)):
        beat = tones.slope / SPEED_OF_LIGHT_MPS * length[echo]
        if beat >= 0 and beat < tones.sample_rate:
            for node in range(amplitude.shape[0]):
                if amplitude[node, echo] != 0:
                    received[count] = echo
                    count += 1
                    break
    # Tones beyond the last one, up to a whole group, have no amplitude.
    first[:] = 0.0
    change[:] = 0.0
    # The phase of the tone at the first sample and its step; amplitudes as that of the first node
    # and changes from there.
    for i in range(count):
        delay = length[received[i]] / SPEED_OF_LIGHT_MPS
        start[i] = delay * (tones.start_frequency - 0.5 * tones.slope * delay)
        step[i] = tones.slope * delay / tones.sample_rate
        here = amplitude[0, received[i]]
        first[i], first[size + i] = here.real, here.imag
        for node in range(1, amplitude.shape[0]):
            there = amplitude[node, received[i]] - here
            change[node - 1, i], change[node - 1, size + i] = there.real, there.imag
    return count


@compiled(fastmath={"contract"})
def add_tones(begin, end, tones, tables, out):
    """Fill ``out (chirp, rx, sample)`` from chirp ``begin`` to ``end``, with the tables' digits."""
    receivers, samples = out.shape[1:]
    nodes, echoes = tones.amplitude.shape[0], tones.length.shape[2]
    # The last pair of blocks may go beyond the last sample. The last group of tones that are added
    # together may go beyond the last tone; those beyond it are silent.
    pairs = (samples + 2 * LANES - 1) // (2 * LANES)
    size = (echoes + _TOGETHER - 1) // _TOGETHER * _TOGETHER
    like = tables.middles
    start, step = np.zeros(size), np.zeros(size)
    first, weight = np.empty(2 * size), np.empty(2 * size)
    change, now = np.empty((nodes - 1, 2 * size)), np.empty(2 * size, dtype=like.dtype)
    lanes, sums = on_cache_lines(size * _NEXT, like), on_cache_lines(2 * _NEXT, like)
    # Real and imaginary parts of tones in each middle, their products with amplitudes, and the sum.
    middle_re, middle_im = np.empty(pairs * size, like.dtype), np.empty(pairs * size, like.dtype)
    weighted = np.empty_like(middle_re), np.empty_like(middle_re)
    total = np.empty(2 * pairs * LANES, like.dtype), np.empty(2 * pairs * LANES, like.dtype)
    sum_re, sum_im = total
    received = np.empty(echoes, np.int64)
    fraction = np.empty(samples, dtype=like.dtype)
    # The place in the sweep, of whose powers the weights give the coefficients.
    for sample in range(samples):
        fraction[sample] = 2 * (sample - samples // 2) / samples
    # Whatever a chirp does not fill is left over from the one before, and silent.
    lanes[:] = 0.0
    for chirp in range(begin, end):
        for receiver in range(receivers):
            count = _take(tones, chirp, receiver, received, start, step, first, change)
            # Powers of each tone about a middle, and its phasor in each middle.
            for i in range(count):
                row = int(step[i] * _GRID + 0.5)
                rest = like.dtype.type((step[i] - row / _GRID) * (2 * math.pi))
                _lanes(tables.first[row], rest, tables, lanes[i * _NEXT : (i + 1) * _NEXT])
            for pair in range(pairs):
                middle = (2 * pair + 1) * LANES - 0.5
                re = middle_re[pair * size : (pair + 1) * size]
                im = middle_im[pair * size : (pair + 1) * size]
                for i in range(size):
                    re[i], im[i] = phasor(start[i] + step[i] * middle)
            sum_re[:] = 0.0
            sum_im[:] = 0.0
            # Horner's scheme over powers of the sample number: for each a sum of constant tones.
            for power in range(nodes - 1, -1, -1):
                for sample in range(samples if power < nodes - 1 else 0):
                    sum_re[sample] *= fraction[sample]
                    sum_im[sample] *= fraction[sample]
                # Constant tones have no part in the higher powers, which are then left out.
                if not _weigh(power, tones.weights, first, change, weight, now):
                    continue
                now_re, now_im = now[:size], now[size:]
                for pair in range(pairs):
                    own = slice(pair * size, (pair + 1) * size)
                    re, im = middle_re[own], middle_im[own]
                    own_re, own_im = weighted[0][own], weighted[1][own]
                    for i in range(size):
                        own_re[i] = re[i] * now_re[i] - im[i] * now_im[i]
                        own_im[i] = re[i] * now_im[i] + im[i] * now_re[i]
                _add_constants(pairs, weighted, lanes, sums, total)
            samples_there = out[chirp, receiver]
            for sample in range(samples):
                samples_there[sample] = complex(sum_re[sample], sum_im[sample])
