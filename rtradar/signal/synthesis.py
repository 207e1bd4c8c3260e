"""IF samples of a block of chirps: every echo a tone, added up (paper, eqs 7 to 12)."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, DTypeLike, NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.errors import ValidityWarning
from rtradar.phasor import phasor
from rtradar.radar import Radar
from rtradar.signal.spreading import MOST_NODES, spread_sum
from rtradar.threads import in_threads

MAX_BINS_IN_CHIRP = 0.1
"""A length belongs to the centre of its chirp; where it changes by more range bins inside one, that is no longer true."""

MANY_ECHOES = 32
"""From so many on, tones are spread over a grid for one FFT if float32 will do (`validation/if_sum.py` has what it saves)."""

_LANES = 32
_CHIRPS_A_THREAD = 16
"""Handed out at once: half a millisecond or more of work."""

_INSTANTS = 16
"""At so many instants of a block the speed of echoes is looked at."""

_POWERS = 3
"""Powers of the sample number that one pass over a tone takes: all of an amplitude given at up to three frequencies."""


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract"})
def _powers(turn, real, imaginary):  # type: ignore[no-untyped-def]
    """Powers of ``turn`` from the 0th on; the one after the last is returned."""
    real[0], imaginary[0] = 1.0, 0.0
    known = 1
    while known < _LANES:
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
    for block in range(len(out_re) // _LANES):
        block_re, block_im = out_re[block * _LANES : (block + 1) * _LANES], out_im[block * _LANES : (block + 1) * _LANES]
        now[0], now[1] = start.real, start.imag
        re, im = now[0], now[1]
        for lane in range(_LANES):
            block_re[lane] += re * real[lane] - im * imaginary[lane]
            block_im[lane] += re * imaginary[lane] + im * real[lane]
        start = start * block_turn


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"contract"})
def _add_parabola(real, imaginary, ramp, start, block_turn, step, c0, c1, c2, now, out_re, out_im):  # type: ignore[no-untyped-def]
    """Add a tone whose amplitude is c0 + c1 x + c2 x^2, x the sample number times ``step``; ``ramp`` counts the lanes."""
    for block in range(len(out_re) // _LANES):
        block_re, block_im = out_re[block * _LANES : (block + 1) * _LANES], out_im[block * _LANES : (block + 1) * _LANES]
        first = block * _LANES * step
        # The parabola about the first sample of the block.
        d0, d1, d2 = start * (c0 + first * (c1 + first * c2)), start * (c1 + 2 * first * c2) * step, start * c2 * step * step
        now[0], now[1], now[2], now[3], now[4], now[5] = d0.real, d0.imag, d1.real, d1.imag, d2.real, d2.imag
        re0, im0, re1, im1, re2, im2 = now[0], now[1], now[2], now[3], now[4], now[5]
        for lane in range(_LANES):
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
def _synthesize(  # type: ignore[no-untyped-def]
    begin, end, length, amplitude, powers, start_frequency, slope, sample_rate, ramp, out
):
    """Fill ``out (chirp, rx, sample)`` from chirp ``begin`` to ``end``, in the precision of ``ramp``, which counts the lanes."""
    receivers, samples = out.shape[1:]
    nodes, echoes = amplitude.shape[0], length.shape[2]
    # The last block may reach past the last sample.
    padded = (samples + _LANES - 1) // _LANES * _LANES
    real, imaginary, now = np.empty_like(ramp), np.empty_like(ramp), np.empty(6, dtype=ramp.dtype)
    exact_re, exact_im = np.empty(_LANES), np.empty(_LANES)
    sum_re, sum_im = np.empty(padded, dtype=ramp.dtype), np.empty(padded, dtype=ramp.dtype)
    start_re, start_im, turn_re, turn_im = np.empty(echoes), np.empty(echoes), np.empty(echoes), np.empty(echoes)
    heard, coefficient = np.empty(echoes, dtype=np.int64), np.empty(_POWERS, dtype=np.complex128)
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
            for lowest in range((nodes - 1) // _POWERS * _POWERS, -1, -_POWERS):
                if lowest + _POWERS < nodes:
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
                    for lane in range(_LANES):
                        real[lane], imaginary[lane] = exact_re[lane], exact_im[lane]
                    if not varies:
                        _add_constant(real, imaginary, start * own[0, echo], block_turn, now, sum_re, sum_im)
                        continue
                    coefficient[:] = 0
                    for power in range(lowest, min(lowest + _POWERS, nodes)):
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


def in_band(echoes: Echoes, radar: Radar) -> NDArray[np.bool_]:
    """Which echoes pass the ideal IF low-pass: beat frequency in [0, sample rate), (chirp, rx, echo).

    Parameters
    ----------
    echoes : Echoes
    radar : Radar

    Returns
    -------
    (chirp, rx, echo) bool
    """
    return _in_band(echoes.length, radar)


def _in_band(length: NDArray[np.float64], radar: Radar) -> NDArray[np.bool_]:
    beat = radar.slope_hz_per_s / SPEED_OF_LIGHT_MPS * length
    return np.asarray((beat >= 0) & (beat < radar.sample_rate_hz))


def synthesize(
    echoes: Echoes, radar: Radar, times: ArrayLike, *, dtype: DTypeLike = np.complex128
) -> NDArray[np.complexfloating]:
    """IF samples of a block of chirps, without noise.

    Parameters
    ----------
    echoes : Echoes
        Of this block. Those whose beat frequency lies outside [0, sample rate) are left out, see `in_band`.
    radar : Radar
        Its waveform.
    times : (chirp,) array_like
        Centres of the chirps [s], as of `Radar.chirp_times`; each length belongs to one of them.
    dtype : complex64 or complex128
        Of the samples. Phases are float64 in both. For complex64, samples are added up in float32, to 1e-6 of the sum of the
        magnitudes: by `spread_sum` from `MANY_ECHOES` on, with at most 6 frequencies, else where amplitudes are given at 3
        frequencies at most.

    Returns
    -------
    (chirp, rx, sample) complex
        x[n] = sum over echoes of amplitude(f_n) exp(+j 2 pi (f_c tau + s tau t_n - s tau^2 / 2)), tau = length / c,
        t_n = n / sample rate, f_n = f_c + s t_n; paper, eq. 9, with its neglected last term. Hidden echoes add nothing.
        Under FDM f_c is that of each Tx, `Radar.tx_offset_hz` higher, but for amplitudes, which hardly change by so little.

    Raises
    ------
    ValueError
        Where times and echoes differ in their number of chirps.

    Warns
    -----
    ValidityWarning
        Where an echo moves by more than a tenth of a range bin inside one chirp, which is taken to stand still there.

    Notes
    -----
    Equation :eq:`if-signal` of the theory page, which follows from the sweep, :eq:`chirp`.
    """
    times = np.asarray(times, dtype=np.float64)
    if times.shape != echoes.length.shape[:1]:
        raise ValueError(f"synthesize: times has shape {times.shape}; with these echoes it must be {echoes.length.shape[:1]}")
    _warn_of_motion_in_chirp(echoes, radar, times)
    if radar.tx_offset_hz.any():
        echoes = _on_own_carriers(echoes, radar)
    out = np.empty((*echoes.length.shape[:2], radar.samples_per_chirp), dtype=dtype)
    many = echoes.length.shape[2] >= MANY_ECHOES and len(echoes.frequency) <= MOST_NODES and out.dtype == np.complex64
    length, powers = np.ascontiguousarray(echoes.length), _powers_of_sample_number(echoes.frequency, radar)
    waveform = float(radar.start_frequency_hz), radar.slope_hz_per_s, radar.sample_rate_hz
    if many:
        # A slice of a block serves as it is where amplitudes are only picked.
        spread_sum(length, echoes.amplitude, powers, *waveform, out)
    else:
        # More powers than those of a parabola cancel too much for float32.
        kind = np.float32 if out.dtype == np.complex64 and len(echoes.frequency) <= _POWERS else np.float64
        amplitude = np.ascontiguousarray(echoes.amplitude, dtype=np.complex128)
        ramp = np.arange(_LANES, dtype=kind)

        def fill(begin: int) -> None:
            _synthesize(begin, min(begin + _CHIRPS_A_THREAD, len(out)), length, amplitude, powers, *waveform, ramp, out)

        in_threads(fill, range(0, len(out), _CHIRPS_A_THREAD))
    return out


def _on_own_carriers(echoes: Echoes, radar: Radar) -> Echoes:
    """A carrier that is higher by an offset turns every echo by the offset times its delay."""
    turns = radar.tx_offset_hz[echoes.tx][:, None, None] * (echoes.length / SPEED_OF_LIGHT_MPS)
    return dataclasses.replace(echoes, amplitude=echoes.amplitude * np.exp(2j * np.pi * turns))


def _powers_of_sample_number(frequency: NDArray[np.float64], radar: Radar) -> NDArray[np.float64]:
    """Weights (power, node) of an amplitude's values at the nodes in its polynomial in n / samples."""
    nodes = (frequency - radar.start_frequency_hz) / radar.bandwidth_hz
    return np.asarray(np.linalg.inv(np.vander(nodes, increasing=True)), dtype=np.float64)


def _warn_of_motion_in_chirp(echoes: Echoes, radar: Radar, times: NDArray[np.float64]) -> None:
    # Chirps of one Tx only: between two Tx the length changes by the array, not by motion.
    same = np.flatnonzero(echoes.tx == echoes.tx[0]) if len(times) else np.zeros(0, dtype=np.int64)
    if len(same) < 2:
        return
    # Neighbours, for what is fast soon leaves the band.
    first = np.unique(np.linspace(0, len(same) - 2, _INSTANTS).astype(np.int64))
    before, after = same[first], same[first + 1]
    # The ends of the line of receivers: those in between see no other speed.
    ends = [0, -1]
    lengths = [echoes.length[chirps][:, ends] for chirps in (before, after)]
    heard = np.ones(lengths[0].shape, dtype=bool)
    for chirps, length in zip((before, after), lengths, strict=True):
        heard &= (echoes.amplitude[:, chirps][:, :, ends] != 0).any(axis=0) & _in_band(length, radar)
    rate = np.abs(lengths[1] - lengths[0]) / (times[after] - times[before])[:, None, None]
    bins = float(np.where(heard, rate, 0.0).max(initial=0.0)) / 2 * radar.chirp_duration_s / radar.range_bin_m
    if bins > MAX_BINS_IN_CHIRP:
        warnings.warn(
            f"an echo moves {bins:.2f} range bins inside one chirp, more than {MAX_BINS_IN_CHIRP}: it is taken to stand "
            "still there; shorten the chirp or slow the motion",
            ValidityWarning,
            stacklevel=3,
        )
