"""A unit sphere of triangles, and which rays meet it: any ellipsoid is one in axes of its own, so there is nothing to pose."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body.meshes import unit_sphere

SUBDIVISIONS = 4
"""5120 triangles: middles up to 0.03 % inside the unit sphere, corners 0.07 % outside it."""

_LEAST_RAYS = 4096
"""Traced at once, with idle ones among them: what Dr.Jit keeps for itself would else grow with the most that ever came."""

_LANES = 16
"""Of float32 in the widest vectors. Dr.Jit compiles one kernel for rows that begin where a vector may, another for others."""


class UnitSphere:
    """The triangles of every part, in a Mitsuba scene.

    Parameters
    ----------
    mi : module
        Mitsuba with its variant set.
    """

    def __init__(self, mi: Any) -> None:
        self._mi = mi
        vertices, faces = unit_sphere(SUBDIVISIONS)
        mesh = mi.Mesh("unit_sphere", len(vertices), len(faces), has_vertex_normals=False, has_vertex_texcoords=False)
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = np.ravel(vertices).astype(np.float32)
        parameters["faces"] = np.ravel(faces).astype(np.uint32)
        parameters.update()
        self._scene = mi.load_dict({"type": "scene", "unit_sphere": mesh})

    def meets(self, rays: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Which rays (7, ray) meet it: start and direction in its axes, and how far they go."""
        mi = self._mi
        if rays.shape[1] == 0:  # Dr.Jit takes the process down over arrays without entries
            return np.zeros(0, dtype=np.bool_)
        if mi.variant().startswith("scalar"):
            found = []
            for x, y, z, *way, reach in rays.T.tolist():
                ray = mi.Ray3f(mi.Point3f(x, y, z), mi.Vector3f(*way))
                ray.maxt = reach
                found.append(bool(self._scene.ray_test(ray)))
            return np.array(found)
        count = rays.shape[1]
        padded = _aligned_zeros(7, max(math.ceil(count / _LANES) * _LANES, _LEAST_RAYS))
        padded[:, :count] = rays
        padded[3, count:] = 1  # from the middle, no way at all
        ray = mi.Ray3f(mi.Point3f(padded[:3]), mi.Vector3f(padded[3:6]))
        ray.maxt = mi.Float(padded[6])
        return np.asarray(self._scene.ray_test(ray, coherent=True).numpy())[:count]


def _aligned_zeros(rows: int, columns: int) -> NDArray[np.float32]:
    """Zeros (row, column), each row beginning at a multiple of `_LANES` numbers in memory if the columns are such a multiple."""
    memory = np.zeros(rows * columns + _LANES, dtype=np.float32)
    first = -(memory.ctypes.data // memory.itemsize) % _LANES
    return memory[first : first + rows * columns].reshape(rows, columns)
