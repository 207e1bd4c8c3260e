"""The sum of many tones: each spread over a few cells of a grid of beat frequencies, and one FFT.

A nonuniform FFT of type 1 (Dutt and Rokhlin, SIAM J. Sci. Comput. 14, 1993; Greengard and Lee, SIAM
Review 46, 2004), with a Gaussian. Its work grows with echoes times taps, not with echoes times
samples. An amplitude that is a parabola of frequency costs no further FFT: a power of the sample
number is a derivative with respect to the beat, so the Gaussian of such an echo is multiplied by a
parabola of the distance from it. Sums are float32, for samples that are kept as such; phases are
float64.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.elementary import phasor
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.tone_sum import Tones
from rtradar.system.threads import in_threads

_POWERS = 3
"""Powers of the sample number that one grid takes, for an amplitude at three frequencies."""

_CUBIC = (0.0, -6.0, 0.0, 32.0)
"""Chebyshev's polynomial over the chirp, by which polynomials of more powers are divided: quotient
and remainder hardly cancel, so that float32 holds both."""

MOST_NODES = 6
"""Frequencies at which amplitudes may be given: two grids."""

_TAPS = 16
"""Cells over which an echo is spread: with twice as many cells as samples what is cut off is 1e-8
of the echo over a chirp (rms), and 6e-8 at its ends."""

LEAST_SAMPLES = _TAPS
"""Samples of a chirp; with fewer an echo would go round the grid more than once."""

_BEFORE = _TAPS // 2 - 1
"""Cells before that of the echo."""

_PLACES = 1024
"""Places in a cell at which the Gaussian is tabulated; linear steps from there are off by 1e-7."""

_CHIRPS_AT_ONCE = 48
"""Chirps whose grids stay in the processor's cache between spreading and FFT."""


class _Gaussian(NamedTuple):
    """``values (place, tap)`` around an echo, their variance [cells^2], and ``weights (sample,)``.

    The weights undo the Gaussian after the FFT.
    """

    values: NDArray[np.float32]
    variance: float
    weights: NDArray[np.float32]


def sum_by_nufft(tones: Tones, out: NDArray[np.complex64]) -> None:
    """Fill ``out (chirp, rx, sample)`` with the sum of the echoes, to 1e-6 of it [m].

    The tones have at most `MOST_NODES` nodes, and powers of the sample number that count from the
    first sample; each chirp has `LEAST_SAMPLES` or more.
    """
    chirps, receivers, samples = out.shape
    cells, half = fft.next_fast_len(2 * samples), samples // 2
    gaussian = _gaussian(samples, cells)
    weights, fraction = gaussian.weights, (np.arange(samples) - half) / samples
    cubic = np.polynomial.polynomial.polyval(fraction, _CUBIC).astype(np.float32)
    parabolas = _parabolas(tones.powers, half / samples)
    for first in range(0, chirps, _CHIRPS_AT_ONCE):
        some = slice(first, min(first + _CHIRPS_AT_ONCE, chirps))
        sums = out[some]
        sums[:] = 0
        # One type and layout, or Numba would compile for each that comes.
        amplitude = np.ascontiguousarray(tones.amplitude[:, some], dtype=np.complex64)
        for number, parabola in enumerate(parabolas):
            own = tones._replace(length=tones.length[some], amplitude=amplitude, powers=parabola)
            grid = np.empty((len(sums), receivers, cells), dtype=np.complex64)
            in_threads(_spread_tones, len(grid), own, half, samples, gaussian, grid)
            summed = fft.ifft(grid, axis=-1, norm="forward", overwrite_x=True, workers=-1)
            if number > 0:
                sums *= cubic
            sums[..., :half] += summed[..., cells - half :] * weights[:half]
            sums[..., half:] += summed[..., : samples - half] * weights[half:]


def _parabolas(powers: NDArray[np.float64], middle: float) -> list[NDArray[np.float64]]:
    """The same polynomials about the middle of the chirp: one parabola (3, node), or two.

    The first of two is to be multiplied by `_CUBIC` before the second is added.
    """
    nodes = powers.shape[1]
    shifted = np.zeros((2 * _POWERS, nodes))
    for low in range(len(powers)):
        for high in range(low, len(powers)):
            shifted[low] += math.comb(high, low) * middle ** (high - low) * powers[high]
    parts = np.zeros((2, _POWERS, nodes))
    for node, column in enumerate(shifted.T):
        for part, own in zip(parts, np.polynomial.polynomial.polydiv(column, _CUBIC), strict=True):
            part[: np.size(own), node] = own
    return list(parts) if len(powers) > _POWERS else [parts[1]]


@lru_cache
def _gaussian(samples: int, cells: int) -> _Gaussian:
    # So wide that what is cut off weighs as much as what folds over.
    ratio = cells / samples
    variance = _TAPS * ratio / (4 * math.pi * (ratio - 0.5))
    place = (np.arange(_PLACES) + 0.5) / _PLACES
    distance = np.arange(_TAPS) - _BEFORE - place[:, None]
    turn = 2 * np.pi * (np.arange(samples) - samples // 2) / cells
    weights = np.exp(variance * turn**2 / 2) / math.sqrt(2 * math.pi * variance)
    values = np.exp(-(distance**2) / (2 * variance))
    return _Gaussian(values.astype(np.float32), variance, weights.astype(np.float32))


@inlined()
def _tap_polynomial(start, c0, c1, c2, width, variance, off):
    """Coefficients of the cubic of the tap's distance that multiplies the tabulated Gaussian.

    A power of the sample number is one of the distance from the echo: constant + slant x + bend
    x^2. The polynomial is moved to the tabulated place, ``off`` before the echo, and multiplied by
    the Gaussian's own change from there.
    """
    bend = start * c2 * (width * width / variance)
    constant, slant = start * c0 + bend, start * c1 * complex(0.0, -width / variance)
    bend = -bend / variance
    slope = off / variance
    twist = slope * bend
    bend, slant, constant = (
        bend + slope * slant,
        slant + slope * constant - 2 * off * bend,
        constant - off * slant,
    )
    return constant, slant, bend, twist


@inlined()
def closed_grid(real, imaginary, before, out):
    """Fill ``out (cell,)`` with sums whose first cell is number ``before``.

    Cells beyond an end belong to the other end.
    """
    cells = len(out)
    for cell in range(before):
        real[cells + cell] += real[cell]
        imaginary[cells + cell] += imaginary[cell]
    for cell in range(before, len(real) - cells):
        real[cell] += real[cells + cell]
        imaginary[cell] += imaginary[cells + cell]
    for cell in range(cells):
        out[cell] = complex(real[before + cell], imaginary[before + cell])


@compiled(fastmath={"contract"})
def _spread_tones(start, stop, tones, half, samples, gaussian, grid):
    """Fill ``grid (chirp, rx, cell)`` with Gaussians of the tones, phases about sample ``half``.

    Chirps ``start`` to ``stop`` are filled.
    """
    _, receivers, cells = grid.shape
    nodes, echoes = tones.amplitude.shape[0], tones.length.shape[2]
    powers, variance = tones.powers, gaussian.variance
    width = cells / (2 * math.pi * samples)
    for chirp in range(start, stop):
        real = np.empty(cells + _TAPS, dtype=np.float32)
        imaginary = np.empty(cells + _TAPS, dtype=np.float32)
        position, across, up = np.empty(echoes), np.empty(echoes), np.empty(echoes)
        for receiver in range(receivers):
            real[:] = 0
            imaginary[:] = 0
            # Positions on the grid and phases, in vector lanes over the echoes.
            for echo in range(echoes):
                delay = tones.length[chirp, receiver, echo] / SPEED_OF_LIGHT_MPS
                beat = tones.slope * delay
                position[echo] = beat / tones.sample_rate * cells
                across[echo], up[echo] = phasor(
                    tones.start_frequency * delay
                    - 0.5 * beat * delay
                    + half * beat / tones.sample_rate
                )
            for echo in range(echoes):
                if not (position[echo] >= 0 and position[echo] < cells):
                    continue
                c0, c1, c2 = 0j, 0j, 0j
                for node in range(nodes):
                    own = tones.amplitude[node, chirp, receiver, echo]
                    c0 += powers[0, node] * own
                    c1 += powers[1, node] * own
                    c2 += powers[2, node] * own
                cell = int(position[echo])
                place = int((position[echo] - cell) * _PLACES)
                known = (place + 0.5) / _PLACES
                c, s, b, t = _tap_polynomial(
                    complex(across[echo], up[echo]),
                    c0,
                    c1,
                    c2,
                    width,
                    variance,
                    position[echo] - cell - known,
                )
                # Real and imaginary parts in float32, in vector lanes over the taps.
                c_re, c_im = np.float32(c.real), np.float32(c.imag)
                s_re, s_im = np.float32(s.real), np.float32(s.imag)
                b_re, b_im = np.float32(b.real), np.float32(b.imag)
                t_re, t_im = np.float32(t.real), np.float32(t.imag)
                nearest = np.float32(-_BEFORE - known)
                taps = gaussian.values[place]
                re, im = real[cell : cell + _TAPS], imaginary[cell : cell + _TAPS]
                for tap in range(_TAPS):
                    x = np.float32(tap) + nearest
                    re[tap] += taps[tap] * (c_re + x * (s_re + x * (b_re + x * t_re)))
                    im[tap] += taps[tap] * (c_im + x * (s_im + x * (b_im + x * t_im)))
            closed_grid(real, imaginary, _BEFORE, grid[chirp, receiver])
