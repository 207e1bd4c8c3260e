"""Many tones at once: each spread over a few cells of a grid of beat frequencies, and one FFT for all of them.

A nonuniform FFT of type 1 (Dutt and Rokhlin, SIAM J. Sci. Comput. 14, 1993; Greengard and Lee, SIAM Review 46, 2004), with a
Gaussian. Its work grows with echoes times taps, not with echoes times samples. An amplitude that is a parabola of frequency
costs no further FFT: a power of the sample number is a derivative with respect to the beat, so the Gaussian of such an echo is
multiplied by a parabola of the distance from it. In float32, for samples that are kept as such; phases are float64.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import prange
from numpy.typing import NDArray
from scipy import fft

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.jit import compiled
from rtradar.kernels.phasor import phasor

_POWERS = 3
"""Powers of the sample number that one grid takes: all of an amplitude given at up to three frequencies."""

_CUBIC = (0.0, -6.0, 0.0, 32.0)
"""Chebyshev's polynomial over the chirp, by which more are divided: float32 then holds both parts, which hardly cancel."""

MOST_NODES = 6
"""Frequencies at which amplitudes may be given: two grids."""

_TAPS = 16
"""Cells that an echo is spread over: with twice as many cells as samples, what is left out is 1e-8 of the echo."""

LEAST_SAMPLES = _TAPS
"""In a chirp: of half as many an echo would go round the grid, and of a quarter more than once."""

_BEFORE = _TAPS // 2 - 1
"""Cells before that of the echo."""

_PLACES = 1024
"""In a cell for which the Gaussian is known; from there to an echo it goes straight, which is off by 1e-7."""

_CHIRPS_AT_ONCE = 48
"""Their grids stay in the processor's cache between the two steps."""


def spread_sum(
    length: NDArray[np.float64],
    amplitude: NDArray[np.complexfloating],
    powers: NDArray[np.float64],
    start_frequency: float,
    slope: float,
    sample_rate: float,
    out: NDArray[np.complex64],
) -> None:
    """Fill ``out (chirp, rx, sample)`` with the sum of the echoes, to 1e-6 of it.

    Parameters
    ----------
    length : (chirp, rx, echo) float64
        [m]; echoes whose beat lies outside [0, sample rate) are left out.
    amplitude : (node, chirp, rx, echo) complex
        [m], at `MOST_NODES` frequencies at most.
    powers : (power, node) float64
        Weights of the values at the nodes in the polynomial in the sample number over the number of samples.
    start_frequency, slope, sample_rate : float
        [Hz], [Hz/s], [Hz].
    out : (chirp, rx, sample) complex64
        IF samples, overwritten; each chirp has `LEAST_SAMPLES` or more [m].
    """
    chirps, receivers, samples = out.shape
    cells, half = fft.next_fast_len(2 * samples), samples // 2
    gaussian, variance, weights = _gaussian(samples, cells)
    parabolas = _parabolas(powers, half / samples)
    cubic = np.polynomial.polynomial.polyval((np.arange(samples) - half) / samples, _CUBIC).astype(
        np.float32
    )
    for first in range(0, chirps, _CHIRPS_AT_ONCE):
        some = slice(first, min(first + _CHIRPS_AT_ONCE, chirps))
        sums = out[some]
        sums[:] = 0
        for number, parabola in enumerate(parabolas):
            grid = np.empty((len(sums), receivers, cells), dtype=np.complex64)
            own = length[some], amplitude[:, some]
            _spread(
                *own,
                parabola,
                start_frequency,
                slope,
                sample_rate,
                half,
                samples,
                gaussian,
                variance,
                grid,
            )
            summed = fft.ifft(grid, axis=-1, norm="forward", overwrite_x=True, workers=-1)
            if number > 0:
                sums *= cubic
            sums[..., :half] += summed[..., cells - half :] * weights[:half]
            sums[..., half:] += summed[..., : samples - half] * weights[half:]


def _parabolas(powers: NDArray[np.float64], middle: float) -> list[NDArray[np.float64]]:
    """The same polynomials of the sample number, counted from the middle of the chirp: one parabola (3, node), or two.

    The first of two is to be multiplied by `_CUBIC` before the second is added.
    """
    nodes = powers.shape[1]
    shifted = np.zeros((2 * _POWERS, nodes))
    for low in range(len(powers)):
        for high in range(low, len(powers)):
            shifted[low] += math.comb(high, low) * middle ** (high - low) * powers[high]
    parts = np.zeros((2, _POWERS, nodes))
    for node, column in enumerate(shifted.T):
        quotient, remainder = (
            np.atleast_1d(part) for part in np.polynomial.polynomial.polydiv(column, _CUBIC)
        )
        parts[0, : len(quotient), node], parts[1, : len(remainder), node] = quotient, remainder
    return list(parts) if len(powers) > _POWERS else [parts[1]]


@lru_cache
def _gaussian(samples: int, cells: int) -> tuple[NDArray[np.float32], float, NDArray[np.float32]]:
    """Values (place, tap) around an echo, their variance [cells^2], and weights (sample,) that undo it after the FFT."""
    # So wide that what is cut off weighs as much as what folds over.
    ratio = cells / samples
    variance = _TAPS * ratio / (4 * math.pi * (ratio - 0.5))
    place = (np.arange(_PLACES) + 0.5) / _PLACES
    distance = np.arange(_TAPS) - _BEFORE - place[:, None]
    turn = 2 * np.pi * (np.arange(samples) - samples // 2) / cells
    weights = np.exp(variance * turn**2 / 2) / math.sqrt(2 * math.pi * variance)
    return (
        np.exp(-(distance**2) / (2 * variance)).astype(np.float32),
        variance,
        weights.astype(np.float32),
    )


@compiled(parallel=True, fastmath={"contract"})
def _spread(
    length,
    amplitude,
    powers,
    start_frequency,
    sweep,
    sample_rate,
    half,
    samples,
    gaussian,
    variance,
    grid,
):
    chirps, receivers, cells = grid.shape
    nodes, echoes = amplitude.shape[0], length.shape[2]
    width = cells / (2 * math.pi * samples)
    for chirp in prange(chirps):
        real, imaginary = (
            np.empty(cells + _TAPS, dtype=np.float32),
            np.empty(cells + _TAPS, dtype=np.float32),
        )
        position, across, up = np.empty(echoes), np.empty(echoes), np.empty(echoes)
        for receiver in range(receivers):
            real[:] = 0
            imaginary[:] = 0
            # In vector lanes over the echoes.
            for echo in range(echoes):
                delay = length[chirp, receiver, echo] / SPEED_OF_LIGHT_MPS
                beat = sweep * delay
                position[echo] = beat / sample_rate * cells
                across[echo], up[echo] = phasor(
                    start_frequency * delay - 0.5 * beat * delay + half * beat / sample_rate
                )
            for echo in range(echoes):
                if not (position[echo] >= 0 and position[echo] < cells):
                    continue
                c0, c1, c2 = 0j, 0j, 0j
                for node in range(nodes):
                    own = amplitude[node, chirp, receiver, echo]
                    c0 += powers[0, node] * own
                    c1 += powers[1, node] * own
                    c2 += powers[2, node] * own
                start = complex(across[echo], up[echo])
                cell = int(position[echo])
                place = int((position[echo] - cell) * _PLACES)
                known = (place + 0.5) / _PLACES
                off = position[echo] - cell - known
                # A power of the sample number is one of the distance from the echo: constant + slant x + bend x^2.
                bend = start * c2 * (width * width / variance)
                constant, slant, bend = (
                    start * c0 + bend,
                    start * c1 * complex(0.0, -width / variance),
                    -bend / variance,
                )
                # About the known place instead, and times the Gaussian's own change from there.
                slope = off / variance
                twist = slope * bend
                bend, slant, constant = (
                    bend + slope * slant,
                    slant + slope * constant - 2 * off * bend,
                    constant - off * slant,
                )
                c_re, c_im = np.float32(constant.real), np.float32(constant.imag)
                s_re, s_im = np.float32(slant.real), np.float32(slant.imag)
                b_re, b_im = np.float32(bend.real), np.float32(bend.imag)
                t_re, t_im = np.float32(twist.real), np.float32(twist.imag)
                nearest = np.float32(-_BEFORE - known)
                taps, re, im = (
                    gaussian[place],
                    real[cell : cell + _TAPS],
                    imaginary[cell : cell + _TAPS],
                )
                for tap in range(_TAPS):
                    distance = np.float32(tap) + nearest
                    re[tap] += taps[tap] * (
                        c_re + distance * (s_re + distance * (b_re + distance * t_re))
                    )
                    im[tap] += taps[tap] * (
                        c_im + distance * (s_im + distance * (b_im + distance * t_im))
                    )
            # Cells beyond an end are those at the other end; cell 0 of the grid stands at _BEFORE.
            for cell in range(_BEFORE):
                real[cells + cell] += real[cell]
                imaginary[cells + cell] += imaginary[cell]
            for cell in range(_BEFORE, _TAPS):
                real[cell] += real[cells + cell]
                imaginary[cell] += imaginary[cells + cell]
            for cell in range(cells):
                grid[chirp, receiver, cell] = complex(
                    real[_BEFORE + cell], imaginary[_BEFORE + cell]
                )
