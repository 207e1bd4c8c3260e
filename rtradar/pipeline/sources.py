"""Who returned most of each detected cell of a range-Doppler map.

The echoes of everyone and of every object are looked at some eight times in a frame, for one Tx and
all Rx together. In between the range is a cubic and the power a line. Each echo puts its power on
the map as the window functions spread a tone of that range: over the bins of range that it passes,
and over the Doppler bins of the time that it is in each. Of all that a cell is given to the person
with most of it. Echoes over walls, ghosts, belong to the person too. Powers are added up, so it
does not matter how echoes interfere.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.expected_echoes import Looks, fields_in_bins, follow_echoes
from rtradar.pipeline.capture import Capture
from rtradar.process import range_spectrum
from rtradar.process.power_maps import doppler_power
from rtradar.process.window_functions import WindowName, weights
from rtradar.system.threads import in_threads, thread_map

_INSTANTS = 8
"""Times in a frame at which echoes are looked at."""

_LOOKS_AHEAD = 8
"""Times that are looked at with those that are needed, because a call has its price."""

_RATE_CYCLES = 2
"""Cycles before and after such a time, over which range rates are taken."""

_WEAK = 0.1
"""Echoes with less power than this fraction of the noise of a cell are left out."""

_FINE, _LEAST, _FARTHEST = 512, 1e-5, 32
"""Steps of a bin in which the spectrum of a range window is known; the power over that of its peak
down to which it is followed, and the most bins for that. As an echo goes on from step to step, its
field jumps, which puts some power on all velocities: less than noise only if steps are fine."""

_UNEXPECTED = 10.0
"""A cell with so many times the power of what is expected in it of anybody is nobody's: noise, the
room's or a shadow's. Echoes that interfere make less of a difference."""

_AT_ONCE = 2048

Array = NDArray[np.float64]


class _Echoes(NamedTuple):
    """Echoes (echo,) at one time: range [m], range rate [m/s], mean power [m^2], and owner."""

    range_m: Array
    rate_mps: Array
    power_m2: Array
    owner: NDArray[np.int64]


class Sources:
    """Who returned most of a detected cell, for the frames of one capture in order."""

    def __init__(self, capture: Capture) -> None:
        self._capture, radar = capture, capture.radar
        self._cycles = radar.cycles_per_frame
        self._every = max(1, self._cycles // _INSTANTS)
        windows = capture.processing.window_functions
        self._doppler = weights(windows.doppler, self._cycles)
        self._spread, self._reach = _spread(windows.range, radar.samples_per_chirp)
        after = self._spread[len(self._spread) // 2 :] ** 2
        # Largest power from each bin after the tone on.
        self._falls = np.maximum.accumulate(after[::-1])[::-1][: _FINE * self._reach : _FINE]
        noise = capture.noise.power / radar.samples_per_chirp / self._cycles
        self._weak_m2 = _WEAK * noise
        self._kept: dict[int, _Echoes] = {}

    def of_cells(
        self, start_cycle: int, power: NDArray[np.floating], mask: NDArray[np.bool_]
    ) -> NDArray[np.int64]:
        """Return the index of the person or object for each marked cell, -1 for the room or nobody.

        Objects come after all people. The frame begins at ``start_cycle``; ``power (range,
        velocity)`` is its map [m^2], and the cells are in the order of `numpy.nonzero`.
        """
        rows, columns = np.nonzero(mask)
        expected = self.expected(start_cycle, np.unique(rows))[:, rows, columns]
        best = expected.max(axis=0)
        known = (best > self._still[rows, columns]) & (power[rows, columns] < _UNEXPECTED * best)
        return np.where(known, expected.argmax(axis=0), -1)

    def expected(self, start_cycle: int, rows: NDArray[np.int64]) -> Array:
        """Map (person and object, range, velocity) that is expected of each of them.

        Powers are those of a map, sums over all channels [m^2]; only these ``rows`` of range bins
        are filled.
        """
        radar, n_cycles = self._capture.radar, self._cycles
        looks, owner = self._looks(start_cycle)
        n_echoes = len(owner)
        # An echo to a column, as the transform takes it.
        steps = np.empty((n_cycles, n_echoes), dtype=np.int32)
        fields = np.empty((n_cycles, n_echoes), dtype=np.complex64)
        scales = 2 / radar.wavelength_m, _FINE / radar.range_bin_m
        in_threads(follow_echoes, n_cycles, start_cycle, looks, *scales, steps, fields)
        # As far as an echo is not weak.
        most_m2 = looks.power_m2.max(axis=0, initial=0.0)
        reach = _FINE * (self._falls * most_m2[:, None] > self._weak_m2).sum(axis=1)
        low, high = steps.min(axis=0) - reach, steps.max(axis=0) + reach
        asked = _FINE * rows
        echo, row = np.nonzero((asked >= low[:, None]) & (asked <= high[:, None]))
        n_owners = len(self._capture.body.names) + len(self._capture.scene.objects)
        found = np.zeros((n_cycles, n_owners * radar.samples_per_chirp))
        target = owner[echo] * radar.samples_per_chirp + rows[row]
        order = np.argsort(target, kind="stable")
        echo, row, target = echo[order], row[order], target[order]

        def spectra(first: int) -> tuple[NDArray[np.int64], Array]:
            own, bins = echo[first : first + _AT_ONCE], rows[row[first : first + _AT_ONCE]]
            away = _FINE * (bins + self._reach)
            signal = np.empty((n_cycles, len(own)), dtype=np.complex64)
            fields_in_bins(own, away, steps, fields, self._spread, signal)
            spectrum = doppler_power(signal[:, None], range(1), self._doppler, 1)
            targets, begin = np.unique(target[first : first + _AT_ONCE], return_index=True)
            return targets, np.add.reduceat(spectrum, begin, axis=1)

        for targets, power_m2 in thread_map(spectra, range(0, len(echo), _AT_ONCE)):
            found[:, targets] += power_m2
        maps = found.T.reshape(n_owners, radar.samples_per_chirp, n_cycles)
        return np.asarray(radar.n_channels * np.fft.fftshift(maps, axes=2))

    def _looks(self, start_cycle: int) -> tuple[Looks, NDArray[np.int64]]:
        """The echoes at the instants of a frame that are not weak in it, and their owners."""
        at = self._instants(start_cycle)
        seen = self._seen(at)
        count = min(len(one.owner) for one in seen)  # more may come while they are asked for
        range_m, rate_mps, power_m2 = (
            np.array([array[:count] for array in column], dtype=np.float64)
            for column in list(zip(*seen, strict=True))[:3]
        )
        kept = np.flatnonzero(power_m2.max(axis=0) > max(self._weak_m2, 0.0))
        # One layout and type, or Numba would compile for each that comes.
        own = (np.take(array, kept, axis=1) for array in (range_m, rate_mps, power_m2))
        return Looks(at, self._capture.radar.cycle_duration_s, *own), seen[0].owner[kept]

    def _instants(self, start_cycle: int) -> NDArray[np.int64]:
        """Cycles about a frame at which echoes are looked at; past a gap there is nothing."""
        end, every = start_cycle + self._cycles, self._every
        if self._capture.radar.in_frames:
            return np.append(np.arange(start_cycle, max(end - 1, start_cycle + 1), every), end - 1)
        return np.arange(start_cycle // every, (end - 1) // every + 2) * every

    def _seen(self, numbers: NDArray[np.int64]) -> list[_Echoes]:
        """Echoes at these cycles, found once for all frames."""
        for old in [number for number in self._kept if number < numbers[0]]:
            del self._kept[old]
        missing = [number for number in numbers.tolist() if number not in self._kept]
        if missing:
            missing += self._ahead(missing[-1])
            self._kept |= zip(missing, self._look(np.array(missing)), strict=True)
        return [self._kept[number] for number in numbers.tolist()]

    def _ahead(self, number: int) -> list[int]:
        """Return the cycles after this one at which the next frames will be looked at."""
        radar, every = self._capture.radar, self._every
        if radar.in_frames:
            return []
        last = (self._capture.n_chirps // radar.n_tx - 1) // every + 1
        return list(
            range(number + every, min(number // every + _LOOKS_AHEAD, last) * every + 1, every)
        )

    def _look(self, numbers: NDArray[np.int64]) -> list[_Echoes]:
        capture, radar = self._capture, self._capture.radar
        cycles = numbers[:, None] + [-_RATE_CYCLES, _RATE_CYCLES]
        cycles = np.clip(cycles, 0, capture.n_chirps // radar.n_tx - 1)
        if radar.in_frames:
            first = numbers[:, None] - numbers[:, None] % self._cycles
            cycles = np.clip(cycles, first, first + self._cycles - 1)
        middle = int(np.linalg.norm(radar.tx - np.asarray(radar.position_m), axis=1).argmin())
        chirps, where = np.unique(cycles * radar.n_tx + middle, return_inverse=True)
        echoes = capture.model.echoes(chirps.astype(np.int64))
        # (number, before and after, rx, echo)
        where = where.reshape(cycles.shape)
        power = (np.abs(echoes.amplitude) ** 2).mean(axis=0)[where]
        length = echoes.length[where]
        # A receiver that has an echo at one time only knows no rate.
        both = np.sqrt(power[:, 0] * power[:, 1])
        total = np.maximum(both.sum(axis=1), np.finfo(np.float64).tiny)
        before, after = ((both * length[:, side]).sum(axis=1) / total for side in (0, 1))
        apart_s = np.diff(cycles, axis=1) * radar.cycle_duration_s
        rate = np.divide(after - before, 2 * apart_s, out=np.zeros_like(before), where=apart_s > 0)
        # At the ends of the capture the times are not in the middle of both cycles.
        late_s = (numbers - cycles.mean(axis=1)) * radar.cycle_duration_s
        range_m = (before + after) / 4 + rate * late_s[:, None]
        mean = np.where(range_m < radar.max_range_m, both.mean(axis=1), 0.0)
        # Objects come after all people.
        objects = len(capture.body.names) + np.arange(len(capture.scene.objects))
        owner = np.append(capture.body.owner, objects)[echoes.part]
        return [_Echoes(*arrays, owner) for arrays in zip(range_m, rate, mean, strict=True)]

    @cached_property
    def _still(self) -> Array:
        """Power of the room in each cell, none where its clutter is removed [m^2]."""
        capture, radar = self._capture, self._capture.radar
        power = np.zeros((radar.samples_per_chirp, self._cycles))
        if capture.inside is not None and capture.settings.clutter_removal == "none":
            samples = np.zeros((radar.n_tx, radar.n_rx, len(power)), np.complex64)
            capture.inside.room.add(samples, np.arange(radar.n_tx))
            windows = capture.processing.window_functions
            spectra = range_spectrum(samples, radar, window_functions=windows)
            by_range = (np.abs(spectra.astype(np.complex128)) ** 2).sum(axis=(0, 1))
            power += by_range[:, None] * np.fft.fftshift(np.abs(np.fft.fft(self._doppler)) ** 2)
        return power


def _spread(window: WindowName, n: int) -> tuple[NDArray[np.float32], int]:
    """Field of a tone of 1 in the bins so far before and after it, and how far that is [bin].

    Steps are fractions of a bin, (2 _FINE reach + 1,), the first and last one 0. The phase is that
    about the middle of the sweep, whose frequency range rates are measured at.
    """
    steps = np.arange(_FINE * n)
    spectrum = np.fft.fft(weights(window, n), _FINE * n) * np.exp(1j * np.pi * steps / _FINE)
    half = spectrum.real[: min(_FINE * n // 2, _FINE * _FARTHEST + 1)]
    reach = int(np.flatnonzero(half**2 > _LEAST)[-1]) // _FINE + 1
    half = np.append(half[: _FINE * reach], 0.0)
    return np.concatenate([half[:0:-1], half]).astype(np.float32), reach
