"""Surfaces for rays that bounce: Mitsuba says which one a ray meets, float64 says where.

The scene of Mitsuba is in float32 and made of triangles, so of its answer only the name of what was
met is kept: the part of a body, or the face of a mesh. The place follows in float64 from the ray
and that ellipsoid, or that face's plane.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import unit_sphere
from rtradar.scene.mitsuba_scene import build_body_scene, pose_body_scene, triangle_mesh
from rtradar.trace.rays import ball_around, first_met, into_ball

SUBDIVISIONS = 4
"""5120 triangles: middles up to 0.03 % inside the unit sphere, corners 0.07 % outside it."""

_LIFT_OF_PART = 1e-3
"""Fraction of the largest semi-axis by which rays are lifted off a part: its triangles, up to
0.07 % outside it, must not stop rays that leave it."""
_LIFT_OF_MESH = 1e-5
"""Fraction of a mesh's radius by which rays are lifted off it: a hundred steps of float32."""
_BEHIND = 1e-7  # relative; what is met this little before a point is the point itself

Array = NDArray[np.float64]


class Surfaces(Protocol):
    """What rays can meet: a posed body or a mesh; surfaces go by their numbers, -1 is none.

    ``flat`` tells whether surfaces are flat faces.
    """

    flat: bool

    def sees(self, antennas: Array, points: Array, own: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether no surface but ``own (ray,)`` is nearer to an antenna than a point (ray, 3)."""
        ...

    def meets(
        self, points: Array, normals: Array, directions: Array, own: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Array]:
        """Surface (ray,) met first from points on surfaces ``own``, and how far it is [m].

        Rays leave on the side of the normals, along unit vectors ``directions (ray, 3)``. The
        distance is of float32 quality, and infinite where nothing is met.
        """
        ...

    def distance(self, surface: NDArray[np.int64], origins: Array, directions: Array) -> Array:
        """Distance to that surface along lines (..., 3), float64 [m]; NaN where they miss it."""
        ...

    def normal(self, surface: NDArray[np.int64], points: Array, directions: Array) -> Array:
        """Unit normals at points on surfaces, on the side that rays along them come from."""
        ...


class BodySurfaces:
    """Ellipsoids with ``semi_axes (part, 3)`` [m], posed; a surface is a part.

    ``owner (part,)`` are the people whose parts they are, one if left out. Each has a scene of
    their own about their own middle, so that float32 rounds alike whoever else is there.
    """

    flat = False

    def __init__(self, mi: Any, semi_axes: Array, owner: NDArray[np.int64] | None = None) -> None:
        self._axes = np.asarray(semi_axes, dtype=np.float64)
        owner = np.zeros(len(self._axes), dtype=np.int64) if owner is None else owner
        groups = (np.flatnonzero(owner == person) for person in np.unique(owner))
        self._people = [(parts, _PosedParts(mi, self._axes[parts])) for parts in groups]

    def pose(self, centres: Array, frames: Array) -> None:
        """Pose the body: ``centres (part, 3)`` [m], ``frames (part, 3, 3)``."""
        self._centres, self._frames = centres, frames
        for parts, own in self._people:
            own.pose(centres[parts], frames[parts])

    def first_parts(self, origins: Array, directions: Array) -> tuple[NDArray[np.int64], Array]:
        """Part (ray,) met first, -1 for none, and distance (ray,) [m] along unit vectors."""
        part = np.full(len(origins), -1, dtype=np.int64)
        distance = np.full(len(origins), np.inf)
        for parts, own in self._people:
            met, far = own.first_parts(origins, directions)
            nearer = far < distance
            part[nearer], distance[nearer] = parts[met[nearer]], far[nearer]
        return part, distance

    def sees(self, antennas: Array, points: Array, own: NDArray[np.int64]) -> NDArray[np.bool_]:
        """As `Surfaces.sees`; a part does not occlude itself: its normal tells that."""
        directions = points - antennas
        range_m = np.sqrt(np.einsum("ij,ij->i", directions, directions))
        part, distance = self.first_parts(antennas, directions / range_m[:, None])
        return ~((part != own) & (distance < range_m * (1 - _BEHIND)))

    def meets(
        self, points: Array, normals: Array, directions: Array, own: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Array]:
        """As `Surfaces.meets`."""
        lifted = points + _LIFT_OF_PART * self._axes.max(axis=1)[own][:, None] * normals
        return self.first_parts(lifted, directions)

    def distance(self, surface: NDArray[np.int64], origins: Array, directions: Array) -> Array:
        """As `Surfaces.distance`: where the line enters the ellipsoid."""
        o = self._stretched(surface, origins - self._centres[surface])
        d = self._stretched(surface, directions)
        square, half, rest = (d * d).sum(-1), (o * d).sum(-1), (o * o).sum(-1) - 1
        root = half**2 - square * rest
        return np.where(root > 0, (-half - np.sqrt(np.maximum(root, 0.0))) / square, np.nan)

    def normal(self, surface: NDArray[np.int64], points: Array, directions: Array) -> Array:
        """As `Surfaces.normal`; always outward, and so no normal for rays that come from inside."""
        local = self._stretched(surface, points - self._centres[surface]) / self._axes[surface]
        normal = np.einsum("...ij,...j->...i", self._frames[surface], local)
        return normal / np.linalg.norm(normal, axis=-1, keepdims=True)

    def _stretched(self, surface: NDArray[np.int64], vectors: Array) -> Array:
        """To the axes in which the part is the unit sphere."""
        return np.einsum("...ji,...j->...i", self._frames[surface], vectors) / self._axes[surface]


class _PosedParts:
    """The triangles of ellipsoids in a scene of Mitsuba, about their middle."""

    def __init__(self, mi: Any, semi_axes: Array) -> None:
        self._mi = mi
        self._axes = semi_axes
        self._scene = build_body_scene(mi, *unit_sphere(SUBDIVISIONS), len(self._axes))
        self._parameters = mi.traverse(self._scene)
        # The instances by their numbers in Dr.Jit's registry, which scalar variants have none of.
        self._instances = np.empty(0, dtype=np.int64)
        if not mi.variant().startswith("scalar"):
            import drjit as dr

            shapes = sorted(self._scene.shapes(), key=lambda shape: shape.id())
            pointers = (dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape)) for shape in shapes)
            registry = [int(pointer[0]) for pointer in pointers]
            self._instances = np.full(max(registry) + 1, -1, dtype=np.int64)
            self._instances[registry] = np.arange(len(registry))

    def pose(self, centres: Array, frames: Array) -> None:
        """Pose the body: ``centres (part, 3)`` [m], ``frames (part, 3, 3)``."""
        self._centre, self._ball = ball_around(centres, self._axes.max(axis=1))
        matrices = np.zeros((len(centres), 4, 4))
        matrices[:, :3, :3] = frames * self._axes[:, None, :]
        matrices[:, :3, 3] = centres - self._centre
        matrices[:, 3, 3] = 1
        pose_body_scene(self._mi, self._parameters, matrices)

    def first_parts(self, origins: Array, directions: Array) -> tuple[NDArray[np.int64], Array]:
        """Part (ray,) met first, -1 for none, and distance (ray,) [m] along unit vectors."""
        starts, ahead = into_ball(origins - self._centre, directions, self._ball)
        part, distance = first_met(self._mi, self._scene, starts, directions, self._instances)
        return part, distance + ahead


class MeshSurfaces:
    """A triangle mesh; a surface is a face, and reflects on both sides.

    ``vertices (vertex, 3)`` are in the world [m], ``faces (face, 3)`` the numbers of the three of
    each. A hit nearer to a point than the fraction ``same`` of the mesh's size is the point;
    float32 knows distances to a millionth.
    """

    flat = True

    def __init__(
        self, mi: Any, vertices: Array, faces: NDArray[np.integer], *, same: float = 1e-6
    ) -> None:
        corners = np.asarray(vertices, dtype=np.float64)[faces]
        self._same = same
        self._mi = mi
        self._centre, self._ball = ball_around(corners.reshape(-1, 3))
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        # A face without area has no normal and is never met: any unit vector serves.
        size = np.linalg.norm(across, axis=1, keepdims=True)
        self._normals = np.where(size > 0, across / np.where(size > 0, size, 1.0), [0.0, 0.0, 1.0])
        self._places = corners[:, 0]
        self._scene = mi.load_dict(
            {"type": "scene", "target": triangle_mesh(mi, vertices - self._centre, faces)}
        )

    def sees(self, antennas: Array, points: Array, own: NDArray[np.int64]) -> NDArray[np.bool_]:
        """As `Surfaces.sees`."""
        face, met = self._first_hits(antennas, points - antennas)
        nearer = met < np.linalg.norm(points - antennas, axis=1) - self._same * self._ball
        return ~((face != own) & nearer)

    def meets(
        self, points: Array, normals: Array, directions: Array, own: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Array]:
        """As `Surfaces.meets`."""
        return self._first_hits(points + _LIFT_OF_MESH * self._ball * normals, directions)

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
        starts, ahead = into_ball(origins - self._centre, directions, self._ball)
        face, distance = first_met(self._mi, self._scene, starts, directions)
        return face, distance + ahead
