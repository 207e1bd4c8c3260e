"""The moving shadow in the clutter: what people and objects that move take from a room's echoes.

Each leg of an echo, from an antenna to a point, from wall to wall or back, is a spherical wave that
passes them. What is lost of its field is Kirchhoff's integral over the silhouette of all parts and
triangles together, across the leg, in units of the Fresnel zone there
(`rtradar.kernels.scatter.silhouettes`): a complex number that begins before the edge arrives and is
a half where it is in the middle. An echo keeps the product of what its legs keep. Of what walls
reflect every leg of every Tx and Rx is computed, at `SWEEP_NODES` frequencies, for zones narrow
over the sweep.

Points on furniture and on rough walls, which all antennas share, are many, and the shadow in them
is weak: of a person who walks through a furnished room some 40 dB below their own echoes. They are
computed as `FINE` says, from every Tx and at three frequencies, where the error of `COARSE`,
measured beforehand, is more than may be: that is at the sweep's centre, from the ends of each line
of Tx and the middle of each of Rx, the weakest points from the array's middle. The time between
keyframes, too, follows from the error of cubics between them.

Mitsuba is not asked. A ray is free or not, and what is wanted is the wave near an edge, whose field
is between both over a Fresnel zone. Clutter that furniture hides is not in the room's echoes
already; what hides is a product of the free wave and the moving screen, as if the edge of
furniture, which is fixed, were far from that of the body in Fresnel zones.

How far from its edge a screen's fringes are those of a body says the series of a conducting
cylinder between two line sources (`validation/other_methods/shadow.py`). Up to two Fresnel radii
from the edge Kirchhoff's integral is off by -12 to -15 dB of the shadow's change, with its sign
by polarisation. Beyond, where a wave turns by more than (2/ka)^(1/3), it is the ray reflected at
grazing incidence, a ghost of the person that has its own echo, and not the edge's fringe. With
the damping ``eps`` = 0.1 both together are as near as any damping comes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.scatter.silhouettes import Posed, Shadow
from rtradar.kernels.still_room import cubic_weights
from rtradar.radar import Radar
from rtradar.scatter.clutter.furniture import small_facets
from rtradar.scatter.clutter.point_shadow import (
    COARSE,
    FADE,
    FINE,
    MEDIUM,
    REACH,
    PointShadow,
    Precision,
    SharedPoints,
    lost_on_legs,
)
from rtradar.scatter.clutter.returns import RoomEchoes
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.common.interpolation import interpolation_weights, sweep_nodes
from rtradar.scatter.common.keyframes import KeyframeCache, keyframe_step
from rtradar.scatter.common.poses import chirp_poses
from rtradar.scene import Object

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Indices = NDArray[np.int64]

_SHORTEST_M = 1e-6
KEYFRAMES_S, SHORTEST_S, TRIED_S = 50e-3, 4e-3, 10e-3
"""Longest and shortest time between keyframes of the shadow, and that for which the error of the
cubics in between is measured [s]. `validation/other_methods/shadow.py` judges the one chosen."""
ERROR_DB, _ERROR_POWER = -32.0, 3.0
"""Error that is aimed at, over what changes of the shadow in `_CHANGE_S` [dB], and the power of the
time between keyframes with which its power grows, as `validation/other_methods/shadow.py` has
it."""
_OF_KEYFRAMES, _OF_POINTS = 0.25, 0.75
"""Parts of the power that may be in error which keyframes and coarse points may take."""
_CHANGE_S, _TESTS = 0.1, 12
"""Time of a change [s], and the instants of the capture at which errors are measured."""
_FEW = 4
"""One of how many tests is made for the error of points."""
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

    What is approximated may be in error by ``allowed_m2``, a mean power of IF samples [m^2], and by
    `ERROR_DB` of what changes if that is more; ``error_m2`` is what it is expected to be.

    ``step`` is the number of chirps between keyframes, ``starts (object + 1,)`` the first echo of
    each object of the clutter in the count through all, ``mirrors`` the numbers of those that walls
    reflect; ``frequency (node,)`` are the frequencies of their shadow, ``point_frequency (node,)``
    those of the others' [Hz].
    """

    def __init__(
        self,
        clutter: Clutter,
        body: Body,
        objects: Sequence[Object] = (),
        allowed_m2: float = 0.0,
    ) -> None:
        self._radar, self._body = clutter.radar, body
        self._faces = [_Faces.of(moving) for moving in objects]
        self.starts = np.cumsum([0, *(own.n_echoes for own in clutter.objects)])
        self.frequency = sweep_nodes(self._radar, SWEEP_NODES)
        numbered = enumerate(clutter.objects)
        self.mirrors = tuple(number for number, own in numbered if own.kind == "mirror")
        mirrors = [clutter.objects[number] for number in self.mirrors]
        self._legs = _mirror_legs(mirrors, self._radar)
        self._mirror_m = np.array([np.abs(own.amplitude).max() for own in mirrors])
        points = _shared_points(clutter, self.starts)
        count = min(int(body.duration_s / _TRACK_S) + 2, _MOST_INSTANTS)
        last = body.duration_s / self._radar.chirp_interval_s
        poses = [self._posed(int(chirp)) for chirp in np.linspace(0.0, last, count)]
        near = points.some(points.near(self._radar, poses))
        self._settle(clutter, near, allowed_m2)
        self.point_frequency = sweep_nodes(self._radar, self._points.precision.nodes)
        self._kept: KeyframeCache[int, Shadow] = KeyframeCache(0, _KEPT_KEYFRAMES)

    def at(self, keyframe: int) -> Shadow:
        """Return the shadow at a keyframe, the pose of chirp ``keyframe * step``."""
        return self._kept.get(keyframe, partial(self._find, keyframe))

    def _find(self, keyframe: int) -> Shadow:
        posed = self._posed(max(keyframe, 0) * self.step)
        return Shadow(*self._points.at(posed), *self._of_mirrors(posed))

    def _posed(self, chirp: int) -> Posed:
        chirps = np.array([chirp])
        radar = self._radar.gapless
        at = chirp_poses(radar, self._body, chirps)
        maps = np.swapaxes(at.frames[0], 1, 2) / at.semi_axes[:, :, None]
        corners, closed = [np.empty((0, 3, 3))], [np.empty(0, dtype=bool)]
        for own in self._faces:
            (rotation,), (place,) = own.moving.pose(radar.centres_of(chirps))
            corners.append(own.corners @ rotation.T + place)
            closed.append(np.full(len(own.corners), own.moving.shape.closed))
        return Posed(
            at.centres[0],
            np.ascontiguousarray(maps),
            at.semi_axes.max(axis=1),
            np.concatenate(corners),
            np.concatenate(closed),
        )

    def _settle(self, clutter: Clutter, near: SharedPoints, allowed_m2: float) -> None:
        """Choose the precision of the points and the time between keyframes by measured errors.

        Measured are what changes of the error of points, in the samples of two Tx, and the error of
        cubics between keyframes `TRIED_S` apart.
        """
        ends = np.array([-1.5, -0.5, 0.5, 1.5]) * TRIED_S
        around = np.array([0.0, *ends, -_CHANGE_S / 2, _CHANGE_S / 2])
        middles = np.linspace(0.0, self._body.duration_s, _TESTS + 2)[1:-1, None]
        chirps = np.clip(middles + around, 0, self._body.duration_s) / self._radar.chirp_interval_s
        poses = [[self._posed(int(chirp)) for chirp in row] for row in chirps]
        # Not at the ends of a line, where coarse points are exact.
        tx = np.unique([self._radar.n_tx // 4, self._radar.n_tx * 3 // 4])
        fields = _fields(clutter, self.starts, near.number, tx)
        precision, of_points = FINE, 0.0
        if allowed_m2 > 0:
            some = [[row[i] for i in (0, 5, 6)] for row in poses[_FEW // 2 :: _FEW]]
            precision, of_points = self._enough(near, fields, tx, some, _OF_POINTS * allowed_m2)
        self._points = PointShadow(self._radar, near, precision)
        middle = precision._replace(nodes=1, weak=2.0)
        points = PointShadow(self._radar, near, middle, tx[:1])
        lost = [[self._lost(points, fields, own) for own in row] for row in poses]
        apart_s, of_keyframes = _apart_s(lost, _OF_KEYFRAMES * allowed_m2)
        self.step, self.error_m2 = keyframe_step(self._radar, apart_s), of_points + of_keyframes

    def _enough(
        self,
        near: SharedPoints,
        fields: Field,
        tx: Indices,
        poses: list[list[Posed]],
        allowed_m2: float,
    ) -> tuple[Precision, float]:
        """Find the least precision whose error changes little enough in the samples.

        What changes of the error beside `FINE` follows, a mean power of samples [m^2].
        """

        def samples(precision: Precision) -> Field:
            points = PointShadow(self._radar, near, precision, tx)
            return np.array([[points.samples(fields, own) for own in row] for row in poses])

        fine = samples(FINE)
        for precision in (COARSE, MEDIUM):
            error = float(np.var(samples(precision) - fine, axis=1).mean())
            if error <= allowed_m2:
                return precision, error
        return FINE, 0.0

    def _lost(self, points: PointShadow, fields: Field, posed: Posed) -> Field:
        """Samples of what is lost of points, for the array's middle, and of mirrors [m].

        The sum of their powers is that of the mean sample.
        """
        legs = self._legs
        some = np.flatnonzero(legs.channel == self._radar.n_channels // 2)
        lost = self._on_legs(tuple(array[some] for array in legs.geometry), posed, np.ones(1))
        kept = np.ones(len(self.mirrors), dtype=np.complex128)
        np.multiply.at(kept, legs.mirror[some], 1 - lost[:, 0])
        of_points = points.samples(fields, posed)
        mean = of_points.ravel() / np.sqrt(of_points.size)
        return np.concatenate([mean, (1 - kept) * self._mirror_m])

    def _of_mirrors(self, posed: Posed) -> tuple[Indices, Field]:
        """Which mirrors are occluded, and what of each is lost (mirror, tx, rx, node)."""
        legs, radar = self._legs, self._radar
        scales = self.frequency / radar.centre_frequency_hz
        lost = self._on_legs(legs.geometry, posed, scales)
        kept = np.ones((len(self.mirrors), radar.n_channels, SWEEP_NODES), dtype=np.complex128)
        some = np.flatnonzero(lost.any(axis=1))
        np.multiply.at(kept, (legs.mirror[some], legs.channel[some]), 1 - lost[some])
        hidden = np.flatnonzero((kept != 1).any(axis=(1, 2)))
        shape = len(hidden), radar.n_tx, radar.n_rx, SWEEP_NODES
        return np.array(self.mirrors, dtype=np.int64)[hidden], 1 - kept[hidden].reshape(shape)

    def _on_legs(self, geometry: tuple[Array, ...], posed: Posed, scales: Array) -> Field:
        return lost_on_legs(self._radar, geometry, posed, REACH, MIRROR_LINES, scales, FADE)


def _apart_s(lost: list[list[Field]], allowed_m2: float) -> tuple[float, float]:
    """Time between keyframes at which the error is as large as it may be [s], and that error."""
    error = change = 0.0
    for now, *rest in lost:
        error += float((np.abs(now - cubic_weights([0.5])[0] @ rest[:4]) ** 2).sum()) / len(lost)
        change += float(np.var([now, *rest[4:]], axis=0).sum()) / len(lost)
    if not error > 0:
        return KEYFRAMES_S, 0.0
    goal = max(change * 10 ** (ERROR_DB / 10), allowed_m2)
    apart_s = TRIED_S * (goal / error) ** (1 / _ERROR_POWER)
    apart_s = float(min(KEYFRAMES_S, max(SHORTEST_S, apart_s)))
    return apart_s, error * (apart_s / TRIED_S) ** _ERROR_POWER


class _Faces(NamedTuple):
    """An object that moves, and its triangles (face, 3, 3) about its pivot, in its own axes [m]."""

    moving: Object
    corners: Array

    @classmethod
    def of(cls, moving: Object) -> _Faces:
        return cls(moving, small_facets(moving.shape.corners, 0, _EDGE_M).corners)


def _shared_points(clutter: Clutter, starts: Indices) -> SharedPoints:
    """Points of all echoes whose points all antennas share."""
    points, numbers, powers = [np.empty((0, 3))], [np.empty(0, dtype=np.int64)], [np.empty(0)]
    for own, first in zip(clutter.objects, starts[:-1], strict=True):
        if own.kind != "mirror":
            points.append(own.points[0, 0, :, 0])
            numbers.append(np.arange(own.n_echoes) + first)
            middle = own.amplitude[len(own.frequency) // 2]
            powers.append((np.abs(middle) ** 2).mean(axis=(0, 1)))
    return SharedPoints(np.concatenate(points), np.concatenate(numbers), np.concatenate(powers))


def _fields(clutter: Clutter, starts: Indices, numbers: Indices, tx: Indices) -> Field:
    """Samples (node, tx, rx, echo) of some echoes, by number, at the nodes of `FINE`."""
    radar, found = clutter.radar, []
    nodes = sweep_nodes(radar, FINE.nodes)
    k = 2 * np.pi / SPEED_OF_LIGHT_MPS * nodes[:, None, None, None]
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
