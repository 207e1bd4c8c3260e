"""Features of clouds: a few statistics that the baselines use in place of the points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds.collection import Collection
from rtradar.errors import InputError

_PERCENTILES = (5, 25, 50, 75, 95)
_TIME_BINS = 8

METADATA = (
    "duration_s",
    "heading_deg",
    "snr_db",
    "height_m",
    "build",
    "tempo",
    "amplitude",
    "side",
    "person_position_m",
    "radar_position_m",
    "radar",
    "scene",
    "fidelity",
)
"""Provenance entries that state how a cloud was made, not what it shows.

Entries that a data set lacks are left out.
"""


def rdt_features(clouds: Collection) -> NDArray[np.float64]:
    """Compute simple features of RDT clouds, (cloud, feature).

    For time and range from the middle of the cloud and for velocity, these are the standard
    deviation, the minimum, the maximum and the 5th, 25th, 50th, 75th and 95th percentile. Then
    follow the three correlations, the fraction of points slower than 0.5 m/s, and the mean and
    spread of velocity in each eighth of the time. The features of an empty cloud are those of one
    point at zero.
    """
    return np.stack([_rdt(clouds.points(index)) for index in range(len(clouds))])


def spatial_features(clouds: Collection) -> NDArray[np.float64]:
    """Compute simple features of spatial clouds, (cloud, feature).

    For x and y from the middle of the cloud and for z, these are the statistics of `rdt_features`.
    Then follow the three correlations and the logarithm of the number of points plus 1. The
    features of a coordinate that the radar does not measure are 0.
    """
    return np.stack([_spatial(clouds.spatial(index)) for index in range(len(clouds))])


def metadata_features(clouds: Collection) -> NDArray[np.float64]:
    """Return the `METADATA` that all clouds have, (cloud, feature); names are one-hot encoded."""
    columns = [feature for name in METADATA for feature in _metadata(clouds, name)]
    return np.stack(columns, axis=1) if columns else np.zeros((len(clouds), 1))


def _metadata(clouds: Collection, name: str) -> list[NDArray[np.float64]]:
    try:
        column = clouds.column(name).tolist()
    except (KeyError, InputError):
        return []
    try:
        numbers = np.array(
            [np.nan if value is None else value for value in column], dtype=np.float64
        )
    except (TypeError, ValueError):  # names, or lists of several lengths
        names = np.array([str(value) for value in column])
        return [(names == value).astype(np.float64) for value in np.unique(names)]
    # A position has several columns. Infinity (an SNR without noise) and unknown values become
    # finite numbers of their own.
    numbers = np.nan_to_num(numbers.reshape(len(column), -1), nan=-1e6, posinf=1e6, neginf=-1e6)
    return list(numbers.T)


def _rdt(points: NDArray[np.float64]) -> NDArray[np.float64]:
    if not len(points):
        points = np.zeros((1, 3))
    middle = np.array([points[:, 0].mean(), points[:, 1].mean(), 0.0])
    centred = points - middle
    time, velocity = centred[:, 0], centred[:, 2]
    edges = np.linspace(time.min(), time.max(), _TIME_BINS + 1)
    place = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, _TIME_BINS - 1)
    in_bins = [velocity[place == number] for number in range(_TIME_BINS)]
    moments = [
        value
        for some in in_bins
        for value in ((some.mean(), some.std()) if len(some) else (0.0, 0.0))
    ]
    return np.concatenate([_shape(centred), [np.mean(np.abs(velocity) < 0.5)], moments])


def _spatial(points: NDArray[np.float64]) -> NDArray[np.float64]:
    number = len(points)
    points = np.where(np.isnan(points), 0.0, points)
    if not number:
        points = np.zeros((1, 3))
    return np.append(
        _shape(points - [points[:, 0].mean(), points[:, 1].mean(), 0.0]), np.log(number + 1)
    )


def _shape(points: NDArray[np.float64]) -> NDArray[np.float64]:
    spread = points.std(axis=0)
    safe = np.where(spread > 0, spread, 1.0)
    unit = (points - points.mean(axis=0)) / safe
    pairs: Sequence[tuple[int, int]] = ((0, 1), (0, 2), (1, 2))
    correlations = [float(np.mean(unit[:, one] * unit[:, other])) for one, other in pairs]
    values = [
        spread,
        points.min(axis=0),
        points.max(axis=0),
        *np.percentile(points, _PERCENTILES, axis=0),
        correlations,
    ]
    return np.concatenate(values)
