"""Radiation of the footprints of ray tubes, see `rtradar.scatter.ray_tubes.footprints`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import phasor
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.triangles import mean_of_phasor

_STEEP = 1e-9
"""Sine of the angle from up below which the boresight takes its place, as everywhere."""


class Tubes(NamedTuple):
    """Where tubes of rays end: `Footprints` as plain arrays, with the middle ray's alone of some.

    ``places (tube, 4, 3)`` [m], ``path (tube, 4)`` [m], ``direction``, ``normal``, ``field (tube,
    3)`` of the middle, and the ``group (tube,)`` that each adds to.
    """

    places: NDArray[np.float64]
    path: NDArray[np.float64]
    direction: NDArray[np.float64]
    normal: NDArray[np.float64]
    field: NDArray[np.float64]
    group: NDArray[np.int64]


@inlined()
def _copolar(sx, sy, sz, axes, horizontal):
    """Polarisation of a receiver, whose axes are columns: h = up x s, v = s x h."""
    ux, uy, uz = axes[0, 2], axes[1, 2], axes[2, 2]
    hx, hy, hz = uy * sz - uz * sy, uz * sx - ux * sz, ux * sy - uy * sx
    if hx * hx + hy * hy + hz * hz < _STEEP * _STEEP:
        ux, uy, uz = axes[0, 0], axes[1, 0], axes[2, 0]
        hx, hy, hz = uy * sz - uz * sy, uz * sx - ux * sz, ux * sy - uy * sx
    size = math.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx / size, hy / size, hz / size
    if horizontal:
        return hx, hy, hz
    return sy * hz - sz * hy, sz * hx - sx * hz, sx * hy - sy * hx


@inlined()
def _amplitude(tubes, tube, sx, sy, sz, axes, horizontal, tapered):
    """Amplitude a of a footprint towards a receiver, times its area."""
    p0, p1, p2 = tubes.places[tube, 0], tubes.places[tube, 1], tubes.places[tube, 2]
    ax, ay, az = p1[0] - p0[0], p1[1] - p0[1], p1[2] - p0[2]
    bx, by, bz = p2[0] - p0[0], p2[1] - p0[1], p2[2] - p0[2]
    # Normal of the triangle times its area, on the lit side.
    nx, ny, nz = (ay * bz - az * by) / 2, (az * bx - ax * bz) / 2, (ax * by - ay * bx) / 2
    normal, d, e = tubes.normal[tube], tubes.direction[tube], tubes.field[tube]
    if nx * normal[0] + ny * normal[1] + nz * normal[2] < 0:
        nx, ny, nz = -nx, -ny, -nz
    n_d, n_e = nx * d[0] + ny * d[1] + nz * d[2], nx * e[0] + ny * e[1] + nz * e[2]
    n_s = nx * sx + ny * sy + nz * sz
    qx, qy, qz = _copolar(sx, sy, sz, axes, horizontal)
    e_q, d_q = e[0] * qx + e[1] * qy + e[2] * qz, d[0] * qx + d[1] * qy + d[2] * qz
    e_s, n_q = e[0] * sx + e[1] * sy + e[2] * sz, nx * qx + ny * qy + nz * qz
    weight = (e_q * (n_s - n_d) + d_q * n_e - e_s * n_q) / 2
    if tapered:
        weight *= max(-4 * n_s * n_d, 0.0) / (n_s - n_d) ** 2
    return weight


@compiled()
def radiate_tubes(
    start, stop, tubes, visible, rx, axes, wavenumber, length, horizontal, spreading, tapered, out
):
    """Add what tubes send to receivers to ``out (chunk, node, rx, group)``, a part in each chunk.

    Tasks ``start`` to ``stop`` are done, one for each chunk and receiver. ``visible (rx, tube)``,
    ``rx (rx, 3)`` [m] and their axes (3, 3), ``wavenumber (node,)`` [1/m], and the path ``length
    (rx, group)`` whose phase is taken out [m].
    """
    count, receivers, chunks = len(tubes.group), len(rx), len(out)
    for task in range(start, stop):
        chunk, receiver = task // receivers, task % receivers
        x, y, z = rx[receiver, 0], rx[receiver, 1], rx[receiver, 2]
        u = np.empty(3)
        # Interleaved, for occluded tubes come in runs.
        for tube in range(chunk, count, chunks):
            if not visible[receiver, tube]:
                continue
            own, middle = tubes.group[tube], tubes.places[tube, 3]
            sx, sy, sz = x - middle[0], y - middle[1], z - middle[2]
            leg = math.sqrt(sx * sx + sy * sy + sz * sz)
            sx, sy, sz = sx / leg, sy / leg, sz / leg
            weight = _amplitude(tubes, tube, sx, sy, sz, axes, horizontal, tapered)
            if spreading:
                weight /= leg
            # Paths over the corners, and their mean.
            mean = 0.0
            for corner in range(3):
                place = tubes.places[tube, corner]
                wx, wy, wz = x - place[0], y - place[1], z - place[2]
                u[corner] = tubes.path[tube, corner] - length[receiver, own]
                u[corner] += math.sqrt(wx * wx + wy * wy + wz * wz)
                mean += u[corner] / 3
            # A bow of the path across the triangle, quadratic, is on average 3/4 of its middle's.
            bow = 0.75 * (tubes.path[tube, 3] + leg - length[receiver, own] - mean)
            for node in range(len(wavenumber)):
                k = wavenumber[node]
                a, b, c = k * (u[0] - mean), k * (u[1] - mean), k * (u[2] - mean)
                real, imaginary = mean_of_phasor(a, b, c)
                cosine, sine = phasor(k * (mean + bow) / (2 * math.pi))
                out[chunk, node, receiver, own] += weight * complex(
                    real * cosine + imaginary * sine, imaginary * cosine - real * sine
                )
