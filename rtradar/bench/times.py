"""What is made of measured seconds: best and median, ratios, and which stages lead to the range-Doppler-time cloud."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

OTHER_PRODUCTS = ("spectrogram", "angle")
"""Stages of a run that the range-Doppler-time cloud does not need."""

FILES = ("write", "pictures", "view", "report")
"""Stages that write files: maps, clouds, pictures, moments to view and the page."""

ELSEWHERE = "elsewhere"
"""Time of a run outside all of its stages, such as sliding windows, which copy; it counts to the cloud."""


@dataclass(frozen=True)
class Spread:
    """Some measurements of one thing.

    Parameters
    ----------
    best, median : float
        [s].
    """

    best: float
    median: float

    @classmethod
    def of(cls, seconds: Sequence[float]) -> Spread:
        """Of at least one."""
        return cls(min(seconds), median(seconds))


def with_elsewhere(stages: Mapping[str, float], wall_s: float) -> dict[str, float]:
    """Seconds by stage, and what the whole has beside them [s]; not below zero, should stages overlap one day."""
    return {**stages, ELSEWHERE: max(wall_s - sum(stages.values()), 0.0)}


def to_cloud_s(stages: Mapping[str, float], wall_s: float) -> float:
    """Of a whole run, what leads to the range-Doppler-time cloud [s]: all but `OTHER_PRODUCTS` and `FILES`."""
    return wall_s - sum(stages.get(name, 0.0) for name in (*OTHER_PRODUCTS, *FILES))


def by_stage(runs: Sequence[Mapping[str, float]]) -> dict[str, Spread]:
    """Seconds by stage over runs, in the order in which stages first come; a run without a stage spent nothing there."""
    names = dict.fromkeys(name for run in runs for name in run)
    return {name: Spread.of([run.get(name, 0.0) for run in runs]) for name in names}


def paired_ratio(seconds: Sequence[float], of: Sequence[float]) -> float:
    """Median of the ratios of what was measured one after the other, so that a slow minute falls on both.

    Raises
    ------
    ValueError
        Where they are not pairs.
    """
    return median(one / other for one, other in zip(seconds, of, strict=True))
