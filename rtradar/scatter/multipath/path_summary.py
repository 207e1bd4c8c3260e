"""What became of the echoes over each path: how strong they are, which were kept, and why others were not."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.scatter.multipath.image_paths import WallPath

MARGIN_DB = 10.0
"""What a room returns is left out where it is further below the noise."""


@dataclass(frozen=True)
class PathAccount:
    """What became of the echoes of one path.

    Parameters
    ----------
    path : str
        Walls in the order in which the wave meets them.
    order : int
        Reflections at walls.
    power_m2 : float
        Echo power of all parts, averaged over rx and one chirp every 20 ms [m^2].
    over_noise_db : float or None
        The same over noise, after the gain of samples, cycles and channels; None without noise or without an echo.
    kept, dropped : tuple of str
        Body parts.
    why : str
        Why those were dropped; empty where none was.
    """

    path: str
    order: int
    power_m2: float
    over_noise_db: float | None
    kept: tuple[str, ...]
    dropped: tuple[str, ...]
    why: str

    def row(self) -> dict[str, Any]:
        """For ``summary.json``."""
        return {**self.__dict__, "kept": list(self.kept), "dropped": list(self.dropped)}


def account(
    path: WallPath,
    own: NDArray[np.bool_],
    keep: NDArray[np.bool_],
    power: NDArray[np.float64],
    names: NDArray[Any],
    noise: float,
) -> PathAccount:
    """Account of one path.

    Parameters
    ----------
    path : WallPath
    own, keep, power, names : (echo,)
        Which echoes are of this path, which of all are kept, their power [m^2] and the names of their parts.
    noise : float
        Over the gain of processing [m^2].
    """
    total = float(power[own].sum())
    lost = own & ~keep
    why = []
    if (power[lost] == 0).any():
        why.append(
            "never seen: no specular point in the wall, or in the shadow of furniture or body"
        )
    if (power[lost] > 0).any():
        why.append(f"more than {MARGIN_DB:g} dB below the noise after processing")
    over = 10 * math.log10(total / noise) if total > 0 and noise > 0 else None
    return PathAccount(
        path.name,
        path.order,
        total,
        over,
        tuple(names[own & keep]),
        tuple(names[lost]),
        "; ".join(why),
    )
