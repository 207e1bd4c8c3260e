"""IF samples of a room, with the moving shadow of a body in it, or before a radar that moves.

Before a radar that moves, the clutter is that at keyframes along the way. At a keyframe the room is
traced as for a radar at rest there. From a chirp on either side of it the same echoes are as much
longer or shorter as the ways from the antennas to their points are, and those over walls as the way
from the image of the Tx is: the image moves as the Tx does, mirrored. Between two keyframes both
sets of echoes are summed, with weights that change evenly. Fields of a group of facets turn against
each other meanwhile, by a wavenumber times the way and the angle under which the group is seen:
keyframes are `SPACING` wavelengths apart. What a person takes from the clutter by their shadow is
left out there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.echoes import Echoes
from rtradar.kernels.elementary import add_blended, cubic_weights
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import (
    at_nodes,
    interpolation_weights,
    sweep_nodes,
    take,
    together,
)
from rtradar.scatter.common.poses import KeyframeCache, antennas_in_use, keyframe_before
from rtradar.signal.synthesis import synthesize
from rtradar.system.threads import begun, thread_map

_Array = NDArray[np.float64]
_Samples = NDArray[np.complex64]

_FEW = 16
_SHADOW_NODES = 3
"""Frequencies at which amplitudes of points are taken for their shadow: groups of facets half a
range bin deep are then known to -25 dB, and on average to -40 dB."""
_CHIRPS_A_THREAD = 16

_KEPT_ROOMS = 2
"""Rooms whose samples stay in memory: as many as traced rooms, which this package must not know."""


class _Group(NamedTuple):
    """Objects whose amplitudes are given at the same frequencies, so that one sum takes them all.

    ``member (object,)`` says which belong to it, ``first (object,)`` where their echoes begin.
    """

    echoes: Echoes
    member: NDArray[np.bool_]
    first: NDArray[np.int64]


def _grouped(objects: Sequence[Echoes], mirrors: Collection[int]) -> list[_Group]:
    counts = np.array([len(own.part) for own in objects], dtype=np.int64)
    # Mirrors have few echoes. What is few is summed alone, with a shadow and without.
    kinds = [
        (number,) if number in mirrors or counts[number] <= _FEW else tuple(own.frequency)
        for number, own in enumerate(objects)
    ]
    groups = []
    for kind in dict.fromkeys(kinds):
        member = np.array([other == kind for other in kinds])
        chosen = [own for own, inside in zip(objects, member, strict=True) if inside]
        # In the precision of the samples.
        echoes = together(
            [replace(own, amplitude=own.amplitude.astype(np.complex64)) for own in chosen]
        )
        groups.append(_Group(echoes, member, np.cumsum(counts * member) - counts * member))
    return groups


class _Still(tuple[Echoes, ...]):
    """The echoes of each object of a room; two of the same arrays are one key."""

    def _arrays(self) -> list[int]:
        return [id(array) for own in self for array in (own.length, own.amplitude)]

    def __hash__(self) -> int:
        return hash(tuple(self._arrays()))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Still) and other._arrays() == self._arrays()


@lru_cache(maxsize=_KEPT_ROOMS)
def _at_rest(
    radar: Radar, objects: _Still, mirrors: tuple[int, ...]
) -> tuple[list[_Group], _Samples, dict[int, _Samples]]:
    """Groups of a room's objects, their IF samples in one cycle, and those of each mirror alone.

    Kept as long as the traced room is: the next recording in it needs the same.
    """
    groups, of_mirrors = _grouped(objects, mirrors), dict[int, _Samples]()
    whole = np.zeros((radar.n_tx, radar.n_rx, radar.samples_per_chirp), np.complex128)
    for group in groups:
        samples, number = _synthesized(group.echoes, radar), int(group.member.argmax())
        whole += samples
        if number in mirrors:
            of_mirrors[number] = samples
    return groups, whole.astype(np.complex64), of_mirrors


def _synthesized(echoes: Echoes, radar: Radar) -> _Samples:
    times = radar.chirp_times(radar.n_tx)
    return np.asarray(synthesize(echoes, radar, times, dtype=np.complex64))


class RoomIf:
    """IF samples of a room.

    The room is computed for one TDM cycle, because its IF is the same in every cycle. At keyframes
    the IF of what the body occludes is computed. Between them a cubic goes through the samples,
    because the sum over echoes is linear in what each has lost. ``objects`` are the echoes of each
    object for one cycle, as `Clutter.cycle` yields them; the ``shadow`` is what the body occludes
    of them, a `rtradar.scatter.clutter.body_shadow.ClutterShadow`. Without one the room is exactly
    still.
    """

    def __init__(self, radar: Radar, objects: Iterable[Echoes], shadow: Any = None) -> None:
        self._radar, still = radar, _Still(objects)
        self._shadow: Any = shadow if still else None
        mirrors = tuple(shadow.mirrors) if shadow else ()
        self._groups, self._whole, self._mirrors = _at_rest(radar, still, mirrors)
        # What a body takes from a wall that mirrors changes over the sweep; weights take it from
        # the nodes of the shadow to every sample.
        if shadow:
            frequency = np.arange(radar.samples_per_chirp) / radar.sample_rate_hz
            frequency = radar.sampled_start_hz + radar.slope_hz_per_s * frequency
            self._sweep = interpolation_weights(shadow.frequency, frequency)
        # What is lost at keyframes: what was begun is waited for.
        self._lost: Callable[[], dict[int, _Samples]] = dict
        self._slow: KeyframeCache[int, _Samples] = KeyframeCache(0, 4)

    @property
    def power_m2(self) -> float:
        """Mean power of the room's IF samples without a person [m^2]."""
        return float((np.abs(self._whole) ** 2).mean())

    @property
    def cycle(self) -> tuple[Echoes, ...]:
        """Echoes of one cycle of the room without a person."""
        return tuple(group.echoes for group in self._groups)

    def clutter_if(self, chirps: NDArray[np.int64]) -> _Samples:
        """Return the IF samples of the room (chirp, rx, sample); chirps as in `add`."""
        out = np.zeros((len(chirps), *self._whole.shape[1:]), dtype=np.complex64)
        self.add(out, chirps)
        return out

    def add(self, samples: _Samples, chirps: NDArray[np.int64]) -> None:
        """Add the IF samples of the room to ``samples (chirp, rx, sample)`` complex64, in place.

        The chirps (chirp,) are numbered from the start of the capture, ascending.
        """
        chirps = np.asarray(chirps, dtype=np.int64)
        tx = self._radar.tx_of_chirp(chirps)
        if self._shadow is None:
            samples += self._whole[tx]
            return
        self.begin(chirps)
        # The IF is the whole less what is lost, by a cubic through the four keyframes about each
        # chirp.
        found = self._waited_for()
        keyframes, rest = keyframe_before(self._radar, chirps, self._shadow.step)
        weights = cubic_weights(rest / self._shadow.step).astype(np.float32)
        for keyframe in np.unique(keyframes).tolist():
            inside = np.flatnonzero(keyframes == keyframe)
            some = slice(int(inside[0]), int(inside[-1]) + 1)
            lost = np.stack([found[k] for k in range(keyframe - 1, keyframe + 3)])
            self._blend(samples[some], tx[some], weights[some], lost)

    def begin(self, chirps: NDArray[np.int64]) -> None:
        """Begin to compute what the body occludes around some chirps (chirp,), ascending.

        It is done in another thread, and `add` waits for it. The model of the echoes is asked for
        nothing, so that it may be asked for others meanwhile.
        """
        if self._shadow is None:
            return
        before = np.unique(keyframe_before(self._radar, chirps, self._shadow.step)[0])
        needed = np.unique(before[:, None] + np.arange(-1, 3)).tolist()
        # Only after what was begun are the caches free.
        held = self._waited_for()
        missing = [k for k in needed if k not in held]
        # Where nothing is missing it is perhaps part of a block, whose rest is asked for later.
        if missing:
            kept = {k: held[k] for k in needed if k in held}
            self._lost = begun(lambda: kept | {k: self._find(k) for k in missing})

    def _waited_for(self) -> dict[int, _Samples]:
        """Return what is lost at the keyframes that were begun; an error leaves none behind."""
        lost, self._lost = self._lost, dict
        held = lost()
        self._lost = lambda: held
        return held

    def _blend(self, out: _Samples, tx: Any, weights: NDArray[np.float32], lost: _Samples) -> None:
        n_tx, whole = len(self._whole), self._whole.reshape(len(self._whole), -1)
        rows, out = lost.reshape(4, n_tx, -1), out.reshape(len(tx), -1)

        def fill(begin: int) -> None:
            some = slice(begin, begin + _CHIRPS_A_THREAD)
            add_blended(tx[some], weights[some], rows, whole, out[some])

        thread_map(fill, range(0, len(tx), _CHIRPS_A_THREAD))

    def _find(self, keyframe: int) -> _Samples:
        """IF of one cycle of what the body occludes at a keyframe, (tx, rx, sample)."""
        shadow, now = self._shadow, self._shadow.at(keyframe)
        # What is lost of points on furniture and walls.
        lost = self._of_points(now.echo, now.fraction)
        # A mirror loses a fraction of its samples that depends on the frequency, and so on the
        # sample.
        for number, of_mirror in zip(now.mirror.tolist(), now.of_mirror, strict=True):
            lost += self._mirrors[number] * (of_mirror @ self._sweep.T)
        # Weak points have keyframes farther apart, between which they are interpolated as well.
        if shadow.slower:
            before, rest = divmod(keyframe, shadow.slower)
            weights = cubic_weights([rest / shadow.slower])[0].astype(np.float32)
            for weight, number in zip(weights, range(before - 1, before + 3), strict=True):
                if weight:
                    lost += weight * self._slow.get(number, partial(self._of_weak, number))
        return lost

    def _of_weak(self, number: int) -> _Samples:
        """The same of weak points, at one of their own keyframes."""
        return self._of_points(*self._shadow.slow_at(number))

    def _of_points(self, echo: NDArray[np.int64], fraction: NDArray[np.complex128]) -> _Samples:
        starts, nodes = self._shadow.starts, self._shadow.point_frequency
        lost = np.zeros(self._whole.shape, dtype=np.complex64)
        # Points are numbered through all objects: which object each is of, and its echo in the
        # group of that.
        own = np.searchsorted(starts, echo, side="right") - 1
        for group in self._groups:
            chosen = np.flatnonzero(group.member[own])
            if not len(chosen):
                continue
            which = group.first[own[chosen]] + echo[chosen] - starts[own[chosen]]
            some = take(group.echoes, which)
            # Amplitudes are taken at few frequencies; where the fraction that is lost changes over
            # the sweep, at those of the fraction, so that both can be multiplied.
            few = len(some.frequency) <= _SHADOW_NODES
            frequency = some.frequency if few else sweep_nodes(self._radar, _SHADOW_NODES)
            frequency = nodes if len(fraction) > 1 else frequency
            amplitude = at_nodes(some.amplitude, some.frequency, frequency)
            amplitude = amplitude * fraction[..., chosen].astype(np.complex64)
            lost += _synthesized(
                replace(some, amplitude=amplitude, frequency=frequency), self._radar
            )
        return lost


# -- a radar that moves ----------------------------------------------------------------------------

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
        # Between which two keyframes each chirp is, and how far on the way.
        before = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, last)
        for keyframe in np.unique(before).tolist():
            inside = np.flatnonzero(before == keyframe)
            some = slice(int(inside[0]), int(inside[-1]) + 1)
            steps = self.times[keyframe : keyframe + 2]
            later = np.interp(times[some], steps, np.arange(len(steps)))
            # The echoes of one keyframe fade out as those of the next fade in.
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
        # Some chirps at a time, because every channel has all echoes of the room.
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
        # What the way from antenna to point does not explain of a length, it keeps while the radar
        # moves.
        radar = self._radar.at(float(self.times[keyframe]))
        objects, rx = self._trace(radar).objects, radar.rx[radar.rx_of_tx]
        return [(own, own.length - _ways(own, radar.tx, rx)) for own in objects]


def keyframe_times(radar: Radar, duration_s: float) -> _Array:
    """Times of keyframes on the path of a radar, up to the end of a capture [s]."""
    knots = np.clip([0.0, *(radar.path_times_s or ()), duration_s], 0.0, duration_s)
    knots = np.unique(knots)
    # Its angles change evenly between the knots, as its place does.
    angles, places = radar.path_at(knots)
    # Between two knots of the path the radar goes straight and evenly: as many keyframes as its way
    # and its turn ask for.
    way, turn = (np.linalg.norm(np.diff(values, axis=0), axis=1) for values in (places, angles))
    counts = np.ceil(np.maximum(way / (SPACING * radar.wavelength_m), turn / TURN_DEG))
    pieces = [
        np.linspace(start, stop, max(1, math.ceil(count)), endpoint=False)
        for start, stop, count in zip(knots, knots[1:], counts, strict=False)
    ]
    return np.concatenate([*pieces, knots[-1:]])


def _ways(own: Any, tx: _Array, rx: _Array) -> _Array:
    """Ways (chirp, rx, echo) from Tx (chirp, 3) to Rx (chirp, rx, 3), over walls or points [m]."""
    # Over walls the path is straight from the image of the Tx, which moves as the Tx does,
    # mirrored.
    if own.image is not None:
        turn, shift = own.image
        way = np.linalg.norm((tx @ turn.T + shift)[:, None] - rx, axis=-1)
        return np.repeat(way[..., None], own.n_echoes, axis=-1)
    where = own.points[0, 0, :, 0]
    out = np.linalg.norm(tx[:, None, None] - where, axis=-1)
    return np.asarray(out + np.linalg.norm(rx[:, :, None] - where, axis=-1))
