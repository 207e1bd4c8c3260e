"""Range-time map of a stream whose static clutter is removed, also by a method that works by windows."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.process.clutter import ClutterRemoval
from rtradar.process.power_maps import mean_power, range_time, range_time_steps, step_cycles
from rtradar.radar import Radar
from rtradar.system.threads import in_threads


class _Step(NamedTuple):
    """One step of the map: its centre [s], ``mean (channel, range)`` over its cycles, and the power (range,) about that mean."""

    time_s: float
    cycles: int
    mean: NDArray[np.complexfloating]
    spread: NDArray[np.floating]


class SlidingRangeTime:
    """`range_time` of a stream of chirps without its static clutter, in constant memory.

    A step of the map is far shorter than a processing window. Its own mean would take with it whatever moves slower than
    2 m/s or so. Removal by the mean therefore subtracts, channel by channel, the mean over one processing window about the
    step, which is what the range-Doppler map has subtracted there; at both ends of the capture the mean over its first or
    last window. Who stands still for the length of a window is removed with the clutter, in this map as in the others.

    With the mean a of a step and m of the window, the mean of abs(x - m)^2 over a step is that of abs(x - a)^2 plus
    abs(a - m)^2, so the steps of one window are kept instead of its chirps.

    Parameters
    ----------
    radar : Radar
        Gives the schedule.
    removal : ClutterRemoval
        The removal whose `ClutterRemoval.block` the spectra have passed.
    step_s : float
        Duration of one step [s], as of `range_time`.
    """

    def __init__(self, radar: Radar, removal: ClutterRemoval, *, step_s: float = 5e-3) -> None:
        self._radar, self._by_windows, self._step_s = radar, removal.works_by_windows, step_s
        self._steps = max(
            1, round(radar.cycles_per_frame / step_cycles(radar, step_s))
        )  # in a window
        self._window: deque[_Step] = deque()
        self._waiting: deque[_Step] = deque()  # steps of which not all of the window was there
        self._sum = np.zeros((radar.n_channels, radar.samples_per_chirp), np.complex128)
        self._cycles = 0  # in the window

    @property
    def window_cycles(self) -> int:
        """Cycles over which the mean is taken where the removal works by windows."""
        return self._steps * step_cycles(self._radar, self._step_s)

    def push(
        self, spectra: NDArray[np.complexfloating], first_chirp: int
    ) -> tuple[NDArray[np.floating], NDArray[np.float64]]:
        """Take the next chirps and give the steps that are complete.

        Parameters
        ----------
        spectra : (chirp, rx, range) complex
            Whole TDM cycles that follow those of the last call.
        first_chirp : int
            Number of the first of them in the capture.

        Returns
        -------
        power : (slow_time, range) float32 or float64
            Power [unit of the squared IF], averaged over channels and the cycles of the step.
        slow_time : (slow_time,) float64
            Centre of each step since the start of the capture [s].
        """
        if not self._by_windows:
            return range_time(spectra, self._radar, first_chirp=first_chirp, step_s=self._step_s)
        chirps, radar = np.asarray(spectra), self._radar
        bounds, times = range_time_steps(len(chirps), radar, first_chirp, self._step_s)

        def step(number: int) -> _Step:
            own = chirps[slice(*bounds[number])].reshape(-1, radar.n_channels, chirps.shape[2])
            mean = own.mean(axis=0)
            return _Step(float(times[number]), len(own), mean, mean_power(own - mean))

        ready = []
        for one in in_threads(step, range(len(bounds))):
            if len(self._window) == self._steps:
                oldest = self._window.popleft()
                self._sum -= oldest.cycles * oldest.mean
                self._cycles -= oldest.cycles
            self._window.append(one)
            self._waiting.append(one)
            self._sum += one.cycles * one.mean
            self._cycles += one.cycles
            if len(self._window) == self._steps:
                # Those in the middle of the window, and before it the first of the capture.
                ready += self._cleaned(len(self._waiting) - (self._steps - 1) // 2)
        return self._map(ready, chirps.real.dtype)

    def finish(self) -> tuple[NDArray[np.floating], NDArray[np.float64]]:
        """Give the steps at the end of the capture, from which the mean over its last window is taken; as of `push`."""
        return self._map(self._cleaned(len(self._waiting)), np.dtype(np.float32))

    def _cleaned(self, count: int) -> list[tuple[float, NDArray[np.floating]]]:
        """Time and power of the next steps that wait, by the mean of the window as it is now."""
        mean = self._sum / max(self._cycles, 1)
        steps = [self._waiting.popleft() for _ in range(count)]
        return [(step.time_s, step.spread + mean_power(step.mean - mean)) for step in steps]

    def _map(
        self, steps: list[tuple[float, NDArray[np.floating]]], kind: np.dtype[np.floating]
    ) -> tuple[NDArray[np.floating], NDArray[np.float64]]:
        power = np.array([power for _, power in steps], dtype=kind).reshape(
            len(steps), self._radar.samples_per_chirp
        )
        return power, np.array([time for time, _ in steps], dtype=np.float64)
