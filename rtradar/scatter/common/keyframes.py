"""Keyframes: the instants at which slow quantities are computed, and a cache of what was found."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar

_Key = TypeVar("_Key", bound=Hashable)
_Value = TypeVar("_Value")


def keyframe_step(radar: Radar, apart_s: float = 10e-3) -> int:
    """Return the number of chirps between keyframes.

    Visibility and power are evaluated at keyframes, 10 ms apart: a limb at 5 m/s moves 5 cm in
    that time.
    """
    return max(1, round(apart_s / radar.chirp_interval_s))


def keyframe_before(
    radar: Radar, chirps: NDArray[np.int64], step: int
) -> tuple[NDArray[np.int64], NDArray[np.int64] | NDArray[np.float64]]:
    """Number of the keyframe before each chirp, and places from there to it.

    Keyframes follow each other evenly, also in the gaps between frames: keyframe k is in the middle
    of chirp k times ``step`` of `Radar.gapless`.
    """
    numbers, rest = np.divmod(radar.slots_of(chirps), step)
    return numbers.astype(np.int64), rest


def chirps_by_steps(radar: Radar, n_chirps: int, step: int) -> NDArray[np.int64]:
    """Every chirp that begins a step, and at least one of every frame."""
    return np.arange(0, n_chirps, min(step, radar.chirps_per_frame) if radar.in_frames else step)


class KeyframeCache(Generic[_Key, _Value]):
    """Values of keyframes: the first ``stay`` that come stay, later ones pass through.

    A recording is processed twice from its start, once for its power and once for its signal. If
    the last values were kept, a recording a little longer than this cache would find nothing left
    of them when it starts again. Of later values those that were last asked for are held,
    ``passing`` of them.
    """

    def __init__(self, stay: int, passing: int) -> None:
        self.stay, self._passing = stay, passing
        self._staying: dict[_Key, _Value] = {}
        self._later: OrderedDict[_Key, _Value] = OrderedDict()

    def __contains__(self, key: object) -> bool:
        return key in self._staying or key in self._later

    def __getitem__(self, key: _Key) -> _Value:
        if key in self._staying:
            return self._staying[key]
        self._later.move_to_end(key)
        return self._later[key]

    def get(self, key: _Key, find: Callable[[], _Value]) -> _Value:
        """Return the value of a key, which is found now if it is not known."""
        if key not in self:
            self.keep(key, find())
        return self[key]

    def keep(self, key: _Key, value: _Value) -> None:
        """Keep the value of a key that is not known."""
        if len(self._staying) < self.stay:
            self._staying[key] = value
        else:
            self._later[key] = value
            if len(self._later) > self._passing:
                self._later.popitem(last=False)

    def replace(self, new: Callable[[_Value], _Value]) -> None:
        """Replace every value by a new one."""
        for values in (self._staying, self._later):
            for key, value in values.items():
                values[key] = new(value)

    def copy(self) -> KeyframeCache[_Key, _Value]:
        """Return a cache of its own with the same values."""
        other = KeyframeCache[_Key, _Value](self.stay, self._passing)
        other._staying, other._later = self._staying.copy(), self._later.copy()
        return other
