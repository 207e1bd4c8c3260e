"""DFTs over slow time whose number of cycles is a product of coprime factors.

FFT libraries are made for small prime factors. A frame of 100 ms has 133 = 7 x 19 or 666 = 18 x 37
cycles here, and the factors 19 and 37 take most of a library's time. The prime-factor algorithm
(Good 1958) takes a DFT of each length in turn, without twiddle factors between them. Each is small
enough for plain sums, which run over half of the terms because cosines are even and sines odd.
Range bins lie side by side in vector lanes. Samples are weighted as they are read, and only their
power or the values of chosen cells are written, so that no whole spectrum is ever stored.
"""

from __future__ import annotations

from functools import lru_cache
from math import gcd
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined, on_cache_lines

_LARGEST = 40
"""Largest factor; plain sums grow with its square."""

_COLUMNS = 256
"""Range bins that are transformed together, so that the overhead of each row pays."""

_ROW = 2 * _COLUMNS
"""A row: the real parts of these bins, then their imaginary parts."""

_TOGETHER = 3
"""Terms, and frequencies, of one inner loop: sums are read and written a third as often."""


class PrimeFactorDft(NamedTuple):
    """Tables of a DFT over as many cycles as there are in ``cycle_at``.

    At each place of the grid (first, second) of the two ``factors``, ``cycle_at (place,)`` is the
    cycle that is put there, and ``bin_at (place,)`` the Doppler bin that is found there afterwards.
    ``cosines`` and ``sines (frequency, term)`` are tables of each factor for the frequencies and
    terms from 1 to below half of it, filled up with zeros to multiples of `_TOGETHER`.
    """

    cycle_at: NDArray[np.int64]
    bin_at: NDArray[np.int64]
    cosines: tuple[NDArray[np.float32], NDArray[np.float32]]
    sines: tuple[NDArray[np.float32], NDArray[np.float32]]
    factors: tuple[int, int]


@lru_cache(maxsize=8)
def prime_factor_dft(n_cycles: int) -> PrimeFactorDft | None:
    """Tables for a number of cycles; None where it has no two coprime factors small enough."""
    pairs = [(n_cycles // n, n) for n in range(2, _LARGEST + 1) if n_cycles % n == 0]
    allowed = [pair for pair in pairs if 2 <= pair[0] < pair[1] <= _LARGEST and gcd(*pair) == 1]
    if not allowed:
        return None
    first, second = min(allowed, key=sum)  # the least sum is the least work
    i, j = np.divmod(np.arange(n_cycles), second)
    # Cycles by Good's map and bins by the Chinese remainder theorem: their product modulo the
    # number of cycles has no mixed term, and so there are no twiddle factors.
    cycle_at = (i * second + j * first) % n_cycles
    bin_at = (i * second * pow(second, -1, first) + j * first * pow(first, -1, second)) % n_cycles
    cosines, sines = zip(_tables(first), _tables(second), strict=True)
    return PrimeFactorDft(cycle_at, bin_at, cosines, sines, (first, second))


def _tables(factor: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    paired = np.arange(1, (factor + 1) // 2)
    angles = 2 * np.pi * np.outer(paired, paired) / factor
    # Zeros fill the tables up to whole groups of the inner loop.
    rest = -len(paired) % _TOGETHER
    cosines, sines = (np.pad(table, (0, rest)) for table in (np.cos(angles), np.sin(angles)))
    return cosines.astype(np.float32), sines.astype(np.float32)


def add_doppler_power(
    spectra: NDArray[np.complex64],
    channels: range,
    weights: NDArray[np.float32],
    dft: PrimeFactorDft,
    power: NDArray[np.float32],
) -> None:
    """Add the squared magnitudes of weighted DFTs over the cycles of some channels.

    The ``channels``, in steps of one, of ``spectra (cycle, channel, range)``, which are contiguous,
    are weighted by ``weights (cycle,)``. Their power is added to ``power (doppler, range)``, in the
    order of the DFT. All are of single precision.
    """
    none = np.empty(0, np.int64), np.empty((0, 0), np.int64), np.empty(0, np.int64)
    values = np.empty((0, 0, 0), np.complex64)
    _transform(
        _read_only(spectra), channels.start, channels.stop, weights, dft, power, none, values
    )


def pick_cells(
    spectra: NDArray[np.complex64],
    channels: range,
    weights: NDArray[np.float32],
    dft: PrimeFactorDft,
    cells: tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]],
    values: NDArray[np.complex64],
) -> None:
    """Fill in the chosen cells of weighted DFTs over the cycles, for some channels.

    ``cells`` are the Doppler bin ``(cell,)`` of each in the order of the DFT, its range bins
    ``(cell, offset)`` as places in a list, and that list of the range bins ``(bin,)`` that are
    transformed; ``values (cell, offset, channel)`` are filled. The rest is as for
    `add_doppler_power`.
    """
    turns, at, bins = cells
    # A few bins of some channels side by side fill the lanes.
    lanes = (np.asarray(channels)[:, None] * spectra.shape[2] + bins).ravel()
    # The inverse of the map of bins: the place of the grid where each Doppler bin is found.
    place = np.argsort(dft.bin_at)[turns], at, lanes
    power = np.empty((0, 0), np.float32)
    _transform(
        _read_only(spectra), channels.start, channels.stop, weights, dft, power, place, values
    )


def _read_only(spectra: NDArray[np.complex64]) -> NDArray[np.complex64]:
    # Numba compiles anew where one array may be written to and another not: these never are.
    spectra = spectra.view()
    spectra.flags.writeable = False
    return spectra


# Rows have the constant length `_ROW`, and the rows of a function lie in as few arrays as possible.
# If each were an array, every loop would first have to check whether any two of them overlap.


@inlined()
def _row(rows, number):
    return rows[number * _ROW : (number + 1) * _ROW]


@inlined()
def _powers(sums, number):
    return sums[number * _COLUMNS : (number + 1) * _COLUMNS]


@inlined(fastmath={"contract"})
def _read(samples, weight, out):
    """Fill ``out (row,)`` with weighted samples: real parts, then imaginary ones."""
    for c in range(len(samples)):
        out[c] = samples[c].real * weight
        out[_COLUMNS + c] = samples[c].imag * weight


@inlined(fastmath={"contract"})
def _gather(samples, lanes, weight, out):
    """Do the same as `_read` with the samples at some places."""
    for c in range(len(lanes)):
        sample = samples[lanes[c]]
        out[c] = sample.real * weight
        out[_COLUMNS + c] = sample.imag * weight


@inlined(fastmath={"contract"})
def _fold(near, far, even, odd):
    """Fill the sum of two rows, and -j times their difference, which belongs to the sines."""
    for c in range(_COLUMNS):
        # exp(-jx) and exp(jx) of the two terms leave the sum times cos(x), and -j times the
        # difference times sin(x).
        near_re, near_im, far_re, far_im = near[c], near[_COLUMNS + c], far[c], far[_COLUMNS + c]
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
    """Add to three rows ``out`` the terms times the table of three frequencies from ``begin``."""
    a, b, c = table[begin], table[begin + 1], table[begin + 2]
    for k in range(0, len(a), _TOGETHER):
        rows = terms[k * _ROW : (k + _TOGETHER) * _ROW]
        a0, a1, a2 = a[k], a[k + 1], a[k + 2]
        b0, b1, b2 = b[k], b[k + 1], b[k + 2]
        c0, c1, c2 = c[k], c[k + 1], c[k + 2]
        for i in range(_ROW):
            r0, r1, r2 = rows[i], rows[_ROW + i], rows[2 * _ROW + i]
            out[i] = out[i] + a0 * r0 + a1 * r1 + a2 * r2
            out[_ROW + i] = out[_ROW + i] + b0 * r0 + b1 * r1 + b2 * r2
            out[2 * _ROW + i] = out[2 * _ROW + i] + c0 * r0 + c1 * r1 + c2 * r2


@inlined(fastmath={"contract"})
def _add_signed(terms, count, sign, out):
    """Add rows to one, with signs that alternate where ``sign`` is -1."""
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
    """Fill ``low`` with the sum of two parts, and ``high`` with their difference."""
    for i in range(_ROW):
        low[i], high[i] = one[i] + other[i], one[i] - other[i]


@inlined(fastmath={"contract"})
def _add_unfolded_squares(cosine, sine, low, high):
    """`_unfold`, but the squared magnitudes are added."""
    for c in range(_COLUMNS):
        cosine_re, cosine_im = cosine[c], cosine[_COLUMNS + c]
        sine_re, sine_im = sine[c], sine[_COLUMNS + c]
        real, imaginary = cosine_re + sine_re, cosine_im + sine_im
        low[c] += real * real + imaginary * imaginary
        real, imaginary = cosine_re - sine_re, cosine_im - sine_im
        high[c] += real * real + imaginary * imaginary


@inlined()
def _transform_line(cosines, sines, rows, line, to_power):
    """Sum the terms of one line (first place, step, factor, place of its half) to its frequencies.

    They are put in its places, or their power is added. Among the ``rows``, the ``grid`` has one
    for each cycle and one of zeros, ``sums`` has the power of each bin, ``even`` and ``odd`` have
    the folded terms of a line, ``alone`` has the sum and the difference of the two terms without a
    partner, ``total`` has one frequency, and each of the ``parts`` three.
    """
    grid, sums, even, odd, alone, total, cosine_parts, sine_parts = rows
    first, step, factor, at_half = line
    pairs, one = (factor - 1) // 2, np.float32(1)
    # Fold the terms in pairs.
    _unfold(_row(grid, first), _row(grid, at_half), _row(alone, 0), _row(alone, 1))
    for k in range(pairs):
        low, high = first + (k + 1) * step, first + (factor - k - 1) * step
        _fold(_row(grid, low), _row(grid, high), _row(even, k), _row(odd, k))
    # Frequencies without a partner: 0, and half of an even factor.
    for half in range(2 - factor % 2):
        place, sign = (at_half, -one) if half else (first, one)
        # At frequency 0 all terms are added. At half of the factor their signs alternate, and the
        # term at half of it has the sign of that half.
        _put(_row(alone, half * (factor // 2 % 2)), total)
        _add_signed(even, pairs, sign, total)
        if to_power:
            _add_squares(total, _powers(sums, place))
        else:
            _put(total, _row(grid, place))
    # All others in pairs, some pairs together.
    for group in range(0, pairs, _TOGETHER):
        for k in range(_TOGETHER):
            # The term at half of the factor changes its sign from one frequency to the next.
            _put(_row(alone, (group + k + 1) % 2), _row(cosine_parts, k))
        sine_parts[:] = 0
        _add_products(cosines, group, even, cosine_parts)
        _add_products(sines, group, odd, sine_parts)
        # Both frequencies of a pair have the same cosines, and sines of opposite sign.
        for k in range(min(_TOGETHER, pairs - group)):
            low, high = first + (group + k + 1) * step, first + (factor - group - k - 1) * step
            cosine, sine = _row(cosine_parts, k), _row(sine_parts, k)
            if to_power:
                _add_unfolded_squares(cosine, sine, _powers(sums, low), _powers(sums, high))
            else:
                _unfold(cosine, sine, _row(grid, low), _row(grid, high))


@inlined()
def _pick(grid, cells, begin, end, channel_begin, channel_end, values):
    """Fill in the values of some channels from the lanes of the transformed grid that hold them."""
    places, at, lanes = cells
    bins = len(lanes) // (channel_end - channel_begin)
    for cell in range(len(places)):
        row = _row(grid, places[cell])
        for offset in range(at.shape[1]):
            for channel in range(channel_begin, channel_end):
                # The place among the lanes of this pass.
                c = (channel - channel_begin) * bins + at[cell, offset] - begin
                if 0 <= c < end - begin:
                    values[cell, offset, channel] = complex(row[c], row[_COLUMNS + c])


# One function for both uses, because it takes longer to compile than most.
@compiled(fastmath={"contract"})
def _transform(spectra, channel_begin, channel_end, weights, dft, power, cells, values):
    """Add to power (doppler, range), unless that is empty; else fill in values at cells.

    The cells are (place, place of their bins among those of a channel, lanes).
    """
    to_power = len(power) > 0
    cycles, _, n_range = spectra.shape
    n_lanes, passes = (n_range, channel_end - channel_begin) if to_power else (len(cells[2]), 1)
    n_1, n_2 = dft.factors
    terms = max(dft.cosines[0].shape[1], dft.cosines[1].shape[1])
    grid = on_cache_lines((cycles + 1) * _ROW, weights)
    sums = on_cache_lines(cycles * _COLUMNS, weights)
    even, odd = on_cache_lines(terms * _ROW, weights), on_cache_lines(terms * _ROW, weights)
    alone, total = on_cache_lines(2 * _ROW, weights), on_cache_lines(_ROW, weights)
    cosine_parts = on_cache_lines(_TOGETHER * _ROW, weights)
    sine_parts = on_cache_lines(_TOGETHER * _ROW, weights)
    rows = grid, sums, even, odd, alone, total, cosine_parts, sine_parts
    grid[:], even[:], odd[:] = 0, 0, 0
    # Rows have a constant length, so the lanes are taken in blocks of it.
    for begin in range(0, n_lanes, _COLUMNS):
        # Lanes beyond the last one are transformed, too, and not read.
        end = min(begin + _COLUMNS, n_lanes)
        sums[:] = 0
        for channel in range(channel_begin, channel_begin + passes):
            # Read the cycles in the order of Good's map, weighted.
            for place in range(cycles):
                cycle, row = dft.cycle_at[place], _row(grid, place)
                if to_power:
                    _read(spectra[cycle, channel, begin:end], weights[cycle], row)
                else:
                    samples = spectra[cycle].reshape(-1)
                    _gather(samples, cells[2][begin:end], weights[cycle], row)
            for last in (False, True):
                # First along the second factor, whose places are neighbours, then the first.
                factor, step = (n_1, n_2) if last else (n_2, 1)
                cosines, sines = dft.cosines[0 if last else 1], dft.sines[0 if last else 1]
                # Rows that only fill up the groups meet zeros of the tables. They are cleared of
                # what the other factor left there, because 0 times infinity would not be 0.
                padding = slice((factor - 1) // 2 * _ROW, cosines.shape[1] * _ROW)
                even[padding] = 0
                odd[padding] = 0
                for number in range(cycles // factor):
                    first = number if last else number * n_2
                    # The term at half of an even factor has no partner. An odd factor has no such
                    # term: the row of zeros stands for it.
                    at_half = first + factor // 2 * step if factor % 2 == 0 else cycles
                    line = first, step, factor, at_half
                    _transform_line(cosines, sines, rows, line, to_power and last)
        # The grid holds the spectrum of the chosen lanes; where power is wanted, the sums hold that
        # of all channels.
        if not to_power:
            _pick(grid, cells, begin, end, channel_begin, channel_end, values)
        for place in range(cycles if to_power else 0):
            own, out = _powers(sums, place), power[dft.bin_at[place], begin:end]
            for c in range(len(out)):
                out[c] += own[c]
