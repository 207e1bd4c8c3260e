"""The sum of tones whose lengths and amplitudes are known at anchors: instants some cycles apart.

Between anchors both are cubics in time. A tone is spread over a few cells of a grid of beat
frequencies, as by `rtradar.kernels.nufft`, but with so few cells that the sum is good to -60 dB:
enough for ghosts, which are weaker than what they are ghosts of. An amplitude may be a parabola
over the sweep: the sample number times a tone is the derivative of the spread tone.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray
from scipy import fft

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.elementary import phasor
from rtradar.kernels.jit import compiled
from rtradar.kernels.nufft import closed_grid

ANCHORS = 4
"""Anchors around a chirp through which the cubic goes."""

_TAPS = 6
"""Cells over which a tone is spread."""

_BEFORE = _TAPS // 2 - 1
"""Cells before that of the tone."""

_RATIO = 1.4
"""Least number of cells for each sample."""

_PLACES = 512
"""Places in a cell at which the window is tabulated: more would leave the processor's cache."""

_CHIRPS_AT_ONCE = 48


class Anchors(NamedTuple):
    """Echoes at the anchors of each Tx, receivers side by side.

    ``length (anchor, tx, rx, echo)`` float64 [m], ``level (2, anchor, tx, rx, echo)`` float32, real
    and imaginary parts of amplitudes [m]. Those of the last echoes change over the sweep by
    ``change[0] u + change[1] u^2 (2, 2, anchor, tx, rx, changing)``, u = n / samples - 1/2.
    """

    length: NDArray[np.float64]
    level: NDArray[np.float32]
    change: NDArray[np.float32]


class Between(NamedTuple):
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


class _Window(NamedTuple):
    """The window of a tone, and what undoes it after the FFT.

    ``values (power, place, tap)`` are for amplitudes as the powers 0 to 2 of u, less the factor j
    of the first; ``weights (sample,)`` are what the sums are multiplied by.
    """

    values: NDArray[np.float32]
    weights: NDArray[np.float32]


def add_anchored_tones(
    anchors: Anchors, between: Between, sweep: Sweep, out: NDArray[np.complex64]
) -> None:
    """Add the sum of the tones to ``out (chirp, rx, sample)`` [m].

    Tones whose beat frequency lies outside [0, sample rate) add nothing.
    """
    chirps, receivers, samples = out.shape
    cells = fft.next_fast_len(max(int(np.ceil(_RATIO * samples)), _TAPS))
    half, window = samples // 2, _window(samples, cells)
    # Chirps of one Tx and of the same anchors in turn, so that these stay in the cache.
    order = np.lexsort((between.first, between.tx))
    for begin in range(0, chirps, _CHIRPS_AT_ONCE):
        some = order[begin : begin + _CHIRPS_AT_ONCE]
        first, weight, tx, carrier = between
        own = Between(first[some], weight[some], tx[some], carrier[some])
        grid = np.empty((len(some), receivers, cells), dtype=np.complex64)
        _spread_anchored(anchors, own, sweep, half, window.values, grid)
        summed = fft.ifft(grid, axis=-1, norm="forward", overwrite_x=True, workers=-1)
        _add_rows(summed, window.weights, half, some, out)


@lru_cache
def _window(samples: int, cells: int) -> _Window:
    # Kaiser and Bessel's window, and its Fourier transform.
    shape = np.pi * _TAPS * (1 - samples / (2 * cells))

    def window(distance: NDArray[np.float64]) -> NDArray[np.float64]:
        inside = np.maximum(1 - (2 * distance / _TAPS) ** 2, 0.0)
        return np.asarray(np.i0(shape * np.sqrt(inside)) / np.i0(shape))

    place = (np.arange(_PLACES) + 0.5) / _PLACES
    distance = np.arange(_TAPS) - _BEFORE - place[:, None]
    step = 1e-3
    before, here, after = (window(distance + away) for away in (-step, 0.0, step))
    # The derivative by the tone's place on the grid is the sample number times 2j pi / cells.
    turn = cells / (2 * np.pi * samples)
    slope, bend = (after - before) / (2 * step), (before - 2 * here + after) / step**2
    values = np.stack([here, turn * slope, -(turn**2) * bend])
    fraction = (np.arange(samples) - samples // 2) / cells
    root = np.sqrt(shape**2 - (np.pi * _TAPS * fraction) ** 2)
    weights = np.i0(shape) * root / (_TAPS * np.sinh(root))
    return _Window(values.astype(np.float32), weights.astype(np.float32))


@compiled(parallel=True)
def _add_rows(summed, weights, half, rows, out):
    """Add the samples of grids after the FFT to rows of ``out``, weighted."""
    cells, samples = summed.shape[2], out.shape[2]
    for i in prange(len(rows)):
        for receiver in range(out.shape[1]):
            source, target = summed[i, receiver], out[rows[i], receiver]
            for sample in range(half):
                target[sample] += source[cells - half + sample] * weights[sample]
            for sample in range(half, samples):
                target[sample] += source[sample - half] * weights[sample]


@compiled(parallel=True, fastmath={"contract"})
def _spread_anchored(anchors, between, sweep, half, values, grid):
    """Fill ``grid (chirp, rx, cell)`` with the tones' windows, phases about sample ``half``."""
    chirps, receivers, cells = grid.shape
    echoes, changing = anchors.length.shape[3], anchors.change.shape[5]
    flat = echoes - changing
    turns_per_m = 1 / SPEED_OF_LIGHT_MPS
    cells_per_m = sweep.slope * turns_per_m / sweep.sample_rate * cells
    for chirp in prange(chirps):
        real = np.empty(cells + _TAPS, dtype=np.float32)
        imaginary = np.empty(cells + _TAPS, dtype=np.float32)
        position = np.empty(echoes)
        cosine, sine = np.empty(echoes, dtype=np.float32), np.empty(echoes, dtype=np.float32)
        turned = np.empty((6, echoes), dtype=np.float32)
        first, tx, carrier = between.first[chirp], between.tx[chirp], between.carrier[chirp]
        w = between.weight[chirp]
        w0, w1, w2, w3 = w[0], w[1], w[2], w[3]
        v0, v1, v2, v3 = np.float32(w0), np.float32(w1), np.float32(w2), np.float32(w3)
        bend = 0.5 * sweep.slope * turns_per_m
        carrier += sweep.slope * half / sweep.sample_rate
        for receiver in range(receivers):
            real[:] = 0
            imaginary[:] = 0
            l0, l1 = anchors.length[first, tx, receiver], anchors.length[first + 1, tx, receiver]
            l2 = anchors.length[first + 2, tx, receiver]
            l3 = anchors.length[first + 3, tx, receiver]
            # Interpolate, in vector lanes over the echoes: lengths and phases, then amplitudes.
            for echo in range(echoes):
                length = w0 * l0[echo] + w1 * l1[echo] + w2 * l2[echo] + w3 * l3[echo]
                position[echo] = length * cells_per_m
                across, up = phasor(length * turns_per_m * (carrier - bend * length))
                cosine[echo], sine[echo] = np.float32(across), np.float32(up)
            for power in range(3 if changing else 1):
                source = anchors.level if power == 0 else anchors.change[power - 1]
                begin = 0 if power == 0 else flat
                c, s = cosine[begin:], sine[begin:]
                a0, b0 = source[0, first, tx, receiver], source[1, first, tx, receiver]
                a1, b1 = source[0, first + 1, tx, receiver], source[1, first + 1, tx, receiver]
                a2, b2 = source[0, first + 2, tx, receiver], source[1, first + 2, tx, receiver]
                a3, b3 = source[0, first + 3, tx, receiver], source[1, first + 3, tx, receiver]
                re, im = turned[2 * power], turned[2 * power + 1]
                for i in range(len(c)):
                    a = v0 * a0[i] + v1 * a1[i] + v2 * a2[i] + v3 * a3[i]
                    b = v0 * b0[i] + v1 * b1[i] + v2 * b2[i] + v3 * b3[i]
                    re[i], im[i] = a * c[i] - b * s[i], a * s[i] + b * c[i]
            # Loops of one array each and unsigned indices: checks would cost more than the sums.
            for echo in range(echoes):
                if not (position[echo] >= 0 and position[echo] < cells):
                    continue
                cell = np.uint64(position[echo])
                at = np.uint64((position[echo] - np.float64(cell)) * _PLACES)
                a, b = turned[0, echo], turned[1, echo]
                for tap in range(np.uint64(_TAPS)):
                    real[cell + tap] += a * values[0, at, tap]
                for tap in range(np.uint64(_TAPS)):
                    imaginary[cell + tap] += b * values[0, at, tap]
                if echo >= flat:
                    # The first power has a factor j.
                    i = echo - flat
                    c1, s1, c2, s2 = -turned[3, i], turned[2, i], turned[4, i], turned[5, i]
                    for tap in range(np.uint64(_TAPS)):
                        real[cell + tap] += c1 * values[1, at, tap] + c2 * values[2, at, tap]
                    for tap in range(np.uint64(_TAPS)):
                        imaginary[cell + tap] += s1 * values[1, at, tap] + s2 * values[2, at, tap]
            closed_grid(real, imaginary, _BEFORE, grid[chirp, receiver])


def anchored_tones_reference(anchors, between, sweep, samples):
    """The sum of `add_anchored_tones` (chirp, rx, sample), by NumPy."""
    which = between.first[:, None] + np.arange(ANCHORS), between.tx[:, None]
    parts = (part[0] + 1j * part[1] for part in (anchors.level, *anchors.change))
    length, level, tilt, curve = (
        np.einsum("ck,ckre->cre", between.weight, part[which]) for part in (anchors.length, *parts)
    )
    delay = length / SPEED_OF_LIGHT_MPS
    beat, n = sweep.slope * delay, np.arange(samples)
    start = between.carrier[:, None, None] * delay - beat * delay / 2
    turns = start[..., None] + beat[..., None] * n / sweep.sample_rate
    u = (n - samples // 2) / samples
    own = np.repeat(level[..., None], samples, axis=3)
    flat = level.shape[2] - tilt.shape[2]
    own[:, :, flat:] += tilt[..., None] * u + curve[..., None] * u**2
    received = (beat >= 0) & (beat < sweep.sample_rate)
    return np.sum(own * received[..., None] * np.exp(2j * np.pi * turns), axis=2)
