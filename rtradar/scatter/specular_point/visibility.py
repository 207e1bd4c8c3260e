"""Which specular points are visible: traced at keyframes 10 ms apart, ramped between them.

A part that goes behind another fades as the edge crosses the Fresnel zone round its specular point,
which takes longer than 10 ms for a limb at 1 m/s. A jump would smear a line over all velocities
that physical optics does not have: ``validation/other_methods/occlusion.py`` measures -35 dB beside
the Doppler line for a ramp of 1.25 ms, -59 dB for this one and -60 dB for physical optics (12 GHz,
1.5 m/s). The instant is known to 5 ms; at 4 m/s the true fade is faster than the ramp.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.kernels.elementary import smoothstep
from rtradar.radar import Radar
from rtradar.scatter.common.keyframes import KeyframeCache, keyframe_before, keyframe_step
from rtradar.scatter.common.poses import ChirpPoses, keyframe_time
from rtradar.scatter.specular_point.solver import local_points
from rtradar.trace.body_tracer import BodyTracer

_KEPT_KEYFRAMES = 2048
"""Keyframes kept, 20 s: the passes that measure power and make the signal trace once."""

_PASSING = 2
"""Keyframes among these that give way to later ones: a chirp needs those on both sides of it."""


class Keyframe(NamedTuple):
    """One pose: ``visible (tx, rx, part)``, ``start (part, 3)`` as in `local_points`."""

    visible: NDArray[np.bool_]
    start: NDArray[np.float64]


def trace_keyframe(tracer: BodyTracer, at: ChirpPoses) -> Keyframe:
    """Trace one pose, given with one chirp for each Tx.

    Whether another part occludes either leg is asked from Tx and Rx to the specular point of each
    pair. One of these points is where the search for those of the chirps after it begins.
    """
    tracer.pose(at.centres[0], at.frames[0])
    points, start = local_points(at)
    return Keyframe(unobstructed(tracer, at.tx, at.rx, points), start)


def unobstructed(
    tracer: BodyTracer,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    points: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Whether no other part of the posed body occludes either leg, (chirp, rx, part) bool.

    The legs run from ``tx (chirp, 3)`` and ``rx (chirp, rx, 3)`` to one point on each part,
    ``points (chirp, rx, part, 3)``, world [m].
    """
    own = np.broadcast_to(np.arange(points.shape[2]), points.shape[:3]).ravel()
    targets = points.reshape(-1, 3)
    from_tx, from_rx = (
        tracer.sees(np.broadcast_to(antennas, points.shape).reshape(-1, 3), targets, own)
        for antennas in (tx[:, None, None], rx[:, :, None])
    )
    return (from_tx & from_rx).reshape(points.shape[:3])


class SpecularVisibility:
    """Visibility of the specular points of a moving body, the tracer's, over a capture."""

    def __init__(self, radar: Radar, body: Body, tracer: BodyTracer) -> None:
        self._radar, self._body, self._tracer = radar, body, tracer
        self._step = keyframe_step(radar)
        # Visibility as bits, which take an eighth of the memory.
        self._kept: KeyframeCache[int, tuple[NDArray[np.uint8], NDArray[np.float64]]]
        self._kept = KeyframeCache(_KEPT_KEYFRAMES - _PASSING, _PASSING)

    def _keyframe(self, chirp: int) -> Keyframe:
        bits, start = self._kept.get(chirp, partial(self._trace, chirp))
        shape = self._radar.n_tx, self._radar.n_rx, len(start)
        visible = np.unpackbits(bits, count=shape[0] * shape[1] * shape[2]).view(np.bool_)
        return Keyframe(visible.reshape(shape), start)

    def _trace(self, chirp: int) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
        time_s = keyframe_time(self._radar, self._body, chirp)
        radar, poses = self._radar.at(time_s), self._body.at([time_s])
        centres, frames = (
            np.repeat(own, radar.n_tx, axis=0) for own in (poses.centres, poses.frames)
        )
        ends = radar.tx, radar.rx[radar.rx_of_tx]
        at = ChirpPoses(np.arange(radar.n_tx), *ends, centres, frames, poses.semi_axes)
        visible, start = trace_keyframe(self._tracer, at)
        return np.packbits(visible), start

    def at(self, chirps: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Visibility and starting points at chirps.

        Returned are weights (chirp, rx, part), 1 visible, 0 occluded, in between on the ramp
        between two keyframes that differ; and the specular points (chirp, part, 3) of one pair at
        the keyframe before, in the parts' axes [m].
        """
        chirps = np.asarray(chirps, dtype=np.int64)
        parts = len(self._body.part_names)
        weight = np.empty((len(chirps), self._radar.n_rx, parts))
        start = np.empty((len(chirps), parts, 3))
        tx = self._radar.tx_of_chirp(chirps)
        intervals, rest = keyframe_before(self._radar, chirps, self._step)
        for interval in np.unique(intervals):
            inside = np.flatnonzero(intervals == interval)
            first = int(interval) * self._step
            before = self._keyframe(first)
            weight[inside], start[inside] = before.visible[tx[inside]], before.start
            if (rest[inside] > 0).any():
                after = self._keyframe(first + self._step).visible[tx[inside]]
                ramp = smoothstep(rest[inside] / self._step)[:, None, None]
                weight[inside] = (1 - ramp) * weight[inside] + ramp * after
        return weight, start
