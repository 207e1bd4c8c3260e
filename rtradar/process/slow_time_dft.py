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

from rtradar.compiled import compiled, on_cache_lines, taken_in

_LARGEST = 40
"""Factor: plain sums grow with its square."""

_COLUMNS = 256
"""Range bins side by side, at most: each cycle's lie together in memory, and of all cycles these stay in the cache of a core."""

_LANES = 16
"""Of which their number is a multiple."""

_TERMS = 5
"""Added at once, so that sums are read and written back a fifth as often."""


class SlowTimeDft(NamedTuple):
    """Tables of a DFT over as many cycles as there are in ``cycle_at``.

    Parameters
    ----------
    cycle_at, bin_at : (place,) int64
        Which cycle stands at each place of the grid (first, second) of the factors, and which Doppler bin afterwards.
    cosines, sines : pair of (frequency, term) float32
        Of each factor: frequencies and terms 0 to half of it, the latter without those of which the sine is 0; filled up with
        zeros to an even number of frequencies and a multiple of `_TERMS`.
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
    frequencies, odd = np.arange(factor // 2 + 1), np.arange(1, (factor + 1) // 2)
    cosines = np.cos(2 * np.pi * np.outer(frequencies, frequencies) / factor)
    sines = np.sin(2 * np.pi * np.outer(frequencies, odd) / factor)
    return _filled(cosines), _filled(sines)


def _filled(table: NDArray[np.float64]) -> NDArray[np.float32]:
    frequencies, terms = table.shape
    whole = max(1, -(-terms // _TERMS)) * _TERMS  # a factor of two has no sines
    return np.pad(table, ((0, frequencies % 2), (0, whole - terms))).astype(np.float32)


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
def _fold(grid, row, first, step, factor, even, odd):  # type: ignore[no-untyped-def]
    """Sums of rows at the same distance from both ends, and differences, times -j, which the sine has before it."""
    half = row // 2
    own, out = grid[first * row : (first + 1) * row], even[:row]
    for c in range(row):
        out[c] = own[c]
    for term in range(1, (factor + 1) // 2):
        at, mirrored = first + term * step, first + (factor - term) * step
        near, far = grid[at * row : (at + 1) * row], grid[mirrored * row : (mirrored + 1) * row]
        out = even[term * row : (term + 1) * row]
        for c in range(row):
            out[c] = near[c] + far[c]
        out, other = odd[(term - 1) * row : term * row - half], odd[term * row - half : term * row]
        near_re, near_im, far_re, far_im = near[:half], near[half:], far[:half], far[half:]
        for c in range(half):
            out[c] = near_im[c] - far_im[c]
        for c in range(half):
            other[c] = far_re[c] - near_re[c]
    if factor % 2 == 0:
        at, last = first + factor // 2 * step, factor // 2
        own, out = grid[at * row : (at + 1) * row], even[last * row : (last + 1) * row]
        for c in range(row):
            out[c] = own[c]


@taken_in(fastmath={"contract"})
def _combine(table, frequency, row, rows, out):  # type: ignore[no-untyped-def]
    """Fill ``out (2 * row,)`` for this frequency and the next: the sum of rows, times what the table has for them."""
    t, u = table[frequency], table[frequency + 1]
    one, two = out[:row], out[row:]
    for k in range(0, len(t), _TERMS):
        t0, t1, t2, t3, t4 = t[k], t[k + 1], t[k + 2], t[k + 3], t[k + 4]
        u0, u1, u2, u3, u4 = u[k], u[k + 1], u[k + 2], u[k + 3], u[k + 4]
        r0, r1, r2 = rows[k * row : (k + 1) * row], rows[(k + 1) * row : (k + 2) * row], rows[(k + 2) * row : (k + 3) * row]
        r3, r4 = rows[(k + 3) * row : (k + 4) * row], rows[(k + 4) * row : (k + 5) * row]
        if k == 0:
            for c in range(row):
                one[c] = t0 * r0[c] + t1 * r1[c] + t2 * r2[c] + t3 * r3[c] + t4 * r4[c]
                two[c] = u0 * r0[c] + u1 * r1[c] + u2 * r2[c] + u3 * r3[c] + u4 * r4[c]
        else:
            for c in range(row):
                one[c] += t0 * r0[c] + t1 * r1[c] + t2 * r2[c] + t3 * r3[c] + t4 * r4[c]
                two[c] += u0 * r0[c] + u1 * r1[c] + u2 * r2[c] + u3 * r3[c] + u4 * r4[c]


@taken_in(fastmath={"contract"})
def _add_squares(cosine_part, sine_part, low, high):  # type: ignore[no-untyped-def]
    """Add squared magnitudes of cosine part plus sine part to ``low (column,)``, and of their difference to ``high``."""
    half = len(low)
    cosine_re, cosine_im, sine_re, sine_im = cosine_part[:half], cosine_part[half:], sine_part[:half], sine_part[half:]
    for c in range(half):
        real, imaginary = cosine_re[c] + sine_re[c], cosine_im[c] + sine_im[c]
        low[c] += real * real + imaginary * imaginary
        real, imaginary = cosine_re[c] - sine_re[c], cosine_im[c] - sine_im[c]
        high[c] += real * real + imaginary * imaginary


@taken_in(fastmath={"contract"})
def _put(cosine_part, sine_part, low, high):  # type: ignore[no-untyped-def]
    """Fill ``low`` with cosine part plus sine part, and ``high`` with their difference."""
    for c in range(len(low)):
        low[c], high[c] = cosine_part[c] + sine_part[c], cosine_part[c] - sine_part[c]


@compiled(fastmath={"contract"})
def _add_power(  # type: ignore[no-untyped-def]
    spectra, weights, cycle_at, bin_at, n_1, n_2, cosines_1, sines_1, cosines_2, sines_2, power
):
    cycles, channels, n_range = spectra.shape
    blocks = max(1, -(-n_range // _COLUMNS))
    columns = -(-n_range // (blocks * _LANES)) * _LANES
    # Real parts of a row of range bins, then imaginary ones. All is flat, and cut into slices before it is worked on: lanes are
    # only filled from what is surely not counted from an array's end.
    row = 2 * columns
    grid, sums = on_cache_lines((cycles + 1) * row, weights), on_cache_lines((cycles + 1) * columns, weights)
    even, odd = on_cache_lines(_LARGEST * row, weights), on_cache_lines(_LARGEST * row, weights)
    cosine_part, sine_part = on_cache_lines(2 * row, weights), on_cache_lines(2 * row, weights)
    grid[:] = 0
    for begin in range(0, n_range, columns):
        end = min(begin + columns, n_range)
        sums[:] = 0
        for channel in range(channels):
            for place in range(cycles):
                weight = weights[cycle_at[place]]
                samples = spectra[cycle_at[place], channel, begin:end]
                re, im = grid[place * row : place * row + columns], grid[place * row + columns : (place + 1) * row]
                for c in range(end - begin):
                    re[c] = samples[c].real * weight
                    im[c] = samples[c].imag * weight
            for last in (False, True):
                # First along the second factor, whose places are neighbours, then along the first.
                factor, step = (n_1, n_2) if last else (n_2, 1)
                cosines, sines = (cosines_1, sines_1) if last else (cosines_2, sines_2)
                odd_terms = (factor - 1) // 2
                even[(factor // 2 + 1) * row : cosines.shape[1] * row] = 0
                odd[odd_terms * row : sines.shape[1] * row] = 0
                for line in range(cycles // factor):
                    first = line if last else line * n_2
                    _fold(grid, row, first, step, factor, even, odd)
                    for pair in range(0, factor // 2 + 1, 2):
                        _combine(cosines, pair, row, even, cosine_part)
                        _combine(sines, pair, row, odd, sine_part)
                        for frequency in range(pair, min(pair + 2, factor // 2 + 1)):
                            # The sine of a frequency without a mirror image is 0: what would be put there goes to a row behind.
                            low, high = first + frequency * step, first + (factor - frequency) * step
                            if not 1 <= frequency <= odd_terms:
                                high = cycles
                            part = slice((frequency - pair) * row, (frequency - pair + 1) * row)
                            cosine, sine = cosine_part[part], sine_part[part]
                            if last:
                                near, far = slice(low * columns, (low + 1) * columns), slice(high * columns, (high + 1) * columns)
                                _add_squares(cosine, sine, sums[near], sums[far])
                            else:
                                near, far = slice(low * row, (low + 1) * row), slice(high * row, (high + 1) * row)
                                _put(cosine, sine, grid[near], grid[far])
        for place in range(cycles):
            for c in range(end - begin):
                power[bin_at[place], begin + c] += sums[place * columns + c]
