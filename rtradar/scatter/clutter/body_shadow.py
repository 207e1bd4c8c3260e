"""The moving shadow in the clutter: which echoes of the room a person's body occludes, and when.

The body is traced at keyframes 20 ms apart, and what changes from one to the next fades smoothly,
as specular points on the body do (`rtradar.scatter.specular_point.visibility`). A specular path
carries a strong echo, which has to fade as the body's edge crosses its first Fresnel zone: for
every Tx and Rx, `SHADOW_RAYS` rays side by side fill that zone where the body is, and the fraction
that meets it is occluded - a half where an edge is in the middle, as in Kirchhoff's theory. Points
on furniture and rough walls, which all antennas share, are many and weak: one ray each is traced
from the ends of each line of Tx and from the middle of each of Rx. Along a line the occluded
fraction changes linearly, and an echo loses the larger fraction of its two legs.
"""

from __future__ import annotations

from functools import lru_cache, partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.kernels.scatter.rooms import Shadow
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.common.interpolation import shadow_nodes
from rtradar.scatter.common.keyframes import KeyframeCache, keyframe_step
from rtradar.scatter.common.poses import chirp_poses
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Bools = NDArray[np.bool_]

_SHORTEST_M = 1e-6
KEYFRAMES_S = 20e-3
"""Keyframe spacing of the body shadow [s]. Interpolating leaves an error of -7 dB of the shadow
(`validation/other_methods/multipath.py`)."""
_KEPT_KEYFRAMES = 8
"""Keyframes in the cache: those on both sides of a chirp, and a few before."""
SHADOW_RAYS = 24
"""Rays over a Fresnel zone: a walking body crosses one in several keyframes."""


class ClutterShadow:
    """Shadow of a moving body in the clutter of a room.

    ``step`` is the number of chirps between keyframes, ``starts (object + 1,)`` the first echo of
    each object in the count through all.
    """

    def __init__(self, clutter: Clutter, body: Body, *, variant: str = "auto") -> None:
        self._radar, self._body = clutter.radar, body
        self._tracer = BodyTracer(use(select(variant)), body.semi_axes)
        self._antennas, self._tx_weights, self._rx_weights = shadow_nodes(clutter.radar)
        self._middle = self._antennas.mean(axis=0)
        self._extent = float(np.linalg.norm(self._antennas - self._middle, axis=1).max())
        self.step = keyframe_step(clutter.radar, KEYFRAMES_S)
        self.starts = np.cumsum([0, *(own.n_echoes for own in clutter.objects)])
        self._points, self._of_point = _shared_points(clutter, self.starts)
        self._ways = self._points - self._middle
        self._squares = np.maximum((self._ways**2).sum(axis=1), 1e-30)
        self._legs = _specular_legs(clutter, self.starts)
        self._kept: KeyframeCache[int, Shadow] = KeyframeCache(0, _KEPT_KEYFRAMES)

    def at(self, keyframe: int) -> Shadow:
        """Return the shadow at a keyframe, the pose of chirp ``keyframe * step``."""
        return self._kept.get(keyframe, partial(self._trace, keyframe))

    def _trace(self, keyframe: int) -> Shadow:
        at = chirp_poses(self._radar, self._body, np.array([keyframe * self.step]))
        centres = at.centres[0]
        self._tracer.pose(centres, at.frames[0])
        middle = (centres.max(axis=0) + centres.min(axis=0)) / 2
        ball = float((np.linalg.norm(centres - middle, axis=1) + at.semi_axes.max(axis=1)).max())
        near = np.flatnonzero(self._passes(middle, ball + self._extent))
        starts, ends, zone = self._zones(middle, ball)
        nodes = len(self._antennas)
        met = self._met(
            np.concatenate([np.repeat(self._antennas, len(near), axis=0), starts.reshape(-1, 3)]),
            np.concatenate([np.tile(self._points[near], (nodes, 1)), ends.reshape(-1, 3)]),
        )
        of_nodes, of_zones = np.split(met, [nodes * len(near)])
        of_zones = of_zones.reshape(-1, SHADOW_RAYS).mean(axis=1)
        return self._together(near, of_nodes.reshape(nodes, -1), zone, of_zones)

    def _passes(self, place: Array, radius: float) -> Bools:
        """Whether legs from the array's middle to the points come nearer to a place than this."""
        away = place - self._middle
        along = self._ways @ away
        part = np.clip(along / self._squares, 0.0, 1.0)
        return np.asarray(away @ away - 2 * part * along + part**2 * self._squares < radius**2)

    def _zones(self, middle: Array, ball: float) -> tuple[Array, Array, Indices]:
        """Rays (leg, ray, 3) over the Fresnel zones of legs near the body, and which these are."""
        legs = self._legs
        ways = legs.ends - legs.starts
        size = np.linalg.norm(ways, axis=1)
        ways = ways / size[:, None]
        along = np.clip(((middle - legs.starts) * ways).sum(axis=1), 0.0, size)
        past = legs.before + along
        left = np.maximum(legs.length - past, 0.0)
        radius = np.sqrt(self._radar.wavelength_m * past * left / legs.length)
        gap = np.linalg.norm(legs.starts + along[:, None] * ways - middle, axis=1)
        near = np.flatnonzero(gap < ball + radius)
        side = np.cross(ways[near], np.eye(3)[np.abs(ways[near]).argmin(axis=1)])
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        axes = np.stack([side, np.cross(ways[near], side)], axis=1) * radius[near, None, None]
        shifts = np.einsum("rk,lki->lri", _disc(SHADOW_RAYS), axes)
        return legs.starts[near, None] + shifts, legs.ends[near, None] + shifts, near

    def _together(self, near: Indices, of_nodes: Bools, zone: Indices, of_zone: Array) -> Shadow:
        """Combine both kinds of echoes: those of shared points, and specular ones."""
        radar = self._radar
        met = of_nodes.any(axis=0)
        near, of_nodes = near[met], of_nodes[:, met]
        of_tx, of_rx = self._tx_weights @ of_nodes, self._rx_weights @ of_nodes
        of_points = np.maximum(of_tx[:, None], of_rx[radar.rx_of_tx])
        zone, of_zone = zone[of_zone > 0], of_zone[of_zone > 0]
        specular, own = np.unique(self._legs.echo[zone], return_inverse=True)
        fraction = np.zeros((radar.n_channels, len(specular)))
        np.maximum.at(fraction, (self._legs.channel[zone], own), of_zone)
        of_legs = fraction.reshape(radar.n_tx, radar.n_rx, -1)
        echoes = np.concatenate([self._of_point[near], specular])
        order = np.argsort(echoes)
        fractions = np.concatenate([of_points, of_legs], axis=-1)
        return Shadow(echoes[order], fractions[..., order])

    def _met(self, origins: Array, targets: Array) -> Bools:
        """Whether the posed body occludes the legs, (leg,)."""
        return ~self._tracer.sees(origins, targets, np.full(len(origins), -1))


def _shared_points(clutter: Clutter, starts: Indices) -> tuple[Array, Indices]:
    """Points (point, 3) of echoes whose points all antennas share, and each one's echo."""
    points, numbers = [np.empty((0, 3))], [np.empty(0, dtype=np.int64)]
    for own, first in zip(clutter.objects, starts[:-1], strict=True):
        if own.points.shape[0] == 1:
            points.append(own.points[0, 0, :, 0])
            numbers.append(np.arange(own.n_echoes) + first)
    return np.concatenate(points), np.concatenate(numbers)


class _Legs(NamedTuple):
    """Legs of the specular paths of every channel.

    ``starts, ends (leg, 3)`` [m]; ``before (leg,)`` is the path from the Tx to the start and
    ``length (leg,)`` all of it [m]; ``echo`` and ``channel (leg,)`` are those of the path.
    """

    starts: Array
    ends: Array
    before: Array
    length: Array
    echo: Indices
    channel: Indices


def _specular_legs(clutter: Clutter, starts: Indices) -> _Legs:
    radar = clutter.radar
    places, numbers = np.empty((0, 3)), np.empty(0, dtype=np.int64)
    found = [(places, places, np.empty(0), np.empty(0), numbers, numbers)]
    for own, first in zip(clutter.objects, starts[:-1], strict=True):
        if own.points.shape[0] == 1:
            continue
        shape = own.length.shape
        tx = np.broadcast_to(radar.tx[:, None, None], (*shape, 3))
        rx = np.broadcast_to(radar.rx[radar.rx_of_tx][:, :, None], (*shape, 3))
        received = (own.amplitude != 0).any(axis=0)
        channel, echo = np.nonzero(received.reshape(-1, shape[2]))
        length, before = own.length[received], np.zeros(len(echo))
        for start, end in pairwise([tx, *np.moveaxis(own.points, -2, 0), rx]):
            size = np.linalg.norm(end[received] - start[received], axis=1)
            # In the crease of a corner a path goes from wall to wall at one place.
            long = size > _SHORTEST_M
            arrays = (start[received], end[received], before, length, echo + first, channel)
            found.append(tuple(array[long] for array in arrays))
            before = before + size
    return _Legs(*(np.concatenate(arrays) for arrays in zip(*found, strict=True)))


@lru_cache
def _disc(count: int) -> Array:
    """Points (point, 2) spread evenly over the unit disc, as the seeds of a sunflower."""
    index = np.arange(count)
    angle = np.pi * (3 - np.sqrt(5)) * index
    radius = np.sqrt((index + 0.5) / count)
    return radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
