"""IF samples of a block of chirps: the sum of a tone for each echo (paper, eqs 7 to 12)."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.polynomial.polynomial import polyvander
from numpy.typing import ArrayLike, DTypeLike, NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.errors import ValidityWarning
from rtradar.kernels.nufft import LEAST_SAMPLES, MOST_NODES, sum_by_nufft
from rtradar.kernels.tone_sum import Tones, add_tones, tone_tables
from rtradar.radar import Radar
from rtradar.system.checks import array_to_fill
from rtradar.system.threads import thread_count, thread_map

MAX_BINS_IN_CHIRP = 0.1
"""Range bins by which a length, which belongs to the centre of its chirp, may change inside one."""

MANY_ECHOES, MANY_VARYING_ECHOES = 80, 36
"""Echoes from which on the NUFFT is faster, if float32 will do: with amplitudes that are one
number, and with amplitudes at several frequencies (`validation/other_methods/if_sum.py` times both
methods)."""

_CHIRPS_A_THREAD = 16
"""Least number of chirps of one task of a thread, because handing out the next takes time."""

_MOST_POWERS = 3
"""Most powers of the sample number in float32: those beyond a parabola cancel too much."""

_INSTANTS = 16
"""Instants of a block, or up to twice as many, at which the speed of echoes is checked."""


def in_band(echoes: Echoes, radar: Radar) -> NDArray[np.bool_]:
    """Echoes that pass the ideal IF low-pass: beat frequency in [0, sample rate).

    Parameters
    ----------
    echoes : Echoes
        Echoes of a block of chirps.
    radar : Radar
        Radar whose sweep and sample rate count.

    Returns
    -------
    (chirp, rx, echo) bool
    """
    return _in_band(echoes.length, radar)


def _in_band(length: NDArray[np.float64], radar: Radar) -> NDArray[np.bool_]:
    beat = radar.slope_hz_per_s / SPEED_OF_LIGHT_MPS * length
    return np.asarray((beat >= 0) & (beat < radar.sample_rate_hz))


def synthesize(
    echoes: Echoes,
    radar: Radar,
    times: ArrayLike,
    *,
    dtype: DTypeLike = np.complex128,
    out: NDArray[np.complexfloating] | None = None,
) -> NDArray[np.complexfloating]:
    """IF samples of a block of chirps, without noise.

    Equation :eq:`if-signal` of the theory page, which follows from the sweep, :eq:`chirp`.

    Parameters
    ----------
    echoes : Echoes
        Echoes of this block. Those whose beat frequency lies outside [0, sample rate) are left out,
        see `in_band`.
    radar : Radar
        Radar that gives the waveform.
    times : (chirp,) array_like
        Centres of the chirps [s], from `Radar.chirp_times`; each length belongs to one of them.
    dtype : complex64 or complex128
        Type of the samples. Phases are float64 in both. For complex64, samples are added up in
        float32, to 1e-6 of the sum of the magnitudes: by the NUFFT where there are many echoes, at
        least 16 samples, and at most 6 frequencies; else where amplitudes are given at 3
        frequencies at most.
    out : (chirp, rx, sample) complex, optional
        Array of that type to fill, C-contiguous; otherwise a new one is made.

    Returns
    -------
    (chirp, rx, sample) complex
        x[n] = sum over echoes of amplitude(f_n) exp(+j 2 pi (f_c tau + s tau t_n - s tau^2 / 2)),
        tau = length / c, t_n = n / sample rate, f_n = f_c + s t_n, f_c = `Radar.sampled_start_hz`,
        the sweep at the first sample; paper, eq. 9, with its neglected last term. Under FDM f_c is
        that of each Tx, `Radar.tx_offset_hz` higher, except in the amplitudes, which hardly change
        by so little.

    Raises
    ------
    ValueError
        Where times and echoes differ in their number of chirps, or ``out`` is not an array of that
        shape and type.

    Warns
    -----
    ValidityWarning
        Where an echo moves by more than a tenth of a range bin inside one chirp; it is synthesised
        as if it did not move there.
    """
    times = np.asarray(times, dtype=np.float64)
    if times.shape != echoes.length.shape[:1]:
        raise ValueError(
            f"synthesize: times has shape {times.shape}; with these echoes it must be "
            f"{echoes.length.shape[:1]}"
        )
    # A chirp is a moment: an echo that moves inside of one is off, and a Tx with a carrier of its
    # own turns its echoes by it.
    warn_of_motion_in_chirp(echoes, radar, times)
    if radar.tx_offset_hz.any():
        echoes = _on_own_carriers(echoes, radar)
    shape = (*echoes.length.shape[:2], radar.samples_per_chirp)
    out = array_to_fill("synthesize", out, shape, dtype)
    # Many echoes go through the NUFFT, few are summed tone by tone, in float32 where that is
    # precise enough.
    if _are_many(echoes, radar, out.dtype):
        sum_by_nufft(_tones(echoes, echoes.amplitude, radar, legvander), out)
        return out
    amplitude = np.ascontiguousarray(echoes.amplitude, dtype=np.complex128)
    tones = _tones(echoes, amplitude, radar, polyvander)
    in_float32 = out.dtype == np.complex64 and len(echoes.frequency) <= _MOST_POWERS
    tables = tone_tables(np.float32 if in_float32 else np.float64)
    # Two tasks for each thread, none of them too small.
    at_once = max(_CHIRPS_A_THREAD, -(-len(out) // (2 * thread_count())))

    def fill(begin: int) -> None:
        add_tones(begin, min(begin + at_once, len(out)), tones, tables, out)

    thread_map(fill, range(0, len(out), at_once))
    return out


def _are_many(echoes: Echoes, radar: Radar, dtype: np.dtype[Any]) -> bool:
    """Whether the NUFFT is faster than the direct sum, and precise enough."""
    nodes, count = len(echoes.frequency), echoes.length.shape[2]
    many = count >= (MANY_ECHOES if nodes == 1 else MANY_VARYING_ECHOES)
    possible = nodes <= MOST_NODES and radar.samples_per_chirp >= LEAST_SAMPLES
    return many and possible and dtype == np.complex64


def _tones(
    echoes: Echoes, amplitude: NDArray[np.complexfloating], radar: Radar, basis: Callable[..., Any]
) -> Tones:
    length = np.ascontiguousarray(echoes.length)
    weights = weights_of_nodes(echoes.frequency, radar, basis)
    sweep = float(radar.sampled_start_hz), radar.slope_hz_per_s, radar.sample_rate_hz
    return Tones(length, amplitude, weights, *sweep)


def _on_own_carriers(echoes: Echoes, radar: Radar) -> Echoes:
    """The same echoes, each rotated by the offset of its Tx's carrier times its delay."""
    turns = radar.tx_offset_hz[echoes.tx][:, None, None] * (echoes.length / SPEED_OF_LIGHT_MPS)
    return dataclasses.replace(echoes, amplitude=echoes.amplitude * np.exp(2j * np.pi * turns))


def weights_of_nodes(
    frequency: NDArray[np.float64], radar: Radar, basis: Callable[..., Any] = legvander
) -> NDArray[np.float64]:
    """Weights (term, node) that make coefficients of values at nodes, see `Tones`.

    The basis gives its polynomials (node, term) at x (node,) up to a degree; Legendre's by default.
    """
    # Coefficients over the sweep, from -1 to 1 about its middle sample.
    middle = radar.samples_per_chirp // 2 / radar.samples_per_chirp
    x = 2 * ((frequency - radar.sampled_start_hz) / radar.sampled_bandwidth_hz - middle)
    return np.asarray(np.linalg.inv(basis(x, len(x) - 1)), dtype=np.float64)


def warn_of_motion_in_chirp(echoes: Echoes, radar: Radar, times: NDArray[np.float64]) -> None:
    """Warn where echoes, at the centres of some chirps [s], move too far inside one of them."""
    # Chirps of one Tx only: between two Tx the length changes by the array, not by motion.
    same = np.flatnonzero(echoes.tx == echoes.tx[0]) if len(times) else np.zeros(0, dtype=np.int64)
    if len(same) < 2:
        return
    # Neighbours, because what is fast soon leaves the band; the last two among them.
    step = max(1, (len(same) - 1) // _INSTANTS)
    before, after = same[-2::-step], same[:0:-step]
    # The ends of the line of receivers: those in between see no other speed.
    ends = slice(None, None, max(1, echoes.length.shape[1] - 1))
    lengths = [echoes.length[chirps, ends] for chirps in (before, after)]
    rate = np.abs(lengths[1] - lengths[0]) / (times[after] - times[before])[:, None, None]
    bins_of_rate = radar.sampled_duration_s / (2 * radar.range_bin_m)
    if rate.max(initial=0.0) * bins_of_rate <= MAX_BINS_IN_CHIRP:
        return
    # An echo that is occluded or out of the band has no samples that could be wrong.
    for chirps, length in zip((before, after), lengths, strict=True):
        visible = (echoes.amplitude[:, chirps, ends] != 0).any(axis=0)
        rate[~(visible & _in_band(length, radar))] = 0.0
    bins = float(rate.max()) * bins_of_rate
    if bins > MAX_BINS_IN_CHIRP:
        warnings.warn(
            f"an echo moves {bins:.2f} range bins inside one chirp, more than {MAX_BINS_IN_CHIRP}: "
            "it is taken to stand still there; shorten the chirp or slow the motion",
            ValidityWarning,
            stacklevel=3,
        )
