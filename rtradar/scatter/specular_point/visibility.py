"""Which specular points are seen: traced at anchors 10 ms apart, ramped smoothly where two neighbours differ.

A part that goes behind another fades as the edge crosses the Fresnel zone round its specular point, which takes longer
than 10 ms for a limb at 1 m/s. A jump would smear a line over all velocities that physical optics does not have:
``validation/other_methods/occlusion.py`` measures -35 dB beside the Doppler line for a ramp of 1.25 ms, -59 dB for this one and
-60 dB for physical optics (12 GHz, 1.5 m/s). The instant is known to 5 ms; at 4 m/s the true fade is the faster one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.kernels.blends import smoothstep
from rtradar.radar import Radar
from rtradar.scatter.common.poses import ChirpPoses, anchor_step, chirp_poses
from rtradar.scatter.specular_point.solver import mirror
from rtradar.trace.body_tracer import BodyTracer

_KEPT_ANCHORS = 2048
"""Anchors remembered, so that the pass that measures power and the pass that makes the signal trace once: 20 s, 1.5 MB."""


class Anchor(NamedTuple):
    """One pose: ``visible (tx, rx, part)`` bool, ``start (part, 3)`` the specular point of one pair in the part's axes [m]."""

    visible: NDArray[np.bool_]
    start: NDArray[np.float64]


def trace_anchor(tracer: BodyTracer, at: ChirpPoses) -> Anchor:
    """Trace one pose, given with one chirp for each Tx.

    Whether another part stands in the way of either leg is asked from Tx and Rx to the specular point of each pair. One of
    these points is where the search for those of the chirps after it begins.
    """
    tracer.pose(at.centres[0], at.frames[0])
    _, _, points = mirror(at.tx, at.rx, at.centres, at.frames, at.semi_axes, points=True)
    start = np.einsum("pji,pj->pi", at.frames[0], points[0, 0] - at.centres[0])
    return Anchor(unobstructed(tracer, at.tx, at.rx, points), start)


def unobstructed(
    tracer: BodyTracer,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    points: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Whether no other part of the posed body is nearer, on both legs, than the point of each part.

    Parameters
    ----------
    tracer : BodyTracer
        Posed.
    tx, rx : (chirp, 3), (chirp, rx, 3) float64
        [m].
    points : (chirp, rx, part, 3) float64
        One point on each part [m].

    Returns
    -------
    (chirp, rx, part) bool
    """
    own = np.broadcast_to(np.arange(points.shape[2]), points.shape[:3]).ravel()
    targets = points.reshape(-1, 3)
    legs = (
        np.broadcast_to(tx[:, None, None], points.shape),
        np.broadcast_to(rx[:, :, None], points.shape),
    )
    from_tx, from_rx = (tracer.sees(antennas.reshape(-1, 3), targets, own) for antennas in legs)
    return (from_tx & from_rx).reshape(points.shape[:3])


class _KeptAnchors:
    """Anchors by their chirp, visibility a bit each, in memory that is all taken at once.

    A recording is gone through twice, from its start. So the first that come stay; later ones pass through the last two places,
    for an instant needs the anchors on both sides of it.
    """

    def __init__(self, shape: tuple[int, int, int]) -> None:
        self._shape = shape
        self._visible = np.full((_KEPT_ANCHORS, -(-math.prod(shape) // 8)), 0, dtype=np.uint8)
        self._start = np.full((_KEPT_ANCHORS, shape[2], 3), np.nan)
        self._places: dict[int, int] = {}  # in the order of coming

    def get(self, chirp: int) -> Anchor | None:
        place = self._places.get(chirp)
        if place is None:
            return None
        bits = np.unpackbits(self._visible[place], count=math.prod(self._shape))
        return Anchor(bits.view(np.bool_).reshape(self._shape), self._start[place].copy())

    def put(self, chirp: int, anchor: Anchor) -> None:
        place = len(self._places)
        if place == _KEPT_ANCHORS:
            place = self._places.pop(list(self._places)[-2])
        self._visible[place], self._start[place] = np.packbits(anchor.visible), anchor.start
        self._places[chirp] = place


class MirrorVisibility:
    """Visibility of the specular points of a moving body over a capture.

    Parameters
    ----------
    radar : Radar
    body : Body
    tracer : BodyTracer
        Tracer of the same body.
    """

    def __init__(self, radar: Radar, body: Body, tracer: BodyTracer) -> None:
        self._radar, self._body, self._tracer = radar, body, tracer
        self._step = anchor_step(radar)
        self._kept = _KeptAnchors((radar.n_tx, radar.n_rx, len(body.part_names)))

    def _anchor(self, chirp: int) -> Anchor:
        kept = self._kept.get(chirp)
        if kept is not None:
            return kept
        every_tx = chirp_poses(self._radar, self._body, np.array([chirp]))
        n_tx = self._radar.n_tx
        at = ChirpPoses(
            np.arange(n_tx),
            self._radar.tx,
            self._radar.rx[self._radar.rx_of_tx],
            np.repeat(every_tx.centres, n_tx, axis=0),
            np.repeat(every_tx.frames, n_tx, axis=0),
            every_tx.semi_axes,
        )
        anchor = trace_anchor(self._tracer, at)
        self._kept.put(chirp, anchor)
        return anchor

    def at(
        self, chirps: NDArray[np.int64], parts: NDArray[np.int64] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Visibility and starting points at these chirps.

        Parameters
        ----------
        chirps : (chirp,) int64
            Numbered from the start of the capture.
        parts : (part,) int64, optional
            Which are wanted; all if left out.

        Returns
        -------
        weight : (chirp, rx, part) float64
            1 seen, 0 hidden, in between on the ramp between two anchors that differ.
        start : (chirp, part, 3) float64
            Specular point of one pair at the anchor before, in the part's axes [m].
        """
        chirps = np.asarray(chirps, dtype=np.int64)
        if parts is None:
            parts = np.arange(len(self._body.part_names))
        weight = np.empty((len(chirps), self._radar.n_rx, len(parts)))
        start = np.empty((len(chirps), len(parts), 3))
        tx = self._radar.tx_of_chirp(chirps)
        intervals = chirps // self._step
        for interval in np.unique(intervals):
            first, last = int(interval) * self._step, int(interval + 1) * self._step
            inside = np.flatnonzero(intervals == interval)
            if (chirps[inside] == first).all():
                here = self._anchor(first)
                weight[inside], start[inside] = (
                    here.visible[..., parts][tx[inside]],
                    here.start[parts],
                )
                continue
            ramp = smoothstep((chirps[inside] - first) / self._step)[:, None, None]
            before, after = self._anchor(first), self._anchor(last)
            seen, seen_next = (anchor.visible[..., parts][tx[inside]] for anchor in (before, after))
            weight[inside] = (1 - ramp) * seen + ramp * seen_next
            start[inside] = before.start[parts]
        return weight, start
