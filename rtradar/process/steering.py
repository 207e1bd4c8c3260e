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
from rtradar.kernels.cells import Steering
from rtradar.process.window_functions import taylor
from rtradar.radar import Radar
from rtradar.system.threads import one_blas_thread, thread_count, thread_map

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
        there, back = (_excess_m(u, own[:, None], range_m) for own in (self.tx_m, self.rx_m))
        return there + back


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
    # A channel is on the line if its Tx and its Rx are. Tx are numbered in the order in which they
    # transmit, and lines by the fields.
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
    # A beam is about the inverse of the aperture wide in sines, and so fine that a parabola finds
    # its peak between them.
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
    # A Taylor window by the places of the virtual elements.
    places, count = line.tx_m + line.rx_m, len(line.channels)
    window = taylor(count, _TAYLOR_EQUAL_LOBES, SIDE_LOBE_DB)
    # A line without gaps gets the window itself.
    weights = np.interp(places, np.linspace(places.min(), places.max(), count), window)
    return np.asarray(weights / weights.sum())


@lru_cache(maxsize=16)
def range_walk(radar: Radar) -> int:
    """Range bins on either side of a cell in which some elements receive its echo from the side."""
    lines = [line for line in virtual_lines(radar) if line is not None]
    # Antennas anywhere: as far as both are from the origin together, whatever the direction.
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
    # At each range the phases of all elements and sines, with the taper, and in which bin each is
    # read.
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
        # Along the sines an element is read in the same bin for a while; the kernel goes from run
        # to run.
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
    # A run begins with each element, and where its offset changes; it ends where the next begins.
    fresh = np.ones(offsets.shape, dtype=np.bool_)
    fresh[:, 1:] = np.diff(offsets, axis=1) != 0
    element, first = np.nonzero(fresh)
    last = np.append(first[1:], 0)
    last[last == 0] = offsets.shape[1]
    return np.stack([element, offsets[element, first], first, last], axis=1)


# -- arrays of antennas anywhere -------------------------------------------------------------------

_MOST_BEAMS = 2**18  # of the grid
_WEIGHTS_AT_ONCE = 2**20  # of all channels, toward some directions, in all threads together


@one_blas_thread()
def cuts_through_highest(
    cells: _Complex, bins: NDArray[np.int64] | None, radar: Radar, sines: _Reals, walk: int
) -> tuple[NDArray[np.float32] | None, NDArray[np.float32] | None]:
    """Power (cell, sine) over u and over w through the highest beam of each cell.

    ``cells (cell, offset, channel)`` are without the motion within a cycle, ``bins (cell,)`` their
    range bins; without them waves are plane. A sine that the array does not measure gives None, and
    is taken to be 0.
    """
    # The grid over both sines, whose highest beam is looked for in each cell.
    limits = np.sin(np.radians([radar.max_azimuth_deg, radar.max_elevation_deg]))
    y, z = (_grid(radar, axis, limit) for axis, limit in enumerate(limits.tolist()))
    if len(y) * len(z) > _MOST_BEAMS:
        raise InputError(
            f"angle: radar '{radar.name}' has an array whose {len(y) * len(z)} beams are too many "
            "to keep; bring its antennas nearer to each other"
        )
    range_m = None if bins is None else np.asarray(bins * radar.range_bin_m, np.float64)
    at = _highest(cells, range_m, radar, (y, z), walk)

    def cut(axis: int) -> NDArray[np.float32]:
        # One sine over the grid, the other as in the highest beam. Beyond the unambiguous angle
        # nothing is shown.
        toward = np.repeat(at[:, None], len(sines), axis=1)
        toward[..., axis] = sines
        power = _powers(cells, toward, range_m, radar, walk)
        power[:, np.abs(sines) > limits[axis] + 1e-12] = 0
        return power

    azimuth, elevation = radar.measures
    return cut(0) if azimuth else None, cut(1) if elevation else None


def _grid(radar: Radar, axis: int, largest: float) -> _Reals:
    """Sines of the grid over one axis, up to the largest."""
    if not radar.measures[axis]:
        return np.zeros(1)
    aperture = np.ptp(radar.virtual_m[:, 1 + axis]) / radar.wavelength_m
    half = int(np.ceil(_OVERSAMPLING * largest * aperture)) + 1
    return np.linspace(-largest, largest, 2 * half + 1)


def _highest(
    cells: _Complex, range_m: _Reals | None, radar: Radar, axes: tuple[_Reals, _Reals], walk: int
) -> _Reals:
    """Sines (cell, 2) of the highest beam of each cell, refined between those of the grid.

    It is the vertex of the paraboloid through the logarithms of the power of nine beams, a step of
    the grid apart and then a quarter of it. An array that is no rectangle has tilted beams, where
    what one sine shifts the other does, too.
    """
    # All beams of the grid, for cells of one range together, because these share their phases.
    grid = np.stack([own.ravel() for own in np.meshgrid(*axes, indexing="ij")], axis=1)
    at = np.empty((len(cells), 2))
    at_once = max(1, _WEIGHTS_AT_ONCE // (thread_count() * len(grid) * radar.n_tx))
    ranges = np.zeros(len(cells)) if range_m is None else range_m
    pieces = [
        same[first : first + at_once]
        for same in (np.flatnonzero(ranges == own) for own in np.unique(ranges))
        for first in range(0, len(same), at_once)
    ]

    def find(number: int) -> None:
        some = pieces[number]
        own = None if range_m is None else range_m[some[:1]]
        at[some] = grid[_power(cells[some], grid[None], own, radar, walk).argmax(axis=1)]

    thread_map(find, range(len(pieces)))
    # Twice refined by a paraboloid through nine beams about the highest.
    largest = np.array([own[-1] for own in axes])
    steps = np.array([np.ptp(own[:2]) for own in axes])
    nine = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1], indexing="ij"), axis=-1).reshape(9, 2)
    for step in (steps, steps / 4):
        around = _powers(cells, at[:, None] + nine * step, range_m, radar, walk)
        vertices = _vertices(around.reshape(-1, 3, 3).astype(np.float64))
        at = np.clip(at + vertices * step, -largest, largest)
    return at


def _vertices(power: _Reals) -> _Reals:
    """Places (cell, 2) of maxima within power (cell, 3, 3), in steps from the middle, which is one.

    They stay in the middle along an axis beside which there is no power.
    """
    least = np.finfo(np.float32).tiny
    # Logarithms of the power, along both axes and in the corners.
    height = np.log(np.maximum(power, least))
    middle = height[:, 1, 1, None]
    before = np.stack([height[:, 0, 1], height[:, 1, 0]], axis=1)
    after = np.stack([height[:, 2, 1], height[:, 1, 2]], axis=1)
    corners = height[:, ::2, ::2]
    # Second derivative along each axis; where it is no maximum, or the power is 0 beside it, the
    # vertex stays.
    bend = before - 2 * middle + after
    inside = (bend < 0) & (np.minimum(before, after) > math.log(least) + 1)
    bend = np.where(inside, bend, -1.0)
    slope = np.where(inside, (after - before) / 2, 0.0)
    # The mixed derivative of tilted beams, used where the Hessian stays that of a maximum.
    twist = (corners[:, 0, 0] + corners[:, 1, 1] - corners[:, 0, 1] - corners[:, 1, 0]) / 4
    whole = inside.all(axis=1) & (corners.min(axis=(1, 2)) > math.log(least) + 1)
    twist = np.where(whole & (twist**2 < bend.prod(axis=1)), twist, 0.0)[:, None]
    # One step of Newton's method: minus the inverse of the Hessian times the gradient.
    shift = (twist * slope[:, ::-1] - bend[:, ::-1] * slope) / (
        bend.prod(axis=1, keepdims=True) - twist**2
    )
    return np.asarray(np.clip(shift, -1, 1))


def _powers(
    cells: _Complex, sines: _Reals, range_m: _Reals | None, radar: Radar, walk: int
) -> NDArray[np.float32]:
    """`_power` of cells that have directions of their own, some at a time."""
    power = np.empty(sines.shape[:2], np.float32)
    at_once = max(1, _WEIGHTS_AT_ONCE // (thread_count() * sines.shape[1] * radar.n_channels))

    def fill(first: int) -> None:
        some = slice(first, first + at_once)
        own = None if range_m is None else range_m[some]
        power[some] = _power(cells[some], sines[some], own, radar, walk)

    thread_map(fill, range(0, len(cells), at_once))
    return power


def _power(
    cells: _Complex, sines: _Reals, range_m: _Reals | None, radar: Radar, walk: int
) -> _Reals:
    """Power (cell, direction) of beams toward ``sines (cell or 1, direction, 2)``, u and w.

    ``range_m (cell or 1,)`` are the ranges; without them waves are plane. It is 0 where both sines
    together are no direction.
    """
    tx, which, rx, carrier, carrier_back = _phased(radar)
    # The direction by its two sines; the third component is what is left, and imaginary where there
    # is no direction.
    ahead = 1 - (sines**2).sum(axis=2)
    direction = np.concatenate([np.sqrt(np.maximum(ahead, 0))[..., None], sines], axis=2)
    away = None if range_m is None else range_m[:, None, None]
    # The phasor of a channel is the product of one of its Tx and one of its receiver.
    there, back = (_excess_m(direction, places, away) for places in (radar.tx_m, rx))
    of_tx, of_rx = _phasors(there, carrier), _phasors(back, carrier_back)
    values = np.zeros((len(cells), radar.n_tx, len(rx)), np.complex64)
    values[:, tx, which] = cells[:, walk]
    # First the receivers of each Tx are added, then all Tx. Where cells share their directions, it
    # is one product of two matrices.
    part = values.reshape(len(sines), -1, len(rx)) @ of_rx.swapaxes(1, 2)
    part = part.reshape(len(cells), radar.n_tx, -1)
    beams = (part * of_tx.swapaxes(1, 2)).sum(axis=1)
    farthest = np.abs(there).max(axis=2) + np.abs(back).max(axis=2)
    # Where no element's path leaves the range bin, the product above is all there is to do.
    far = farthest.max(axis=0) > radar.range_bin_m
    if walk and range_m is not None and far.any():
        # Elements whose path ends in another range bin are read there. From one range bin to the
        # next the phase also turns by half a turn, because the window function is even about the
        # middle of the chirp.
        weights = of_tx[:, far][..., tx] * of_rx[:, far][..., which]
        excess = there[:, far][..., tx] + back[:, far][..., which]
        offsets = np.rint(excess / (2 * radar.range_bin_m))
        own = cells.reshape(len(sines), -1, *cells.shape[1:])
        beams[:, far] = 0
        for offset in range(-walk, walk + 1):
            read = weights * ((offsets == offset) * np.float32((-1) ** offset))
            added = own[:, :, walk + offset] @ read.swapaxes(1, 2)
            beams[:, far] += added.reshape(len(cells), -1)
    power = np.abs(beams / radar.n_channels) ** 2
    return np.asarray(power * (ahead >= 0))


@lru_cache(maxsize=16)
def _phased(radar: Radar) -> tuple[NDArray[np.int64], NDArray[np.int64], _Reals, _Reals, _Reals]:
    """Which antennas have phases of their own: all Tx, and each receiver at each carrier.

    There are several carriers under FDM alone. Returned are the Tx of each channel and its number
    among the receivers (channel,), places of these (receiver, 3) [m], and the carriers of the Tx
    and of the receivers [Hz].
    """
    tx, carrier = np.arange(radar.n_tx), radar.centre_frequency_hz + radar.tx_offset_hz
    channels = np.stack([radar.rx_of_tx.ravel(), carrier.repeat(radar.n_rx)])
    receivers, which = np.unique(channels, axis=1, return_inverse=True)
    places = radar.rx_m[receivers[0].astype(np.int64)]
    return tx.repeat(radar.n_rx), which.ravel(), places, carrier, receivers[1]


def _excess_m(direction: _Reals, places_m: _Reals, range_m: _Reals | float | None) -> _Reals:
    """Path (..., place) from a point to each place less the range, :eq:`near-field` [m].

    ``direction (..., axis)`` are the sines of the point along the axes of ``places_m (place,
    axis)``; without a range the wave is plane.
    """
    along = direction @ places_m.T
    if range_m is None:
        return np.asarray(-along)
    square = range_m**2 - 2 * range_m * along + (places_m**2).sum(axis=1)
    # Directions beyond the horizon, which a search may try, have no real path.
    return np.asarray(np.sqrt(np.maximum(square, 0.0)) - range_m)


def _phasors(excess_m: _Reals, carrier_hz: _Reals) -> NDArray[np.complex64]:
    """Phases (..., place) that bring places into step, each at its carrier."""
    # Whole turns are taken out in float64 before the angle goes to float32.
    turns = excess_m * (carrier_hz / SPEED_OF_LIGHT_MPS)
    angle = (-2 * np.pi * (turns - np.rint(turns))).astype(np.float32)
    return np.asarray(np.cos(angle) + np.complex64(1j) * np.sin(angle))


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
    # The vertex of a parabola through three points a step apart.
    bend = left - 2 * middle + right
    inside = (bend < 0) & (index > 0) & (index < last)
    # Beside what is no direction, where power is 0, a peak stays where it is, too.
    inside &= np.minimum(left, right) > math.log(least) + 1
    shift = np.clip(0.5 * (left - right) / np.where(inside, bend, -1.0), -0.5, 0.5) * inside
    sine = sines[index] + shift * (sines[1] - sines[0])
    return sine, np.exp(middle - 0.25 * (left - right) * shift)
