"""What became of the echoes over each path: their power, which were kept, and where they show."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar
from rtradar.scatter.multipath.image_paths import WallPath

if TYPE_CHECKING:
    from rtradar.scatter.multipath.room_model import RoomModel

MARGIN_DB = 10.0
"""Echoes of a room are left out where they are further below the noise than this [dB]."""

_STEP_CYCLES = 4
"""TDM cycles over which the velocity of a ghost is measured."""


@dataclass(frozen=True)
class PathSummary:
    """What became of the echoes over one path.

    ``path`` names its walls in the order in which the wave meets them, ``order`` is the number of
    reflections at walls. ``power_m2`` is the echo power of all parts, averaged over rx and the
    chirps that are looked at [m^2]; ``over_noise_db`` the same over noise, after the gain of
    samples, cycles and channels [dB], or None without noise or without an echo. ``kept`` and
    ``dropped`` are the body parts whose echoes were kept and left out, ``why`` the reason for the
    latter.
    """

    path: str
    order: int
    power_m2: float
    over_noise_db: float | None
    kept: list[str]
    dropped: list[str]
    why: str


def summarize(
    path: WallPath,
    own: NDArray[np.bool_],
    keep: NDArray[np.bool_],
    power: NDArray[np.float64],
    names: NDArray[Any],
    noise: float,
    *,
    weakest: NDArray[np.bool_],
) -> PathSummary:
    """Summarize one path.

    Given for each echo are whether it takes this path and whether it is kept, its power [m^2], the
    name of its part, and whether it is among the ``weakest``, which a tolerance leaves out.
    ``noise`` is the noise power over the gain of processing [m^2].
    """
    total = float(power[own].sum())
    lost = own & ~keep
    why = []
    # Echoes are left out for up to three reasons.
    if (power[lost] == 0).any():
        why.append(
            "never seen: no specular point in the wall, or in the shadow of furniture or body"
        )
    if weakest[lost].any():
        why.append("among the weakest echoes, which together are below the tolerance")
    if (power[lost & ~weakest] > 0).any():
        why.append(f"more than {MARGIN_DB:g} dB below the noise after processing")
    over = 10 * math.log10(total / noise) if total > 0 and noise > 0 else None
    kept, dropped = names[own & keep].tolist(), names[lost].tolist()
    return PathSummary(path.name, path.order, total, over, kept, dropped, "; ".join(why))


# -- where they show -------------------------------------------------------------------------------


class Ghost(NamedTuple):
    """Where the echoes over a path show, and their power."""

    path: str
    range_m: float
    velocity_mps: float
    azimuth_rad: float
    power_m2: float


def ghosts(model: RoomModel | None, radar: Radar, time_s: float) -> list[Ghost]:
    """Find where the echoes over walls show at one time [s], path by path.

    Each ghost is the mean of its parts, weighted by their power. The azimuth is that from which the
    last leg comes. Without a model, when nobody is in the room, there are none.
    """
    if model is None:
        return []
    # Two instants a few cycles apart, within one frame, give the velocity.
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
    # The mean of the echoes over each path, weighted by their power.
    for path in dict.fromkeys(echoes.path.tolist()):
        own = (echoes.path == path) & (echoes.bounces > 1) & (power > 0)
        if own.any():
            total = float(power[own].sum())
            range_m, rate_mps, angle = (values[:, own] @ (power[own] / total)).tolist()
            found.append(Ghost(model.path_names[path], range_m, rate_mps, angle, total))
    return found
