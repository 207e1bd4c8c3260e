"""Who returned most of each detected cell of a range-Doppler map, and by which part.

Between the instants of the `EchoTable` the range of an echo is a cubic and its power a line. Each
echo puts its power on the map as the window functions spread a tone of that range: over the bins of
range that it passes, and over the Doppler bins of the time that it is in each. Of all that a cell
is given to the person with most of it, and to the part with most of that. Echoes over walls,
ghosts, belong to the person too. Powers are added up, so it does not matter how echoes interfere.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.cells import EchoesAtInstants, fields_in_bins, follow_echoes
from rtradar.pipeline.output.truth import EchoTable
from rtradar.pipeline.processing import CellSources
from rtradar.process import range_spectrum
from rtradar.process.power_maps import doppler_power
from rtradar.process.window_functions import WindowName, weights
from rtradar.system.threads import in_threads, thread_map

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


class Sources:
    """Who returned most of a detected cell, for the frames of one capture in order.

    Parts are those of all people, and then the objects, each a part of its own.
    """

    def __init__(self, table: EchoTable) -> None:
        self._table, self._capture = table, table.capture
        capture, radar = self._capture, self._capture.radar
        self._cycles = radar.cycles_per_frame
        objects = len(capture.body.names) + np.arange(len(capture.scene.objects))
        self._owner = np.append(capture.body.owner, objects)
        windows = capture.processing.window_functions
        self._doppler = weights(windows.doppler, self._cycles)
        # How a tone spreads over range bins, and how far it must be followed.
        self._spread, self._reach = _spread(windows.range, radar.samples_per_chirp)
        after = self._spread[len(self._spread) // 2 :] ** 2
        # Largest power from each bin after the tone on.
        self._falls = np.maximum.accumulate(after[::-1])[::-1][: _FINE * self._reach : _FINE]
        # Noise power in a cell of one channel, as rectangular window functions would leave it.
        noise = capture.noise.power / radar.samples_per_chirp / self._cycles
        self._weak_m2 = _WEAK * noise

    def of_cells(
        self, start_cycle: int, power: NDArray[np.floating], mask: NDArray[np.bool_]
    ) -> CellSources:
        """Return who returned each marked cell, and by which part.

        The frame begins at ``start_cycle``; ``power (range, velocity)`` is its map [m^2], and the
        cells are in the order of `numpy.nonzero`.
        """
        rows, columns = np.nonzero(mask)
        if not len(self._owner):
            return CellSources(np.full(len(rows), -1), np.full(len(rows), -1))
        of_parts = self.expected(start_cycle, rows, columns)
        # The parts of one owner are neighbours.
        # Sums over the parts of each person or object, then the largest of these.
        first_parts = np.flatnonzero(np.diff(self._owner, prepend=-1))
        of_owners = np.add.reduceat(of_parts, first_parts, axis=0)
        best, source = of_owners.max(axis=0), of_owners.argmax(axis=0)
        part = np.where(self._owner[:, None] == source, of_parts, -1.0).argmax(axis=0)
        # Nobody's where the room returns more, or where far more was received than anybody
        # explains.
        known = (best > self._still[rows, columns]) & (power[rows, columns] < _UNEXPECTED * best)
        return CellSources(np.where(known, source, -1), np.where(known, part, -1))

    def expected(
        self, start_cycle: int, rows: NDArray[np.int64], columns: NDArray[np.int64]
    ) -> Array:
        """Return the power (part, cell) that is expected of each part in some cells.

        It is that of a map (range, velocity), a sum over all channels [m^2], at these ``rows`` and
        ``columns (cell,)``.
        """
        radar, n_cycles = self._capture.radar, self._cycles
        looks, part = self._looks(start_cycle)
        n_echoes, n_parts = len(part), len(self._owner)
        # An echo to a column, as the transform takes it.
        steps = np.empty((n_cycles, n_echoes), dtype=np.int32)
        fields = np.empty((n_cycles, n_echoes), dtype=np.complex64)
        scales = 2 / radar.wavelength_m, _FINE / radar.range_bin_m
        in_threads(follow_echoes, n_cycles, start_cycle, looks, *scales, steps, fields)
        # As far as an echo is not weak.
        most_m2 = looks.power_m2.max(axis=0, initial=0.0)
        reach = _FINE * (self._falls * most_m2[:, None] > self._weak_m2).sum(axis=1)
        low, high = steps.min(axis=0) - reach, steps.max(axis=0) + reach
        # Only pairs of an echo and a range bin with detections in it count that the echo reaches.
        bins, bin_of_cell = np.unique(rows, return_inverse=True)
        asked = _FINE * bins
        echo, number = np.nonzero((asked >= low[:, None]) & (asked <= high[:, None]))
        # A spectrum for each part in each bin that it reaches, and one of nothing for the others.
        target = part[echo] * len(bins) + number
        order = np.argsort(target, kind="stable")
        echo, number = echo[order], number[order]
        reached, target = np.unique(target[order], return_inverse=True)
        found = np.zeros((n_cycles, len(reached) + 1))

        def spectra(first: int) -> tuple[NDArray[np.int64], Array]:
            some = slice(first, first + _AT_ONCE)
            # The field of each echo in its bin over slow time, and the Doppler spectrum of that.
            away = _FINE * (bins[number[some]] + self._reach)
            signal = np.empty((n_cycles, len(away)), dtype=np.complex64)
            fields_in_bins(echo[some], away, steps, fields, self._spread, signal)
            spectrum = doppler_power(signal[:, None], range(1), self._doppler, 1)
            # Echoes of one part in one bin follow each other, and their powers add up.
            targets, begin = np.unique(target[some], return_index=True)
            return targets, np.add.reduceat(spectrum, begin, axis=1)

        for targets, power_m2 in thread_map(spectra, range(0, len(echo), _AT_ONCE)):
            found[:, targets] += power_m2
        # Pairs that no echo reaches have the last column, which is nothing.
        place = np.full(n_parts * len(bins), len(reached))
        place[reached] = np.arange(len(reached))
        of_cells = place.reshape(n_parts, len(bins))[:, bin_of_cell]
        # The map begins at the most negative velocity.
        cycles = (columns - n_cycles // 2) % n_cycles
        return np.asarray(radar.n_channels * found[cycles, of_cells])

    def _looks(self, start_cycle: int) -> tuple[EchoesAtInstants, NDArray[np.int64]]:
        """The echoes at the instants of a frame that are not weak in it, and their parts."""
        at, looks = self._table.frame(start_cycle)
        radar, count = self._capture.radar, min(len(one.part) for one in looks)
        # More may come while they are asked for.
        range_m, rate_mps, power_m2 = (
            np.array([getattr(one, name)[:count] for one in looks], dtype=np.float64)
            for name in ("range_m", "rate_mps", "power_m2")
        )
        # What is beyond the last range is removed by the filter before the ADC.
        power_m2 = np.where(range_m < radar.max_range_m, power_m2, 0.0)
        kept = np.flatnonzero(power_m2.max(axis=0) > max(self._weak_m2, 0.0))
        # One layout and type, or Numba would compile for each that comes.
        own = (np.take(array, kept, axis=1) for array in (range_m, rate_mps, power_m2))
        return EchoesAtInstants(at, radar.cycle_duration_s, *own), looks[0].part[kept]

    @cached_property
    def _still(self) -> Array:
        """Power of the room in each cell, none where its clutter is removed [m^2]."""
        capture, radar = self._capture, self._capture.radar
        power = np.zeros((radar.samples_per_chirp, self._cycles))
        settings = capture.settings
        left = settings.clutter_removal == "none" and settings.background is None
        if capture.room is not None and left:
            samples = np.zeros((radar.n_tx, radar.n_rx, len(power)), np.complex64)
            capture.room.clutter.add(samples, np.arange(radar.n_tx))
            windows = capture.processing.window_functions
            # The room is the same in every cycle: its power in a bin lies about zero Doppler as the
            # window spreads it.
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
    # A spectrum with zeros padded is known at fractions of a bin. Its phase about the middle of the
    # chirp is taken out, which leaves it real for a symmetric window.
    spectrum = np.fft.fft(weights(window, n), _FINE * n) * np.exp(1j * np.pi * steps / _FINE)
    half = spectrum.real[: min(_FINE * n // 2, _FINE * _FARTHEST + 1)]
    # Whole bins up to the last side lobe that is high enough to count.
    reach = int(np.flatnonzero(half**2 > _LEAST)[-1]) // _FINE + 1
    half = np.append(half[: _FINE * reach], 0.0)
    return np.concatenate([half[:0:-1], half]).astype(np.float32), reach
