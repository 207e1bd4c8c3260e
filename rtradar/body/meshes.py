"""Closed triangle meshes of ellipsoids."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import Ellipsoids
from rtradar.errors import InputError

MAXIMUM_SUBDIVISIONS = 8
"""20 x 4^8 is 1.3 million triangles a part: more is a mistake."""


@lru_cache(maxsize=4)
def unit_sphere(subdivisions: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Make an icosphere of 20 x 4^subdivisions triangles, closed, with the mean radius 1.

    Its vertices lie a little outside the unit sphere, so that the mean of ``|x|^2`` over its
    surface is 1.

    Parameters
    ----------
    subdivisions : int
        0 to `MAXIMUM_SUBDIVISIONS`.

    Returns
    -------
    vertices : (vertex, 3) float64
        Read-only, for they are kept.
    faces : (face, 3) int64
        Anticlockwise seen from outside; read-only.

    Raises
    ------
    InputError
        Where ``subdivisions`` is out of range.
    """
    if not 0 <= subdivisions <= MAXIMUM_SUBDIVISIONS:
        raise InputError(
            f"unit_sphere: subdivisions = {subdivisions}; allowed are 0 to {MAXIMUM_SUBDIVISIONS}"
        )
    import trimesh  # slow to import

    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=1.0)
    vertices, faces = (
        np.array(sphere.vertices, dtype=np.float64),
        np.array(sphere.faces, dtype=np.int64),
    )
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    # Mean of |x|^2 over a triangle: (|a|^2 + |b|^2 + |c|^2 + |a + b + c|^2) / 12.
    means = (np.sum(a * a + b * b + c * c, axis=1) + np.sum((a + b + c) ** 2, axis=1)) / 12
    vertices /= np.sqrt(np.sum(areas * means) / np.sum(areas))
    vertices.setflags(write=False)
    faces.setflags(write=False)
    return vertices, faces


def ellipsoid_meshes(
    ellipsoids: Ellipsoids, subdivisions: int = 3
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """One closed mesh a part, all with the same faces.

    Parameters
    ----------
    ellipsoids : Ellipsoids
        One pose.
    subdivisions : int
        Subdivisions of the icosphere that each part is made from.

    Returns
    -------
    vertices : (part, vertex, 3) float64
        Positions of the vertices, world [m].
    faces : (face, 3) int64
        Anticlockwise seen from outside, the same for every part.
    """
    sphere, faces = unit_sphere(subdivisions)
    local = sphere * ellipsoids.semi_axes[:, None, :]
    return ellipsoids.centres[:, None, :] + local @ np.swapaxes(ellipsoids.frames, 1, 2), faces
