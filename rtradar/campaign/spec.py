"""Specification of a data set, and the keys of its TOML file.

::

    seed = 0                          # of all random numbers
    pfa = 1e-6                        # of OS-CFAR
    clutter_removal = "none"
    folder = "."                      # of the recordings, relative to this file; ${NAME} is the
                                      # value of an environment variable

    [windows]                         # which intervals of each recording
    start_s = 0.0
    duration_s = 2.0                  # to the end where it is left out
    hop_s = 1.0                       # one interval every hop up to end_s; only one without it
    end_s = 9.0                       # the end of the recording where it is left out

    [each]                            # every combination of these is a sample
    radar = ["paper-12ghz"]           # presets or TOML files
    scene = ["free-space"]            # names or TOML files
    fidelity = ["specular"]
    heading_deg = [0.0]
    snr_db = [20.0]
    person_position_m = [[0.0, 0.0]]  # where the scene says, where it is left out
    radar_position_m = [[-4.0, 1.0, 1.0]]

    [drawn]                           # every interval draws one value from each range
    heading_deg = [-30.0, 30.0]       # not beside [each] heading_deg; snr_db likewise
    snr_db = [15.0, 25.0]
    offset_x_m = [-0.3, 0.3]          # added to the place of the person
    offset_y_m = [-0.3, 0.3]
    tempo = [0.8, 1.25]               # this and the following: of synthetic actors
    amplitude = [0.8, 1.1]
    build = [0.8, 1.25]
    height_m = [1.55, 1.95]

    [[synthetic]]
    label = "walk"                    # kick, punch, jumping_jack
    count = 100                       # of takes, or seeds = [0, 1, 2]
    subjects = 20                     # take k is of subject k modulo 20, who is the same person in
                                      # all activities

    [[recordings]]
    file = "07_05.amc"
    skeleton = "07.asf"
    label = "walk"
    subject = "CMU_07"
    licence = "CMU mocap terms"
    start_s = 0.5                     # these four, where given, in place of those of [windows]
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scene import Scene
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
"""Largest number of samples of a data set, whose plan takes 2 GB of memory and half an hour."""


def check_samples(intervals: int, settings: int) -> None:
    """Refuse a data set of more samples than `MOST_SAMPLES` before it takes memory.

    Parameters
    ----------
    intervals : int
        Number of intervals of recordings and of synthetic takes.
    settings : int
        Number of combinations of the values under ``[each]``, all made for every interval.

    Raises
    ------
    InputError
        If there are too many samples. The message gives both numbers and a remedy.
    """
    if intervals * settings > MOST_SAMPLES:
        raise InputError(
            f"these are {intervals * settings} samples, "
            f"{intervals} intervals under {settings} combinations of [each]; "
            f"{MOST_SAMPLES} are allowed: split the file, each part into a folder of its own, "
            "as rtradar train takes several"
        )


WINDOW_KEYS = ("start_s", "duration_s", "hop_s", "end_s")
"""Keys of the intervals in files."""

_SLACK_S = 1e-6  # by which rounding may shorten a recording


@dataclass(frozen=True)
class Windows:
    """Intervals of ``duration_s`` from ``start_s`` on, one every ``hop_s``, all before ``end_s``.

    Parameters
    ----------
    start_s : float
        Start of the first interval [s].
    duration_s : float, optional
        Length of an interval [s]; None for one to the end.
    hop_s : float, optional
        Time from one interval to the next [s]; None for a single interval.
    end_s : float, optional
        Time before which all intervals end [s]; None for the end of the recording.
    """

    start_s: float = 0.0
    duration_s: float | None = None
    hop_s: float | None = None
    end_s: float | None = None

    @classmethod
    def read(cls, where: str, table: Mapping[str, Any]) -> Windows:
        """Read the intervals from a table whose keys are known.

        Raises
        ------
        InputError
            If a value is invalid, or values contradict each other.
        """
        least = {"start_s": 0.0, "duration_s": 1e-3, "hop_s": 1e-3, "end_s": 1e-3}
        windows = cls(
            **{
                key: check_number(where, key, table[key], least[key], 1e5)
                for key in WINDOW_KEYS
                if key in table
            }
        )
        if windows.hop_s is not None and windows.duration_s is None:
            raise InputError(f"{where}: hop_s needs duration_s; give both")
        if (
            windows.end_s is not None
            and windows.end_s < windows.start_s + (windows.duration_s or 1e-3) - _SLACK_S
        ):
            raise InputError(
                f"{where}: end_s = {windows.end_s:g} leaves no room for one interval "
                f"from {windows.start_s:g} s on"
            )
        return windows

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

        Raises
        ------
        InputError
            If the recording is too short for one interval.
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
        starts = (
            self.start_s + number * (self.hop_s or 0.0) for number in range(self.count(length_s))
        )
        return [(round(start, 6), self.duration_s) for start in starts]


@dataclass(frozen=True)
class Actor:
    """Takes of synthetic actors, by the seeds of the takes and the numbers of the subjects."""

    label: str
    seeds: tuple[int, ...]
    subjects: tuple[int, ...]


@dataclass(frozen=True)
class Recorded:
    """One recording: ``name`` as in the file, ``path`` and ``skeleton`` as absolute paths."""

    name: str
    path: Path
    skeleton: Path | None
    label: str
    subject: str
    licence: str
    windows: Windows


@dataclass(frozen=True)
class Setting:
    """One combination of the values under ``[each]``; None means drawn at random."""

    radar: Radar
    scene: Scene
    fidelity: str
    heading_deg: float | None
    snr_db: float | None


@dataclass(frozen=True)
class Spec:
    """Specification of a data set, see the keys in this module's docstring."""

    seed: int
    pfa: float
    clutter_removal: str
    windows: Windows
    settings: tuple[Setting, ...]
    drawn: Mapping[str, tuple[float, float]]
    actors: tuple[Actor, ...]
    recordings: tuple[Recorded, ...]
