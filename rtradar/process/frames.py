"""The overlapping frames of a radar, cut from a stream of range spectra in constant memory."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rtradar.process.spectra import checked_chirps
from rtradar.radar import Radar

_Frame = tuple[int, int, NDArray[np.complex64]]
"""Index, first cycle and cube of a frame."""


class SlidingWindows:
    """The frames of a stream of chirps, however the stream is cut into blocks.

    The frames are those of `Radar.window_starts` for as many chirps as were pushed. At most two and
    a half frames are in memory, whatever the size of the blocks: one that is given, and the chirps
    that later ones need.

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
        shape = (radar.chirps_per_frame, radar.n_rx, radar.samples_per_chirp)
        self._frame = np.empty(shape, np.complex64)
        self._at_once = -(-radar.chirps_per_frame // 4)
        # Chirps that are needed, in pieces, with the number of the first of each.
        self._held: deque[tuple[int, NDArray[np.complex64]]] = deque()
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
            Read-only array, valid until the next step of the iteration.

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
        for begin in range(0, len(block), self._at_once):
            piece = block[begin : begin + self._at_once]
            self._held.append((self.n_chirps, np.array(piece, np.complex64)))
            self.n_chirps += len(piece)
            while (start := self._next_start()) is not None:
                self._index += 1
                yield self._index - 1, start, self._cube(start)
            # No later frame needs a chirp before this one.
            wanted = self._start_of(self._candidate) * self._radar.n_tx
            while self._held and self._held[0][0] + len(self._held[0][1]) <= wanted:
                self._held.popleft()
        self._busy = False

    def _cube(self, start: int) -> NDArray[np.complex64]:
        """Copy the chirps of a frame beside each other, (cycle, tx, rx, range)."""
        begin = start * self._radar.n_tx
        for number, piece in self._held:
            first, last = max(number, begin), min(number + len(piece), begin + len(self._frame))
            if first < last:
                self._frame[first - begin : last - begin] = piece[first - number : last - number]
        cube = self._frame.reshape(-1, self._radar.n_tx, *self._frame.shape[1:])
        cube.flags.writeable = False
        return cube

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
