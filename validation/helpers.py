"""Helpers that several scripts share: decibels, root mean squares, and bodies of one ellipsoid.

None of them uses what the scripts judge. A script imports them after this folder has joined
``sys.path``, because each runs by hand from any folder.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body.body import Poses

Array = NDArray[np.float64]


def power_db(ratio: Any) -> Any:
    """Ratio of powers in decibels."""
    return 10 * np.log10(ratio)


def field_db(ratio: Any) -> Any:
    """Ratio of complex fields or amplitudes in decibels."""
    return 20 * np.log10(np.abs(ratio))


def rms(values: Any) -> float:
    """Root mean square of real or complex values."""
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def one_ellipsoid(
    axes: Any, frame: Array | None = None, centre: Array | None = None
) -> rt.Ellipsoids:
    """One ellipsoid of given semi-axes [m], at the origin and along its axes by default."""
    at = np.zeros(3) if centre is None else centre
    return rt.Ellipsoids([at], [np.eye(3) if frame is None else frame], [axes])


@dataclass(frozen=True)
class MovingEllipsoid:
    """A body of one ellipsoid in straight motion, with all that a model needs of a body."""

    centre: tuple[float, float, float]  # at 0 s [m]
    axes: tuple[float, float, float]  # semi-axes [m]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m/s]
    frame: Array | None = None  # columns are the axes; None: those of the world
    duration_s: float = 1.0
    part_names: tuple[str, ...] = ("ellipsoid",)

    @property
    def semi_axes(self) -> Array:
        return np.array([self.axes])

    def at(self, times: Array) -> Poses:
        times = np.atleast_1d(times)
        frame = np.eye(3) if self.frame is None else self.frame
        centres = np.array(self.centre) + times[:, None, None] * np.array(self.velocity)
        return Poses(centres, np.broadcast_to(frame, (len(times), 1, 3, 3)), self.semi_axes)
