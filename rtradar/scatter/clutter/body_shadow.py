"""The moving shadow in the clutter: what a person's body takes from the echoes of a room.

Each leg of an echo, from an antenna to a point, from wall to wall or back, is a spherical wave that
passes the body. What is lost of its field is Kirchhoff's integral over the silhouette of all parts
together, across the leg, in units of the Fresnel zone there
(`rtradar.kernels.scatter.silhouettes`): a complex number that begins before the edge arrives and is
a half where it is in the middle. An echo keeps the product of what its legs keep. Of what walls
reflect every leg of every Tx and Rx is computed, at `SWEEP_NODES` frequencies, for zones narrow
over the sweep. Points on furniture and on rough walls, which all antennas share, are many and weak:
the fraction is that at the sweep's centre and at the ends of each line of Tx and the middle of each
of Rx, linear in between; for the weakest it is that in the array's middle. Nobody is seen past an
edge here, so no ray is traced. The time between keyframes follows from the error of cubics between
them, which is measured beforehand: that of a trunk that walks past is small, that of hands alone,
as in jumping jacks, is much of all that changes.
"""

from __future__ import annotations

from functools import lru_cache, partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.kernels.scatter.silhouettes import Shadow, occluded_fractions, wave_table
from rtradar.kernels.still_room import cubic_weights
from rtradar.radar import Radar
from rtradar.scatter.clutter.returns import RoomEchoes
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.common.interpolation import shadow_nodes, sweep_nodes
from rtradar.scatter.common.keyframes import KeyframeCache, keyframe_step
from rtradar.scatter.common.poses import chirp_poses
from rtradar.system.threads import thread_map

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Indices = NDArray[np.int64]
Bools = NDArray[np.bool_]

_SHORTEST_M = 1e-6
KEYFRAMES_S, SHORTEST_S, TRIED_S = 30e-3, 4e-3, 10e-3
"""Longest and shortest time between keyframes of the shadow, and that for which the error of the
cubics in between is measured [s]. `validation/other_methods/shadow.py` judges the one chosen."""
_ERROR_DB, _ERROR_POWER = -32.0, 3.0
"""Error that is aimed at, over what changes of the shadow in `_CHANGE_S` [dB], and the power of the
time between keyframes with which its power grows, as `validation/other_methods/shadow.py` has
it."""
_CHANGE_S, _TESTS, _EVERY = 0.1, 12, 4
"""Time of a change [s], the instants of the capture at which the error is measured, and one of how
many points it is measured for."""
_KEPT_KEYFRAMES = 8
"""Keyframes in the cache: those on both sides of a chirp, and a few before."""
SWEEP_NODES = 5
"""Frequencies at which the shadow of what walls reflect is computed."""
MIRROR_LINES, POINT_LINES = 48, 12
"""Lines through a leg over which Kirchhoff's integral is taken: an error of 0.4 % and of 3 %."""
MIRROR_FADE, POINT_FADE = 0.2, 0.3
"""Damping ``eps`` of the integral: an edge two Fresnel radii aside has a tenth of its fringes. A
point stands for facets or a cell as wide as such a zone, which sees none."""
MIRROR_REACH, POINT_REACH = 2.5, 2.0
"""Fresnel radii beyond which parts are left out: fringes are then below 0.2 %."""
_WEAK = 0.03
"""Power of the points seen from the array's middle only, over that of all that the body may come
near."""
_FAINT = 2e-3
"""Power of the points whose shadow is left out, over that of all that the body may come near."""
_TRACK_S, _MOST_INSTANTS = 0.05, 400
"""Spacing of the instants at which it is asked what the body comes near [s], and most of them."""
_LEGS_A_THREAD = 256


class ClutterShadow:
    """Shadow of a moving body in the clutter of a room.

    ``step`` is the number of chirps between keyframes, ``starts (object + 1,)`` the first echo of
    each object in the count through all, ``mirrors`` the numbers of objects that walls reflect,
    ``frequency (node,)`` the frequencies of their shadow [Hz].
    """

    def __init__(self, clutter: Clutter, body: Body) -> None:
        radar = clutter.radar
        self._radar, self._body = radar, body
        self._antennas, self._tx_weights, self._rx_weights = shadow_nodes(radar)
        self._middle = self._antennas.mean(axis=0)
        self._extent = float(np.linalg.norm(self._antennas - self._middle, axis=1).max())
        self.starts = np.cumsum([0, *(own.n_echoes for own in clutter.objects)])
        self.frequency = sweep_nodes(radar, SWEEP_NODES)
        objects = enumerate(clutter.objects)
        self.mirrors = tuple(number for number, own in objects if own.kind == "mirror")
        self._legs = _mirror_legs([clutter.objects[number] for number in self.mirrors], radar)
        self._points, self._of_point, power = _shared_points(clutter, self.starts)
        count = min(int(body.duration_s / _TRACK_S) + 2, _MOST_INSTANTS)
        self._keep_points(power, body.at(np.linspace(0.0, body.duration_s, count)))
        mirrors = [clutter.objects[number].amplitude for number in self.mirrors]
        self._mirror_m = np.array([np.abs(own).max() for own in mirrors])
        self.step = keyframe_step(radar, min(KEYFRAMES_S, max(SHORTEST_S, self._apart_s())))
        self._kept: KeyframeCache[int, Shadow] = KeyframeCache(0, _KEPT_KEYFRAMES)

    def at(self, keyframe: int) -> Shadow:
        """Return the shadow at a keyframe, the pose of chirp ``keyframe * step``."""
        return self._kept.get(keyframe, partial(self._find, keyframe))

    def _find(self, keyframe: int) -> Shadow:
        body = self._posed(max(keyframe, 0) * self.step)
        return Shadow(*self._of_points(body), *self._of_mirrors(body))

    def _posed(self, chirp: int) -> tuple[Array, Array, Array]:
        at = chirp_poses(self._radar, self._body, np.array([chirp]))
        maps = np.swapaxes(at.frames[0], 1, 2) / at.semi_axes[:, :, None]
        return at.centres[0], np.ascontiguousarray(maps), at.semi_axes.max(axis=1)

    def _apart_s(self) -> float:
        """Time between keyframes at which the error is as large as it may be [s].

        Measured is that of cubics between keyframes `TRIED_S` apart.
        """
        ends = np.array([-1.5, -0.5, 0.5, 1.5]) * TRIED_S
        around = np.array([0.0, *ends, -_CHANGE_S / 2, _CHANGE_S / 2])
        middles = np.linspace(0.0, self._body.duration_s, _TESTS + 2)[1:-1, None]
        chirps = np.clip(middles + around, 0, self._body.duration_s) / self._radar.chirp_interval_s
        error = change = 0.0
        for now, *rest in (map(self._lost_m, own) for own in chirps.astype(np.int64)):
            error += (np.abs(now - cubic_weights([0.5])[0] @ rest[:4]) ** 2).sum()
            change += np.var([now, *rest[4:]], axis=0).sum()
        if not error > 0:
            return KEYFRAMES_S
        return float(TRIED_S * (change / error * 10 ** (_ERROR_DB / 10)) ** (1 / _ERROR_POWER))

    def _lost_m(self, chirp: int) -> Field:
        """What some points lose for the array's middle, and mirrors for one channel (loss,) [m]."""
        body = self._posed(chirp)
        points = np.zeros(len(self._points), dtype=np.complex128)
        near = np.flatnonzero(self._passes(*_ball(body[0], body[2])))
        near = near[near % _EVERY == 0]
        points[near] = 1 - (1 - self._seen_from(self._middle[None], near, body)[0]) ** 2
        legs = self._legs
        some = np.flatnonzero(legs.channel == self._radar.n_channels // 2)
        geometry = tuple(array[some] for array in legs.geometry)
        lost = self._lost(geometry, body, MIRROR_REACH, MIRROR_LINES, np.ones(1), MIRROR_FADE)
        kept = np.ones(len(self.mirrors), dtype=np.complex128)
        np.multiply.at(kept, legs.mirror[some], 1 - lost[:, 0])
        return np.concatenate([points * self._point_m * _EVERY**0.5, (1 - kept) * self._mirror_m])

    def _of_mirrors(self, body: tuple[Array, Array, Array]) -> tuple[Indices, Field]:
        """Which mirrors are occluded, and what of each is lost (node, tx, rx, mirror)."""
        legs, radar = self._legs, self._radar
        scales = self.frequency / radar.centre_frequency_hz
        lost = self._lost(legs.geometry, body, MIRROR_REACH, MIRROR_LINES, scales, MIRROR_FADE)
        kept = np.ones((len(self.mirrors), radar.n_channels, SWEEP_NODES), dtype=np.complex128)
        some = np.flatnonzero(lost.any(axis=1))
        np.multiply.at(kept, (legs.mirror[some], legs.channel[some]), 1 - lost[some])
        hidden = np.flatnonzero((kept != 1).any(axis=(1, 2)))
        shape = len(hidden), radar.n_tx, radar.n_rx, SWEEP_NODES
        return np.array(self.mirrors, dtype=np.int64)[hidden], 1 - kept[hidden].reshape(shape)

    def _of_points(self, body: tuple[Array, Array, Array]) -> tuple[Indices, Field]:
        """Which echoes of shared points are occluded, and the fraction (tx, rx, echo)."""
        centres, _, longest = body
        near = np.flatnonzero(self._passes(*_ball(centres, longest)))
        from_middle = self._seen_from(self._middle[None], near, body)
        some = from_middle[0] != 0
        from_middle, near = from_middle[:, some], near[some]
        strong = np.flatnonzero(self._strong[near])
        from_nodes = self._seen_from(self._antennas, near[strong], body)
        lost = np.repeat(from_middle, len(self._antennas), axis=0)
        lost[:, strong] = from_nodes
        # Not by BLAS, whose threads cost more than these few numbers.
        of_tx, of_rx = (
            1 - np.einsum("an,ne->ae", weights, lost)
            for weights in (self._tx_weights, self._rx_weights)
        )
        return self._of_point[near], 1 - of_tx[:, None] * of_rx[self._radar.rx_of_tx]

    def _seen_from(self, antennas: Array, points: Indices, body: tuple[Array, ...]) -> Field:
        """Fraction lost on the legs from places to some points (place, point)."""
        starts = np.repeat(antennas, len(points), axis=0)
        ends = np.tile(self._points[points], (len(antennas), 1))
        length = np.linalg.norm(ends - starts, axis=1)
        geometry = starts, ends, np.zeros(len(length)), length
        lost = self._lost(geometry, body, POINT_REACH, POINT_LINES, np.ones(1), POINT_FADE)
        return lost.reshape(len(antennas), len(points))

    def _lost(
        self,
        legs: tuple[Array, ...],
        body: tuple[Array, ...],
        reach: float,
        lines: int,
        scales: Array,
        fade: float,
    ) -> Field:
        """Fraction of the field that the body takes from each leg (leg, node)."""
        out = np.zeros((len(legs[0]), len(scales)), dtype=np.complex128)

        def fill(begin: int) -> None:
            some = slice(begin, begin + _LEGS_A_THREAD)
            own = tuple(np.ascontiguousarray(array[some]) for array in legs)
            given = self._radar.wavelength_m, body, reach, lines, scales, _table(fade)
            occluded_fractions(own, *given, out[some])

        thread_map(fill, range(0, len(out), _LEGS_A_THREAD))
        return out

    def _keep_points(self, power: Array, poses: Poses) -> None:
        """Keep the points that the body comes near in some poses, without the weakest of them."""
        self._measure()
        near = np.zeros(len(self._points), dtype=bool)
        for centres in poses.centres:
            near |= self._passes(*_ball(centres, poses.semi_axes.max(axis=1)))
        order = np.flatnonzero(near)[np.argsort(power[near])]
        share = np.cumsum(power[order]) / power[order].sum()
        chosen = np.sort(order[share >= _FAINT])
        strong = np.zeros(len(self._points), dtype=bool)
        strong[order[share >= _WEAK]] = True
        self._strong, self._point_m = strong[chosen], np.sqrt(power[chosen])
        self._points, self._of_point = self._points[chosen], self._of_point[chosen]
        self._measure()

    def _measure(self) -> None:
        self._ways = self._points - self._middle
        self._squares = np.maximum((self._ways**2).sum(axis=1), 1e-30)

    def _passes(self, place: Array, radius: float) -> Bools:
        """Whether legs from the array to the points have part of a ball in their Fresnel zone."""
        away = place - self._middle
        along = self._ways @ away
        part = np.clip(along / self._squares, 0.0, 1.0)
        gap = away @ away - 2 * part * along + part**2 * self._squares
        zone = np.sqrt(self._radar.wavelength_m * part * (1 - part) * np.sqrt(self._squares))
        return np.asarray(gap < (radius + self._extent + zone) ** 2)


def _ball(centres: Array, longest: Array) -> tuple[Array, float]:
    middle = (centres.max(axis=0) + centres.min(axis=0)) / 2
    return middle, float((np.linalg.norm(centres - middle, axis=1) + longest).max())


@lru_cache
def _table(fade: float) -> Field:
    return np.asarray(wave_table(fade))


def _shared_points(clutter: Clutter, starts: Indices) -> tuple[Array, Indices, Array]:
    """Points (point, 3) of echoes whose points all antennas share, each one's echo and power."""
    points, numbers, powers = [np.empty((0, 3))], [np.empty(0, dtype=np.int64)], [np.empty(0)]
    for own, first in zip(clutter.objects, starts[:-1], strict=True):
        if own.kind != "mirror":
            points.append(own.points[0, 0, :, 0])
            numbers.append(np.arange(own.n_echoes) + first)
            middle = own.amplitude[len(own.frequency) // 2]
            powers.append((np.abs(middle) ** 2).mean(axis=(0, 1)))
    return np.concatenate(points), np.concatenate(numbers), np.concatenate(powers)


class _Legs(NamedTuple):
    """Legs of the paths over walls of every channel.

    ``geometry`` is starts and ends (leg, 3), the path from the Tx to the start and the whole path
    (leg,) [m]; ``mirror`` is the number among the mirrors and ``channel (leg,)`` that of the path.
    """

    geometry: tuple[Array, Array, Array, Array]
    mirror: Indices
    channel: Indices


def _mirror_legs(mirrors: list[RoomEchoes], radar: Radar) -> _Legs:
    places, numbers = np.empty((0, 3)), np.empty(0, dtype=np.int64)
    found = [(places, places, np.empty(0), np.empty(0), numbers, numbers)]
    for number, own in enumerate(mirrors):
        # The echoes of one object are delays in the walls, on one path.
        received = (own.amplitude != 0).any(axis=(0, 3))
        channel = np.flatnonzero(received)
        rx = radar.rx[radar.rx_of_tx]
        tx = np.broadcast_to(radar.tx[:, None], rx.shape)
        stops = [array[received] for array in (tx, *np.moveaxis(own.points[:, :, 0], 2, 0), rx)]
        sizes = [np.linalg.norm(end - start, axis=1) for start, end in pairwise(stops)]
        before, length = np.zeros(len(channel)), np.sum(sizes, axis=0)
        for (start, end), size in zip(pairwise(stops), sizes, strict=True):
            # In the crease of a corner a path goes from wall to wall at one place.
            long = size > _SHORTEST_M
            arrays = (start, end, before, length, np.full(len(channel), number), channel)
            found.append(tuple(array[long] for array in arrays))
            before = before + size
    starts, ends, before, length, mirror, channel = (
        np.concatenate(arrays) for arrays in zip(*found, strict=True)
    )
    return _Legs((starts, ends, before, length), mirror, channel)
