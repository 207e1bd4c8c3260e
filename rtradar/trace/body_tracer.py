"""Ask Mitsuba which part of a body of ellipsoids a ray meets; float64 says where.

Every ellipsoid is the exact unit `sphere` of Mitsuba in axes of its own, so there is no scene to
pose: each ray is taken into the axes of the part that it comes near. Instances of a sphere in one
posed scene answer wrongly where Dr.Jit compiles, and instances of triangles cost more to pose than
their rays (`validation/cost/occluders.py`). The answers are held against float64 in
`validation/other_methods/occlusion.py`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.kernels.scatter.rays import facet_rays, first_occluders, near_rays
from rtradar.system.threads import thread_map
from rtradar.trace.rays import any_met, ball_around

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_Groups = tuple[Indices, Indices, Indices, Poses]

_LINES_A_THREAD = 1 << 14
"""For fewer, waking threads costs more than the work."""


class UnitSphere:
    """The unit sphere in a scene of its own of Mitsuba, ``mi``, which has its variant set."""

    def __init__(self, mi: Any) -> None:
        self._mi = mi
        self._scene = mi.load_dict({"type": "scene", "sphere": {"type": "sphere"}})

    def meets(self, rays: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Which rays (7, ray) meet it: start, unit direction and length in its axes."""
        return any_met(self._mi, self._scene, rays)


class BodyTracer:
    """A body of ellipsoids with ``semi_axes (part, 3)`` [m], posed again and again.

    Of its `Surfaces` each is a part. Mitsuba, ``mi``, has its variant set.
    """

    flat = False

    def __init__(self, mi: Any, semi_axes: Array) -> None:
        self._semi_axes = np.ascontiguousarray(semi_axes, dtype=np.float64)
        self._longest = self._semi_axes.max(axis=1)
        self._sphere = UnitSphere(mi)
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

        Lines go from ``origins`` to ``targets (line, 3)``, world [m]. Those of a ``group (line,)``
        have their targets on the part ``own (group,)``, which cannot occlude them, -1 for none, in
        the pose ``pose (group,)`` among ``poses``.
        """
        seen = np.ones(len(origins), dtype=bool)
        seen[self._met(origins, targets, (group, own, pose, poses))[0]] = False
        return seen

    def meets(
        self, points: Array, normals: Array, directions: Array, own: Indices
    ) -> tuple[Indices, Array]:
        """As `Surfaces.meets`: the part; no part is met from itself, since all are convex."""
        centre, ball = ball_around(self._posed[0], self._longest)
        reach = np.linalg.norm(points - centre, axis=1) + ball
        ends = points + reach[:, None] * directions
        line, part = self._met(points, ends, self._groups(own))
        entry, exit_ = self._crossings(part, points[line], directions[line])
        far = np.where(entry > 0, entry, exit_)
        nearest = np.lexsort((far, line))
        line, first = np.unique(line[nearest], return_index=True)
        found, distance = np.full(len(points), -1, dtype=np.int64), np.full(len(points), np.inf)
        found[line], distance[line] = part[nearest][first], far[nearest][first]
        return found, distance

    def distance(self, surface: Indices, origins: Array, directions: Array) -> Array:
        """As `Surfaces.distance`: where the line enters the ellipsoid."""
        return self._crossings(surface, origins, directions, missed=np.nan)[0]

    def normal(self, surface: Indices, points: Array, directions: Array) -> Array:
        """As `Surfaces.normal`; always outward, and so no normal for rays that come from inside."""
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

        It is another part that is nearer to the antenna on the same line, else -1. ``centres`` and
        ``frames`` are the pose of the body, ``antennas (antenna, 3)`` places, world [m]. Asked
        about are the vertices of ``parts (n,)``, but not those that face away by more than the sine
        ``margin``; ``vertices (3, vertex)`` are those of every part, from ``first (part + 1,)`` on,
        on its ellipsoid, in its own axes [m].
        """
        found = np.full((len(antennas), vertices.shape[1]), -1, dtype=np.int16)
        floats = (antennas, centres, frames, self._semi_axes, self._longest)
        places, *body = (np.ascontiguousarray(a, dtype=np.float64) for a in floats)
        asked = np.ascontiguousarray(parts, dtype=np.int64)
        rays, whose = facet_rays(places, asked, *body, vertices, first, float(margin))
        first_occluders(self._sphere.meets(rays[:7]), rays[7], whose, found.ravel())
        return found

    # -- rays --------------------------------------------------------------------------------------

    def _groups(self, own: Indices) -> _Groups:
        """Groups of lines by the part ``own (ray,)``, -1 for none, as `clear` takes them."""
        parts = len(self._semi_axes)
        centres, frames = self._posed
        # The last group is that of none.
        whose = np.append(np.arange(parts), -1), np.zeros(parts + 1, dtype=np.int64)
        return own % (parts + 1), *whose, Poses(centres[None], frames[None], self._semi_axes)

    def _met(self, origins: Array, targets: Array, groups: _Groups) -> Indices:
        """Lines and the parts that they meet (2, hit), of lines and groups as of `clear`."""
        group, own, pose, poses = groups
        maps = np.swapaxes(poses.frames, -1, -2) / self._semi_axes[:, :, None]
        floats = (origins, targets, poses.centres, maps, self._longest)
        starts, ends, *body = (np.ascontiguousarray(a, dtype=np.float64) for a in floats)

        def near(begin: int) -> tuple[NDArray[np.float32], Indices]:
            some = slice(begin, begin + _LINES_A_THREAD)
            rays, whose = near_rays(starts[some], ends[some], group[some], own, pose, *body)
            whose[0] += begin
            return rays, whose

        found = thread_map(near, range(0, len(starts), _LINES_A_THREAD))
        if not found:
            return np.empty((2, 0), dtype=np.int64)
        rays, whose = (np.concatenate(arrays, axis=-1) for arrays in zip(*found, strict=True))
        return np.asarray(whose[:, self._sphere.meets(rays)])

    def _crossings(
        self, part: Indices, origins: Array, directions: Array, missed: float = 0.0
    ) -> tuple[Array, Array]:
        """Where lines (..., 3) enter and leave parts [m]; half a chord is ``missed`` where none."""
        o = self._stretched(part, origins - self._posed[0][part])
        d = self._stretched(part, directions)
        square, half, rest = (d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - 1
        root = half**2 - square * rest
        chord = np.where(root > 0, np.sqrt(np.maximum(root, 0.0)), missed)
        return (-half - chord) / square, (-half + chord) / square

    def _stretched(self, part: Indices, vectors: Array) -> Array:
        """To the axes in which the part is the unit sphere."""
        turned = np.einsum("...ji,...j->...i", self._posed[1][part], vectors)
        return np.asarray(turned / self._semi_axes[part])
