"""Which intervals of a recording become samples."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rtradar.errors import InputError
from rtradar.system.checks import check_number

WINDOW_KEYS = ("start_s", "duration_s", "hop_s", "end_s")
"""As files call them."""

_SLACK_S = 1e-6  # what the length of a recording may be short of a frame by rounding


@dataclass(frozen=True)
class Windows:
    """Intervals of ``duration_s`` from ``start_s`` on, one every ``hop_s``, all before ``end_s``.

    Parameters
    ----------
    start_s : float
    duration_s : float, optional
        To the end where it is None.
    hop_s : float, optional
        One interval alone where it is None.
    end_s : float, optional
        The end of the recording where it is None.
    """

    start_s: float = 0.0
    duration_s: float | None = None
    hop_s: float | None = None
    end_s: float | None = None

    @classmethod
    def read(cls, where: str, table: Mapping[str, Any]) -> Windows:
        """From a table of a file, of keys that are known.

        Raises
        ------
        InputError
            Where a value has no meaning, or they contradict each other.
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
                f"{where}: end_s = {windows.end_s:g} leaves no room for one interval from {windows.start_s:g} s on"
            )
        return windows

    @property
    def needed_s(self) -> float | None:
        """Length of a recording that serves all of them [s]; None where only a recording can tell."""
        if self.end_s is not None:
            return self.end_s
        return None if self.duration_s is None else self.start_s + self.duration_s

    def count(self, length_s: float | None = None) -> int:
        """How many intervals a recording of that length [s] gives; at least how many where the length is not known."""
        end = length_s if self.end_s is None else self.end_s
        if self.hop_s is None or self.duration_s is None or end is None:
            return 1
        return 1 + math.floor((end - self.start_s - self.duration_s + _SLACK_S) / self.hop_s)

    def of(self, name: str, length_s: float) -> list[tuple[float, float]]:
        """Start and duration [s] of each interval of a recording of that length [s].

        Raises
        ------
        InputError
            Where it is too short for one of them.
        """
        end = length_s if self.end_s is None else self.end_s
        needed = self.start_s + (self.duration_s or 1e-3)
        if max(end, needed) > length_s + _SLACK_S:
            raise InputError(
                f"recording '{name}' has {length_s:.6g} s, too short for an interval from {self.start_s:g} to "
                f"{max(end, needed):.6g} s; shorten it (start_s, duration_s, end_s)"
            )
        if self.duration_s is None:
            return [(self.start_s, round(end - self.start_s, 6))]
        starts = (
            self.start_s + number * (self.hop_s or 0.0) for number in range(self.count(length_s))
        )
        return [(round(start, 6), self.duration_s) for start in starts]
