"""What stands between two points of a scene: furniture, moving objects and people.

Walls are rectangles, and few, so they are done in closed form in float64. A moving object has a
scene of Mitsuba in its own axes, into which rays are taken.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.scene import Object, Scene
from rtradar.trace.tracers import BodyTracer, MeshTracer

Array = NDArray[np.float64]

_KEPT = 8
"""Poses of meshes that are kept, 5 MB each, because all paths ask for the same times."""


class Occluders:
    """The furniture and the moving objects of a scene, and people if there is a ``body``.

    People are ellipsoids, or their mesh if they have one. ``mi`` is Mitsuba with its variant set.
    """

    def __init__(self, mi: Any, scene: Scene, body: Body | None = None) -> None:
        self.mi, self._body = mi, body
        # All furniture is one mesh, which stands still; each object has a scene of its own axes.
        pieces = [piece.triangles().corners for piece in scene.furniture]
        self._still = MeshTracer(mi, np.concatenate(pieces)) if pieces else None
        self._moving = [(own, MeshTracer(mi, own.shape.corners)) for own in scene.objects]
        people = () if body is None else body.people
        self._meshes = [(one, one.mesh) for one in people if one.mesh is not None]
        # Ellipsoids of everybody without a mesh are one body.
        if body is not None:
            others = [n for n, person in enumerate(people) if person.mesh is None]
            self._parts = np.flatnonzero(np.isin(body.owner, others))
            self._ellipsoids = BodyTracer(mi, body.semi_axes[self._parts])
        self._skins: dict[float, list[MeshTracer]] = {}

    def clear(
        self,
        origins: ArrayLike,
        targets: ArrayLike,
        times: ArrayLike | None = None,
        *,
        but: Object | None = None,
    ) -> NDArray[np.bool_]:
        """Whether nothing is between two points, ``origins`` and ``targets (..., 3)``, world [m].

        Both are drawn in by `CLEAR_M`, so either may be on a surface. The answer is True in an
        empty scene, and where two points are at most twice `CLEAR_M` apart. Objects, ``but`` one,
        and people are where they are at the ``times (...)`` since the start of the capture [s];
        without times only what stands still is asked.
        """
        starts, ends = np.broadcast_arrays(
            np.asarray(origins, dtype=np.float64), np.asarray(targets, dtype=np.float64)
        )
        shape = starts.shape[:-1]
        starts, ends = starts.reshape(-1, 3), ends.reshape(-1, 3)
        # What stands still comes first, because it needs no poses.
        clear = np.ones(len(starts), dtype=bool)
        if clear.size and self._still is not None:
            clear = ~self._still.between(starts, ends)
        if clear.size and times is not None:
            # Poses are computed once for each instant; only rays that are still free go on.
            moments, moment = np.unique(np.broadcast_to(times, shape), return_inverse=True)
            moment = moment.ravel()
            for moving, tracer in self._moving:
                if moving is not but:
                    left = np.flatnonzero(clear)
                    rotation, place = (own[moment[left]] for own in moving.pose(moments))
                    ways = (points[left] - place for points in (starts, ends))
                    ways = (np.einsum("ri,rij->rj", way, rotation) for way in ways)
                    clear[left] = ~tracer.between(*ways)
            if self._body is not None:
                left = np.flatnonzero(clear)
                clear[left] = self._past_people(starts[left], ends[left], moments, moment[left])
        return clear.reshape(shape)

    def _past_people(
        self, origins: Array, targets: Array, moments: Array, moment: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Which lines (ray,) people leave clear, each at one ``moment (ray,)`` of several."""
        assert self._body is not None
        # Outside of the recording people rest in their first or last pose.
        moments = np.clip(moments, 0.0, self._body.duration_s)
        clear = np.ones(len(origins), dtype=bool)
        if len(self._parts):
            (centres, frames, semi_axes), parts = self._body.at(moments), self._parts
            own = Poses(centres[:, parts], frames[:, parts], semi_axes[parts])
            numbers = np.arange(len(moments))
            none = np.full_like(numbers, -1)
            clear = self._ellipsoids.clear(origins, targets, moment, none, numbers, own)
        # Skins bend, so each instant has a mesh of its own.
        for number in np.unique(moment) if self._meshes else ():
            for skin in self._skins_at(float(moments[number])):
                left = np.flatnonzero(clear & (moment == number))
                clear[left] = ~skin.between(origins[left], targets[left])
        return clear

    def _skins_at(self, time: float) -> list[MeshTracer]:
        if time not in self._skins:
            if len(self._skins) >= _KEPT:
                self._skins.pop(next(iter(self._skins)))
            self._skins[time] = [
                MeshTracer(self.mi, person.skin([time])[0][mesh.faces()])
                for person, mesh in self._meshes
            ]
        return self._skins[time]
