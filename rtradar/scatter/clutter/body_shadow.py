"""The moving shadow in the clutter: which echoes of the room a person's body cuts off, and when.

The body is traced at anchors 20 ms apart, and what changes from one to the next fades smoothly, as specular points on the body
do (`rtradar.scatter.specular_point.visibility`). A mirror path carries a strong echo, which has to fade as the body's edge
crosses its first Fresnel zone: for every Tx and Rx, `SHADOW_RAYS` rays side by side fill that zone where the body is, and their
share that is met is hidden - a half where an edge stands in the middle, as in Kirchhoff's theory. Points on furniture and rough
walls, which all antennas share, are many and weak: they are asked about by one ray each from the ends of each line of Tx and
from the middle of each of Rx. Along a line the share that is hidden runs straight between its ends, and an echo keeps the
smaller share of its two legs.
"""

from __future__ import annotations

from functools import lru_cache, partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.kernels.blends import smoothstep
from rtradar.radar import Radar
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.common.keyframe_cache import FirstCome
from rtradar.scatter.common.poses import anchor_step, chirp_poses
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer

Array = NDArray[np.float64]
_SHORTEST_M = 1e-6
ANCHORS_S = 20e-3
"""Between instants at which the body is looked at; what changes of the shadow is then known to -7 dB (`multipath.py`)."""

_KEPT_ANCHORS = 8
"""Remembered: those on both sides of a chirp, and a few before."""
SHADOW_RAYS = 24
"""Side by side over a Fresnel zone: a body that walks passes one of them in several anchors."""


class Hidden(NamedTuple):
    """What a body hides at one instant.

    ``echo (n,)`` counts through the objects of the clutter, one after the other, ascending; ``share (tx, rx, n)``.
    """

    echo: NDArray[np.int64]
    share: Array


class ClutterShadow:
    """What a moving body hides of the clutter of a room.

    Parameters
    ----------
    clutter : Clutter
    body : Body
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend.

    Attributes
    ----------
    step : int
        Chirps from one anchor to the next.
    starts : (object + 1,) int64
        Where the echoes of each object begin in the count through all.
    """

    def __init__(self, clutter: Clutter, body: Body, *, variant: str = "auto") -> None:
        self._radar, self._body = clutter.radar, body
        self._tracer = BodyTracer(use(select(variant)), body.semi_axes)
        self._antennas, self._tx_weights, self._rx_weights = _nodes(clutter.radar)
        self._middle = self._antennas.mean(axis=0)
        self._reach = float(np.linalg.norm(self._antennas - self._middle, axis=1).max())
        self.step = anchor_step(clutter.radar, ANCHORS_S)
        self.starts = np.cumsum([0, *(own.n_echoes for own in clutter.objects)])
        self._points, self._of_point = _shared_points(clutter, self.starts)
        self._ways = self._points - self._middle
        self._squares = np.maximum((self._ways**2).sum(axis=1), 1e-30)
        self._legs = _Legs.of(clutter, self.starts)
        self._kept: FirstCome[int, Hidden] = FirstCome(0, _KEPT_ANCHORS)

    def hidden(self, anchor: int) -> Hidden:
        """What the body hides at an anchor, the pose of chirp ``anchor * step``."""
        return self._kept.get(anchor, partial(self._trace, anchor))

    def _trace(self, anchor: int) -> Hidden:
        at = chirp_poses(self._radar, self._body, np.array([anchor * self.step]))
        centres = at.centres[0]
        self._tracer.pose(centres, at.frames[0])
        middle = (centres.max(axis=0) + centres.min(axis=0)) / 2
        ball = float((np.linalg.norm(centres - middle, axis=1) + at.semi_axes.max(axis=1)).max())
        near = np.flatnonzero(self._passes(middle, ball + self._reach))
        starts, ends, zone = self._zones(middle, ball)
        nodes = len(self._antennas)
        met = self._met(
            np.concatenate([np.repeat(self._antennas, len(near), axis=0), starts.reshape(-1, 3)]),
            np.concatenate([np.tile(self._points[near], (nodes, 1)), ends.reshape(-1, 3)]),
        )
        of_nodes, of_zones = (
            met[: nodes * len(near)].reshape(nodes, -1),
            met[nodes * len(near) :].reshape(-1, SHADOW_RAYS),
        )
        return self._together(near, of_nodes, zone, of_zones.mean(axis=1))

    def weights(self, chirps: NDArray[np.int64]) -> Array:
        """What is left of each echo at these chirps, numbered from the start of the capture: (chirp, rx, echo) of all objects."""
        chirps = np.asarray(chirps, dtype=np.int64)
        anchors, tx = chirps // self.step, self._radar.tx_of_chirp(chirps)
        share = smoothstep((chirps - anchors * self.step) / self.step)
        out = np.ones((len(chirps), self._radar.n_rx, int(self.starts[-1])))
        for index, (anchor, line, after) in enumerate(
            zip(anchors.tolist(), tx.tolist(), share.tolist(), strict=True)
        ):
            for place, weight in ((anchor, 1 - after), (anchor + 1, after)):
                if weight > 0:
                    lost = self.hidden(place)
                    out[index][:, lost.echo] -= weight * lost.share[line]
        return out

    def _passes(self, place: Array, radius: float) -> NDArray[np.bool_]:
        """Whether legs from the middle of the array to the points (point,) come nearer to a place than this."""
        away = place - self._middle
        along = self._ways @ away
        share = np.clip(along / self._squares, 0.0, 1.0)
        return np.asarray(away @ away - 2 * share * along + share**2 * self._squares < radius**2)

    def _zones(self, middle: Array, ball: float) -> tuple[Array, Array, NDArray[np.int64]]:
        """Ends (leg, ray, 3) of rays over the first Fresnel zones of mirror paths near the body, and which legs these are."""
        legs = self._legs
        ways = legs.ends - legs.starts
        size = np.linalg.norm(ways, axis=1)
        ways = ways / size[:, None]
        along = np.clip(((middle - legs.starts) * ways).sum(axis=1), 0.0, size)
        past = legs.before + along
        radius = np.sqrt(
            self._radar.wavelength_m * past * np.maximum(legs.length - past, 0.0) / legs.length
        )
        gap = np.linalg.norm(legs.starts + along[:, None] * ways - middle, axis=1)
        near = np.flatnonzero(gap < ball + radius)
        side = np.cross(ways[near], np.eye(3)[np.abs(ways[near]).argmin(axis=1)])
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        axes = np.stack([side, np.cross(ways[near], side)], axis=1) * radius[near, None, None]
        shifts = np.einsum("rk,lki->lri", _disc(SHADOW_RAYS), axes)
        return legs.starts[near, None] + shifts, legs.ends[near, None] + shifts, near

    def _together(
        self,
        near: NDArray[np.int64],
        of_nodes: NDArray[np.bool_],
        zone: NDArray[np.int64],
        of_zone: Array,
    ) -> Hidden:
        radar = self._radar
        near, of_nodes = near[of_nodes.any(axis=0)], of_nodes[:, of_nodes.any(axis=0)]
        of_tx, of_rx = self._tx_weights @ of_nodes, self._rx_weights @ of_nodes
        zone, of_zone = zone[of_zone > 0], of_zone[of_zone > 0]
        mirrored, own = np.unique(self._legs.echo[zone], return_inverse=True)
        share = np.zeros((radar.n_channels, len(mirrored)))
        np.maximum.at(share, (self._legs.channel[zone], own), of_zone)
        shares = (
            np.maximum(of_tx[:, None], of_rx[radar.rx_of_tx]),
            share.reshape(radar.n_tx, radar.n_rx, -1),
        )
        echoes = np.concatenate([self._of_point[near], mirrored])
        order = np.argsort(echoes)
        return Hidden(echoes[order], np.concatenate(shares, axis=-1)[..., order])

    def _met(self, origins: Array, targets: Array) -> NDArray[np.bool_]:
        """Whether the posed body stands between, (leg,)."""
        return ~self._tracer.sees(origins, targets, np.full(len(origins), -1))


def _shared_points(clutter: Clutter, starts: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Points (point, 3) of echoes whose points all antennas share, and the number of each echo."""
    shared = [
        (own, first)
        for own, first in zip(clutter.objects, starts[:-1], strict=True)
        if own.points.shape[0] == 1
    ]
    points = [np.empty((0, 3)), *(own.points[0, 0, :, 0] for own, _ in shared)]
    numbers = [
        np.empty(0, dtype=np.int64),
        *(np.arange(own.n_echoes) + first for own, first in shared),
    ]
    return np.concatenate(points), np.concatenate(numbers)


class _Legs(NamedTuple):
    """Legs of the mirror paths of every channel.

    ``starts, ends (leg, 3)`` [m]; ``before (leg,)`` the path from the Tx to the start, ``length (leg,)`` all of it [m]; ``echo``
    and ``channel (leg,)`` whose they are.
    """

    starts: Array
    ends: Array
    before: Array
    length: Array
    echo: NDArray[np.int64]
    channel: NDArray[np.int64]

    @classmethod
    def of(cls, clutter: Clutter, starts: NDArray[np.int64]) -> _Legs:
        radar = clutter.radar
        found = [
            cls(
                np.empty((0, 3)),
                np.empty((0, 3)),
                *(np.empty(0),) * 2,
                *(np.empty(0, dtype=np.int64),) * 2,
            )
        ]
        for own, first in zip(clutter.objects, starts[:-1], strict=True):
            if own.points.shape[0] == 1:
                continue
            shape = own.length.shape
            tx = np.broadcast_to(radar.tx[:, None, None], (*shape, 3))
            rx = np.broadcast_to(radar.rx[radar.rx_of_tx][:, :, None], (*shape, 3))
            heard = (own.amplitude != 0).any(axis=0)
            channel, echo = np.nonzero(heard.reshape(-1, shape[2]))
            length, before = own.length[heard], np.zeros(len(echo))
            for start, end in pairwise([tx, *np.moveaxis(own.points, -2, 0), rx]):
                size = np.linalg.norm(end[heard] - start[heard], axis=1)
                # In the crease of a corner a path goes from wall to wall at one place.
                long = size > _SHORTEST_M
                arrays = (start[heard], end[heard], before, length, echo + first, channel)
                found.append(cls(*(array[long] for array in arrays)))
                before = before + size
        return cls(*(np.concatenate(arrays) for arrays in zip(*found, strict=True)))


@lru_cache
def _disc(count: int) -> Array:
    """Points (point, 2) spread evenly over the unit disc, as the seeds of a sunflower."""
    index = np.arange(count)
    angle = np.pi * (3 - np.sqrt(5)) * index
    return np.sqrt((index + 0.5) / count)[:, None] * np.stack(
        [np.cos(angle), np.sin(angle)], axis=-1
    )


def _nodes(radar: Radar) -> tuple[Array, Array, Array]:
    """Places (node, 3), and weights (tx, node) and (rx, node) of what was found there for each antenna."""
    places: list[Array] = []
    weights = []
    for antennas, along_y, ends in ((radar.tx, radar.tx_y, 2), (radar.rx, radar.rx_y, 1)):
        weight = np.zeros((len(antennas), 8))
        for line in (np.arange(along_y), np.arange(along_y, len(antennas))):
            if len(line) == 0:
                continue
            first = len(places)
            if ends == 1 or len(line) == 1:
                places.append(antennas[line].mean(axis=0))
                weight[line, first] = 1
            else:
                places += [antennas[line[0]], antennas[line[-1]]]
                share = np.linspace(0, 1, len(line))
                weight[line, first], weight[line, first + 1] = 1 - share, share
        weights.append(weight)
    return np.stack(places), weights[0][:, : len(places)], weights[1][:, : len(places)]
