"""What each receiver gets of several Tx that transmit at once, and how it is separated again.

Samples have a row for each chirp of each Tx, ``(chirp, rx, sample)``, in all that makes and all
that processes them. Under TDM and FDM these rows are what is received, because filters separate the
bands of FDM. Under DDM (Doppler division; Sun, Petropulu and Poor, IEEE Signal Processing Magazine
37(4), 2020) a receiver gets the sum of all Tx, each rotated by its code from chirp to chirp;
`separate` rotates the sum back by the code of one Tx after the other. In the row of a Tx its own
echoes then lie at their Doppler frequency and those of the others whole bands away from it, where
`rtradar.process.power_map` removes them.

Under BPM a row is a chirp of all Tx, which have signs in it; the echoes that make it are summed
already. What moves turns its phase from chirp to chirp, so that `tell_apart` can part the Tx only
in a range-Doppler cell. Its matrix is unitary: the power of a cell is the same before.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar


def codes(radar: Radar, first_chirp: int, count: int) -> NDArray[np.complex64]:
    """DDM codes (cycle, tx), exp(j 2 pi k p / D), of ``count`` chirps from the start of a cycle."""
    cycles = first_chirp // radar.n_tx + np.arange(count // radar.n_tx)
    # The product is a whole number, so the phase is exact however long the capture is.
    steps = np.outer(cycles, np.arange(radar.n_tx)) % radar.n_doppler_bands
    return np.exp(2j * np.pi * steps / radar.n_doppler_bands).astype(np.complex64)


def chirps_together(radar: Radar) -> int:
    """Number of chirps in each row of what `receive` gives: all of a cycle under DDM, else 1."""
    return radar.n_tx if radar.multiplexing == "ddm" else 1


def receive(
    samples: NDArray[np.complexfloating], radar: Radar, first_chirp: int
) -> NDArray[np.complexfloating]:
    """Multiplex the Tx: what the receivers get of samples of each Tx alone.

    Parameters
    ----------
    samples : (chirp, rx, sample) complex
        IF samples of each Tx alone, from `synthesize`: whole cycles.
    radar : Radar
        Radar whose multiplexing is applied.
    first_chirp : int
        Number of the first chirp in the capture.

    Returns
    -------
    (chirp, rx, sample) complex
        ``samples`` themselves; under DDM a row for each cycle, the coded sum over the Tx.
    """
    if radar.multiplexing != "ddm":
        return samples
    # All Tx of a cycle, each turned by its code, arrive as one sum.
    cube = samples.reshape(-1, radar.n_tx, *samples.shape[1:])
    coded = np.einsum("ct,ctrs->crs", codes(radar, first_chirp, len(samples)), cube, optimize=False)
    return np.asarray(coded, dtype=samples.dtype)


def separate(
    received: NDArray[np.complexfloating], radar: Radar, first_chirp: int
) -> NDArray[np.complexfloating]:
    """Demultiplex the Tx: rows for each Tx from what the receivers got.

    Parameters
    ----------
    received : (row, rx, sample) complex
        Samples from `receive`, with noise.
    radar, first_chirp
        What they are for `receive`.

    Returns
    -------
    (chirp, rx, sample) complex
        ``received`` itself; under DDM ``n_tx`` rows for each row, rotated back by each Tx's code;
        under BPM over sqrt(n_tx), so that powers are those of one Tx.
    """
    if radar.multiplexing == "bpm":
        return np.asarray(received / math.sqrt(radar.n_tx), dtype=received.dtype)
    if radar.multiplexing != "ddm":
        return received
    # Turned back by the code of each Tx in turn: the same sum as often as there are Tx.
    back = codes(radar, first_chirp, len(received) * radar.n_tx).conj()
    rows = back[:, :, None, None] * received[:, None]
    return np.asarray(rows.reshape(-1, *received.shape[1:]), dtype=received.dtype)


def tell_apart(values: NDArray[Any], radar: Radar) -> NDArray[np.complexfloating]:
    """Part the Tx of cells (cell, chirp, rx, ...) of chirps from `separate`, under BPM (:eq:`bpm`).

    The phase that motion adds from chirp to chirp has been removed.
    """
    if radar.multiplexing != "bpm":
        return values
    signs = (radar.tx_signs / math.sqrt(radar.n_tx)).astype(values.real.dtype)
    return np.asarray(np.einsum("ct,ic...->it...", signs, values, optimize=False))
