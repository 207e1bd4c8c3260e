"""The physical-optics integral over facets: linear phase integrated exactly over each triangle.

    F = jk / sqrt(pi) * sum over lit facets of  o w / (R_T R_R)  Int exp(-jk (R_T + R_R - L)) dS

with the reciprocal obliquity o = (n.s_T + n.s_R) / 2, which is n.s where Tx and Rx are one: the Fresnel-Kirchhoff factor
(Born and Wolf, *Principles of Optics*, section 8.3.2). Path lengths are exact at the three vertices, in float64, and taken
as linear between them. The mean of exp(j phi) over a triangle with phases phi_i at its corners is twice the divided
difference of exp at j phi_1, j phi_2, j phi_3 (Hermite and Genocchi), the formula of Gordon (1975) and Ludwig (1968) in a form
without small denominators: about the mean phase a series, 2 sum_n j^n h_n / (n + 2)!, whose h_n = p h_(n-2) + q h_(n-3) are
the complete symmetric polynomials of phases with sum 0, p = (u^2 + v^2 + w^2) / 2, q = u v w; for large phases the differences
themselves, divided by the largest of the three.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from rtradar.scatter.facets import Facets

_SERIES = 4.0
"""Largest p for the series: what it leaves out, p^6 2 / 14!, is then 1e-7 of a facet."""

# Sums may be reordered; NaN and infinity keep their meaning.
_FAST = {"reassoc", "contract", "nsz", "arcp"}


@njit(cache=True, error_model="numpy", fastmath=_FAST)
def _sum_small(count, mean, u, v, strength, k):  # type: ignore[no-untyped-def]
    """Sum of strength exp(-jk mean) times the mean of exp(-jk deviation), of facets with small deviations; vector code."""
    real, imaginary = 0.0, 0.0
    for i in range(count):
        a, b = -k * u[i], -k * v[i]
        p = a * a + a * b + b * b
        q = -a * b * (a + b)
        size = strength[i] if p <= _SERIES else 0.0
        square = q * q
        mean_re = 1 + p * (-1 / 12 + p * (1 / 360 + p * (-1 / 20160 + p * (1 / 1814400 - p / 239500800))))
        mean_re += square * (-1 / 20160 + p * (3 / 1814400 - p * 6 / 239500800))
        mean_im = -1 / 60 + p * (1 / 1260 + p * (-1 / 60480 + p * (4 / 19958400 - p * 5 / 3113510400)))
        mean_im = q * (mean_im + square * (1 / 19958400 - p * 4 / 3113510400))
        # Sine and cosine by Taylor's series of half the angle, within 1e-11: branch-free, and so in vector lanes.
        turns = -k * mean[i] * (0.5 / math.pi)
        half = math.pi * (turns - math.floor(turns + 0.5))
        x = half * half
        sine = -1 / 1307674368000 * x + 1 / 6227020800
        sine = half * (1 + x * (-1 / 6 + x * (1 / 120 + x * (-1 / 5040 + x * (1 / 362880 + x * (-1 / 39916800 + x * sine))))))
        cosine = 1 / 20922789888000 * x - 1 / 87178291200
        cosine = 1 / 40320 + x * (-1 / 3628800 + x * (1 / 479001600 + x * cosine))
        cosine = 1 + x * (-1 / 2 + x * (1 / 24 + x * (-1 / 720 + x * cosine)))
        turn_re, turn_im = 1 - 2 * sine * sine, 2 * sine * cosine
        real += size * (turn_re * mean_re - turn_im * mean_im)
        imaginary += size * (turn_re * mean_im + turn_im * mean_re)
    return complex(real, imaginary)


@njit(cache=True, error_model="numpy")
def _chord(x, y):  # type: ignore[no-untyped-def]
    """Divided difference of exp between j x and j y: exp(j (x + y) / 2) sinc."""
    half = 0.5 * (y - x)
    size = 1 - half * half / 6 if abs(half) < 1e-4 else math.sin(half) / half
    middle = 0.5 * (x + y)
    return complex(size * math.cos(middle), size * math.sin(middle))


@njit(cache=True, error_model="numpy")
def _sum_large(count, mean, u, v, strength, k):  # type: ignore[no-untyped-def]
    """The same for the facets whose deviations are large."""
    total = 0j
    for i in range(count):
        a, b = -k * u[i], -k * v[i]
        if a * a + a * b + b * b <= _SERIES:
            continue
        c = -a - b
        low, high = min(a, min(b, c)), max(a, max(b, c))
        middle = -low - high
        difference = (_chord(middle, high) - _chord(low, middle)) / complex(0.0, high - low)
        turn = -k * mean[i]
        total += 2 * strength[i] * difference * complex(math.cos(turn), math.sin(turn))
    return total


@njit(cache=True, error_model="numpy", fastmath=_FAST)
def _see(antenna, vertices, faces, normals, excess, facing):  # type: ignore[no-untyped-def]
    """Path from the antenna to each vertex less that to the origin, and n.s of each facet."""
    x, y, z = antenna[0], antenna[1], antenna[2]
    distance = math.sqrt(x * x + y * y + z * z)
    for i in range(vertices.shape[0]):
        p, q, r = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        away = math.sqrt((p - x) ** 2 + (q - y) ** 2 + (r - z) ** 2)
        # |T - p| - |T| without the loss of digits of a far antenna.
        excess[i] = (p * (p - 2 * x) + q * (q - 2 * y) + r * (r - 2 * z)) / (away + distance)
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        height = (
            normals[f, 0] * (x - vertices[i, 0]) + normals[f, 1] * (y - vertices[i, 1]) + normals[f, 2] * (z - vertices[i, 2])
        )
        facing[f] = height / (distance + (excess[i] + excess[j] + excess[k]) / 3)
    return distance


@njit(cache=True, error_model="numpy", fastmath=_FAST)
def _collect(faces, areas, bend, both, tx, rx, facing_t, facing_r, seen_t, seen_r, far_t, far_r, carrier, spreading, lit):  # type: ignore[no-untyped-def]
    """Rows of ``lit``: mean path, two deviations from it, strength, of the facets that both antennas light; their count."""
    count = 0
    for f in range(faces.shape[0]):
        low, high = min(facing_t[f], facing_r[f]), max(facing_t[f], facing_r[f])
        if both and high < 0:
            low, high = -high, -low
        h = bend[f]
        if low <= -h:
            continue
        seen = min(seen_t[f], seen_r[f])
        if seen <= 0:
            continue
        # The part that falls to 0 at the terminator by itself, and the one between Tx and Rx, which has to be led there.
        share = min(1.0, (low + h) / (2 * h)) if h > 0 else 1.0
        obliquity = max(low, 0.0) + share * (high - low) / 2
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        tx_mean, rx_mean = (tx[i] + tx[j] + tx[k]) / 3, (rx[i] + rx[j] + rx[k]) / 3
        strength = obliquity * seen * areas[f]
        if spreading:
            strength /= (far_t + tx_mean) * (far_r + rx_mean)
        mean = tx_mean + rx_mean
        lit[0, count] = mean - carrier
        lit[1, count] = tx[i] + rx[i] - mean
        lit[2, count] = tx[j] + rx[j] - mean
        lit[3, count] = strength
        count += 1
    return count


def _integrate(vertices, faces, normals, areas, bend, both, part, antennas, row, seen, pairs, carrier, k, spreading, out):  # type: ignore[no-untyped-def]
    tasks, count_antennas = antennas.shape[:2]
    n_vertices, n_facets = vertices.shape[1], faces.shape[0]
    for task in prange(tasks):
        own = part[task]
        excess, facing = np.empty((count_antennas, n_vertices)), np.empty((count_antennas, n_facets))
        far = np.empty(count_antennas)
        lit = np.empty((4, n_facets))
        for antenna in range(count_antennas):
            far[antenna] = _see(antennas[task, antenna], vertices[own], faces, normals[own], excess[antenna], facing[antenna])
        for pair in range(pairs.shape[0]):
            t, r = pairs[pair, 0], pairs[pair, 1]
            seen_t, seen_r = seen[row[task, t]], seen[row[task, r]]
            count = _collect(
                faces,
                areas[own],
                bend[own],
                both,
                excess[t],
                excess[r],
                facing[t],
                facing[r],
                seen_t,
                seen_r,
                far[t],
                far[r],
                carrier[task, pair] - far[t] - far[r],
                spreading,
                lit,
            )
            for node in range(k.shape[1]):
                total = _sum_small(count, lit[0], lit[1], lit[2], lit[3], k[task, node])
                total += _sum_large(count, lit[0], lit[1], lit[2], lit[3], k[task, node])
                out[task, pair, node] = total * complex(0.0, k[task, node] / math.sqrt(math.pi))


_integrate_parallel = njit(cache=True, error_model="numpy", parallel=True)(_integrate)
_integrate_serial = njit(cache=True, error_model="numpy")(_integrate)
_PARALLEL_SHARES = 4_000_000
"""Below this many facets times pairs times frequencies waking threads costs as much as the work: some 20 ms."""


def facet_integral(
    facets: Facets,
    part: NDArray[np.integer],
    antennas: NDArray[np.float64],
    row: NDArray[np.integer],
    seen: NDArray[np.float32],
    pairs: NDArray[np.integer],
    carrier: NDArray[np.float64],
    wavenumber: NDArray[np.float64],
    *,
    spreading: bool = True,
) -> NDArray[np.complex128]:
    """Scattering length of posed parts, the phase of a carrier taken out.

    Parameters
    ----------
    facets : Facets
        In the axes of their parts.
    part : (task,) int
        One task is one part in one pose.
    antennas : (task, antenna, 3) float64
        In the axes of that part [m].
    row : (task, antenna) int
        Where in ``seen`` that antenna's view of that part stands.
    seen : (row, facet) float32
        Share of each facet that nothing hides from the antenna, 0 to 1. Facing away need not be marked.
    pairs : (pair, 2) int
        Tx and Rx of each pair, among the antennas of a task.
    carrier : (task, pair) float64
        Path length L that phases are told from [m].
    wavenumber : (task, node) float64
        2 pi f / c [rad/m].
    spreading : bool
        Whether each facet's share is divided by R_T R_R, normalised to 1 m.

    Returns
    -------
    (task, pair, node) complex128
        F [m], for exp(+j omega t); 0 where nothing is lit.
    """
    out = np.empty((len(part), len(pairs), wavenumber.shape[1]), dtype=np.complex128)
    kernel = _integrate_parallel if out.size * len(facets.faces) >= _PARALLEL_SHARES else _integrate_serial
    kernel(
        facets.vertices,
        facets.faces,
        facets.normals,
        facets.areas,
        facets.bend,
        facets.both_sides,
        np.ascontiguousarray(part, dtype=np.int64),
        np.ascontiguousarray(antennas, dtype=np.float64),
        np.ascontiguousarray(row, dtype=np.int64),
        seen,
        np.ascontiguousarray(pairs, dtype=np.int64),
        np.ascontiguousarray(carrier, dtype=np.float64),
        np.ascontiguousarray(wavenumber, dtype=np.float64),
        spreading,
        out,
    )
    return out
