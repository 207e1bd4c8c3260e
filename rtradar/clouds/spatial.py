"""Spatial point cloud: detected cells placed in the room by their range and angles (paper, eq. 19)."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.process.angles.peaks import Peaks, find_peaks
from rtradar.process.angles.spectra import AngleSpectra
from rtradar.radar import Radar
from rtradar.system.files import atomic_file

SPATIAL_AXES = ("x", "y", "z")
"""Names of the coordinates of a spatial cloud, world axes."""

SPATIAL_UNITS = ("m", "m", "m")
"""Their units."""

SHOWN_DB = 40.0
"""Farther below the strongest point lie most of those that are of no body."""


@dataclass(frozen=True)
class SpatialCloud:
    """Points in the room, each with what the radar knows of it.

    Parameters
    ----------
    points : (n, 3) float64
        World axes [m]. An array on one line does not measure the coordinate across it, which is NaN in every point: z of a
        line along y, y of a line along z. Its x then holds the distance from the line of the array, added to the radar's x:
        all that is known of an echo is its range and the cone about that line on which it lies. For a line along y that is
        the true x only at the height of the radar (sqrt(x^2 + z^2) elsewhere, x and z from the radar), for a line along z the
        horizontal distance.
    velocity : (n,) float64
        Range rate [m/s], positive receding.
    power : (n,) float64
        Power of one channel, in the unit of the IF squared: an echo of amplitude 1 reads 1.
    time : (n,) float64
        Centre of the window [s].

    Raises
    ------
    InputError
        Where the shapes do not fit each other or a value is not finite, but for a y or a z that is NaN throughout.
    """

    points: NDArray[np.float64]
    velocity: NDArray[np.float64]
    power: NDArray[np.float64]
    time: NDArray[np.float64]

    def __post_init__(self) -> None:
        for field in ("points", "velocity", "power", "time"):
            values = np.asarray(getattr(self, field), dtype=np.float64)
            object.__setattr__(self, field, values)
            if values.shape != (
                (len(self.points), 3) if field == "points" else (len(self.points),)
            ):
                raise InputError(
                    f"spatial cloud: {field} has shape {values.shape}; give points (n, 3) and all else (n,)"
                )
            if not (measured_alone(values) if field == "points" else np.isfinite(values).all()):
                raise InputError(
                    f"spatial cloud: {field} holds NaN or infinity; every value must be finite, but for y or z not measured"
                )

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Which of x, y and z (3,) the radar has measured; all of them where there is no point."""
        return np.asarray(~np.isnan(self.points).any(axis=0))

    def strongest(self) -> SpatialCloud:
        """Points at most `SHOWN_DB` below the strongest, which pictures show."""
        kept = self.power >= self.power.max(initial=0.0) * 10 ** (-SHOWN_DB / 10)
        return SpatialCloud(
            self.points[kept], self.velocity[kept], self.power[kept], self.time[kept]
        )


def measured_alone(points: NDArray[np.float64]) -> bool:
    """Whether ``points (n, 3)`` are finite but for one coordinate, y or z, that is NaN in all of them: not measured."""
    finite = np.isfinite(points)
    if finite.all():
        return True
    missing = np.asarray(np.isnan(points).all(axis=0))
    return bool(missing.sum() == 1 and not missing[0] and finite[:, ~missing].all())


def spatial_points(spectra: AngleSpectra, radar: Radar, time_s: float) -> SpatialCloud:
    """Points of one window: for each cell the peaks of both lines, put together.

    The lines know nothing of each other: which peak of the one belongs to which of the other is not measured. They are paired by
    the rank of their power, and where one line has fewer peaks its strongest stands in. Two echoes of equal power in a cell
    may so exchange their elevations. A pair that is no direction at all (u^2 + w^2 > 1) is left out. A radar with one line
    alone measures the cone about that line on which an echo lies: the coordinate across is NaN (see `SpatialCloud`).

    Parameters
    ----------
    spectra : AngleSpectra
        Of the detected cells.
    radar : Radar
        Its axes are parallel to the world's.
    time_s : float
        Centre of the window [s].

    Returns
    -------
    SpatialCloud
        Cell by cell, the strongest pair first; the power of a point is the mean of its two peaks.
    """
    y, z = _peaks(spectra)
    forward = 1 - y.sine**2 - z.sine**2
    cell, rank = np.nonzero((y.real | z.real) & (forward >= 0))
    direction = np.stack(
        [np.sqrt(forward[cell, rank]), y.sine[cell, rank], z.sine[cell, rank]], axis=1
    )
    for axis, power in ((1, spectra.y), (2, spectra.z)):
        if power is None:
            direction[:, axis] = np.nan
    return SpatialCloud(
        np.asarray(radar.position_m) + spectra.range_m[cell, None] * direction,
        spectra.velocity[cell],
        (y.power[cell, rank] + z.power[cell, rank]) / 2,
        np.full(len(cell), time_s),
    )


def save_spatial_npz(path: str | os.PathLike[str], cloud: SpatialCloud) -> None:
    """Write a cloud as a NumPy archive: ``points (n, 3)``, ``velocity``, ``power``, ``time (n,)``, ``axes``, ``units (3,)``.

    A coordinate that is not measured is NaN in every point.

    Parameters
    ----------
    path : path
        Replaced if it is there, whole or not at all.
    cloud : SpatialCloud
        May be empty.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    with atomic_file(path) as file:
        np.savez_compressed(
            file,
            points=cloud.points,
            velocity=cloud.velocity,
            power=cloud.power,
            time=cloud.time,
            axes=np.array(SPATIAL_AXES),
            units=np.array(SPATIAL_UNITS),
        )


def _peaks(spectra: AngleSpectra) -> tuple[Peaks, Peaks]:
    """Peaks of both lines; a line that is not there has sine 0 and the power of the other."""
    y, z = (
        None if power is None else find_peaks(spectra.sines, power)
        for power in (spectra.y, spectra.z)
    )
    known = y or z
    if known is None:
        raise InputError(
            "spatial cloud: the spectra are of no line at all; take them from angle_spectra"
        )
    flat = Peaks(np.zeros_like(known.sine), known.power, known.real)
    return y or flat, z or flat
