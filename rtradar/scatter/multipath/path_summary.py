"""What became of the echoes over each path: their power, and which were kept."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.scatter.multipath.image_paths import WallPath

MARGIN_DB = 10.0
"""Echoes of a room are left out where they are further below the noise than this [dB]."""


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

    By echo: whether it takes this path and whether it is kept, its power [m^2], the name of its
    part, and whether it is among the ``weakest``, which a tolerance leaves out. ``noise`` is the
    noise power over the gain of processing [m^2].
    """
    total = float(power[own].sum())
    lost = own & ~keep
    why = []
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
