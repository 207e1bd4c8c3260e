"""Capture of a moving person by a radar in a scene, streamed as range spectra."""

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
from rtradar.pipeline.processing import Processing
from rtradar.pipeline.timing import Stages
from rtradar.process import range_spectrum
from rtradar.radar import Radar
from rtradar.scatter import EchoModel
from rtradar.scatter.link_budget import LinkBudget
from rtradar.scene import Scene
from rtradar.settings import RunSettings
from rtradar.signal import Noise, receive, separate, synthesize
from rtradar.system.files import uninterruptible


class SpectraSink(Protocol):
    """What range spectra are streamed to, at most ``max_chirps`` at a time."""

    max_chirps: int

    def push(self, spectra: NDArray[np.complex64], first: int) -> None:
        """Process range spectra (chirp, rx, range) of whole TDM cycles from chirp ``first`` on.

        The next call gets its spectra in the same array.
        """


@dataclass(frozen=True)
class Capture:
    """Everything that `prepare` settles before the first echo is computed.

    Parameters
    ----------
    motion : str
        Name of the recording.
    scene : Scene
        Scene around the person.
    settings : RunSettings
        Settings of the run.
    processing : Processing
        Radar at its position in the scene, and what its range spectra go through.
    body : Body
        Person at their position in the scene.
    model : EchoModel
        Echo model of the person, and of the paths over walls if the scene has any.
    inside : Indoors, optional
        Room, if the scene has one.
    survey : LinkBudget
        Link budget of the person's parts.
    warned : tuple of str
        Warnings of the link budget.
    noise : Noise
        Noise of the IF samples.
    n_chirps : int
        Number of chirps, in whole TDM cycles.
    frame_starts : (frame,) int64
        First cycle of each frame.
    warmup_s : float
        Time until everything was compiled or loaded [s].
    """

    motion: str
    scene: Scene
    settings: RunSettings
    processing: Processing
    body: Body
    model: EchoModel
    inside: Indoors | None
    survey: LinkBudget
    warned: tuple[str, ...]
    noise: Noise
    n_chirps: int
    frame_starts: NDArray[np.int64]
    warmup_s: float

    @property
    def radar(self) -> Radar:
        """Radar at its position in the scene."""
        return self.processing.radar

    @property
    def stages(self) -> Stages:
        """Record of the time that each stage takes."""
        return self.processing.stages

    @property
    def title(self) -> str:
        """Title of pictures and of the progress bar."""
        names = [self.motion, self.radar.name, self.settings.fidelity]
        return ", ".join(names + ([self.scene.name] if self.inside else []))

    @property
    def block_chirps(self) -> int:
        """Number of chirps whose echoes are computed together: a hop of the frames, or a frame."""
        return min(math.ceil(self.radar.hop_cycles), self.radar.cycles_per_frame) * self.radar.n_tx

    def stream(self, sink: SpectraSink, kept: Any = None, *, progress: bool = True) -> None:
        """Compute echoes in blocks of chirps, and from them IF samples, noise and range spectra.

        Parameters
        ----------
        sink : SpectraSink
            Object that receives the range spectra.
        kept : array-like, optional
            Array (chirp, rx, sample) that receives the IF samples with noise; with DDM it has one
            chirp for each cycle.
        progress : bool
            Whether a progress bar is shown on a terminal.
        """
        radar, stages = self.radar, self.stages
        room = self.inside.room if self.inside else None
        # The blocks of an array on disk are its chunks.
        at_once = self.block_chirps if kept is not None else min(sink.max_chirps, self.block_chirps)

        # The largest arrays but for the frames. Allocated anew for each block, they would now and
        # then find no hole in the heap.
        shape = at_once, radar.n_rx, radar.samples_per_chirp
        samples_of, spectra_of = np.empty(shape, np.complex64), np.empty(shape, np.complex64)

        def range_spectra(echoes: Echoes, first: int) -> NDArray[np.complex64]:
            n = len(echoes.tx)
            with stages.time("signal"):
                times = radar.chirp_times(n, first)
                samples = synthesize(echoes, radar, times, dtype=np.complex64, out=samples_of[:n])
            if room is not None:
                with stages.time("clutter"):
                    room.add(samples, np.arange(first, first + n))
            with stages.time("noise"):
                received = receive(samples, radar, first)
                self.noise.add(received, radar, first)
            if kept is not None:
                # Zarr makes folders as it writes, which must not be after they were removed.
                with stages.time("write"), uninterruptible():
                    begin = first * len(received) // n
                    kept[begin : begin + len(received)] = received
            with stages.time("range"):
                return range_spectrum(
                    separate(received, radar, first),
                    radar,
                    window_functions=self.processing.window_functions,
                    out=spectra_of[:n],
                )

        # A function of its own: names that a loop binds would keep echoes alive while the next
        # block is computed.
        def stream_block(chirps: NDArray[np.int64]) -> None:
            with stages.time("scatter"):
                echoes = self.model.echoes(chirps)
            for begin in range(0, len(chirps), at_once):
                first = int(chirps[begin])
                sink.push(range_spectra(chirps_of(echoes, begin, begin + at_once), first), first)

        silent = None if progress else True  # None: silent where there is no terminal
        blocks = range(0, self.n_chirps, self.block_chirps)
        for first in tqdm(blocks, desc=self.title, unit="block", disable=silent):
            stream_block(np.arange(first, min(first + self.block_chirps, self.n_chirps)))


def chirps_of(echoes: Echoes, begin: int, end: int) -> Echoes:
    """Return the echoes of some chirps of a block."""
    chirps = slice(begin, end)
    return dataclasses.replace(
        echoes,
        length=echoes.length[chirps],
        amplitude=echoes.amplitude[:, chirps],
        tx=echoes.tx[chirps],
    )
