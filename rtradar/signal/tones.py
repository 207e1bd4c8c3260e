"""Tones added up one by one: their powers side by side in vector lanes, phases in float64."""

from __future__ import annotations

import numpy as np
from numba import njit

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.phasor import phasor

LANES = 32
"""Samples that are made side by side."""

POWERS = 3
"""Powers of the sample number that one pass over a tone takes: all of an amplitude given at up to three frequencies."""


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract"})
def _powers(turn, real, imaginary):  # type: ignore[no-untyped-def]
    """Powers of ``turn`` from the 0th on; the one after the last is returned."""
    real[0], imaginary[0] = 1.0, 0.0
    known = 1
    while known < LANES:
        # Known powers times the one after them: as many again, side by side.
        low_re, low_im, next_re, next_im = real[:known], imaginary[:known], real[known : 2 * known], imaginary[known : 2 * known]
        for i in range(known):
            next_re[i] = low_re[i] * turn.real - low_im[i] * turn.imag
            next_im[i] = low_re[i] * turn.imag + low_im[i] * turn.real
        turn = turn * turn
        known *= 2
    return turn


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract"})
def _add_constant(real, imaginary, start, block_turn, now, out_re, out_im):  # type: ignore[no-untyped-def]
    """Add a tone to ``out``, block by block: the powers of its turn, times its value at the first sample of the block.

    That value goes on in float64; ``now (6,)`` takes it to the precision of all other arrays.
    """
    for block in range(len(out_re) // LANES):
        block_re, block_im = out_re[block * LANES : (block + 1) * LANES], out_im[block * LANES : (block + 1) * LANES]
        now[0], now[1] = start.real, start.imag
        re, im = now[0], now[1]
        for lane in range(LANES):
            block_re[lane] += re * real[lane] - im * imaginary[lane]
            block_im[lane] += re * imaginary[lane] + im * real[lane]
        start = start * block_turn


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract"})
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


@njit(cache=True, forceinline=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def add_tones(  # type: ignore[no-untyped-def]
    begin, end, length, amplitude, powers, start_frequency, slope, sample_rate, ramp, out
):
    """Fill ``out (chirp, rx, sample)`` from chirp ``begin`` to ``end``, in the precision of ``ramp``, which counts the lanes."""
    receivers, samples = out.shape[1:]
    nodes, echoes = amplitude.shape[0], length.shape[2]
    # The last block may reach past the last sample.
    padded = (samples + LANES - 1) // LANES * LANES
    real, imaginary, now = np.empty_like(ramp), np.empty_like(ramp), np.empty(6, dtype=ramp.dtype)
    exact_re, exact_im = np.empty(LANES), np.empty(LANES)
    sum_re, sum_im = np.empty(padded, dtype=ramp.dtype), np.empty(padded, dtype=ramp.dtype)
    start_re, start_im, turn_re, turn_im = np.empty(echoes), np.empty(echoes), np.empty(echoes), np.empty(echoes)
    heard, coefficient = np.empty(echoes, dtype=np.int64), np.empty(POWERS, dtype=np.complex128)
    delay = np.empty(echoes)
    for chirp in range(begin, end):
        for receiver in range(receivers):
            own = amplitude[:, chirp, receiver]
            count = _heard(length[chirp, receiver], own, slope / SPEED_OF_LIGHT_MPS, sample_rate, heard)
            for i in range(count):
                delay[i] = length[chirp, receiver, heard[i]] / SPEED_OF_LIGHT_MPS
            for i in range(count):
                beat = slope * delay[i]
                start_re[i], start_im[i] = phasor(start_frequency * delay[i] - 0.5 * beat * delay[i])
                turn_re[i], turn_im[i] = phasor(beat / sample_rate)
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
                    varies = False
                    for node in range(1, nodes):
                        varies |= own[node, echo] != own[0, echo]
                    if lowest > 0 and not varies:
                        continue
                    start = complex(start_re[i], start_im[i])
                    block_turn = _powers(complex(turn_re[i], turn_im[i]), exact_re, exact_im)
                    for lane in range(LANES):
                        real[lane], imaginary[lane] = exact_re[lane], exact_im[lane]
                    if not varies:
                        _add_constant(real, imaginary, start * own[0, echo], block_turn, now, sum_re, sum_im)
                        continue
                    coefficient[:] = 0
                    for power in range(lowest, min(lowest + POWERS, nodes)):
                        for node in range(nodes):
                            coefficient[power - lowest] += powers[power, node] * own[node, echo]
                    _add_parabola(
                        real,
                        imaginary,
                        ramp,
                        start,
                        block_turn,
                        1 / samples,
                        coefficient[0],
                        coefficient[1],
                        coefficient[2],
                        now,
                        sum_re,
                        sum_im,
                    )
            for sample in range(samples):
                out[chirp, receiver, sample] = complex(sum_re[sample], sum_im[sample])
