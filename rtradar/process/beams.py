"""Beams of an array of antennas anywhere: power over azimuth and elevation of a cell.

The beam toward a direction adds up all channels, each with the phase of the path over its Tx and Rx
to the point at that direction and range. The highest beam is looked for on a grid over the sines u
= y / r and w = z / r; the cuts through it over each of both sines are what `AngleSpectra` has.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.radar import Radar

_Reals = NDArray[np.float64]
_Complex = NDArray[np.complexfloating]

_OVERSAMPLING = 4  # sines of the grid for each resolution cell
_MOST_BEAMS = 2**18  # of the grid
_REFINEMENTS = 3  # of the highest beam, for what one sine shifts the other does


def cuts_through_highest(
    cells: _Complex, bins: NDArray[np.int64] | None, radar: Radar, sines: _Reals, walk: int
) -> tuple[NDArray[np.float32] | None, NDArray[np.float32] | None]:
    """Power (cell, sine) over u and over w through the highest beam of each cell.

    ``cells (cell, offset, channel)`` are without the motion within a cycle, ``bins (cell,)`` their
    range bins; without them waves are plane. A sine that the array does not measure gives None, and
    is taken to be 0.
    """
    y, z = (_grid(radar, axis) for axis in (0, 1))
    u, w = (grid.ravel() for grid in np.meshgrid(y, z, indexing="ij"))
    if len(u) > _MOST_BEAMS:
        raise InputError(
            f"angle: radar '{radar.name}' has an array whose {len(u)} beams are too many to keep; "
            "bring its antennas nearer to each other"
        )
    limits = np.sin(np.radians([radar.max_azimuth_deg, radar.max_elevation_deg]))
    out = [np.zeros((len(cells), len(sines)), np.float32) for _ in range(2)]
    used, which = np.unique(np.zeros(len(cells)) if bins is None else bins, return_inverse=True)
    for number, range_bin in enumerate(used.tolist()):
        some = np.flatnonzero(which == number)
        range_m = None if bins is None else range_bin * radar.range_bin_m
        highest = _power(cells[some], u, w, range_m, radar, walk).argmax(axis=1)
        for cell, best in zip(some.tolist(), highest.tolist(), strict=True):
            at = [u[best], w[best]]
            for step in range(_REFINEMENTS * 2 if all(radar.measures) else 1):
                axis = step % 2 if all(radar.measures) else radar.measures.index(True)
                over_u, over_w = (
                    sines if own == axis else np.full(len(sines), at[own]) for own in (0, 1)
                )
                power = _power(cells[cell : cell + 1], over_u, over_w, range_m, radar, walk)[0]
                power[np.abs(sines) > limits[axis] + 1e-12] = 0
                out[axis][cell] = power
                at[axis] = _highest(sines, power)
    azimuth, elevation = radar.measures
    return out[0] if azimuth else None, out[1] if elevation else None


def _grid(radar: Radar, axis: int) -> _Reals:
    """Sines of the grid over one axis, within its unambiguous angle."""
    if not radar.measures[axis]:
        return np.zeros(1)
    largest = np.sin(np.radians((radar.max_azimuth_deg, radar.max_elevation_deg)[axis]))
    aperture = np.ptp(radar.virtual_m[:, 1 + axis]) / radar.wavelength_m
    half = int(np.ceil(_OVERSAMPLING * largest * aperture)) + 1
    return np.linspace(-largest, largest, 2 * half + 1)


def _power(
    cells: _Complex, u: _Reals, w: _Reals, range_m: float | None, radar: Radar, walk: int
) -> _Reals:
    """Power (cell, direction) of beams; 0 where both sines together are no direction."""
    ahead = 1 - u**2 - w**2
    direction = np.stack([np.sqrt(np.maximum(ahead, 0)), u, w], axis=1)
    excess = excess_m(direction, range_m, radar)
    steps = np.rint(excess / (2 * radar.range_bin_m)) * (range_m is not None)
    offsets = np.clip(steps, -walk, walk).astype(np.int64)
    carrier = radar.centre_frequency_hz + np.repeat(radar.tx_offset_hz, radar.n_rx)
    # From one range bin to the next the phase also turns by half a turn.
    turns = excess * (carrier / SPEED_OF_LIGHT_MPS) - offsets / 2
    weights = np.exp(-2j * np.pi * turns) / radar.n_channels
    beams = np.zeros((len(cells), len(u)), np.complex128)
    for offset in np.unique(offsets).tolist():
        beams += cells[:, walk + offset] @ (weights * (offsets == offset)).T
    return np.asarray(np.abs(beams) ** 2 * (ahead >= 0))


def excess_m(direction: _Reals, range_m: float | None, radar: Radar) -> _Reals:
    """Path over each channel less twice the range (direction, channel) [m]; plane without range."""
    tx = np.repeat(radar.tx_m, radar.n_rx, axis=0)
    rx = radar.rx_m[radar.rx_of_tx].reshape(-1, 3)
    if range_m is None:
        return np.asarray(-direction @ (tx + rx).T)
    point = range_m * direction[:, None]
    there, back = (np.linalg.norm(point - places, axis=2) for places in (tx, rx))
    return np.asarray(there + back - 2 * range_m)


def _highest(sines: _Reals, power: _Reals) -> float:
    """Sine of the highest power, by the parabola through three."""
    top = int(power.argmax())
    if not 0 < top < len(sines) - 1:
        return float(sines[top])
    left, middle, right = power[top - 1 : top + 2]
    bend = left - 2 * middle + right
    shift = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(sines[top] + shift * (sines[1] - sines[0]))
