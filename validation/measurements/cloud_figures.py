"""Figures that compare clouds of points frame by frame, and their intervals by bootstrap.

None of them uses rtradar: counts, weighted means, Wasserstein distances, the limb that is nearest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.stats import wasserstein_distance

Reals = NDArray[np.float64]
Ints = NDArray[np.int64]

RESAMPLED = 1000  # draws of the bootstrap
LIMBS = {
    "trunk": ("spine_base spine_mid", "spine_mid spine_shoulder", "neck head"),
    "left arm": ("shoulder_left elbow_left", "elbow_left wrist_left", "wrist_left hand_tip_left"),
    "right arm": (
        "shoulder_right elbow_right", "elbow_right wrist_right", "wrist_right hand_tip_right",
    ),
    "left leg": ("hip_left knee_left", "knee_left ankle_left", "ankle_left foot_left"),
    "right leg": ("hip_right knee_right", "knee_right ankle_right", "ankle_right foot_right"),
}  # fmt: skip
"""Bones of each limb, by the joints of the camera at their ends."""


def counts(frame: Ints, frames: int) -> Ints:
    """Points of each of the frames."""
    return np.bincount(frame, minlength=frames)


def weighted_means(values: NDArray[np.generic], weight: Reals, frame: Ints, frames: int) -> Reals:
    """Mean of the points of each frame; NaN where it has none."""
    total = np.bincount(frame, weight, frames)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.bincount(frame, weight * values, frames) / total)


def distances(ours: tuple[Reals, Ints], theirs: tuple[Reals, Ints], frames: int) -> Reals:
    """Wasserstein distance of the values of each frame; NaN where either has none."""
    found = np.full(frames, np.nan)
    (first, second) = (
        np.split(values[np.argsort(frame, kind="stable")], np.cumsum(counts(frame, frames))[:-1])
        for values, frame in (ours, theirs)
    )
    for index, (one, other) in enumerate(zip(first, second, strict=True)):
        if len(one) and len(other):
            found[index] = wasserstein_distance(one, other)
    return found


def variation(ours: Ints, theirs: Ints) -> float:
    """Total variation of two histograms of whole numbers, 0 (alike) to 1."""
    least, most = min(ours.min(), theirs.min()), max(ours.max(), theirs.max())
    edges = np.arange(least, most + 2) - 0.5
    (one, other) = (np.histogram(values, edges)[0] / len(values) for values in (ours, theirs))
    return float(np.abs(one - other).sum() / 2)


def nearest_limb(places: Reals, joints: Reals, names: tuple[str, ...]) -> Ints:
    """Limb, in the order of `LIMBS`, whose bones are nearest to each place (point, 3).

    ``joints (point, joint, 3)`` are those of the frame of the point.
    """
    found = []
    for bones in LIMBS.values():
        away = []
        for bone in bones:
            begin, end = (joints[:, names.index(joint)] for joint in bone.split())
            along = end - begin
            part = np.sum((places - begin) * along, axis=1) / np.sum(along**2, axis=1)
            foot = begin + part.clip(0, 1)[:, None] * along
            away.append(np.linalg.norm(places - foot, axis=1))
        found.append(np.min(away, axis=0))
    return np.asarray(np.argmin(found, axis=0), dtype=np.int64)


def interval(values: Reals, move: Ints, figure: Callable[[Reals], float]) -> tuple[float, float]:
    """Interval of 95 % of a figure of ``values (frame, ...)``, by drawing whole moves anew.

    Frames of one move are alike; moves are what another recording would have others of.
    """
    random = np.random.default_rng(0)
    of_move = [values[move == one] for one in np.unique(move)]
    drawn = random.integers(0, len(of_move), (RESAMPLED, len(of_move)))
    found = [figure(np.concatenate([of_move[one] for one in draw])) for draw in drawn]
    low, high = np.quantile(found, (0.025, 0.975))
    return float(low), float(high)


def correlation(pairs: Reals) -> float:
    """Pearson's r of the columns of (frame, 2), without frames that lack one."""
    known = pairs[np.isfinite(pairs).all(axis=1)]
    return float(np.corrcoef(known.T)[0, 1])


def slope(pairs: Reals) -> float:
    """Slope of the least-squares line of the first column over the second."""
    known = pairs[np.isfinite(pairs).all(axis=1)]
    covariance = np.cov(known.T)
    return float(covariance[0, 1] / covariance[1, 1])
