"""What pictures show of a map: fitted limits of its axes, and what was not detected."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

HANDFUL = 3
"""Detections that may lie beyond each end of an axis, as false alarms do."""

_MASKED = 0.1  # fraction of the strongest cells
_FRACTION = 1e-3
_FLOOR, _BELOW_PEAK = 4.0, 1e-5  # 6 dB above the median, 50 dB below the peak
_MARGIN, _LEAST_BINS = 0.15, 8
_ASTRAY = 5e-3  # fraction of spatial points whose angle is that of noise
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
    outside = min(max(_FRACTION * total, handful), total / 20)
    passed = np.cumsum(number)
    begin = int(np.argmax(passed > outside))
    end = len(number) - 1 - int(np.argmax(np.cumsum(number[::-1]) > outside))
    shown = [float(centres[begin]) - step / 2, float(centres[end]) + step / 2]
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
    strongest = np.argsort(power, axis=None)[mask.size - count :]
    missed = int(np.count_nonzero(~mask.ravel()[strongest]))
    if missed <= _MASKED * count:
        return ""
    return (
        f"{missed} of the {count} strongest cells are not detected: strong cells about them raise "
        "the threshold there (self-masking of CFAR)."
    )
