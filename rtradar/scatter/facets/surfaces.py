"""Surfaces as flat triangles fixed in the material: of ellipsoids, and of any mesh.

Triangles move and turn with the part they belong to, so that what they add stays coherent from chirp to chirp. Their
vertices are kept in the axes of the part; antennas are brought there, not triangles to the antennas.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rtradar.body.meshes import MAXIMUM_SUBDIVISIONS, unit_sphere
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError

MAXIMUM_FACETS = 20 * 4**MAXIMUM_SUBDIVISIONS
"""Facets of one ellipsoid beyond which no icosphere is built."""


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles of one or more parts, all with the same faces; each part in its own axes.

    Parameters
    ----------
    vertices : (part, vertex, 3) float64
        [m].
    faces : (facet, 3) int32
        Anticlockwise seen from outside.
    normals : (part, facet, 3) float64
        Unit normals, outward.
    areas : (part, facet) float64
        [m^2].
    bend : (part, facet) float64
        How far n.s swings to either side of its mean over the curved surface that the facet stands for; 0 where it is
        flat. The terminator is softened over it.
    both_sides : bool
        A thin sheet, lit from either side.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    normals: NDArray[np.float64]
    areas: NDArray[np.float64]
    bend: NDArray[np.float64]
    both_sides: bool = False


def subdivisions_for(facets: int) -> int:
    """Subdivisions of the icosphere with at least that many triangles.

    Raises
    ------
    InputError
        Where ``facets`` is not a whole number from 20 to `MAXIMUM_FACETS`.
    """
    whole = isinstance(facets, int | np.integer) and not isinstance(facets, bool)
    if not whole or not 20 <= facets <= MAXIMUM_FACETS:
        raise InputError(
            f"facets = {facets!r}; it must be a whole number from 20 to {MAXIMUM_FACETS}, counted per ellipsoid"
        )
    return next(level for level in range(MAXIMUM_SUBDIVISIONS + 1) if 20 * 4**level >= facets)


def body_facets(semi_axes: NDArray[np.float64], frequency: float) -> int:
    """Facets per part that a body takes at this frequency [Hz], for ``semi_axes (part, 3)`` [m].

    The sag of a facet, seen as phase, is about 10 ka / facets; 120 a unit of ka keep it below 0.1 rad. By the middle
    semi-axis of the thickest part: 5120 at 12 to 16 GHz, 20 480 at 77 to 81 GHz for a grown person.
    """
    radius = float(np.median(semi_axes, axis=1).max())
    wanted = 120 * 2 * math.pi * frequency / SPEED_OF_LIGHT_MPS * radius
    return min(MAXIMUM_FACETS, 20 * 4 ** max(3, math.ceil(math.log(wanted / 20, 4))))


@lru_cache(maxsize=4)
def _unit_facets(subdivisions: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    vertices, faces = unit_sphere(subdivisions)
    return vertices, faces.astype(np.int32)


def ellipsoid_facets(semi_axes: NDArray[np.float64], subdivisions: int) -> Facets:
    """Facets of ellipsoids, ``semi_axes (part, 3)`` [m]: an icosphere each, stretched."""
    sphere, faces = _unit_facets(subdivisions)
    axes = np.asarray(semi_axes, dtype=np.float64)[:, None, :]
    vertices = sphere * axes
    normals, areas = _normals(vertices, faces)
    smooth = sphere / axes
    smooth /= np.linalg.norm(smooth, axis=2, keepdims=True)
    # Half the width of a uniform spread with the variance that a linear function has over the triangle, by the mean over
    # directions along the surface: sum u^2 / 12 = h^2 / 3, and half of |n_i - n|^2 lies along any one of them.
    swing = sum(np.sum((smooth[:, faces[:, corner]] - normals) ** 2, axis=2) for corner in range(3))
    return Facets(vertices, faces, normals, areas, np.sqrt(swing / 8))


def mesh_facets(
    vertices: NDArray[np.float64], faces: NDArray[np.integer], *, both_sides: bool
) -> Facets:
    """Facets of one mesh, ``vertices (vertex, 3)`` [m], ``faces (facet, 3)``; those without area are left out."""
    whole = np.asarray(vertices, dtype=np.float64)[None]
    chosen = np.asarray(faces, dtype=np.int32)
    normals, areas = _normals(whole, chosen)
    solid = areas[0] > 0
    return Facets(
        whole,
        np.ascontiguousarray(chosen[solid]),
        normals[:, solid],
        areas[:, solid],
        np.zeros((1, int(solid.sum()))),
        both_sides,
    )


def _normals(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    a, b, c = (vertices[:, faces[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    twice = np.linalg.norm(normals, axis=2)
    normals /= np.where(twice > 0, twice, 1.0)[..., None]
    return np.ascontiguousarray(normals), np.ascontiguousarray(twice / 2)
