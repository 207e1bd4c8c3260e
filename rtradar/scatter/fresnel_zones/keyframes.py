"""Fractions of the returns left to the parts of a moving body: at keyframes, and smoothly between.

Over the array V is a polynomial through at most six nodes along a line of Tx and three along a line
of Rx: half a metre of array sees an edge half a metre before a part move by several Fresnel zones
(``validation/other_methods/fresnel.py``: 1.0 % rms at 12 GHz; two along the line of Rx give 1.9 %,
four along that of Tx 7 %). In time it is a cubic through keyframes 10 ms apart, and 1.25 ms (12
GHz) or 0.5 ms (77 GHz) apart for each part and interval in which it bends. Slopes are those of the
parabola through neighbours, so that the result has no corners, whatever the spacing on either side.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.kernels.scatter.zones.fresnel_zones import blend_fractions
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import array_nodes
from rtradar.scatter.common.keyframes import KeyframeCache, keyframe_before, keyframe_step
from rtradar.scatter.fresnel_zones.visible_fraction import SHADOW_RAYS, Zones, zone_fractions
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.trace.body_tracer import BodyTracer

TX_NODES, RX_NODES = 6, 3
"""Antennas along a line of Tx and of Rx at which fractions are computed."""

_KEPT_KEYFRAMES = 1024
"""Keyframes remembered, 10 s of them in some 40 MB, so that the pass that measures power and the
pass that makes the signal trace once; longer recordings trace again from there on."""

_KEPT_INTERVALS = 512
"""Intervals remembered, 5 s of them: the view asks again when the signal is made."""

_AT_ONCE = 16
"""Intervals whose rays are traced together."""

_PASSING = 8 * _AT_ONCE
"""Keyframes, and intervals, held at a time beyond those: each interval needs six keyframes."""

_FINE, _FINE_FREQUENCY_HZ = 8, 14e9
"""Keyframes to 10 ms where the fraction bends, at that frequency; Fresnel zones are as narrow as
the root of the wavelength."""

BEND = 0.02
"""Second difference over 10 ms that asks for finer keyframes: a cubic misses at most an eighth."""


class ZoneFractions:
    """Visible fractions of the returns of a moving body over a capture.

    They are for frequencies (frequency,) [Hz]. ``wanted(time)`` says which parts (part,) bool are
    computed at a keyframe [s]; the others are 1. ``shadow_rays`` is the number of points on each
    part to which rays are traced from each node of the array, ``bend`` as `BEND`.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        frequency: NDArray[np.float64],
        tracer: BodyTracer,
        wanted: Callable[[float], NDArray[np.bool_]] | None = None,
        shadow_rays: int = SHADOW_RAYS,
        bend: float = BEND,
    ) -> None:
        self._radar, self._body, self._tracer, self._wanted = radar, body, tracer, wanted
        self._shadow_rays, self._bend = shadow_rays, bend
        self._wavenumber = 2 * np.pi * frequency / SPEED_OF_LIGHT_MPS
        self._nodes = array_nodes(radar, TX_NODES, RX_NODES)
        self._step = keyframe_step(radar)
        finer = _FINE * max(1.0, radar.centre_frequency_hz / _FINE_FREQUENCY_HZ) ** 0.5
        self._fine = min(round(finer), self._step)
        self._keyframes: KeyframeCache[int, NDArray[np.complex128]] = KeyframeCache(
            _KEPT_KEYFRAMES, _PASSING
        )
        self._intervals: KeyframeCache[int, _Interval] = KeyframeCache(_KEPT_INTERVALS, _PASSING)

    def at(
        self, chirps: NDArray[np.int64], parts: NDArray[np.int64] | None = None
    ) -> NDArray[np.complex128]:
        """Fractions V (frequency, chirp, rx, part) at chirps, of some parts or all of them.

        Chirps are numbered from the start of the capture.
        """
        chirps = np.asarray(chirps, dtype=np.int64)
        if parts is None:
            parts = np.arange(len(self._body.part_names))
        shape = (len(self._wavenumber), len(chirps), self._radar.n_rx, len(parts))
        out = np.empty(shape, dtype=np.complex128)
        spread = self._nodes.weights[self._radar.tx_of_chirp(chirps)]
        interval, chirp = keyframe_before(self._radar, chirps, self._step)
        where = chirp / self._step * self._fine
        numbers = np.unique(interval)
        # At a keyframe alone neighbours do not matter.
        between = np.isin(numbers, interval[where > 0])
        for begin in range(0, len(numbers), _AT_ONCE):
            own = slice(begin, begin + _AT_ONCE)
            some, whole = numbers[own], set(numbers[own][between[own]].tolist())
            self._look_up(whole, set(some.tolist()) - whole, parts)
            for number in some.tolist():
                inside = np.flatnonzero(interval == number)
                if number in whole:
                    fine, nodes, slopes = self._cubics(number, parts)
                else:
                    nodes = np.stack([self._keyframe(number)[..., parts]] * 2)
                    fine, slopes = np.zeros(len(parts), dtype=bool), np.zeros_like(nodes)
                blend_fractions(nodes, slopes, fine, where[inside], spread[inside], inside, out)
        return out

    def _look_up(self, whole: set[int], alone: set[int], parts: NDArray[np.int64]) -> None:
        """Trace what the cubics over whole intervals, and single keyframes, need, all at once."""
        around = {number + i for number in whole for i in range(-2, 4)}
        self._find_keyframes(around | alone)
        # Of the neighbours of an interval no more than the node beside it.
        nodes: dict[int, set[int]] = {}
        for number in whole:
            nodes.setdefault(number, set()).update(range(self._fine - 1))
            if self._fine > 1:
                nodes.setdefault(number - 1, set()).add(self._fine - 2)
                nodes.setdefault(number + 1, set()).add(0)
        self._find_nodes(nodes, parts)

    def _fractions(
        self, times: NDArray[np.float64], pose: NDArray[np.int64], part: NDArray[np.int64]
    ) -> NDArray[np.complex128]:
        """Fractions (zone, frequency, pair), each of a part at one of the times (time,) [s]."""
        poses = self._body.at(times)
        radar, zones = self._radar, len(part)
        tx, rx = (np.tile(a.mean(axis=0), (len(times), 1)) for a in (radar.tx, radar.rx))
        _, _, points = solve_specular_points(Geometry(tx, rx[:, None], *poses), points=True)
        k = 2 * np.pi * radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS
        antennas = np.broadcast_to(self._nodes.antennas, (zones, *self._nodes.antennas.shape))
        laid_for = np.full(zones, k)
        given = Zones(tx[pose], rx[pose], points[pose, 0, part], part, pose, antennas, laid_for)
        wavenumber = np.broadcast_to(self._wavenumber, (zones, len(self._wavenumber)))
        return zone_fractions(
            self._tracer, given, poses, self._nodes.pairs, wavenumber, self._shadow_rays
        )

    def _times(self, chirps: NDArray[np.float64]) -> NDArray[np.float64]:
        # Past the end of the recording the body rests in its last pose; before it nothing moved.
        times = (np.maximum(chirps, 0.0) + 0.5) * self._radar.chirp_interval_s
        return np.minimum(times, self._body.duration_s)

    def _keyframe(self, number: int) -> NDArray[np.complex128]:
        """Fractions (frequency, pair, part) at a keyframe."""
        number = max(number, 0)
        if number not in self._keyframes:
            self._find_keyframes([number])
        return self._keyframes[number]

    def _find_keyframes(self, numbers: Iterable[int]) -> None:
        missing = sorted({n for n in (max(n, 0) for n in numbers) if n not in self._keyframes})
        if not missing:
            return
        times = self._times(np.array(missing) * float(self._step))
        wanted = np.ones((len(times), len(self._body.part_names)), dtype=bool)
        if self._wanted is not None:
            wanted = np.stack([self._wanted(float(time)) for time in times])
        pose, part = np.nonzero(wanted)
        shape = (len(times), len(self._wavenumber), len(self._nodes.pairs), wanted.shape[1])
        fractions = np.ones(shape, dtype=np.complex128)
        fractions[pose, :, :, part] = self._fractions(times, pose, part)
        for number, found in zip(missing, fractions, strict=True):
            self._keyframes.keep(number, found)

    def _interval(self, number: int) -> _Interval:
        return self._intervals.get(number, partial(self._begin_interval, number))

    def _begin_interval(self, number: int) -> _Interval:
        """Which parts bend in an interval, from the keyframes around it; no nodes in between."""
        around = np.stack([self._keyframe(number + i) for i in (-1, 0, 1, 2)])
        bend = np.abs(np.diff(around, 2, axis=0)).max(axis=(0, 1, 2))
        fine = (bend > self._bend) & (self._fine > 1 and number >= 0)
        return _Interval(fine, around[1:3].copy(), self._fine - 1)

    def _find_nodes(self, nodes: dict[int, set[int]], parts: NDArray[np.int64]) -> None:
        """Compute what is not known of these nodes of intervals, of these parts."""
        wanted: list[tuple[_Interval, NDArray[np.int64], NDArray[np.int64]]] = []
        chirps, pose, part, count = [], [], [], 0
        for number, some in sorted(nodes.items()):
            interval = self._interval(number)
            node, own = interval.missing(np.array(sorted(some), dtype=np.int64), parts)
            if not len(node):
                continue
            used, place = np.unique(node, return_inverse=True)
            wanted.append((interval, node, own))
            chirps.append((number + (used + 1) / self._fine) * self._step)
            pose.append(place + count)
            part.append(own)
            count += len(used)
        if not wanted:
            return
        found = self._fractions(
            self._times(np.concatenate(chirps)), np.concatenate(pose), np.concatenate(part)
        )
        ends = np.cumsum([len(node) for _, node, _ in wanted])[:-1]
        for (interval, node, own), fractions in zip(wanted, np.split(found, ends), strict=True):
            interval.keep(node, own, fractions)

    def _cubics(
        self, number: int, parts: NDArray[np.int64]
    ) -> tuple[NDArray[np.bool_], NDArray[np.complex128], NDArray[np.complex128]]:
        """Which parts are fine, nodes and slopes (node, frequency, pair, part) of an interval."""
        before, here, after = (self._interval(number + i) for i in (-1, 0, 1))
        nodes = here.nodes(parts)
        slopes = np.empty_like(nodes)
        slopes[1:-1] = (nodes[2:] - nodes[:-2]) / 2
        for end, left, right in ((0, before, here), (-1, here, after)):
            wide_left, wide_right = (
                np.where(one.fine[parts], 1, self._fine) for one in (left, right)
            )
            rise_left = (nodes[end] - left.beside(-1, parts)) / wide_left
            rise_right = (right.beside(0, parts) - nodes[end]) / wide_right
            slopes[end] = rise_left * wide_right + rise_right * wide_left
            slopes[end] /= wide_left + wide_right
        return here.fine[parts], nodes, slopes


class _Interval:
    """Fractions over 10 ms: at both ends, and at nodes in between for parts that are ``fine``.

    ``fine (part,)`` bool, ``ends (2, frequency, pair, part)``, and how many nodes are in between.
    """

    def __init__(self, fine: NDArray[np.bool_], ends: NDArray[np.complex128], inner: int) -> None:
        self.fine, self.ends = fine, ends
        # A column for each part that is fine, for all parts would be many.
        self._column = np.cumsum(fine) - 1
        self._between = np.empty((inner, *ends.shape[1:-1], int(fine.sum())), dtype=np.complex128)
        self._known = np.zeros((inner, self._between.shape[-1]), dtype=bool)

    def missing(
        self, nodes: NDArray[np.int64], parts: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Node and part of each fraction that is not known, of these nodes in between and parts."""
        own = parts[self.fine[parts]]
        node, which = np.nonzero(~self._known[np.ix_(nodes, self._column[own])])
        return nodes[node], own[which]

    def keep(
        self, node: NDArray[np.int64], part: NDArray[np.int64], fractions: NDArray[np.complex128]
    ) -> None:
        """Remember ``fractions (fraction, frequency, pair)``."""
        column = self._column[part]
        self._between[node, :, :, column], self._known[node, column] = fractions, True

    def nodes(self, parts: NDArray[np.int64]) -> NDArray[np.complex128]:
        """All nodes (node, frequency, pair, part); parts that are not fine use first and last."""
        ends, fine = self.ends[..., parts], self.fine[parts]
        nodes = np.repeat(ends[:1], len(self._between) + 2, axis=0)
        nodes[-1] = ends[1]
        nodes[1:-1, :, :, fine] = self._between[..., self._column[parts[fine]]]
        return nodes

    def beside(self, end: int, parts: NDArray[np.int64]) -> NDArray[np.complex128]:
        """The node next to the first (0) or the last (-1) one: (frequency, pair, part)."""
        fine = self.fine[parts]
        node = self.ends[-1 - end][..., parts]
        if fine.any():
            node[..., fine] = self._between[end][..., self._column[parts[fine]]]
        return node
