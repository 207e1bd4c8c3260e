"""Ask Mitsuba whether furniture is between two points of a room.

Furniture only: walls are rectangles, and few, so they are done in closed form in float64. Mitsuba
works in float32, so its scene is centred on the furniture, and rays start where they enter the ball
around it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.scene import Scene
from rtradar.scene.mitsuba_scene import triangle_mesh
from rtradar.trace.rays import any_met, ball_around

CLEAR_M = 1e-3
"""Length by which both ends of a leg are drawn in [m], so that a surface does not occlude its own
points: a thousand times the error of float32 some 10 m from the middle."""


class RoomTracer:
    """The furniture of a scene, in a scene of its own for Mitsuba, ``mi`` with its variant set."""

    def __init__(self, mi: Any, scene: Scene) -> None:
        self._mi = mi
        self._scene: Any = None
        self._centre, self._ball = np.zeros(3), 0.0
        pieces = [piece.triangles() for piece in scene.furniture]
        if pieces:
            counts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
            vertices = np.concatenate([piece.vertices for piece in pieces])
            faces = np.concatenate(
                [piece.faces + count for piece, count in zip(pieces, counts[:-1], strict=True)]
            )
            self._centre, self._ball = ball_around(vertices)
            mesh = triangle_mesh(mi, vertices - self._centre, faces)
            self._scene = mi.load_dict({"type": "scene", "furniture": mesh})

    def blocked(self, origins: ArrayLike, targets: ArrayLike) -> NDArray[np.bool_]:
        """Whether furniture is between two points, ``origins`` and ``targets (..., 3)``, world [m].

        Both are drawn in by `CLEAR_M`, so either may be on a surface. The answer is False without
        furniture, and where two points are at most twice `CLEAR_M` apart.
        """
        origins, targets = np.broadcast_arrays(
            np.asarray(origins, dtype=np.float64), np.asarray(targets, dtype=np.float64)
        )
        out = np.zeros(origins.shape[:-1], dtype=bool)
        if self._scene is None or out.size == 0:
            return out
        starts, ways = (origins - self._centre).reshape(-1, 3), (targets - origins).reshape(-1, 3)
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
        return met.reshape(out.shape)
