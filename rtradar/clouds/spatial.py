"""Spatial point clouds: detected cells placed in space by range and angles (paper, eq. 19)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.process.angles import AngleSpectra, Peaks, find_peaks
from rtradar.radar import Radar

SPATIAL_AXES = ("x", "y", "z")
"""Coordinate names of a spatial cloud, along the world axes."""

SPATIAL_UNITS = ("m", "m", "m")
"""Units of `SPATIAL_AXES`."""

SHOWN_DB = 40.0
"""Dynamic range of pictures [dB]. Most points that no body causes are weaker than that."""


@dataclass(frozen=True)
class SpatialCloud:
    """Points in world coordinates with velocity, power and time.

    Parameters
    ----------
    points : (n, 3) float64
        World coordinates x, y and z [m]. A linear array does not measure the coordinate across it,
        which is NaN in every point: z for an array along y, y for an array along z. Such an array
        knows only the range of an echo and the cone about its line on which the echo lies, so that
        x holds the distance from that line, added to the radar's x. For an array along y that is
        sqrt(x^2 + z^2), with x and z from the radar, hence the true x only at the radar's height;
        for an array along z it is the horizontal distance.
    velocity : (n,) float64
        Range rate [m/s], positive receding.
    power : (n,) float64
        Power of one channel in squared units of the IF signal; an echo of amplitude 1 has power 1.
    time : (n,) float64
        Centre of the frame [s].
    source : (n,) int64, optional
        Index of the person, or after them the object, that returned most of the cell, -1 for the
        room or nobody; None where that is not known.
    part : (n,) int64, optional
        Part that returned most of that, with the parts of all people first and then the objects; -1
        as above.

    Raises
    ------
    InputError
        If the shapes do not fit each other or a value is not finite, except for y or z that is NaN
        in all points.
    """

    points: NDArray[np.float64]
    velocity: NDArray[np.float64]
    power: NDArray[np.float64]
    time: NDArray[np.float64]
    source: NDArray[np.int64] | None = None
    part: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        count = len(self.points)
        # As many of everything as there are points.
        for field, given in vars(self).items():
            if given is None:
                continue
            values: NDArray[Any] = np.asarray(
                given, dtype=np.int64 if field in ("source", "part") else np.float64
            )
            object.__setattr__(self, field, values)
            if values.shape != ((count, 3) if field == "points" else (count,)):
                raise InputError(
                    f"spatial cloud: {field} has shape {values.shape}; "
                    "give points (n, 3) and all else (n,)"
                )
            if not (measured_alone(values) if field == "points" else np.isfinite(values).all()):
                raise InputError(
                    f"spatial cloud: {field} holds NaN or infinity; "
                    "every value must be finite, but for y or z not measured"
                )

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Whether the radar measured x, y and z, (3,) bool; all True if there is no point."""
        return np.asarray(~np.isnan(self.points).any(axis=0))

    def strongest(self) -> SpatialCloud:
        """Return the points at most `SHOWN_DB` below the strongest one, for pictures."""
        kept = self.power >= self.power.max(initial=0.0) * 10 ** (-SHOWN_DB / 10)
        given = {name: values[kept] for name, values in vars(self).items() if values is not None}
        return SpatialCloud(**given)


def measured_alone(points: NDArray[np.float64]) -> bool:
    """Return whether ``points (n, 3)`` are finite, or NaN throughout only in y or only in z."""
    finite = np.isfinite(points)
    if finite.all():
        return True
    missing = np.asarray(np.isnan(points).all(axis=0))
    return bool(missing.sum() == 1 and not missing[0] and finite[:, ~missing].all())


def spatial_points(
    spectra: AngleSpectra,
    radar: Radar,
    time_s: float,
    source: NDArray[np.int64] | None = None,
    part: NDArray[np.int64] | None = None,
) -> SpatialCloud:
    """Make the points of one frame from the angle peaks of each detected cell.

    Azimuth and elevation are measured by two separate linear arrays, so that it is unknown which
    peak of one belongs to which peak of the other. Peaks are paired by the rank of their power, and
    if one array has fewer peaks, its strongest is used again. Two echoes of equal power in a cell
    may therefore exchange their elevations. Pairs with u^2 + w^2 > 1 are no direction and dropped.
    For a radar with one linear array the coordinate across is NaN (see `SpatialCloud`).

    Parameters
    ----------
    spectra : AngleSpectra
        Angle spectra of the detected cells.
    radar : Radar
        Radar at its position, turned as it is.
    time_s : float
        Centre of the frame [s].
    source, part : (cell,) int64, optional
        Who returned most of each cell, and by which part.

    Returns
    -------
    SpatialCloud
        Points cell by cell, the strongest pair first. The power is the mean of the two peaks.
    """
    y, z = _peaks(spectra)
    # The component along the boresight is what both sines leave of a unit vector.
    forward = 1 - y.sine**2 - z.sine**2
    cell, rank = np.nonzero((y.real | z.real) & (forward >= 0))
    direction = np.stack(
        [np.sqrt(forward[cell, rank]), y.sine[cell, rank], z.sine[cell, rank]], axis=1
    )
    for axis, power in ((1, spectra.y), (2, spectra.z)):
        if power is None:
            direction[:, axis] = np.nan
    return SpatialCloud(
        _in_world(spectra.range_m[cell, None] * direction, radar, time_s),
        spectra.velocity[cell],
        (y.power[cell, rank] + z.power[cell, rank]) / 2,
        np.full(len(cell), time_s),
        *(None if own is None else own[cell] for own in (source, part)),
    )


def points_of_sines(
    sines: NDArray[np.float64],
    mask: NDArray[np.bool_],
    power: NDArray[np.floating],
    radar: Radar,
    time_s: float,
    source: NDArray[np.int64] | None = None,
    part: NDArray[np.int64] | None = None,
) -> SpatialCloud:
    """Make the points of one frame from the direction of each detected cell.

    Parameters
    ----------
    sines : (cell, 2) float64
        Sines of the direction along the radar's y and z of each cell of ``mask``, in the order of
        ``np.argwhere``; NaN where one is not measured, which is taken for 0 if the radar is turned.
        A pair with u^2 + w^2 > 1 is no direction and dropped.
    mask : (range, velocity) bool
        Detected cells.
    power : (range, velocity) float
        Power summed over all channels.
    radar, time_s, source, part
        The same as for `spatial_points`.

    Returns
    -------
    SpatialCloud
        Points cell by cell. The power is the mean over the channels.
    """
    row, column = np.nonzero(mask)
    # A sine that is not measured counts as 0 here, and stays NaN in the direction.
    forward = 1 - np.nansum(sines**2, axis=1)
    kept = forward >= 0
    direction = np.column_stack([np.sqrt(forward[kept]), sines[kept]])
    velocity = radar.velocity_mps(mask.shape[1])
    return SpatialCloud(
        _in_world(radar.range_m[row[kept], None] * direction, radar, time_s),
        velocity[column[kept]],
        power[row[kept], column[kept]] / radar.n_channels,
        np.full(int(kept.sum()), time_s),
        *(None if own is None else own[kept] for own in (source, part)),
    )


def _in_world(places: NDArray[np.float64], radar: Radar, time_s: float) -> NDArray[np.float64]:
    """World coordinates (n, 3) of places in the radar's axes at a time.

    What is not measured is NaN, but where other axes mix it into all coordinates it is taken as 0.
    """
    if not (radar.is_turned or radar.is_moving):
        return np.asarray(radar.position_m) + places
    (axes,), (position,) = radar.poses_at([time_s])
    world = np.nan_to_num(places) @ axes.T + position
    # A coordinate stays unmeasured only if the radar's axis is the world's.
    missing = np.isnan(places).all(axis=0) & (np.abs(np.diag(axes)) > 1 - 1e-12)
    return np.where(missing, np.nan, world)


def _peaks(spectra: AngleSpectra) -> tuple[Peaks, Peaks]:
    """Peaks of both arrays; an array that is absent has sine 0 and the power of the other."""
    powers = spectra.y, spectra.z
    y, z = (None if power is None else find_peaks(spectra.sines, power) for power in powers)
    known = y or z
    if known is None:
        raise InputError(
            "spatial cloud: the spectra are of no line at all; take them from angle_spectra"
        )
    flat = Peaks(np.zeros_like(known.sine), known.power, known.real)
    return y or flat, z or flat
