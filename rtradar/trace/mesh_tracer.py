"""Ask Mitsuba which triangle of a mesh a ray meets; float64 says where.

The mesh has a scene of its own, centred on it, into which rays start where they enter the ball
around it: Mitsuba works in float32.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.trace.rays import any_met, ball_around, ball_chord, first_met, triangle_scene

Array = NDArray[np.float64]

CLEAR_M = 1e-3
"""Length by which both ends of a leg are drawn in [m], so that a surface does not occlude its own
points: a thousand times the error of float32 some 10 m from the middle."""

_LIFT = 1e-5
"""Fraction of a mesh's radius by which rays are lifted off it: a hundred steps of float32."""


class MeshTracer:
    """A triangle mesh; of its `Surfaces` each is a face, and reflects on both sides.

    ``corners (face, 3, 3)`` are in the world [m]. A hit nearer to a point than the fraction
    ``same`` of the mesh's size is the point; float32 knows distances to a millionth. ``mi`` is
    Mitsuba with its variant set.
    """

    flat = True

    def __init__(self, mi: Any, corners: Array, *, same: float = 1e-6) -> None:
        self._mi, self._same, self._bouncing = mi, same, range(len(corners))
        self._centre, self._ball = ball_around(corners.reshape(-1, 3))
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        # A face without area has no normal and is never met: any unit vector serves.
        size = np.linalg.norm(across, axis=1, keepdims=True)
        self._normals = np.where(size > 0, across / np.where(size > 0, size, 1.0), [0.0, 0.0, 1.0])
        self._places = corners[:, 0]
        self._scene = triangle_scene(mi, corners - self._centre)

    def between(self, origins: Array, targets: Array) -> NDArray[np.bool_]:
        """Whether any face is between two points (ray, 3), both drawn in by `CLEAR_M`."""
        starts, ways = origins - self._centre, targets - origins
        size = np.linalg.norm(ways, axis=1)
        ways = ways / np.where(size > 0, size, 1.0)[:, None]
        along, square = ball_chord(starts, ways, self._ball)
        half = np.sqrt(np.maximum(square, 0.0))
        first, last = np.maximum(along - half, CLEAR_M), np.minimum(along + half, size - CLEAR_M)
        # Only legs that enter the ball have to be followed.
        asked = np.flatnonzero((square > 0) & (last > first))
        met = np.zeros(len(starts), dtype=bool)
        entry = starts[asked] + first[asked, None] * ways[asked]
        rays = np.concatenate([entry.T, ways[asked].T, (last - first)[None, asked]])
        met[asked] = any_met(self._mi, self._scene, rays.astype(np.float32))
        return met

    def sees(self, origins: Array, targets: Array, own: NDArray[np.int64]) -> NDArray[np.bool_]:
        """As `Surfaces.sees`."""
        face, met = self._first_hits(origins, targets - origins)
        nearer = met < np.linalg.norm(targets - origins, axis=1) - self._same * self._ball
        return ~((face != own) & nearer)

    def meets(
        self, points: Array, normals: Array, directions: Array, own: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Array]:
        """As `Surfaces.meets`; the distance is of float32 quality."""
        face, distance = self._first_hits(points + _LIFT * self._ball * normals, directions)
        own = (face >= self._bouncing.start) & (face < self._bouncing.stop)
        return np.where(own, face, -1), np.where(own, distance, np.inf)

    def of_piece(self, first: int, last: int) -> MeshTracer:
        """Return the mesh, of which rays bounce on these faces only: others absorb them."""
        piece = copy.copy(self)
        piece._bouncing = range(first, last)
        return piece

    def way_out(
        self, points: Array, normals: Array, antenna: Array, own: NDArray[np.int64]
    ) -> tuple[Array, NDArray[np.int64]]:
        """Places (ray, 3) [m] and faces where the ways to an antenna (3,) leave the mesh.

        The points (ray, 3) are on the faces ``own (ray,)``, the normals those into the mesh. What
        meets nothing, by float32 at an edge, is outside at once.
        """
        ways = antenna - points
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        face, distance = self.meets(points, normals, ways, own)
        inside = face >= 0
        distance = np.where(inside, distance, 0.0)
        return points + distance[:, None] * ways, np.where(inside, face, own)

    def distance(self, surface: NDArray[np.int64], origins: Array, directions: Array) -> Array:
        """As `Surfaces.distance`: to the plane of the face, which has no border."""
        normal = self._normals[surface]
        steepness = (directions * normal).sum(-1)
        height = ((self._places[surface] - origins) * normal).sum(-1)
        return np.where(steepness != 0, height / np.where(steepness != 0, steepness, 1.0), np.nan)

    def normal(self, surface: NDArray[np.int64], points: Array, directions: Array) -> Array:
        """As `Surfaces.normal`."""
        normal = self._normals[surface]
        return np.where((directions * normal).sum(-1, keepdims=True) > 0, -normal, normal)

    def _first_hits(self, origins: Array, directions: Array) -> tuple[NDArray[np.int64], Array]:
        """Face (ray,) met first, -1 for none, and distance (ray,) [m], infinite for none."""
        directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        starts = origins - self._centre
        along, square = ball_chord(starts, directions, self._ball)
        # Rays start where they enter the ball.
        ahead = np.maximum(along - np.sqrt(np.maximum(square, 0.0)), 0.0)
        starts += ahead[:, None] * directions
        face, distance = first_met(self._mi, self._scene, starts, directions)
        return face, distance + ahead
