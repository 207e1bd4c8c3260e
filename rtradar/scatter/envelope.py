"""The slow part of a physical-optics echo: sampled at anchors in time, more of them where it bends, and interpolated.

The envelope is the echo over that of the unobstructed mirror point, carrier and all: 1 where optics is geometric, and
slow. Anchors are 10 ms apart. Where the second difference of a part's echo over neighbouring anchors is more than a given
share of the whole body's, the interval is halved, and halved again, down to an eighth: there an edge crosses the part, or
what it returns comes from far beside its mirror point. Between anchors runs a cubic with one slope on either side of each.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

PIECES = 8
"""Parts of the interval between two anchors where it is divided the most: 1.25 ms of 10 ms."""

_KEPT_ANCHORS = 2048
"""Anchors remembered, so that the pass that measures power and the pass that makes the signal trace once (some 50 MB)."""


class Sample(NamedTuple):
    """The envelope in one pose: ``ratio (node, pair, part)`` complex, ``strength (pair, part)`` [m] of what it multiplies."""

    ratio: NDArray[np.complex128]
    strength: NDArray[np.float64]


class _Interval(NamedTuple):
    """``ratio (place, node, pair, part)`` at the 9 places of one interval, ``known (place, part)``."""

    ratio: NDArray[np.complex128]
    known: NDArray[np.bool_]


class Envelope:
    """An envelope over a capture.

    Parameters
    ----------
    sample : callable
        ``sample(place, parts, whole)``: the `Sample` of these parts (n,) at a place in time, counted in anchors from the
        start; ``whole`` is `whole_echo` near by, or None where all parts are asked for.
    parts : int
        How many parts there are.
    tolerance : float
        Second difference of a part's echo over the root of the whole body's power that halves an interval.
    """

    def __init__(self, sample: Callable[[float, NDArray[np.int64], float | None], Sample], parts: int, tolerance: float) -> None:
        self._sample, self._parts, self._tolerance = sample, np.arange(parts), tolerance
        self._anchors: OrderedDict[int, Sample] = OrderedDict()
        self._intervals: OrderedDict[int, _Interval] = OrderedDict()

    def anchor(self, index: int) -> Sample:
        """All parts at one anchor."""
        if index not in self._anchors:
            self._anchors[index] = self._sample(float(index), self._parts, None)
            if len(self._anchors) > _KEPT_ANCHORS:
                self._anchors.popitem(last=False)
        return self._anchors[index]

    def between(self, index: int, share: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Ratio (time, node, pair, part) at these shares (time,), 0 to 1, of the way from an anchor to the next."""
        before = self._interval(index - 1) if index > 0 else None
        here, after = self._interval(index), self._interval(index + 1)
        out = np.empty((len(share), *here.ratio.shape[1:]), dtype=np.complex128)
        patterns, group = np.unique(here.known, axis=1, return_inverse=True)
        for number in range(patterns.shape[1]):
            parts = np.flatnonzero(group.ravel() == number)
            places = np.flatnonzero(patterns[:, number])
            ratio = here.ratio[:, :, :, parts]
            slope = np.empty((len(places), *ratio.shape[1:]), dtype=np.complex128)
            for i in range(1, len(places) - 1):
                slope[i] = _slope(ratio, places[i - 1], places[i], places[i + 1])
            for column, part in enumerate(parts.tolist()):
                # At both ends the neighbour on the other side belongs to the next interval, where this part has its own.
                left = _neighbour(before, part, last=True) if before is not None else None
                right = _neighbour(after, part, last=False)
                own = ratio[:, :, :, column]
                slope[0, :, :, column] = _slope_at(own, left, places[0], places[1], left_side=True)
                slope[-1, :, :, column] = _slope_at(own, right, places[-1], places[-2], left_side=False)
            out[..., parts] = CubicHermiteSpline(places / PIECES, ratio[places], slope * PIECES)(share)
        return out

    def _interval(self, index: int) -> _Interval:
        if index in self._intervals:
            return self._intervals[index]
        first, last = self.anchor(index), self.anchor(index + 1)
        ratio = np.full((PIECES + 1, *first.ratio.shape), np.nan + 0j)
        ratio[0], ratio[PIECES] = first.ratio, last.ratio
        known = np.zeros((PIECES + 1, len(self._parts)), dtype=bool)
        known[[0, PIECES]] = True
        bends = [_bend(self.anchor(index).ratio, last.ratio, self.anchor(index + 2).ratio, last.strength)]
        if index > 0:
            bends.append(_bend(self.anchor(index - 1).ratio, first.ratio, last.ratio, first.strength))
        whole = max(whole_echo(first), whole_echo(last))
        bent = np.flatnonzero(np.max(bends, axis=0) > self._tolerance * whole)
        self._divide(index, ratio, known, 0, PIECES, bent, whole)
        self._intervals[index] = _Interval(ratio, known)
        if len(self._intervals) > 16:
            self._intervals.popitem(last=False)
        return self._intervals[index]

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
        bend = _bend(ratio[left][:, :, parts], found.ratio, ratio[right][:, :, parts], found.strength)
        for ends in ((left, middle), (middle, right)):
            self._divide(index, ratio, known, *ends, parts[bend > self._tolerance * whole], whole)


def _bend(
    before: NDArray[np.complex128], here: NDArray[np.complex128], after: NDArray[np.complex128], strength: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Second difference of the echo of each part (part,), the largest over frequencies and pairs [m]."""
    return np.asarray((np.abs(before - 2 * here + after) * strength).max(axis=(0, 1)))


def whole_echo(sample: Sample) -> float:
    """Root of the power of all parts, the mean over frequencies and pairs [m]."""
    return float(np.sqrt((np.abs(sample.ratio * sample.strength) ** 2).sum(axis=2).mean()))


def _slope(ratio: NDArray[np.complex128], left: int, here: int, right: int) -> NDArray[np.complex128]:
    """Slope at the middle one of three places, of the parabola through them."""
    return _parabola(ratio[left], here - left, ratio[here], right - here, ratio[right])


def _parabola(
    before: NDArray[np.complex128],
    gap_before: int,
    here: NDArray[np.complex128],
    gap_after: int,
    after: NDArray[np.complex128],
) -> NDArray[np.complex128]:
    rise, next_rise = (here - before) / gap_before, (after - here) / gap_after
    return np.asarray((rise * gap_after + next_rise * gap_before) / (gap_before + gap_after))


def _neighbour(interval: _Interval, part: int, *, last: bool) -> tuple[int, NDArray[np.complex128]]:
    """How far from the shared anchor the nearest place of the part in the neighbouring interval is, and its ratio there."""
    places = np.flatnonzero(interval.known[:, part])
    place = places[-2] if last else places[1]
    return int(PIECES - place if last else place), interval.ratio[place, :, :, part]


def _slope_at(
    own: NDArray[np.complex128], beyond: tuple[int, NDArray[np.complex128]] | None, end: int, inner: int, *, left_side: bool
) -> NDArray[np.complex128]:
    """Slope at an end of an interval, from its own next place and the one beyond; without the latter a straight line's."""
    if beyond is None:
        return np.asarray((own[inner] - own[end]) / (inner - end))
    gap, ratio = beyond
    if left_side:
        return _parabola(ratio, gap, own[end], inner - end, own[inner])
    return _parabola(own[inner], end - inner, own[end], gap, ratio)
