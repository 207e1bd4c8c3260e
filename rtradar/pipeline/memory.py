"""Size of maps and IF samples in memory, and its limit, which is checked before any work."""

from __future__ import annotations

import numpy as np

from rtradar.errors import InputError
from rtradar.pipeline.processing import RANGE_TIME_S
from rtradar.process import angle_grid, measured_angles
from rtradar.radar import Radar

MEMORY_LIMIT_BYTES = 4_000_000_000
"""Largest size of what is held in memory, maps or IF samples [byte].

It is that of maps of about three minutes, or IF samples of 15 s, of the radar ``paper-12ghz``.
"""


def refuse_large(what: str, n_bytes: float, instead: str) -> None:
    """Raise an `InputError` if something would take more than the limit of memory."""
    if n_bytes > MEMORY_LIMIT_BYTES:
        raise InputError(
            f"{what} would take {n_bytes / 1e9:.1f} GB in memory, and at most "
            f"{MEMORY_LIMIT_BYTES / 1e9:.1f} GB are allowed; {instead}"
        )


def refuse_large_maps(radar: Radar, n_chirps: int, *, sources: bool = False) -> None:
    """Raise an `InputError` if maps of so many chirps are too large for memory."""
    interval_s = radar.duration_of(n_chirps)
    what = f"maps of {interval_s:.3g} s of radar '{radar.name}'"
    instead = "give a folder, out=, and they are written there as they are computed"
    refuse_large(what, bytes_of_maps(radar, n_chirps, sources=sources), instead)


def bytes_of_maps(radar: Radar, n_chirps: float, *, sources: bool = False) -> float:
    """Estimate the size of the maps of so many chirps [byte], without that of the spectrogram.

    ``sources`` says whether there is a map of who returned each detection.
    """
    frames = max(n_chirps / radar.n_tx - radar.cycles_per_frame, 0) / radar.hop_cycles + 1
    steps = n_chirps * radar.chirp_interval_s / RANGE_TIME_S + radar.in_frames * frames
    power, mask = np.dtype(np.float32).itemsize, np.dtype(np.uint8).itemsize
    if sources:
        mask += np.dtype(np.int16).itemsize
    a_range = radar.cycles_per_frame * (power + mask)
    if angles := measured_angles(radar):
        a_range += len(angles) * len(angle_grid(radar)) * power
    return radar.samples_per_chirp * (frames * a_range + steps * power)
