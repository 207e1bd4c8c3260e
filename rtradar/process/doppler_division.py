"""Which of the copies that Doppler division makes of an echo is the echo.

The sum of all Tx, transformed over slow time, has D bands; an echo at Doppler bin d stands in bins d + k P / D for Tx k, P the
bins of the whole axis. Adding the power of those n bins up for every d gives a map in which the echo has copies whole bands away,
(n - 1) / n, (n - 2) / n, ... as strong. Empty bands tell them apart: of the D places where the block of n filled bands could
begin, the one with most power in it is taken, and the copies lose what that echo explains; the mean of the empty bands comes in
its place.

Parts of a body interfere, so a Tx may see next to nothing of an echo in one cell; where the block begins is therefore asked of
the cells about it together, as far as the main lobes of the window functions spread an echo. Of two echoes so near each other in range
and, but for a whole number of bands, in speed, the weaker is taken for a copy: whoever moves in more than one band's width of
speeds at one range needs fewer bands or shorter chirps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter
from scipy.special import gammainccinv, gammaincinv

from rtradar.errors import InputError
from rtradar.process.window_functions import HANN, WindowFunctions
from rtradar.radar import Radar

_CHANCE = 1e-3
"""That noise alone passes for an echo, whose copies are taken out, somewhere on the Doppler axis. What is detected is rarer."""


def without_copies(
    band_power: NDArray[np.floating],
    radar: Radar,
    receivers: int,
    window_functions: WindowFunctions = HANN,
) -> NDArray[np.floating]:
    """Power of all Tx together, each echo at its own Doppler only.

    Parameters
    ----------
    band_power : (doppler, range) float
        Power of the sum over slow time, in the order of the DFT; of one or more Rx together.
    radar : Radar
        Under DDM.
    receivers : int
        Rx whose power is summed.
    window_functions : WindowFunctions
        Window functions of the power. Their main lobes tell how far an echo spreads over cells.

    Returns
    -------
    (doppler, range) float
        In the same order: of one echo, what the Tx give together.

    Raises
    ------
    InputError
        Where the Doppler axis does not divide into the bands.
    """
    bands, n_tx = radar.n_doppler_bands, radar.n_tx
    if len(band_power) % bands:
        raise InputError(
            f"Doppler division of radar '{radar.name}': {len(band_power)} cycles do not divide into {bands} bands; "
            f"take a multiple of {bands}"
        )
    power = band_power.reshape(bands, -1, band_power.shape[1])
    filled = _block_sums(power, n_tx)
    spread = window_functions.main_lobe_bins
    begin = _block_sums(_about(band_power, spread).reshape(power.shape), n_tx).argmax(axis=0)
    strongest = np.take_along_axis(filled, begin[None], axis=0)[0]
    empty = (power.sum(axis=0) - strongest) / (bands - n_tx)
    usual = np.median(filled, axis=(0, 1))
    looks = n_tx * receivers
    place = (np.arange(bands)[:, None, None] - begin) % bands
    echo = strongest > usual * float(gammainccinv(looks, _CHANCE / bands) / gammaincinv(looks, 0.5))
    # Its skirts have copies, too, weaker than what passes for an echo by itself.
    echoes = ((place == 0) & echo).reshape(band_power.shape)
    size = [2 * bins + 1 for bins in spread]
    near = maximum_filter(echoes, size=size, mode=("wrap", "nearest")).reshape(power.shape)
    echo = np.take_along_axis(near, begin[None], axis=0)[0]
    # Band by band: how many filled bands of the copy that begins there the echo explains, and with what power.
    explained = np.where(place < n_tx, power - empty, 0)
    copies = _block_sums(explained, n_tx)
    # Few looks are left in a copy's place, and their tail must not be detected: no more than what is usual at that range.
    left = np.where(echo & (place != 0), np.clip(filled - copies, 0, usual), filled)
    return np.asarray(left.reshape(band_power.shape))


def _block_sums(power: NDArray[np.floating], count: int) -> NDArray[np.floating]:
    """Of so many bands from each band on, around the axis (band, ...)."""
    total = power.copy()
    for k in range(1, count):
        total += np.roll(power, -k, axis=0)
    return total


def _about(power: NDArray[np.floating], spread: tuple[int, int]) -> NDArray[np.floating]:
    """Sum over the cells about each one (doppler, range)."""
    for axis, bins in enumerate(spread):
        power = sum(
            (np.roll(power, step, axis=axis) for step in range(-bins, bins + 1)),
            np.zeros_like(power),
        )
    return power
