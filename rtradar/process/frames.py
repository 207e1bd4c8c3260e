"""The overlapping frames of a radar, cut from a stream of range spectra in constant memory."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

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
        self._candidate = 0  # frames are counted by multiples of the hop ...
        self._index = 0  # ... of which those that round to the same cycle are one frame
        self._last_start = -1
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
        while taken < len(block):
            taken += self._take(block[taken:])
            while (start := self._next_start()) is not None:
                offset = start * self._radar.n_tx - self._first
                view = self._buffer[offset : offset + self._radar.chirps_per_frame]
                cube = view.reshape(self._radar.cycles_per_frame, self._radar.n_tx, *view.shape[1:])
                cube.flags.writeable = False
                index = self._index
                self._index += 1
                yield index, start, cube
        self._busy = False

    def _take(self, block: NDArray[np.generic]) -> int:
        """Copy what fits of the block behind what is still needed; how many chirps it took."""
        # No later frame needs a chirp before this one.
        wanted = self._start_of(self._candidate) * self._radar.n_tx
        gone = min(max(wanted - self._first, 0), self._held)
        room = len(self._buffer) - self._held
        if self._held == gone:
            self._first, self._held = self._first + gone, 0
            # A hop longer than the frame leaves chirps unused.
            skip = min(max(wanted - self._first, 0), len(block))
            if skip:
                self._first += skip
                self.n_chirps += skip
                return skip
        elif room == 0:
            kept = self._held - gone
            # At most as many at once as it moves, for NumPy copies overlapping arrays twice.
            for begin in range(0, kept, gone):
                end = min(begin + gone, kept)
                _copy(self._buffer[begin + gone : end + gone], self._buffer[begin:end])
            self._first, self._held = self._first + gone, kept
        count = min(len(self._buffer) - self._held, len(block))
        _copy(block[:count], self._buffer[self._held : self._held + count])
        self._held += count
        self.n_chirps += count
        return count

    def _start_of(self, candidate: int) -> int:
        return round(candidate * self._radar.hop_cycles)

    def _next_start(self) -> int | None:
        """First cycle of the next frame if its last chirp is there, as in `Radar.window_starts`."""
        last = self.n_chirps // self._radar.n_tx - self._radar.cycles_per_frame
        newest = math.floor((last + 0.5) / self._radar.hop_cycles)
        while self._candidate <= newest and (start := self._start_of(self._candidate)) <= last:
            self._candidate += 1
            if start > self._last_start:
                self._last_start = start
                return start
        return None


def _copy(chirps: NDArray[np.generic], to: NDArray[np.complex64]) -> None:
    def some(first: int) -> None:
        to[first : first + _CHIRPS_AT_ONCE] = chirps[first : first + _CHIRPS_AT_ONCE]

    thread_map(some, range(0, len(chirps), _CHIRPS_AT_ONCE))
