"""Traits by which synthetic subjects differ."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True)
class Traits:
    """A subject's way of moving.

    Parameters
    ----------
    height_m : float
        Standing height [m].
    side : {"l", "r"}
        Side of the leg or hand that acts, or of the foot that steps first.
    tempo, amplitude : float
        Relative to the nominal actor, the subject's own few percent included.
    phase : float
        Fraction of a step, or of the first rest, at which the movement begins, 0 to 1.
    uneven : mapping of side to float
        Strength of each side, near 1.
    """

    height_m: float
    side: str
    tempo: float
    amplitude: float
    phase: float
    uneven: Mapping[str, float]

    @property
    def other(self) -> str:
        """The side that does not act."""
        return "r" if self.side == "l" else "l"

    @property
    def cycle_s(self) -> float:
        """Duration of two steps [s], 1.1 s at 1.75 m; it grows with the root of the height."""
        return 1.1 * math.sqrt(self.height_m / 1.75) / self.tempo

    @property
    def step_m(self) -> float:
        """One step of a walk [m]: 0.375 of the height."""
        return 0.375 * self.height_m * self.amplitude

    @property
    def track_m(self) -> float:
        """Distance of the footprints from the middle line [m]."""
        return 0.038 * self.height_m

    @property
    def clearance_m(self) -> float:
        """Height to which a swinging foot is lifted [m]."""
        return 0.042 * self.height_m

    @property
    def arm_swing_rad(self) -> float:
        """Half the arc of a walking arm [rad]."""
        return math.radians(20) * self.amplitude


def draw_traits(
    rng: np.random.Generator, *, height_m: float, side: str, tempo: float, amplitude: float
) -> Traits:
    """Draw a subject: 3 % of spread (cut at two sigma) on tempo, amplitude and each side."""
    spread = 1 + 0.03 * np.clip(rng.standard_normal(4), -2.0, 2.0)
    return Traits(
        height_m=height_m,
        side=side,
        tempo=tempo * float(spread[0]),
        amplitude=amplitude * float(spread[1]),
        phase=float(rng.uniform()),
        uneven={"l": float(spread[2]), "r": float(spread[3])},
    )
