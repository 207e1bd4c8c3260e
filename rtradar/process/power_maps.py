"""Range spectra to the range-Doppler power that CFAR reads, also under Doppler division.

Doppler division: the sum of all Tx, transformed over slow time, has D bands; an echo at Doppler bin
d lies in bins d + k P / D for Tx k, P the bins of the whole axis. Adding the power of those n bins
up for every d gives a map in which the echo has copies whole bands away, (n - 1) / n, (n - 2) / n,
... as strong. Empty bands tell them apart: of the D places where the block of n filled bands could
begin, the one with most power in it is taken, and the copies lose what that echo explains; the mean
of the empty bands replaces it.

Parts of a body interfere, so a Tx may receive next to nothing of an echo in one cell; where the
block begins is therefore decided for the cells about it together, as far as the main lobes of the
window functions spread an echo. Of two echoes so near each other in range and, but for a whole
number of bands, in speed, the weaker is taken for a copy: a person who moves in more than one
band's width of speeds at one range needs fewer bands or shorter chirps.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.kernels.prime_factor_dft import add_doppler_power, prime_factor_dft
from rtradar.process.spectra import check_channel, checked_frame, complex_kind
from rtradar.process.window_functions import DEFAULT_WINDOWS, WindowFunctions, weights
from rtradar.radar import Radar
from rtradar.system.threads import thread_map

_CHANCE = 1e-3
"""Chance that noise alone passes for an echo, whose copies are removed, on the Doppler axis of a
range bin. Detections in noise are rarer."""


def power_map(
    spectra: NDArray[np.complexfloating],
    radar: Radar,
    *,
    channel: int | None = None,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
) -> NDArray[np.floating]:
    """Range-Doppler power of one frame: squared magnitudes summed over channels, or of one channel.

    Parameters
    ----------
    spectra : (cycle, tx, rx, range) complex
        Range spectra of whole TDM cycles, from `range_spectrum`.
    radar : Radar
        Radar that gives the shape.
    channel : int, optional
        Index tx * n_rx + rx of the only channel; all channels when left out.
    window_functions : WindowFunctions
        Window functions of the range spectra and in slow time. Only that in slow time is applied
        here; under DDM both tell how far an echo spreads over cells.

    Returns
    -------
    (range, velocity) float32 or float64
        Power in the precision of ``spectra``; velocity as in `RangeDoppler`. With complex Gaussian
        noise a cell follows the Gamma law of as many looks as there are channels in the sum. Under
        DDM the copies of an echo are removed, except from a single channel.

    Raises
    ------
    InputError
        Where the shape does not fit the radar, or there is no such channel.
    """
    # One row for each virtual channel, in which the Doppler transform runs over cycles.
    cube = checked_frame("power_map", spectra, radar)
    if channel is not None:
        check_channel("power_map", channel, radar)
    n_cycles, _, _, n_range = cube.shape
    scale = weights(window_functions.doppler, n_cycles)
    channels = np.ascontiguousarray(cube).reshape(n_cycles, radar.n_channels, n_range)
    divided = channel is None and radar.multiplexing == "ddm"
    if channel is not None:
        chosen = range(channel, channel + 1)
    else:
        # Under DDM the rows of all Tx hold the same sum; those of the first are not rotated.
        chosen = range(radar.n_rx if divided else radar.n_channels)
    power = doppler_power(channels, chosen, scale, radar.n_rx)
    if divided:
        power = without_copies(power, radar, radar.n_rx, window_functions)
    # Zero velocity to the middle, and range first.
    return np.ascontiguousarray(np.fft.fftshift(power, axes=0).T)


def doppler_power(
    channels: NDArray[np.complexfloating], chosen: range, window: NDArray[np.float64], together: int
) -> NDArray[np.floating]:
    """Power (doppler, range) of chosen ``channels (cycle, channel, range)``, some to a thread.

    Samples are weighted by the ``window (cycle,)``; Doppler is in the order of the DFT.
    """
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
    first, *others = thread_map(power_of, chosen[::together])
    for power in others:
        first += power
    return first


def without_copies(
    band_power: NDArray[np.floating],
    radar: Radar,
    receivers: int,
    window_functions: WindowFunctions,
) -> NDArray[np.floating]:
    """Power (doppler, range) of all Tx together, each echo at its own Doppler only.

    ``band_power (doppler, range)`` is that of the sum over slow time, in the order of the DFT, of
    so many ``receivers`` together. An `InputError` is raised where the Doppler axis does not divide
    into the bands.
    """
    bands, n_tx = radar.n_doppler_bands, radar.n_tx
    if len(band_power) % bands:
        raise InputError(
            f"Doppler division of radar '{radar.name}': {len(band_power)} cycles do not divide "
            f"into {bands} bands; take a multiple of {bands}"
        )
    from scipy.ndimage import maximum_filter  # here, because SciPy is slow to import
    from scipy.special import gammainccinv, gammaincinv

    # The Doppler axis as bands, and for each band the power of the block of n_tx bands that begins
    # there: an echo at its own place fills such a block.
    power = band_power.reshape(bands, -1, band_power.shape[1])
    filled = _block_sums(power, n_tx)
    spread = window_functions.main_lobe_bins
    # The block of bands with most power in and about each cell, and its power in the cell.
    begin = _block_sums(_about(band_power, spread).reshape(power.shape), n_tx).argmax(axis=0)
    strongest = np.take_along_axis(filled, begin[None], axis=0)[0]
    # What the bands outside of the block hold is noise.
    empty = (power.sum(axis=0) - strongest) / (bands - n_tx)
    usual = np.median(filled, axis=(0, 1))
    # An echo stands out of the median by more than noise does, which has a Gamma law of so many
    # looks.
    looks = n_tx * receivers
    place = (np.arange(bands)[:, None, None] - begin) % bands
    echo = strongest > usual * float(gammainccinv(looks, _CHANCE / bands) / gammaincinv(looks, 0.5))
    # The skirts of an echo have copies, too, weaker than what passes for an echo by itself.
    echoes = ((place == 0) & echo).reshape(band_power.shape)
    size = [2 * bins + 1 for bins in spread]
    near = maximum_filter(echoes, size=size, mode=("wrap", "nearest")).reshape(power.shape)
    echo = np.take_along_axis(near, begin[None], axis=0)[0]
    # Band by band: with what power the echo fills bands of the copy that begins there.
    copies = _block_sums(np.where(place < n_tx, power - empty, 0), n_tx)
    # Few looks are left in a copy's place, and their tail must not be detected: no more remains
    # than what is usual at that range.
    left = np.where(echo & (place != 0), np.clip(filled - copies, 0, usual), filled)
    return np.asarray(left.reshape(band_power.shape))


def _block_sums(power: NDArray[np.floating], count: int) -> NDArray[np.floating]:
    """Sum of so many bands from each band on, around the axis (band, ...)."""
    return sum((np.roll(power, -k, axis=0) for k in range(1, count)), power)


def _about(power: NDArray[np.floating], spread: tuple[int, int]) -> NDArray[np.floating]:
    """Sum over the cells about each one (doppler, range)."""
    for axis, bins in enumerate(spread):
        steps = range(-bins, bins + 1)
        power = sum((np.roll(power, step, axis=axis) for step in steps), np.zeros_like(power))
    return power
