"""The slow part of a physical-optics echo, interpolated between keyframes, more where it bends.

The envelope is the echo divided by that of the unobstructed specular point, with its carrier: it is
1 where optics is geometric, and slow. Where the second difference of a part's echo over
neighbouring keyframes is more than a given fraction of its owner's echo, the interval is halved,
and halved again, down to an eighth of 10 ms by `physical-optics`. There an edge crosses the part,
or what it returns comes from far beside its specular point. Between keyframes runs a cubic, whose
slope is the same on both sides of each keyframe.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.kernels.scatter.facets import fill_envelope
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayNodes, array_nodes, spread_nodes
from rtradar.scatter.common.poses import (
    KeyframeCache,
    keyframe_before,
    keyframe_step,
    keyframe_time,
    owners_of,
)
from rtradar.scatter.facets.body import FacetBody
from rtradar.scatter.facets.skin import SkinFacets
from rtradar.system.threads import thread_map

_KEPT_KEYFRAMES = 2048
"""Keyframes kept, so that the passes for power and for the signal trace once (some 50 MB)."""

_PASSING = 32
"""Later keyframes kept: those that are prepared together, and what lies around them."""

TOGETHER = 16
"""Neighbouring intervals that may be prepared at once."""

_KEPT_INTERVALS = TOGETHER + 8
"""More than these and one on either side."""

_COARSE, _FINE = (2, 1), (6, 2)
"""Tx times Rx nodes per line of the array: for parts that look alike all over it, and others."""

_GRADUAL_S, _GRADUAL_PLACES, _GRADUAL_BEND, _GRADUAL_UNEVENNESS = 10e-3, 16, 0.05, 0.02
"""For visible fractions: the time between keyframes [s], the most parts into which it is divided,
and the changes in time and over the array that ask for more, as in `ArrayEnvelope`. In 20 ms a limb
at 4 m/s may pass unseen (``validation/other_methods/visible_fractions.py``)."""

_WIDE = 0.1
"""Bandwidth over centre frequency above which visible fractions differ over the sweep: what an edge
diffracts takes another path than the return of the specular point."""

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Indices = NDArray[np.int64]
Scale = NDArray[np.float64]


class Sample(NamedTuple):
    """One pose: ``ratio (node, pair, part)``, to be multiplied by ``strength (pair, part)`` [m]."""

    ratio: Field
    strength: NDArray[np.float64]


class _Interval(NamedTuple):
    """One interval: ``ratio (place, node, pair, part)`` where it is ``known (place, part)``."""

    ratio: Field
    known: NDArray[np.bool_]


class Envelope:
    """An envelope over a capture, of the parts of one or several people: ``owner (part,)``.

    ``sample(place, parts, whole)`` returns the `Sample` of parts (n,) at a place in time, counted
    in keyframes from the start; ``whole (part,)`` is `whole_echo` near by, or None where all parts
    are asked for. Several threads call it at once. ``tolerance`` is the second difference of a
    part's echo, over the root of the power of the whole person, above which an interval is halved.
    ``places``, a power of two, is the largest number of parts into which an interval is divided.
    """

    def __init__(
        self,
        sample: Callable[[float, Indices, Scale | None], Sample],
        owner: Indices,
        tolerance: float,
        places: int,
    ) -> None:
        self._sample, self._owner, self._parts = sample, owner, np.arange(len(owner))
        self._tolerance, self._places = tolerance, places
        self._keyframes: KeyframeCache[int, Sample] = KeyframeCache(_KEPT_KEYFRAMES, _PASSING)
        self._intervals: KeyframeCache[int, _Interval] = KeyframeCache(0, _KEPT_INTERVALS)

    def prepare_keyframes(self, indices: Iterable[int]) -> None:
        """Find these keyframes, of `TOGETHER` intervals at most, with all cores."""
        # Only what is not known yet is computed, all of it at once.
        missing = [index for index in sorted(set(indices)) if index not in self._keyframes]
        found = thread_map(
            lambda n: self._sample(float(missing[n]), self._parts, None), range(len(missing))
        )
        for index, sample in zip(missing, found, strict=True):
            self._keyframes.keep(index, sample)

    def prepare_courses(self, indices: Iterable[int]) -> None:
        """Find the courses of these intervals, and of those beside them, with all cores."""
        # Slopes at the ends of an interval need the intervals on both sides as well.
        around = {index + step for index in indices for step in (-1, 0, 1) if index + step >= 0}
        missing = []
        for index in sorted(around):
            if index in self._intervals:
                self._intervals[index]  # now the last to be dropped
            else:
                missing.append(index)
        # Those intervals in turn need the keyframes around them, to tell where the echo bends.
        self.prepare_keyframes(
            index + step for index in missing for step in (-1, 0, 1, 2) if index + step >= 0
        )
        ends = [self._ends(index) for index in missing]
        found = thread_map(lambda n: self._divided(missing[n], *ends[n]), range(len(missing)))
        for index, interval in zip(missing, found, strict=True):
            self._intervals.keep(index, interval)

    def keyframe(self, index: int) -> Sample:
        """All parts at one keyframe."""
        return self._keyframes.get(index, lambda: self._sample(float(index), self._parts, None))

    def course(self, index: int) -> tuple[Field, Field, NDArray[np.bool_]]:
        """Return the cubics of an interval, with the slopes of parabolas through three places.

        They are ratio and slope (place, node, pair, part), where ``known (place, part)``.
        """
        self.prepare_courses([index])
        here, after = self._intervals[index], self._intervals[index + 1]
        before = self._intervals[index - 1] if index > 0 else here
        return here.ratio, _slopes(before, here, after, inside=index > 0), here.known

    def _ends(self, index: int) -> tuple[Sample | None, Sample, Sample, Sample]:
        """The keyframe before an interval, if any, those at its ends, and the one after it."""
        before = self.keyframe(index - 1) if index > 0 else None
        return before, self.keyframe(index), self.keyframe(index + 1), self.keyframe(index + 2)

    def _divided(
        self, index: int, before: Sample | None, first: Sample, last: Sample, after: Sample
    ) -> _Interval:
        # Only the ends are known at first.
        ratio = np.full((self._places + 1, *first.ratio.shape), np.nan + 0j)
        ratio[0], ratio[self._places] = first.ratio, last.ratio
        known = np.zeros((self._places + 1, len(self._parts)), dtype=bool)
        known[[0, self._places]] = True
        # A part that bends at either end is sampled in between, too.
        bends = [_bend(first.ratio, last.ratio, after.ratio, last.strength)]
        if before is not None:
            bends.append(_bend(before.ratio, first.ratio, last.ratio, first.strength))
        whole = np.maximum(*(whole_echo(end, self._owner) for end in (first, last)))
        bent = np.flatnonzero(np.max(bends, axis=0) > self._tolerance * whole)
        interval = _Interval(ratio, known)
        self._divide(index, interval, 0, self._places, bent, whole)
        return interval

    def _divide(
        self,
        index: int,
        interval: _Interval,
        left: int,
        right: int,
        parts: Indices,
        whole: Scale,
    ) -> None:
        """Sample these parts half-way, and go on where they bend there."""
        if right - left < 2 or len(parts) == 0:
            return
        # Half-way, for these parts alone.
        middle, (ratio, known) = (left + right) // 2, interval
        found = self._sample(index + middle / self._places, parts, whole)
        ratio[middle][:, :, parts] = found.ratio
        known[middle, parts] = True
        before, after = ratio[left][:, :, parts], ratio[right][:, :, parts]
        # Both halves are divided again for parts that still bend.
        bent = _bend(before, found.ratio, after, found.strength) > self._tolerance * whole[parts]
        for ends in ((left, middle), (middle, right)):
            self._divide(index, interval, *ends, parts[bent], whole)


def _bend(
    before: Field, here: Field, after: Field, strength: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Second difference of each part's echo (part,), largest over frequencies and pairs [m]."""
    return np.asarray((np.abs(before - 2 * here + after) * strength).max(axis=(0, 1)))


def whole_echo(sample: Sample, owner: Indices) -> Scale:
    """Root of the power of a part's whole owner (part,), mean over frequencies and pairs [m].

    So the scale of a person is the same whoever else is there.
    """
    power = (np.abs(sample.ratio * sample.strength) ** 2).mean(axis=(0, 1))
    return np.asarray(np.sqrt(np.bincount(owner, power)[owner]))


def _slopes(before: _Interval, here: _Interval, after: _Interval, *, inside: bool) -> Field:
    """Slopes per place (place, node, pair, part) where a part is known.

    A slope is that of the parabola through a place and the known places on either side of it; at
    the very start, where it is not ``inside``, that of a straight line.
    """
    # Places of three intervals in a row, and for each the nearest known place on either side.
    last = len(here.known) - 1
    known = np.concatenate([before.known[:-1], here.known, after.known[1:]])
    number = np.arange(len(known))[:, None]
    earlier = np.maximum.accumulate(np.where(known, number, 0))
    later = np.minimum.accumulate(np.where(known, number, 3 * last)[::-1])[::-1]
    place, part = np.nonzero(here.known)
    at = place + last
    left, right = earlier[at - 1, part], later[at + 1, part]
    gap, next_gap = (at - left)[:, None, None], (right - at)[:, None, None]

    def ratio(number: Indices) -> Field:
        several = np.stack([before.ratio, here.ratio, after.ratio])
        interval = np.clip(number // last, 0, 2)
        return np.asarray(several[interval, number - interval * last, :, :, part])

    value = ratio(at)
    # The slope of the parabola weights the nearer chord more.
    rise, next_rise = (value - ratio(left)) / gap, (ratio(right) - value) / next_gap
    if not inside:
        rise = np.where((place == 0)[:, None, None], next_rise, rise)
    slope = np.empty_like(here.ratio)
    slope[place, :, :, part] = (rise * next_gap + next_rise * gap) / (gap + next_gap)
    return slope


# -- before a whole array --------------------------------------------------------------------------


class ArrayEnvelope:
    """The envelope of each part of a moving body over a capture, for every Tx and Rx.

    It is the sum over the facets of a ``surface`` divided by the carriers, the echoes of the
    specular points; or, with ``gradual``, the visible fraction of these facets. Keyframes are
    ``anchor_s`` apart [s]. They come closer, down to ``anchor_s`` over ``places``, where the echo
    of a part bends by more than ``tolerance`` of that of the whole person. More places of the array
    are taken where the echo differs over the array by more than ``unevenness`` of it.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        surface: FacetBody | SkinFacets,
        *,
        anchor_s: float,
        tolerance: float,
        unevenness: float,
        places: int = 8,
        gradual: bool = False,
    ) -> None:
        self._radar, self._body, self._surface, self._gradual = radar, body, surface, gradual
        self.frequency = surface.frequency
        self._weights = array_nodes(radar, *_FINE).weights
        # Weights from coarse nodes to fine ones, which stand at antennas or between them.
        self._spread = spread_nodes(radar, _COARSE, _FINE)
        self._unevenness = unevenness
        self._step = keyframe_step(radar, anchor_s)
        self._envelope = Envelope(self._sample, owners_of(body), tolerance, places)

    def _sample(self, place: float, parts: Indices, whole: Scale | None) -> Sample:
        """Envelope at the fine nodes, from the coarse ones unless it differs over the array."""
        # The time of the keyframe before, in the middle of what is sampled of its chirp, and after
        # it.
        start_s = keyframe_time(self._radar, self._body, int(place) * self._step)
        time = start_s + place % 1 * self._step * self._radar.chirp_interval_s
        time = min(time, self._body.duration_s)
        pose, radar = self._body.at([time]), self._radar.at(time)
        coarse = self._at_nodes(time, pose, array_nodes(radar, *_COARSE), parts)
        ratio, strength = self._spread @ coarse.ratio, self._spread @ coarse.strength
        # A part whose echo differs over the array is computed at more nodes.
        echo = coarse.ratio * coarse.strength
        scale = whole_echo(coarse, owners_of(self._body)) if whole is None else whole[parts]
        uneven = (
            np.abs(echo - echo.mean(axis=1, keepdims=True)).max(axis=(0, 1))
            > self._unevenness * scale
        )
        if uneven.any():
            fine = self._at_nodes(time, pose, array_nodes(radar, *_FINE), parts[uneven])
            ratio[:, :, uneven], strength[:, uneven] = fine.ratio, fine.strength
        return Sample(ratio, strength)

    def _at_nodes(self, time: float, pose: Poses, nodes: ArrayNodes, parts: Indices) -> Sample:
        antennas, pairs = nodes.antennas, nodes.pairs
        # Each pair of nodes counts as a pose with one transmitter and one receiver.
        centres, frames = (
            np.repeat(array[:, parts], len(pairs), axis=0) for array in (pose.centres, pose.frames)
        )
        ends = antennas[pairs[:, 0]], antennas[pairs[:, 1], None]
        carriers = self._surface.carriers(Geometry(*ends, centres, frames, pose.semi_axes[parts]))
        length, strength = (values[:, 0] for values in carriers)
        given = time, pose, antennas, pairs, length, parts
        if self._gradual:
            assert isinstance(self._surface, FacetBody)  # a skin has no fraction that is seen
            return Sample(self._surface.field(*given, left=True), np.abs(strength))
        amplitude = self._surface.field(*given)
        # Where there is no specular point, antennas are on opposite sides and see next to nothing.
        ratio = np.where(strength != 0, amplitude / np.where(strength != 0, strength, 1.0), 0.0)
        return Sample(ratio, np.abs(strength))

    def times(self, chirps: Indices, tx: Indices, strength: Array) -> Field:
        """Multiply ``strength (chirp, rx, part)`` at chirps, which ``tx (chirp,)`` send.

        Returned is (node, chirp, rx, part) in the phase convention of `Echoes`.
        """
        amplitude = np.empty((len(self.frequency), *strength.shape), dtype=np.complex128)
        # Chirps interval by interval.
        intervals, rest = keyframe_before(self._radar, chirps, self._step)
        envelope, weights = self._envelope, self._weights
        # Power is measured at keyframes: there no later keyframe is needed.
        between = set(intervals[rest != 0].tolist())
        in_order = sorted(set(intervals.tolist()))
        # Intervals that are prepared together share the cores.
        for _, group in groupby(in_order, key=lambda interval: interval // TOGETHER):
            together = list(group)
            envelope.prepare_keyframes(k for k in together if k not in between)
            envelope.prepare_courses(between.intersection(together))
            for interval in together:
                inside = np.flatnonzero(intervals == interval)
                if interval in between:
                    # Between keyframes the cubic, at keyframes the value itself.
                    fraction = self._radar.slots_of(chirps[inside]) / self._step - interval
                    course = envelope.course(interval)
                    fill_envelope(inside, fraction, tx, weights, course, strength, amplitude)
                else:
                    ratio = envelope.keyframe(interval).ratio[:, None]
                    amplitude[:, inside] = (weights[tx[inside]] @ ratio) * strength[inside]
        return amplitude


def visible_fractions_of(
    radar: Radar, body: Body, *, variant: str, spreading: bool
) -> ArrayEnvelope:
    """Return what occluders leave of the returns of a moving body's parts.

    The visible fraction of a part is the sum over its facets with traced shadows over the same sum
    without them, at three frequencies where the sweep is wide, else at one. ``variant`` and
    ``spreading`` are those of a model.
    """
    surface = FacetBody(
        radar,
        body,
        variant=variant,
        spreading=spreading,
        facets=None,
        nodes=3 if radar.bandwidth_hz > _WIDE * radar.centre_frequency_hz else 1,
    )
    return ArrayEnvelope(
        radar,
        body,
        surface,
        anchor_s=_GRADUAL_S,
        tolerance=_GRADUAL_BEND,
        unevenness=_GRADUAL_UNEVENNESS,
        places=_GRADUAL_PLACES,
        gradual=True,
    )
