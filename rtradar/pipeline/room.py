"""The IF of a room: made once for a TDM cycle, and after that only what a person hides of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.scatter.clutter import Clutter
from rtradar.scatter.clutter_shadow import ClutterShadow, Hidden, smooth
from rtradar.signal import synthesize

_Samples = NDArray[np.complex128]


@njit(cache=True, error_model="numpy", parallel=True)
def _fade(kept, changed, share, tx, out):  # type: ignore[no-untyped-def]
    """Fill ``out (chirp, rx, sample)``: what is kept of the room, and the share of its change that has come."""
    for chirp in prange(len(out)):
        own, more, part = kept[tx[chirp]], changed[tx[chirp]], share[chirp]
        for receiver in range(out.shape[1]):
            for sample in range(out.shape[2]):
                out[chirp, receiver, sample] = own[receiver, sample] + part * more[receiver, sample]


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
    variant : {"auto", "llvm", "scalar", "cuda"}
        Mitsuba's backend.
    """

    def __init__(self, clutter: Clutter, body: Body | None = None, *, variant: str = "auto") -> None:
        self._radar = clutter.radar
        self._cycle = tuple(clutter.cycle())
        radar = self._radar
        self._whole: _Samples = np.zeros((radar.n_tx, radar.n_rx, radar.samples_per_chirp), dtype=np.complex128)
        for echoes in self._cycle:
            self._whole += self._synthesized(echoes)
        self._shadow = ClutterShadow(clutter, body, variant=variant) if body is not None and clutter.objects else None
        self._lost: dict[int, _Samples] = {}
        self._mirrored: dict[int, NDArray[np.complex64]] = {}

    @property
    def power_m2(self) -> float:
        """Mean power of the room's IF samples with nobody there [m^2]."""
        return float((np.abs(self._whole) ** 2).mean())

    def clutter_if(self, chirps: NDArray[np.int64]) -> NDArray[np.complex64]:
        """IF samples of the room at these chirps.

        Parameters
        ----------
        chirps : (chirp,) int64
            Numbered from the start of the capture, ascending.

        Returns
        -------
        (chirp, rx, sample) complex64
        """
        chirps = np.asarray(chirps, dtype=np.int64)
        tx = self._radar.tx_of_chirp(chirps)
        if self._shadow is None:
            return self._whole.astype(np.complex64)[tx]
        step = self._shadow.step
        out = np.empty((len(chirps), *self._whole.shape[1:]), dtype=np.complex64)
        anchors = chirps // step
        for anchor in np.unique(anchors).tolist():
            inside = np.flatnonzero(anchors == anchor)
            share = smooth(chirps[inside] - anchor * step, step)
            before = self._hidden(anchor)
            after = self._hidden(anchor + 1) if (share > 0).any() else before
            kept, changed = ((first - second).astype(np.complex64) for first, second in ((self._whole, before), (before, after)))
            _fade(kept, changed, share.astype(np.float32), tx[inside], out[inside[0] : inside[-1] + 1])
        return out

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
            self._lost = {key: value for key, value in self._lost.items() if key == anchor - 1} | {anchor: lost}
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
        for index, (first, last) in enumerate(zip(*np.searchsorted(echoes, [starts[:-1], starts[1:]]), strict=True)):
            if first == last:
                continue
            which, share, whole = echoes[first:last] - starts[index], change[..., first:last], self._cycle[index]
            if len(whole.part) == 1:
                lost += share * self._alone(index)
            else:
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

    def _alone(self, index: int) -> NDArray[np.complex64]:
        """IF of an object of one echo: of a mirror, which a person stands before again and again."""
        if index not in self._mirrored:
            self._mirrored[index] = self._synthesized(self._cycle[index])
        return self._mirrored[index]

    def _synthesized(self, echoes: Echoes) -> NDArray[np.complex64]:
        return np.asarray(synthesize(echoes, self._radar, self._radar.chirp_times(self._radar.n_tx), dtype=np.complex64))
