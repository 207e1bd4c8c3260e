"""IF samples to range spectra and range-Doppler spectra.

The IF turns with exp(+j 2 pi f tau), so an echo at range R peaks in range bin R / range_bin (paper, eq. 12) and one
that recedes in a positive Doppler bin (paper, eq. 16). Window functions are periodic Hann windows unless others are named.
Spectra are divided by the sums of their weights: a tone of amplitude 1 on the middle of a bin reads 1.

Range spectra, which are streamed, keep complex64: their rounding stays some 140 dB below the strongest echo, and a map of 666
cycles takes 131 MB instead of 262 MB.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.kernels.spectra import weigh_samples
from rtradar.process.window_functions import HANN, WindowFunctions, weights
from rtradar.radar import Radar
from rtradar.system.checks import array_to_fill
from rtradar.system.threads import in_threads

_CHIRPS_PER_BATCH = 128
"""Chirps transformed at once: 8 receivers x 256 samples x 8 bytes make 2 MB, which stays in the cache of a core."""


@dataclass(frozen=True)
class RangeDoppler:
    """Range-Doppler spectra of one coherent processing window, every channel apart.

    Parameters
    ----------
    values : (range, velocity, channel) complex
        Spectra with coherent gain 1, in the unit of the IF; channel = tx * n_rx + rx. The Tx of one cycle transmit
        one after the other; the phase that a moving echo gains meanwhile is left in.
    range_m : (range,) float64
        Range of each range bin [m], half the Tx..Rx path.
    velocity : (velocity,) float64
        Range rate of each Doppler bin [m/s], positive receding, ascending, zero at index ``n_cycles // 2``.
    """

    values: NDArray[np.complexfloating]
    range_m: NDArray[np.float64]
    velocity: NDArray[np.float64]


def range_doppler(
    x: ArrayLike,
    radar: Radar,
    *,
    window_functions: WindowFunctions = HANN,
) -> RangeDoppler:
    """Windowed range and Doppler spectra of IF samples, every channel apart.

    Parameters
    ----------
    x : (chirp, rx, sample) complex
        IF samples; chirp 0 comes from Tx 0. Whole TDM cycles are used, the chirps after the last are left out.
    radar : Radar
        Gives the schedule and the axes.
    window_functions : WindowFunctions
        Window functions in fast time and in slow time.

    Returns
    -------
    RangeDoppler
        In complex64 where ``x`` is complex64 or float32, else in complex128.

    Raises
    ------
    InputError
        Where the shape does not fit the radar, not one whole cycle is there, or a sample is not finite.

    Notes
    -----
    Equation :eq:`range-doppler` of the theory page.
    """
    samples = _checked_if(x, radar)
    n_cycles = samples.shape[0] // radar.n_tx
    if n_cycles < 1:
        raise InputError(
            f"range_doppler: {samples.shape[0]} chirps hold no whole TDM cycle; give at least {radar.n_tx}, one for each Tx"
        )
    if not np.isfinite(samples).all():
        raise InputError("range_doppler: x holds NaN or infinity; every IF sample must be finite")
    fast = weights(window_functions.range, samples.shape[2])
    slow = weights(window_functions.doppler, n_cycles)
    kind = complex_kind(samples)
    cube = samples[: n_cycles * radar.n_tx].reshape(n_cycles, radar.n_channels, samples.shape[2])
    weighted = cube * fast.astype(kind) * slow.astype(kind)[:, None, None]
    spectra = scipy.fft.fft(weighted, axis=2, overwrite_x=True, workers=-1)
    spectra = scipy.fft.fft(spectra, axis=0, overwrite_x=True, workers=-1)
    values = np.fft.fftshift(spectra, axes=0).transpose(2, 0, 1)
    return RangeDoppler(np.ascontiguousarray(values), radar.range_m, radar.velocity_mps(n_cycles))


def range_spectrum(
    x: ArrayLike,
    radar: Radar,
    *,
    window_functions: WindowFunctions = HANN,
    out: NDArray[np.complex64] | None = None,
) -> NDArray[np.complex64]:
    """Range spectrum of each chirp, the part of the work that overlapping windows share.

    Parameters
    ----------
    x : (chirp, rx, sample) complex
        IF samples of any number of chirps.
    radar : Radar
        Gives the shape.
    window_functions : WindowFunctions
        The window function in fast time is taken from it.
    out : (chirp, rx, range) complex64, optional
        Array to fill, C-contiguous; otherwise a new one is made.

    Returns
    -------
    (chirp, rx, range) complex64
        Spectra with coherent gain 1.

    Raises
    ------
    InputError
        Where the shape does not fit the radar.
    ValueError
        Where ``out`` is not an array of that shape and type.
    """
    samples = _checked_if(x, radar)
    scale = weights(window_functions.range, samples.shape[2]).astype(np.float32)
    spectra = array_to_fill("range_spectrum", out, samples.shape, np.complex64)

    def transform(first: int) -> None:
        block = spectra[first : first + _CHIRPS_PER_BATCH]
        weigh_samples(samples[first : first + len(block)], scale, block)
        # Where it stands, if SciPy can.
        done = scipy.fft.fft(block, axis=2, overwrite_x=True)
        if not np.shares_memory(done, block):
            block[...] = done

    in_threads(transform, range(0, samples.shape[0], _CHIRPS_PER_BATCH))
    return spectra


def _checked_if(x: ArrayLike, radar: Radar) -> NDArray[np.generic]:
    samples = np.asarray(x)
    if samples.ndim != 3 or samples.shape[1:] != (radar.n_rx, radar.samples_per_chirp):
        raise InputError(
            f"IF samples have shape {samples.shape}; radar '{radar.name}' needs "
            f"(chirp, rx, sample) = (any, {radar.n_rx}, {radar.samples_per_chirp})"
        )
    if samples.dtype.kind not in "fc":
        raise InputError(f"IF samples are of type {samples.dtype}; they must be complex numbers")
    return samples


def complex_kind(values: NDArray[np.generic]) -> type[np.complex64] | type[np.complex128]:
    """Complex numbers as precise as the values."""
    return np.complex64 if values.dtype in (np.complex64, np.float32) else np.complex128
