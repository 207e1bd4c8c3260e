"""IF samples of a room before a radar that moves: its clutter at keyframes along the way.

At a keyframe the room is traced as for a radar at rest there. From a chirp on either side of it the
same echoes are as much longer or shorter as the ways from the antennas to their points are, and
those over walls as the way from the image of the Tx is: the image moves as the Tx does, mirrored.
Between two keyframes both sets of echoes are summed, with weights that change evenly. Fields of a
group of facets turn against each other meanwhile, by a wavenumber times the way and the angle under
which the group is seen: keyframes are `SPACING` wavelengths apart.

What a person takes from the clutter by their shadow is left out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.common.poses import KeyframeCache, antennas_in_use
from rtradar.signal.static_clutter import RoomIf
from rtradar.signal.synthesis import synthesize

_Array = NDArray[np.float64]
_Samples = NDArray[np.complex64]

SPACING = 2.0
"""Way between keyframes in wavelengths."""
TURN_DEG = 1.0
"""Turn between keyframes [deg]: what an antenna sees changes by its pattern alone."""
_MOST_TERMS = 4_000_000
"""Echoes of channels that are in memory at once."""


class MovingRoomIf(RoomIf):
    """IF samples of a room, for a capture of ``duration_s`` by a radar that moves.

    ``trace`` gives the clutter before a radar at rest,
    `rtradar.scatter.clutter.static_clutter.Clutter`, once for each keyframe.
    """

    def __init__(self, radar: Radar, duration_s: float, trace: Callable[[Radar], Any]) -> None:
        self._trace, self.times = trace, keyframe_times(radar, duration_s)
        # Each object at a keyframe, with the lengths (tx, rx, echo) that `_ways` does not hold [m].
        self._kept: KeyframeCache[int, list[tuple[Any, _Array]]] = KeyframeCache(0, 3)
        super().__init__(radar, trace(radar.at(0.0)).cycle())

    def add(self, samples: _Samples, chirps: NDArray[np.int64]) -> None:
        """Add the IF samples of the room, as `RoomIf.add`."""
        chirps = np.asarray(chirps, dtype=np.int64)
        times = self._radar.centres_of(chirps)
        last = max(len(self.times) - 2, 0)
        before = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, last)
        for keyframe in np.unique(before).tolist():
            inside = np.flatnonzero(before == keyframe)
            some = slice(int(inside[0]), int(inside[-1]) + 1)
            steps = self.times[keyframe : keyframe + 2]
            later = np.interp(times[some], steps, np.arange(len(steps)))
            for number, weight in enumerate((1 - later, later)[: len(steps)]):
                self._add_set(samples[some], chirps[some], weight, keyframe + number)

    def _add_set(
        self, samples: _Samples, chirps: NDArray[np.int64], weight: _Array, keyframe: int
    ) -> None:
        """Add the echoes of a keyframe, each chirp with its weight."""
        radar = self._radar
        found = self._kept.get(keyframe, lambda: self._keyframe(keyframe))
        times, tx = radar.centres_of(chirps), radar.tx_of_chirp(chirps)
        at_tx, at_rx = antennas_in_use(radar, times, tx)
        for own, rest in found:
            at_once = max(1, _MOST_TERMS // (radar.n_rx * own.n_echoes))
            for first in range(0, len(chirps), at_once):
                some = slice(first, first + at_once)
                echoes = Echoes(
                    length=rest[tx[some]] + _ways(own, at_tx[some], at_rx[some]),
                    amplitude=own.amplitude[:, tx[some]] * weight[some, None, None],
                    frequency=own.frequency,
                    tx=tx[some],
                    part=np.full(own.n_echoes, -1),
                    bounces=own.bounces,
                )
                samples[some] += synthesize(echoes, radar, times[some], dtype=np.complex64)

    def _keyframe(self, keyframe: int) -> list[tuple[Any, _Array]]:
        radar = self._radar.at(float(self.times[keyframe]))
        objects, rx = self._trace(radar).objects, radar.rx[radar.rx_of_tx]
        return [(own, own.length - _ways(own, radar.tx, rx)) for own in objects]


def keyframe_times(radar: Radar, duration_s: float) -> _Array:
    """Times of keyframes on the path of a radar, up to the end of a capture [s]."""
    knots = np.clip([0.0, *(radar.path_times_s or ()), duration_s], 0.0, duration_s)
    knots = np.unique(knots)
    # Its angles change evenly between the knots, as its place does.
    angles, places = radar.path_at(knots)
    way, turn = (np.linalg.norm(np.diff(values, axis=0), axis=1) for values in (places, angles))
    counts = np.ceil(np.maximum(way / (SPACING * radar.wavelength_m), turn / TURN_DEG))
    pieces = [
        np.linspace(start, stop, max(1, math.ceil(count)), endpoint=False)
        for start, stop, count in zip(knots, knots[1:], counts, strict=False)
    ]
    return np.concatenate([*pieces, knots[-1:]])


def _ways(own: Any, tx: _Array, rx: _Array) -> _Array:
    """Ways (chirp, rx, echo) from Tx (chirp, 3) to Rx (chirp, rx, 3), over walls or points [m]."""
    if own.image is not None:
        turn, shift = own.image
        way = np.linalg.norm((tx @ turn.T + shift)[:, None] - rx, axis=-1)
        return np.repeat(way[..., None], own.n_echoes, axis=-1)
    where = own.points[0, 0, :, 0]
    out = np.linalg.norm(tx[:, None, None] - where, axis=-1)
    return np.asarray(out + np.linalg.norm(rx[:, :, None] - where, axis=-1))
