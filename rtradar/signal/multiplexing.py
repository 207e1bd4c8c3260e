"""What one receiver hears of Tx that transmit at once, and how it is parted again.

Samples stand in rows, one for each chirp of each Tx, ``(chirp, rx, sample)``, for all that makes echoes and for all that
processes them. Under TDM and FDM these are what is received, for the bands of FDM are parted by filters. Under DDM (Doppler
division; Sun, Petropulu and Poor, IEEE Signal Processing Magazine 37(4), 2020) a receiver gets the sum of all Tx, each turned by
its code from chirp to chirp; `separate` turns the sum back by the code of one Tx after the other. In the row of a Tx its own
echoes then stand at their Doppler frequency and those of the others whole bands away from it, where
`rtradar.process.doppler_division` finds them out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar


def codes(radar: Radar, first_chirp: int, count: int) -> NDArray[np.complex64]:
    """Codes of DDM for ``count`` chirps from ``first_chirp`` on, a cycle's first: exp(j 2 pi k p / D), (cycle, tx)."""
    cycles = first_chirp // radar.n_tx + np.arange(count // radar.n_tx)
    # The product is a whole number, so the phase is exact however long the capture is.
    steps = np.outer(cycles, np.arange(radar.n_tx)) % radar.n_doppler_bands
    return np.exp(2j * np.pi * steps / radar.n_doppler_bands).astype(np.complex64)


def receive(
    samples: NDArray[np.complexfloating], radar: Radar, first_chirp: int
) -> NDArray[np.complexfloating]:
    """What the receivers get.

    Parameters
    ----------
    samples : (chirp, rx, sample) complex
        IF samples of each Tx alone, from `synthesize`: whole cycles.
    radar : Radar
    first_chirp : int
        Number of the first in the capture.

    Returns
    -------
    (chirp, rx, sample) complex
        ``samples`` themselves; under DDM a row for each cycle, the coded sum over the Tx.
    """
    if radar.multiplexing != "ddm":
        return samples
    cube = samples.reshape(-1, radar.n_tx, *samples.shape[1:])
    coded = np.einsum("ct,ctrs->crs", codes(radar, first_chirp, len(samples)), cube, optimize=False)
    return np.asarray(coded, dtype=samples.dtype)


def separate(
    received: NDArray[np.complexfloating], radar: Radar, first_chirp: int
) -> NDArray[np.complexfloating]:
    """Rows for each Tx from what the receivers got.

    Parameters
    ----------
    received : (row, rx, sample) complex
        As `receive` gives it, noise added.
    radar : Radar
    first_chirp : int
        Index of the first chirp of the block in the capture, see `receive`.

    Returns
    -------
    (chirp, rx, sample) complex
        ``received`` itself; under DDM ``n_tx`` rows for each of it, turned back by the code of each Tx.
    """
    if radar.multiplexing != "ddm":
        return received
    turned = codes(radar, first_chirp, len(received) * radar.n_tx).conj()
    rows = turned[:, :, None, None] * received[:, None]
    return np.asarray(rows.reshape(-1, *received.shape[1:]), dtype=received.dtype)
