"""The physical-optics integral over facets: linear phase integrated exactly over each triangle.

    F = jk / sqrt(pi) * sum over lit facets of  o w / (R_T R_R)  Int exp(-jk (R_T + R_R - L)) dS

with the reciprocal obliquity o = (n.s_T + n.s_R) / 2, which is n.s where Tx and Rx are one: the Fresnel-Kirchhoff factor
(Born and Wolf, *Principles of Optics*, section 8.3.2). Path lengths are exact at the three vertices, in float64, and taken
as linear between them; `rtradar.scatter.facets.triangle_phase` has the integral over one triangle.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined
from rtradar.scatter.facets.surfaces import Facets
from rtradar.scatter.facets.triangle_phase import FAST, SERIES, largest_spread, sum_large, sum_small
from rtradar.system.threads import in_threads


@inlined()
def _may_be_lit(antennas, planes, normals, bend, both, size, seen, row, chosen):
    """Facets that any of the antennas may light, by the ball round them all; their count."""
    count_antennas = len(antennas)
    x, y, z = antennas[:, 0].mean(), antennas[:, 1].mean(), antennas[:, 2].mean()
    spread = 0.0
    for antenna in antennas:
        spread = max(
            spread, math.sqrt((antenna[0] - x) ** 2 + (antenna[1] - y) ** 2 + (antenna[2] - z) ** 2)
        )
    farthest = math.sqrt(x * x + y * y + z * z) + spread + size
    count = 0
    for f in range(len(planes)):
        height = normals[f, 0] * x + normals[f, 1] * y + normals[f, 2] * z - planes[f]
        if both or height > -spread - bend[f] * farthest:
            for antenna in range(count_antennas):
                if seen[row[antenna], f] > 0:
                    chosen[count] = f
                    count += 1
                    break
    return count


@inlined(fastmath=FAST)
def _excess(antenna, x, y, z, out):
    """Path from the antenna to each vertex less that to the origin, which is returned."""
    a, b, c = antenna[0], antenna[1], antenna[2]
    distance = math.sqrt(a * a + b * b + c * c)
    for i in range(len(x)):
        p, q, r = x[i], y[i], z[i]
        away = math.sqrt((p - a) ** 2 + (q - b) ** 2 + (r - c) ** 2)
        # |T - p| - |T| without the loss of digits of a far antenna.
        out[i] = (p * (p - 2 * a) + q * (q - 2 * b) + r * (r - 2 * c)) / (away + distance)
    return distance


@inlined(fastmath=FAST)
def _see(antenna, distance, excess, corners, facing, chosen, seen, view):
    """Rows of ``view`` for the chosen facets: mean path, two deviations from it, n.s, and the share that is seen."""
    a, b, c = antenna[0], antenna[1], antenna[2]
    first_of, second_of, third_of = corners[0], corners[1], corners[2]
    n0, n1, n2, plane = facing[0], facing[1], facing[2], facing[3]
    means, first_less, second_less, along, shares = view[0], view[1], view[2], view[3], view[4]
    for i in range(len(chosen)):
        first, second, third = excess[first_of[i]], excess[second_of[i]], excess[third_of[i]]
        mean = (first + second + third) / 3
        means[i], first_less[i], second_less[i] = mean, first - mean, second - mean
        shares[i] = seen[chosen[i]]
    # Apart from what is picked here and there, in vector lanes.
    for i in range(len(chosen)):
        along[i] = (n0[i] * a + n1[i] * b + n2[i] * c - plane[i]) / (distance + means[i])


@inlined(fastmath=FAST)
def _light(tx, rx, areas, bend, both, far_t, far_r, carrier, spreading, mean, u, v, strength):
    """Mean path, two deviations from it and strength of facets under two views."""
    tx_mean, tx_u, tx_v, tx_facing, tx_seen = tx[0], tx[1], tx[2], tx[3], tx[4]
    rx_mean, rx_u, rx_v, rx_facing, rx_seen = rx[0], rx[1], rx[2], rx[3], rx[4]
    for i in range(len(mean)):
        low, high = min(tx_facing[i], rx_facing[i]), max(tx_facing[i], rx_facing[i])
        behind = both and high < 0
        low, high = (-high, -low) if behind else (low, high)
        # The part that falls to 0 at the terminator by itself, and the one between Tx and Rx, which has to be led there.
        h = max(bend[i], 1e-300)
        share = min(1.0, max(0.0, (low + h) / (2 * h)))
        size = (max(low, 0.0) + share * (high - low) / 2) * min(tx_seen[i], rx_seen[i]) * areas[i]
        if spreading:
            size /= (far_t + tx_mean[i]) * (far_r + rx_mean[i])
        mean[i] = tx_mean[i] + rx_mean[i] - carrier
        u[i], v[i] = tx_u[i] + rx_u[i], tx_v[i] + rx_v[i]
        strength[i] = size


@compiled()
def _integrate(
    begin,
    end,
    vertices,
    faces,
    normals,
    areas,
    bend,
    both,
    part,
    antennas,
    row,
    seen,
    pairs,
    carrier,
    k,
    spreading,
    out,
):
    """Fill the tasks from begin to end."""
    count_antennas = antennas.shape[1]
    n_vertices, n_facets = vertices.shape[1], faces.shape[0]
    for task in range(begin, end):
        own = part[task]
        # Coordinate by coordinate: loops over vertices run in vector lanes.
        x, y, z = np.empty(n_vertices), np.empty(n_vertices), np.empty(n_vertices)
        planes = np.empty(n_facets)
        size = 0.0
        for i in range(n_vertices):
            x[i], y[i], z[i] = vertices[own, i, 0], vertices[own, i, 1], vertices[own, i, 2]
            size = max(size, x[i] * x[i] + y[i] * y[i] + z[i] * z[i])
        for f in range(n_facets):
            i = faces[f, 0]
            planes[f] = (
                normals[own, f, 0] * x[i] + normals[own, f, 1] * y[i] + normals[own, f, 2] * z[i]
            )
        lit = np.empty(n_facets, dtype=np.uint32)
        count = _may_be_lit(
            antennas[task],
            planes,
            normals[own],
            bend[own],
            both,
            math.sqrt(size),
            seen,
            row[task],
            lit,
        )
        chosen = lit[:count]
        # Side by side, and without a sign: what may be counted from an array's end keeps a loop from vector lanes.
        corners, facing = np.empty((3, count), dtype=np.uint32), np.empty((4, count))
        for i in range(count):
            f = chosen[i]
            for axis in range(3):
                corners[axis, i], facing[axis, i] = faces[f, axis], normals[own, f, axis]
            facing[3, i] = planes[f]
        excess, far = np.empty(n_vertices), np.empty(count_antennas)
        view = np.empty((count_antennas, 5, count))
        for antenna in range(count_antennas):
            place = antennas[task, antenna]
            far[antenna] = _excess(place, x, y, z, excess)
            _see(
                place,
                far[antenna],
                excess,
                corners,
                facing,
                chosen,
                seen[row[task, antenna]],
                view[antenna],
            )
        own_areas, own_bend = np.empty(count), np.empty(count)
        for i in range(count):
            own_areas[i], own_bend[i] = areas[own, chosen[i]], bend[own, chosen[i]]
        mean, u, v, strength, room = (
            np.empty(count),
            np.empty(count),
            np.empty(count),
            np.empty(count),
            np.empty(count + 1),
        )
        for pair in range(pairs.shape[0]):
            t, r = pairs[pair, 0], pairs[pair, 1]
            offset = carrier[task, pair] - far[t] - far[r]
            _light(
                view[t],
                view[r],
                own_areas,
                own_bend,
                both,
                far[t],
                far[r],
                offset,
                spreading,
                mean,
                u,
                v,
                strength,
            )
            largest = largest_spread(u, v, room)
            for node in range(k.shape[1]):
                wave = k[task, node]
                if largest * wave**2 <= SERIES:
                    total = sum_small(mean, u, v, strength, wave)
                else:
                    total = sum_large(mean, u, v, strength, wave)
                out[task, pair, node] = total * complex(0.0, wave / math.sqrt(math.pi))


_PARALLEL_SHARES = 4_000_000
"""Below this many facets times pairs times frequencies waking threads costs as much as the work: some 12 ms."""


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
        Facets of the parts, in the axes of their parts.
    part : (task,) int
        One task is one part in one pose.
    antennas : (task, antenna, 3) float64
        Antenna positions in the axes of that part [m].
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
    given = (
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
        # What may not be written to is another type to Numba, for which it would compile everything again.
        np.require(wavenumber, np.float64, ["C", "W"]),
        spreading,
        out,
    )
    at_once = 1 if out.size * len(facets.faces) >= _PARALLEL_SHARES else max(1, len(part))
    in_threads(
        lambda first: _integrate(first, min(first + at_once, len(part)), *given),
        range(0, len(part), at_once),
    )
    return out
