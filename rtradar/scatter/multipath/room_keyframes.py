"""Keyframes of a room as chirps need them: computed many at a time, kept, and found again."""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.kernels.scatter.nearby_points import Nearby
from rtradar.kernels.scatter.rooms import Blend
from rtradar.scatter.common.keyframes import KeyframeCache, keyframe_before, keyframe_step
from rtradar.scatter.multipath.keyframes import PathKeyframes, Surroundings, path_keyframes
from rtradar.scatter.multipath.path_echoes import EchoColumns

KEYFRAMES_S = 20e-3
"""Keyframe spacing of echoes over walls [s]. Interpolating leaves an error of -21 dB of the ghosts
(`validation/other_methods/multipath.py`)."""

_KEPT_BYTES = 64e6
"""Memory of the keyframes that stay, so that pruning and the signal trace once: 10 s in a box."""

_KEYFRAMES_AT_ONCE = 32


class RoomKeyframes:
    """Keyframes of the echoes of a ``body``, in their ``columns``, every ``step`` chirps."""

    def __init__(self, around: Surroundings, columns: EchoColumns, body: Body) -> None:
        self._around, self.columns, self._body = around, columns, body
        self.step = keyframe_step(around.radar, KEYFRAMES_S)
        self._cache: KeyframeCache[int, PathKeyframes] = KeyframeCache(0, _KEYFRAMES_AT_ONCE)

    def direct(self) -> RoomKeyframes:
        """Return those of the direct echoes alone, with what is already known of them."""
        other, keep = copy.copy(self), self.columns.direct
        other.columns, other._cache = copy.copy(self.columns), self._cache.copy()
        other.restrict(keep[np.array(self.columns.echo)], keep)
        return other

    def around(
        self, chirps: NDArray[np.int64], tx: NDArray[np.int64]
    ) -> tuple[Blend, PathKeyframes, PathKeyframes]:
        """Return where chirps are, and the keyframes before and after each interval.

        ``tx (chirp,)`` are their transmitters.
        """
        numbers, rest = keyframe_before(self._around.radar, chirps, self.step)
        starts, interval = np.unique(numbers, return_inverse=True)
        fraction = rest / self.step
        # Where every chirp of an interval is its first, the keyframe after it does not matter.
        stops = starts + (np.bincount(interval, weights=fraction) > 0)
        found = self._find(np.union1d(starts, stops).tolist())
        before, after = (
            _stack([found[number] for number in ends.tolist()], len(self.columns))
            for ends in (starts, stops)
        )
        ends = self._around.ends
        blend = Blend(
            interval, fraction, ends.line_of_tx[tx], ends.tx_weight[tx], ends.rx_weight[tx]
        )
        return blend, before, after

    def look_ahead(self, n_chirps: int) -> None:
        """Compute the keyframes of a capture that stay, many at a time."""
        self._find(list(range(min(-(-n_chirps // self.step) + 1, self._cache.stay))))

    def _find(self, numbers: list[int]) -> dict[int, PathKeyframes]:
        """Keyframes with these numbers, from the cache or many at a time."""
        cache = self._cache
        found = {number: cache[number] for number in numbers if number in cache}
        missing = [number for number in numbers if number not in cache]
        radar, gapless = self._around.radar, self._around.radar.gapless
        at_once = 1 if radar.is_moving else _KEYFRAMES_AT_ONCE
        for first in range(0, len(missing), at_once):
            some = missing[first : first + at_once]
            times = gapless.centres_of(np.array(some) * self.step)
            poses = self._body.at(np.minimum(times, self._body.duration_s))
            around = self._around.before(radar.at(float(times[0])))
            keyframes = path_keyframes(around, self.columns, poses, times)
            for place, number in enumerate(some):
                own = PathKeyframes(*(array[place].copy() for array in keyframes))
                cache.stay = int(_KEPT_BYTES / sum(array.nbytes for array in own))
                cache.keep(number, own)
                found[number] = own
        return found

    def restrict(self, column: NDArray[np.bool_], echo: NDArray[np.bool_]) -> None:
        """Leave out all other columns and all other echoes for good."""
        self.columns.keep(column, echo)
        self._cache.replace(
            lambda own: PathKeyframes(
                _widened(own.factor, len(column))[..., column].copy(),
                own.seen[..., echo].copy(),
                own.start[..., echo, :].copy(),
            )
        )


def nearby_points(blend: Blend, before: PathKeyframes, after: PathKeyframes) -> Nearby:
    """Return the specular points that are expected at chirps between keyframes."""
    wanted = np.any(before.seen | after.seen, axis=(2, 3))
    interval, fraction, line, tx_weight, _ = blend
    return Nearby(before.start, after.start, wanted, interval, line, fraction, tx_weight)


def _stack(keyframes: list[PathKeyframes], columns: int) -> PathKeyframes:
    factor = np.stack([_widened(own.factor, columns) for own in keyframes])
    seen, start = (np.stack(arrays) for arrays in list(zip(*keyframes, strict=True))[1:])
    return PathKeyframes(factor, seen, start)


def _widened(factor: NDArray[np.complex64], columns: int) -> NDArray[np.complex64]:
    """Add empty columns for what was not yet known."""
    missing = columns - factor.shape[-1]
    return factor if not missing else np.pad(factor, [(0, 0)] * (factor.ndim - 1) + [(0, missing)])
