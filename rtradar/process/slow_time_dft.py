"""Power over Doppler of channel after channel: the DFT over slow time where the number of cycles is a product of coprime factors.

FFT libraries are made for small prime factors. A window of 100 ms has 133 = 7 x 19 or 666 = 18 x 37 cycles here, and what they
do about 19 and 37 takes most of their time. By the prime-factor algorithm (Good 1958) such a DFT is one of either length in turn,
without twiddle factors between; each of these is small enough for plain sums, over half the terms, for cosines are even and
sines odd. Range bins stand side by side in vector lanes; weights go in where samples are read, and power comes out where sums
are done, so that no spectrum is ever written.
"""

from __future__ import annotations

from functools import lru_cache
from math import gcd
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.compiled import compiled, taken_in

_LARGEST = 40
"""Factor: plain sums grow with its square."""

_COLUMNS = 64
"""Range bins side by side: of two factors' worth of rows this many stay in the cache of a core."""

_TERMS = 5
"""Added at once, so that sums are read and written back a fifth as often."""


class SlowTimeDft(NamedTuple):
    """Tables of a DFT over as many cycles as there are in ``cycle_at``.

    Parameters
    ----------
    cycle_at, bin_at : (place,) int64
        Which cycle stands at each place of the grid (first, second) of the factors, and which Doppler bin afterwards.
    cosines, sines : pair of (frequency, term) float32
        Of each factor: frequencies and terms 0 to half of it, and without those of which the sine is 0; filled up with zeros to a
        multiple of `_TERMS`.
    factors : pair of int
    """

    cycle_at: NDArray[np.int64]
    bin_at: NDArray[np.int64]
    cosines: tuple[NDArray[np.float32], NDArray[np.float32]]
    sines: tuple[NDArray[np.float32], NDArray[np.float32]]
    factors: tuple[int, int]

    @property
    def multiply_adds(self) -> int:
        """Of one transform: those of the sums, real and imaginary parts."""
        squares = [(factor // 2 + 1) ** 2 + ((factor - 1) // 2) ** 2 for factor in self.factors]
        return 2 * sum(len(self.cycle_at) // factor * count for factor, count in zip(self.factors, squares, strict=True))


@lru_cache(maxsize=8)
def slow_time_dft(n_cycles: int) -> SlowTimeDft | None:
    """The tables for so many cycles, or None where they have no two coprime factors small enough.

    Parameters
    ----------
    n_cycles : int

    Returns
    -------
    SlowTimeDft or None
    """
    pairs = [(n_cycles // second, second) for second in range(2, _LARGEST + 1) if n_cycles % second == 0]
    # The least sum is the least work.
    allowed = [(sum(pair), pair) for pair in pairs if 2 <= pair[0] < pair[1] and max(pair) <= _LARGEST and gcd(*pair) == 1]
    if not allowed:
        return None
    first, second = min(allowed)[1]
    i, j = np.divmod(np.arange(n_cycles), second)
    # Cycles by Ruritania's map and bins by the Chinese remainder theorem: their product then has no mixed term.
    cycle_at = (i * second + j * first) % n_cycles
    bin_at = (i * second * pow(second, -1, first) + j * first * pow(first, -1, second)) % n_cycles
    (cosines_1, sines_1), (cosines_2, sines_2) = _tables(first), _tables(second)
    return SlowTimeDft(cycle_at, bin_at, (cosines_1, cosines_2), (sines_1, sines_2), (first, second))


def _tables(factor: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    even, odd = np.arange(factor // 2 + 1), np.arange(1, (factor + 1) // 2)
    cosines, sines = np.cos(2 * np.pi * np.outer(even, even) / factor), np.sin(2 * np.pi * np.outer(odd, odd) / factor)
    filled = [np.pad(table, ((0, 0), (0, -table.shape[1] % _TERMS))) for table in (cosines, sines)]
    return filled[0].astype(np.float32), filled[1].astype(np.float32)


def add_doppler_power(
    spectra: NDArray[np.complex64], weights: NDArray[np.float32], dft: SlowTimeDft, power: NDArray[np.float32]
) -> None:
    """Add the squared magnitudes of weighted DFTs over the cycles of some channels.

    Parameters
    ----------
    spectra : (cycle, channel, range) complex64
        Of any strides.
    weights : (cycle,) float32
        Of the cycles.
    dft : SlowTimeDft
        Of as many cycles.
    power : (doppler, range) float32
        Added to, in the order of the DFT.
    """
    (cosines_1, cosines_2), (sines_1, sines_2) = dft.cosines, dft.sines
    # What may be written to and what may not are two types to Numba, each with code of its own.
    spectra = spectra.view()
    spectra.flags.writeable = False
    _add_power(spectra, weights, dft.cycle_at, dft.bin_at, *dft.factors, cosines_1, sines_1, cosines_2, sines_2, power)


@taken_in(fastmath={"contract"})
def _fold(grid, first, step, factor, even, odd):  # type: ignore[no-untyped-def]
    """Sums and differences of the rows at the same distance from both ends; real parts stand in the left half of a row.

    Differences are multiplied by -j, which the sine has before it.
    """
    columns = grid.shape[1] // 2
    for c in range(2 * columns):
        even[0, c] = grid[first, c]
    for term in range(1, (factor + 1) // 2):
        near, far = first + term * step, first + (factor - term) * step
        for c in range(2 * columns):
            even[term, c] = grid[near, c] + grid[far, c]
        for c in range(columns):
            odd[term - 1, c] = grid[near, columns + c] - grid[far, columns + c]
        for c in range(columns):
            odd[term - 1, columns + c] = grid[far, c] - grid[near, c]
    if factor % 2 == 0:
        for c in range(2 * columns):
            even[factor // 2, c] = grid[first + factor // 2 * step, c]


@taken_in(fastmath={"contract"})
def _combine(table, frequency, rows, out):  # type: ignore[no-untyped-def]
    """Fill ``out (column,)``: the sum of rows, times what the table has for this frequency."""
    t = table[frequency]
    for k in range(0, len(t), _TERMS):
        t0, t1, t2, t3, t4 = t[k], t[k + 1], t[k + 2], t[k + 3], t[k + 4]
        if k == 0:
            for c in range(len(out)):
                out[c] = t0 * rows[k, c] + t1 * rows[k + 1, c] + t2 * rows[k + 2, c] + t3 * rows[k + 3, c] + t4 * rows[k + 4, c]
        else:
            for c in range(len(out)):
                out[c] += t0 * rows[k, c] + t1 * rows[k + 1, c] + t2 * rows[k + 2, c] + t3 * rows[k + 3, c] + t4 * rows[k + 4, c]


@taken_in(fastmath={"contract"})
def _add_squares(cosine_part, sine_part, sign, total):  # type: ignore[no-untyped-def]
    """Add squared magnitudes of cosine part plus ``sign`` times sine part to ``total (column,)``."""
    columns = len(cosine_part) // 2
    for c in range(len(total)):
        real = cosine_part[c] + sign * sine_part[c]
        imaginary = cosine_part[columns + c] + sign * sine_part[columns + c]
        total[c] += real * real + imaginary * imaginary


_PLUS, _MINUS = np.float32(1), np.float32(-1)


@compiled(fastmath={"contract"})
def _add_power(  # type: ignore[no-untyped-def]
    spectra, weights, cycle_at, bin_at, n_1, n_2, cosines_1, sines_1, cosines_2, sines_2, power
):
    cycles, channels, n_range = spectra.shape
    # Made here, for then the compiler knows that they do not overlap.
    grid = np.empty((cycles, 2 * _COLUMNS), dtype=np.float32)
    even, odd = np.empty((_LARGEST, 2 * _COLUMNS), dtype=np.float32), np.empty((_LARGEST, 2 * _COLUMNS), dtype=np.float32)
    cosine_part, sine_part = np.empty(2 * _COLUMNS, dtype=np.float32), np.empty(2 * _COLUMNS, dtype=np.float32)
    grid[:] = 0
    for channel in range(channels):
        for begin in range(0, n_range, _COLUMNS):
            end = min(begin + _COLUMNS, n_range)
            for place in range(cycles):
                weight = weights[cycle_at[place]]
                samples = spectra[cycle_at[place], channel, begin:end]
                for c in range(end - begin):
                    grid[place, c] = samples[c].real * weight
                    grid[place, _COLUMNS + c] = samples[c].imag * weight
            for last in (False, True):
                # First along the second factor, whose places are neighbours, then along the first.
                factor, step = (n_1, n_2) if last else (n_2, 1)
                cosines, sines = (cosines_1, sines_1) if last else (cosines_2, sines_2)
                odd_terms = (factor - 1) // 2
                even[factor // 2 + 1 :] = 0
                odd[odd_terms:] = 0
                for line in range(cycles // factor):
                    first = line if last else line * n_2
                    _fold(grid, first, step, factor, even, odd)
                    for frequency in range(factor // 2 + 1):
                        _combine(cosines, frequency, even, cosine_part)
                        paired = 1 <= frequency <= odd_terms
                        if paired:
                            _combine(sines, frequency - 1, odd, sine_part)
                        else:
                            sine_part[:] = 0
                        low, high = first + frequency * step, first + (factor - frequency) * step
                        if last:
                            _add_squares(cosine_part, sine_part, _PLUS, power[bin_at[low], begin:end])
                            if paired:
                                _add_squares(cosine_part, sine_part, _MINUS, power[bin_at[high], begin:end])
                        else:
                            for c in range(2 * _COLUMNS):
                                grid[low, c] = cosine_part[c] + sine_part[c]
                            if paired:
                                for c in range(2 * _COLUMNS):
                                    grid[high, c] = cosine_part[c] - sine_part[c]
