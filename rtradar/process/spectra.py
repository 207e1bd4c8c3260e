"""IF samples to range spectra and range-Doppler spectra, whole or in chosen cells.

The IF turns with exp(+j 2 pi f tau), so an echo at range R peaks in range bin R / range_bin (paper,
eq. 12) and one that recedes in a positive Doppler bin (paper, eq. 16). Spectra are divided by the
sums of their window functions: a tone of amplitude 1 in the middle of a bin reads 1.

Range spectra, which are streamed, are complex64: their rounding is some 140 dB below the strongest
echo, and a map of 666 cycles takes 131 MB instead of 262 MB.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.kernels.prime_factor_dft import pick_cells, prime_factor_dft
from rtradar.process.steering import range_walk
from rtradar.process.window_functions import DEFAULT_WINDOWS, WindowFunctions, weights
from rtradar.radar import Radar
from rtradar.system.checks import array_to_fill
from rtradar.system.threads import thread_map

_CHIRPS_PER_BATCH = 128
"""Chirps of one transform: 8 receivers x 256 samples x 8 bytes make 2 MB, the cache of a core."""


@dataclass(frozen=True)
class RangeDoppler:
    """Range-Doppler spectra of one frame, every channel by itself.

    Parameters
    ----------
    values : (range, velocity, channel) complex
        Spectra with coherent gain 1, in the unit of the IF; channel = tx * n_rx + rx. The phase
        that a moving echo gains between the Tx of one cycle is left in.
    range_m : (range,) float64
        Range of each range bin [m], half the Tx..Rx path.
    velocity : (velocity,) float64
        Range rate of each Doppler bin [m/s], positive receding, ascending, zero at index
        ``n_cycles // 2``.
    """

    values: NDArray[np.complexfloating]
    range_m: NDArray[np.float64]
    velocity: NDArray[np.float64]


def range_doppler(
    x: ArrayLike, radar: Radar, *, window_functions: WindowFunctions = DEFAULT_WINDOWS
) -> RangeDoppler:
    """Range and Doppler spectra of IF samples (:eq:`range-doppler`), every channel by itself.

    Parameters
    ----------
    x : (chirp, rx, sample) complex
        IF samples; chirp 0 comes from Tx 0. Whole TDM cycles are used, the chirps after the last
        are left out.
    radar : Radar
        Radar that gives the schedule and the axes.
    window_functions : WindowFunctions
        Window functions in fast time and in slow time.

    Returns
    -------
    RangeDoppler
        In complex64 where ``x`` is complex64 or float32, else in complex128.

    Raises
    ------
    InputError
        Where the shape does not fit the radar, not one whole cycle is there, or a sample is not
        finite.

    Examples
    --------
    >>> import rtradar as rt
    >>> motion = rt.synthetic_motion("walk", duration_s=0.5)
    >>> radar = rt.Radar.preset("paper-12ghz")
    >>> capture = rt.simulate(motion, radar, fidelity="analytic", duration_s=0.12)
    >>> frame = capture.samples.values[: radar.chirps_per_frame]
    >>> rt.process.range_doppler(frame, radar).values.shape
    (256, 133, 96)
    """
    samples = checked_chirps("IF samples", x, radar)
    n_cycles = whole_cycles("range_doppler", samples, radar)
    fast = weights(window_functions.range, samples.shape[2])
    slow = weights(window_functions.doppler, n_cycles)
    kind = complex_kind(samples)
    cube = samples[: n_cycles * radar.n_tx].reshape(n_cycles, radar.n_channels, samples.shape[2])
    # Both windows at once, then the transform over fast time, to range, and over slow time, to
    # Doppler.
    weighted = cube * fast.astype(kind) * slow.astype(kind)[:, None, None]
    spectra = scipy.fft.fft(weighted, axis=2, overwrite_x=True, workers=-1)
    spectra = scipy.fft.fft(spectra, axis=0, overwrite_x=True, workers=-1)
    # Zero velocity to the middle, and axes in the order of maps.
    values = np.fft.fftshift(spectra, axes=0).transpose(2, 0, 1)
    return RangeDoppler(np.ascontiguousarray(values), radar.range_m, radar.velocity_mps(n_cycles))


def range_spectrum(
    x: ArrayLike,
    radar: Radar,
    *,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
    out: NDArray[np.complex64] | None = None,
) -> NDArray[np.complex64]:
    """Range spectrum of each chirp, the part of the work that overlapping frames share.

    Parameters
    ----------
    x : (chirp, rx, sample) complex
        IF samples of any number of chirps.
    radar : Radar
        Radar that gives the shape.
    window_functions : WindowFunctions
        Window functions, of which that in fast time is applied.
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
    samples = checked_chirps("IF samples", x, radar)
    scale = weights(window_functions.range, samples.shape[2]).astype(np.float32).repeat(2)
    spectra = array_to_fill("range_spectrum", out, samples.shape, np.complex64)

    def transform(first: int) -> None:
        block = spectra[first : first + _CHIRPS_PER_BATCH]
        part = np.ascontiguousarray(samples[first : first + len(block)], dtype=np.complex64)
        # Real and imaginary parts by themselves: NumPy would make complex numbers of the weights.
        np.multiply(part.view(np.float32), scale, out=block.view(np.float32))
        # SciPy transforms in place if it can.
        done = scipy.fft.fft(block, axis=2, overwrite_x=True)
        if not np.shares_memory(done, block):
            block[...] = done

    thread_map(transform, range(0, samples.shape[0], _CHIRPS_PER_BATCH))
    return spectra


def checked_chirps(what: str, values: ArrayLike, radar: Radar) -> NDArray[np.generic]:
    """Values (chirp, rx, sample or range) as an array; InputError if they are none of the radar."""
    chirps, needed = np.asarray(values), (radar.n_rx, radar.samples_per_chirp)
    if chirps.ndim != 3 or chirps.shape[1:] != needed:
        raise InputError(
            f"{what} have shape {chirps.shape}; radar '{radar.name}' needs (chirp, rx, "
            f"{'sample' if what == 'IF samples' else 'range'}) = (any, {needed[0]}, {needed[1]})"
        )
    if chirps.dtype.kind not in "fc":
        raise InputError(f"{what} are of type {chirps.dtype}; they must be complex numbers")
    return chirps


def whole_cycles(where: str, chirps: NDArray[np.generic], radar: Radar) -> int:
    """Whole TDM cycles of chirps; InputError where there is none, or a value is not finite."""
    if len(chirps) < radar.n_tx:
        raise InputError(
            f"{where}: {len(chirps)} chirps hold no whole TDM cycle; give at least {radar.n_tx}, "
            "one for each Tx"
        )
    if not np.isfinite(chirps).all():
        raise InputError(f"{where}: x holds NaN or infinity; every IF sample must be finite")
    return len(chirps) // radar.n_tx


def checked_frame(where: str, spectra: ArrayLike, radar: Radar) -> NDArray[np.complexfloating]:
    """Spectra (cycle, tx, rx, range) of a frame; InputError if they are none of the radar."""
    cube, shape = np.asarray(spectra), (radar.n_tx, radar.n_rx)
    if cube.ndim != 4 or cube.shape[1:3] != shape or len(cube) < 1 or cube.dtype.kind not in "fc":
        raise InputError(
            f"{where}: spectra have shape {cube.shape}, type {cube.dtype}; radar '{radar.name}' "
            f"needs complex (cycle, tx, rx, range) = (>= 1, {shape[0]}, {shape[1]}, any)"
        )
    return cube


def check_channel(where: str, channel: int, radar: Radar) -> None:
    """Raise InputError where a radar has no such channel."""
    if not 0 <= channel < radar.n_channels:
        raise InputError(
            f"{where}: channel = {channel}; radar '{radar.name}' has channels 0 to "
            f"{radar.n_channels - 1}"
        )


def complex_kind(values: NDArray[np.generic]) -> type[np.complex64] | type[np.complex128]:
    """Complex numbers as precise as the values."""
    return np.complex64 if values.dtype in (np.complex64, np.float32) else np.complex128


def cell_spectra(
    spectra: NDArray[np.complexfloating],
    radar: Radar,
    range_bins: ArrayLike,
    velocity_bins: ArrayLike,
    *,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
) -> NDArray[np.complexfloating]:
    """Complex values of chosen cells in every channel, with those of the range bins beside them.

    An echo from the side reaches the ends of the array sooner and later than the middle, by more
    than a range bin: some channels have it in the neighbours of its cell. A frame has some hundred
    detected cells among 30 000 to 170 000, in a few dozen range bins; only these are transformed.

    Parameters
    ----------
    spectra : (cycle, tx, rx, range) complex
        Range spectra of one frame, from `range_spectrum`.
    radar : Radar
        Radar that gives the shape.
    range_bins, velocity_bins : (cell,) int
        Indices of the cells in the map of `power_map`: velocity ascending, zero at
        ``n_cycles // 2``.
    window_functions : WindowFunctions
        Window functions, of which that in slow time is applied.

    Returns
    -------
    (cell, offset, channel) complex
        What `range_doppler` gives at range bins ``-walk`` to ``+walk`` about each cell, where walk
        is `range_walk` of the radar: offset ``walk`` is the cell itself; past the end of the range
        axis it goes on at the other. In the precision of ``spectra``, with coherent gain 1; channel
        = tx * n_rx + rx. The phase that a moving echo gains between the Tx of one cycle is left in.

    Raises
    ------
    InputError
        Where the shape does not fit the radar, the cells are no whole numbers within the map, or
        the radar has no line of channels to measure an angle.
    """
    cube = checked_frame("cell_spectra", spectra, radar)
    if cube.dtype.kind != "c":
        raise InputError(f"cell_spectra: spectra are of type {cube.dtype}; they must be complex")
    n_cycles, n_range = cube.shape[0], cube.shape[3]
    # The cells, as bins of range and velocity in the map.
    rows = _indices(range_bins, n_range, "range_bins")
    columns = _indices(velocity_bins, n_cycles, "velocity_bins")
    if rows.shape != columns.shape:
        raise InputError(
            f"cell_spectra: {len(rows)} range_bins and {len(columns)} velocity_bins; give one of "
            "each for a cell"
        )
    # The range bins about each cell; the range axis is a DFT, and goes on from its end to its
    # beginning.
    walk = range_walk(radar)
    steps = (rows[:, None] + np.arange(-walk, walk + 1)) % n_range
    # Index 0 of the map is the DFT bin of the most negative velocity.
    turns = (columns - n_cycles // 2) % n_cycles
    values = np.empty((*steps.shape, radar.n_channels), dtype=cube.dtype)
    scale = weights(window_functions.doppler, n_cycles).astype(cube.real.dtype)
    dft = prime_factor_dft(n_cycles) if cube.dtype == np.complex64 else None
    channels = np.ascontiguousarray(cube).reshape(n_cycles, radar.n_channels, n_range)
    # Cells share range bins. Each bin that occurs is transformed once.
    used, place = np.unique(steps, return_inverse=True)
    place = place.reshape(steps.shape)
    if dft is not None:
        cells = turns, place, used
        # Channels of one Tx lie side by side in what is filled.
        thread_map(
            lambda first: pick_cells(
                channels, range(first, first + radar.n_rx), scale, dft, cells, values
            ),
            range(0, radar.n_channels, radar.n_rx),
        )
        return values

    def transform(channel: int) -> None:
        # One channel at a time fits the cache of a core.
        weighted = channels[:, channel, used] * scale[:, None]
        doppler = scipy.fft.fft(weighted, axis=0, overwrite_x=True)
        values[:, :, channel] = doppler[turns[:, None], place]

    thread_map(transform, range(radar.n_channels))
    return values


def _indices(bins: ArrayLike, n: int, name: str) -> NDArray[np.int64]:
    indices = np.asarray(bins)
    if indices.ndim == 1 and indices.size == 0:
        return np.zeros(0, dtype=np.int64)
    whole = indices.ndim == 1 and indices.dtype.kind in "iu"
    if not whole or indices.min() < 0 or indices.max() >= n:
        raise InputError(f"cell_spectra: {name} must be whole numbers (cell,) from 0 to {n - 1}")
    return indices.astype(np.int64)
