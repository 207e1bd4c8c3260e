"""IF samples of static clutter, with the moving shadow of a body in it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rtradar.echoes import Echoes
from rtradar.kernels.elementary import smoothstep
from rtradar.kernels.scatter.rooms import Shadow
from rtradar.radar import Radar
from rtradar.scatter.common.keyframes import KeyframeCache
from rtradar.signal.synthesis import synthesize

_Samples = NDArray[np.complex128]


class MovingShadow(Protocol):
    """What of static clutter a body occludes, as `ClutterShadow` computes it.

    ``step`` is the number of chirps between keyframes, ``starts (object + 1,)`` the first echo of
    each object of the clutter.
    """

    step: int
    starts: NDArray[np.int64]

    def at(self, keyframe: int) -> Shadow:
        """Return what is occluded at a keyframe."""
        ...


class _Group(NamedTuple):
    """Objects whose amplitudes are given at the same frequencies, for one sum over all of them.

    ``member (object,)`` says which belong to it, ``first (object,)`` where their echoes begin. The
    single echo of a wall is a group of its own, whose IF is kept: a person is often before it.
    """

    echoes: Echoes
    member: NDArray[np.bool_]
    first: NDArray[np.int64]


def _grouped(objects: Sequence[Echoes]) -> list[_Group]:
    counts = np.array([len(own.part) for own in objects], dtype=np.int64)
    kinds = [
        (number,) if counts[number] == 1 else tuple(own.frequency)
        for number, own in enumerate(objects)
    ]
    groups = []
    for kind in dict.fromkeys(kinds):
        member = np.array([other == kind for other in kinds])
        chosen = [own for own, inside in zip(objects, member, strict=True) if inside]
        together = replace(
            chosen[0],
            length=np.concatenate([own.length for own in chosen], axis=-1),
            amplitude=np.concatenate([own.amplitude for own in chosen], axis=-1),
            part=np.concatenate([own.part for own in chosen]),
            bounces=np.concatenate([own.bounces for own in chosen]),
        )
        groups.append(_Group(together, member, np.cumsum(counts * member) - counts * member))
    return groups


class RoomIf:
    """IF samples of a room.

    The IF of the whole room is that of one TDM cycle, the same in all of them. At keyframes 20 ms
    apart the IF of what the body occludes is computed, from that of the keyframe before by what has
    changed. Between keyframes it fades as the echoes do, for the sum is linear in them. ``objects``
    are the echoes of each object for one cycle, as `Clutter.cycle` yields them; without a shadow
    the room is exactly still.
    """

    def __init__(
        self, radar: Radar, objects: Iterable[Echoes], shadow: MovingShadow | None = None
    ) -> None:
        self._radar = radar
        self._groups = _grouped(tuple(objects))
        self._whole: _Samples = np.zeros(
            (self._radar.n_tx, self._radar.n_rx, self._radar.samples_per_chirp), np.complex128
        )
        self._singles: dict[int, NDArray[np.complex64]] = {}
        for number, group in enumerate(self._groups):
            samples = self._synthesized(group.echoes)
            self._whole += samples
            if len(group.echoes.part) == 1:
                self._singles[number] = samples
        self._shadow = shadow if self._groups else None
        self._lost: KeyframeCache[int, _Samples] = KeyframeCache(0, 2)

    @property
    def power_m2(self) -> float:
        """Mean power of the room's IF samples without a person [m^2]."""
        return float((np.abs(self._whole) ** 2).mean())

    def clutter_if(self, chirps: NDArray[np.int64]) -> NDArray[np.complex64]:
        """Return the IF samples of the room (chirp, rx, sample); chirps as in `add`."""
        out = np.zeros((len(chirps), *self._whole.shape[1:]), dtype=np.complex64)
        self.add(out, chirps)
        return out

    def add(self, samples: NDArray[np.complex64], chirps: NDArray[np.int64]) -> None:
        """Add the IF samples of the room to ``samples (chirp, rx, sample)`` complex64, in place.

        The chirps (chirp,) are numbered from the start of the capture, ascending.
        """
        chirps = np.asarray(chirps, dtype=np.int64)
        tx = self._radar.tx_of_chirp(chirps)
        if self._shadow is None:
            samples += self._whole.astype(np.complex64)[tx]
            return
        keyframes, rest = np.divmod(chirps, self._shadow.step)
        fractions = smoothstep(rest / self._shadow.step)
        for keyframe in np.unique(keyframes).tolist():
            inside = np.flatnonzero(keyframes == keyframe)
            fraction = fractions[inside]
            before = self._occluded(keyframe)
            after = self._occluded(keyframe + 1) if (fraction > 0).any() else before
            kept, changed = (
                (first - second).astype(np.complex64)
                for first, second in ((self._whole, before), (before, after))
            )
            some = samples[inside[0] : inside[-1] + 1]
            some += kept[tx[inside]]
            some += fraction.astype(np.float32)[:, None, None] * changed[tx[inside]]

    def _occluded(self, keyframe: int) -> _Samples:
        """IF of one cycle of what the body occludes at a keyframe, (tx, rx, sample)."""
        return self._lost.get(keyframe, partial(self._find, keyframe))

    def _find(self, keyframe: int) -> _Samples:
        assert self._shadow is not None
        now = self._shadow.at(keyframe)
        # From scratch where nothing is occluded: then the room is exactly as without a person.
        if keyframe - 1 in self._lost and len(now.echo):
            return self._changed(self._lost[keyframe - 1], self._shadow.at(keyframe - 1), now)
        nothing = Shadow(now.echo[:0], now.fraction[..., :0])
        return self._changed(np.zeros_like(self._whole), nothing, now)

    def _changed(self, lost: _Samples, then: Shadow, now: Shadow) -> _Samples:
        """IF of what is occluded now, from that of then."""
        assert self._shadow is not None
        echoes = np.union1d(then.echo, now.echo)
        change = np.zeros((*self._whole.shape[:2], len(echoes)))
        change[..., np.searchsorted(echoes, now.echo)] = now.fraction
        change[..., np.searchsorted(echoes, then.echo)] -= then.fraction
        differs = (change != 0).any(axis=(0, 1))
        echoes, change = echoes[differs], change[..., differs]
        starts = self._shadow.starts
        lost = lost.copy()
        own = np.searchsorted(starts, echoes, side="right") - 1
        for number, group in enumerate(self._groups):
            chosen = np.flatnonzero(group.member[own])
            if len(chosen) == 0:
                continue
            fraction, whole = change[..., chosen], group.echoes
            if number in self._singles:
                lost += fraction * self._singles[number]
                continue
            which = group.first[own[chosen]] + echoes[chosen] - starts[own[chosen]]
            some = replace(
                whole,
                length=whole.length[..., which],
                amplitude=whole.amplitude[..., which] * fraction,
                part=whole.part[which],
                bounces=whole.bounces[which],
            )
            lost += self._synthesized(some)
        return lost

    def _synthesized(self, echoes: Echoes) -> NDArray[np.complex64]:
        times = self._radar.chirp_times(self._radar.n_tx)
        return np.asarray(synthesize(echoes, self._radar, times, dtype=np.complex64))
