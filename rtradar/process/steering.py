"""Phases by which the two virtual lines of a cross, or antennas anywhere, measure a direction.

The path :eq:`near-field` over the elements of the y-line depends on the sine u = y / r alone and
not on the elevation; the z-line measures w = z / r alike. Both are exact at any range.

Of antennas anywhere, the beam toward a direction adds up all channels, each with the phase of the
path over its Tx and Rx to the point at that direction and range. The highest beam is looked for on
a grid over the sines u = y / r and w = z / r; the cuts through it over each of both sines are what
`AngleSpectra` has.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.angles import Steering
from rtradar.process.window_functions import taylor
from rtradar.radar import Radar

_Reals = NDArray[np.float64]
_Complex = NDArray[np.complexfloating]

Taper = Literal["uniform", "taylor"]
"""Weights of the elements of a line."""

SIDE_LOBE_DB = 25.0
"""Side lobes of the Taylor taper below the main lobe, in the far field [dB]."""

_OVERSAMPLING = 4  # sines for each resolution cell of the longest line
_MOST_WEIGHTS = 2**29  # of one line for all ranges, 4 GB; the paper's have 2.4 million
_TAYLOR_EQUAL_LOBES = 4


@dataclass(frozen=True)
class Line:
    """One virtual line: the channels whose Tx and Rx both lie on it.

    ``channels (element,)`` are tx * n_rx + rx, ``tx_m`` and ``rx_m (element,)`` the positions of
    each element's Tx and Rx along the line, in the radar's axes [m].
    """

    channels: NDArray[np.int64]
    tx_m: NDArray[np.float64]
    rx_m: NDArray[np.float64]

    def excess_m(self, sines: ArrayLike, range_m: float | None) -> NDArray[np.float64]:
        """Path over each element less twice the range, :eq:`near-field` (..., element) [m].

        The direction has the ``sines (...)`` along the line; without a range it is a plane wave.
        """
        u = np.asarray(sines, dtype=np.float64)[..., None]
        if range_m is None:
            return np.asarray(-(self.tx_m + self.rx_m) * u)
        there, back = (
            np.sqrt(range_m**2 - 2 * range_m * place * u + place**2)
            for place in (self.tx_m, self.rx_m)
        )
        return np.asarray(there + back - 2 * range_m)


@lru_cache(maxsize=16)
def virtual_lines(radar: Radar) -> tuple[Line | None, Line | None]:
    """The y-line and the z-line; None where one has fewer than two elements, InputError for both.

    Channels of a Tx on one line and an Rx on the other, which ``channels = "all"`` has, belong to
    neither. An array of antennas in lists has no lines; `cuts_through_highest` steers it.
    """
    if not any(radar.measures):
        raise InputError(
            f"angle: radar '{radar.name}' has no line of at least 2 channels; give a Tx and 2 Rx "
            "(or 2 Tx and an Rx) along y or z"
        )
    return (_line(radar, 1), _line(radar, 2)) if radar.is_cross else (None, None)


def _line(radar: Radar, axis: int) -> Line | None:
    order = range(radar.n_tx) if radar.tx_order is None else radar.tx_order
    tx_there, rx_there = np.array(order) < radar.tx_y, np.arange(len(radar.rx)) < radar.rx_y
    if axis == 2:
        tx_there, rx_there = ~tx_there, ~rx_there
    tx, slot = np.nonzero(tx_there[:, None] & rx_there[radar.rx_of_tx])
    if len(tx) < 2:
        return None
    places = radar.tx_m[tx, axis], radar.rx_m[radar.rx_of_tx[tx, slot], axis]
    return Line(np.asarray(tx * radar.n_rx + slot, dtype=np.int64), *places)


@lru_cache(maxsize=16)
def sine_grid(radar: Radar) -> NDArray[np.float64]:
    """Uniform sines (sine,) within the unambiguous angle, fine enough for a parabola through three.

    An `InputError` is raised where there is no line, or one so long that they would be too many.
    """
    largest = np.sin(np.radians(radar.max_angle_deg))
    lines = [line for line in virtual_lines(radar) if line is not None]
    places = [line.tx_m + line.rx_m for line in lines] or list(radar.virtual_m[:, 1:].T)
    aperture = max(map(np.ptp, places)) / radar.wavelength_m
    half = int(np.ceil(_OVERSAMPLING * largest * aperture)) + 1
    elements = max(map(len, places))
    if (2 * half + 1) * elements * radar.samples_per_chirp > _MOST_WEIGHTS:
        raise InputError(
            f"angle: radar '{radar.name}' has a line {aperture:.3g} wavelengths long, whose beams "
            "are too many to keep; lessen tx_spacing_wavelengths or rx_spacing_wavelengths"
        )
    grid = np.linspace(-largest, largest, 2 * half + 1)
    grid.flags.writeable = False
    return grid


def taper_weights(line: Line, taper: Taper) -> NDArray[np.float64]:
    """Weights of the elements (element,), sum 1, by their positions on the virtual line."""
    if taper == "uniform":
        return np.full(len(line.channels), 1 / len(line.channels))
    places, count = line.tx_m + line.rx_m, len(line.channels)
    window = taylor(count, _TAYLOR_EQUAL_LOBES, SIDE_LOBE_DB)
    # A line without gaps gets the window itself.
    weights = np.interp(places, np.linspace(places.min(), places.max(), count), window)
    return np.asarray(weights / weights.sum())


@lru_cache(maxsize=16)
def range_walk(radar: Radar) -> int:
    """Range bins on either side of a cell in which some elements receive its echo from the side."""
    lines = [line for line in virtual_lines(radar) if line is not None]
    if not radar.is_cross:
        farthest = (
            np.linalg.norm(radar.tx_m, axis=1).max() + np.linalg.norm(radar.rx_m, axis=1).max()
        )
        return int(np.ceil(farthest / 2 / radar.range_bin_m))
    farthest = max(np.abs(line.tx_m + line.rx_m).max() for line in lines)
    return int(np.ceil(farthest * float(sine_grid(radar)[-1]) / 2 / radar.range_bin_m))


def steering(
    radar: Radar, axis: int, range_bins: NDArray[np.int64] | None, taper: Taper
) -> Steering:
    """Phases and range bins of a line for points at some ranges, for every sine of `sine_grid`.

    Echoes are read in the bin nearest to half their path over each element. Without ``range_bins
    (bin,)`` the wave is plane and read in the bin of the cell alone (the far-field FFT): one entry,
    for all bins.
    """
    line = virtual_lines(radar)[axis - 1]
    if line is None:
        raise InputError(
            f"angle: radar '{radar.name}' has no line of at least 2 channels along "
            f"{'xyz'[axis]}; give it one"
        )
    walk, sines, own = range_walk(radar), sine_grid(radar), taper_weights(line, taper)
    count = 1 if range_bins is None else len(range_bins)
    weights = np.empty((count, len(line.channels), len(sines)), dtype=np.complex64)
    carrier = radar.centre_frequency_hz + radar.tx_offset_hz[line.channels // radar.n_rx]
    runs = []
    for place in range(count):
        range_m = None if range_bins is None else radar.range_bin_m * int(range_bins[place])
        phases, offsets = phases_of(
            line.excess_m(sines, range_m), carrier, radar, 0 if range_m is None else walk
        )
        weights[place] = (phases * own).T
        runs.append(_runs(offsets.T + walk))
    return Steering(weights, np.concatenate(runs), np.cumsum([0, *map(len, runs)]))


def phases_of(
    excess_m: _Reals, carrier_hz: _Reals, radar: Radar, walk: int
) -> tuple[NDArray[np.complex128], NDArray[np.int64]]:
    """Phases (..., element) that bring elements into step, and the bins in which to read each.

    ``excess_m (..., element)`` is the path over each less twice the range; bins are counted from
    that of the cell, at most ``walk`` to either side.
    """
    steps = np.rint(excess_m / (2 * radar.range_bin_m))
    offsets = np.clip(steps, -walk, walk).astype(np.int64)
    # From one range bin to the next the phase also turns by half a turn, because the window
    # function is even about the middle of the chirp.
    turns = excess_m * (carrier_hz / SPEED_OF_LIGHT_MPS) - offsets / 2
    return np.exp(-2j * np.pi * turns), offsets


# Both lines of two radars; 20 MB each, computed at once, so that memory does not grow with motion.
@lru_cache(maxsize=4)
def steering_everywhere(radar: Radar, axis: int) -> Steering:
    """`steering` for every range bin of a radar, with the Taylor taper.

    Where both lines of a cross have the same elements, they share their weights.
    """
    if axis == 2 and _lines_are_alike(radar):
        return steering_everywhere(radar, 1)
    return steering(radar, axis, np.arange(radar.samples_per_chirp), "taylor")


def _lines_are_alike(radar: Radar) -> bool:
    elements = [
        (line.tx_m, line.rx_m, radar.tx_offset_hz[line.channels // radar.n_rx])
        for line in virtual_lines(radar)
        if line is not None
    ]
    return len(elements) == 2 and all(map(np.array_equal, *elements))


def _runs(offsets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Runs of sines along which an element is read at the same offset (element, sine)."""
    fresh = np.ones(offsets.shape, dtype=np.bool_)
    fresh[:, 1:] = np.diff(offsets, axis=1) != 0
    element, first = np.nonzero(fresh)
    last = np.append(first[1:], 0)
    last[last == 0] = offsets.shape[1]
    return np.stack([element, offsets[element, first], first, last], axis=1)


# -- arrays of antennas anywhere -------------------------------------------------------------------

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
        _excess_m(direction, range_m, radar), carrier, radar, 0 if range_m is None else walk
    )
    beams = np.zeros((len(cells), sines.shape[1]), np.complex128)
    for offset in np.unique(offsets).tolist():
        read = (weights * (offsets == offset)).swapaxes(1, 2)
        # Where all cells share their directions, it is one product of two matrices.
        own = cells[:, walk + offset].reshape(len(sines), -1, radar.n_channels)
        beams += (own @ read).reshape(beams.shape)
    return np.asarray(np.abs(beams / radar.n_channels) ** 2 * (ahead >= 0))


def _excess_m(direction: _Reals, range_m: float | None, radar: Radar) -> _Reals:
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
