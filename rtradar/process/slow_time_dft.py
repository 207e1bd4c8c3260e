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

from rtradar.kernels.jit import compiled, inlined, on_cache_lines

_LARGEST = 40
"""Factor: plain sums grow with its square."""

_COLUMNS = 256
"""Range bins side by side, those of one cycle after the other: many, for what begins anew with every row takes time."""

_ROW = 2 * _COLUMNS
"""Real parts of these, then imaginary ones."""

_TOGETHER = 3
"""Terms added at once, and frequencies they are added for: sums and terms are read and written back a third as often."""


class SlowTimeDft(NamedTuple):
    """Tables of a DFT over as many cycles as there are in ``cycle_at``.

    Parameters
    ----------
    cycle_at, bin_at : (place,) int64
        Which cycle stands at each place of the grid (first, second) of the factors, and which Doppler bin afterwards.
    cosines, sines : pair of (frequency, term) float32
        Tables of each factor: frequencies and terms that have a mirror image, 1 to below half of
        it; filled up with zeros to multiples of `_TOGETHER`.
    factors : pair of int
    """

    cycle_at: NDArray[np.int64]
    bin_at: NDArray[np.int64]
    cosines: tuple[NDArray[np.float32], NDArray[np.float32]]
    sines: tuple[NDArray[np.float32], NDArray[np.float32]]
    factors: tuple[int, int]

    @property
    def multiply_adds(self) -> int:
        """Of one transform: those of terms that have a mirror image, real and imaginary parts."""
        squares = [2 * ((factor - 1) // 2) ** 2 for factor in self.factors]
        return 2 * sum(
            len(self.cycle_at) // factor * count
            for factor, count in zip(self.factors, squares, strict=True)
        )


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
    pairs = [
        (n_cycles // second, second) for second in range(2, _LARGEST + 1) if n_cycles % second == 0
    ]
    # The least sum is the least work.
    allowed = [
        (sum(pair), pair)
        for pair in pairs
        if 2 <= pair[0] < pair[1] and max(pair) <= _LARGEST and gcd(*pair) == 1
    ]
    if not allowed:
        return None
    first, second = min(allowed)[1]
    i, j = np.divmod(np.arange(n_cycles), second)
    # Cycles by Ruritania's map and bins by the Chinese remainder theorem: their product then has no mixed term.
    cycle_at = (i * second + j * first) % n_cycles
    bin_at = (i * second * pow(second, -1, first) + j * first * pow(first, -1, second)) % n_cycles
    (cosines_1, sines_1), (cosines_2, sines_2) = _tables(first), _tables(second)
    return SlowTimeDft(
        cycle_at, bin_at, (cosines_1, cosines_2), (sines_1, sines_2), (first, second)
    )


def _tables(factor: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    mirrored = np.arange(1, (factor + 1) // 2)
    angles = 2 * np.pi * np.outer(mirrored, mirrored) / factor
    rest = -len(mirrored) % _TOGETHER
    cosines, sines = (
        np.pad(table, (0, rest)).astype(np.float32) for table in (np.cos(angles), np.sin(angles))
    )
    return cosines, sines


def add_doppler_power(
    spectra: NDArray[np.complex64],
    channels: range,
    weights: NDArray[np.float32],
    dft: SlowTimeDft,
    power: NDArray[np.float32],
) -> None:
    """Add the squared magnitudes of weighted DFTs over the cycles of some channels.

    Parameters
    ----------
    spectra : (cycle, channel, range) complex64
        Contiguous.
    channels : range
        Which of them, in steps of one.
    weights : (cycle,) float32
        Window weights of the cycles.
    dft : SlowTimeDft
        Transform of as many cycles.
    power : (doppler, range) float32
        Added to, in the order of the DFT.
    """
    (cosines_1, cosines_2), (sines_1, sines_2) = dft.cosines, dft.sines
    # What may be written to and what may not are two types to Numba, each with code of its own.
    spectra = spectra.view()
    spectra.flags.writeable = False
    _add_power(
        spectra,
        channels.start,
        channels.stop,
        weights,
        dft.cycle_at,
        dft.bin_at,
        *dft.factors,
        cosines_1,
        sines_1,
        cosines_2,
        sines_2,
        power,
    )


# Rows are `_ROW` long, a constant, and a function's rows stand one after the other in as few arrays as may be: were they arrays
# each, the compiler would have every call ask first whether any two overlap.


@inlined()
def _row(store, number):
    return store[number * _ROW : (number + 1) * _ROW]


@inlined()
def _powers(store, number):
    return store[number * _COLUMNS : (number + 1) * _COLUMNS]


@inlined(fastmath={"contract"})
def _read(samples, weight, out):
    """Fill ``out (row,)``: real parts of what is read, then imaginary ones, weighted."""
    for c in range(len(samples)):
        out[c] = samples[c].real * weight
        out[_COLUMNS + c] = samples[c].imag * weight


@inlined(fastmath={"contract"})
def _fold(near, far, even, odd):
    """Sum of two rows, and their difference times -j, which the sine has before it."""
    for c in range(_COLUMNS):
        near_re, near_im, far_re, far_im = near[c], near[_COLUMNS + c], far[c], far[_COLUMNS + c]
        even[c] = near_re + far_re
        even[_COLUMNS + c] = near_im + far_im
        odd[c] = near_im - far_im
        odd[_COLUMNS + c] = far_re - near_re


@inlined(fastmath={"contract"})
def _read_folded(near, near_weight, far, far_weight, even, odd):
    """The same of what is read, weighted."""
    for c in range(len(near)):
        near_re, near_im = near[c].real * near_weight, near[c].imag * near_weight
        far_re, far_im = far[c].real * far_weight, far[c].imag * far_weight
        even[c] = near_re + far_re
        even[_COLUMNS + c] = near_im + far_im
        odd[c] = near_im - far_im
        odd[_COLUMNS + c] = far_re - near_re


@inlined()
def _put(row, out):
    for i in range(_ROW):
        out[i] = row[i]


@inlined(fastmath={"contract"})
def _add_products(table, begin, terms, out):
    """Add to three rows ``out``: those of ``terms``, times what the table has for the three frequencies from ``begin`` on."""
    a, b, c = table[begin], table[begin + 1], table[begin + 2]
    for k in range(0, len(a), _TOGETHER):
        rows = terms[k * _ROW : (k + _TOGETHER) * _ROW]
        a0, a1, a2, b0, b1, b2, c0, c1, c2 = (
            a[k],
            a[k + 1],
            a[k + 2],
            b[k],
            b[k + 1],
            b[k + 2],
            c[k],
            c[k + 1],
            c[k + 2],
        )
        for i in range(_ROW):
            r0, r1, r2 = rows[i], rows[_ROW + i], rows[2 * _ROW + i]
            out[i] = out[i] + a0 * r0 + a1 * r1 + a2 * r2
            out[_ROW + i] = out[_ROW + i] + b0 * r0 + b1 * r1 + b2 * r2
            out[2 * _ROW + i] = out[2 * _ROW + i] + c0 * r0 + c1 * r1 + c2 * r2


@inlined(fastmath={"contract"})
def _add_signed(terms, count, sign, out):
    """Add rows to one: all of them, or (``sign`` -1) with signs that alternate."""
    factor = sign
    for k in range(count):
        row = _row(terms, k)
        for i in range(_ROW):
            out[i] += factor * row[i]
        factor *= sign


@inlined(fastmath={"contract"})
def _add_squares(row, out):
    for c in range(_COLUMNS):
        out[c] += row[c] * row[c] + row[_COLUMNS + c] * row[_COLUMNS + c]


@inlined(fastmath={"contract"})
def _unfold(one, other, low, high):
    """Fill ``low`` with the sum of two parts, and ``high``, of the mirrored frequency, with their difference."""
    for i in range(_ROW):
        low[i], high[i] = one[i] + other[i], one[i] - other[i]


@inlined(fastmath={"contract"})
def _add_unfolded_squares(cosine, sine, low, high):
    """The same, but squared magnitudes, added."""
    for c in range(_COLUMNS):
        cosine_re, cosine_im, sine_re, sine_im = (
            cosine[c],
            cosine[_COLUMNS + c],
            sine[c],
            sine[_COLUMNS + c],
        )
        real, imaginary = cosine_re + sine_re, cosine_im + sine_im
        low[c] += real * real + imaginary * imaginary
        real, imaginary = cosine_re - sine_re, cosine_im - sine_im
        high[c] += real * real + imaginary * imaginary


@compiled(fastmath={"contract"})
def _add_power(
    spectra,
    channel_begin,
    channel_end,
    weights,
    cycle_at,
    bin_at,
    n_1,
    n_2,
    cosines_1,
    sines_1,
    cosines_2,
    sines_2,
    power,
):
    cycles, _, n_range = spectra.shape
    # Behind the rows of the grid is one of zeros.
    grid, sums = (
        on_cache_lines((cycles + 1) * _ROW, weights),
        on_cache_lines(cycles * _COLUMNS, weights),
    )
    terms = max(cosines_1.shape[1], cosines_2.shape[1])
    even, odd = on_cache_lines(terms * _ROW, weights), on_cache_lines(terms * _ROW, weights)
    alone, total = on_cache_lines(2 * _ROW, weights), on_cache_lines(_ROW, weights)
    cosine_parts, sine_parts = (
        on_cache_lines(_TOGETHER * _ROW, weights),
        on_cache_lines(_TOGETHER * _ROW, weights),
    )
    one = np.float32(1)
    for begin in range(0, n_range, _COLUMNS):
        end = min(begin + _COLUMNS, n_range)
        # What stands beside the last range bins is 0 as well.
        grid[:], sums[:], even[:], odd[:] = 0, 0, 0, 0
        for channel in range(channel_begin, channel_end):
            for last in (False, True):
                # First along the second factor, whose places are neighbours, then along the first.
                factor, step = (n_1, n_2) if last else (n_2, 1)
                cosines, sines = (cosines_1, sines_1) if last else (cosines_2, sines_2)
                pairs, half = (factor - 1) // 2, factor // 2
                even[pairs * _ROW : cosines.shape[1] * _ROW] = 0
                odd[pairs * _ROW : cosines.shape[1] * _ROW] = 0
                for line in range(cycles // factor):
                    first = line if last else line * n_2
                    # A term at half of an even factor is its own mirror image.
                    at_half = first + half * step if factor % 2 == 0 else cycles
                    own, middle = _row(grid, first), _row(grid, at_half)
                    if not last:
                        _read(
                            spectra[cycle_at[first], channel, begin:end],
                            weights[cycle_at[first]],
                            own,
                        )
                        if at_half < cycles:
                            _read(
                                spectra[cycle_at[at_half], channel, begin:end],
                                weights[cycle_at[at_half]],
                                middle,
                            )
                    _unfold(own, middle, _row(alone, 0), _row(alone, 1))
                    for k in range(pairs):
                        low, high = first + (k + 1) * step, first + (factor - k - 1) * step
                        if last:
                            _fold(_row(grid, low), _row(grid, high), _row(even, k), _row(odd, k))
                        else:
                            low, high = cycle_at[low], cycle_at[high]
                            near, far = (
                                spectra[low, channel, begin:end],
                                spectra[high, channel, begin:end],
                            )
                            _read_folded(
                                near, weights[low], far, weights[high], _row(even, k), _row(odd, k)
                            )
                    # Frequencies without a mirror image: 0, and half of an even factor.
                    _put(_row(alone, 0), total)
                    _add_signed(even, pairs, one, total)
                    if last:
                        _add_squares(total, _powers(sums, first))
                    else:
                        _put(total, own)
                    if at_half < cycles:
                        _put(_row(alone, half % 2), total)
                        _add_signed(even, pairs, -one, total)
                        if last:
                            _add_squares(total, _powers(sums, at_half))
                        else:
                            _put(total, middle)
                    for group in range(0, pairs, _TOGETHER):
                        for k in range(_TOGETHER):
                            _put(_row(alone, (group + k + 1) % 2), _row(cosine_parts, k))
                        sine_parts[:] = 0
                        _add_products(cosines, group, even, cosine_parts)
                        _add_products(sines, group, odd, sine_parts)
                        for k in range(min(_TOGETHER, pairs - group)):
                            low, high = (
                                first + (group + k + 1) * step,
                                first + (factor - group - k - 1) * step,
                            )
                            cosine, sine = _row(cosine_parts, k), _row(sine_parts, k)
                            if last:
                                _add_unfolded_squares(
                                    cosine, sine, _powers(sums, low), _powers(sums, high)
                                )
                            else:
                                _unfold(cosine, sine, _row(grid, low), _row(grid, high))
        for place in range(cycles):
            own, out = _powers(sums, place), power[bin_at[place], begin:end]
            for c in range(len(out)):
                out[c] += own[c]
