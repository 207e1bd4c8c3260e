"""Envelopes of the parts of a moving body before a whole array, for any chirps.

At each keyframe an envelope is found for a few places of the array, and for more of them where it
differs; between keyframes it runs as `rtradar.scatter.facets.envelope` has it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.kernels.scatter.envelope import fill_envelope
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayNodes, array_nodes, spread_nodes
from rtradar.scatter.common.keyframes import keyframe_before
from rtradar.scatter.common.poses import owners_of
from rtradar.scatter.facets.envelope import TOGETHER, Envelope, Sample, Scale, whole_echo

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_COARSE, _FINE = (2, 1), (6, 2)
"""Tx times Rx nodes per line of the array: for parts alike all over it, and for the others."""


class ArrayEnvelope:
    """The envelope of each part of a moving body over a capture, for every Tx and Rx.

    ``carriers(geometry)`` returns path and strength of each part (pair, 1, part) by its specular
    point [m]; ``ratio(time, pose, nodes, length, strength, parts)`` what that is to be multiplied
    by, (node, pair, n), for some parts (n,) in one pose, between pairs of places of the array.
    Keyframes are ``anchor_s`` apart [s]. They come closer, down to that over ``places``, where a
    part bends by more than ``tolerance`` of the whole person, and there are more places of the
    array where it differs over that by more than ``unevenness`` of it.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        carriers: Callable[[Geometry], tuple[Array, Array]],
        ratio: Callable[[float, Poses, ArrayNodes, Array, Array, Indices], NDArray[np.complex128]],
        *,
        anchor_s: float,
        tolerance: float,
        unevenness: float,
        places: int = 8,
    ) -> None:
        self._radar, self._body, self._carriers, self._ratio = radar, body, carriers, ratio
        self._weights = array_nodes(radar, *_FINE).weights
        # From coarse nodes to fine ones, which stand at antennas or between them.
        self._spread = spread_nodes(radar, _COARSE, _FINE)
        self._unevenness = unevenness
        self._step = max(1, round(anchor_s / radar.chirp_interval_s))
        end = math.ceil(body.duration_s / (self._step * radar.chirp_interval_s))
        self._envelope = Envelope(self._sample, owners_of(body), tolerance, end, places)

    def _sample(self, place: float, parts: Indices, whole: Scale | None) -> Sample:
        """Envelope at the fine nodes, from the coarse ones unless it differs over the array."""
        time = min((place * self._step + 0.5) * self._radar.chirp_interval_s, self._body.duration_s)
        pose, radar = self._body.at([time]), self._radar.at(time)
        coarse = self._at_nodes(time, pose, array_nodes(radar, *_COARSE), parts)
        ratio, strength = self._spread @ coarse.ratio, self._spread @ coarse.strength
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
        centres, frames = (
            np.repeat(array[:, parts], len(pairs), axis=0) for array in (pose.centres, pose.frames)
        )
        ends = antennas[pairs[:, 0]], antennas[pairs[:, 1], None]
        carriers = self._carriers(Geometry(*ends, centres, frames, pose.semi_axes[parts]))
        length, strength = (values[:, 0] for values in carriers)
        return Sample(self._ratio(time, pose, nodes, length, strength, parts), np.abs(strength))

    def times(
        self, chirps: Indices, tx: Indices, strength: Array, nodes: int
    ) -> NDArray[np.complex128]:
        """Multiply ``strength (chirp, rx, part)`` at chirps, which ``tx (chirp,)`` send.

        Returned is (node, chirp, rx, part), for the number of frequencies of a sample.
        """
        amplitude = np.empty((nodes, *strength.shape), dtype=np.complex128)
        intervals, rest = keyframe_before(self._radar, chirps, self._step)
        envelope, weights = self._envelope, self._weights
        # Power is measured at keyframes, where nothing is asked of what comes after.
        between = set(intervals[rest != 0].tolist())
        in_order = sorted(set(intervals.tolist()))
        for _, group in groupby(in_order, key=lambda interval: interval // TOGETHER):
            together = list(group)
            envelope.prepare_keyframes(k for k in together if k not in between)
            envelope.prepare_courses(between.intersection(together))
            for interval in together:
                inside = np.flatnonzero(intervals == interval)
                if interval in between:
                    fraction = self._radar.slots_of(chirps[inside]) / self._step - interval
                    course = tuple(envelope.course(interval))
                    fill_envelope(inside, fraction, tx, weights, course, strength, amplitude)
                else:
                    ratio = envelope.keyframe(interval).ratio[:, None]
                    amplitude[:, inside] = (weights[tx[inside]] @ ratio) * strength[inside]
        return amplitude
