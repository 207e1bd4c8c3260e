"""Ask Mitsuba whether furniture or a moving object is between two points of a room.

Walls are rectangles, and few, so they are done in closed form in float64. Mitsuba works in float32,
so each scene of its is centred on what it holds, and rays start where they enter the ball around
it. A moving object has a scene in its own axes, into which rays are taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.scene import Object, Scene, Triangles
from rtradar.scene.mitsuba_scene import triangle_mesh
from rtradar.trace.rays import any_met, ball_around

Array = NDArray[np.float64]

CLEAR_M = 1e-3
"""Length by which both ends of a leg are drawn in [m], so that a surface does not occlude its own
points: a thousand times the error of float32 some 10 m from the middle."""


class _Solid:
    """Meshes in one scene of Mitsuba, centred on them."""

    def __init__(self, mi: Any, pieces: Sequence[Triangles]) -> None:
        self._mi = mi
        counts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
        vertices = np.concatenate([piece.vertices for piece in pieces])
        faces = np.concatenate(
            [piece.faces + count for piece, count in zip(pieces, counts[:-1], strict=True)]
        )
        self._centre, self._ball = ball_around(vertices)
        mesh = triangle_mesh(mi, vertices - self._centre, faces)
        self._scene = mi.load_dict({"type": "scene", "furniture": mesh})

    def meets(self, origins: Array, targets: Array) -> NDArray[np.bool_]:
        """Whether the way between points (ray, 3), both ends drawn in, meets any of it."""
        starts, ways = origins - self._centre, targets - origins
        size = np.linalg.norm(ways, axis=1)
        ways = ways / np.where(size > 0, size, 1.0)[:, None]
        along = -np.einsum("ij,ij->i", starts, ways)
        nearest = starts + along[:, None] * ways
        chord = self._ball**2 - np.einsum("ij,ij->i", nearest, nearest)
        half = np.sqrt(np.maximum(chord, 0.0))
        first, last = np.maximum(along - half, CLEAR_M), np.minimum(along + half, size - CLEAR_M)
        # Only legs that enter the ball have to be followed.
        asked = np.flatnonzero((chord > 0) & (last > first))
        met = np.zeros(len(starts), dtype=bool)
        entry = starts[asked] + first[asked, None] * ways[asked]
        rays = np.concatenate([entry.T, ways[asked].T, (last - first)[None, asked]])
        met[asked] = any_met(self._mi, self._scene, rays.astype(np.float32))
        return met


class RoomTracer:
    """The furniture and the moving objects of a scene for Mitsuba, ``mi`` with its variant set."""

    def __init__(self, mi: Any, scene: Scene) -> None:
        pieces = [piece.triangles() for piece in scene.furniture]
        self._still = _Solid(mi, pieces) if pieces else None
        self._moving = [(moving, _Solid(mi, [moving.shape])) for moving in scene.objects]

    def blocked(
        self,
        origins: ArrayLike,
        targets: ArrayLike,
        times: ArrayLike | None = None,
        *,
        but: Object | None = None,
    ) -> NDArray[np.bool_]:
        """Whether anything is between two points, ``origins`` and ``targets (..., 3)``, world [m].

        Both are drawn in by `CLEAR_M`, so either may be on a surface. The answer is False in an
        empty room, and where two points are at most twice `CLEAR_M` apart. Objects, ``but`` one,
        are where they are at the ``times (...)`` since the start of the capture [s]; without times
        only what stands still is asked.
        """
        starts, ends = np.broadcast_arrays(
            np.asarray(origins, dtype=np.float64), np.asarray(targets, dtype=np.float64)
        )
        shape = starts.shape[:-1]
        starts, ends = starts.reshape(-1, 3), ends.reshape(-1, 3)
        met = np.zeros(len(starts), dtype=bool)
        if met.size == 0:
            return met.reshape(shape)
        if self._still is not None:
            met |= self._still.meets(starts, ends)
        if times is not None and self._moving:
            moments, moment = np.unique(np.broadcast_to(times, shape), return_inverse=True)
            for moving, solid in self._moving:
                if moving is but:
                    continue
                clear = np.flatnonzero(~met)
                rotation, place = (own[moment.ravel()[clear]] for own in moving.pose(moments))
                met[clear] = solid.meets(
                    *(
                        np.einsum("ri,rij->rj", points[clear] - place, rotation)
                        for points in (starts, ends)
                    )
                )
        return met.reshape(shape)
