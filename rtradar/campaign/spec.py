"""Specification of a data set: which intervals, under which combinations, by which settings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from rtradar.campaign.kept import sizes
from rtradar.errors import InputError
from rtradar.process import CLUTTER_REMOVALS, DETECTORS, measured_angles
from rtradar.radar import Radar
from rtradar.scatter.common.polarization import BODY_MATERIALS
from rtradar.scene import Scene
from rtradar.settings import RunSettings
from rtradar.system.checks import check_number

DRAWN: Mapping[str, tuple[tuple[float, float], float, float]] = {
    "heading_deg": ((0.0, 0.0), -360.0, 360.0),
    "snr_db": ((20.0, 20.0), -100.0, 200.0),
    "offset_x_m": ((0.0, 0.0), -100.0, 100.0),
    "offset_y_m": ((0.0, 0.0), -100.0, 100.0),
    "tempo": ((0.8, 1.25), 0.4, 2.0),
    "amplitude": ((0.8, 1.1), 0.3, 1.25),
    "build": ((0.8, 1.25), 0.4, 2.5),
    "height_m": ((1.55, 1.95), 0.8, 2.5),
}
"""Quantities drawn at random: default range, smallest and largest allowed value."""

MOST_SAMPLES = 1_000_000
"""Largest number of samples of a data set, all of whose plans are in memory."""

INTERVAL_KEYS = ("start_s", "duration_s", "hop_s", "end_s")
"""Keys of the intervals in files."""

NAMED = {
    "clutter_removal": CLUTTER_REMOVALS,
    "detector": DETECTORS,
    "body_material": BODY_MATERIALS,
}
WINDOWS = ("range_window", "doppler_window")
SWITCHES = ("keep_all", "spreading")
RUN_KEYS = ("pfa", *NAMED, *WINDOWS, "order", *SWITCHES)
"""Settings of a run that a file may give for all samples."""

_SLACK_S = 1e-6  # by which rounding may shorten a recording


@dataclass(frozen=True)
class Intervals:
    """Intervals of ``duration_s`` from ``start_s`` on, one every ``hop_s``, all before ``end_s``.

    Without ``duration_s`` there is one interval to the end, without ``hop_s`` a single one, and
    without ``end_s`` the recording ends them.
    """

    start_s: float = 0.0
    duration_s: float | None = None
    hop_s: float | None = None
    end_s: float | None = None

    @classmethod
    def read(cls, where: str, table: Mapping[str, Any]) -> Intervals:
        """Read the intervals from a table whose keys are known; InputError for invalid values."""
        least = {"start_s": 0.0, "duration_s": 1e-3, "hop_s": 1e-3, "end_s": 1e-3}
        given = {
            key: check_number(where, key, table[key], least[key], 1e5)
            for key in INTERVAL_KEYS
            if key in table
        }
        found = cls(**given)
        if found.hop_s is not None and found.duration_s is None:
            raise InputError(f"{where}: hop_s needs duration_s; give both")
        needed = found.start_s + (found.duration_s or 1e-3) - _SLACK_S
        if found.end_s is not None and found.end_s < needed:
            raise InputError(
                f"{where}: end_s = {found.end_s:g} leaves no room for one interval "
                f"from {found.start_s:g} s on"
            )
        return found

    @property
    def needed_s(self) -> float | None:
        """Length of a recording that all intervals need [s]; None if not known in advance."""
        if self.end_s is not None:
            return self.end_s
        return None if self.duration_s is None else self.start_s + self.duration_s

    def count(self, length_s: float | None = None) -> int:
        """Count the intervals of a recording of this length [s]; a lower bound for None."""
        end = length_s if self.end_s is None else self.end_s
        if self.hop_s is None or self.duration_s is None or end is None:
            return 1
        return 1 + math.floor((end - self.start_s - self.duration_s + _SLACK_S) / self.hop_s)

    def of(self, name: str, length_s: float) -> list[tuple[float, float]]:
        """Return start and duration [s] of each interval of a recording of this length [s].

        InputError if the recording is too short for one.
        """
        end = length_s if self.end_s is None else self.end_s
        needed = self.start_s + (self.duration_s or 1e-3)
        if max(end, needed) > length_s + _SLACK_S:
            raise InputError(
                f"recording '{name}' has {length_s:.6g} s, "
                f"too short for an interval from {self.start_s:g} to "
                f"{max(end, needed):.6g} s; shorten it (start_s, duration_s, end_s)"
            )
        if self.duration_s is None:
            return [(self.start_s, round(end - self.start_s, 6))]
        hop_s, count = self.hop_s or 0.0, self.count(length_s)
        return [(round(self.start_s + k * hop_s, 6), self.duration_s) for k in range(count)]


class Actor(NamedTuple):
    """Takes of synthetic actors, by the seeds of the takes and the numbers of the subjects."""

    label: str
    seeds: Sequence[int]
    subjects: Sequence[int]


class Recorded(NamedTuple):
    """One recording: ``name`` as in the file, ``path`` and ``skeleton`` as absolute paths."""

    name: str
    path: Path
    skeleton: Path | None
    label: str
    subject: str
    licence: str
    intervals: Intervals


class Combination(NamedTuple):
    """One combination of the values under ``[each]``; None means drawn at random."""

    radar: Radar
    scene: Scene
    fidelity: str
    heading_deg: float | None
    snr_db: float | None


class Others(NamedTuple):
    """People beside the one of the label: how many, what they do, and where, from least to most.

    Synthetic actors whose mean places are at least `APART_M` from each other and from that one.
    """

    people: int
    labels: tuple[str, ...]
    x_m: tuple[float, float]
    y_m: tuple[float, float]


OTHERS: Mapping[str, list[Any]] = {
    "labels": ["walk", "stand"],
    "x_m": [-1.0, 1.0],
    "y_m": [-1.5, 1.5],
}
"""Keys of ``[others]`` beside ``count``, with their defaults."""

MOST_OTHERS, APART_M = 8, 1.0
"""Most people beside the one of the label, and the least distance of their places [m]."""


class Spec(NamedTuple):
    """Specification of a data set; ``run`` has the seed and what the file gives of `RUN_KEYS`.

    ``keep`` are the kinds of arrays that samples hold beside clouds, in the order of `KEPT`.
    """

    run: RunSettings
    intervals: Intervals
    combinations: tuple[Combination, ...]
    drawn: Mapping[str, tuple[float, float]]
    actors: tuple[Actor, ...]
    recordings: tuple[Recorded, ...]
    keep: tuple[str, ...] = ()
    others: Others | None = None


def check_samples(intervals: int, combinations: int) -> None:
    """Refuse a data set of more samples than `MOST_SAMPLES` before it takes memory."""
    if intervals * combinations > MOST_SAMPLES:
        raise InputError(
            f"these are {intervals * combinations} samples, "
            f"{intervals} intervals under {combinations} combinations of [each]; "
            f"{MOST_SAMPLES} are allowed: split the file, each part into a folder of its own, "
            "as rtradar train takes several"
        )


def check_equal_sizes(
    keep: tuple[str, ...], lengths_s: set[float | None], combinations: tuple[Combination, ...]
) -> None:
    """Refuse maps of several sizes, which could not be batched, and angles not measured."""
    if len(lengths_s) > 1 or None in lengths_s:
        raise InputError(
            f"keep = {list(keep)}: intervals differ in length; give all the same duration_s, "
            "so that their maps have one size"
        )
    radars = list({each.radar.name: each.radar for each in combinations}.values())
    if len(set(map(sizes, radars))) > 1:
        raise InputError(
            f"keep = {list(keep)}: maps of radars {', '.join(radar.name for radar in radars)} "
            "have several sizes; make a data set for each of them"
        )
    for radar in radars if "range_azimuth" in keep else ():
        if "azimuth" not in measured_angles(radar):
            raise InputError(
                f"keep = {list(keep)}: radar '{radar.name}' measures no azimuth; "
                "leave range_azimuth out"
            )
