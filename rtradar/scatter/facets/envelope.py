"""The slow part of a physical-optics echo: sampled at anchors in time, more of them where it bends, and interpolated.

The envelope is the echo over that of the unobstructed specular point, carrier and all: 1 where optics is geometric, and
slow. Anchors are 10 ms apart. Where the second difference of a part's echo over neighbouring anchors is more than a given
share of the whole body's, the interval is halved, and halved again, down to an eighth: there an edge crosses the part, or
what it returns comes from far beside its specular point. Between anchors runs a cubic with one slope on either side of each.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined
from rtradar.scatter.common.keyframes import KeyframeCache
from rtradar.system.threads import in_threads

PIECES = 8
"""Parts of the interval between two anchors where it is divided the most: 1.25 ms of 10 ms."""

_KEPT_ANCHORS = 2048
"""Anchors remembered, so that the pass that measures power and the pass that makes the signal trace once (some 50 MB)."""

_PASSING = 32
"""Of later ones: those that are prepared together, and what lies around them."""

TOGETHER = 16
"""Neighbouring intervals that may be prepared at once."""

_INTERVALS_KEPT = TOGETHER + 8
"""More than these and one on either side."""


class Sample(NamedTuple):
    """The envelope in one pose: ``ratio (node, pair, part)`` complex, ``strength (pair, part)`` [m] of what it multiplies."""

    ratio: NDArray[np.complex128]
    strength: NDArray[np.float64]


class _Interval(NamedTuple):
    """``ratio (place, node, pair, part)`` at the 9 places of one interval, ``known (place, part)``."""

    ratio: NDArray[np.complex128]
    known: NDArray[np.bool_]


class Course(NamedTuple):
    """The envelope over one interval: ``ratio`` and ``slope (place, node, pair, part)``, where ``known (place, part)``."""

    ratio: NDArray[np.complex128]
    slope: NDArray[np.complex128]
    known: NDArray[np.bool_]


class Envelope:
    """An envelope over a capture.

    Parameters
    ----------
    sample : callable
        ``sample(place, parts, whole)``: the `Sample` of these parts (n,) at a place in time, counted in anchors from the
        start; ``whole`` is `whole_echo` near by, or None where all parts are asked for. Several threads call it at once.
    parts : int
        How many parts there are.
    tolerance : float
        Second difference of a part's echo over the root of the whole body's power that halves an interval.
    end : int
        Anchor from which on nothing moves.
    """

    def __init__(
        self,
        sample: Callable[[float, NDArray[np.int64], float | None], Sample],
        parts: int,
        tolerance: float,
        end: int,
    ) -> None:
        self._sample, self._parts, self._tolerance, self._end = (
            sample,
            np.arange(parts),
            tolerance,
            end,
        )
        self._anchors: KeyframeCache[int, Sample] = KeyframeCache(_KEPT_ANCHORS, _PASSING)
        self._intervals: OrderedDict[int, _Interval] = OrderedDict()

    def prepare_anchors(self, indices: Iterable[int]) -> None:
        """Find these anchors, of `TOGETHER` intervals at the most, with all cores: one by itself has too little to share."""
        missing = [
            index
            for index in sorted({min(index, self._end) for index in indices})
            if index not in self._anchors
        ]
        found = in_threads(
            lambda n: self._sample(float(missing[n]), self._parts, None), range(len(missing))
        )
        for index, sample in zip(missing, found, strict=True):
            self._anchors.keep(index, sample)

    def prepare_courses(self, indices: Iterable[int]) -> None:
        """The same for the courses of these intervals."""
        around = sorted(
            {index + step for index in indices for step in (-1, 0, 1) if index + step >= 0}
        )
        missing = [index for index in around if index not in self._intervals]
        self.prepare_anchors(
            index + step for index in missing for step in (-1, 0, 1, 2) if index + step >= 0
        )
        ends = [self._ends(index) for index in missing]
        found = in_threads(lambda n: self._divided(missing[n], *ends[n]), range(len(missing)))
        self._intervals.update(zip(missing, found, strict=True))
        for index in around:
            self._intervals.move_to_end(index)
        while len(self._intervals) > _INTERVALS_KEPT:
            self._intervals.popitem(last=False)

    def anchor(self, index: int) -> Sample:
        """All parts at one anchor."""
        index = min(index, self._end)
        return self._anchors.get(index, lambda: self._sample(float(index), self._parts, None))

    def course(self, index: int) -> Course:
        """From one anchor to the next: a cubic from place to place, its slopes those of the parabola through three."""
        self.prepare_courses([index])
        here, after = self._intervals[index], self._intervals[index + 1]
        before = self._intervals[index - 1] if index > 0 else here
        slope = np.empty_like(here.ratio)
        _find_slopes(
            index > 0,
            before.ratio,
            before.known,
            here.ratio,
            here.known,
            after.ratio,
            after.known,
            slope,
        )
        return Course(here.ratio, slope, here.known)

    def _ends(self, index: int) -> tuple[Sample | None, Sample, Sample, Sample]:
        """The anchor before an interval, if there is one, those at its ends, and the one after it."""
        before = self.anchor(index - 1) if index > 0 else None
        return before, self.anchor(index), self.anchor(index + 1), self.anchor(index + 2)

    def _divided(
        self, index: int, before: Sample | None, first: Sample, last: Sample, after: Sample
    ) -> _Interval:
        ratio = np.full((PIECES + 1, *first.ratio.shape), np.nan + 0j)
        ratio[0], ratio[PIECES] = first.ratio, last.ratio
        known = np.zeros((PIECES + 1, len(self._parts)), dtype=bool)
        known[[0, PIECES]] = True
        bends = [_bend(first.ratio, last.ratio, after.ratio, last.strength)]
        if before is not None:
            bends.append(_bend(before.ratio, first.ratio, last.ratio, first.strength))
        whole = max(whole_echo(first), whole_echo(last))
        bent = np.flatnonzero(np.max(bends, axis=0) > self._tolerance * whole)
        if index < self._end:
            self._divide(index, ratio, known, 0, PIECES, bent, whole)
        else:
            # Half-way it is as at the beginning, and does not bend there.
            ratio[PIECES // 2][:, :, bent], known[PIECES // 2, bent] = first.ratio[:, :, bent], True
        return _Interval(ratio, known)

    def _divide(
        self,
        index: int,
        ratio: NDArray[np.complex128],
        known: NDArray[np.bool_],
        left: int,
        right: int,
        parts: NDArray[np.int64],
        whole: float,
    ) -> None:
        """Sample these parts half-way, and go on where they bend there."""
        if right - left < 2 or len(parts) == 0:
            return
        middle = (left + right) // 2
        found = self._sample(index + middle / PIECES, parts, whole)
        ratio[middle][:, :, parts] = found.ratio
        known[middle, parts] = True
        bend = _bend(
            ratio[left][:, :, parts], found.ratio, ratio[right][:, :, parts], found.strength
        )
        for ends in ((left, middle), (middle, right)):
            self._divide(index, ratio, known, *ends, parts[bend > self._tolerance * whole], whole)


def _bend(
    before: NDArray[np.complex128],
    here: NDArray[np.complex128],
    after: NDArray[np.complex128],
    strength: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Second difference of the echo of each part (part,), the largest over frequencies and pairs [m]."""
    return np.asarray((np.abs(before - 2 * here + after) * strength).max(axis=(0, 1)))


def whole_echo(sample: Sample) -> float:
    """Root of the power of all parts, the mean over frequencies and pairs [m]."""
    return float(np.sqrt((np.abs(sample.ratio * sample.strength) ** 2).sum(axis=2).mean()))


@compiled()
def _find_slopes(inside, ratio_before, known_before, ratio, known, ratio_after, known_after, slope):
    """Slopes per place (place, node, pair, part) where a part is known; at the very start that of a straight line."""
    nodes, pairs, parts = ratio.shape[1:]
    for part in range(parts):
        left = -1
        for place in range(PIECES + 1):
            if not known[place, part]:
                continue
            right = place + 1
            while right <= PIECES and not known[right, part]:
                right += 1
            # At both ends the neighbour on the other side belongs to the next interval, where this part has its own.
            beyond = PIECES - 1 if left < 0 else 1
            while left < 0 and not known_before[beyond, part]:
                beyond -= 1
            while right > PIECES and not known_after[beyond, part]:
                beyond += 1
            gap = place - left if left >= 0 else PIECES - beyond
            next_gap = right - place if right <= PIECES else beyond
            for node in range(nodes):
                for pair in range(pairs):
                    value = ratio[place, node, pair, part]
                    last = (
                        ratio[left, node, pair, part]
                        if left >= 0
                        else ratio_before[beyond, node, pair, part]
                    )
                    following = (
                        ratio[right, node, pair, part]
                        if right <= PIECES
                        else ratio_after[beyond, node, pair, part]
                    )
                    rise, next_rise = (value - last) / gap, (following - value) / next_gap
                    if left < 0 and not inside:
                        rise = next_rise
                    slope[place, node, pair, part] = (rise * next_gap + next_rise * gap) / (
                        gap + next_gap
                    )
            left = place


@inlined()
def stretch(known, place):
    """The known places (place,) on either side of one in 0 to `PIECES`."""
    left = min(int(place), PIECES - 1)
    right = left + 1
    while not known[left]:
        left -= 1
    while not known[right]:
        right += 1
    return left, right
