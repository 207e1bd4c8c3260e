"""The IF of a room: made once for a TDM cycle, and after that only what a person hides of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.kernels.blends import smoothstep
from rtradar.kernels.jit import compiled
from rtradar.scatter.clutter.body_shadow import ClutterShadow, Hidden
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.signal import synthesize

_Samples = NDArray[np.complex128]


@compiled(parallel=True)
def _fade(kept, changed, share, tx, out):
    """Add to ``out (chirp, rx, sample)`` what is kept of the room, and the share of its change that has come."""
    for chirp in prange(len(out)):
        own, more, part = kept[tx[chirp]], changed[tx[chirp]], share[chirp]
        for receiver in range(out.shape[1]):
            for sample in range(out.shape[2]):
                out[chirp, receiver, sample] += (
                    own[receiver, sample] + part * more[receiver, sample]
                )


class _Crowd(NamedTuple):
    """Objects whose amplitudes are given at the same frequencies, so that one sum does all of them.

    ``member (object,)`` whether an object is in it, ``first (object,)`` where its echoes begin in ``echoes``.
    A single echo, of a mirror, is one of its own: a person stands before it again and again, and its IF is kept.
    """

    echoes: Echoes
    member: NDArray[np.bool_]
    first: NDArray[np.int64]


def _crowds(objects: Sequence[Echoes]) -> list[_Crowd]:
    crowds = []
    counts = [len(own.part) for own in objects]
    kinds = [
        (number,) if counts[number] == 1 else tuple(own.frequency)
        for number, own in enumerate(objects)
    ]
    for kind in dict.fromkeys(kinds):
        member = np.array([other == kind for other in kinds])
        numbers = np.flatnonzero(member).tolist()
        chosen = [objects[number] for number in numbers]
        together = Echoes(
            length=np.concatenate([own.length for own in chosen], axis=-1),
            amplitude=np.concatenate([own.amplitude for own in chosen], axis=-1),
            frequency=chosen[0].frequency,
            tx=chosen[0].tx,
            part=np.concatenate([own.part for own in chosen]),
            bounces=np.concatenate([own.bounces for own in chosen]),
        )
        first = np.cumsum(
            [0, *(count * inside for count, inside in zip(counts, member, strict=True))]
        )[:-1]
        crowds.append(_Crowd(together, member, first))
    return crowds


class RoomIf:
    """IF samples of static clutter, with the moving shadow of a body in it.

    The IF of the whole room is that of one TDM cycle, the same in all of them. At anchors 20 ms apart the IF of what the body
    hides is made, from the last anchor's by what has changed; between anchors it fades as the echoes do, for the sum is
    linear in them.

    Parameters
    ----------
    clutter : Clutter
    body : Body, optional
        None: nobody is there, and the room is exactly still.
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend.
    """

    def __init__(
        self, clutter: Clutter, body: Body | None = None, *, variant: str = "auto"
    ) -> None:
        self._radar = clutter.radar
        radar = self._radar
        self._crowds = _crowds(tuple(clutter.cycle()))
        self._whole: _Samples = np.zeros(
            (radar.n_tx, radar.n_rx, radar.samples_per_chirp), dtype=np.complex128
        )
        for crowd in self._crowds:
            self._whole += self._synthesized(crowd.echoes)
        self._shadow = (
            ClutterShadow(clutter, body, variant=variant)
            if body is not None and clutter.objects
            else None
        )
        self._lost: dict[int, _Samples] = {}
        self._mirrored: dict[int, NDArray[np.complex64]] = {}

    @property
    def power_m2(self) -> float:
        """Mean power of the room's IF samples with nobody there [m^2]."""
        return float((np.abs(self._whole) ** 2).mean())

    def clutter_if(self, chirps: NDArray[np.int64]) -> NDArray[np.complex64]:
        """IF samples of the room at these chirps, (chirp, rx, sample); chirps as in `add`."""
        out = np.zeros((len(chirps), *self._whole.shape[1:]), dtype=np.complex64)
        self.add(out, chirps)
        return out

    def add(self, samples: NDArray[np.complex64], chirps: NDArray[np.int64]) -> None:
        """Add the IF samples of the room in place.

        Parameters
        ----------
        samples : (chirp, rx, sample) complex64
        chirps : (chirp,) int64
            Numbered from the start of the capture, ascending.
        """
        chirps = np.asarray(chirps, dtype=np.int64)
        tx = self._radar.tx_of_chirp(chirps)
        if self._shadow is None:
            samples += self._whole.astype(np.complex64)[tx]
            return
        step = self._shadow.step
        anchors = chirps // step
        for anchor in np.unique(anchors).tolist():
            inside = np.flatnonzero(anchors == anchor)
            share = smoothstep((chirps[inside] - anchor * step) / step)
            before = self._hidden(anchor)
            after = self._hidden(anchor + 1) if (share > 0).any() else before
            kept, changed = (
                (first - second).astype(np.complex64)
                for first, second in ((self._whole, before), (before, after))
            )
            _fade(
                kept,
                changed,
                share.astype(np.float32),
                tx[inside],
                samples[inside[0] : inside[-1] + 1],
            )

    def _hidden(self, anchor: int) -> _Samples:
        """IF of one cycle of what the body hides at an anchor, (tx, rx, sample)."""
        if anchor not in self._lost:
            assert self._shadow is not None
            now = self._shadow.hidden(anchor)
            lost = np.zeros_like(self._whole)
            then = Hidden(now.echo[:0], now.share[..., :0])
            # From scratch where nothing is hidden: then the room is exactly as it is without a person.
            if anchor - 1 in self._lost and len(now.echo):
                lost, then = self._lost[anchor - 1], self._shadow.hidden(anchor - 1)
            lost = self._changed(lost, then, now)
            self._lost = {key: value for key, value in self._lost.items() if key == anchor - 1} | {
                anchor: lost
            }
        return self._lost[anchor]

    def _changed(self, lost: _Samples, then: Hidden, now: Hidden) -> _Samples:
        assert self._shadow is not None
        echoes = np.union1d(then.echo, now.echo)
        change = np.zeros((*self._whole.shape[:2], len(echoes)))
        change[..., np.searchsorted(echoes, now.echo)] = now.share
        change[..., np.searchsorted(echoes, then.echo)] -= then.share
        differs = (change != 0).any(axis=(0, 1))
        echoes, change = echoes[differs], change[..., differs]
        starts = self._shadow.starts
        lost = lost.copy()
        own = np.searchsorted(starts, echoes, side="right") - 1
        for crowd in self._crowds:
            chosen = np.flatnonzero(crowd.member[own])
            if len(chosen) == 0:
                continue
            share = change[..., chosen]
            if len(crowd.echoes.part) == 1:
                lost += share * self._alone(crowd)
                continue
            which = crowd.first[own[chosen]] + echoes[chosen] - starts[own[chosen]]
            whole = crowd.echoes
            lost += self._synthesized(
                replace(
                    whole,
                    length=whole.length[..., which],
                    amplitude=whole.amplitude[..., which] * share,
                    part=whole.part[which],
                    bounces=whole.bounces[which],
                )
            )
        return lost

    def _alone(self, crowd: _Crowd) -> NDArray[np.complex64]:
        """IF of a single mirror."""
        number = int(np.argmax(crowd.member))
        if number not in self._mirrored:
            self._mirrored[number] = self._synthesized(crowd.echoes)
        return self._mirrored[number]

    def _synthesized(self, echoes: Echoes) -> NDArray[np.complex64]:
        return np.asarray(
            synthesize(
                echoes, self._radar, self._radar.chirp_times(self._radar.n_tx), dtype=np.complex64
            )
        )
