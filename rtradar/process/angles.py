"""Directions of echoes: power over the sines of the two virtual lines, its peaks, and its maps.

The phase :eq:`tdm-phase` is removed with the velocity of the cell; an echo faster than the
unambiguous velocity keeps a part of it, and appears in a wrong direction
(`rtradar.scatter.validity.folded_angle_deg`).

Both lines together measure :eq:`direction`. A radar with one line alone measures the cone about
that line: along y azimuth is asin(u), the cone angle, which is the true azimuth only at the height
of the radar, and elevation is not measured; along z azimuth is not.

Off the boresight an echo reaches the ends of the line up to several range bins before and behind
its cell (12 GHz: 1 bin at 14 degrees, 2 at 30, 3.4 at the unambiguous 59). Each element is
therefore read in the bin where the echo from that direction lies. Read in the cell alone, a point
off the boresight would appear weaker and in a wider beam, and beside its direction if it moved, for
the elements would receive it at different times.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.cells import add_interpolated, beam_power, highest_maxima
from rtradar.process.spectra import cell_spectra, range_spectrum, whole_cycles
from rtradar.process.steering import (
    Taper,
    cuts_through_highest,
    range_walk,
    refine,
    sine_grid,
    steering,
    steering_everywhere,
    virtual_lines,
)
from rtradar.process.window_functions import DEFAULT_WINDOWS, WindowFunctions
from rtradar.radar import Radar
from rtradar.signal.multiplexing import tell_apart
from rtradar.system.threads import thread_map

MOST_PEAKS = 3
"""Peaks taken of one spectrum."""

BELOW_HIGHEST_DB = 6.0
"""Peaks further below the highest are left out [dB]. Off the boresight, elements read different
range bins: in a cell beside a strong, fast echo its side lobes in range and angle meet.
``validation/closed_forms/spatial_cloud.py`` counts the points that are of no body part: 4 % of
those of a walk at 6 dB, 9 % at 10 dB."""

ABOVE_MEDIAN_DB = 11.0
"""Peaks, except the highest, nearer to the median of their spectrum are left out as well [dB];
noise alone exceeds it in 2 of 100 spectra."""

_CELLS_A_THREAD = 64

_Reals = NDArray[np.float64]


@dataclass(frozen=True)
class AngleSpectra:
    """Power over the sine of direction of range-Doppler cells, on each virtual line.

    Parameters
    ----------
    sines : (sine,) float64
        Uniform grid within the unambiguous angle.
    y, z : (cell, sine) float32, or None
        Power over u = y / r and over w = z / r; an echo of amplitude 1 in every channel reads 1.
        None where the radar has no such line.
    range_m : (cell,) float64
        Range of the cells [m].
    velocity : (cell,) float64
        Range rate of the cells [m/s].
    """

    sines: NDArray[np.float64]
    y: NDArray[np.float32] | None
    z: NDArray[np.float32] | None
    range_m: NDArray[np.float64]
    velocity: NDArray[np.float64]


def angle_spectra(
    values: NDArray[np.complexfloating],
    radar: Radar,
    range_m: ArrayLike,
    velocity: ArrayLike,
    *,
    focus: bool = True,
    taper: Taper = "taylor",
) -> AngleSpectra:
    """Power over direction of range-Doppler cells, without the motion within a TDM cycle.

    The phases :eq:`tdm-phase` are removed; elements are added along :eq:`near-field`.

    Parameters
    ----------
    values : (cell, offset, channel) complex
        Values from `cell_spectra`.
    radar : Radar
        Radar that gives the array.
    range_m : (cell,) float
        Range of each cell [m]; the nearest range bin counts.
    velocity : (cell,) float
        Range rate of each cell [m/s].
    focus : bool
        Steer with the exact path over each element at the range of the cell; else with plane waves,
        which is a far-field FFT.
    taper : {"taylor", "uniform"}
        Weights along the line. ``taylor`` (side lobes at -25 dB) for several echoes in a cell: a
        uniform line has side lobes at -13 dB, and two that meet pass for an echo; Hann widens the
        beam by 63 %, this by 20 %. ``uniform`` for a single echo.

    Returns
    -------
    AngleSpectra

    Raises
    ------
    InputError
        Where the shapes do not fit each other or the radar, a number is not finite, a range lies
        outside the map, or the radar has no line of at least 2 channels.
    """
    cells, lines = np.asarray(values), virtual_lines(radar)
    ranges, rates = np.asarray(range_m, dtype=np.float64), np.asarray(velocity, dtype=np.float64)
    bins = _checked_bins(cells, ranges, rates, radar)
    # Phase that a moving echo gains between the Tx of one cycle, and phase of its path there and
    # back by its Tx's own carrier.
    turns = np.outer(rates * (2 / radar.wavelength_m), radar.tx_delay_s)
    turns += np.outer(bins * (2 * radar.range_bin_m / SPEED_OF_LIGHT_MPS), radar.tx_offset_hz)
    # The same conjugate phase for all Rx of a Tx: they receive the same chirp.
    samples = cells.astype(np.complex64, copy=False)
    still = np.exp(-2j * np.pi * turns).astype(np.complex64).repeat(radar.n_rx, axis=1)
    # Under BPM the chirps of a cycle hold all Tx with signs. Only with the motion between chirps
    # taken out are they told apart.
    if radar.multiplexing == "bpm":
        turned = np.moveaxis(samples * still[:, None], 1, -1)
        parted = tell_apart(turned.reshape(len(cells), radar.n_tx, radar.n_rx, -1), radar)
        samples = np.moveaxis(parted.reshape(turned.shape), -1, 1).copy()
        still = np.ones_like(still)

    # Antennas anywhere have no lines; the beam is steered in both sines at once.
    if not radar.is_cross:
        known_bins = bins if focus else None
        cuts = cuts_through_highest(
            samples * still[:, None], known_bins, radar, sine_grid(radar), range_walk(radar)
        )
        return AngleSpectra(sine_grid(radar), *cuts, ranges, rates)

    def power(axis: int) -> NDArray[np.float32] | None:
        line = lines[axis - 1]
        if line is None:
            return None
        result = np.empty((len(cells), len(sine_grid(radar))), dtype=np.float32)
        # Weights are found by the range bin: one set for all bins in the far field; all bins, kept,
        # for the taper that runs use; and else only the bins that occur.
        if not focus:
            known, place = steering(radar, axis, None, taper), np.zeros_like(bins)
        elif taper == "taylor":
            known, place = steering_everywhere(radar, axis), bins
        else:
            used, place = np.unique(bins, return_inverse=True)
            known = steering(radar, axis, used, taper)

        def fill(first: int) -> None:
            end = min(first + _CELLS_A_THREAD, len(samples))
            beam_power(first, end, samples, still, place, line.channels, known, result)

        thread_map(fill, range(0, len(samples), _CELLS_A_THREAD))
        return result

    return AngleSpectra(sine_grid(radar), power(1), power(2), ranges, rates)


def _checked_bins(
    cells: NDArray[np.generic], ranges: _Reals, rates: _Reals, radar: Radar
) -> NDArray[np.int64]:
    """Range bins (cell,) of cells whose arrays fit each other and the radar."""
    needed = (2 * range_walk(radar) + 1, radar.n_channels)
    count = cells.shape[:1]
    if cells.ndim != 3 or cells.shape[1:] != needed or not count == ranges.shape == rates.shape:
        raise InputError(
            f"angle: values, range_m and velocity have shapes {cells.shape}, {ranges.shape} and "
            f"{rates.shape}; radar '{radar.name}' needs (cell, {needed[0]}, {needed[1]}), (cell,) "
            "and (cell,)"
        )
    if not all(np.isfinite(array).all() for array in (cells, ranges, rates)):
        raise InputError(
            "angle: values, range_m or velocity hold NaN or infinity; all must be finite"
        )
    bins = np.rint(ranges / radar.range_bin_m).astype(np.int64)
    if len(bins) and not 0 <= bins.min() <= bins.max() < radar.samples_per_chirp:
        raise InputError(
            f"angle: range_m must lie between 0 and {radar.range_m[-1]:.3f} m, the last range bin"
        )
    return bins


def angle(
    x: ArrayLike,
    radar: Radar,
    range_m: float,
    velocity: float,
    focus: bool = True,
    *,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
) -> tuple[float, float]:
    """Direction of the strongest echo in one range-Doppler cell (:eq:`direction`).

    Parameters
    ----------
    x : (chirp, rx, sample) complex
        IF samples of one frame; chirp 0 comes from Tx 0. Whole TDM cycles are used.
    radar : Radar
        Radar that gives schedule and array.
    range_m, velocity : float
        Range [m] and range rate [m/s] in the middle of the frame; the nearest cell of the map is
        taken.
    focus : bool
        See `angle_spectra`.
    window_functions : WindowFunctions
        Window functions in fast time and in slow time.

    Returns
    -------
    azimuth, elevation : float
        Angles in the radar's frame [rad], within its unambiguous angle; NaN where the radar has no
        line for it. Without a line along z azimuth is the cone angle asin(y / r).

    Raises
    ------
    InputError
        Where the shape does not fit the radar, a sample is not finite, the cell lies outside the
        map or holds nothing, or the radar has no line of at least 2 channels.
    """
    virtual_lines(radar)
    spectra = range_spectrum(np.asarray(x), radar, window_functions=window_functions)
    n_cycles = whole_cycles("angle", spectra, radar)
    last = radar.samples_per_chirp - 1
    # The cell that is meant, as bins of range and of Doppler.
    row = _nearest("range_m", range_m, radar.range_bin_m, 0, last)
    step = radar.wavelength_m / (2 * n_cycles * radar.cycle_duration_s)
    column = _nearest("velocity", velocity, step, -n_cycles / 2, n_cycles / 2)
    cube = spectra[: n_cycles * radar.n_tx].reshape(n_cycles, radar.n_tx, radar.n_rx, -1)
    cell = [row], [(column + n_cycles // 2) % n_cycles]
    # The strongest direction on each line; the azimuth follows with that elevation.
    values = cell_spectra(cube, radar, *cell, window_functions=window_functions)
    at = [row * radar.range_bin_m], [column * step]
    found = angle_spectra(values, radar, *at, focus=focus, taper="uniform")
    u, w = (_peak(found.sines, power) for power in (found.y, found.z))
    azimuth = math.asin(max(-1.0, min(1.0, u / math.sqrt(1 - w * w))))
    return (math.nan if found.y is None else azimuth, math.nan if found.z is None else math.asin(w))


def _nearest(name: str, value: float, step: float, least: float, largest: float) -> int:
    """The nearest of the bins; InputError where the value is half a bin or more outside, or NaN."""
    if not least - 0.5 < value / step < largest + 0.5:
        raise InputError(
            f"angle: {name} = {value}; it must lie between {least * step:.3f} and "
            f"{largest * step:.3f}, the ends of the map"
        )
    return round(value / step)


def _peak(sines: NDArray[np.float64], power: NDArray[np.float32] | None) -> float:
    if power is None:
        return 0.0
    if not power.max() > 0:
        raise InputError("angle: the cell holds no echo at all; choose one that was detected")
    return float(refine(sines, power, power.argmax(axis=1)[:, None])[0][0, 0])


@dataclass(frozen=True)
class Peaks:
    """Highest maxima (cell, peak) of spectra, the strongest first, refined between grid points.

    ``real`` is False where a cell has fewer peaks; sine and power are then those of its strongest.
    A cell with any power has a peak.
    """

    sine: NDArray[np.float64]
    power: NDArray[np.float64]
    real: NDArray[np.bool_]


def find_peaks(sines: NDArray[np.float64], power: NDArray[np.float32]) -> Peaks:
    """Up to `MOST_PEAKS` maxima of each spectrum (cell, sine), neither side lobes nor noise."""
    index = np.empty((len(power), MOST_PEAKS), dtype=np.int64)
    count = np.empty(len(power), dtype=np.int64)
    below, above = (np.float32(10 ** (db / 10)) for db in (-BELOW_HIGHEST_DB, ABOVE_MEDIAN_DB))
    highest_maxima(power, below, above, index, count)
    real = np.arange(MOST_PEAKS) < count[:, None]
    return Peaks(*refine(sines, power, index), real)


# -- maps over range and angle ---------------------------------------------------------------------


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
    # A direction at elevation e has u = sin(azimuth) cos(e), so that azimuths are read at shorter
    # sines.
    w = 0.0 if spectra.z is None else spectra.sines[spectra.z.argmax(axis=1), None]
    return _map(spectra, "y", np.sqrt(1 - w**2) * np.sin(angle_grid(radar)), radar)


def range_elevation(spectra: AngleSpectra, radar: Radar) -> NDArray[np.float64]:
    """Power over range and elevation, summed over cells; the z-line measures w = sin(elevation).

    Parameters
    ----------
    spectra, radar
        What they are for `range_azimuth`.

    Returns
    -------
    (range, elevation) float64
        Power as that of `range_azimuth`.

    Raises
    ------
    InputError
        Where the radar has no z-line.
    """
    return _map(spectra, "z", np.sin(angle_grid(radar)), radar)


def _map(spectra: AngleSpectra, line: str, sines: _Reals, radar: Radar) -> _Reals:
    """Power of each cell on a line read at its own sines (cell, angle), summed by range bin."""
    power: NDArray[np.float32] | None = getattr(spectra, line)
    if power is None:
        raise InputError(
            f"range-{'azimuth' if line == 'y' else 'elevation'} map: radar '{radar.name}' has no "
            f"line of at least 2 channels along {line}; give it one"
        )
    total = np.zeros((radar.samples_per_chirp, sines.shape[-1]))
    # A read-only array is another type to Numba, which would compile everything again for it.
    own = np.array(np.broadcast_to(sines, (len(power), sines.shape[-1])), order="C")
    bins = np.rint(spectra.range_m / radar.range_bin_m).astype(np.int64)
    grid = spectra.sines
    add_interpolated(power, own, grid[0], grid[1] - grid[0], bins, total)
    return total
