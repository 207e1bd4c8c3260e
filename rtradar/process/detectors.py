"""Detectors by their names: of power alone, and of all channels, which give directions too.

One of all channels is here: the chain of the "out of box" demo of Texas Instruments. The demo of
the mmWave SDK (its documents "Object Detection Data-path Processing Chain" and "CFAR and angle of
arrival") sums logarithms of the magnitudes of all virtual antennas, so that a cell of the heat map
is a mean of decibels. CFAR compares it with the mean of cells beside it, over Doppler and over
range, by a threshold in decibels. Of neighbours only the strongest stays. One FFT over the
horizontal antennas gives the azimuth of each cell, and the phase between the rows of antennas its
elevation. Static clutter is removed before, as `rtradar.process.clutter_removal` does by the mean
over the frame.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from rtradar.errors import InputError, prefixed
from rtradar.front_end import Chip
from rtradar.process.window_functions import DEFAULT_WINDOWS, WindowFunctions, weights
from rtradar.radar import Radar
from rtradar.signal.multiplexing import tell_apart
from rtradar.system.registries import DETECTORS

Detector = Callable[[NDArray[np.floating]], NDArray[np.bool_]]
"""Power (range, velocity) in, mask of the same shape out."""

PointDetector = Callable[
    [NDArray[np.complexfloating]], tuple[NDArray[np.bool_], NDArray[np.float64]]
]
"""Range spectra (cycle, tx, rx, range) in; mask (range, velocity) out, and for each cell of it, in
the order of ``np.argwhere``, the sines (cell, 2) of its direction along y and z, NaN where one is
not measured."""

register_detector = DETECTORS.register

_GIVEN = ("power", "cube", "radar", "pfa", "looks", "window_functions")
"""Parameters that are no options."""


def build_detector(
    name: str, *, pfa: float, looks: int, options: Mapping[str, Any] | None = None
) -> Detector:
    """Detector of a name, for a false-alarm rate and a number of looks.

    Parameters
    ----------
    name : str
        Name in `DETECTORS`.
    pfa : float
        Asked false-alarm rate of each cell.
    looks : int
        Channels summed in the power.
    options : mapping, optional
        Further keywords of the detector, such as ``guard`` of ``os-cfar``.

    Returns
    -------
    callable
        From power (range, velocity) to a bool mask of the same shape.

    Raises
    ------
    InputError
        Where there is no such detector, it has no such option, or it takes all channels.
    ExtensionError
        Where it comes from another package, and fails; also when it is called.
    """
    find = _found(name, options or {})
    if takes_channels(name):
        raise InputError(f"detector '{name}' takes all channels of a frame, not their power alone")

    def detect(power: NDArray[np.floating]) -> NDArray[np.bool_]:
        with DETECTORS.guarded(name):
            mask = np.asarray(find(power, pfa=pfa, looks=looks, **(options or {})))
        if mask.dtype != np.bool_ or mask.shape != power.shape:
            raise DETECTORS.refuse(
                name, f"gave {mask.dtype} of shape {mask.shape}, not bool of shape {power.shape}"
            )
        return mask

    return detect


def build_point_detector(
    name: str,
    radar: Radar,
    *,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
    options: Mapping[str, Any] | None = None,
) -> PointDetector:
    """Detector of a name that takes all channels and gives the direction of each cell.

    Parameters
    ----------
    name : str
        Name in `DETECTORS`, of a detector that `takes_channels`.
    radar : Radar
        Radar that received the frames.
    window_functions : WindowFunctions
        Window functions of the maps.
    options : mapping, optional
        Further keywords of the detector, such as ``max_points`` of ``ti-oob``.

    Returns
    -------
    callable
        From range spectra (cycle, tx, rx, range) to a mask (range, velocity) and sines (cell, 2).

    Raises
    ------
    InputError
        Where there is no such detector, or it has no such option.
    ExtensionError
        Where it comes from another package, and fails; also when it is called.
    """
    find = _found(name, options or {})

    def detect(
        cube: NDArray[np.complexfloating],
    ) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
        with DETECTORS.guarded(name):
            found = find(cube, radar, window_functions=window_functions, **(options or {}))
            mask, sines = (np.asarray(values) for values in found)
        shape = cube.shape[3], cube.shape[0]
        wanted = int(np.count_nonzero(mask)), 2
        if mask.dtype != np.bool_ or mask.shape != shape or sines.shape != wanted:
            raise DETECTORS.refuse(
                name,
                f"gave {mask.dtype} of shape {mask.shape} and sines of shape {sines.shape}, not "
                f"bool of shape {shape} and sines of shape {wanted}",
            )
        return mask, sines.astype(np.float64)

    return detect


def takes_channels(name: str) -> bool:
    """Tell whether a detector takes all channels, as ``cube``, in place of ``power``.

    Parameters
    ----------
    name : str
        Name in `DETECTORS`.

    Returns
    -------
    bool

    Raises
    ------
    InputError, ExtensionError
        Where there is no such detector, or it cannot be loaded.
    """
    return "cube" in _parameters(DETECTORS.find(name))


def _found(name: str, options: Mapping[str, Any]) -> Callable[..., Any]:
    """Find a detector; InputError if it has not all of these options."""
    find = DETECTORS.find(name)
    allowed = [key for key in _parameters(find) if key not in _GIVEN]
    for option in options:
        if option not in allowed:
            raise InputError(
                f"detector '{name}' has no option '{option}'; "
                f"allowed: {', '.join(allowed) or 'none'} (--detector-option)"
            )
    return find


def _parameters(find: Callable[..., Any]) -> list[str]:
    try:
        return list(inspect.signature(find).parameters)
    except (TypeError, ValueError):  # of some compiled functions
        return []


# -- points as chips of Texas Instruments make them -----------------------------------------------

ANGLE_BINS = 64
"""Bins of the azimuth FFT, which lie evenly over the sine from -1 to 1."""

_GROUPED = {"both": (3, 3), "range": (1, 3), "doppler": (3, 1), "none": (1, 1)}
"""Cells (Doppler, range) about a cell among which it must be the strongest, by ``grouping``."""

_SAME_ROW = 0.1  # of a wavelength: antennas so near in height are in one row

_Reals = NDArray[np.float64]


def ti_oob(
    cube: NDArray[np.complexfloating],
    radar: Radar,
    *,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
    threshold_db: float | None = None,
    max_points: int | None = None,
    cfar_axes: str | None = None,
    grouping: str | None = None,
) -> tuple[NDArray[np.bool_], _Reals]:
    """Points of one frame as the chips of Texas Instruments make them.

    Parameters
    ----------
    cube : (cycle, tx, rx, range) complex
        Range spectra of one frame, without static clutter.
    radar : Radar
        Radar under TDM or BPM, whose ``chip`` says how it detects.
    window_functions : WindowFunctions
        Window functions, of which that in slow time is applied.
    threshold_db : float, optional
        Level of a cell above the noise beside it, over both axes, in place of the chip's own [dB].
    max_points : int, optional
        Largest number of points, in place of the chip's own. The list is filled in the order of the
        chip: by Doppler bin, from that of no speed on, the receding ones first, then by range.
    cfar_axes, grouping : str, optional
        Axes of CFAR and of peak grouping, see `Chip`, in place of the chip's own.

    Returns
    -------
    mask : (range, velocity) bool
        Cells that are points.
    sines : (cell, 2) float64
        Sines of the direction along the radar's y and z of each cell, in the order of
        ``np.argwhere(mask)``; NaN where the array does not measure one.

    Raises
    ------
    InputError
        Where an option is out of its range, or the radar multiplexes otherwise.
    """
    if radar.multiplexing not in ("tdm", "bpm"):
        raise InputError(
            f"detector ti-oob: radar '{radar.name}' has multiplexing = '{radar.multiplexing}'; the "
            "chain is that of tdm and bpm"
        )
    given: dict[str, Any] = {
        "threshold_db": threshold_db,
        "doppler_threshold_db": threshold_db,
        "max_points": max_points,
        "cfar_axes": cfar_axes,
        "grouping": grouping,
    }
    with prefixed("detector ti-oob: "):
        chip = replace(
            radar.chip or Chip(), **{key: own for key, own in given.items() if own is not None}
        )
    spectra, n_cycles = _spectra(cube, radar, window_functions), len(cube)
    level_db = _heat_map(spectra)
    detected = np.ones(level_db.shape, dtype=np.bool_)
    if chip.cfar_axes != "range":
        beside = _around(level_db, chip.doppler_mode, chip.doppler_noise, chip.doppler_guard)
        detected &= level_db > chip.doppler_threshold_db + beside
    if chip.cfar_axes != "doppler":
        beside = _along(level_db, chip.range_mode, chip.range_noise, chip.range_guard)
        detected &= level_db > chip.threshold_db + beside
    # Peak grouping; the Doppler axis is a circle, and beyond the range axis there is nothing.
    beyond = np.pad(level_db, ((0, 0), (1, 1)), constant_values=-np.inf)
    neighbours = maximum_filter(beyond, size=_GROUPED[chip.grouping], mode="wrap")[:, 1:-1]
    doppler, row = np.nonzero(detected & (level_db >= neighbours))
    doppler, row = doppler[: chip.max_points], row[: chip.max_points]
    column = (doppler + n_cycles // 2) % n_cycles
    mask = np.zeros((cube.shape[3], n_cycles), dtype=np.bool_)
    mask[row, column] = True
    order = np.lexsort((column, row))
    values = spectra[doppler[order], :, :, row[order]]
    return mask, _sines(values, radar)


def _spectra(
    cube: NDArray[np.complexfloating], radar: Radar, window_functions: WindowFunctions
) -> NDArray[np.complexfloating]:
    """Spectra (doppler, tx, rx, range) of range spectra, as if all Tx had transmitted at once."""
    window = weights(window_functions.doppler, len(cube)).astype(cube.real.dtype)
    spectra = scipy.fft.fft(cube * window[:, None, None, None], axis=0)
    velocity = np.fft.ifftshift(radar.velocity_mps(len(cube)))
    # The Tx transmit one after the other, while targets move on: their phases are turned back.
    turns = np.outer(velocity * (2 / radar.wavelength_m), radar.tx_delay_s)
    still = np.exp(-2j * np.pi * turns).astype(spectra.dtype)
    return tell_apart(spectra * still[:, :, None, None], radar)


def _heat_map(spectra: NDArray[np.complexfloating]) -> _Reals:
    """Level of each cell (doppler, range) [dB], the mean over the virtual antennas."""
    power = np.square(spectra.real) + np.square(spectra.imag)
    least = np.finfo(np.float32).tiny
    return np.asarray(10 * np.log10(np.maximum(power, least)).mean(axis=(1, 2)), dtype=np.float64)


_OF_BOTH = {"cago": np.max, "caso": np.min}
"""Which of the means of both sides is the noise, by the mode of CFAR."""


def _around(level_db: _Reals, mode: str, noise: int, guard: int) -> _Reals:
    """Noise beside each cell over Doppler, which is a circle, of cells (doppler, range) [dB]."""
    count = len(level_db)
    near = {step % count for step in range(-guard, guard + 1)}
    far = range(guard + 1, guard + noise + 1)
    sides = [{sign * step % count for step in far} - near for sign in (-1, 1)]
    if not all(sides):
        raise InputError(
            f"detector ti-oob: {count} Doppler bins leave no cell for the noise beside one; take "
            f"at least {2 * guard + 2} cycles in a frame (frame_duration_s)"
        )
    # On a short circle both sides have cells in common, each of which counts once in their mean.
    sides = [sides[0] | sides[1]] if mode == "ca" else sides
    means = [
        np.mean([np.roll(level_db, step, axis=0) for step in sorted(side)], axis=0)
        for side in sides
    ]
    return np.asarray(_OF_BOTH.get(mode, np.mean)(means, axis=0))


def _along(level_db: _Reals, mode: str, noise: int, guard: int) -> _Reals:
    """Noise beside each cell over range, of cells (doppler, range) [dB].

    At the ends of the axis one side is whole, which counts alone; infinite where none is.
    """
    means = np.full((2, *level_db.shape), np.nan)
    total = np.cumsum(np.pad(level_db, ((0, 0), (1, 0))), axis=1)
    whole = level_db.shape[1] - guard - noise
    if whole > 0:
        sums = (total[:, noise:] - total[:, :-noise]) / noise
        means[0, :, guard + noise :] = sums[:, :whole]
        means[1, :, :whole] = sums[:, -whole:]
    # A side that is not whole gives way to the other.
    means = np.where(np.isnan(means), means[::-1], means)
    return np.nan_to_num(_OF_BOTH.get(mode, np.mean)(means, axis=0), nan=np.inf)


def _sines(values: NDArray[np.complexfloating], radar: Radar) -> _Reals:
    """Sines of direction (cell, 2) of cells (cell, tx, rx) without their motion in a cycle."""
    still = values.reshape(len(values), radar.n_channels)
    y, z = radar.virtual_m.T[1:] / radar.wavelength_m
    row = np.unique(np.rint(z / _SAME_ROW), return_inverse=True)[1]
    rows = [np.flatnonzero(row == number) for number in range(row.max() + 1)]
    found = np.full((len(values), 2), np.nan)
    along = np.zeros(len(values))
    longest = max(rows, key=len)
    if np.ptp(y[longest]) > 0:
        grid = np.arange(-ANGLE_BINS // 2, ANGLE_BINS // 2) / (ANGLE_BINS / 2)
        spectrum = still[:, longest] @ np.exp(2j * np.pi * np.outer(y[longest], grid))
        found[:, 0] = along = grid[np.abs(spectrum).argmax(axis=1)]
    steered = still * np.exp(2j * np.pi * np.outer(along, y))
    sums = np.stack([steered[:, own].mean(axis=1) for own in rows], axis=1)
    heights = np.array([z[own].mean() for own in rows])
    if len(rows) > 1:
        steps = np.diff(heights)
        nearest = steps < steps.min() + _SAME_ROW
        between = (sums[:, :-1] * sums[:, 1:].conj())[:, nearest].sum(axis=1)
        found[:, 1] = np.angle(between) / (2 * np.pi * steps[nearest].mean())
    return found
