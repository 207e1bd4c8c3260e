"""The sum of many tones: each spread over a few cells of a grid of beat frequencies, and one FFT.

A nonuniform FFT of type 1 (Dutt and Rokhlin, SIAM J. Sci. Comput. 14, 1993). Its windows are fitted
to the weights that undo the window of Kaiser and Bessel. Its work grows with tones times taps, not
with tones times samples. An amplitude that changes over the sweep costs no further FFT: it is a sum
of Legendre polynomials P_k(x) of the place in the sweep, x = 2 (n - n_samples // 2) / n_samples,
and the product of each with a tone has a window of its own, real for even k and imaginary for odd.

Tones are given in one of two ways. Chirp by chirp they are summed to 1e-6. At anchors, which are
instants some cycles apart between which lengths and amplitudes are cubics in time, they are summed
to -60 dB: enough for ghosts, which are weaker than the echoes that they repeat. Sums are float32.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import NDArray
from scipy import fft

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.elementary import phasor, phasor_float32
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.tone_sum import Tones
from rtradar.system.threads import thread_map

ANCHORS = 4
"""Anchors around a chirp through which the cubic goes."""

MOST_NODES, LEAST_SAMPLES = 6, 16
"""Frequencies at which amplitudes may be given, and samples of a chirp, for sums to 1e-6: with more
terms in fewer cells float32 rounds by more."""

_FINE, _COARSE = (16, 2.0), (8, 1.25)
"""Cells over which a tone is spread, and the least number of cells for each sample, for sums to
1e-6 and to -60 dB. With fewer cells float32 would not do for 1e-6: weights would be up to 1600
times as large at the ends of the chirp as in the middle."""

_PLACES = 1024
"""Places in a cell at which windows are tabulated. From the nearest a tone is off by up to 1.2e-3
at the ends of the chirp, on the coarse grid; with a linear step from there by 3e-7 on the other."""

_FITTED, _PLACES_AT_ONCE = 65, 16
"""Most samples over which windows are fitted, and places for which they are at once."""

_CHIRPS_AT_ONCE = 24
"""Chirps whose grids stay in the processor's cache between spreading and FFT."""


class Anchors(NamedTuple):
    """Echoes at the anchors of each Tx, receivers side by side.

    ``length (anchor, tx, rx, echo)`` float64 [m], ``level (2, anchor, tx, rx, echo)`` float32, real
    and imaginary parts of the mean amplitudes over the sweep [m]. The amplitudes of the last echoes
    change over the sweep by ``change[0] P_1(x) + change[1] P_2(x) (2, 2, anchor, tx, rx,
    changing)``.
    """

    length: NDArray[np.float64]
    level: NDArray[np.float32]
    change: NDArray[np.float32]


class BetweenAnchors(NamedTuple):
    """Where chirps are between anchors, and their sweep.

    Each chirp has the number of the ``first (chirp,)`` of its `ANCHORS` anchors and their ``weight
    (chirp, 4)``, its ``tx``, and the ``carrier`` on which it starts [Hz]. All have a slope [Hz/s]
    and a sample rate [Hz].
    """

    first: NDArray[np.int64]
    weight: NDArray[np.float64]
    tx: NDArray[np.int64]
    carrier: NDArray[np.float64]
    slope: float
    sample_rate: float


def sum_by_nufft(tones: Tones, out: NDArray[np.complex64]) -> None:
    """Fill ``out (chirp, rx, sample)`` with the sum of the echoes, to 1e-6 of it [m].

    The weights of the tones are those of Legendre polynomials. There are at most `MOST_NODES`
    nodes, and at least `LEAST_SAMPLES` samples in each chirp.
    """
    out[:] = 0
    # One type and layout, or Numba would compile anew for each other one.
    amplitude = np.ascontiguousarray(tones.amplitude, dtype=np.complex64)
    own = tones._replace(amplitude=amplitude, weights=tones.weights.astype(np.float32))
    windows = _windows(out.shape[2], len(own.weights) + 1, *_FINE)
    _add_sums(np.arange(len(out)), _spread_tones, (own,), windows, out)


def add_anchored_tones(
    anchors: Anchors, between: BetweenAnchors, out: NDArray[np.complex64]
) -> None:
    """Add the sum of the tones to ``out (chirp, rx, sample)`` [m].

    Tones whose beat frequency lies outside [0, sample rate) add nothing.
    """
    windows = _windows(out.shape[2], 1 + len(anchors.change), *_COARSE)
    # Chirps of one Tx and of the same anchors follow one another, so that these stay in the cache.
    order = np.lexsort((between.first, between.tx))
    _add_sums(order, _spread_anchored, (anchors, between), windows, out)


class _Windows(NamedTuple):
    """``values (term, place, tap)`` of tones times P_k(x), without the factor j of odd terms.

    They are for a grid of so many ``cells``. After the FFT, samples are to be multiplied by
    ``weights (sample,)``.
    """

    cells: int
    values: NDArray[np.float32]
    weights: NDArray[np.float32]


@lru_cache
def _windows(samples: int, terms: int, taps: int, ratio: float) -> _Windows:
    # The FFT of the grid is fast for some numbers of cells only.
    half, cells = samples // 2, fft.next_fast_len(max(math.ceil(ratio * samples), taps))
    # The usual shape parameter: pi times the taps W, times 1 - 1 / 2s with s cells for each sample.
    shape = np.pi * taps * (1 - samples / (2 * cells))

    def weights(sample: NDArray[np.floating]) -> NDArray[np.float64]:
        """One over the Fourier transform of Kaiser and Bessel's window."""
        root = np.sqrt(shape**2 - (np.pi * taps * sample / cells) ** 2)
        return np.asarray(np.i0(shape) * root / (taps * np.sinh(root)))

    # For each place and term the values with the least squared error over the samples. The products
    # are so small that a library for matrices does not share them among its threads, whose number
    # would change how they round.
    sample = np.linspace(-half, half, min(2 * half + 1, _FITTED))[:, None]
    tap, place = np.arange(taps) - taps // 2 + 1, (np.arange(_PLACES) + 0.5) / _PLACES
    fit = np.linalg.pinv(weights(sample) * np.exp(2j * np.pi / cells * sample * tap), rcond=1e-15)
    tones = np.exp(2j * np.pi / cells * sample * place.reshape(-1, 1, _PLACES_AT_ONCE))
    values = np.empty((terms, _PLACES, taps), dtype=np.float32)
    for term in range(terms):
        found = fit @ (Legendre.basis(term)(2 * sample / samples) * tones)
        # The fit is over samples that are symmetric about 0: of odd terms it is imaginary.
        own = found.imag if term % 2 else found.real
        values[term] = own.transpose(0, 2, 1).reshape(_PLACES, taps)
    return _Windows(cells, values, weights(np.arange(samples) - float(half)).astype(np.float32))


def _add_sums(
    order: NDArray[np.int64],
    spread: Callable[..., None],
    tones: tuple[Any, ...],
    windows: _Windows,
    out: NDArray[np.complex64],
) -> None:
    """Add the sums of tones to ``out (chirp, rx, sample)``, chirps in an order (chirp,).

    ``spread(chirps, *tones, samples, values, grid)`` fills a grid (chirp, rx, cell), with phases
    about the middle sample.
    """
    _, receivers, samples = out.shape

    def fill(begin: int) -> None:
        chirps = order[begin : begin + _CHIRPS_AT_ONCE]
        grid = np.empty((len(chirps), receivers, windows.cells), dtype=np.complex64)
        spread(chirps, *tones, samples, windows.values, grid)
        summed = fft.ifft(grid, axis=-1, norm="forward", overwrite_x=True)
        _add_rows(summed, windows.weights, samples // 2, chirps, out)

    thread_map(fill, range(0, len(out), _CHIRPS_AT_ONCE))


@compiled()
def _add_rows(summed, weights, half, rows, out):
    """Add the samples of grids to rows of ``out`` after the FFT, weighted."""
    cells, samples = summed.shape[2], out.shape[2]
    for i in range(len(rows)):
        for receiver in range(out.shape[1]):
            source, target = summed[i, receiver], out[rows[i], receiver]
            # Phases are about the middle sample: the samples before it are at the end of the
            # period.
            for sample in range(half):
                target[sample] += source[cells - half + sample] * weights[sample]
            for sample in range(half, samples):
                target[sample] += source[sample - half] * weights[sample]


@inlined(fastmath={"contract"})
def _turned(real, imaginary, cosine, sine, odd):
    """Real and imaginary part of an amplitude times a phasor, and times j for an odd term."""
    across, up = real * cosine - imaginary * sine, real * sine + imaginary * cosine
    return (-up, across) if odd else (across, up)


@inlined(fastmath={"contract"})
def _spread(flat, cell, place, terms, values, grid, out):
    """Fill ``out (cell,)`` with the windows of tones, added up in ``grid (cell + tap,)``.

    Each tone has a ``cell (tone,)``, a ``place`` in it and amplitudes ``terms (2, term, tone)``,
    real and imaginary, times its phasor. The first ``flat`` tones have the first term alone.
    """
    cells, taps, last = len(out), values.shape[2], terms.shape[1] - 1
    grid[:] = 0
    # Indices are unsigned, because checks of them would cost more than the sums.
    # Tones of constant amplitude have the first window alone.
    for i in range(flat):
        at, window = np.uint64(cell[i]), values[0, np.uint64(place[i])]
        _add_window(window, at, terms[0, 0, i], terms[1, 0, i], grid)
    for i in range(flat, len(cell)):
        at, which = np.uint64(cell[i]), np.uint64(place[i])
        # Two terms at a time, so that sums are read and written, and rounded, half as often.
        for term in range(0, last, 2):
            one, other = values[term, which], values[term + 1, which]
            a, b = terms[0, term, i], terms[1, term, i]
            c, d = terms[0, term + 1, i], terms[1, term + 1, i]
            for tap in range(np.uint64(taps)):
                real, imaginary = a * one[tap] + c * other[tap], b * one[tap] + d * other[tap]
                grid[at + tap] += complex(real, imaginary)
        if last % 2 == 0:
            _add_window(values[last, which], at, terms[0, last, i], terms[1, last, i], grid)
    # Cells beyond an end belong to the other end.
    before = taps // 2 - 1
    for i in range(taps):
        # The grid begins half a window before the first cell.
        if i < before:
            grid[cells + i] += grid[i]
        else:
            grid[i] += grid[cells + i]
    for i in range(cells):
        out[i] = grid[before + i]


@inlined(fastmath={"contract"})
def _add_window(window, cell, real, imaginary, grid):
    # A number of taps that the compiler knew would be written out one by one, not in vectors.
    for tap in range(np.uint64(len(window))):
        grid[cell + tap] += complex(real * window[tap], imaginary * window[tap])


# -- tones chirp by chirp --


@compiled(fastmath={"contract"})
def _spread_tones(chirps, tones, samples, values, grid):
    """Fill ``grid (chirp, rx, cell)`` with the windows of the tones of some chirps."""
    receivers, cells = grid.shape[1:]
    nodes, echoes = tones.amplitude.shape[0], tones.length.shape[2]
    cell, place = np.empty(echoes, dtype=np.int32), np.empty(echoes, dtype=np.int32)
    cosine, sine = np.empty(echoes, dtype=np.float32), np.empty(echoes, dtype=np.float32)
    step = np.empty(echoes, dtype=np.float32)
    # One row of zeros before the first term and two after the last, for `_step`.
    amplitude = np.zeros((2, nodes + 3, echoes), dtype=np.float32)
    terms = np.empty((2, nodes + 1, echoes), dtype=np.float32)
    summed = np.empty(cells + values.shape[2], dtype=np.complex64)
    per_m = 1 / SPEED_OF_LIGHT_MPS
    cells_per_m = tones.slope * per_m / tones.sample_rate * cells
    middle = tones.start_frequency + tones.slope * (samples // 2) / tones.sample_rate
    for i in range(len(chirps)):
        # Where each tone lies on the grid, and its phase in the middle of the chirp.
        for receiver in range(receivers):
            length = tones.length[chirps[i], receiver]
            for echo in range(echoes):
                position = length[echo] * cells_per_m
                received = position >= 0 and position < cells
                position = position if received else 0.0
                cell[echo] = np.int32(position)
                position = (position - np.floor(position)) * _PLACES
                place[echo] = np.int32(position)
                # The phase at the end of the chirp, from the place that is tabulated.
                off = position - np.floor(position) - 0.5
                step[echo] = np.float32(off * (math.pi * samples / (_PLACES * cells)))
                turns = length[echo] * per_m * (middle - 0.5 * tones.slope * per_m * length[echo])
                across, up = phasor(turns)
                cosine[echo] = np.float32(across if received else 0.0)
                sine[echo] = np.float32(up if received else 0.0)
            # The coefficients of its Legendre polynomials, turned by that phase.
            for term in range(nodes):
                real, imaginary = amplitude[0, term + 1], amplitude[1, term + 1]
                real[:] = 0
                imaginary[:] = 0
                for node in range(nodes):
                    weight = tones.weights[term, node]
                    own = tones.amplitude[node, chirps[i], receiver]
                    for echo in range(echoes):
                        real[echo] += weight * own[echo].real
                        imaginary[echo] += weight * own[echo].imag
                odd = term % 2 == 1
                for echo in range(echoes):
                    a, b = real[echo], imaginary[echo]
                    real[echo], imaginary[echo] = _turned(a, b, cosine[echo], sine[echo], odd)
            # Correct for the step to the tabulated place, and spread.
            _step(amplitude, step, terms)
            _spread(0, cell, place, terms, values, summed, grid[i, receiver])


@inlined(fastmath={"contract"})
def _step(amplitude, step, out):
    """Fill ``out (2, term, echo)`` with amplitudes times 1 + j step x.

    The rows of ``amplitude (2, 1 + term + 1, echo)`` before the first term and after the last are
    zeros. A sum of P_(k-1) and P_(k+1) is x P_k.
    """
    # (2k + 1) x P_k = k P_(k-1) + (k + 1) P_(k+1). Odd terms are stored times j: an even term takes
    # j times an odd one as it is stored, an odd term takes j twice, which is -1.
    for term in range(out.shape[1]):
        sign = -1 if term % 2 == 1 else 1
        less = np.float32(sign * term / (2 * term - 1))
        more = np.float32(sign * (term + 1) / (2 * term + 3))
        for part in range(2):
            a, b, c = amplitude[part, term], amplitude[part, term + 1], amplitude[part, term + 2]
            target = out[part, term]
            for i in range(len(step)):
                target[i] = b[i] + step[i] * (less * a[i] + more * c[i])


# -- tones at anchors --


@compiled(fastmath={"contract"})
def fill_anchors(start, stop, chirps, length, amplitude, which, weights, anchors):
    """Fill `Anchors` with some echoes, ``which (kept,)``, at chirps ``start`` to ``stop``.

    Each of the ``chirps (anchor, tx)`` is one of ``length (chirp, rx, echo)`` and ``amplitude
    (node, chirp, rx, echo)``. Amplitudes are summed over the nodes by ``weights (3, node)``
    float32, for each of Legendre's polynomials.
    """
    nodes, _, receivers, _ = amplitude.shape
    lengths, level, change = anchors
    flat, transmitters = len(which) - change.shape[5], chirps.shape[1]
    for item in range(start, stop):
        anchor, tx = item // transmitters, item % transmitters
        # The chirp at which this transmitter has its anchor.
        chirp = chirps[anchor, tx]
        for receiver in range(receivers):
            for kept in range(len(which)):
                echo = which[kept]
                lengths[anchor, tx, receiver, kept] = length[chirp, receiver, echo]
                # The mean over the sweep, and of echoes that change its first two polynomials.
                for term in range(1 if kept < flat else 3):
                    total = np.complex64(0)
                    for node in range(nodes):
                        total += weights[term, node] * amplitude[node, chirp, receiver, echo]
                    target = level if term == 0 else change[term - 1]
                    i = kept if term == 0 else kept - flat
                    target[0, anchor, tx, receiver, i] = total.real
                    target[1, anchor, tx, receiver, i] = total.imag


@inlined()
def _course(length, carrier, slope, cells_per_m, place, turn, steps):
    """Fill in places and phases of tones at their first anchor, and the turns to the others.

    They are ``place`` and ``turn (echo,)`` and ``steps (3, echo)`` float32, for lengths (4, echo).
    """
    # The phase in the middle of the chirp, with the term of the squared delay.
    turns_per_m = 1 / SPEED_OF_LIGHT_MPS
    bend = 0.5 * slope * turns_per_m
    for echo in range(length.shape[1]):
        own = length[0, echo]
        # Whole turns are taken out in float64; the turns between anchors are few enough for
        # float32.
        before = own * turns_per_m * (carrier - bend * own)
        place[echo] = np.float32(own * cells_per_m)
        turn[echo] = np.float32(before - np.floor(before))
        for step in range(3):
            own = length[step + 1, echo]
            after = own * turns_per_m * (carrier - bend * own)
            steps[step, echo] = np.float32(after - before)
            before = after


@compiled(fastmath={"contract"})
def _spread_anchored(chirps, anchors, between, samples, values, grid):
    """Fill ``grid (chirp, rx, cell)`` with the windows of the tones of some chirps.

    What chirps one after another have in common, their anchors and their Tx, is computed once.
    """
    receivers, cells = grid.shape[1:]
    echoes, changing = anchors.length.shape[3], anchors.change.shape[5]
    flat = echoes - changing
    cells_per_m = between.slope / SPEED_OF_LIGHT_MPS / between.sample_rate * cells
    cell, place = np.empty((2, echoes), dtype=np.int32)
    begin, turn, cosine, sine = np.empty((4, echoes), dtype=np.float32)
    steps, terms = np.empty((3, echoes), np.float32), np.empty((2, 3, echoes), np.float32)
    summed = np.empty(cells + values.shape[2], dtype=np.complex64)
    pace, end = np.float32(0), np.float32(cells)
    for receiver in range(receivers):
        for i in range(len(chirps)):
            chirp, before = chirps[i], chirps[max(i - 1, 0)]
            first, tx, w = between.first[chirp], between.tx[chirp], between.weight[chirp]
            # Places and phases at the anchors, where these or the transmitter are new.
            if i == 0 or first != between.first[before] or tx != between.tx[before]:
                middle = between.carrier[chirp]
                middle += between.slope * (samples // 2) / between.sample_rate
                own = anchors.length[first : first + ANCHORS, tx, receiver]
                _course(own, middle, between.slope, cells_per_m, begin, turn, steps)
                # While its phase grows by one turn, a tone moves on by so many cells.
                pace = np.float32(cells_per_m * SPEED_OF_LIGHT_MPS / middle)
            # The cubic as its value at the first anchor and the differences after it, for the
            # weights of the four anchors add up to 1.
            v0, v1, v2, v3 = np.float32(w[0]), np.float32(w[1]), np.float32(w[2]), np.float32(w[3])
            after0, after1 = np.float32(w[1] + w[2] + w[3]), np.float32(w[2] + w[3])
            # Interpolate, in vector lanes over the echoes: places and phases, then amplitudes.
            for echo in range(echoes):
                moved = after0 * steps[0, echo] + after1 * steps[1, echo] + v3 * steps[2, echo]
                at = begin[echo] + pace * moved
                received = at >= 0 and at < end
                at = at if received else np.float32(0)
                cell[echo] = np.int32(at)
                place[echo] = np.int32((at - np.floor(at)) * np.float32(_PLACES))
                across, up = phasor_float32(turn[echo] + moved)
                cosine[echo] = across if received else np.float32(0)
                sine[echo] = up if received else np.float32(0)
            for term in range(3 if changing else 1):
                source = anchors.level if term == 0 else anchors.change[term - 1]
                past = 0 if term == 0 else flat
                c, s = cosine[past:], sine[past:]
                a0, b0 = source[0, first, tx, receiver], source[1, first, tx, receiver]
                a1, b1 = source[0, first + 1, tx, receiver], source[1, first + 1, tx, receiver]
                a2, b2 = source[0, first + 2, tx, receiver], source[1, first + 2, tx, receiver]
                a3, b3 = source[0, first + 3, tx, receiver], source[1, first + 3, tx, receiver]
                re, im = terms[0, term, past:], terms[1, term, past:]
                for n in range(len(c)):
                    a = v0 * a0[n] + v1 * a1[n] + v2 * a2[n] + v3 * a3[n]
                    b = v0 * b0[n] + v1 * b1[n] + v2 * b2[n] + v3 * b3[n]
                    re[n], im[n] = _turned(a, b, c[n], s[n], term == 1)
            _spread(flat, cell, place, terms, values, summed, grid[i, receiver])
