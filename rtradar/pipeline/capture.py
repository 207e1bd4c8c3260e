"""Capture of a moving person by a radar in a scene, streamed as range spectra."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from rtradar.body import Body, Person
from rtradar.description import table_of
from rtradar.echoes import Echoes
from rtradar.pipeline.processing import Processing, block_chirps
from rtradar.pipeline.timing import Stages
from rtradar.radar import Radar
from rtradar.scatter import EchoModel
from rtradar.scatter.link_budget import LinkBudget
from rtradar.scatter.people_and_objects import PeopleAndObjects
from rtradar.scene import Scene
from rtradar.settings import RunSettings
from rtradar.signal import Noise, receive, synthesize
from rtradar.signal.clutter import RoomIf
from rtradar.signal.ghosts import AHEAD, GhostIf
from rtradar.signal.multiplexing import chirps_together
from rtradar.signal.receiver import ReceiverStage
from rtradar.system.files import uninterruptible
from rtradar.system.threads import one_blas_thread


class SpectraSink(Protocol):
    """What range spectra are streamed to, at most ``max_chirps`` at a time."""

    max_chirps: int

    def push(self, spectra: NDArray[np.complex64], first: int) -> None:
        """Process range spectra (chirp, rx, range) of whole TDM cycles from chirp ``first`` on.

        The next call gets its spectra in the same array.
        """


class PreparedRoom(NamedTuple):
    """The IF samples of a room, and those of ghosts that are approximated, if any are.

    ``summary`` is what was kept and dropped, for JSON.
    """

    clutter: RoomIf
    ghosts: GhostIf | None
    summary: dict[str, Any]


@dataclass(frozen=True)
class Capture:
    """Everything that `prepare` settles before the first echo is computed.

    ``people`` are the scene's own and those who were given, ``body`` is all of them at their
    places, and ``processing`` has the radar at its position in the scene.
    ``model`` includes the paths over walls if the scene has any; ``room`` is the room, or None.
    ``summed`` is the model of the echoes that are summed at every chirp: all but ghosts that the
    room approximates. ``link_budget`` is that of the people's parts, with the limits of all else.
    ``n_chirps`` are whole TDM cycles, ``frame_starts`` (frame,) the first cycle of each frame,
    ``noise`` is that of the IF samples, and ``receiver`` what else their receiver adds.
    """

    people: tuple[Person, ...]
    scene: Scene
    processing: Processing
    body: Body
    model: PeopleAndObjects
    summed: EchoModel
    room: PreparedRoom | None
    link_budget: LinkBudget
    noise: Noise
    receiver: ReceiverStage | None
    n_chirps: int
    frame_starts: NDArray[np.int64]

    @property
    def radar(self) -> Radar:
        """Radar at its position in the scene."""
        return self.processing.radar

    @property
    def settings(self) -> RunSettings:
        """Settings of the run."""
        return self.processing.settings

    @property
    def motion(self) -> str:
        """Names of the motions, or that there is nobody."""
        return " and ".join(self.body.names) or "nobody"

    @property
    def stages(self) -> Stages:
        """Record of the time that each stage takes."""
        return self.processing.stages

    @property
    def title(self) -> str:
        """Title of pictures and of the progress bar."""
        names = [self.motion, self.radar.name, self.settings.fidelity]
        return ", ".join(names + ([self.scene.name] if self.room else []))

    def described(self) -> dict[str, Any]:
        """Return the tables of the run, see `rtradar.description.table_of`."""
        return table_of(self.people, self.radar, self.scene, self.settings)

    def stream(self, sink: SpectraSink, kept: Any = None, *, progress: bool = True) -> None:
        """Compute echoes in blocks of chirps, and from them IF samples, noise and range spectra.

        The sink receives the range spectra. The array ``kept`` (chirp, rx, sample), if there is
        one, receives the IF samples with noise; with DDM it has one chirp for each cycle.
        """
        most = block_chirps(self.radar)
        # The blocks of an array on disk are its chunks.
        at_once = most if kept is not None else min(sink.max_chirps, most)
        # Range spectra fill one array again and again; the sink is done with them before the next
        # block.
        range_spectra = self.processing.range_spectra(at_once)
        for first, received in self.received(at_once, progress=progress):
            if kept is not None:
                # Zarr makes folders as it writes, which must not be after they were removed.
                with self.stages.time("write"), uninterruptible():
                    begin = first // chirps_together(self.radar)
                    kept[begin : begin + len(received)] = received
            sink.push(range_spectra(received, first), first)

    def received(
        self, at_once: int, *, progress: bool = True
    ) -> Iterator[tuple[int, NDArray[np.complex64]]]:
        """Compute echoes in blocks of chirps, and from them IF samples (chirp, rx, sample).

        Yields the first chirp of at most ``at_once`` and their samples with noise; the next may
        come in the same array. With DDM there is one row for each cycle.
        """
        radar, stages, most = self.radar, self.stages, block_chirps(self.radar)
        clutter, ghosts = (self.room.clutter, self.room.ghosts) if self.room else (None, None)
        # The largest array but for the frames. Allocated anew for each block, it would now and then
        # find no hole in the heap.
        samples_of = np.empty((at_once, radar.n_rx, radar.samples_per_chirp), np.complex64)

        @one_blas_thread()
        def if_samples(echoes: Echoes, first: int) -> NDArray[np.complex64]:
            n = len(echoes.tx)
            samples, chirps = samples_of[:n], np.arange(first, first + n)

            # What moves comes first: a tone for each echo that is summed exactly, and the ghosts
            # over walls that are interpolated between keyframes in time.
            with stages.time("signal"):
                times = radar.chirp_times(n, first)
                synthesize(echoes, radar, times, dtype=np.complex64, out=samples)
                if ghosts is not None:
                    ghosts.add(samples, chirps)
            # The phase noise that is left in an echo depends on its delay. Moving echoes share the
            # phase noise of their mean delay, so they are turned before the room is added: its
            # echoes have delays of their own.
            phases = None
            if self.receiver is not None:
                with stages.time("receiver"):
                    phases = self.receiver.phases(echoes, first)
                    self.receiver.turn_moving(samples, phases)
            # Of the static room the samples are known, less what people occlude of it now.
            if clutter is not None:
                with stages.time("clutter"):
                    clutter.add(samples, chirps)
            if self.receiver is not None:
                with stages.time("receiver"):
                    self.receiver.transmit(samples, phases, first)
            # Thermal noise belongs to a receiver and not to a pair of Tx and Rx: under DDM it comes
            # after the sum over all Tx.
            with stages.time("noise"):
                received = receive(samples, radar, first)
                self.noise.add(received, radar, first)
            if self.receiver is not None:
                with stages.time("receiver"):
                    self.receiver.receive(received, first)
            return received

        # A function of its own: names that a loop binds would keep echoes alive while the next
        # block is computed.
        def block(chirps: NDArray[np.int64]) -> Iterator[tuple[int, NDArray[np.complex64]]]:
            # The shadow in the clutter is computed in another thread while the echoes are traced.
            with stages.time("scatter"), one_blas_thread():
                if clutter is not None:
                    clutter.begin(chirps)
                echoes = self.summed.echoes(chirps)
                if ghosts is not None:
                    ghosts.compute(chirps, AHEAD)
            for begin in range(0, len(chirps), at_once):
                first = int(chirps[begin])
                yield first, if_samples(chirps_of(echoes, begin, begin + at_once), first)

        silent = None if progress else True  # None: silent where there is no terminal
        blocks = range(0, self.n_chirps, most)
        for first in tqdm(blocks, desc=self.title, unit="block", disable=silent):
            yield from block(np.arange(first, min(first + most, self.n_chirps)))


def chirps_of(echoes: Echoes, begin: int, end: int) -> Echoes:
    """Return the echoes of some chirps of a block."""
    chirps = slice(begin, end)
    length, amplitude = echoes.length[chirps], echoes.amplitude[:, chirps]
    return dataclasses.replace(echoes, length=length, amplitude=amplitude, tx=echoes.tx[chirps])
