"""How far apart two results are: maps and clouds. Pure functions on arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class LevelAgreement(NamedTuple):
    """How alike the decibels of two maps are.

    Parameters
    ----------
    correlation : float
        Pearson's, of decibels; NaN where a map is flat or fewer than two cells count.
    mean_db, rms_db : float
        Mean and root mean square of the difference, map less reference [dB]; NaN where no cell counts.
    """

    correlation: float
    mean_db: float
    rms_db: float


def level_agreement(
    power: ArrayLike, reference: ArrayLike, where: NDArray[np.bool_]
) -> LevelAgreement:
    """Compare two power maps in decibels over the cells that count.

    Parameters
    ----------
    power, reference : array_like of float
        Power, positive in the cells that count; the same shape.
    where : array of bool
        Cells that count. Noise that both share would make any two maps alike: leave it out.

    Returns
    -------
    LevelAgreement
    """
    ours, other = (
        10 * np.log10(np.asarray(values)[where].astype(np.float64)) for values in (power, reference)
    )
    if not ours.size:
        return LevelAgreement(np.nan, np.nan, np.nan)
    difference = ours - other
    flat = ours.size < 2 or np.ptp(ours) == 0 or np.ptp(other) == 0
    correlation = np.nan if flat else float(np.corrcoef(ours, other)[0, 1])
    return LevelAgreement(
        correlation, float(difference.mean()), float(np.sqrt((difference**2).mean()))
    )


def above_noise(power: ArrayLike) -> NDArray[np.bool_]:
    """Cells 10 dB or more above the median, which is noise in a map of one person, and at most 60 dB below the peak."""
    values = np.asarray(power)
    return np.asarray(
        values > max(10 * float(np.median(values)), 1e-6 * float(values.max(initial=0.0)))
    )


def chamfer(points: NDArray[np.float64], reference: NDArray[np.float64], bins: ArrayLike) -> float:
    """Chamfer distance: mean distance to the nearest point of the other cloud, averaged over both ways.

    Parameters
    ----------
    points, reference : (n, axis), (m, axis) float64
        Clouds.
    bins : (axis,) array_like
        Unit of each axis, such as the width of its bins.

    Returns
    -------
    float
        In bins. Two samplings of one surface are not at 0 but about half the mean distance between points. Infinite where
        one cloud alone is empty, 0 where both are.
    """
    from scipy.spatial import KDTree  # slow to import

    if not len(points) or not len(reference):
        return 0.0 if len(points) == len(reference) else np.inf
    ours, other = (
        np.asarray(cloud) / np.asarray(bins, dtype=np.float64) for cloud in (points, reference)
    )
    there, back = KDTree(other).query(ours)[0], KDTree(ours).query(other)[0]
    return float(there.mean() + back.mean()) / 2
