"""IF samples to range spectra, range-Doppler spectra and the power map that CFAR reads.

The IF turns with exp(+j 2 pi f tau), so an echo at range R peaks in range bin R / range_bin (paper, eq. 12) and one
that recedes in a positive Doppler bin (paper, eq. 16). Windows are periodic Hann unless others are given. Spectra are
divided by the sums of their windows: a tone of amplitude 1 on the middle of a bin reads 1.

The streaming pieces keep complex64: their rounding stays some 140 dB below the strongest echo, and a map of 666 cycles
takes 131 MB instead of 262 MB.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.fft
from numba import njit
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.process.doppler_division import without_copies
from rtradar.radar import Radar
from rtradar.threads import in_threads

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


def hann(n: int) -> NDArray[np.float64]:
    """Periodic (DFT-even) Hann window (sample,); one sample alone is 1."""
    if n == 1:
        return np.ones(1)
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)


def range_doppler(
    x: ArrayLike, radar: Radar, *, range_window: ArrayLike | None = None, doppler_window: ArrayLike | None = None
) -> RangeDoppler:
    """Windowed range and Doppler spectra of IF samples, every channel apart.

    Parameters
    ----------
    x : (chirp, rx, sample) complex
        IF samples; chirp 0 comes from Tx 0. Whole TDM cycles are used, the chirps after the last are left out.
    radar : Radar
        Gives the schedule and the axes.
    range_window : (sample,) float, optional
        Instead of the periodic Hann window in fast time.
    doppler_window : (cycle,) float, optional
        Instead of the periodic Hann window in slow time.

    Returns
    -------
    RangeDoppler
        In complex64 where ``x`` is complex64 or float32, else in complex128.

    Raises
    ------
    InputError
        Where the shape does not fit the radar, not one whole cycle is there, a sample is not finite, or a window has
        the wrong length or no weight.

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
    fast = _weights(range_window, samples.shape[2], "range_window")
    slow = _weights(doppler_window, n_cycles, "doppler_window")
    kind = _complex_kind(samples)
    cube = samples[: n_cycles * radar.n_tx].reshape(n_cycles, radar.n_channels, samples.shape[2])
    weighted = cube * fast.astype(kind) * slow.astype(kind)[:, None, None]
    spectra = scipy.fft.fft(weighted, axis=2, overwrite_x=True, workers=-1)
    spectra = scipy.fft.fft(spectra, axis=0, overwrite_x=True, workers=-1)
    values = np.fft.fftshift(spectra, axes=0).transpose(2, 0, 1)
    return RangeDoppler(np.ascontiguousarray(values), radar.range_m, radar.velocity_mps(n_cycles))


def range_spectrum(x: ArrayLike, radar: Radar, *, window: ArrayLike | None = None) -> NDArray[np.complex64]:
    """Range spectrum of each chirp, the part of the work that overlapping windows share.

    Parameters
    ----------
    x : (chirp, rx, sample) complex
        IF samples of any number of chirps.
    radar : Radar
        Gives the shape.
    window : (sample,) float, optional
        Instead of the periodic Hann window.

    Returns
    -------
    (chirp, rx, range) complex64
        Spectra with coherent gain 1.

    Raises
    ------
    InputError
        Where the shape does not fit the radar or the window has the wrong length or no weight.
    """
    samples = _checked_if(x, radar)
    weights = _weights(window, samples.shape[2], "window").astype(np.float32)
    spectra = np.empty(samples.shape, dtype=np.complex64)

    def transform(first: int) -> None:
        block = spectra[first : first + _CHIRPS_PER_BATCH]
        _taper(samples[first : first + len(block)], weights, block)
        # Where it stands, if SciPy can.
        done = scipy.fft.fft(block, axis=2, overwrite_x=True)
        if not np.shares_memory(done, block):
            block[...] = done

    in_threads(transform, range(0, samples.shape[0], _CHIRPS_PER_BATCH))
    return spectra


def range_time(
    spectra: NDArray[np.complexfloating], radar: Radar, *, first_chirp: int = 0, step_s: float = 5e-3
) -> tuple[NDArray[np.floating], NDArray[np.float64]]:
    """Power over slow time and range, averaged over channels and over whole TDM cycles.

    Parameters
    ----------
    spectra : (chirp, rx, range) complex
        From `range_spectrum`; the first chirp comes from Tx 0.
    radar : Radar
        Gives the schedule.
    first_chirp : int
        Its number in the capture.
    step_s : float
        About how long each average is [s]; at least one cycle. The last may be shorter.

    Returns
    -------
    power : (slow_time, range) float32 or float64
        In the unit of the squared IF.
    slow_time : (slow_time,) float64
        Centre of each average since the start of the capture [s].

    Raises
    ------
    InputError
        Where the shape does not fit the radar.
    """
    chirps = np.asarray(spectra)
    if chirps.ndim != 3 or chirps.shape[1] != radar.n_rx:
        raise InputError(
            f"range_time: spectra have shape {chirps.shape}; radar '{radar.name}' needs (chirp, {radar.n_rx}, range)"
        )
    together = radar.n_tx if radar.multiplexing == "ddm" else 1  # Tx in every row
    rows = max(1, round(step_s / radar.cycle_duration_s)) * radar.n_tx

    def mean_power(begin: int) -> NDArray[np.floating]:
        # Row by row: no squares of a whole block are kept.
        parts = np.ascontiguousarray(chirps[begin : begin + rows]).view(chirps.real.dtype).reshape(-1, 2 * chirps.shape[2])
        squares = np.einsum("ri,ri->i", parts, parts).reshape(-1, 2).sum(axis=1)
        return np.asarray(squares / (len(parts) * together))

    power = in_threads(mean_power, range(0, len(chirps), rows))
    begins = np.arange(0, len(chirps), rows)
    middles = first_chirp + (begins + np.minimum(begins + rows, len(chirps))) / 2
    kind = chirps.real.dtype
    return np.array(power, dtype=kind).reshape(len(power), chirps.shape[2]), middles * radar.chirp_interval_s


def power_map(
    spectra: NDArray[np.complexfloating], radar: Radar, *, channel: int | None = None, doppler_window: ArrayLike | None = None
) -> NDArray[np.floating]:
    """Range-Doppler power of one window: the squared magnitudes of all channels summed, or of one channel.

    Parameters
    ----------
    spectra : (cycle, tx, rx, range) complex
        Range spectra of whole TDM cycles, from `range_spectrum`.
    radar : Radar
        Gives the shape.
    channel : int, optional
        Only this channel, tx * n_rx + rx; all of them when left out.
    doppler_window : (cycle,) float, optional
        Instead of the periodic Hann window.

    Returns
    -------
    (range, velocity) float32 or float64
        Power, in the precision of ``spectra``; velocity as in `RangeDoppler`. With complex Gaussian noise a cell follows the
        Gamma law of as many looks as there are channels in the sum. Under DDM an echo's copies are taken out, but of a single
        channel.

    Raises
    ------
    InputError
        Where the shape does not fit the radar, there is no such channel, or the window has the wrong length or no weight.
    """
    cube = np.asarray(spectra)
    if cube.ndim != 4 or cube.shape[1:3] != (radar.n_tx, radar.n_rx) or cube.shape[0] < 1:
        raise InputError(
            f"power_map: spectra have shape {cube.shape}; radar '{radar.name}' needs "
            f"(cycle, tx, rx, range) = (>= 1, {radar.n_tx}, {radar.n_rx}, any)"
        )
    if channel is not None and not 0 <= channel < radar.n_channels:
        raise InputError(f"power_map: channel = {channel}; radar '{radar.name}' has channels 0 to {radar.n_channels - 1}")
    n_cycles, _, _, n_range = cube.shape
    kind = _complex_kind(cube)
    real = np.float32 if kind == np.complex64 else np.float64
    weights = _weights(doppler_window, n_cycles, "doppler_window").astype(real)

    def add_channel(tx: int, rx: int, total: NDArray[np.floating]) -> None:
        # One channel at a time fits the cache of a core.
        weighted = np.empty((n_cycles, n_range), dtype=kind)
        _weigh(cube[:, tx, rx], weights, weighted)
        _add_power(scipy.fft.fft(weighted, axis=0, overwrite_x=True), total)

    def tx_power(tx: int) -> NDArray[np.floating]:
        total = np.zeros((n_cycles, n_range), dtype=real)
        for rx in range(radar.n_rx):
            add_channel(tx, rx, total)
        return total

    power = np.zeros((n_cycles, n_range), dtype=real)
    if channel is not None:
        add_channel(*divmod(channel, radar.n_rx), power)
    elif radar.multiplexing == "ddm":
        # The rows of all Tx are the same sum; those of the first are not turned.
        power = without_copies(tx_power(0), radar, radar.n_rx)
    else:
        # The order of the sum is fixed, so the map does not depend on the number of threads.
        for own in in_threads(tx_power, range(radar.n_tx)):
            power += own
    return np.ascontiguousarray(np.fft.fftshift(power, axes=0).T)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _taper(values, weights, out):  # type: ignore[no-untyped-def]
    """Fill ``out (chirp, rx, sample)``: values times the weight of their sample."""
    for chirp in range(len(out)):
        for receiver in range(out.shape[1]):
            for sample in range(out.shape[2]):
                out[chirp, receiver, sample] = values[chirp, receiver, sample] * weights[sample]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _weigh(values, weights, out):  # type: ignore[no-untyped-def]
    """Fill ``out (cycle, range)``: values times the weight of their cycle."""
    for cycle in range(len(out)):
        for place in range(out.shape[1]):
            out[cycle, place] = values[cycle, place] * weights[cycle]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _add_power(values, total):  # type: ignore[no-untyped-def]
    """Add squared magnitudes to ``total (cycle, range)``."""
    for cycle in range(len(total)):
        for place in range(total.shape[1]):
            total[cycle, place] += values[cycle, place].real ** 2 + values[cycle, place].imag ** 2


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


def _complex_kind(values: NDArray[np.generic]) -> type[np.complex64] | type[np.complex128]:
    return np.complex64 if values.dtype in (np.complex64, np.float32) else np.complex128


def _weights(window: ArrayLike | None, n: int, name: str) -> NDArray[np.float64]:
    """The window divided by its sum."""
    if window is None:
        return _hann_weights(n)
    weights = np.asarray(window)
    if weights.shape != (n,) or weights.dtype.kind not in "fiu" or not np.isfinite(weights).all():
        raise InputError(f"{name} has shape {weights.shape}, type {weights.dtype}; it must be {n} finite real numbers")
    total = float(weights.sum())
    if total == 0:
        raise InputError(f"{name} sums to 0; a window needs weight")
    return weights.astype(np.float64) / total


@lru_cache(maxsize=16)
def _hann_weights(n: int) -> NDArray[np.float64]:
    weights = hann(n) / hann(n).sum()
    weights.flags.writeable = False
    return weights
