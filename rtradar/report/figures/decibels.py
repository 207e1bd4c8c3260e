"""Maps in decibels, coarse enough to travel in a page."""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_LEVEL = 250
"""The highest of the steps that a level is told by."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Levels:
    """Maps in decibels, coarse enough to be small.

    Parameters
    ----------
    level : (map, row, column) uint8
        Power is ``low_db + step_db level``.
    low_db, step_db : float
        Lowest level and step from one level to the next [dB].
    label : str
        What they are levels of, with the unit: the label of a colour bar.
    across, up : (float, float)
        Value of the first column or row, and from one to the next.
    """

    level: NDArray[np.uint8]
    low_db: float
    step_db: float
    label: str
    across: tuple[float, float]
    up: tuple[float, float]

    @property
    def high_db(self) -> float:
        """Power of the highest level that colours reach [dB]."""
        return self.low_db + self.step_db * MOST_LEVEL

    def packed(self) -> dict[str, Any]:
        """Ready for JSON; ``levels`` is base64 of what zlib makes of them."""
        return {
            "levels": base64.b64encode(zlib.compress(self.level.tobytes(), 9)).decode(),
            "shape": list(self.level.shape[1:]),
            "x": list(self.across),
            "y": list(self.up),
            "low_db": self.low_db,
            "high_db": self.high_db,
            "step_db": self.step_db,
            "label": self.label,
        }
