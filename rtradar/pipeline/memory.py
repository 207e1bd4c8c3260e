"""Size of maps and IF samples in memory, and its limit, which is checked before any work."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rtradar.body import Person
from rtradar.errors import InputError
from rtradar.pipeline.processing import RANGE_TIME_S
from rtradar.process import angle_grid, measured_angles
from rtradar.radar import Radar
from rtradar.settings import RunSettings

MEMORY_LIMIT_BYTES = 4_000_000_000
"""Largest size of what is held in memory, maps or IF samples [byte].

It is that of maps of about three minutes, or IF samples of 15 s, of the radar ``paper-12ghz``.
"""

IN_A_FOLDER = "give a folder, out=, and they are written there as they are computed"
"""How the limit is passed for maps."""


def refuse_large(what: str, n_bytes: float, instead: str) -> None:
    """Raise an `InputError` if something would take more than the limit of memory."""
    if n_bytes > MEMORY_LIMIT_BYTES:
        raise InputError(
            f"{what} would take {n_bytes / 1e9:.1f} GB in memory, and at most "
            f"{MEMORY_LIMIT_BYTES / 1e9:.1f} GB are allowed; {instead}"
        )


def refuse_large_maps(people: Sequence[Person], radar: Radar, settings: RunSettings) -> None:
    """Raise an `InputError` if maps of this run are too large for memory."""
    left = [person.motion.duration_s - person.start_s - settings.start_s for person in people]
    asked = settings.duration_s
    if not left and asked is None:
        return  # refused where people are placed
    interval_s = max(min(left) if asked is None else min(max(left, default=asked), asked), 0.0)
    if math.isnan(interval_s):
        return  # a start or duration that is none is refused where people are placed
    n_bytes = bytes_of_maps(radar, radar.chirps_in(interval_s), sources=True)
    refuse_large(f"maps of {interval_s:g} s of radar '{radar.name}'", n_bytes, IN_A_FOLDER)


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
