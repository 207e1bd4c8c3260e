"""Range-azimuth and range-elevation maps: power of the detected cells over range and angle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.kernels.angles import add_interpolated
from rtradar.process.angles import AngleSpectra
from rtradar.process.steering import sine_grid
from rtradar.radar import Radar


def angle_grid(radar: Radar) -> NDArray[np.float64]:
    """Azimuths and elevations of the maps: uniform within the unambiguous angle.

    Parameters
    ----------
    radar : Radar
        Radar that has the array.

    Returns
    -------
    (angle,) float64
        Angles [rad].
    """
    largest = math.radians(radar.max_angle_deg)
    return np.linspace(-largest, largest, len(sine_grid(radar)))


def range_azimuth(spectra: AngleSpectra, radar: Radar) -> NDArray[np.float64]:
    """Power over range and azimuth, summed over cells.

    The y-line measures u = sin(azimuth) cos(elevation); the azimuths of each cell follow with the
    cosine of its strongest elevation. Without a z-line elevation is not measured, and the map is
    over the cone angle asin(u) in place of azimuth.

    Parameters
    ----------
    spectra : AngleSpectra
        Angle spectra of the detected cells of one frame.
    radar : Radar
        Radar that gives range bins and angles.

    Returns
    -------
    (range, azimuth) float64
        Power on the range bins of the radar and on `angle_grid`, in the unit of ``spectra``; zero
        where there are no cells.

    Raises
    ------
    InputError
        Where the radar has no y-line.
    """
    if spectra.y is None:
        raise InputError(
            f"range_azimuth: radar '{radar.name}' has no line of at least 2 channels along y; "
            "give it one"
        )
    w = (
        spectra.sines[spectra.z.argmax(axis=1)]
        if spectra.z is not None
        else np.zeros(len(spectra.y))
    )
    return _map(spectra, spectra.y, np.sqrt(1 - w**2)[:, None] * np.sin(angle_grid(radar)), radar)


def range_elevation(spectra: AngleSpectra, radar: Radar) -> NDArray[np.float64]:
    """Power over range and elevation, summed over cells; the z-line measures w = sin(elevation).

    Parameters
    ----------
    spectra : AngleSpectra
        Angle spectra of the detected cells of one frame.
    radar : Radar
        Radar that gives range bins and angles.

    Returns
    -------
    (range, elevation) float64
        Power on the range bins of the radar and on `angle_grid`, in the unit of ``spectra``; zero
        where there are no cells.

    Raises
    ------
    InputError
        Where the radar has no z-line.
    """
    if spectra.z is None:
        raise InputError(
            f"range_elevation: radar '{radar.name}' has no line of at least 2 channels along z; "
            "give it one"
        )
    sines = np.tile(np.sin(angle_grid(radar)), (len(spectra.z), 1))
    return _map(spectra, spectra.z, sines, radar)


def _map(
    spectra: AngleSpectra, power: NDArray[np.float32], sines: NDArray[np.float64], radar: Radar
) -> NDArray[np.float64]:
    """Power of each cell (cell, sine) read at its own sines (cell, angle), summed by range bin."""
    total = np.zeros((radar.samples_per_chirp, sines.shape[1]))
    bins = np.rint(spectra.range_m / radar.range_bin_m).astype(np.int64)
    grid = spectra.sines
    add_interpolated(power, sines, grid[0], grid[1] - grid[0], bins, total)
    return total
