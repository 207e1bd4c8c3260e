"""The moving shadow in the clutter: what people and objects that move take from a room's echoes.

Each leg of an echo, from an antenna to a point, from wall to wall or back, is a spherical wave that
passes people and objects. The fraction of its field that is lost is Kirchhoff's integral over the
silhouette of all parts and triangles together, across the leg, in units of the Fresnel zone there
(`rtradar.kernels.scatter.silhouettes`). It is a complex number that begins before the edge arrives,
and is a half where the edge is in the middle. An echo keeps the product of what its legs keep. For
echoes over walls every leg of every Tx and Rx is computed, at `SWEEP_NODES` frequencies, because
zones become narrower over the sweep.

Points on furniture and on rough walls, which all antennas share, are many. A few hundred of them
return most of the power: these are computed for every Tx and at three frequencies, the weak ones
from the array's middle at the sweep's centre. How many count as strong, the time between keyframes,
and the longer time between keyframes of weak points follow from errors that are measured
beforehand. Where no error is allowed, all points are computed as `EXACT` says.

Mitsuba is not asked. A ray is free or not, but what is wanted is the wave near an edge, whose field
is between both over a Fresnel zone. Clutter that furniture hides is already missing from the room's
echoes. The rest is a product of the free wave and the moving screen, as if the fixed edge of
furniture were many Fresnel zones away from the edge of the body.

The series of a conducting cylinder between two line sources says how far from its edge the fringes
of a screen are those of a body (`validation/other_methods/shadow.py`). Up to two Fresnel radii from
the edge, Kirchhoff's integral is off by -12 to -15 dB of the shadow's change, with a sign that
depends on polarisation. Farther away, where a wave turns by more than (2/ka)^(1/3), the wave is the
ray reflected at grazing incidence, a ghost of the person that has its own echo, and not the edge's
fringe. With the damping ``eps`` = 0.1 both together are as near as any damping comes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.elementary import cubic_weights
from rtradar.kernels.scatter.silhouettes import Posed, Shadow
from rtradar.radar import Radar
from rtradar.scatter.clutter.furniture import small_facets
from rtradar.scatter.clutter.point_shadow import (
    CLOSE,
    EXACT,
    FAINT,
    FINE,
    REACH,
    USUAL,
    PointShadow,
    Precision,
    SharedPoints,
    lost_on_legs,
)
from rtradar.scatter.clutter.returns import RoomEchoes
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.common.interpolation import interpolation_weights, sweep_nodes
from rtradar.scatter.common.poses import KeyframeCache, chirp_poses, keyframe_step
from rtradar.scene import Object

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Indices = NDArray[np.int64]
Bools = NDArray[np.bool_]

_SHORTEST_M = 1e-6
KEYFRAMES_S, SHORTEST_S, TRIED_S = 50e-3, 4e-3, 10e-3
"""Longest and shortest time between keyframes of the shadow, and that for which the error of the
cubics in between is measured [s]. `validation/other_methods/shadow.py` judges the one chosen."""
ERROR_DB, _ERROR_POWER = -32.0, 3.0
"""Error that is aimed at, over the change of the shadow in `_CHANGE_S` [dB]; and the exponent with
which its power grows with the time between keyframes, as measured by
`validation/other_methods/shadow.py`."""
_OF_KEYFRAMES, _OF_POINTS, _OF_SLOW = 0.15, 0.7, 0.15
"""Fractions of the error that is allowed, as a power: for keyframes, for points, and for the
keyframes of weak points."""
SLOW_S, SLOW_TRIED_S = 0.4, 0.1
"""`KEYFRAMES_S` and `TRIED_S` for weak points."""
_STRONG = (0.8, 0.95, 0.99)
"""Parts of the power of points, the strongest of which may be computed as `USUAL`."""
_LEFT_OUT, _THIN = 1e-4, 4
"""Part of the power of points that is left out; and of how many weak points one is looked at."""
_ENDS = np.array([-1.5, -0.5, 0.5, 1.5])
"""Keyframes about the middle between two of them."""
_CHANGE_S, _TESTS, _FEW = 0.1, 12, 4
"""Time of a change [s], and the instants of the capture at which errors are measured: those between
keyframes, and those of points."""
_KEPT_KEYFRAMES = 8
"""Keyframes in the cache: those on both sides of a chirp, and a few before."""
SWEEP_NODES = 5
"""Frequencies at which the shadow of what walls reflect is computed."""
MIRROR_LINES = 48
"""Lines through a leg over which Kirchhoff's integral is taken: an error of 0.4 %."""
_EDGE_M = 0.5
"""Longest side of an object's triangles, whose sides are straight in units of the zone [m]."""
_TRACK_S, _MOST_INSTANTS = 0.05, 400
"""Spacing of the instants at which it is asked what comes near a point [s], and most of them."""


class ClutterShadow:
    """Shadow that a moving body, and ``objects`` that move, cast in the clutter of a room.

    Approximations may be in error by ``allowed_m2``, a mean power of IF samples [m^2], or by
    `ERROR_DB` of what changes if that is more; ``error_m2`` is the error that is expected.

    ``step`` is the number of chirps between keyframes, ``slower`` the number of keyframes between
    those of weak points, 0 where no points are weak. ``starts (object + 1,)`` is the first echo
    of each object of the clutter, counted through all, and ``mirrors`` are the numbers of the
    objects that walls reflect. ``frequency (node,)`` are the frequencies of the shadow of these,
    ``point_frequency (node,)`` those of the shadow of points [Hz].
    """

    def __init__(
        self, clutter: Clutter, body: Body, objects: Sequence[Object] = (), allowed_m2: float = 0.0
    ) -> None:
        self._radar, self._body = clutter.radar, body
        # Triangles of objects about their pivots, in their own axes.
        self._faces = [
            (moving, small_facets(moving.shape.corners, 0, _EDGE_M).corners) for moving in objects
        ]
        # Paths over walls are few, and each leg of every channel is computed.
        self.starts = np.cumsum([0, *(own.n_echoes for own in clutter.objects)])
        self.frequency = sweep_nodes(self._radar, SWEEP_NODES)
        numbered = enumerate(clutter.objects)
        self.mirrors = tuple(number for number, own in numbered if own.kind == "mirror")
        mirrors = [clutter.objects[number] for number in self.mirrors]
        self._legs = _mirror_legs(mirrors, self._radar)
        self._mirror_m = np.array([np.abs(own.amplitude).max() for own in mirrors])
        # Points are many: only those that something comes near during the capture, and that return
        # most of the power, are kept.
        points = _shared_points(clutter, self.starts)
        count = min(int(body.duration_s / _TRACK_S) + 2, _MOST_INSTANTS)
        last = body.duration_s / self._radar.chirp_interval_s
        poses = [self._posed(int(chirp)) for chirp in np.linspace(0.0, last, count)]
        near = points.some(points.near(self._radar, poses))
        near = near.some(near.shares() < 1 - _LEFT_OUT)
        self._settle(clutter, near, allowed_m2)
        self.point_frequency = sweep_nodes(self._radar, self._points.precision.nodes)
        self._kept: KeyframeCache[int, Shadow] = KeyframeCache(0, _KEPT_KEYFRAMES)

    def at(self, keyframe: int) -> Shadow:
        """Return the shadow at a keyframe, the pose of chirp ``keyframe * step``."""
        return self._kept.get(keyframe, partial(self._find, keyframe))

    def slow_at(self, keyframe: int) -> tuple[Indices, Field]:
        """Return the shadow in weak points at the keyframe ``keyframe * slower``.

        It is as in `Shadow`, the same for all antennas and at all frequencies.
        """
        return self._weak.at(self._posed(max(keyframe * self.slower, 0) * self.step))

    def _find(self, keyframe: int) -> Shadow:
        posed = self._posed(max(keyframe, 0) * self.step)
        return Shadow(*self._points.at(posed), *self._of_mirrors(posed))

    def _posed(self, chirp: int) -> Posed:
        chirps = np.array([chirp])
        radar = self._radar.gapless
        at = chirp_poses(radar, self._body, chirps)
        # The map to the axes where each part is the unit sphere.
        maps = np.swapaxes(at.frames[0], 1, 2) / at.semi_axes[:, :, None]
        corners, closed = [np.empty((0, 3, 3))], [np.empty(0, dtype=bool)]
        # The triangles of objects are posed at the same time.
        for moving, own in self._faces:
            (rotation,), (place,) = moving.pose(radar.centres_of(chirps))
            corners.append(own @ rotation.T + place)
            closed.append(np.full(len(own), moving.shape.closed))
        return Posed(
            at.centres[0],
            np.ascontiguousarray(maps),
            at.semi_axes.max(axis=1),
            np.concatenate(corners),
            np.concatenate(closed),
        )

    def _settle(self, clutter: Clutter, near: SharedPoints, allowed_m2: float) -> None:
        """Choose the precision of the points and the time between keyframes by measured errors.

        Measured are the error of points, and that of cubics between keyframes `TRIED_S` and
        `SLOW_TRIED_S` apart, in the samples of one Tx.
        """
        # Errors are measured for one Tx, which is about a quarter along the array.
        tx = np.array([self._radar.n_tx // 4])
        fields = _fields(clutter, self.starts, near.number, tx)
        # Where an error is allowed, fewer points may be computed with less precision.
        strong, precision, of_points = np.ones(len(near.power), dtype=bool), EXACT, 0.0
        if allowed_m2 > 0:
            strong, precision, of_points = self._enough(near, fields, tx, _OF_POINTS * allowed_m2)
        self._points = PointShadow(self._radar, near.some(strong), precision)
        # How fast the shadow changes is measured with the cheap precision, about some instants of
        # the capture.
        points = PointShadow(self._radar, near.some(strong), FAINT)
        around = np.array([0.0, *(_ENDS * TRIED_S), -_CHANGE_S / 2, _CHANGE_S / 2])
        lost = [
            [self._lost(points, fields[..., strong], own) for own in row]
            for row in self._tests(_TESTS, around)
        ]
        limits_s, allowed = (SHORTEST_S, KEYFRAMES_S), _OF_KEYFRAMES * allowed_m2
        apart_s, of_keyframes = _apart_s(lost, allowed, TRIED_S, limits_s)
        self.step, self.slower = keyframe_step(self._radar, apart_s), 0
        self.error_m2 = of_points + of_keyframes
        if not strong.all():
            self._settle_weak(near.some(~strong), fields[..., ~strong], _OF_SLOW * allowed_m2)

    def _settle_weak(self, weak: SharedPoints, fields: Field, allowed_m2: float) -> None:
        """Choose the keyframes of weak points, from one in `_THIN` of them, whose powers add up."""
        self._weak = PointShadow(self._radar, weak, FAINT)
        some = np.arange(len(weak.power))[::_THIN]
        points = PointShadow(self._radar, weak.some(some), FAINT)
        # Scaled so that the points that are looked at stand for all weak ones, and the sum of
        # powers is the mean power of a sample.
        own = np.sqrt(_THIN / fields[..., 0].size) * fields[..., some]
        lost = [
            [points.samples(own, posed).ravel() for posed in row]
            for row in self._tests(_FEW, np.array([0.0, *(_ENDS * SLOW_TRIED_S)]))
        ]
        fast_s = self.step * self._radar.chirp_interval_s
        apart_s, error_m2 = _apart_s(lost, allowed_m2, SLOW_TRIED_S, (fast_s, SLOW_S))
        self.slower = max(1, round(apart_s / fast_s))
        self.error_m2 += error_m2

    def _tests(self, count: int, around: Array) -> list[list[Posed]]:
        """Poses at times ``around`` some instants of the capture [s]."""
        # Instants spread over the capture, each with the times around it.
        middles = (np.arange(count) + 0.5) * self._body.duration_s / count
        times = np.clip(middles[:, None] + around, 0, self._body.duration_s)
        chirps = times / self._radar.chirp_interval_s
        return [[self._posed(int(chirp)) for chirp in row] for row in chirps]

    def _enough(
        self, near: SharedPoints, fields: Field, tx: Indices, allowed_m2: float
    ) -> tuple[Bools, Precision, float]:
        """Find how few points need more than `FAINT`, and whether they need `USUAL` or `CLOSE`.

        Returned is also the mean power of the error of samples against `FINE` [m^2]. One in `_THIN`
        of the weak points is looked at, whose errors add up as powers do.
        """
        # Points by their strength: group 0 returns most of the power.
        group = np.searchsorted(_STRONG, near.shares(), side="right")
        poses = [own for (own,) in self._tests(_FEW, np.zeros(1))]
        error = np.zeros((3, len(_STRONG) + 1, len(poses), *fields.shape[:-1]), np.complex128)
        # The error of each precision, group by group, against the fine one.
        for number in range(len(_STRONG) + 1):
            thin = 1 if number < 2 else _THIN
            which = np.flatnonzero(group == number)[::thin]
            own = np.sqrt(thin) * fields[..., which]
            fine, *others = (
                np.array([points.samples(own, posed) for posed in poses])
                for points in (
                    PointShadow(self._radar, near.some(which), precision, tx)
                    for precision in (FINE, USUAL, CLOSE, FAINT)
                )
            )
            error[:, number] = np.array(others) - fine
        # The fewest strong groups, and the cheaper precision, that keep the error that is allowed.
        for strong in range(len(_STRONG) + 2):
            weak = error[2, strong:].sum(axis=0)
            for precision, own in zip((USUAL, CLOSE), error[:2], strict=True):
                wrong = weak + own[:strong].sum(axis=0)
                power_m2 = float((np.abs(wrong) ** 2).mean())
                if power_m2 <= allowed_m2:
                    return group < strong, precision, power_m2
        return group >= 0, FINE, 0.0

    def _lost(self, points: PointShadow, fields: Field, posed: Posed) -> Field:
        """What the samples lose of points and, for the array's middle, of mirrors [m].

        The sum of their powers is the mean power of a sample.
        """
        # One channel in the middle of the array stands for all, for the paths over walls.
        middle = self._radar.n_channels // 2
        some = np.flatnonzero(self._legs.channel == middle)
        of_mirrors = 1 - self._mirrors_kept(self._legs.some(some), posed, np.ones(1))[:, middle, 0]
        of_points = points.samples(fields, posed)
        mean = of_points.ravel() / np.sqrt(of_points.size)
        return np.concatenate([mean, of_mirrors * self._mirror_m])

    def _of_mirrors(self, posed: Posed) -> tuple[Indices, Field]:
        """Which mirrors are occluded, and what of each is lost (mirror, tx, rx, node)."""
        radar = self._radar
        kept = self._mirrors_kept(self._legs, posed, self.frequency / radar.centre_frequency_hz)
        hidden = np.flatnonzero((kept != 1).any(axis=(1, 2)))
        shape = len(hidden), radar.n_tx, radar.n_rx, SWEEP_NODES
        return np.array(self.mirrors, dtype=np.int64)[hidden], 1 - kept[hidden].reshape(shape)

    def _mirrors_kept(self, legs: _Legs, posed: Posed, scales: Array) -> Field:
        """What mirrors keep over some legs (mirror, channel, node), at scales of the frequency."""
        geometry = legs[:4]
        lost = lost_on_legs(self._radar, geometry, posed, REACH, MIRROR_LINES, scales)
        some = np.flatnonzero(lost.any(axis=1))
        shape = len(self.mirrors), self._radar.n_channels, len(scales)
        kept = np.ones(shape, dtype=np.complex128)
        # A path keeps the product of what its legs keep.
        np.multiply.at(kept, (legs.mirror[some], legs.channel[some]), 1 - lost[some])
        return kept


def _apart_s(
    lost: list[list[Field]], allowed_m2: float, tried_s: float, limits_s: tuple[float, float]
) -> tuple[float, float]:
    """Time between keyframes at which the error is as large as it may be [s], and that error.

    Each row has what is lost at an instant, at `_ENDS` about it, and at times of a change.
    """
    # The error in the middle between keyframes, and how much the shadow changes in a given time.
    error = change = 0.0
    for now, *rest in lost:
        error += float((np.abs(now - cubic_weights([0.5])[0] @ rest[:4]) ** 2).sum()) / len(lost)
        change += float(np.var([now, *rest[4:]], axis=0).sum()) / len(lost)
    if not error > 0:
        return limits_s[1], 0.0
    # The power of the error grows with a power of the time between keyframes.
    goal = max(change * 10 ** (ERROR_DB / 10), allowed_m2)
    apart_s = tried_s * (goal / error) ** (1 / _ERROR_POWER)
    apart_s = float(min(limits_s[1], max(limits_s[0], apart_s)))
    return apart_s, error * (apart_s / tried_s) ** _ERROR_POWER


def _shared_points(clutter: Clutter, starts: Indices) -> SharedPoints:
    """Points of all echoes whose points all antennas share."""
    found = [(np.empty((0, 3)), np.empty(0, dtype=np.int64), np.empty(0))]
    for own, first in zip(clutter.objects, starts[:-1], strict=True):
        if own.kind != "mirror":
            power = (np.abs(own.amplitude[len(own.frequency) // 2]) ** 2).mean(axis=(0, 1))
            found.append((own.points[0, 0, :, 0], np.arange(own.n_echoes) + first, power))
    return SharedPoints._make(np.concatenate(arrays) for arrays in zip(*found, strict=True))


def _fields(clutter: Clutter, starts: Indices, numbers: Indices, tx: Indices) -> Field:
    """Samples (node, tx, rx, echo) of some echoes, by number, at the nodes of `FINE`."""
    radar, found = clutter.radar, []
    nodes = sweep_nodes(radar, FINE.nodes)
    k = 2 * np.pi / SPEED_OF_LIGHT_MPS * nodes[:, None, None, None]
    # Each number belongs to the last object that begins at or before it.
    own = np.searchsorted(starts, numbers, side="right") - 1
    for number in np.unique(own):
        echoes, which = clutter.objects[number], numbers[own == number] - starts[number]
        weights = interpolation_weights(echoes.frequency, nodes)
        amplitude = np.tensordot(weights, echoes.amplitude[:, tx][..., which], axes=1)
        found.append(amplitude * np.exp(1j * k * echoes.length[tx][..., which]))
    shape = len(nodes), len(tx), radar.n_rx, 0
    return np.concatenate([np.empty(shape), *found], axis=-1)


class _Legs(NamedTuple):
    """Legs of the paths over walls of every channel.

    ``start`` and ``end (leg, 3)``, the path from the Tx to the start and the whole path (leg,) [m];
    ``mirror`` is the number among the mirrors and ``channel (leg,)`` that of the path.
    """

    start: Array
    end: Array
    before: Array
    length: Array
    mirror: Indices
    channel: Indices

    def some(self, which: Indices | Bools) -> _Legs:
        """Return some of them."""
        return _Legs._make(array[which] for array in self)


def _mirror_legs(mirrors: list[RoomEchoes], radar: Radar) -> _Legs:
    places, numbers = np.empty((0, 3)), np.empty(0, dtype=np.int64)
    found = [_Legs(places, places, np.empty(0), np.empty(0), numbers, numbers)]
    rx = radar.rx[radar.rx_of_tx]
    tx = np.broadcast_to(radar.tx[:, None], rx.shape)
    for number, own in enumerate(mirrors):
        # The echoes of one object are delays in the walls, on one path.
        received = (own.amplitude != 0).any(axis=(0, 3))
        stops = [array[received] for array in (tx, *np.moveaxis(own.points[:, :, 0], 2, 0), rx)]
        # Every stretch between two places of a path is a leg, with the path before it.
        size = np.linalg.norm(np.diff(stops, axis=0), axis=2)
        before = np.cumsum(np.concatenate([np.zeros((1, size.shape[1])), size]), axis=0)
        of_path = size.sum(axis=0), number, np.flatnonzero(received)
        each = np.broadcast_arrays(before[:-1], *of_path)
        # In the crease of a corner a path goes from wall to wall at one place.
        legs = _Legs(np.array(stops[:-1]), np.array(stops[1:]), *each)
        found.append(legs.some(size > _SHORTEST_M))
    return _Legs._make(np.concatenate(arrays) for arrays in zip(*found, strict=True))
