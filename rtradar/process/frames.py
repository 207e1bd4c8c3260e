"""What is made of a stream of range spectra in constant memory: frames and range-time maps."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.process.clutter import ClutterRemoval
from rtradar.process.spectra import checked_chirps
from rtradar.radar import Radar
from rtradar.system.threads import thread_map

_Frame = tuple[int, int, NDArray[np.complex64]]
"""Index, first cycle and cube of a frame."""

_CHIRPS_AT_ONCE = 256
"""Chirps that one task of a thread copies: 4 MB of 8 receivers and 256 samples."""


class SlidingWindows:
    """The frames of a stream of chirps, however the stream is cut into blocks.

    The frames are those of `Radar.window_starts` for as many chirps as were pushed. The buffer
    holds one and a quarter frames, whatever the size of the blocks: with the quarter, what is kept
    moves to its front at most once for every quarter of a frame of new chirps.

    Parameters
    ----------
    radar : Radar
        Radar that gives the schedule and the shape.

    Attributes
    ----------
    n_chirps : int
        Chirps pushed so far.
    """

    def __init__(self, radar: Radar) -> None:
        self._radar = radar
        frame = radar.chirps_per_frame
        chirps = frame + max(2 * radar.n_tx, frame // 4)
        shape = (chirps, radar.n_rx, radar.samples_per_chirp)
        self._buffer = np.empty(shape, np.complex64)
        self._first = 0  # chirp at the front of the buffer
        self._held = 0  # chirps in the buffer
        self._index = 0  # of the next frame
        self._busy = False
        self.n_chirps = 0

    def push(self, spectra: NDArray[np.complexfloating]) -> Iterator[_Frame]:
        """Take the next block of chirps and give every frame that it completes.

        Parameters
        ----------
        spectra : (chirp, rx, range) complex
            Range spectra of the chirps that follow those of the last call, from `range_spectrum`;
            the first chirp of all comes from Tx 0.

        Yields
        ------
        window_index : int
            Number of the frame in the capture, from 0.
        start_cycle : int
            First TDM cycle of the frame.
        cube : (cycle, tx, rx, range) complex64
            Read-only view of the buffer, valid until the next step of the iteration.

        Raises
        ------
        InputError
            Where the shape does not fit the radar.
        RuntimeError
            Where the frames of the last call were not all taken: the block is read meanwhile.
        """
        block = checked_chirps("SlidingWindows: spectra", spectra, self._radar)
        if self._busy:
            raise RuntimeError("SlidingWindows: take every window of one push before the next push")
        self._busy = True
        return self._frames(block)

    def _frames(self, block: NDArray[np.generic]) -> Iterator[_Frame]:
        taken = 0
        # A block may be longer than the buffer: some of it is taken, then all frames that are whole
        # are given, and so on.
        while taken < len(block):
            taken += self._take(block[taken:])
            while (start := self._next_start()) is not None:
                offset = start * self._radar.n_tx - self._first
                view = self._buffer[offset : offset + self._radar.chirps_per_frame]
                cube = view.reshape(self._radar.cycles_per_frame, self._radar.n_tx, *view.shape[1:])
                # Frames overlap in the buffer: who wrote into one would change the next.
                cube.flags.writeable = False
                self._index += 1
                yield self._index - 1, start, cube
        self._busy = False

    def _take(self, block: NDArray[np.generic]) -> int:
        """Copy what fits of the block behind what is still needed; how many chirps it took."""
        # No later frame needs a chirp before this one.
        wanted = self._start_of(self._index) * self._radar.n_tx
        gone = min(max(wanted - self._first, 0), self._held)
        room = len(self._buffer) - self._held
        # Nothing that is held is needed any more: the buffer begins anew.
        if self._held == gone:
            self._first, self._held = self._first + gone, 0
            # A hop longer than the frame leaves chirps unused.
            skip = min(max(wanted - self._first, 0), len(block))
            if skip:
                self._first += skip
                self.n_chirps += skip
                return skip
        # The buffer is full: what is still needed moves to its front.
        elif room == 0:
            kept = self._held - gone
            # At most as many at once as it moves, because NumPy copies overlapping arrays twice.
            for begin in range(0, kept, gone):
                end = min(begin + gone, kept)
                _copy(self._buffer[begin + gone : end + gone], self._buffer[begin:end])
            self._first, self._held = self._first + gone, kept
        count = min(len(self._buffer) - self._held, len(block))
        _copy(block[:count], self._buffer[self._held : self._held + count])
        self._held += count
        self.n_chirps += count
        return count

    def _start_of(self, index: int) -> int:
        return round(index * self._radar.hop_cycles)

    def _next_start(self) -> int | None:
        """First cycle of the next frame if its last chirp is there, as in `Radar.window_starts`."""
        # Starts are multiples of the hop, rounded to whole cycles. A hop has a cycle or more, so no
        # two of them round to the same.
        last = self.n_chirps // self._radar.n_tx - self._radar.cycles_per_frame
        newest = math.floor((last + 0.5) / self._radar.hop_cycles)
        start = self._start_of(self._index)
        return start if self._index <= newest and start <= last else None


def _copy(chirps: NDArray[np.generic], to: NDArray[np.complex64]) -> None:
    def some(first: int) -> None:
        to[first : first + _CHIRPS_AT_ONCE] = chirps[first : first + _CHIRPS_AT_ONCE]

    thread_map(some, range(0, len(chirps), _CHIRPS_AT_ONCE))


# -- range-time maps ------------------------------------------------------------------------------

_Map = tuple[NDArray[np.floating], NDArray[np.float64]]
"""Power (slow_time, range) and the centres of its steps (slow_time,) [s]."""


def range_time(
    spectra: NDArray[np.complexfloating],
    radar: Radar,
    *,
    first_chirp: int = 0,
    step_s: float = 5e-3,
) -> _Map:
    """Power over slow time and range, averaged over channels and over whole TDM cycles.

    Parameters
    ----------
    spectra : (chirp, rx, range) complex
        Spectra from `range_spectrum`; the first chirp comes from Tx 0.
    radar : Radar
        Radar that gives the schedule.
    first_chirp : int
        Number of the first chirp in the capture.
    step_s : float
        Duration of each average, at least one cycle [s]. The last may be shorter.

    Returns
    -------
    power : (slow_time, range) float32 or float64
        Power of each range bin, in the unit of the squared IF.
    slow_time : (slow_time,) float64
        Centre of each average since the start of the capture [s].

    Raises
    ------
    InputError
        Where the shape does not fit the radar.
    """
    chirps = np.asarray(spectra)
    if chirps.ndim != 3 or chirps.shape[1] != radar.n_rx:
        raise InputError(
            f"range_time: spectra have shape {chirps.shape}; radar '{radar.name}' needs "
            f"(chirp, {radar.n_rx}, range)"
        )
    together = radar.n_tx if radar.multiplexing == "ddm" else 1  # Tx in every row
    # Each step is a task of its own. Under DDM each row holds the sum of all Tx, so the mean is
    # that of so many of them.
    bounds, times = _steps(len(chirps), radar, first_chirp, step_s)
    power = thread_map(
        lambda step: _mean_power(chirps[slice(*bounds[step])]) / together, range(len(bounds))
    )
    return np.array(power, dtype=chirps.real.dtype).reshape(len(power), chirps.shape[2]), times


def _step_cycles(radar: Radar, step_s: float) -> int:
    return max(1, round(step_s / radar.cycle_duration_s))


def _steps(
    n_chirps: int, radar: Radar, first_chirp: int, step_s: float
) -> tuple[list[tuple[int, int]], NDArray[np.float64]]:
    """First chirp of each step and the one after its last, and centres of the steps (step,) [s]."""
    rows = _step_cycles(radar, step_s) * radar.n_tx
    begins = np.arange(0, n_chirps, rows)
    ends = np.minimum(begins + rows, n_chirps)
    last = radar.slots_of(first_chirp + ends - 1) + (radar.n_tx if radar.at_once else 1)
    places = radar.slots_of(first_chirp + begins) + last
    centres = places / 2 * radar.chirp_interval_s
    return list(zip(begins.tolist(), ends.tolist(), strict=True)), centres


def _mean_power(values: NDArray[np.complexfloating]) -> NDArray[np.floating]:
    """Squared magnitude of ``values (..., range)``, averaged over all axes but the last."""
    # Row by row, so that squares of a whole block are never stored.
    parts = np.ascontiguousarray(values).view(values.real.dtype).reshape(-1, 2 * values.shape[-1])
    return np.asarray(np.einsum("ri,ri->i", parts, parts).reshape(-1, 2).sum(axis=1) / len(parts))


class _Step(NamedTuple):
    """Centre [s] of one step, its ``mean (channel, range)``, and the power (range,) about it."""

    time_s: float
    cycles: int
    mean: NDArray[np.complexfloating]
    spread: NDArray[np.floating]


class SlidingRangeTime:
    """`range_time` of a stream of chirps without its static clutter, in constant memory.

    A step of the map is far shorter than a processing frame. The mean of a step would contain
    whatever moves slower than 2 m/s or so. Removal by the mean therefore subtracts, channel by
    channel, the mean over one frame about the step, as the range-Doppler map does; at both ends of
    the capture it subtracts the mean over the first or last frame. A person who does not move
    during a frame is removed with the clutter, in this map as in the others.

    With the mean a of a step and m of the frame, the mean of abs(x - m)^2 over a step is that of
    abs(x - a)^2 plus abs(a - m)^2, so the steps of one frame are kept instead of its chirps.

    Parameters
    ----------
    radar : Radar
        Radar that gives the schedule.
    removal : ClutterRemoval
        Removal whose `ClutterRemoval.block` the spectra have passed.
    step_s : float
        Duration of one step [s].
    """

    def __init__(self, radar: Radar, removal: ClutterRemoval, *, step_s: float = 5e-3) -> None:
        self._radar, self._by_frames, self._step_s = radar, removal.works_by_windows, step_s
        # Steps in a frame.
        steps = radar.cycles_per_frame / _step_cycles(radar, step_s)
        self._steps = math.ceil(steps) if radar.in_frames else max(1, round(steps))
        self._frame: deque[_Step] = deque()
        self._waiting: deque[_Step] = deque()  # steps whose frame is not complete yet
        self._sum = np.zeros((radar.n_channels, radar.samples_per_chirp), np.complex128)
        self._cycles = 0  # in the frame

    @property
    def window_cycles(self) -> int:
        """Cycles over which the mean is taken where the removal works by frames."""
        return self._steps * _step_cycles(self._radar, self._step_s)

    def push(self, spectra: NDArray[np.complexfloating], first_chirp: int) -> _Map:
        """Take the next chirps and give the steps that are complete.

        Parameters
        ----------
        spectra : (chirp, rx, range) complex
            Whole TDM cycles that follow those of the last call.
        first_chirp : int
            Number of the first chirp in the capture.

        Returns
        -------
        power : (slow_time, range) float32 or float64
            Power [unit of the squared IF], averaged over channels and the cycles of the step.
        slow_time : (slow_time,) float64
            Centre of each step since the start of the capture [s].
        """
        # Where clutter was removed from the stream itself, steps are averaged at once; removal
        # frame by frame waits for the frame about a step.
        if not self._by_frames:
            return range_time(spectra, self._radar, first_chirp=first_chirp, step_s=self._step_s)
        chirps, radar = np.asarray(spectra), self._radar
        bounds, times = _steps(len(chirps), radar, first_chirp, self._step_s)

        def step(number: int) -> _Step:
            own = chirps[slice(*bounds[number])].reshape(-1, radar.n_channels, chirps.shape[2])
            mean = own.mean(axis=0)
            return _Step(float(times[number]), len(own), mean, _mean_power(own - mean))

        ready = []
        # The steps of one frame, with a running sum of their means: the oldest goes as the next one
        # comes.
        for one in thread_map(step, range(len(bounds))):
            if len(self._frame) == self._steps:
                oldest = self._frame.popleft()
                self._sum -= oldest.cycles * oldest.mean
                self._cycles -= oldest.cycles
            self._frame.append(one)
            self._waiting.append(one)
            self._sum += one.cycles * one.mean
            self._cycles += one.cycles
            if len(self._frame) == self._steps:
                # Those in the middle of the frame, and at first all before it.
                ready += self._cleaned(len(self._waiting) - (self._steps - 1) // 2)
        return self._map(ready, chirps.real.dtype)

    def finish(self) -> _Map:
        """Give the last steps of the capture, less the mean over its last frame; see `push`."""
        return self._map(self._cleaned(len(self._waiting)), np.dtype(np.float32))

    def _cleaned(self, count: int) -> list[tuple[float, NDArray[np.floating]]]:
        """Time and power of the next steps that wait, less the mean of the current frame."""
        mean = self._sum / max(self._cycles, 1)
        steps = [self._waiting.popleft() for _ in range(count)]
        return [(step.time_s, step.spread + _mean_power(step.mean - mean)) for step in steps]

    def _map(
        self, steps: list[tuple[float, NDArray[np.floating]]], kind: np.dtype[np.floating]
    ) -> _Map:
        shape = len(steps), self._radar.samples_per_chirp
        power = np.array([power for _, power in steps], dtype=kind).reshape(shape)
        return power, np.array([time for time, _ in steps], dtype=np.float64)
