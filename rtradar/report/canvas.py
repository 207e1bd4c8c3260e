"""Units of power in all pictures, in place of square metres, their canvases, and what maps share.

Maps hold abs(amplitude)^2 [m^2] including the spreading loss 1 / (R1^2 R2^2)
(`rtradar.conventions`). Read as a cross-section, a person of 1 m^2 at 4 m would be 24 dB too low.
Pictures therefore use one of these units:

``dBm``
    Received power, if the radar states its transmit power.
``dBsm``
    Radar cross-section relative to 1 m^2, otherwise. The loss is removed with the range R of the
    cell: R^4 times the map. An echo on boresight shows its own cross-section, less the scalloping
    loss between two bins (at most 1.4 dB in range and as much in velocity for Hann windows). Noise
    shows as the cross-section of equal power, and so rises with range. Nothing is removed if
    amplitudes do not include the loss.
``dB re maximum``
    Decibels below the strongest value shown, for sums over ranges, as in a spectrogram or over all
    body parts, which have no single loss to remove. If the loss were removed before the sum, the
    noise of the farthest bins would dominate and hide the person. A level above the noise would
    have no meaning in runs without noise.
``dB re 1 count^2``
    The power itself, of samples that are the numbers of an ADC.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.process import measured_angles
from rtradar.process.window_functions import WindowName, noise_bandwidth_bins
from rtradar.radar import Radar
from rtradar.system.figure_style import DIVERGING, STYLE, dress, fit, theme_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

VELOCITY_LABEL = "Velocity [m/s] (positive: receding)"
"""Label of every velocity axis."""

COUNTS = "dB re 1 count^2"
"""Unit of the power of samples that are the numbers of an ADC."""

_COLUMNS = 600
"""Time steps in a picture, those of 3 s; longer maps are averaged, so that memory does not grow."""

_ROWS = 1024
"""Time steps of a map that are read at once."""

_NOISY = 0.02  # fraction of the detected ranges whose strongest angle may be one of noise

_QUANTITIES = {"dBm": "Received power", "dBsm": "RCS", "dB re maximum": "Power", COUNTS: "Power"}


@dataclass(frozen=True, eq=False)
class FieldUnit:
    """Unit of power in pictures, made by `field_unit`.

    ``scale`` is the factor from power [m^2] to the linear unit; it broadcasts with the powers.
    """

    name: str
    scale: float | NDArray[np.float64]

    @property
    def decibels(self) -> str:
        """Unit of a level, such as ``dBsm``; plain ``dB`` where it is relative to the maximum."""
        return self.name.split(" ")[0]

    def level(self, power_m2: ArrayLike) -> NDArray[np.float64]:
        """Convert powers [m^2] to levels in this unit [dB], about -380 dB for a power of 0."""
        # 0 has no logarithm; the least float32 stands for it.
        linear = np.asarray(power_m2, dtype=np.float64) * self.scale
        return np.asarray(10 * np.log10(np.maximum(linear, np.finfo(np.float32).tiny)))

    def label(self, qualifier: str = "") -> str:
        """Return the label of an axis, such as ``RCS, mean of channels [dBsm]``."""
        return f"{_QUANTITIES[self.name]}{', ' if qualifier else ''}{qualifier} [{self.name}]"


def field_unit(
    radar: Radar,
    *,
    spreading: bool = True,
    range_m: ArrayLike | None = None,
    strongest_m2: float = 1.0,
) -> FieldUnit:
    """Choose the unit of power in the pictures of a run, as this module's docstring explains.

    ``spreading`` tells whether amplitudes include the spreading loss. ``range_m`` are the ranges of
    the powers [m], of a shape that broadcasts with them, or None for sums over ranges.
    ``strongest_m2`` is the reference of ``dB re maximum`` [m^2].
    """
    if not spreading:
        return FieldUnit("dBsm", 1.0)
    if radar.transmit_power_dbm is not None:
        return FieldUnit("dBm", 1e3 * radar.watts_per_m2)
    if range_m is None:
        return FieldUnit("dB re maximum", 1 / max(strongest_m2, float(np.finfo(np.float32).tiny)))
    # The first bin begins at the antennas.
    distance = np.maximum(np.asarray(range_m, dtype=np.float64), radar.range_bin_m / 2)
    return FieldUnit("dBsm", distance**4)


def add_colour_bar(image: Any, axes: Sequence[Axes], label: str, **options: Any) -> None:
    """Put a colour bar beside axes that are dressed, with this label.

    In a figure whose axes have equal scales, it is as high as they are if ``compressed`` is its
    layout.
    """
    from matplotlib.image import AxesImage

    figure: Any = axes[0].get_figure(root=True)
    options = {"extend": "min" if isinstance(image, AxesImage) else "neither"} | options
    # The label is fitted to the height of the axes, which the bar is as high as.
    bounds = [one.get_position(original=True) for one in axes]
    height = max(one.y1 for one in bounds) - min(one.y0 for one in bounds)
    height_pt = 72 * height * figure.get_size_inches()[1]
    label = fit(label, height_pt, STYLE["axes.labelsize"])
    bar = figure.colorbar(image, ax=list(axes), label=label, **options)
    dress(bar.ax, grid=False)
    bar.outline.set_edgecolor(theme_of(axes[0]).faint)


# -- what pictures of one run and of several have in common ----------------------------------------


def angle_label(name: str, radar: Radar) -> str:
    """Label of the axis; without an array along z, azimuth is the angle of a cone."""
    if name == "azimuth" and measured_angles(radar) == ("azimuth",):
        return "Azimuth [°] (cone angle; elevation is not measured)"
    return f"{name.capitalize()} [°]"


def angle_view(
    power: NDArray[np.floating],
    angles: NDArray[np.float64],
    radar: Radar,
    ghosts: Sequence[tuple[float, float]] = (),
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the limits of angle and range that show what is detected, and ghosts.

    ``power`` (range, angle) is zero in ranges without a detection. Angles are fitted to where each
    range is strongest, because sidelobes of the array fill all angles. ``ghosts`` are their angles
    and ranges.
    """
    detected: NDArray[np.bool_] = np.asarray(power.any(axis=1))
    # Within 6 dB of the strongest angle of each range with detections.
    near = detected[:, None] & (power > power.max(axis=1, keepdims=True) / 4)
    counts = near.sum(axis=0)
    wide = fitted_limits(
        counts, angles, include=[one for one, _ in ghosts], handful=_NOISY * counts.sum()
    )
    return wide, fitted_limits(detected, radar.range_m, include=[one for _, one in ghosts])


def rdt_points(axes: Any, points: NDArray[np.float64], *, fastest: float, s: float) -> Any:
    """Draw points (point, 3) [s, m, m/s] in 3D, coloured by velocity up to ``fastest`` [m/s]."""
    axes.set(xlabel="Time [s]", ylabel="Range [m]", zlabel=VELOCITY_LABEL)
    few_ticks(axes, 5)
    colours = {"c": points[:, 2], "cmap": DIVERGING, "vmin": -fastest, "vmax": fastest}
    return axes.scatter(*points.T, s=s, **colours)


def few_ticks(axes: Any, most: int) -> None:
    """Leave axes in 3D so many steps at most between their ticks."""
    from matplotlib.ticker import MaxNLocator

    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(most))


def thinned(
    data: Any, times: NDArray[np.float64]
) -> tuple[NDArray[np.floating], NDArray[np.float64]]:
    """Return a map (time, ...) and its times [s], averaged to a few hundred steps.

    Parameters
    ----------
    data : (time, ...) xarray.DataArray or h5py.Dataset
        Map, of which a part at a time is read.
    times : (time,) float64
        Times of the map [s], or of its beginning, which is then all that is read.

    Returns
    -------
    power : (step, ...) float
        Mean of the map in each step.
    times : (step,) float64
        Mean time of each step [s].
    """
    count = len(times)
    every = max(1, math.ceil(count / _COLUMNS))
    if every == 1:
        return np.asarray(data[:count]), times
    at_once = every * max(1, _ROWS // every)  # each access to a file takes its time
    power = np.concatenate(
        [
            _means(np.asarray(data[first : min(first + at_once, count)]), every)
            for first in range(0, count, at_once)
        ]
    )
    return power, _means(times, every)


def spectrogram_power(
    maps: Any, radar: Radar, window: WindowName
) -> tuple[NDArray[np.floating], NDArray[np.float64]]:
    """Return the power (step, velocity) [m^2] of a spectrogram and its times [s], both `thinned`.

    One echo is spread over as many range bins as the ``window`` function of the range is wide.
    """
    power, times = thinned(maps["spectrogram"], np.asarray(maps["spectrogram_time"]))
    return power / noise_bandwidth_bins(window, radar.samples_per_chirp), times


def _means(values: NDArray[Any], every: int) -> NDArray[Any]:
    """Means of so many steps each, the last of what is left."""
    return np.stack([values[k : k + every].mean(axis=0) for k in range(0, len(values), every)])


# -- what pictures show of a map: limits of its axes, and what was not detected --------------------


HANDFUL = 3
"""Detections that may lie beyond each end of an axis, as false alarms do."""

_MASKED = 0.1  # fraction of the strongest cells
_FRACTION = 1e-3
_FLOOR, _BELOW_PEAK = 4.0, 1e-5  # 6 dB above the median, 50 dB below the peak
_MARGIN, _LEAST_BINS = 0.15, 8
_ASTRAY = 5e-3  # fraction of spatial points whose angle noise has set
_CENTRAL_PERCENT = 98


def fitted_limits(
    counts: ArrayLike,
    centres: NDArray[np.float64],
    *,
    include: ArrayLike = (),
    handful: float = HANDFUL,
) -> tuple[float, float]:
    """Return the limits of an axis that show where something is, and not where outliers are.

    At each end, a thousandth of the counts may lie outside, or a handful if that is more, but never
    more than a twentieth. The rest is inside, with a margin of 15 % of its extent, and at
    least eight bins in all. The limits never pass the ends of the axis, and are those ends
    if nothing is counted.

    Parameters
    ----------
    counts : (bin,) array_like
        Number of detections, or of other things to be shown, in each bin of the axis.
    centres : (bin,) float64
        Middle of each bin, evenly spaced and ascending.
    include : array_like
        Values of the axis that are shown whatever is counted, such as velocity 0.
    handful : float
        Number of counts that may lie outside at each end, `HANDFUL` if left out; more where more
        false alarms are expected.

    Returns
    -------
    low, high : float
        Limits in the unit of ``centres``.
    """
    number = np.asarray(counts, dtype=np.float64)
    step = float(centres[1] - centres[0]) if len(centres) > 1 else 1.0
    first, last = float(centres[0]) - step / 2, float(centres[-1]) + step / 2
    total = number.sum()
    if total == 0:
        return first, last
    # From either end, bins are passed until more than what may lie outside is behind.
    outside = min(max(_FRACTION * total, handful), total / 20)
    passed = np.cumsum(number)
    begin = int(np.argmax(passed > outside))
    end = len(number) - 1 - int(np.argmax(np.cumsum(number[::-1]) > outside))
    shown = [float(centres[begin]) - step / 2, float(centres[end]) + step / 2]
    # What must be shown widens the limits, if it is on the axis at all.
    shown += [float(value) for value in np.ravel(include) if first <= value <= last]
    low, high = min(shown), max(shown)
    margin = max(_MARGIN * (high - low), (_LEAST_BINS * step - (high - low)) / 2)
    return max(low - margin, first), min(high + margin, last)


def place_limits(values: NDArray[np.float64], own: float) -> tuple[float, float]:
    """Return the limits of a coordinate that show points but a few outliers, and the radar.

    Parameters
    ----------
    values : (point,) float64
        Coordinate of each point along one axis [m].
    own : float
        Coordinate of the radar [m].

    Returns
    -------
    low, high : float
        Limits [m].
    """
    if not len(values):
        return own - 1, own + 1
    # Points have no bins: a fine histogram over all of them and the radar makes some.
    low, high = min(float(values.min()), own), max(float(values.max()), own)
    margin = 0.2 * (high - low) + 0.05
    edges = np.linspace(low - margin, high + margin, 601)
    centres, counts = (edges[1:] + edges[:-1]) / 2, np.histogram(values, edges)[0]
    return fitted_limits(counts, centres, include=own, handful=_ASTRAY * len(values))


def central_limits(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the limits of most values of each column, without one in a hundred at either end.

    Parameters
    ----------
    values : (point, column) float64
        At least one row.

    Returns
    -------
    (2, column) float64
        Lower and upper limits.
    """
    half = (100 - _CENTRAL_PERCENT) / 2
    return np.asarray(np.percentile(values, (half, 100 - half), axis=0))


def above_floor(power: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Return where a map is more than its floor: 6 dB above its median, 50 dB below its peak.

    Parameters
    ----------
    power : array of float
        Power of the cells of a map, in linear units.

    Returns
    -------
    array of bool
        Whether a cell stands above both levels.
    """
    level = max(_FLOOR * float(np.median(power)), _BELOW_PEAK * float(power.max(initial=0)))
    return np.asarray(power > level)


def masking_note(power: NDArray[np.floating], mask: NDArray[np.bool_]) -> str:
    """Return how many of the strongest cells are not detected, in a sentence with the reason.

    As many of the strongest cells are looked at as cells are detected.

    Parameters
    ----------
    power : (range, velocity) float
        Power of one frame, in linear units.
    mask : (range, velocity) bool
        Detections.

    Returns
    -------
    str
        Sentence, which is empty if nine in ten are detected.
    """
    count = int(np.count_nonzero(mask))
    # A detector without masking would mark as many of the strongest cells as it detects.
    strongest = np.argsort(power, axis=None)[mask.size - count :]
    missed = int(np.count_nonzero(~mask.ravel()[strongest]))
    if missed <= _MASKED * count:
        return ""
    return (
        f"{missed} of the {count} strongest cells are not detected: strong cells about them raise "
        "the threshold there (self-masking of CFAR)."
    )
