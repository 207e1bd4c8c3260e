"""Ask Mitsuba which lines of sight past a body of ellipsoids are clear.

Every ellipsoid is the exact unit `sphere` of Mitsuba in axes of its own, so there is no scene to
pose: each ray is taken into the axes of the part that it comes near. The answers are held against
float64 in `validation/other_methods/occlusion.py`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.kernels.scatter.facet_rays import facet_rays, first_occluders
from rtradar.kernels.scatter.near_rays import near_rays
from rtradar.system.threads import thread_map
from rtradar.trace.rays import any_met

_LINES_A_THREAD = 1 << 14
"""For fewer, waking threads costs more than the work."""

_LOADING = threading.Lock()


class UnitSphere:
    """The unit sphere in a Mitsuba scene of its own, made for the first rays."""

    def __init__(self, mi: ModuleType | Callable[[], ModuleType]) -> None:
        self._mi: Any = mi
        self._scene: Any = None

    def meets(self, rays: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Which rays (7, ray) meet it: start, unit direction and length in its axes."""
        with _LOADING:
            if self._scene is None and rays.size:
                self._mi = self._mi() if callable(self._mi) else self._mi
                self._scene = self._mi.load_dict({"type": "scene", "sphere": {"type": "sphere"}})
        return any_met(self._mi, self._scene, rays)


class BodyTracer:
    """A body of ellipsoids with ``semi_axes (part, 3)`` [m], posed again and again.

    Mitsuba, ``mi``, has its variant set; or it is what loads it for the first ray.
    """

    def __init__(
        self, mi: ModuleType | Callable[[], ModuleType], semi_axes: NDArray[np.float64]
    ) -> None:
        self._semi_axes = np.ascontiguousarray(semi_axes, dtype=np.float64)
        self._sphere = UnitSphere(mi)
        self._pose: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def pose(self, centres: NDArray[np.float64], frames: NDArray[np.float64]) -> None:
        """Pose the body: ``centres (part, 3)`` [m], ``frames (part, 3, 3)``, world axes."""
        self._pose = centres, frames

    def sees(
        self, origins: NDArray[np.float64], targets: NDArray[np.float64], own: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Whether no other part is between ``origins (ray, 3)`` and ``targets (ray, 3)`` [m].

        A target lies on part ``own (ray,)``, which cannot occlude it, or on none, -1. Mitsuba
        decides about every line of sight and every part that the line comes near.
        """
        if self._pose is None:
            raise RuntimeError("BodyTracer: pose the body before rays are sent")
        parts = len(self._semi_axes)
        posed = Poses(self._pose[0][None], self._pose[1][None], self._semi_axes)
        # The last group is that of targets on no part.
        whose = np.append(np.arange(parts), -1), np.zeros(parts + 1, dtype=np.int64)
        return self.clear(origins, targets, own % (parts + 1), *whose, posed)

    def clear(
        self,
        origins: NDArray[np.float64],
        targets: NDArray[np.float64],
        group: NDArray[np.int64],
        own: NDArray[np.int64],
        pose: NDArray[np.int64],
        poses: Poses,
    ) -> NDArray[np.bool_]:
        """Whether no part is in the way of lines of sight (line,) past the body in several poses.

        Lines go from ``origins`` to ``targets (line, 3)``, world [m]. Those of a ``group (line,)``
        have their targets on the part ``own (group,)``, which cannot occlude them, -1 for none, in
        the pose ``pose (group,)`` among ``poses``.
        """
        floats = (origins, targets, poses.centres, poses.frames, self._semi_axes)
        starts, ends, *body = (np.ascontiguousarray(a, dtype=np.float64) for a in floats)

        def near(begin: int) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
            own_lines = slice(begin, begin + _LINES_A_THREAD)
            rays, line = near_rays(
                starts[own_lines], ends[own_lines], group[own_lines], own, pose, *body
            )
            return rays, line + begin

        found = thread_map(near, range(0, len(starts), _LINES_A_THREAD))
        seen = np.ones(len(starts), dtype=bool)
        if found:
            rays, line = (np.concatenate(arrays, axis=-1) for arrays in zip(*found, strict=True))
            seen[line[self._sphere.meets(rays)]] = False
        return seen

    def occluders(
        self,
        centres: NDArray[np.float64],
        frames: NDArray[np.float64],
        antennas: NDArray[np.float64],
        parts: NDArray[np.int64],
        vertices: NDArray[np.float64],
        margin: float,
    ) -> NDArray[np.int16]:
        """Part that occludes each vertex, as each antenna sees it, (antenna, n, vertex) int16.

        It is another part that is nearer to the antenna on the same line, else -1. ``centres`` and
        ``frames`` are the pose of the body, ``antennas (antenna, 3)`` places, world [m]. Asked
        about are the vertices of ``parts (n,)``, but not those that face away by more than the sine
        ``margin``; ``vertices (part, 3, vertex)`` are those of every part, on its ellipsoid, in its
        own axes [m].
        """
        found = np.full((len(antennas), len(parts), vertices.shape[2]), -1, dtype=np.int16)
        floats = (antennas, centres, frames, self._semi_axes)
        places, *body = (np.ascontiguousarray(a, dtype=np.float64) for a in floats)
        asked = np.ascontiguousarray(parts, dtype=np.int64)
        rays, whose = facet_rays(places, asked, *body, vertices, float(margin))
        first_occluders(self._sphere.meets(rays[:7]), rays[7], whose, found.ravel())
        return found
