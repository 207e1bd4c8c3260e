"""One window as it was received, kept beside those from which static clutter has been removed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar


class ReceivedWindow:
    """Collects the chirps of one processing window from a stream.

    Parameters
    ----------
    radar : Radar
    start_cycle : int
        First TDM cycle of the window.
    """

    def __init__(self, radar: Radar, start_cycle: int) -> None:
        self.start_cycle = start_cycle
        self._first, self._radar = start_cycle * radar.n_tx, radar
        self._pieces: list[NDArray[np.complexfloating]] = []

    def push(
        self, spectra: NDArray[np.complexfloating], first: int
    ) -> NDArray[np.complexfloating] | None:
        """Take what belongs to the window of the next chirps; the cube (cycle, tx, rx, range) once, when it is whole."""
        last = self._first + self._radar.chirps_per_frame
        begin, end = max(self._first, first), min(last, first + len(spectra))
        if begin >= end:
            return None
        self._pieces.append(spectra[begin - first : end - first].copy())
        if end < last:
            return None
        cube = np.concatenate(self._pieces)
        self._pieces = []
        return cube.reshape(self._radar.cycles_per_frame, self._radar.n_tx, *cube.shape[1:])
