"""People as they occlude what is none of them: ellipsoids, or the mesh of who has one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.scatter.common.keyframes import KeyframeCache
from rtradar.trace.body_tracer import BodyTracer
from rtradar.trace.bounces import MeshSurfaces

_KEPT = 8
"""Poses of meshes that are kept, 5 MB each: all paths ask for the same times."""


class OccludingPeople:
    """All people of ``body``, whom Mitsuba, ``mi``, traces at any time."""

    def __init__(self, mi: Any, body: Body) -> None:
        self._mi, self._body = mi, body
        self._with_mesh = [person for person in body.people if person.mesh is not None]
        others = [n for n, person in enumerate(body.people) if person.mesh is None]
        self._parts = np.flatnonzero(np.isin(body.owner, others))
        self._ellipsoids = BodyTracer(mi, body.semi_axes[self._parts])
        self._posed: KeyframeCache[float, list[MeshSurfaces]] = KeyframeCache(0, _KEPT)

    def clear(
        self, time_s: float, origins: NDArray[np.float64], targets: NDArray[np.float64]
    ) -> NDArray[np.bool_]:
        """Which lines of sight (line,), from ``origins`` to ``targets (line, 3)``, are clear."""
        time = min(max(time_s, 0.0), self._body.duration_s)
        clear = np.ones(len(origins), dtype=bool)
        if len(self._parts):
            poses = self._body.at([time])
            self._ellipsoids.pose(poses.centres[0][self._parts], poses.frames[0][self._parts])
            clear = self._ellipsoids.sees(origins, targets, np.full(len(origins), -1))
        for skin in self._posed.get(time, lambda: self._pose(time)):
            on_none = np.full(int(clear.sum()), -1)
            clear[clear] = skin.sees(origins[clear], targets[clear], on_none)
        return clear

    def _pose(self, time: float) -> list[MeshSurfaces]:
        return [
            MeshSurfaces(self._mi, person.skin([time])[0], person.mesh.faces())
            for person in self._with_mesh
            if person.mesh is not None
        ]
