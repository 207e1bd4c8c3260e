"""Ask Mitsuba which part of a body, or which triangle of a mesh, a ray meets; float64 says where.

What rays can meet, and bounce off, are `Surfaces`: a posed body or a mesh. Each surface, a part or
a face, has a number; -1 is none. Mitsuba, which works in float32, decides which surface a ray
meets; where the ray meets it follows in float64 from the ray and that surface.

Every ellipsoid is the exact unit `sphere` of Mitsuba in axes of its own, so there is no scene to
pose: each ray is taken into the axes of the part that it comes near. Instances of a sphere in one
posed scene give wrong answers where Dr.Jit compiles, and instances of triangles cost more to pose
than their rays to trace (`validation/cost/occluders.py`). The answers are compared with float64 in
`validation/other_methods/occlusion.py`. A mesh has a scene of its own, centred on it, in which rays
start where they enter the ball around it.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.kernels.scatter.rays import facet_rays, first_occluders, near_rays
from rtradar.system.threads import thread_map
from rtradar.trace.rays import Shapes, ball_around, ball_chord

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_Groups = tuple[Indices, Indices, Indices, Poses]

_LINES_A_THREAD = 1 << 14
"""Lines that one thread takes: for fewer, waking threads costs more than the work."""


CLEAR_M = 1e-3
"""Length by which both ends of a leg are drawn in [m], so that a surface does not occlude its own
points: a thousand times the error of float32 some 10 m from the middle."""

_LIFT = 1e-5
"""Fraction of a mesh's radius by which rays are lifted off it: a hundred steps of float32."""


class BodyTracer:
    """A body of ellipsoids with ``semi_axes (part, 3)`` [m], posed again and again.

    Each of its `Surfaces` is a part. Mitsuba, ``mi``, has its variant set.
    """

    flat = False

    def __init__(self, mi: Any, semi_axes: Array) -> None:
        self._semi_axes = np.ascontiguousarray(semi_axes, dtype=np.float64)
        self._longest = self._semi_axes.max(axis=1)
        self._sphere = Shapes(mi, sphere={"type": "sphere"})
        self._posed: tuple[Array, Array]

    def pose(self, centres: Array, frames: Array) -> None:
        """Pose the body: ``centres (part, 3)`` [m], ``frames (part, 3, 3)``, world axes."""
        self._posed = centres, frames

    def sees(self, origins: Array, targets: Array, own: Indices) -> NDArray[np.bool_]:
        """Whether no other part is between ``origins (ray, 3)`` and ``targets (ray, 3)`` [m].

        A target lies on part ``own (ray,)``, which cannot occlude it, or on none, -1. Mitsuba
        decides about every line of sight and every part that the line comes near.
        """
        return self.clear(origins, targets, *self._groups(own))

    def clear(
        self,
        origins: Array,
        targets: Array,
        group: Indices,
        own: Indices,
        pose: Indices,
        poses: Poses,
    ) -> NDArray[np.bool_]:
        """Whether no part is in the way of lines of sight (line,) past the body in several poses.

        Lines go from ``origins`` to ``targets (line, 3)``, world [m]. Lines of one ``group
        (line,)`` have their targets on the part ``own (group,)``, which cannot occlude them, or on
        none where it is -1. The body is in the pose ``pose (group,)`` among ``poses``.
        """
        seen = np.ones(len(origins), dtype=bool)
        seen[self._met(origins, targets, (group, own, pose, poses))[0]] = False
        return seen

    def meets(
        self, points: Array, normals: Array, directions: Array, own: Indices
    ) -> tuple[Indices, Array]:
        """Part (ray,) met first from points on parts ``own (ray,)``, and its distance [m].

        Rays leave along unit vectors ``directions (ray, 3)``. The distance is infinite where
        nothing is met; no part is met from itself, since all are convex. So ``normals`` are not
        used here: they are for `MeshTracer`, which lifts points off its faces by them.
        """
        # Rays have to end behind the whole body.
        centre, ball = ball_around(self._posed[0], self._longest)
        reach = np.linalg.norm(points - centre, axis=1) + ball
        ends = points + reach[:, None] * directions
        line, part = self._met(points, ends, self._groups(own))
        # Mitsuba says which parts a ray meets; where they are met is computed in float64.
        entry, exit_ = self._crossings(part, points[line], directions[line])
        far = np.where(entry > 0, entry, exit_)
        # The nearest part of each ray comes first among its hits.
        nearest = np.lexsort((far, line))
        line, first = np.unique(line[nearest], return_index=True)
        found, distance = np.full(len(points), -1, dtype=np.int64), np.full(len(points), np.inf)
        found[line], distance[line] = part[nearest][first], far[nearest][first]
        return found, distance

    def distance(self, surface: Indices, origins: Array, directions: Array) -> Array:
        """Distance to parts along lines (..., 3), where they enter [m]; NaN where they miss."""
        return self._crossings(surface, origins, directions, missed=np.nan)[0]

    def normal(self, surface: Indices, points: Array, directions: Array) -> Array:
        """Unit normals at points on parts, outward, also for rays that come from inside."""
        # The gradient of the ellipsoid's equation in its axes, turned into the world.
        local = self._stretched(surface, points - self._posed[0][surface])
        local /= self._semi_axes[surface]
        normal = np.einsum("...ij,...j->...i", self._posed[1][surface], local)
        return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))

    def occluders(
        self,
        centres: Array,
        frames: Array,
        antennas: Array,
        parts: Indices,
        vertices: Array,
        first: Indices,
        margin: float,
    ) -> NDArray[np.int16]:
        """Part that occludes each vertex, as each antenna sees it, (antenna, vertex) int16.

        It is another part that is nearer to the antenna on the same line, one of them where these
        are several (`first_occluders`), else -1. ``centres`` and ``frames`` are the pose of the
        body, ``antennas (antenna, 3)`` are places, world [m]. Only vertices of ``parts (n,)`` are
        asked about that do not face away by more than the sine ``margin``. ``vertices (3,
        vertex)`` are those of all parts, each from ``first (part + 1,)`` on, on its ellipsoid, in
        its own axes [m].
        """
        # One ray for each vertex and part that may occlude it.
        found = np.full((len(antennas), vertices.shape[1]), -1, dtype=np.int16)
        floats = (antennas, centres, frames, self._semi_axes, self._longest)
        places, *body = (np.ascontiguousarray(a, dtype=np.float64) for a in floats)
        asked = np.ascontiguousarray(parts, dtype=np.int64)
        rays, whose = facet_rays(places, asked, *body, vertices, first, float(margin))
        first_occluders(self._sphere.any_met(rays[:7]), rays[7], whose, found.ravel())
        return found

    # -- rays --------------------------------------------------------------------------------------

    def _groups(self, own: Indices) -> _Groups:
        """Groups of lines by the part ``own (ray,)``, -1 for none, as `clear` takes them."""
        parts = len(self._semi_axes)
        centres, frames = self._posed
        # The last group has no part of its own: -1 modulo the number of groups is its number.
        whose = np.append(np.arange(parts), -1), np.zeros(parts + 1, dtype=np.int64)
        return own % (parts + 1), *whose, Poses(centres[None], frames[None], self._semi_axes)

    def _met(self, origins: Array, targets: Array, groups: _Groups) -> Indices:
        """Lines and the parts that they meet (2, hit), for lines and groups as in `clear`."""
        group, own, pose, poses = groups
        # The map to the axes in which each part is the unit sphere.
        maps = np.swapaxes(poses.frames, -1, -2) / self._semi_axes[:, :, None]
        floats = (origins, targets, poses.centres, maps, self._longest)
        starts, ends, *body = (np.ascontiguousarray(a, dtype=np.float64) for a in floats)

        def near(begin: int) -> tuple[NDArray[np.float32], Indices]:
            some = slice(begin, begin + _LINES_A_THREAD)
            rays, whose = near_rays(starts[some], ends[some], group[some], own, pose, *body)
            whose[0] += begin
            return rays, whose

        # Threads choose the rays; Mitsuba is asked about all of them at once.
        found = thread_map(near, range(0, len(starts), _LINES_A_THREAD))
        if not found:
            return np.empty((2, 0), dtype=np.int64)
        rays, whose = (np.concatenate(arrays, axis=-1) for arrays in zip(*found, strict=True))
        return np.asarray(whose[:, self._sphere.any_met(rays)])

    def _crossings(
        self, part: Indices, origins: Array, directions: Array, missed: float = 0.0
    ) -> tuple[Array, Array]:
        """Where lines (..., 3) enter and leave parts [m].

        Half the chord is taken as ``missed`` where a line meets none.
        """
        o = self._stretched(part, origins - self._posed[0][part])
        d = self._stretched(part, directions)
        # The line meets the unit sphere where square t^2 + 2 half t + rest = 0.
        square, half, rest = (d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - 1
        root = half**2 - square * rest
        chord = np.where(root > 0, np.sqrt(np.maximum(root, 0.0)), missed)
        return (-half - chord) / square, (-half + chord) / square

    def _stretched(self, part: Indices, vectors: Array) -> Array:
        """Bring vectors to the axes in which the part is the unit sphere."""
        turned = np.einsum("...ji,...j->...i", self._posed[1][part], vectors)
        return np.asarray(turned / self._semi_axes[part])


# -- meshes ----------------------------------------------------------------------------------------


class MeshTracer:
    """A triangle mesh; each of its `Surfaces` is a face, and reflects on both sides.

    ``corners (face, 3, 3)`` are in the world [m]. A hit that is nearer to a point than the fraction
    ``same`` of the mesh's size counts as the point; float32 knows distances to a millionth. ``mi``
    is Mitsuba with its variant set.
    """

    flat = True

    def __init__(self, mi: Any, corners: Array, *, same: float = 1e-6) -> None:
        self._same, self._bouncing = same, range(len(corners))
        self._centre, self._ball = ball_around(corners.reshape(-1, 3))
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        # A face without area has no normal and is never met: any unit vector serves.
        size = np.linalg.norm(across, axis=1, keepdims=True)
        self._normals = np.where(size > 0, across / np.where(size > 0, size, 1.0), [0.0, 0.0, 1.0])
        self._places = corners[:, 0]
        self._scene = Shapes.of_triangles(mi, corners - self._centre)

    def between(self, origins: Array, targets: Array) -> NDArray[np.bool_]:
        """Whether any face is between two points (ray, 3), both drawn in by `CLEAR_M`."""
        starts, ways = origins - self._centre, targets - origins
        size = np.linalg.norm(ways, axis=1)
        # The part of each leg inside the ball around the mesh, drawn in at both ends.
        ways = ways / np.where(size > 0, size, 1.0)[:, None]
        along, square = ball_chord(starts, ways, self._ball)
        half = np.sqrt(np.maximum(square, 0.0))
        first, last = np.maximum(along - half, CLEAR_M), np.minimum(along + half, size - CLEAR_M)
        # Only legs that enter the ball have to be followed.
        asked = np.flatnonzero((square > 0) & (last > first))
        met = np.zeros(len(starts), dtype=bool)
        entry = starts[asked] + first[asked, None] * ways[asked]
        rays = np.concatenate([entry.T, ways[asked].T, (last - first)[None, asked]])
        met[asked] = self._scene.any_met(rays.astype(np.float32))
        return met

    def sees(self, origins: Array, targets: Array, own: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether no face but ``own (ray,)`` is between origins and targets (ray, 3) on it."""
        # A hit that is hardly nearer than the target is the target.
        face, met = self._first_hits(origins, targets - origins)
        nearer = met < np.linalg.norm(targets - origins, axis=1) - self._same * self._ball
        return ~((face != own) & nearer)

    def meets(
        self, points: Array, normals: Array, directions: Array, own: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Array]:
        """Do the same as `BodyTracer.meets`; the distance has the precision of float32."""
        face, distance = self._first_hits(points + _LIFT * self._ball * normals, directions)
        bounces = (face >= self._bouncing.start) & (face < self._bouncing.stop)
        return np.where(bounces, face, -1), np.where(bounces, distance, np.inf)

    def of_piece(self, first: int, last: int) -> MeshTracer:
        """Return the mesh such that rays bounce on these faces only: others absorb them."""
        piece = copy.copy(self)
        piece._bouncing = range(first, last)
        return piece

    def way_out(
        self, points: Array, normals: Array, antenna: Array, own: NDArray[np.int64]
    ) -> tuple[Array, NDArray[np.int64]]:
        """Places (ray, 3) [m] and faces where the lines to an antenna (3,) leave the mesh.

        The points (ray, 3) are on the faces ``own (ray,)``, and the normals point into the mesh. A
        ray that meets nothing, as float32 may have it at an edge, is outside at once.
        """
        # From just inside the mesh, the first face that is met is where the line leaves it.
        ways = antenna - points
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        face, distance = self.meets(points, normals, ways, own)
        inside = face >= 0
        distance = np.where(inside, distance, 0.0)
        return points + distance[:, None] * ways, np.where(inside, face, own)

    def distance(self, surface: NDArray[np.int64], origins: Array, directions: Array) -> Array:
        """Distance along lines (..., 3) to the planes of faces, which have no border [m]."""
        normal = self._normals[surface]
        steepness = (directions * normal).sum(-1)
        height = ((self._places[surface] - origins) * normal).sum(-1)
        return np.where(steepness != 0, height / np.where(steepness != 0, steepness, 1.0), np.nan)

    def normal(self, surface: NDArray[np.int64], points: Array, directions: Array) -> Array:
        """Unit normals at points on faces, on the side that rays along ``directions`` come from."""
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
        face, distance = self._scene.first_met(starts, directions)
        return face, distance + ahead


Surfaces = BodyTracer | MeshTracer
"""What rays meet: ``flat`` tells whether they are flat faces."""
