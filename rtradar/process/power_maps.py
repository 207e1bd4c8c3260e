"""Range spectra to power: over range and time, and the range-Doppler map that CFAR reads."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.kernels.prime_factor_dft import add_doppler_power, prime_factor_dft
from rtradar.process.doppler_division import without_copies
from rtradar.process.spectra import complex_kind
from rtradar.process.window_functions import HANN, WindowFunctions, weights
from rtradar.radar import Radar
from rtradar.system.threads import in_threads


def range_time(
    spectra: NDArray[np.complexfloating],
    radar: Radar,
    *,
    first_chirp: int = 0,
    step_s: float = 5e-3,
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
        Power of each range bin, in the unit of the squared IF.
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
    bounds, times = range_time_steps(len(chirps), radar, first_chirp, step_s)
    power = in_threads(
        lambda step: mean_power(chirps[slice(*bounds[step])]) / together, range(len(bounds))
    )
    return np.array(power, dtype=chirps.real.dtype).reshape(len(power), chirps.shape[2]), times


def step_cycles(radar: Radar, step_s: float) -> int:
    """TDM cycles in one step of `range_time`."""
    return max(1, round(step_s / radar.cycle_duration_s))


def range_time_steps(
    n_chirps: int, radar: Radar, first_chirp: int, step_s: float
) -> tuple[list[tuple[int, int]], NDArray[np.float64]]:
    """First chirp of each step of `range_time` and the one after its last, and centres of the steps (step,) [s]."""
    rows = step_cycles(radar, step_s) * radar.n_tx
    begins = np.arange(0, n_chirps, rows)
    ends = np.minimum(begins + rows, n_chirps)
    return list(zip(begins.tolist(), ends.tolist(), strict=True)), (
        first_chirp + (begins + ends) / 2
    ) * radar.chirp_interval_s


def mean_power(values: NDArray[np.complexfloating]) -> NDArray[np.floating]:
    """Squared magnitude of ``values (..., range)``, averaged over all axes but the last."""
    # Row by row: no squares of a whole block are kept.
    parts = np.ascontiguousarray(values).view(values.real.dtype).reshape(-1, 2 * values.shape[-1])
    return np.asarray(np.einsum("ri,ri->i", parts, parts).reshape(-1, 2).sum(axis=1) / len(parts))


def power_map(
    spectra: NDArray[np.complexfloating],
    radar: Radar,
    *,
    channel: int | None = None,
    window_functions: WindowFunctions = HANN,
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
    window_functions : WindowFunctions
        Window functions of the range spectra and in slow time. Only that in slow time is applied here; under DDM both tell
        how far an echo spreads over cells.

    Returns
    -------
    (range, velocity) float32 or float64
        Power in the precision of ``spectra``; velocity as in `RangeDoppler`. With complex Gaussian noise a cell follows
        the Gamma law of as many looks as there are channels in the sum. Under DDM the copies of an echo are removed,
        except from a single channel.

    Raises
    ------
    InputError
        Where the shape does not fit the radar, or there is no such channel.
    """
    cube = np.asarray(spectra)
    if cube.ndim != 4 or cube.shape[1:3] != (radar.n_tx, radar.n_rx) or cube.shape[0] < 1:
        raise InputError(
            f"power_map: spectra have shape {cube.shape}; radar '{radar.name}' needs "
            f"(cycle, tx, rx, range) = (>= 1, {radar.n_tx}, {radar.n_rx}, any)"
        )
    if channel is not None and not 0 <= channel < radar.n_channels:
        raise InputError(
            f"power_map: channel = {channel}; radar '{radar.name}' has channels 0 to {radar.n_channels - 1}"
        )
    n_cycles, _, _, n_range = cube.shape
    scale = weights(window_functions.doppler, n_cycles)
    channels = np.ascontiguousarray(cube).reshape(n_cycles, radar.n_channels, n_range)
    divided = channel is None and radar.multiplexing == "ddm"
    # Under DDM the rows of all Tx are the same sum; those of the first are not turned.
    chosen = (
        range(radar.n_rx if divided else radar.n_channels)
        if channel is None
        else range(channel, channel + 1)
    )
    power = _doppler_power(channels, chosen, scale, radar.n_rx)
    if divided:
        power = without_copies(power, radar, radar.n_rx, window_functions)
    return np.ascontiguousarray(np.fft.fftshift(power, axes=0).T)


def _doppler_power(
    channels: NDArray[np.complexfloating], chosen: range, window: NDArray[np.float64], together: int
) -> NDArray[np.floating]:
    """Power (doppler, range) of chosen ``channels (cycle, channel, range)``, ``together`` of them in turn in one thread."""
    n_cycles, _, n_range = channels.shape
    kind = complex_kind(channels)
    real = np.float32 if kind == np.complex64 else np.float64
    scale: NDArray[Any] = window.astype(real)
    dft = prime_factor_dft(n_cycles) if kind == np.complex64 else None

    def power_of(first: int) -> NDArray[np.floating]:
        own = range(first, min(first + together, chosen.stop))
        total = np.zeros((n_cycles, n_range), dtype=real)
        if dft is not None:
            add_doppler_power(channels, own, scale, dft, total)
            return total
        for channel in own:
            # One channel at a time fits the cache of a core.
            weighted = np.multiply(channels[:, channel], scale[:, None], dtype=kind)
            parts = scipy.fft.fft(weighted, axis=0, overwrite_x=True).view(real)
            squares = np.square(parts, out=parts)
            total += squares[:, ::2]
            total += squares[:, 1::2]
        return total

    # The order of the sum is fixed, so the map does not depend on the number of threads.
    first, *others = in_threads(power_of, chosen[::together])
    for power in others:
        first += power
    return first
