"""The slow part of a physical-optics echo, interpolated between keyframes, more where it bends.

The envelope is the echo over that of the unobstructed specular point, carrier and all: 1 where
optics is geometric, and slow. Where the second difference of a part's echo over neighbouring
keyframes is more than a given fraction of its owner's, the interval is halved, and halved again,
down to an eighth of 10 ms by `physical-optics`: there an edge crosses the part, or what it returns
comes from far beside its specular point. Between keyframes runs a cubic with one slope on either
side of each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.scatter.envelope import find_slopes
from rtradar.scatter.common.keyframes import KeyframeCache
from rtradar.system.threads import thread_map

_KEPT_KEYFRAMES = 2048
"""Keyframes kept, so that the passes for power and for the signal trace once (some 50 MB)."""

_PASSING = 32
"""Later keyframes kept: those that are prepared together, and what lies around them."""

TOGETHER = 16
"""Neighbouring intervals that may be prepared at once."""

_KEPT_INTERVALS = TOGETHER + 8
"""More than these and one on either side."""

Field = NDArray[np.complex128]
Scale = NDArray[np.float64]


class Sample(NamedTuple):
    """One pose: ``ratio (node, pair, part)``, to be multiplied by ``strength (pair, part)`` [m]."""

    ratio: Field
    strength: NDArray[np.float64]


class _Interval(NamedTuple):
    """One interval: ``ratio (place, node, pair, part)`` where it is ``known (place, part)``."""

    ratio: Field
    known: NDArray[np.bool_]


class Course(NamedTuple):
    """One interval: ratio and slope (place, node, pair, part), where ``known (place, part)``."""

    ratio: Field
    slope: Field
    known: NDArray[np.bool_]


class Envelope:
    """An envelope over a capture, of the parts of one or several people: ``owner (part,)``.

    ``sample(place, parts, whole)`` returns the `Sample` of parts (n,) at a place in time, counted
    in keyframes from the start; ``whole (part,)`` is `whole_echo` near by, or None where all parts
    are asked for. Several threads call it at once. ``tolerance`` is the second difference of a
    part's echo over the root of the power of the whole person that halves an interval, ``end`` the
    keyframe from which on nothing moves, ``places`` the parts, a power of two, into which an
    interval is divided at most.
    """

    def __init__(
        self,
        sample: Callable[[float, NDArray[np.int64], Scale | None], Sample],
        owner: NDArray[np.int64],
        tolerance: float,
        end: int,
        places: int,
    ) -> None:
        self._sample, self._owner, self._parts = sample, owner, np.arange(len(owner))
        self._tolerance, self._end, self._places = tolerance, end, places
        self._keyframes: KeyframeCache[int, Sample] = KeyframeCache(_KEPT_KEYFRAMES, _PASSING)
        self._intervals: KeyframeCache[int, _Interval] = KeyframeCache(0, _KEPT_INTERVALS)

    def prepare_keyframes(self, indices: Iterable[int]) -> None:
        """Find these keyframes, of `TOGETHER` intervals at most, with all cores."""
        wanted = sorted({min(index, self._end) for index in indices})
        missing = [index for index in wanted if index not in self._keyframes]
        found = thread_map(
            lambda n: self._sample(float(missing[n]), self._parts, None), range(len(missing))
        )
        for index, sample in zip(missing, found, strict=True):
            self._keyframes.keep(index, sample)

    def prepare_courses(self, indices: Iterable[int]) -> None:
        """The same for the courses of these intervals."""
        around = {index + step for index in indices for step in (-1, 0, 1) if index + step >= 0}
        missing = []
        for index in sorted(around):
            if index in self._intervals:
                self._interval(index)  # now the last to be dropped
            else:
                missing.append(index)
        self.prepare_keyframes(
            index + step for index in missing for step in (-1, 0, 1, 2) if index + step >= 0
        )
        ends = [self._ends(index) for index in missing]
        found = thread_map(lambda n: self._divided(missing[n], *ends[n]), range(len(missing)))
        for index, interval in zip(missing, found, strict=True):
            self._intervals.keep(index, interval)

    def _interval(self, index: int) -> _Interval:
        return self._intervals.get(index, lambda: self._divided(index, *self._ends(index)))

    def keyframe(self, index: int) -> Sample:
        """All parts at one keyframe."""
        index = min(index, self._end)
        return self._keyframes.get(index, lambda: self._sample(float(index), self._parts, None))

    def course(self, index: int) -> Course:
        """Cubics from place to place of an interval, with the slopes of parabolas through three."""
        self.prepare_courses([index])
        here, after = self._interval(index), self._interval(index + 1)
        before = self._interval(index - 1) if index > 0 else here
        slope = np.empty_like(here.ratio)
        find_slopes(index > 0, tuple(before), tuple(here), tuple(after), slope)
        return Course(here.ratio, slope, here.known)

    def _ends(self, index: int) -> tuple[Sample | None, Sample, Sample, Sample]:
        """The keyframe before an interval, if any, those at its ends, and the one after it."""
        before = self.keyframe(index - 1) if index > 0 else None
        return before, self.keyframe(index), self.keyframe(index + 1), self.keyframe(index + 2)

    def _divided(
        self, index: int, before: Sample | None, first: Sample, last: Sample, after: Sample
    ) -> _Interval:
        ratio = np.full((self._places + 1, *first.ratio.shape), np.nan + 0j)
        ratio[0], ratio[self._places] = first.ratio, last.ratio
        known = np.zeros((self._places + 1, len(self._parts)), dtype=bool)
        known[[0, self._places]] = True
        bends = [_bend(first.ratio, last.ratio, after.ratio, last.strength)]
        if before is not None:
            bends.append(_bend(before.ratio, first.ratio, last.ratio, first.strength))
        whole = np.maximum(*(whole_echo(end, self._owner) for end in (first, last)))
        bent = np.flatnonzero(np.max(bends, axis=0) > self._tolerance * whole)
        interval = _Interval(ratio, known)
        if index < self._end:
            self._divide(index, interval, 0, self._places, bent, whole)
        else:
            # Half-way it is as at the beginning, and does not bend there.
            ratio[self._places // 2][:, :, bent], known[self._places // 2, bent] = (
                first.ratio[:, :, bent],
                True,
            )
        return interval

    def _divide(
        self,
        index: int,
        interval: _Interval,
        left: int,
        right: int,
        parts: NDArray[np.int64],
        whole: Scale,
    ) -> None:
        """Sample these parts half-way, and go on where they bend there."""
        if right - left < 2 or len(parts) == 0:
            return
        middle, (ratio, known) = (left + right) // 2, interval
        found = self._sample(index + middle / self._places, parts, whole)
        ratio[middle][:, :, parts] = found.ratio
        known[middle, parts] = True
        before, after = ratio[left][:, :, parts], ratio[right][:, :, parts]
        bent = _bend(before, found.ratio, after, found.strength) > self._tolerance * whole[parts]
        for ends in ((left, middle), (middle, right)):
            self._divide(index, interval, *ends, parts[bent], whole)


def _bend(
    before: Field, here: Field, after: Field, strength: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Second difference of each part's echo (part,), largest over frequencies and pairs [m]."""
    return np.asarray((np.abs(before - 2 * here + after) * strength).max(axis=(0, 1)))


def whole_echo(sample: Sample, owner: NDArray[np.int64]) -> Scale:
    """Root of the power of all of a part's owner (part,), mean over frequencies and pairs [m].

    Scales of one person are so the same whoever else is there.
    """
    power = (np.abs(sample.ratio * sample.strength) ** 2).mean(axis=(0, 1))
    return np.asarray(np.sqrt(np.bincount(owner, power)[owner]))
