"""One table of echoes, thinned in time: what cells, pictures and the truth of a run are read from.

Echoes are looked at some eight times in a frame and in its middle, for one Tx and all Rx together,
while the signal is made. Each is there with its part, path, range, range rate and power; of frames
that are over only the middles are kept that are shown.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.pipeline.capture import Capture

_INSTANTS = 8
"""Times in a frame at which echoes are looked at, beside its middle."""

_LOOKS_AHEAD = 8
"""Times that are looked at with those that are needed, because a call has its price."""

_RATE_CYCLES = 2
"""Cycles before and after such a time, over which range rates are taken."""

MAX_SHOWN, SHOWN_HZ = 400, 40.0
"""Largest number of frames whose middle is kept, those of 10 s, and of these in a second; of longer
captures fewer frames are kept."""

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Look(NamedTuple):
    """Echoes (echo,) at one time [s].

    ``part``, ``path`` and ``bounces`` are those of `Echoes`. The range [m] and the range rate [m/s]
    are means over the receivers, weighted by power, the power [m^2] is a mean; an echo that is
    occluded has power 0, and range and rate all the same.
    """

    time_s: float
    part: Indices
    path: Indices
    bounces: Indices
    range_m: Array
    rate_mps: Array
    power_m2: Array


class EchoTable:
    """The echoes of one capture at the instants of its frames, which are asked for in order.

    Unless ``middles`` are asked for, echoes are not looked at in the middle of a frame.
    """

    def __init__(self, capture: Capture, *, middles: bool = True) -> None:
        self.capture, self._middles, radar = capture, middles, capture.radar
        self._cycles = radar.cycles_per_frame
        self._every = max(1, self._cycles // _INSTANTS)
        self._middle_tx = int(
            np.linalg.norm(radar.tx - np.asarray(radar.position_m), axis=1).argmin()
        )
        self._kept: dict[int, Look] = {}
        self._shown: dict[int, Look] = {}
        self._starts_shown = set(capture.frame_starts[self.shown_frames].tolist())

    @property
    def shown_frames(self) -> Indices:
        """Numbers of the evenly chosen frames whose middle is kept."""
        radar, starts = self.capture.radar, self.capture.frame_starts
        hop_s = radar.frame_hop_s
        if len(starts) > 1:
            hop_s = radar.frame_period_s or float(np.diff(starts).mean()) * radar.cycle_duration_s
        every = max(math.ceil(len(starts) / MAX_SHOWN), math.ceil(1 / (SHOWN_HZ * hop_s) - 1e-6))
        return np.arange(0, len(starts), every)

    def frame(self, start_cycle: int) -> tuple[Indices, list[Look]]:
        """Return the cycles about a frame at which echoes are looked at, and the looks."""
        at = self._instants(start_cycle)
        return at, self._looks(start_cycle, at)

    def middle(self, start_cycle: int) -> Look:
        """Return the look at the middle of a frame."""
        if start_cycle in self._shown:
            return self._shown[start_cycle]
        (look,) = self._looks(start_cycle, np.array([self._middle(start_cycle)]))
        if start_cycle in self._starts_shown:
            self._shown[start_cycle] = look
        return look

    def shown(self) -> list[Look]:
        """Return the middles of `shown_frames`."""
        starts = self.capture.frame_starts[self.shown_frames].tolist()
        return [self.middle(start) for start in starts]

    def _middle(self, start_cycle: int) -> int:
        return start_cycle + self._cycles // 2

    def _instants(self, start_cycle: int) -> Indices:
        """Cycles about a frame at which echoes are looked at; past a gap there is nothing."""
        end, every = start_cycle + self._cycles, self._every
        if self.capture.radar.in_frames:
            return np.append(np.arange(start_cycle, max(end - 1, start_cycle + 1), every), end - 1)
        return np.arange(start_cycle // every, (end - 1) // every + 2) * every

    def _looks(self, start_cycle: int, numbers: Indices) -> list[Look]:
        """Echoes at some cycles about a frame, found once for all frames."""
        missing = [number for number in numbers.tolist() if number not in self._kept]
        if missing:
            first = int(self._instants(start_cycle)[0])
            self._kept = {n: look for n, look in self._kept.items() if n >= first}
            wanted = sorted({*missing, *self._ahead(start_cycle)} - self._kept.keys())
            self._kept |= zip(wanted, self._look(np.array(wanted)), strict=True)
        return [self._kept[number] for number in numbers.tolist()]

    def _ahead(self, start_cycle: int) -> set[int]:
        """Return the cycles at which this frame and the next ones are looked at."""
        starts, found = self.capture.frame_starts, set[int]()
        most = _LOOKS_AHEAD + _INSTANTS
        for start in starts[np.searchsorted(starts, start_cycle) :].tolist():
            found.update(self._instants(start).tolist())
            if self._middles:
                found.add(self._middle(start))
            if len(found) >= most:
                break
        return found

    def _look(self, numbers: Indices) -> list[Look]:
        capture, radar = self.capture, self.capture.radar
        cycles = numbers[:, None] + [-_RATE_CYCLES, _RATE_CYCLES]
        cycles = np.clip(cycles, 0, capture.n_chirps // radar.n_tx - 1)
        if radar.in_frames:
            first = numbers[:, None] - numbers[:, None] % self._cycles
            cycles = np.clip(cycles, first, first + self._cycles - 1)
        wanted = (cycles * radar.n_tx + self._middle_tx).astype(np.int64)
        chirps, where = np.unique(wanted, return_inverse=True)
        echoes = capture.model.echoes(chirps)
        # (number, before and after, rx, echo)
        where = where.reshape(cycles.shape)
        power = (np.abs(echoes.amplitude) ** 2).mean(axis=0)[where]
        length = echoes.length[where]
        # A receiver that has an echo at one time only knows no rate.
        both = np.sqrt(power[:, 0] * power[:, 1])
        weight = np.where(both.any(axis=1, keepdims=True), both, 1.0)
        weight /= weight.sum(axis=1, keepdims=True)
        before, after = ((weight * length[:, side]).sum(axis=1) for side in (0, 1))
        apart_s = np.diff(cycles, axis=1) * radar.cycle_duration_s
        rate = np.divide(after - before, 2 * apart_s, out=np.zeros_like(before), where=apart_s > 0)
        # At the ends of the capture the times are not in the middle of both cycles.
        late_s = (numbers - cycles.mean(axis=1)) * radar.cycle_duration_s
        range_m = (before + after) / 4 + rate * late_s[:, None]
        middles = radar.centres_of(chirps)[where].mean(axis=1)
        owned = echoes.part, echoes.path, echoes.bounces
        return [
            Look(float(time_s), *owned, *arrays)
            for time_s, *arrays in zip(
                middles + late_s, range_m, rate, both.mean(axis=1), strict=True
            )
        ]
