"""Ghosts: where the echoes over walls show, and their power."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rtradar.radar import Radar
from rtradar.scatter.multipath.room_model import RoomModel

_STEP_CYCLES = 4
"""TDM cycles over which the velocity of a ghost is measured."""


class Ghost(NamedTuple):
    """Where the echoes over a path show, and their power."""

    path: str
    range_m: float
    velocity_mps: float
    azimuth_rad: float
    power_m2: float


def ghosts(model: RoomModel | None, radar: Radar, time_s: float) -> list[Ghost]:
    """Find where the echoes over walls show at one time [s], path by path.

    Each is the mean of its parts, weighted by their power. The azimuth is that from which the last
    leg comes, or that of its antenna's image mirrored back. Without a model, of nobody in a room,
    there are none.
    """
    if model is None:
        return []
    cycle, step = round(time_s / radar.cycle_duration_s - _STEP_CYCLES / 2), _STEP_CYCLES
    if radar.frame_period_s is not None:
        step = min(step, max(radar.cycles_per_frame - 1, 1))
        cycle = math.floor(time_s / radar.frame_period_s) * radar.cycles_per_frame
    chirps = (max(cycle, 0) + np.array([0, step])) * radar.n_tx
    echoes = model.echoes(chirps)
    power = (np.abs(echoes.amplitude) ** 2).mean(axis=(0, 1, 2))
    length = echoes.length.mean(axis=1)
    rate = (length[1] - length[0]) / (step * radar.cycle_duration_s)
    # The direction follows from the slope of the lengths over the receivers, in the radar's axes.
    places = radar.rx_m[radar.rx_of_tx[0], 1:]
    slope = np.linalg.pinv(places - places.mean(axis=0), rcond=1e-6)[0] @ echoes.length[0]
    azimuth = np.arcsin(np.clip(-slope, -1, 1))
    values = np.stack([length.mean(axis=0) / 2, rate / 2, azimuth])
    found = []
    for path in dict.fromkeys(echoes.path.tolist()):
        own = (echoes.path == path) & (echoes.bounces > 1) & (power > 0)
        if own.any():
            total = float(power[own].sum())
            range_m, rate_mps, angle = (values[:, own] @ (power[own] / total)).tolist()
            found.append(Ghost(model.path_names[path], range_m, rate_mps, angle, total))
    return found
