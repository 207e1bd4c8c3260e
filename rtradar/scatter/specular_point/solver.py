"""Where Tx sees Rx mirrored in each ellipsoid, how far and how strongly, and where to search."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.scatter.specular_point import Geometry, Options, solve
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.common.poses import ChirpPoses
from rtradar.system.threads import thread_map

_CHIRPS_PER_THREAD = 64
"""Fewer cost more for waking threads than for the work, the more so while Mitsuba's are awake."""


def solve_specular_points(
    at: Geometry | ChirpPoses,
    *,
    start: NDArray[np.float64] | None = None,
    polarization: Polarization | None = None,
    spreading: bool = True,
    points: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Path length, amplitude and specular point of every ellipsoid, as if each stood alone.

    The search begins at ``start (chirp, part, 3)``, in the ellipsoid's axes [m], NaN where nothing
    is known. Returned are the lengths |T - p| + |R - p| (chirp, rx, part) [m]; the scattering
    lengths (chirp, rx, part), over R1 R2 with ``spreading`` [m], co-polar where both antennas have
    a ``polarization``, else without regard to it; and, if ``points`` are wanted, for they are many,
    the specular points (chirp, rx, part, 3), world [m].

    Equations :eq:`specular-point`, :eq:`mirror-matrix` and :eq:`mirror-return` of the theory page,
    times :eq:`polarization`.
    """
    at = Geometry.of(at)
    shape = (*at.rx.shape[:2], at.centres.shape[1])
    length, amplitude = np.empty(shape), np.empty(shape)
    point = np.empty((*shape, 3)) if points else np.empty((0, 0, 0, 0))
    begin = np.full(at.centres.shape, np.nan) if start is None else start
    begin = np.ascontiguousarray(begin, dtype=np.float64)
    above, horizontal = np.zeros(at.tx.shape), False
    if polarization is not None:
        above[:], horizontal = polarization.up, polarization.kind == "h"
    options = Options(horizontal, spreading)

    def some(first: int) -> None:
        last = min(first + _CHIRPS_PER_THREAD, len(at.tx))
        solve(first, last, at, above, begin, options, length, amplitude, point)

    thread_map(some, range(0, len(at.tx), _CHIRPS_PER_THREAD))
    return length, amplitude, point


def local_points(at: ChirpPoses) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Specular points (chirp, rx, part, 3), world [m]; those of one pair in the parts' axes."""
    points = solve_specular_points(at, points=True)[2]
    return points, np.einsum("pji,pj->pi", at.frames[0], points[0, 0] - at.centres[0])
