"""The two virtual lines of the cross, and the phases by which they measure a direction.

The path :eq:`near-field` over the elements of the y-line depends on the sine u = y / r alone and
not on the elevation; the z-line measures w = z / r alike. Both are exact at any range.
"""

from __future__ import annotations

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

Taper = Literal["uniform", "taylor"]
"""Weights of the elements of a line."""

SIDE_LOBE_DB = 25.0
"""Side lobes of the Taylor taper below the main lobe, in the far field [dB]."""

_OVERSAMPLING = 4  # sines for each resolution cell of the longest line
_MOST_WEIGHTS = 2**29  # of one line for all ranges, 4 GB; the paper's have 2.4 million
_TAYLOR_EQUAL_LOBES = 4


@dataclass(frozen=True)
class Line:
    """One virtual line: the channels whose Tx and Rx both lie on it, along axis 1 or 2.

    ``channels (element,)`` are tx * n_rx + rx, ``tx_m`` and ``rx_m (element,)`` the positions of
    each element's Tx and Rx along the line, in the radar's axes [m].
    """

    axis: int
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
    neither. An array of antennas in lists has no lines; `beams` steers it.
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
    return Line(axis, np.asarray(tx * radar.n_rx + slot, dtype=np.int64), *places)


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
