"""Beams of an array of antennas anywhere: power over azimuth and elevation of a cell.

The beam toward a direction adds up all channels, each with the phase of the path over its Tx and Rx
to the point at that direction and range. The highest beam is looked for on a grid over the sines u
= y / r and w = z / r; the cuts through it over each of both sines are what `AngleSpectra` has.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.process.steering import phases_of
from rtradar.radar import Radar

_Reals = NDArray[np.float64]
_Complex = NDArray[np.complexfloating]

_OVERSAMPLING = 4  # sines of the grid for each resolution cell
_MOST_BEAMS = 2**18  # of the grid
_REFINEMENTS = 3  # of the highest beam, for what one sine shifts the other does
_PHASES_AT_ONCE = 2**20  # of all channels, toward all sines of the cuts of some cells


def cuts_through_highest(
    cells: _Complex, bins: NDArray[np.int64] | None, radar: Radar, sines: _Reals, walk: int
) -> tuple[NDArray[np.float32] | None, NDArray[np.float32] | None]:
    """Power (cell, sine) over u and over w through the highest beam of each cell.

    ``cells (cell, offset, channel)`` are without the motion within a cycle, ``bins (cell,)`` their
    range bins; without them waves are plane. A sine that the array does not measure gives None, and
    is taken to be 0.
    """
    limits = np.sin(np.radians([radar.max_azimuth_deg, radar.max_elevation_deg]))
    y, z = (_grid(radar, axis, limit) for axis, limit in enumerate(limits.tolist()))
    grid = np.stack([own.ravel() for own in np.meshgrid(y, z, indexing="ij")], axis=1)
    if len(grid) > _MOST_BEAMS:
        raise InputError(
            f"angle: radar '{radar.name}' has an array whose {len(grid)} beams are too many to "
            "keep; bring its antennas nearer to each other"
        )
    out = np.zeros((2, len(cells), len(sines)), np.float32)
    axes = np.flatnonzero(radar.measures).tolist()
    at_once = max(1, _PHASES_AT_ONCE // (len(sines) * radar.n_channels))
    order = axes * _REFINEMENTS if len(axes) > 1 else axes
    used, which = np.unique(np.zeros(len(cells)) if bins is None else bins, return_inverse=True)
    for number, range_bin in enumerate(used.tolist()):
        range_m = None if bins is None else range_bin * radar.range_bin_m
        same = np.flatnonzero(which == number)
        for first in range(0, len(same), at_once):
            some = same[first : first + at_once]
            highest = _power(cells[some], grid[None], range_m, radar, walk).argmax(axis=1)
            at = grid[highest]
            for axis in order:
                cut = np.repeat(at[:, None], len(sines), axis=1)
                cut[..., axis] = sines
                power = _power(cells[some], cut, range_m, radar, walk)
                power[:, np.abs(sines) > limits[axis] + 1e-12] = 0
                out[axis, some] = power
                at[:, axis] = refine(sines, power, power.argmax(axis=1)[:, None])[0][:, 0]
    azimuth, elevation = radar.measures
    return out[0] if azimuth else None, out[1] if elevation else None


def _grid(radar: Radar, axis: int, largest: float) -> _Reals:
    """Sines of the grid over one axis, up to the largest."""
    if not radar.measures[axis]:
        return np.zeros(1)
    aperture = np.ptp(radar.virtual_m[:, 1 + axis]) / radar.wavelength_m
    half = int(np.ceil(_OVERSAMPLING * largest * aperture)) + 1
    return np.linspace(-largest, largest, 2 * half + 1)


def _power(
    cells: _Complex, sines: _Reals, range_m: float | None, radar: Radar, walk: int
) -> _Reals:
    """Power (cell, direction) of beams toward ``sines (cell or 1, direction, 2)``, u and w.

    It is 0 where both sines together are no direction.
    """
    ahead = 1 - (sines**2).sum(axis=2)
    direction = np.concatenate([np.sqrt(np.maximum(ahead, 0))[..., None], sines], axis=2)
    carrier = radar.centre_frequency_hz + np.repeat(radar.tx_offset_hz, radar.n_rx)
    weights, offsets = phases_of(
        excess_m(direction, range_m, radar), carrier, radar, 0 if range_m is None else walk
    )
    beams = np.zeros((len(cells), sines.shape[1]), np.complex128)
    for offset in np.unique(offsets).tolist():
        read = (weights * (offsets == offset)).swapaxes(1, 2)
        # Where all cells share their directions, it is one product of two matrices.
        own = cells[:, walk + offset].reshape(len(sines), -1, radar.n_channels)
        beams += (own @ read).reshape(beams.shape)
    return np.asarray(np.abs(beams / radar.n_channels) ** 2 * (ahead >= 0))


def excess_m(direction: _Reals, range_m: float | None, radar: Radar) -> _Reals:
    """Path over each channel less twice the range (..., channel) [m]; plane without range."""
    tx = np.repeat(radar.tx_m, radar.n_rx, axis=0)
    rx = radar.rx_m[radar.rx_of_tx].reshape(-1, 3)
    if range_m is None:
        return np.asarray(-direction @ (tx + rx).T)
    point = range_m * direction[..., None, :]
    there, back = (np.linalg.norm(point - places, axis=-1) for places in (tx, rx))
    return np.asarray(there + back - 2 * range_m)


def refine(
    sines: NDArray[np.float64], power: NDArray[np.floating], index: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sine and power (cell, peak) of maxima, by the parabola through three logarithms of power.

    ``index (cell, peak)`` is where the maxima of ``power (cell, sine)`` are on the grid; at its
    ends they are left there.
    """
    last = len(sines) - 1
    around = (np.clip(index + step, 0, last) for step in (-1, 0, 1))
    least = np.finfo(np.float32).tiny
    left, middle, right = (
        np.log(np.maximum(np.take_along_axis(power, at, axis=1), least, dtype=np.float64))
        for at in around
    )
    bend = left - 2 * middle + right
    inside = (bend < 0) & (index > 0) & (index < last)
    # Beside what is no direction, where power is 0, a peak stays where it is, too.
    inside &= np.minimum(left, right) > math.log(least) + 1
    shift = np.clip(0.5 * (left - right) / np.where(inside, bend, -1.0), -0.5, 0.5) * inside
    sine = sines[index] + shift * (sines[1] - sines[0])
    return sine, np.exp(middle - 0.25 * (left - right) * shift)
