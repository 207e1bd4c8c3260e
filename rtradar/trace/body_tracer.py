"""Ask Mitsuba what rays meet on a posed body.

Mitsuba works in float32. So the scene is centred on the body, each ray starts where it enters the ball around it, and
all that is taken from Mitsuba is which part is met first, on which triangle and where in it. A place comes from the
triangle and its barycentric coordinates in float64; lengths of paths are never taken from here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body.meshes import unit_sphere
from rtradar.scene.mitsuba_scene import build_body_scene, pose_body_scene
from rtradar.trace.near_rays import near_rays
from rtradar.trace.rays import rays_of
from rtradar.trace.unit_sphere import UnitSphere

SUBDIVISIONS = 4
"""5120 triangles: middles up to 0.03 % inside the unit sphere, corners 0.07 % outside it."""


@dataclass(frozen=True)
class Hits:
    """What rays met first.

    Parameters
    ----------
    part : (ray,) int64
        Body part; -1 where nothing was met.
    distance : (ray,) float64
        From the origin of the ray [m], of float32 quality: enough to say who is in front. Infinite where nothing was met.
    local : (ray, 3) float64
        The place in the part's own axes, on its ellipsoid [m]; NaN where nothing was met.
    """

    part: NDArray[np.int64]
    distance: NDArray[np.float64]
    local: NDArray[np.float64]


class BodyTracer:
    """A body of ellipsoids in a Mitsuba scene, posed again and again.

    Parameters
    ----------
    mi : module
        Mitsuba with its variant set.
    semi_axes : (part, 3) float64
        [m].
    """

    def __init__(self, mi: Any, semi_axes: NDArray[np.float64]) -> None:
        self._mi = mi
        self._scalar = mi.variant().startswith("scalar")
        self._semi_axes = np.asarray(semi_axes, dtype=np.float64)
        self._sphere = UnitSphere(mi)
        self._vertices, self._faces = unit_sphere(SUBDIVISIONS)
        self._scene = build_body_scene(mi, self._vertices, self._faces, len(self._semi_axes))
        self._parameters = mi.traverse(self._scene)
        self._centre = np.zeros(3)
        self._ball = 0.0
        self._pose: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        self._waiting = False
        self._part_of: Any
        shapes = sorted(self._scene.shapes(), key=lambda shape: shape.id())
        if self._scalar:
            self._part_of = {shape.id(): part for part, shape in enumerate(shapes)}
        else:
            import drjit as dr

            registry = [
                int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]) for shape in shapes
            ]
            self._part_of = np.full(max(registry) + 1, -1, dtype=np.int64)
            self._part_of[registry] = np.arange(len(registry))

    def pose(self, centres: NDArray[np.float64], frames: NDArray[np.float64]) -> None:
        """Pose the body: ``centres (part, 3)`` [m], ``frames (part, 3, 3)``, world axes; Mitsuba hears of it by the first ray."""
        # Several ask about one pose in turn, and to place it is most of the cost of a few rays.
        if self._pose is None or not all(map(np.array_equal, self._pose, (centres, frames))):
            self._pose, self._waiting = (centres.copy(), frames.copy()), True

    def _place(self) -> None:
        """See to it that Mitsuba has the pose."""
        if self._pose is None:
            raise RuntimeError("BodyTracer: pose the body before rays are sent")
        if not self._waiting:
            return
        centres, frames = self._pose
        self._waiting = False
        self._centre = (centres.max(axis=0) + centres.min(axis=0)) / 2
        self._ball = (
            float(
                (np.linalg.norm(centres - self._centre, axis=1) + self._semi_axes.max(axis=1)).max()
            )
            * 1.01
        )
        matrices = np.zeros((len(centres), 4, 4))
        matrices[:, :3, :3] = frames * self._semi_axes[:, None, :]
        matrices[:, :3, 3] = centres - self._centre
        matrices[:, 3, 3] = 1
        pose_body_scene(self._mi, self._parameters, matrices)

    def sees(
        self, origins: NDArray[np.float64], targets: NDArray[np.float64], own: NDArray[np.int64]
    ) -> NDArray[np.bool_]:
        """Whether no other part stands between ``origins (ray, 3)`` and ``targets (ray, 3)`` [m].

        A target lies on part ``own (ray,)``, which cannot occlude it, or on none, -1. Mitsuba decides about every line of sight
        and every part that the line comes near.
        """
        if self._pose is None:
            raise RuntimeError("BodyTracer: pose the body before rays are sent")
        rays, line = near_rays(origins, targets, own, *self._pose, self._semi_axes)
        seen = np.ones(len(origins), dtype=bool)
        seen[line[self._sphere.meets(rays)]] = False
        return seen

    def first_hits(self, origins: NDArray[np.float64], targets: NDArray[np.float64]) -> Hits:
        """What rays from ``origins (ray, 3)`` through ``targets (ray, 3)`` meet first; world [m]."""
        if len(origins) == 0:
            # Dr.Jit takes the process down over arrays without entries.
            return Hits(np.empty(0, dtype=np.int64), np.empty(0), np.empty((0, 3)))
        self._place()
        directions = targets - origins
        directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        starts = origins - self._centre
        # Distance along the ray to where it enters the ball around the body; rays that miss it miss the body.
        along = -np.einsum("ij,ij->i", starts, directions)
        half_chord = np.sqrt(
            np.maximum(self._ball**2 - np.einsum("ij,ij->i", starts, starts) + along**2, 0.0)
        )
        ahead = np.maximum(along - half_chord, 0.0)
        starts = starts + ahead[:, None] * directions
        part, distance, triangle, barycentric = (
            self._trace_scalar if self._scalar else self._trace
        )(starts, directions)
        met = part >= 0
        local = np.full(origins.shape, np.nan)
        corners = self._vertices[self._faces[triangle[met]]]
        weights = np.column_stack([1 - barycentric[met].sum(axis=1), barycentric[met]])
        on_sphere = np.einsum("rc,rci->ri", weights, corners)
        on_sphere /= np.linalg.norm(on_sphere, axis=1, keepdims=True)
        local[met] = on_sphere * self._semi_axes[part[met]]
        return Hits(part, np.where(met, distance + ahead, np.inf), local)

    def _trace(
        self, starts: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> tuple[Any, Any, Any, Any]:
        import drjit as dr

        mi = self._mi
        found = self._scene.ray_intersect_preliminary(
            rays_of(mi, starts, directions), coherent=False
        )
        instance = dr.reinterpret_array(mi.UInt32, found.instance)
        dr.eval(found.t, found.prim_index, found.prim_uv, instance)
        distance = found.t.numpy().astype(np.float64)
        part = np.where(np.isfinite(distance), self._part_of[instance.numpy()], -1)
        # A ray that misses leaves its coordinates unset, and what stands there need not be a number.
        barycentric = np.where(part >= 0, found.prim_uv.numpy(), np.float32(0))
        return (
            part,
            distance,
            found.prim_index.numpy().astype(np.int64),
            barycentric.astype(np.float64).T,
        )

    def _trace_scalar(
        self, starts: NDArray[np.float64], directions: NDArray[np.float64]
    ) -> tuple[Any, Any, Any, Any]:
        mi = self._mi
        rays = len(starts)
        part, triangle = np.full(rays, -1, dtype=np.int64), np.zeros(rays, dtype=np.int64)
        distance, barycentric = np.full(rays, np.inf), np.zeros((rays, 2))
        for ray, (start, direction) in enumerate(zip(starts, directions, strict=True)):
            found = self._scene.ray_intersect_preliminary(
                mi.Ray3f(mi.Point3f(*start), mi.Vector3f(*direction))
            )
            if found.is_valid():
                part[ray] = self._part_of[found.instance.id()]
                distance[ray] = found.t
                triangle[ray] = found.prim_index
                barycentric[ray] = found.prim_uv.x, found.prim_uv.y
        return part, distance, triangle, barycentric
