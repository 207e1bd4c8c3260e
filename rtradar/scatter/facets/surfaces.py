"""Surfaces as flat triangles fixed in the material.

Triangles move and turn with the part they belong to, so that what they add stays coherent from
chirp to chirp. Their vertices are kept in the axes of the part; antennas are brought there, not
triangles to the antennas.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import MAXIMUM_SUBDIVISIONS, unit_sphere
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.scatter.facets import Facets
from rtradar.system.checks import is_whole

MAXIMUM_FACETS = 20 * 4**MAXIMUM_SUBDIVISIONS
"""Facets of one ellipsoid beyond which no icosphere is built."""

LARGEST_KA = 400.0
"""Facets for 0.1 dB are chosen up to here; above, the user names them, or gives a finer mesh."""

FACETS_PER_SQUARE_KA = 6.0
"""Facets of a sphere over (ka)^2 for 0.07 dB of the closed form, which its terminator takes."""

_EDGE = 0.5
"""Angle between the normals of a triangle and a vertex [rad] above which a mesh has an edge."""


def subdivisions_for(facets: int) -> int:
    """Subdivisions of the icosphere with at least that many triangles, 20 to `MAXIMUM_FACETS`."""
    if not is_whole(facets) or not 20 <= facets <= MAXIMUM_FACETS:
        raise InputError(
            f"facets = {facets!r}; it must be a whole number from 20 to {MAXIMUM_FACETS}, "
            "counted per ellipsoid"
        )
    return next(level for level in range(MAXIMUM_SUBDIVISIONS + 1) if 20 * 4**level >= facets)


def body_facets(semi_axes: NDArray[np.float64], frequency: float) -> int:
    """Facets per part that a body takes at this frequency [Hz], for ``semi_axes (part, 3)`` [m].

    The sag of a facet, seen as phase, is about 10 ka / facets; 120 a unit of ka keep it below
    0.1 rad. By the middle semi-axis of the thickest part: 5120 at 12 to 16 GHz, 20 480 at 77 to
    81 GHz for a grown person.
    """
    radius = float(np.median(semi_axes, axis=1).max())
    wanted = 120 * 2 * math.pi * frequency / SPEED_OF_LIGHT_MPS * radius
    return min(MAXIMUM_FACETS, 20 * 4 ** max(3, math.ceil(math.log(wanted / 20, 4))))


def edge_facets(semi_axes: NDArray[np.float64], wavenumber: float) -> int:
    """Facets per part for 3 % of the field where edges of shadows cross parts.

    A facet that an edge cuts has one phase, whatever is left of it. That leaves about 0.8 ka^1.5
    over the facets, measured at 12 and 77 GHz with a sphere that passes before an ellipsoid
    (``validation/other_methods/visible_fractions.py``), by the middle semi-axis of the thickest
    part [m] and a wavenumber [rad/m]: 5120 at 12 to 16 GHz, 81 920 at 77 to 81 GHz for a grown
    person.
    """
    ka = wavenumber * float(np.median(semi_axes, axis=1).max())
    return min(MAXIMUM_FACETS, max(5120, math.ceil(27 * ka**1.5)))


@lru_cache(maxsize=4)
def _unit_facets(subdivisions: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    vertices, faces = unit_sphere(subdivisions)
    return vertices, faces.astype(np.int32)


def ellipsoid_facets(semi_axes: NDArray[np.float64], subdivisions: int) -> Facets:
    """Facets of ellipsoids, ``semi_axes (part, 3)`` [m]: an icosphere each, stretched."""
    sphere, faces = _unit_facets(subdivisions)
    axes = np.asarray(semi_axes, dtype=np.float64)[:, None, :]
    vertices = sphere * axes
    normals, areas = facet_normals(vertices, faces)
    smooth = sphere / axes
    smooth /= np.linalg.norm(smooth, axis=2, keepdims=True)
    # Half the width of a uniform spread with the variance that a linear function has over the
    # triangle, by the mean over directions along the surface: sum u^2 / 12 = h^2 / 3, and half of
    # |n_i - n|^2 lies along any one of them.
    swing = sum(np.sum((smooth[:, faces[:, corner]] - normals) ** 2, axis=2) for corner in range(3))
    return Facets(vertices, faces, normals, areas, np.sqrt(swing / 8))


def mesh_facets(
    vertices: NDArray[np.float64],
    faces: NDArray[np.integer],
    *,
    both_sides: bool,
    bend: NDArray[np.float64] | None = None,
) -> Facets:
    """Facets of a mesh, ``vertices (vertex, 3)`` [m], ``faces (facet, 3)``, without empty ones.

    Their ``bend (facet,)`` is that of `smooth_bend`, or none.
    """
    whole = np.asarray(vertices, dtype=np.float64)[None]
    chosen = np.asarray(faces, dtype=np.int32)
    normals, areas = facet_normals(whole, chosen)
    solid = areas[0] > 0
    swing = np.zeros(int(solid.sum())) if bend is None else bend[solid]
    chosen = np.ascontiguousarray(chosen[solid])
    swing = np.ascontiguousarray(swing[None])
    return Facets(whole, chosen, normals[:, solid], areas[:, solid], swing, both_sides)


def smooth_bend(vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> NDArray[np.float64]:
    """Estimate how far the normal swings over the surface that a flat triangle stands for (facet,).

    See `Facets`. The normal at a vertex is the mean of those around it, weighted by area; where one
    of them is more than half a radian off, the mesh has an edge, which is sharp.
    """
    corners = np.asarray(faces, dtype=np.int32)
    (normals,), (areas,) = facet_normals(vertices[None], corners)
    total = np.zeros_like(vertices)
    np.add.at(total, corners, (normals * areas[:, None])[:, None])
    size = np.linalg.norm(total, axis=1, keepdims=True)
    total /= np.where(size > 0, size, 1.0)
    apart = np.sum((total[corners] - normals[:, None]) ** 2, axis=2)
    farthest = np.zeros(len(vertices))
    np.maximum.at(farthest, corners, apart)
    return np.sqrt(np.where(farthest[corners] < _EDGE**2, apart, 0.0).sum(axis=1) / 8)


def facet_normals(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit normals (part, facet, 3) and areas (part, facet) [m^2] of triangles of parts."""
    a, b, c = (vertices[:, faces[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    twice = np.linalg.norm(normals, axis=2)
    normals /= np.where(twice > 0, twice, 1.0)[..., None]
    return np.ascontiguousarray(normals), np.ascontiguousarray(twice / 2)
