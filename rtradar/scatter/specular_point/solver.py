"""Where Tx sees Rx mirrored in each ellipsoid, how far and how strongly, and where to search."""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.kernels.scatter.specular_point import Geometry, Options, solve
from rtradar.radar import Radar
from rtradar.scatter.common.keyframes import KeyframeCache, keyframe_before, keyframe_step
from rtradar.scatter.common.poses import ChirpPoses, chirp_poses
from rtradar.system.threads import thread_map

_CHIRPS_PER_THREAD = 64
"""Fewer cost more for waking threads than for the work, the more so while Mitsuba's are awake."""

_KEPT_KEYFRAMES, _PASSING = 2048, 32
"""The first 20 s of a recording, read twice, in 1 MB; of what follows one block."""


def solve_specular_points(
    at: Geometry | ChirpPoses,
    *,
    start: NDArray[np.float64] | None = None,
    polarization: Literal["v", "h"] = "v",
    spreading: bool = True,
    points: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Path length, amplitude and specular point of every ellipsoid, as if each stood alone.

    The search begins at ``start (chirp, part, 3)``, in the ellipsoid's axes [m], NaN where nothing
    is known. Both antennas have the same polarisation, v along world z. Returned are the lengths
    |T - p| + |R - p| (chirp, rx, part) [m]; the co-polar scattering lengths (chirp, rx, part), over
    R1 R2 with ``spreading`` [m]; and, if ``points`` are wanted, for they are many, the specular
    points (chirp, rx, part, 3), world [m].

    Equations :eq:`specular-point`, :eq:`mirror-matrix` and :eq:`mirror-return` of the theory page,
    times :eq:`polarization`.
    """
    at = Geometry.of(at)
    shape = (*at.rx.shape[:2], at.centres.shape[1])
    length, amplitude = np.empty(shape), np.empty(shape)
    point = np.empty((*shape, 3)) if points else np.empty((0, 0, 0, 0))
    begin = np.full(at.centres.shape, np.nan) if start is None else start
    begin = np.ascontiguousarray(begin, dtype=np.float64)
    options = Options(polarized=True, horizontal=polarization == "h", spreading=spreading)

    def some(first: int) -> None:
        last = min(first + _CHIRPS_PER_THREAD, len(at.tx))
        solve(first, last, at, begin, options, length, amplitude, point)

    thread_map(some, range(0, len(at.tx), _CHIRPS_PER_THREAD))
    return length, amplitude, point


class StartPoints:
    """Starting points of a moving body, from which three steps lead to a specular point.

    They are the specular points of the radar's first two antennas at keyframes 10 ms apart.
    """

    def __init__(self, radar: Radar, body: Body) -> None:
        self._radar, self._body = radar, body
        self._step = keyframe_step(radar)
        self._keyframes: KeyframeCache[int, NDArray[np.float64]] = KeyframeCache(
            _KEPT_KEYFRAMES, _PASSING
        )

    def at(
        self, chirps: NDArray[np.int64], parts: NDArray[np.int64] | None = None
    ) -> NDArray[np.float64]:
        """Specular points (chirp, part, 3) at the keyframes before some chirps, in the parts' axes.

        They are those of some parts (part,), or of all [m].
        """
        before, _ = keyframe_before(self._radar, chirps, self._step)
        numbers, place = np.unique(before, return_inverse=True)
        found = [self._keyframes.get(n, partial(self._find, n)) for n in numbers.tolist()]
        points = np.stack(found)
        return (points if parts is None else points[:, parts])[place]

    def _find(self, number: int) -> NDArray[np.float64]:
        at = chirp_poses(self._radar.gapless, self._body, np.array([number * self._step]))
        return local_points(at._replace(rx=at.rx[:, :1]))[1]


def local_points(at: ChirpPoses) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Specular points (chirp, rx, part, 3), world [m]; those of one pair in the parts' axes."""
    points = solve_specular_points(at, points=True)[2]
    return points, np.einsum("pji,pj->pi", at.frames[0], points[0, 0] - at.centres[0])
