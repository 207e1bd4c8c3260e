"""The sum of tones whose lengths and amplitudes are known at anchors: instants some cycles apart.

Between anchors both are cubics in time. A tone is spread over a few cells of a grid of beat
frequencies, as by `rtradar.kernels.nufft`, but with so few cells that the sum is good to -60 dB:
enough for ghosts, which are weaker than what they are ghosts of. An amplitude may be a parabola
over the sweep: the sample number times a tone is the derivative of the spread tone.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.nufft import closed_grid
from rtradar.system.threads import thread_map

ANCHORS = 4
"""Anchors around a chirp through which the cubic goes."""

_TAPS, _WIDER = 4, 6
"""Cells over which a tone is spread, and one whose amplitude changes over the sweep."""

_BEFORE = _WIDER // 2 - 1
"""Cells before that of the tone."""

_RATIO = 2.0
"""Least number of cells for each sample."""

_PLACES, _COARSER = 1024, 4
"""Places in a cell at which windows are tabulated, so many times fewer where the amplitude changes:
more would leave the fastest cache, and take twice as long."""

_CHIRPS_AT_ONCE = 24


class Anchors(NamedTuple):
    """Echoes at the anchors of each Tx, receivers side by side.

    ``length (anchor, tx, rx, echo)`` float64 [m], ``level (2, anchor, tx, rx, echo)`` float32, real
    and imaginary parts of amplitudes [m]. Those of the last echoes change over the sweep by
    ``change[0] u + change[1] u^2 (2, 2, anchor, tx, rx, changing)``, u = n / samples - 1/2.
    """

    length: NDArray[np.float64]
    level: NDArray[np.float32]
    change: NDArray[np.float32]


class BetweenAnchors(NamedTuple):
    """Where chirps are between anchors.

    Each chirp has the number of the ``first (chirp,)`` of its `ANCHORS` anchors and their ``weight
    (chirp, 4)``, its ``tx``, and the ``carrier`` on which it starts [Hz].
    """

    first: NDArray[np.int64]
    weight: NDArray[np.float64]
    tx: NDArray[np.int64]
    carrier: NDArray[np.float64]


class Sweep(NamedTuple):
    """Slope [Hz/s] and sample rate [Hz] of the chirps."""

    slope: float
    sample_rate: float


@compiled(fastmath={"contract"})
def fill_anchors(start, stop, chirps, length, amplitude, which, weights, anchors):
    """Fill `Anchors` with some echoes, ``which (kept,)``, at chirps ``start`` to ``stop``.

    Each of the ``chirps (anchor, tx)`` is one of ``length (chirp, rx, echo)`` and ``amplitude
    (node, chirp, rx, echo)``. Amplitudes are summed over the nodes by ``weights (4, node)``
    float32: the first for echoes that stay the same over the sweep, the others for the powers of u.
    """
    nodes, _, receivers, _ = amplitude.shape
    lengths, level, change = anchors
    flat, transmitters = len(which) - change.shape[5], chirps.shape[1]
    for item in range(start, stop):
        anchor, tx = item // transmitters, item % transmitters
        chirp = chirps[anchor, tx]
        for receiver in range(receivers):
            for kept in range(len(which)):
                echo = which[kept]
                lengths[anchor, tx, receiver, kept] = length[chirp, receiver, echo]
                for power in range(1 if kept < flat else 3):
                    total = np.complex64(0)
                    for node in range(nodes):
                        weight = weights[0 if kept < flat else power + 1, node]
                        total += weight * amplitude[node, chirp, receiver, echo]
                    if power == 0:
                        level[0, anchor, tx, receiver, kept] = total.real
                        level[1, anchor, tx, receiver, kept] = total.imag
                    else:
                        change[power - 1, 0, anchor, tx, receiver, kept - flat] = total.real
                        change[power - 1, 1, anchor, tx, receiver, kept - flat] = total.imag


class _Windows(NamedTuple):
    """The windows of tones, and what undoes them after the FFT.

    ``level (place, tap)`` is for tones of constant amplitudes; ``powers (3, place, tap)`` are, for
    others, for amplitudes as the powers 0 to 2 of u, less the factor j of the first. The sums are
    multiplied by ``weights (sample,)``.
    """

    level: NDArray[np.float32]
    powers: NDArray[np.float32]
    weights: NDArray[np.float32]


def add_anchored_tones(
    anchors: Anchors, between: BetweenAnchors, sweep: Sweep, out: NDArray[np.complex64]
) -> None:
    """Add the sum of the tones to ``out (chirp, rx, sample)`` [m].

    Tones whose beat frequency lies outside [0, sample rate) add nothing.
    """
    chirps, receivers, samples = out.shape
    cells = fft.next_fast_len(max(int(np.ceil(_RATIO * samples)), _WIDER))
    half, (level, powers, weights) = samples // 2, _windows(samples, cells)
    # Chirps of one Tx and of the same anchors in turn, so that these stay in the cache.
    order = np.lexsort((between.first, between.tx))

    def fill(begin: int) -> None:
        some = order[begin : begin + _CHIRPS_AT_ONCE]
        first, weight, tx, carrier = between
        own = BetweenAnchors(first[some], weight[some], tx[some], carrier[some])
        changed = (np.diff(own.first) != 0) | (np.diff(own.tx) != 0)
        runs = np.concatenate([[0], np.flatnonzero(changed) + 1, [len(some)]])
        grid = np.empty((len(some), receivers, cells), dtype=np.complex64)
        items = (len(runs) - 1) * receivers
        _spread_anchored(0, items, anchors, own, runs, sweep, half, level, powers, grid)
        summed = fft.ifft(grid, axis=-1, norm="forward", overwrite_x=True)
        _add_rows(0, len(some), summed, weights, half, some, out)

    thread_map(fill, range(0, chirps, _CHIRPS_AT_ONCE))


@lru_cache
def _windows(samples: int, cells: int) -> _Windows:
    half = samples // 2
    sample = np.arange(-half, half + 1)[:, None]
    # The Fourier transform of Kaiser and Bessel's window.
    shape = np.pi * _TAPS * (1 - samples / (2 * cells))
    root = np.sqrt(shape**2 - (np.pi * _TAPS * sample / cells) ** 2)
    weights = np.i0(shape) * root / (_TAPS * np.sinh(root))

    def fitted(power: int, taps: int, places: int) -> NDArray[np.float32]:
        """Values (place, tap) with the least squared error over the samples."""
        cell, place = np.arange(taps) - (taps // 2 - 1), (np.arange(places) + 0.5) / places
        of_cells = weights * np.exp(2j * np.pi / cells * sample * cell)
        tones = (sample / samples) ** power * np.exp(2j * np.pi / cells * sample * place)
        found = np.linalg.lstsq(of_cells, tones, rcond=None)[0].T
        return (found.imag if power % 2 else found.real).astype(np.float32)

    powers = np.array([fitted(power, _WIDER, _PLACES // _COARSER) for power in range(3)])
    return _Windows(fitted(0, _TAPS, _PLACES), powers, weights[:samples, 0].astype(np.float32))


@compiled()
def _add_rows(start, stop, summed, weights, half, rows, out):
    """Add the samples of grids ``start`` to ``stop`` to rows of ``out`` after the FFT, weighted."""
    cells, samples = summed.shape[2], out.shape[2]
    for i in range(start, stop):
        for receiver in range(out.shape[1]):
            source, target = summed[i, receiver], out[rows[i], receiver]
            for sample in range(half):
                target[sample] += source[cells - half + sample] * weights[sample]
            for sample in range(half, samples):
                target[sample] += source[sample - half] * weights[sample]


@inlined(fastmath={"contract"})
def _phasor(turns):
    """Cosine and sine of a phase [turns] in float32, to 3e-7: Taylor's series of its half."""
    half = np.float32(math.pi) * (turns - np.floor(turns + np.float32(0.5)))
    x = half * half
    sine = np.float32(1 / 362880) - x * np.float32(1 / 39916800)
    sine = np.float32(1 / 120) + x * (x * sine - np.float32(1 / 5040))
    sine = half + half * x * (x * sine - np.float32(1 / 6))
    cosine = np.float32(1 / 40320) - x * np.float32(1 / 3628800)
    cosine = np.float32(1 / 24) + x * (x * cosine - np.float32(1 / 720))
    cosine = np.float32(1) + x * (x * cosine - np.float32(0.5))
    return np.float32(1) - np.float32(2) * sine * sine, np.float32(2) * sine * cosine


@inlined()
def _course(length, carrier, sweep, cells_per_m, place, turn, steps):
    """Places and phases of tones at the first of their anchors, and the turns to the others.

    Filled are ``place`` and ``turn (echo,)`` and ``steps (3, echo)`` float32, by lengths (4, echo).
    """
    turns_per_m = 1 / SPEED_OF_LIGHT_MPS
    bend = 0.5 * sweep.slope * turns_per_m
    for echo in range(length.shape[1]):
        own = length[0, echo]
        before = own * turns_per_m * (carrier - bend * own)
        place[echo] = np.float32(own * cells_per_m)
        turn[echo] = np.float32(before - np.floor(before))
        for step in range(3):
            own = length[step + 1, echo]
            after = own * turns_per_m * (carrier - bend * own)
            steps[step, echo] = np.float32(after - before)
            before = after


@compiled(fastmath={"contract"})
def _spread_anchored(start, stop, anchors, between, runs, sweep, half, level, powers, grid):
    """Fill ``grid (chirp, rx, cell)`` with the tones' windows, phases about sample ``half``.

    The chirps of a run, from ``runs (run + 1,)``, have their anchors and their Tx in common. Filled
    are items ``start`` to ``stop``, one for each run and receiver.
    """
    receivers, cells = grid.shape[1:]
    echoes, changing = anchors.length.shape[3], anchors.change.shape[5]
    flat = echoes - changing
    cells_per_m = sweep.slope / SPEED_OF_LIGHT_MPS / sweep.sample_rate * cells
    for item in range(start, stop):
        run, receiver = item // receivers, item % receivers
        real, imaginary = np.empty((2, cells + _WIDER), dtype=np.float32)
        begin, turn = np.empty((2, echoes), dtype=np.float32)
        steps, turned = np.empty((3, echoes), dtype=np.float32), np.empty((6, echoes), np.float32)
        cosine, sine = np.empty((2, echoes), dtype=np.float32)
        place = np.empty(echoes, dtype=np.int32)
        first, tx = between.first[runs[run]], between.tx[runs[run]]
        carrier = between.carrier[runs[run]] + sweep.slope * half / sweep.sample_rate
        own = slice(first, first + ANCHORS)
        _course(anchors.length[own, tx, receiver], carrier, sweep, cells_per_m, begin, turn, steps)
        # A tone that turns on by one turn goes on by so many cells.
        pace, end = np.float32(cells_per_m * SPEED_OF_LIGHT_MPS / carrier), np.float32(cells)
        for chirp in range(runs[run], runs[run + 1]):
            real[:] = 0
            imaginary[:] = 0
            w = between.weight[chirp]
            v0, v1, v2, v3 = np.float32(w[0]), np.float32(w[1]), np.float32(w[2]), np.float32(w[3])
            after0, after1 = np.float32(w[1] + w[2] + w[3]), np.float32(w[2] + w[3])
            # Interpolate, in vector lanes over the echoes: places and phases, then amplitudes.
            for echo in range(echoes):
                moved = after0 * steps[0, echo] + after1 * steps[1, echo] + v3 * steps[2, echo]
                at = begin[echo] + pace * moved
                received = np.float32(1) if at >= 0 and at < end else np.float32(0)
                place[echo] = np.int32(at * received * np.float32(_PLACES))
                across, up = _phasor(turn[echo] + moved)
                cosine[echo], sine[echo] = across * received, up * received
            for power in range(3 if changing else 1):
                source = anchors.level if power == 0 else anchors.change[power - 1]
                past = 0 if power == 0 else flat
                c, s = cosine[past:], sine[past:]
                a0, b0 = source[0, first, tx, receiver], source[1, first, tx, receiver]
                a1, b1 = source[0, first + 1, tx, receiver], source[1, first + 1, tx, receiver]
                a2, b2 = source[0, first + 2, tx, receiver], source[1, first + 2, tx, receiver]
                a3, b3 = source[0, first + 3, tx, receiver], source[1, first + 3, tx, receiver]
                re, im = turned[2 * power], turned[2 * power + 1]
                for i in range(len(c)):
                    a = v0 * a0[i] + v1 * a1[i] + v2 * a2[i] + v3 * a3[i]
                    b = v0 * b0[i] + v1 * b1[i] + v2 * b2[i] + v3 * b3[i]
                    re[i], im[i] = a * c[i] - b * s[i], a * s[i] + b * c[i]
            _spread(place, turned, flat, level, powers, real, imaginary)
            closed_grid(real, imaginary, _BEFORE, grid[chirp, receiver])


@inlined(fastmath={"contract"})
def _spread(place, turned, flat, level, powers, real, imaginary):
    """Add the windows of tones to a grid; places are cells times `_PLACES`.

    Amplitudes are ``turned (6, echo)``: those of the powers one after another, of each the real and
    the imaginary part; of powers beyond 0 only those after the first ``flat`` echoes.
    """
    # Loops of one array each and unsigned indices: checks would cost more than the sums.
    aside = np.uint64((_WIDER - _TAPS) // 2)
    for echo in range(flat):
        whole = np.uint32(place[echo])
        cell, at = np.uint64(whole // np.uint32(_PLACES)), np.uint64(whole % np.uint32(_PLACES))
        cell += aside
        a, b = turned[0, echo], turned[1, echo]
        for tap in range(np.uint64(_TAPS)):
            real[cell + tap] += a * level[at, tap]
        for tap in range(np.uint64(_TAPS)):
            imaginary[cell + tap] += b * level[at, tap]
    for echo in range(flat, len(place)):
        whole, i = np.uint32(place[echo]), echo - flat
        cell, at = np.uint64(whole // np.uint32(_PLACES)), np.uint64(whole % np.uint32(_PLACES))
        at //= np.uint64(_COARSER)
        # The first power has a factor j.
        a0, a1, a2 = turned[0, echo], -turned[3, i], turned[4, i]
        b0, b1, b2 = turned[1, echo], turned[2, i], turned[5, i]
        w0, w1, w2 = powers[0, at], powers[1, at], powers[2, at]
        for tap in range(np.uint64(_WIDER)):
            real[cell + tap] += a0 * w0[tap] + a1 * w1[tap] + a2 * w2[tap]
        for tap in range(np.uint64(_WIDER)):
            imaginary[cell + tap] += b0 * w0[tap] + b1 * w1[tap] + b2 * w2[tap]
