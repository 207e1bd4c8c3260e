"""Ask Mitsuba about rays, on every backend, and count what it was asked.

Mitsuba works in float32. So scenes are centred, each ray starts where it enters the ball around its
scene, and only what is met, and roughly how far away, is used of the answer.
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.trace.backend import grow_for

Array = NDArray[np.float64]

_LANES = 16
"""Numbers of float32 in the widest vectors."""

_LEAST_RAYS = 4096
"""Least number of rays traced at once, filled up with idle ones: else the memory that Dr.Jit keeps
for itself would grow with the largest number that ever came."""

_ONE_AT_A_TIME = threading.Lock()

_counted = 0


def rays_traced() -> int:
    """Return how many rays this process has asked Mitsuba about."""
    return _counted


class Shapes:
    """Shapes in a scene of Mitsuba, ``mi``, which has its variant set and takes them by name."""

    def __init__(self, mi: Any, **shapes: Any) -> None:
        self._mi, self._scene = mi, mi.load_dict({"type": "scene", **shapes})

    @classmethod
    def of_triangles(cls, mi: Any, corners: Array) -> Shapes:
        """Make a scene of triangles (face, 3, 3), of which only the hits of rays are used.

        They should lie near the origin, because they are rounded to float32.
        """
        mesh = mi.Mesh(
            *("triangles", corners.size // 3, len(corners)),
            has_vertex_normals=False,
            has_vertex_texcoords=False,
        )
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = np.ravel(corners).astype(np.float32)
        parameters["faces"] = np.arange(corners.size // 3, dtype=np.uint32)
        parameters.update()
        return cls(mi, triangles=mesh)

    def any_met(self, rays: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Whether rays (7, ray) meet anything: start, unit direction, and length."""
        mi, scene = self._mi, self._scene
        count = _count(rays.shape[1])
        if count == 0:
            return np.zeros(0, dtype=np.bool_)
        # The scalar variant takes one ray at a time.
        if mi.variant().startswith("scalar"):
            found = []
            for x, y, z, *direction, length in rays.T.tolist():
                ray = mi.Ray3f(mi.Point3f(x, y, z), mi.Vector3f(*direction))
                ray.maxt = length
                found.append(bool(scene.ray_test(ray)))
            return np.array(found)
        # The others take all rays at once, in arrays of a least width.
        padded = np.zeros((7, max(count, _LEAST_RAYS)), dtype=np.float32)
        padded[:, :count] = rays
        padded[3, count:] = 1  # idle rays start in the middle and have no length
        with _ONE_AT_A_TIME:
            met = scene.ray_test(rays_of(mi, padded), coherent=True)
            return np.asarray(met.numpy())[:count]

    def first_met(self, starts: Array, directions: Array) -> tuple[NDArray[np.int64], Array]:
        """Number of the triangle that rays (ray, 3) meet first, and how far it is.

        It is -1 and infinite where nothing is met.
        """
        mi, scene, count = self._mi, self._scene, _count(len(starts))
        if count == 0:
            return np.empty(0, dtype=np.int64), np.empty(0)
        if mi.variant().startswith("scalar"):
            number, distance = np.full(count, -1, dtype=np.int64), np.full(count, np.inf)
            for ray, (start, direction) in enumerate(zip(starts, directions, strict=True)):
                found = scene.ray_intersect_preliminary(
                    mi.Ray3f(mi.Point3f(*start), mi.Vector3f(*direction))
                )
                if found.is_valid():
                    number[ray], distance[ray] = int(found.prim_index), found.t
            return number, distance
        import drjit as dr

        grow_for(mi, count)
        rays = rays_of(mi, np.concatenate([starts.T, directions.T]))
        found = scene.ray_intersect_preliminary(rays, coherent=False)
        # Both are computed in one pass.
        dr.eval(found.t, found.prim_index)
        distance = found.t.numpy().astype(np.float64)
        number = found.prim_index.numpy().astype(np.int64)
        return np.where(np.isfinite(distance), number, -1), distance


def ball_around(places: Array, radii: Array | float = 0.0) -> tuple[Array, float]:
    """Centre and radius of a ball that holds balls about ``places (n, 3)``, with 1 % to spare."""
    centre = (places.max(axis=0) + places.min(axis=0)) / 2
    return centre, float((np.linalg.norm(places - centre, axis=1) + radii).max()) * 1.01


def ball_chord(starts: Array, directions: Array, radius: float) -> tuple[Array, Array]:
    """How far along rays (ray, 3) the ball about 0 has its middle, and the square of half a chord.

    The square is negative where a ray passes outside.
    """
    along = -np.einsum("ij,ij->i", starts, directions)
    # The square is taken at the nearest point, not at the start: squares of 1e6 m would swallow it.
    nearest = starts + along[:, None] * directions
    return along, radius**2 - np.einsum("ij,ij->i", nearest, nearest)


def rays_of(mi: Any, rows: ArrayLike) -> Any:
    """Make rays of Mitsuba from rows (6 or 7, ray): starts, directions, and lengths if they end.

    Dr.Jit compiles anew for memory that is not aligned to its vectors, and for rows cut from an
    array of another width. So each row is handed over by itself, from aligned memory.
    """
    values = [mi.Float(row) for row in _aligned(np.asarray(rows))]
    ray = mi.Ray3f(mi.Point3f(*values[:3]), mi.Vector3f(*values[3:6]))
    if len(values) == 7:
        ray.maxt = values[6]
    return ray


def _count(rays: int) -> int:
    global _counted
    with _ONE_AT_A_TIME:
        _counted += rays
    return rays


def _aligned(rows: NDArray[Any]) -> NDArray[np.float32]:
    """The rows (row, column), each beginning at a multiple of `_LANES` numbers in memory."""
    count, columns = rows.shape
    width = -(-columns // _LANES) * _LANES
    memory = np.empty(count * width + _LANES, dtype=np.float32)
    first = -(memory.ctypes.data // memory.itemsize) % _LANES
    aligned = memory[first : first + count * width].reshape(count, width)[:, :columns]
    aligned[:] = rows
    return aligned
