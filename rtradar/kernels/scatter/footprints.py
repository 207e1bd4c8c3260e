"""Radiation of the footprints of ray tubes, see `rtradar.scatter.ray_tubes`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import cross, dot, minus, phasor, scaled, with_length
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
def _copolar(s, axes, horizontal):
    """Polarisation of a receiver, whose axes are columns: h = up x s, v = s x h."""
    h, size = with_length(cross(axes[:, 2], s))
    if size < _STEEP:
        h, size = with_length(cross(axes[:, 0], s))
    return h if horizontal else cross(s, h)


@inlined()
def _amplitude(tubes, tube, s, axes, horizontal, tapered):
    """Amplitude a of a footprint towards a receiver, times its area."""
    corners, d, e = tubes.places[tube], tubes.direction[tube], tubes.field[tube]
    # Normal of the triangle times its area, on the lit side.
    twice = cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]))
    n = scaled(twice, -0.5 if dot(twice, tubes.normal[tube]) < 0 else 0.5)
    q = _copolar(s, axes, horizontal)
    n_s, n_d = dot(n, s), dot(n, d)
    weight = (dot(e, q) * (n_s - n_d) + dot(d, q) * dot(n, e) - dot(e, s) * dot(n, q)) / 2
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
        here, u = rx[receiver], np.empty(3)
        # Interleaved, for occluded tubes come in runs.
        for tube in range(chunk, count, chunks):
            if not visible[receiver, tube]:
                continue
            own, middle = tubes.group[tube], tubes.places[tube, 3]
            way, leg = with_length(minus(here, middle))
            weight = _amplitude(tubes, tube, way, axes, horizontal, tapered)
            if spreading:
                weight /= leg
            # Paths over the corners, and their mean.
            mean = 0.0
            for corner in range(3):
                _, away = with_length(minus(here, tubes.places[tube, corner]))
                u[corner] = tubes.path[tube, corner] - length[receiver, own] + away
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
