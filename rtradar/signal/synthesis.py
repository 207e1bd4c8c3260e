"""IF samples of a block of chirps: every echo a tone, added up (paper, eqs 7 to 12)."""

from __future__ import annotations

import math
import warnings

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, DTypeLike, NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.errors import ValidityWarning
from rtradar.radar import Radar

MAX_BINS_IN_CHIRP = 0.1
"""A length belongs to the centre of its chirp; where it changes by more range bins inside one, that is no longer true."""

_LANES = 16
_INSTANTS = 16
"""At so many instants of a block the speed of echoes is looked at."""


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _add_tone(real, imaginary, start_re, start_im, turn_re, turn_im, out_re, out_im):  # type: ignore[no-untyped-def]
    """Add a tone to ``out``: its first value and its turn from sample to sample given. 16 samples go side by side."""
    samples = out_re.shape[0]
    lane_re, lane_im = start_re, start_im
    step_re, step_im = 1.0, 0.0
    for lane in range(_LANES):
        real[lane], imaginary[lane] = lane_re, lane_im
        lane_re, lane_im = lane_re * turn_re - lane_im * turn_im, lane_re * turn_im + lane_im * turn_re
        step_re, step_im = step_re * turn_re - step_im * turn_im, step_re * turn_im + step_im * turn_re
    for first in range(0, samples - _LANES + 1, _LANES):
        for lane in range(_LANES):
            re, im = real[lane], imaginary[lane]
            out_re[first + lane] += re
            out_im[first + lane] += im
            real[lane] = re * step_re - im * step_im
            imaginary[lane] = re * step_im + im * step_re
    done = samples - samples % _LANES
    for lane in range(samples - done):
        out_re[done + lane] += real[lane]
        out_im[done + lane] += imaginary[lane]


@njit(cache=True, error_model="numpy", parallel=True)
def _synthesize(length, coefficients, start_frequency, slope, sample_rate, out):  # type: ignore[no-untyped-def]
    chirps, receivers, samples = out.shape
    degrees, echoes = coefficients.shape[0], length.shape[2]
    for chirp in prange(chirps):
        real, imaginary = np.empty(_LANES), np.empty(_LANES)
        sum_re, sum_im = np.empty(samples), np.empty(samples)
        for receiver in range(receivers):
            sum_re[:] = 0.0
            sum_im[:] = 0.0
            # Horner over the powers of the sample number: constant amplitudes are the one-step case.
            for degree in range(degrees - 1, -1, -1):
                if degree < degrees - 1:
                    for sample in range(samples):
                        sum_re[sample] *= sample / samples
                        sum_im[sample] *= sample / samples
                for echo in range(echoes):
                    amplitude = coefficients[degree, chirp, receiver, echo]
                    delay = length[chirp, receiver, echo] / SPEED_OF_LIGHT_MPS
                    beat = slope * delay
                    if amplitude == 0 or not (beat >= 0 and beat < sample_rate):
                        continue
                    turns = start_frequency * delay - 0.5 * beat * delay
                    phase = 2 * math.pi * (turns - math.floor(turns))
                    cosine, sine = math.cos(phase), math.sin(phase)
                    step = 2 * math.pi * beat / sample_rate
                    _add_tone(
                        real,
                        imaginary,
                        amplitude.real * cosine - amplitude.imag * sine,
                        amplitude.real * sine + amplitude.imag * cosine,
                        math.cos(step),
                        math.sin(step),
                        sum_re,
                        sum_im,
                    )
            for sample in range(samples):
                out[chirp, receiver, sample] = complex(sum_re[sample], sum_im[sample])


def in_band(echoes: Echoes, radar: Radar) -> NDArray[np.bool_]:
    """Which echoes pass the ideal IF low-pass: beat frequency in [0, sample rate), (chirp, rx, echo)."""
    beat = radar.slope_hz_per_s / SPEED_OF_LIGHT_MPS * echoes.length
    return (beat >= 0) & (beat < radar.sample_rate_hz)


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
        Of the samples; sums and phases are float64 in both.

    Returns
    -------
    (chirp, rx, sample) complex
        x[n] = sum over echoes of amplitude(f_n) exp(+j 2 pi (f_c tau + s tau t_n - s tau^2 / 2)), tau = length / c,
        t_n = n / sample rate, f_n = f_c + s t_n; paper, eq. 9, with its neglected last term. Hidden echoes add nothing.

    Raises
    ------
    ValueError
        Where times and echoes differ in their number of chirps.

    Warns
    -----
    ValidityWarning
        Where an echo moves by more than a tenth of a range bin inside one chirp, which is taken to stand still there.
    """
    times = np.asarray(times, dtype=np.float64)
    if times.shape != echoes.length.shape[:1]:
        raise ValueError(f"synthesize: times has shape {times.shape}; with these echoes it must be {echoes.length.shape[:1]}")
    _warn_of_motion_in_chirp(echoes, radar, times)
    coefficients = _powers_of_sample_number(echoes, radar)
    out = np.empty((*echoes.length.shape[:2], radar.samples_per_chirp), dtype=dtype)
    _synthesize(
        np.ascontiguousarray(echoes.length),
        coefficients,
        float(radar.start_frequency_hz),
        radar.slope_hz_per_s,
        radar.sample_rate_hz,
        out,
    )
    return out


def _powers_of_sample_number(echoes: Echoes, radar: Radar) -> NDArray[np.complex128]:
    """Coefficients (degree, chirp, rx, echo) of the amplitude's polynomial in n / samples, from its values at the nodes."""
    amplitude = np.ascontiguousarray(echoes.amplitude, dtype=np.complex128)
    if len(echoes.frequency) == 1:
        return amplitude
    nodes = (echoes.frequency - radar.start_frequency_hz) / radar.bandwidth_hz
    vandermonde = np.vander(nodes, increasing=True)
    return np.ascontiguousarray(np.tensordot(np.linalg.inv(vandermonde), amplitude, axes=1))


def _warn_of_motion_in_chirp(echoes: Echoes, radar: Radar, times: NDArray[np.float64]) -> None:
    # Chirps of one Tx only: between two Tx the length changes by the array, not by motion.
    same = np.flatnonzero(echoes.tx == echoes.tx[0]) if len(times) else np.zeros(0, dtype=np.int64)
    if len(same) < 2:
        return
    # Neighbours, for what is fast soon leaves the band.
    first = np.unique(np.linspace(0, len(same) - 2, _INSTANTS).astype(np.int64))
    before, after = same[first], same[first + 1]
    inside = in_band(echoes, radar)
    heard = np.ones_like(inside[before])
    for chirps in (before, after):
        heard &= (echoes.amplitude[:, chirps] != 0).any(axis=0) & inside[chirps]
    rate = np.abs(echoes.length[after] - echoes.length[before]) / (times[after] - times[before])[:, None, None]
    bins = float(np.where(heard, rate, 0.0).max(initial=0.0)) / 2 * radar.chirp_duration_s / radar.range_bin_m
    if bins > MAX_BINS_IN_CHIRP:
        warnings.warn(
            f"an echo moves {bins:.2f} range bins inside one chirp, more than {MAX_BINS_IN_CHIRP}: it is taken to stand "
            "still there; shorten the chirp or slow the motion",
            ValidityWarning,
            stacklevel=3,
        )
