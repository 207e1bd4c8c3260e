"""Range-time maps: power over slow time and range, also of a stream without its static clutter."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.process.clutter import ClutterRemoval
from rtradar.radar import Radar
from rtradar.system.threads import thread_map

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
    places = radar.slots_of(first_chirp + begins) + (ends - begins) / 2
    centres = places * radar.chirp_interval_s
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
        if not self._by_frames:
            return range_time(spectra, self._radar, first_chirp=first_chirp, step_s=self._step_s)
        chirps, radar = np.asarray(spectra), self._radar
        bounds, times = _steps(len(chirps), radar, first_chirp, self._step_s)

        def step(number: int) -> _Step:
            own = chirps[slice(*bounds[number])].reshape(-1, radar.n_channels, chirps.shape[2])
            mean = own.mean(axis=0)
            return _Step(float(times[number]), len(own), mean, _mean_power(own - mean))

        ready = []
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
