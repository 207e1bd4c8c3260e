"""Echoes of ellipsoids by their far-field cross-sections, on paths over their specular points."""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.elementary import minus, turned_back
from rtradar.kernels.jit import compiled

_NO_BISECTOR = 1e-24
"""Square of the sum of two opposite unit vectors, as rounding leaves it."""

_LANES = 8


@compiled(fastmath={"contract"})
def far_field(start, stop, at, spreading, length, amplitude):
    """Fill length and amplitude (chirp, rx, part) [m] for a `specular_point.Geometry`.

    Chirps ``start`` to ``stop`` are filled.
    """
    tx, rx, centres, frames, semi_axes = at
    _, receivers, parts = length.shape
    for chirp in range(start, stop):
        # Receivers side by side: to each of them in the axes of the part, then length and
        # amplitude. In one array of a known size: of many the compiler would have to fear that they
        # overlap.
        lanes = np.empty((5, _LANES))
        for part in range(parts):
            # The transmitter in the axes of the part.
            centre, frame = centres[chirp, part], frames[chirp, part]
            a, b, c = semi_axes[part, 0], semi_axes[part, 1], semi_axes[part, 2]
            t0, t1, t2 = turned_back(frame, minus(tx[chirp], centre))
            norm_tx = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
            u0, u1, u2 = t0 / norm_tx, t1 / norm_tx, t2 / norm_tx
            root_volume = math.sqrt(math.pi) * a * b * c
            for first in range(0, receivers, _LANES):
                # The receivers in the axes of the part.
                count = min(_LANES, receivers - first)
                for k in range(_LANES):
                    receiver = first + min(k, count - 1)
                    away = turned_back(frame, minus(rx[chirp, receiver], centre))
                    for i in range(3):
                        lanes[i, k] = away[i]
                for k in range(_LANES):
                    # |A n| for the unit normal n is the support function h; the surface point with
                    # that normal is A^2 n / h.
                    r0, r1, r2 = lanes[0, k], lanes[1, k], lanes[2, k]
                    norm = math.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
                    inverse = 1 / norm
                    n0, n1, n2 = u0 + r0 * inverse, u1 + r1 * inverse, u2 + r2 * inverse
                    squared = n0 * n0 + n1 * n1 + n2 * n2
                    support = a * a * n0 * n0 + b * b * n1 * n1 + c * c * n2 * n2
                    scale = 1 / math.sqrt(support)
                    s0, s1, s2 = a * a * n0 * scale, b * b * n1 * scale, c * c * n2 * scale
                    range_tx = math.sqrt(
                        (t0 - s0) * (t0 - s0) + (t1 - s1) * (t1 - s1) + (t2 - s2) * (t2 - s2)
                    )
                    range_rx = math.sqrt(
                        (r0 - s0) * (r0 - s0) + (r1 - s1) * (r1 - s1) + (r2 - s2) * (r2 - s2)
                    )
                    # Square root of the cross-section, pi (abc)^2 / h^4: that of
                    # `rtradar.rcs.ellipsoid` without its angles.
                    root = root_volume * squared * (scale * scale)
                    if spreading:
                        root /= range_tx * range_rx
                    # Straight through there is no bisector, and no reflection.
                    there = squared >= _NO_BISECTOR
                    lanes[3, k] = range_tx + range_rx if there else norm_tx + norm
                    lanes[4, k] = root if there else 0.0
                for k in range(count):
                    length[chirp, first + k, part] = lanes[3, k]
                    amplitude[chirp, first + k, part] = lanes[4, k]
