"""The IF of a room: made once for a TDM cycle, and after that only what a person hides of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.scatter.clutter import Clutter
from rtradar.scatter.clutter_shadow import ClutterShadow, Shares, smooth
from rtradar.signal import synthesize

_Samples = NDArray[np.complex128]


class RoomIf:
    """IF samples of static clutter, with the moving shadow of a body in it.

    The IF of the whole room is that of one TDM cycle, the same in all of them. At anchors 10 ms apart the IF of what the body
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
            if before is after:
                out[inside] = (self._whole - before)[tx[inside]]
            else:
                kept, changed = self._whole - before, after - before
                out[inside] = kept[tx[inside]] - share[:, None, None] * changed[tx[inside]]
        return out

    def _hidden(self, anchor: int) -> _Samples:
        """IF of one cycle of what the body hides at an anchor, (tx, rx, sample)."""
        if anchor not in self._lost:
            assert self._shadow is not None
            shares = self._shadow.hidden(anchor)
            lost, then = np.zeros_like(self._whole), tuple(np.zeros_like(share) for share in shares)
            if anchor - 1 in self._lost and any(share.any() for share in shares):
                lost, then = self._lost[anchor - 1], self._shadow.hidden(anchor - 1)
            lost = self._changed(lost, then, shares)
            self._lost = {key: value for key, value in self._lost.items() if key == anchor - 1} | {anchor: lost}
        return self._lost[anchor]

    def _changed(self, lost: _Samples, before: Shares, after: Shares) -> _Samples:
        changed = lost
        for echoes, old, new in zip(self._cycle, before, after, strict=True):
            which = (old != new).any(axis=(0, 1))
            if which.any():
                share = new[..., which].astype(np.float64) - old[..., which]
                changed = changed + self._synthesized(
                    replace(
                        echoes,
                        length=echoes.length[..., which],
                        amplitude=echoes.amplitude[..., which] * share,
                        part=echoes.part[which],
                        bounces=echoes.bounces[which],
                    )
                )
        return changed

    def _synthesized(self, echoes: Echoes) -> _Samples:
        return np.asarray(synthesize(echoes, self._radar, self._radar.chirp_times(self._radar.n_tx)), dtype=np.complex128)
