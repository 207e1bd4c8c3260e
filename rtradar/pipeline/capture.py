"""A person before a radar in a scene, streamed as range spectra to whatever makes something of them."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.pipeline.indoors import Indoors
from rtradar.pipeline.timing import Stages
from rtradar.process import ClutterRemoval, Detector, WindowFunctions, range_spectrum
from rtradar.radar import Radar
from rtradar.scatter import EchoModel
from rtradar.scatter.link_budget import LinkBudget
from rtradar.signal import Noise, receive, separate, synthesize
from rtradar.system.files import uninterruptible


class Taker(Protocol):
    """What range spectra are streamed to: `take` gets ``piece`` chirps at a time."""

    piece: int

    def take(self, spectra: NDArray[np.complex64], first: int) -> None:
        """Range spectra (chirp, rx, range) from chirp ``first`` on; whole TDM cycles. The next come in the same array."""


@dataclass(frozen=True)
class Capture:
    """What `prepare` gives.

    Parameters
    ----------
    radar : Radar
        Where it stands in the scene.
    body : Body
        Where it moves in the scene.
    model : EchoModel
    inside : Indoors, optional
        The room, where the scene has one.
    survey : LinkBudget
    warned : tuple of str
        What the survey warned of.
    noise : Noise
    n_chirps : int
        Whole cycles of the capture.
    windows : (window,) int64
        First cycle of each processing window.
    removal : ClutterRemoval
        Filter that removes static clutter before Doppler.
    detect : Detector
        Detector that marks the cells of a map.
    window_functions : WindowFunctions
        Window functions in fast and in slow time.
    title : str
        For pictures and progress.
    stages : Stages
        Where the time goes.
    warmup_s : float
        Seconds until all was compiled or loaded.
    """

    radar: Radar
    body: Body
    model: EchoModel
    inside: Indoors | None
    survey: LinkBudget
    warned: tuple[str, ...]
    noise: Noise
    n_chirps: int
    windows: NDArray[np.int64]
    removal: ClutterRemoval
    detect: Detector
    window_functions: WindowFunctions
    title: str
    stages: Stages
    warmup_s: float

    @property
    def block(self) -> int:
        """Chirps whose echoes are made at once: a hop of the windows, but no more than one of them holds."""
        return min(math.ceil(self.radar.hop_cycles), self.radar.cycles_per_frame) * self.radar.n_tx

    def stream(self, taker: Taker, kept: Any = None, *, progress: bool = True) -> None:
        """Echoes `block` chirps at a time, and from them IF samples, noise and range spectra by smaller pieces.

        Parameters
        ----------
        taker : Taker
            Gets the range spectra.
        kept : array-like, optional
            Gets the IF samples as received (chirp, rx, sample), `block` chirps at a time; under DDM those of a cycle are one.
        progress : bool
            Whether a bar is shown, on a terminal.
        """
        radar, stages, noise = self.radar, self.stages, self.noise
        room = self.inside.room if self.inside else None
        piece = taker.piece if kept is None else self.block  # which is a chunk of the array

        # The largest arrays there are but for the windows: made anew for each piece, now and then they find no hole in the heap.
        shape = min(piece, self.block), radar.n_rx, radar.samples_per_chirp
        made, transformed = np.empty(shape, dtype=np.complex64), np.empty(shape, dtype=np.complex64)

        def spectra(echoes: Echoes, first: int) -> NDArray[np.complex64]:
            n, times = len(echoes.tx), radar.chirp_times(len(echoes.tx), first)
            with stages.time("signal"):
                samples = synthesize(echoes, radar, times, dtype=np.complex64, out=made[:n])
            if room is not None:
                with stages.time("clutter"):
                    room.add(samples, np.arange(first, first + len(samples)))
            with stages.time("noise"):
                received = receive(samples, radar, first)
                noise.add(received, radar, first)
            if kept is not None:
                # Its folders are made as they are needed, which must not be after they have been removed.
                with stages.time("write"), uninterruptible():
                    begin = first * len(received) // len(samples)
                    kept[begin : begin + len(received)] = received
            with stages.time("range"):
                apart = separate(received, radar, first)
                return range_spectrum(
                    apart, radar, window_functions=self.window_functions, out=transformed[:n]
                )

        def take(chirps: NDArray[np.int64]) -> None:
            with stages.time("scatter"):
                echoes = self.model.echoes(chirps)
            for begin in range(0, len(chirps), piece):
                taker.take(
                    spectra(chirps_of(echoes, begin, begin + piece), int(chirps[begin])),
                    int(chirps[begin]),
                )

        # In functions, for what a loop leaves bound would still be held while the next block is made.
        silent = None if progress else True  # None: where there is no terminal
        for first in tqdm(
            range(0, self.n_chirps, self.block), desc=self.title, unit="block", disable=silent
        ):
            take(np.arange(first, min(first + self.block, self.n_chirps)))


def chirps_of(echoes: Echoes, begin: int, end: int) -> Echoes:
    """Those of some chirps of the block."""
    chirps = slice(begin, end)
    return dataclasses.replace(
        echoes,
        length=echoes.length[chirps],
        amplitude=echoes.amplitude[:, chirps],
        tx=echoes.tx[chirps],
    )
