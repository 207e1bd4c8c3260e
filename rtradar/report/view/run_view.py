"""What a run left, as the page of ``rtradar view`` and its stills show it: echoes, maps and clouds of the same moments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds.spatial import SpatialCloud
from rtradar.radar import Radar
from rtradar.report.figures.decibels import Levels
from rtradar.report.figures.field_units import FieldUnit, field_unit
from rtradar.report.figures.part_groups import GROUPS, group_of_parts
from rtradar.report.view.snapshots import Moments

_NEAREST_BINS = 4.0
"""A point of the cloud farther than this from any echo is of none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Linked:
    """What a run left, as the page and its stills show it.

    Parameters
    ----------
    heading, subtitle : str
    moments : Moments
    radar : Radar
        Where it stands in the scene.
    range_doppler : Levels
        One map a step, mean of the channels.
    spectrogram : Levels
        One map, time across and velocity up; without columns where the capture is too short for it.
    rdt_points : (point, 3) float64
        Time [s], range [m], velocity [m/s].
    rdt_power_db : (point,) float64
        Power of the range-Doppler map there, in the unit of that map [dB].
    spatial : SpatialCloud
    spreading : bool
        Whether amplitudes hold the loss over distance.
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
        """The unit of the power of each echo (step, echo), by its range; that of the range-Doppler map."""
        return field_unit(self.radar, spreading=self.spreading, range_m=self.moments.range_m)

    @property
    def power_db(self) -> NDArray[np.float64]:
        """Power of each echo (step, echo) in `power_unit` [dB]; NaN where hidden."""
        power = self.moments.power_m2
        return np.where(power > 0, self.power_unit.level(power), np.nan)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """Which echoes (step, echo) would stand above the floor of the maps."""
        return np.asarray(np.nan_to_num(self.power_db, nan=-np.inf) >= self.range_doppler.low_db)

    @property
    def power_range_db(self) -> tuple[float, float]:
        """Of colours, from the floor of the maps to the strongest echo [dB]."""
        low_db = self.range_doppler.low_db
        return low_db, float(np.nanmax(self.power_db, initial=low_db + 1.0))

    @property
    def fastest_mps(self) -> float:
        """Largest rate of range that colours reach [m/s]."""
        rates = [*np.abs(self.moments.velocity_mps[self.seen]), *np.abs(self.rdt_points[:, 2]), 0.1]
        return float(max(rates))

    def shown_box(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Velocities [m/s] and ranges [m] where echoes and detections are at any time, with a margin, inside the map."""
        moments, levels = self.moments, self.range_doppler
        found = []
        for values, points, margin, (first, step), count in (
            (
                self.shown_velocity(),
                self.rdt_points[:, 2],
                1.0,
                levels.across,
                levels.level.shape[2],
            ),
            (moments.range_m, self.rdt_points[:, 1], 0.5, levels.up, levels.level.shape[1]),
        ):
            least, most = first - step / 2, first + step * (count - 0.5)
            inside = np.concatenate([values[self.seen], points])
            inside = inside[(inside >= least) & (inside <= most)]
            if len(inside):
                least, most = (
                    max(least, float(inside.min()) - margin),
                    min(most, float(inside.max()) + margin),
                )
            found.append((least, most))
        return found[0], found[1]

    def shown_velocity(self) -> NDArray[np.float64]:
        """Where echoes (step, echo) show on the velocity axis [m/s]: beyond the unambiguous velocity at another."""
        most = self.radar.max_velocity_mps
        return np.asarray((self.moments.velocity_mps + most) % (2 * most) - most)

    def rdt_group(self) -> NDArray[np.int64]:
        """Group of parts of each point of the cloud (point,): that of the nearest echo of its moment, by bins."""
        moments, radar = self.moments, self.radar
        steps = (
            np.abs(self.rdt_points[:, :1] - moments.times).argmin(axis=1)
            if len(self.rdt_points)
            else np.zeros(0, int)
        )
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
