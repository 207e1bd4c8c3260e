"""Tones added up one by one: their powers side by side in vector lanes, phases in float64."""

from __future__ import annotations

import numpy as np

from rtradar.compiled import compiled, taken_in
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.phasor import phasor

LANES = 32
"""Samples that are made side by side."""

_SQUARES = 8
"""Powers 1/2, 1, 2, 4, ... of a turn, up to that which goes on by two blocks."""

_TOGETHER = 4
"""Tones added up at once, so that sums are read and written a quarter as often."""

POWERS = 3
"""Powers of the sample number that one pass over a tone takes: all of an amplitude given at up to three frequencies."""


@taken_in(fastmath={"contract"})
def _multiply(a_re, a_im, b_re, b_im, out_re, out_im):  # type: ignore[no-untyped-def]
    """Products of complex numbers side by side; ``out`` may be one of the factors."""
    for i in range(len(a_re)):
        re = a_re[i] * b_re[i] - a_im[i] * b_im[i]
        im = a_re[i] * b_im[i] + a_im[i] * b_re[i]
        out_re[i], out_im[i] = re, im


@taken_in(fastmath={"contract"})
def _double(lanes, known, re, im):  # type: ignore[no-untyped-def]
    """As many powers again: those known times the one that is as many sample numbers on."""
    for i in range(known):
        lanes[known + i] = re * lanes[i] - im * lanes[LANES + i]
        lanes[LANES + known + i] = re * lanes[LANES + i] + im * lanes[i]


@taken_in(fastmath={"contract"})
def _powers(squares_re, squares_im, lanes):  # type: ignore[no-untyped-def]
    """Fill ``lanes (tone * 2 * LANES,)``: powers 1/2, 3/2, ... of each tone's turn, real parts first.

    ``squares (square, tone)`` are its powers 1/2, 1, 2, 4, ...
    """
    for tone in range(squares_re.shape[1]):
        own = lanes[tone * 2 * LANES : (tone + 1) * 2 * LANES]
        own[0], own[LANES] = squares_re[0, tone], squares_im[0, tone]
        _double(own, 1, squares_re[1, tone], squares_im[1, tone])
        _double(own, 2, squares_re[2, tone], squares_im[2, tone])
        _double(own, 4, squares_re[3, tone], squares_im[3, tone])
        _double(own, 8, squares_re[4, tone], squares_im[4, tone])
        _double(own, 16, squares_re[5, tone], squares_im[5, tone])


@taken_in(fastmath={"contract"})
def _add_constants(lanes, middle_re, middle_im, rr, ii, ri, ir, out_re, out_im):  # type: ignore[no-untyped-def]
    """Add tones to ``out``, two blocks at a time, of which ``middle (pair, tone)`` are the values in their middle.

    As far before it as after it a power is the conjugate: products of real and imaginary parts serve both.
    """
    for pair in range(len(middle_re)):
        rr[:] = 0.0
        ii[:] = 0.0
        ri[:] = 0.0
        ir[:] = 0.0
        for tone in range(0, middle_re.shape[1], _TOGETHER):
            a, b, c, d = middle_re[pair, tone], middle_re[pair, tone + 1], middle_re[pair, tone + 2], middle_re[pair, tone + 3]
            p, q, r, s = middle_im[pair, tone], middle_im[pair, tone + 1], middle_im[pair, tone + 2], middle_im[pair, tone + 3]
            four = lanes[tone * 2 * LANES : (tone + 4) * 2 * LANES]
            for i in range(LANES):
                rr[i] += a * four[i] + b * four[i + 2 * LANES] + c * four[i + 4 * LANES] + d * four[i + 6 * LANES]
                ir[i] += p * four[i] + q * four[i + 2 * LANES] + r * four[i + 4 * LANES] + s * four[i + 6 * LANES]
            for i in range(LANES):
                ri[i] += a * four[i + LANES] + b * four[i + 3 * LANES] + c * four[i + 5 * LANES] + d * four[i + 7 * LANES]
                ii[i] += p * four[i + LANES] + q * four[i + 3 * LANES] + r * four[i + 5 * LANES] + s * four[i + 7 * LANES]
        early, late = 2 * pair * LANES, (2 * pair + 1) * LANES
        for i in range(LANES):
            out_re[late + i] += rr[i] - ii[i]
            out_im[late + i] += ir[i] + ri[i]
        for i in range(LANES):
            out_re[early + i] += rr[LANES - 1 - i] + ii[LANES - 1 - i]
            out_im[early + i] += ir[LANES - 1 - i] - ri[LANES - 1 - i]


@taken_in(fastmath={"contract"})
def _add_parabola(real, imaginary, ramp, start, block_turn, step, c0, c1, c2, now, out_re, out_im):  # type: ignore[no-untyped-def]
    """Add a tone whose amplitude is c0 + c1 x + c2 x^2, x the sample number times ``step``; ``ramp`` counts the lanes."""
    for block in range(len(out_re) // LANES):
        block_re, block_im = out_re[block * LANES : (block + 1) * LANES], out_im[block * LANES : (block + 1) * LANES]
        first = block * LANES * step
        # The parabola about the first sample of the block.
        d0, d1, d2 = start * (c0 + first * (c1 + first * c2)), start * (c1 + 2 * first * c2) * step, start * c2 * step * step
        now[0], now[1], now[2], now[3], now[4], now[5] = d0.real, d0.imag, d1.real, d1.imag, d2.real, d2.imag
        re0, im0, re1, im1, re2, im2 = now[0], now[1], now[2], now[3], now[4], now[5]
        for lane in range(LANES):
            re = re0 + ramp[lane] * (re1 + ramp[lane] * re2)
            im = im0 + ramp[lane] * (im1 + ramp[lane] * im2)
            block_re[lane] += re * real[lane] - im * imaginary[lane]
            block_im[lane] += re * imaginary[lane] + im * real[lane]
        start = start * block_turn


@taken_in()
def _heard(length, amplitude, beat_per_metre, sample_rate, heard):  # type: ignore[no-untyped-def]
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
def add_tones(  # type: ignore[no-untyped-def]
    begin, end, length, amplitude, powers, start_frequency, slope, sample_rate, ramp, out
):
    """Fill ``out (chirp, rx, sample)`` from chirp ``begin`` to ``end``, in the precision of ``ramp``, which counts the lanes."""
    receivers, samples = out.shape[1:]
    nodes, echoes = amplitude.shape[0], length.shape[2]
    # The last pair of blocks may reach past the last sample, the last tones added together past the last tone: these are silent.
    pairs, tones = (samples + 2 * LANES - 1) // (2 * LANES), (echoes + _TOGETHER - 1) // _TOGETHER * _TOGETHER
    sum_re, sum_im = np.empty(pairs * 2 * LANES, dtype=ramp.dtype), np.empty(pairs * 2 * LANES, dtype=ramp.dtype)
    lanes, now = np.empty(tones * 2 * LANES, dtype=ramp.dtype), np.empty(6, dtype=ramp.dtype)
    rr, ii, ri, ir = np.empty_like(ramp), np.empty_like(ramp), np.empty_like(ramp), np.empty_like(ramp)
    start_re, start_im, now_re, now_im = np.empty(tones), np.empty(tones), np.empty(tones), np.empty(tones)
    squares_re, squares_im = np.empty((_SQUARES, tones)), np.empty((_SQUARES, tones))
    middle_re, middle_im = np.empty((pairs, tones), dtype=ramp.dtype), np.empty((pairs, tones), dtype=ramp.dtype)
    varies, heard, coefficient = np.empty(tones, np.bool_), np.empty(echoes, np.int64), np.empty(POWERS, np.complex128)
    # What is not filled for a chirp is of the one before, and silent.
    squares_re[:], squares_im[:], varies[:] = 0.0, 0.0, False
    delay = np.empty(echoes)
    for chirp in range(begin, end):
        for receiver in range(receivers):
            own = amplitude[:, chirp, receiver]
            count = _heard(length[chirp, receiver], own, slope / SPEED_OF_LIGHT_MPS, sample_rate, heard)
            for i in range(count):
                delay[i] = length[chirp, receiver, heard[i]] / SPEED_OF_LIGHT_MPS
            for i in range(count):
                beat = slope * delay[i]
                # Half a sample before the first, as far as the first power is behind.
                start_re[i], start_im[i] = phasor(start_frequency * delay[i] - 0.5 * beat * (delay[i] + 1 / sample_rate))
                squares_re[0, i], squares_im[0, i] = phasor(0.5 * beat / sample_rate)
            for square in range(1, _SQUARES):
                _multiply(
                    squares_re[square - 1],
                    squares_im[square - 1],
                    squares_re[square - 1],
                    squares_im[square - 1],
                    squares_re[square],
                    squares_im[square],
                )
            _powers(squares_re, squares_im, lanes)
            sum_re[:] = 0.0
            sum_im[:] = 0.0
            # Horner's scheme over threes of powers of the sample number.
            for lowest in range((nodes - 1) // POWERS * POWERS, -1, -POWERS):
                if lowest + POWERS < nodes:
                    for sample in range(samples):
                        cube = (sample / samples) ** 3
                        sum_re[sample] *= cube
                        sum_im[sample] *= cube
                for i in range(count):
                    echo = heard[i]
                    varies[i] = False
                    for node in range(1, nodes):
                        varies[i] |= own[node, echo] != own[0, echo]
                    if not varies[i]:
                        continue
                    coefficient[:] = 0
                    for power in range(lowest, min(lowest + POWERS, nodes)):
                        for node in range(nodes):
                            coefficient[power - lowest] += powers[power, node] * own[node, echo]
                    _add_parabola(
                        lanes[2 * i * LANES : (2 * i + 1) * LANES],
                        lanes[(2 * i + 1) * LANES : (2 * i + 2) * LANES],
                        ramp,
                        complex(start_re[i], start_im[i]),
                        complex(squares_re[_SQUARES - 2, i], squares_im[_SQUARES - 2, i]),
                        1 / samples,
                        coefficient[0],
                        coefficient[1],
                        coefficient[2],
                        now,
                        sum_re,
                        sum_im,
                    )
            for i in range(tones):
                now_re[i], now_im[i] = 0.0, 0.0
                if i < count and not varies[i]:
                    start = complex(start_re[i], start_im[i]) * own[0, heard[i]]
                    now_re[i], now_im[i] = start.real, start.imag
            _multiply(now_re, now_im, squares_re[_SQUARES - 2], squares_im[_SQUARES - 2], now_re, now_im)
            for pair in range(pairs):
                for i in range(tones):
                    middle_re[pair, i], middle_im[pair, i] = now_re[i], now_im[i]
                _multiply(now_re, now_im, squares_re[_SQUARES - 1], squares_im[_SQUARES - 1], now_re, now_im)
            _add_constants(lanes, middle_re, middle_im, rr, ii, ri, ir, sum_re, sum_im)
            for sample in range(samples):
                out[chirp, receiver, sample] = complex(sum_re[sample], sum_im[sample])
