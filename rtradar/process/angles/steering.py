"""The two virtual lines of the cross, and the phases by which a direction is told on them.

An echo that reaches Rx j from Tx i over L_ij metres stands in its range bin with the phase 2 pi f L_ij / c, f the middle of
the sweep. Tx and Rx of the y-line lie at (0, t, 0) and (0, q, 0) about the radar, so the way to a point P at range r is
|P|^2 - 2 t P_y + t^2 under the root: it depends on the sine u = P_y / r alone and tells nothing of the elevation. The z-line
tells w = P_z / r alike. Both sines are exact at any range, near field included.
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
from rtradar.radar import Radar

Taper = Literal["uniform", "taylor"]
"""Weights of the elements of a line."""

SIDE_LOBE_DB = 25.0
"""Side lobes of the Taylor taper below the main lobe, in the far field."""

_OVERSAMPLING = 4  # sines for each resolution cell of the longest line
_MOST_WEIGHTS = 2**29  # of one line for all ranges, 4 GB; the paper's have 2.5 million
_TAYLOR_EQUAL_LOBES = 4


@dataclass(frozen=True)
class Line:
    """One virtual line: the channels whose Tx and Rx both lie on it.

    Parameters
    ----------
    axis : {1, 2}
        World axis of the line, y or z.
    channels : (element,) int64
        Channel of each element, tx * n_rx + rx.
    tx_m, rx_m : (element,) float64
        Place of its Tx and of its Rx along the line, about the radar [m].
    """

    axis: int
    channels: NDArray[np.int64]
    tx_m: NDArray[np.float64]
    rx_m: NDArray[np.float64]

    def excess_m(self, sines: ArrayLike, range_m: float | None) -> NDArray[np.float64]:
        """Path over each element less twice the range, (..., element) [m].

        Parameters
        ----------
        sines : (...) float
            Sine of the direction along the line.
        range_m : float or None
            Range of the point; None for a plane wave.

        Notes
        -----
        Equation :eq:`near-field` of the theory page.
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
    """The y-line and the z-line; None where a line has fewer than two elements.

    Channels of a Tx on one line and an Rx on the other, which ``channels = "all"`` has, belong to neither.

    Raises
    ------
    InputError
        Where the radar has no such line at all.
    """
    lines = _line(radar, 1), _line(radar, 2)
    if not measures_angle(radar):
        raise InputError(
            f"angle: radar '{radar.name}' has no line of at least 2 channels; give a Tx and 2 Rx (or 2 Tx and an Rx) along y or z"
        )
    return lines


def measures_angle(radar: Radar) -> bool:
    """Whether there is a line of at least two channels.

    Parameters
    ----------
    radar : Radar

    Returns
    -------
    bool
    """
    return bool(measured_angles(radar))


def measured_angles(radar: Radar) -> tuple[str, ...]:
    """Which of ``azimuth`` and ``elevation`` the radar measures: two channels on a line tell the angle along it.

    Without a line along z, azimuth is the cone angle asin(y / r).

    Parameters
    ----------
    radar : Radar

    Returns
    -------
    tuple of str
    """
    lines = {"azimuth": radar.tx_y * radar.rx_y, "elevation": radar.tx_z * radar.rx_z}
    return tuple(name for name, channels in lines.items() if channels > 1)


def _line(radar: Radar, axis: int) -> Line | None:
    on_line = [
        np.arange(n) < along_y
        for n, along_y in ((radar.n_tx, radar.tx_y), (len(radar.rx), radar.rx_y))
    ]
    tx_there, rx_there = on_line if axis == 1 else [~there for there in on_line]
    tx, slot = np.nonzero(tx_there[:, None] & rx_there[radar.rx_of_tx])
    if len(tx) < 2:
        return None
    centre = radar.position_m[axis]
    places = radar.tx[tx, axis] - centre, radar.rx[radar.rx_of_tx[tx, slot], axis] - centre
    return Line(axis, np.asarray(tx * radar.n_rx + slot, dtype=np.int64), *places)


@lru_cache(maxsize=16)
def sine_grid(radar: Radar) -> NDArray[np.float64]:
    """Uniform grid of sines (sine,) within the unambiguous angle, fine enough for a parabola through three of them.

    Raises
    ------
    InputError
        Where the radar has no line at all, or one so long that there would be no end of sines.
    """
    largest = np.sin(np.radians(radar.max_angle_deg))
    apertures = [
        np.ptp(line.tx_m + line.rx_m) / radar.wavelength_m
        for line in virtual_lines(radar)
        if line is not None
    ]
    half = int(np.ceil(_OVERSAMPLING * largest * max(apertures))) + 1
    elements = max(len(line.channels) for line in virtual_lines(radar) if line is not None)
    if (2 * half + 1) * elements * radar.samples_per_chirp > _MOST_WEIGHTS:
        raise InputError(
            f"angle: radar '{radar.name}' has a line {max(apertures):.3g} wavelengths long, whose beams are too many to keep; "
            "lessen tx_spacing_wavelengths or rx_spacing_wavelengths"
        )
    grid = np.linspace(-largest, largest, 2 * half + 1)
    grid.flags.writeable = False
    return grid


def taper_weights(line: Line, taper: Taper) -> NDArray[np.float64]:
    """Weights of the elements (element,), sum 1, by their place on the virtual line."""
    if taper == "uniform":
        return np.full(len(line.channels), 1 / len(line.channels))
    from scipy.signal.windows import taylor  # here, for scipy.signal is slow to import

    places = line.tx_m + line.rx_m
    count = len(places)
    window = taylor(count, nbar=_TAYLOR_EQUAL_LOBES, sll=SIDE_LOBE_DB)
    # A line without gaps gets the window itself.
    weights = np.interp(places, np.linspace(places.min(), places.max(), count), window)
    return np.asarray(weights / weights.sum())


@lru_cache(maxsize=16)
def _taper(radar: Radar, axis: int, taper: Taper) -> NDArray[np.float64]:
    line = virtual_lines(radar)[axis - 1]
    assert line is not None
    return taper_weights(line, taper)


@lru_cache(maxsize=16)
def range_walk(radar: Radar) -> int:
    """Range bins on either side of a cell in which the elements see an echo of that cell from the side."""
    largest = float(sine_grid(radar)[-1])
    ways = [
        np.abs(line.tx_m + line.rx_m).max() for line in virtual_lines(radar) if line is not None
    ]
    return int(np.ceil(max(ways) * largest / 2 / radar.range_bin_m))


def steering(
    radar: Radar, axis: int, range_bins: NDArray[np.int64] | None, taper: Taper
) -> Steering:
    """Phases and range bins of a line for points at some ranges.

    Parameters
    ----------
    radar : Radar
    axis : {1, 2}
        Which line.
    range_bins : (bin,) int64 or None
        Ranges of the points, whose echoes are looked for in the bin nearest to half their path over each element; None for
        a plane wave, looked for in the bin of the cell alone (the far-field FFT): one entry, for all bins.
    taper : {"uniform", "taylor"}
        Weighting of the antennas along the line, see `taper_weights`.
    """
    line = virtual_lines(radar)[axis - 1]
    if line is None:
        raise InputError(
            f"angle: radar '{radar.name}' has no line of at least 2 channels along {'xyz'[axis]}; give it one"
        )
    reach, sines, own = range_walk(radar), sine_grid(radar), _taper(radar, axis, taper)
    weights = np.empty(
        (1 if range_bins is None else len(range_bins), len(line.channels), len(sines)),
        dtype=np.complex64,
    )
    carrier = radar.centre_frequency_hz + radar.tx_offset_hz[line.channels // radar.n_rx]
    runs = []
    for place in range(len(weights)):
        range_m = None if range_bins is None else radar.range_bin_m * int(range_bins[place])
        excess = line.excess_m(sines, range_m)
        steps = (
            np.zeros(excess.shape) if range_m is None else np.rint(excess / (2 * radar.range_bin_m))
        )
        offsets = np.clip(steps, -reach, reach).astype(np.int64)
        # From one range bin to the next the phase also turns by half a turn: the window is even about the middle of the chirp.
        turns = excess * (carrier / SPEED_OF_LIGHT_MPS) - offsets / 2
        weights[place] = (np.exp(-2j * np.pi * turns) * own).T
        runs.append(_runs(offsets.T + reach))
    return Steering(weights, np.concatenate(runs), np.cumsum([0, *map(len, runs)]))


# Both lines of two radars; 20 MB each, all at once: so memory stays the same wherever somebody goes.
@lru_cache(maxsize=4)
def steering_everywhere(radar: Radar, axis: int) -> Steering:
    """`steering` for every range bin of a radar, with the Taylor taper."""
    return steering(radar, axis, np.arange(radar.samples_per_chirp), "taylor")


def _runs(offsets: NDArray[np.int64]) -> NDArray[np.int64]:
    """Stretches of sines along which an element is read at the same offset, from offsets (element, sine)."""
    n_sines = offsets.shape[1]
    fresh = np.ones(offsets.shape, dtype=np.bool_)
    fresh[:, 1:] = np.diff(offsets, axis=1) != 0
    element, first = np.nonzero(fresh)
    last = np.append(first[1:], 0)
    return np.stack(
        [element, offsets[element, first], first, np.where(last == 0, n_sines, last)], axis=1
    )
