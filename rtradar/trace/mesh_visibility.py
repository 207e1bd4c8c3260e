"""Ask Mitsuba which points of any triangle mesh an antenna sees."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.scene.mitsuba_scene import triangle_mesh
from rtradar.trace.rays import rays_of

_NEAR = 1e-4
"""A hit nearer to the point than this share of the mesh's size is the point: float32 knows no better at shared edges."""


class MeshTracer:
    """One mesh in a Mitsuba scene, centred there, for float32 decides who sees whom.

    Parameters
    ----------
    mi : module
        Mitsuba with its variant set.
    vertices, faces : (vertex, 3) float64, (face, 3) int
        World [m].
    """

    def __init__(self, mi: Any, vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> None:
        self._mi = mi
        self._centre = (vertices.max(axis=0) + vertices.min(axis=0)) / 2
        self._ball = float(np.linalg.norm(vertices - self._centre, axis=1).max()) * 1.01
        self._scene = mi.load_dict(
            {"type": "scene", "target": triangle_mesh(mi, vertices - self._centre, faces)}
        )

    def sees(
        self, antenna: NDArray[np.float64], points: NDArray[np.float64], faces: NDArray[np.integer]
    ) -> NDArray[np.bool_]:
        """Whether an antenna (3,) sees points (n, 3) on these faces (n,) of the mesh; world [m]."""
        if len(points) == 0:
            # Dr.Jit takes the process down over arrays without entries.
            return np.zeros(0, dtype=bool)
        ways = points - antenna
        reach = np.linalg.norm(ways, axis=1)
        ways = ways / reach[:, None]
        start = antenna - self._centre
        along = -ways @ start
        ahead = np.maximum(
            along - np.sqrt(np.maximum(self._ball**2 - start @ start + along**2, 0.0)), 0.0
        )
        distance, face = self._first_faces(start + ahead[:, None] * ways, ways)
        return np.asarray((face == faces) | (distance >= reach - ahead - _NEAR * self._ball))

    def _first_faces(
        self, starts: NDArray[np.float64], ways: NDArray[np.float64]
    ) -> tuple[Any, Any]:
        mi = self._mi
        if mi.variant().startswith("scalar"):
            found = [
                self._scene.ray_intersect_preliminary(
                    mi.Ray3f(mi.Point3f(*start), mi.Vector3f(*way))
                )
                for start, way in zip(starts, ways, strict=True)
            ]
            distance = np.array([float(hit.t) if hit.is_valid() else np.inf for hit in found])
            return distance, np.array(
                [int(hit.prim_index) if hit.is_valid() else -1 for hit in found]
            )
        import drjit as dr

        found = self._scene.ray_intersect_preliminary(rays_of(mi, starts, ways), coherent=True)
        dr.eval(found.t, found.prim_index)
        distance = found.t.numpy().astype(np.float64)
        return distance, np.where(
            np.isfinite(distance), found.prim_index.numpy().astype(np.int64), -1
        )
