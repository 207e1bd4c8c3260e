"""Run view: data of a run for the page of ``rtradar view`` and its still pictures."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds.spatial import SpatialCloud
from rtradar.radar import Radar
from rtradar.report.figures.canvas import FieldUnit, field_unit
from rtradar.report.view.snapshots import Moments

GROUPS = {
    "head, neck": "#cc79a7",
    "torso": "#3f7fd1",
    "left arm": "#56b4e9",
    "right arm": "#009e73",
    "left leg": "#e69f00",
    "right leg": "#d55e00",
    "no part near": "#8c8c94",
}
"""Names and colours of the groups of body parts; the last is for what belongs to none."""

_ARM = ("clavicle", "upper arm", "forearm", "hand")


def group_of_parts(parts: Sequence[str]) -> list[int]:
    """Return the index in `GROUPS` of each part's group."""
    names = list(GROUPS)
    found = []
    for part in parts:
        side, _, limb = part.partition(" ")
        group = "torso" if "torso" in part else "head, neck"
        if side in ("left", "right"):
            group = f"{side} {'arm' if limb in _ARM else 'leg'}"
        found.append(names.index(group))
    return found


MOST_LEVEL = 250
"""Highest quantised level."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Levels:
    """Maps in decibels, quantised coarsely so that a page stays small.

    ``level`` (map, row, column) means ``low_db + step_db level`` [dB]; ``label`` is that of a
    colour bar; ``across`` and ``up`` are the value of the first column or row and the step to the
    next.
    """

    level: NDArray[np.uint8]
    low_db: float
    step_db: float
    label: str
    across: tuple[float, float]
    up: tuple[float, float]

    @property
    def high_db(self) -> float:
        """Power of the highest level of the colour scale [dB]."""
        return self.low_db + self.step_db * MOST_LEVEL

    def packed(self) -> dict[str, Any]:
        """Return plain values for JSON; ``levels`` are compressed by zlib and encoded in base64."""
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


_NEAREST_BINS = 4.0  # a point of the cloud farther from any echo belongs to none


@dataclass(frozen=True, kw_only=True, eq=False)
class RunView:
    """Data of a run that the view page and its still pictures show.

    ``moments`` are snapshots of body and echoes, and ``radar`` is at its position in the scene.
    ``range_doppler`` has one map, the mean of the channels, for each snapshot; ``spectrogram`` one
    map, time across and velocity up, without columns if the capture is too short. ``rdt_points``
    (point, 3) are time [s], range [m] and velocity [m/s], and ``rdt_power_db`` (point,) the power
    of the range-Doppler map there, in its unit [dB].
    """

    heading: str
    subtitle: str
    moments: Moments
    radar: Radar
    range_doppler: Levels
    spectrogram: Levels
    rdt_points: NDArray[np.float64]
    rdt_power_db: NDArray[np.float64]
    spatial: SpatialCloud
    spreading: bool = True

    @property
    def power_unit(self) -> FieldUnit:
        """Unit of the power of each echo (step, echo), the same as of the range-Doppler map."""
        return field_unit(self.radar, spreading=self.spreading, range_m=self.moments.range_m)

    @property
    def power_db(self) -> NDArray[np.float64]:
        """Power of each echo (step, echo) in `power_unit` [dB]; NaN if it is occluded."""
        power = self.moments.power_m2
        return np.where(power > 0, self.power_unit.level(power), np.nan)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Whether each echo (step, echo) is above the floor of the maps."""
        return np.asarray(np.nan_to_num(self.power_db, nan=-np.inf) >= self.range_doppler.low_db)

    @property
    def power_range_db(self) -> tuple[float, float]:
        """Limits of the colour scale [dB], from the floor of the maps to the strongest echo."""
        low_db = self.range_doppler.low_db
        return low_db, float(np.nanmax(self.power_db, initial=low_db + 1.0))

    @property
    def fastest_mps(self) -> float:
        """Largest range rate of the colour scale [m/s]."""
        rates = [*np.abs(self.moments.velocity_mps[self.seen]), *np.abs(self.rdt_points[:, 2]), 0.1]
        return float(max(rates))

    def shown_box(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the limits in velocity [m/s] and range [m] of echoes and points, with a margin."""
        moments, levels = self.moments, self.range_doppler

        def box(
            values: NDArray[np.float64], column: int, margin: float, axis: tuple[float, float]
        ) -> tuple[float, float]:
            (first, step), count = axis, levels.level.shape[column]
            least, most = first - step / 2, first + step * (count - 0.5)
            inside = np.concatenate([values[self.seen], self.rdt_points[:, column]])
            inside = inside[(inside >= least) & (inside <= most)]
            if not len(inside):
                return least, most
            low, high = float(inside.min()) - margin, float(inside.max()) + margin
            return max(least, low), min(most, high)

        velocity = box(self.shown_velocity(), 2, 1.0, levels.across)
        return velocity, box(moments.range_m, 1, 0.5, levels.up)

    def shown_velocity(self) -> NDArray[np.float64]:
        """Return the aliased velocity of each echo (step, echo) [m/s], as on the velocity axis."""
        most = self.radar.max_velocity_mps
        return np.asarray((self.moments.velocity_mps + most) % (2 * most) - most)

    def rdt_group(self) -> NDArray[np.int64]:
        """Return the group of body parts of each point (point,), that of the nearest echo."""
        moments, radar = self.moments, self.radar
        steps = np.abs(self.rdt_points[:, :1] - moments.times).argmin(axis=1)
        groups = np.array(group_of_parts(moments.part_names.tolist()))[moments.echo_part]
        seen, velocity = self.seen, self.shown_velocity()
        found = np.full(len(steps), len(GROUPS) - 1)
        for point, step in enumerate(steps):
            own = np.flatnonzero(seen[step])
            if len(own):
                bins = np.hypot(
                    (moments.range_m[step, own] - self.rdt_points[point, 1]) / radar.range_bin_m,
                    (velocity[step, own] - self.rdt_points[point, 2]) / radar.velocity_bin_mps,
                )
                if bins.min() <= _NEAREST_BINS:
                    found[point] = groups[own[bins.argmin()]]
        return found
