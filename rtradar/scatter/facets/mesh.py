"""Physical optics of any triangle mesh: closed, or open and then a thin sheet lit from both sides.

Triangles of the mesh are flat, and stay so however they are divided: they are divided where spherical waves bend over them
by more than linear phase can follow, and where the edge of a shadow runs through them, as Mitsuba tells at four points of
each, down to a quarter of a wavelength.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.scatter.common.polarization import copolar
from rtradar.scatter.facets.integral import facet_integral
from rtradar.scatter.facets.surfaces import mesh_facets
from rtradar.scene.mesh_files import Triangles
from rtradar.trace.backends.backend import select, use
from rtradar.trace.bounces import MeshSurfaces

LARGEST_KA = 400.0
"""Of a smooth mesh; a larger one must have the facets that an ellipsoid of its surface would need."""

_BENT_PHASE = 0.05
"""Phase that spherical waves may depart from linear over a facet [rad]: 2 % of its field, were all alike."""

_MOST_FACETS = 5_000_000
_DIVISIONS = 7
"""How often a facet on the edge of a shadow is divided at the most."""

_FOUR = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""Middles of the four equal triangles that a triangle divides into, barycentric."""

_HALVES = np.array(
    [
        [[1, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5]],
        [[0.5, 0.5, 0], [0, 1, 0], [0, 0.5, 0.5]],
        [[0.5, 0, 0.5], [0, 0.5, 0.5], [0, 0, 1]],
        [[0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]],
    ]
)
"""Corners of those four, barycentric, turned as the whole."""

_SAME = 1e-4
"""Fraction of the mesh's size within which a hit is the point itself: at shared edges float32 does
not know which face it met."""

Array = NDArray[np.float64]


def mesh_scattering(
    mesh: Triangles,
    tx: Array,
    rx: Array,
    wavenumber: Array,
    polarization: Literal["v", "h"],
    variant: str,
) -> NDArray[np.complex128]:
    """Scattering length (n,) [m] of a mesh for antennas ``tx, rx (n, 3)`` [m] and ``wavenumber (n,)`` [rad/m].

    Raises
    ------
    InputError
        Where the mesh is too coarse, or an antenna so near that it takes too many facets.
    BackendError
        Where no backend of that kind works here.
    """
    _refuse_coarse(mesh, float(wavenumber.max()))
    corners, closed = np.ascontiguousarray(mesh.corners), mesh.closed
    triangles = corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)
    tracer = MeshSurfaces(use(select(variant)), *triangles, same=_SAME)
    middle = corners.mean(axis=(0, 1))
    field = np.empty(len(tx), dtype=np.complex128)
    for pair in range(len(tx)):
        divided, face = _divide_bent(corners, tx[pair], rx[pair], wavenumber[pair])
        divided, shares = _seen(
            tracer, divided, face, np.stack([tx[pair], rx[pair]]), closed, wavenumber[pair]
        )
        facets = mesh_facets(
            divided.reshape(-1, 3),
            np.arange(3 * len(divided)).reshape(-1, 3),
            both_sides=not closed,
        )
        distances = np.linalg.norm(tx[pair]), np.linalg.norm(rx[pair])
        one = facet_integral(
            facets,
            np.zeros(1, dtype=np.int64),
            np.stack([tx[pair], rx[pair]])[None],
            np.array([[0, 1]]),
            shares,
            np.array([[0, 1]]),
            np.array([[distances[0] + distances[1]]]),
            wavenumber[pair : pair + 1, None],
        )
        field[pair] = one[0, 0, 0] * distances[0] * distances[1]
    return field * copolar(tx - middle, rx - middle, polarization)


def _refuse_coarse(triangles: Triangles, wavenumber: float) -> None:
    """A smooth mesh beyond ka = 400 needs 6 (ka)^2 facets on the surface of its sphere, and its share of them."""
    import trimesh  # slow to import

    vertices = triangles.vertices
    spread = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    radius = float(np.linalg.norm(spread, axis=1).max())
    ka = wavenumber * radius
    if ka <= LARGEST_KA:
        return
    mesh = trimesh.Trimesh(vertices, triangles.faces, process=False)
    angles = np.asarray(mesh.face_adjacency_angles)
    # What meets at sharper angles is an edge, at less than a thousandth of a radian one plane.
    if np.count_nonzero((angles > 1e-3) & (angles < 0.5)) <= len(angles) / 2:
        return
    needed = math.ceil(6 * ka**2 * float(mesh.area) / (4 * math.pi * radius**2))
    if len(mesh.faces) < needed:
        raise InputError(
            f"physical optics of a smooth mesh with ka = {ka:.0f}, above {LARGEST_KA:.0f}, needs {needed} facets; "
            f"it has {len(mesh.faces)}: mesh it finer"
        )


def _divide_bent(
    corners: Array, tx: Array, rx: Array, wavenumber: float
) -> tuple[Array, NDArray[np.int64]]:
    """Divide facets until spherical waves are plane over each; corners (n, 3, 3), and the triangle each came from (n,)."""
    face = np.arange(len(corners))
    done: list[tuple[Array, NDArray[np.int64]]] = []
    while len(corners):
        middle = corners.mean(axis=1)
        size = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        # No nearer than the facet's own middle less its size; an antenna on the surface divides only so far.
        bend = np.zeros(len(corners))
        for antenna in (tx, rx):
            distance = np.maximum(np.linalg.norm(middle - antenna, axis=1), size)
            bend += wavenumber * size**2 / (2 * distance)
        coarse = bend > _BENT_PHASE
        done.append((corners[~coarse], face[~coarse]))
        corners, face = _quarter(corners[coarse]), np.repeat(face[coarse], 4)
        if len(corners) + sum(len(kept) for kept, _ in done) > _MOST_FACETS:
            raise InputError(
                f"physical optics of this mesh from so near takes more than {_MOST_FACETS} facets; stand farther away, "
                "lower the frequency, or take 'specular' on ellipsoids"
            )
    return np.concatenate([kept for kept, _ in done]), np.concatenate([of for _, of in done])


def _seen(
    tracer: MeshSurfaces,
    corners: Array,
    face: NDArray[np.int64],
    antennas: Array,
    closed: bool,
    wavenumber: float,
) -> tuple[Array, NDArray[np.float32]]:
    """Divide facets on edges of shadows; their corners (n, 3, 3), and the share that each antenna sees (antenna, n)."""
    done: list[tuple[Array, Array]] = []
    for level in range(_DIVISIONS + 1):
        shares = np.stack(
            [_sampled(tracer, corners, face, antenna, closed) for antenna in antennas]
        )
        edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        mixed = (
            ((shares > 0) & (shares < 1)).any(axis=0)
            & (edge > math.pi / (2 * wavenumber))
            & (level < _DIVISIONS)
        )
        done.append((corners[~mixed], shares[:, ~mixed]))
        corners, face = _quarter(corners[mixed]), np.repeat(face[mixed], 4)
        if not len(corners):
            break
    return np.concatenate([kept for kept, _ in done]), np.concatenate(
        [of for _, of in done], axis=1
    ).astype(np.float32)


def _sampled(
    tracer: MeshSurfaces, corners: Array, face: NDArray[np.int64], antenna: Array, closed: bool
) -> Array:
    """Share of four points of each facet that the antenna sees; those that face away from it are not asked about."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.flatnonzero((np.sum(normal * (antenna - corners[:, 0]), axis=1) > 0) | (not closed))
    points = _FOUR @ corners[facing]
    share = np.zeros(len(corners))
    points = points.reshape(-1, 3)
    from_there = np.broadcast_to(antenna, points.shape)
    seen = tracer.sees(from_there, points, np.repeat(face[facing], 4))
    share[facing] = seen.reshape(-1, 4).mean(axis=1)
    return share


def _quarter(corners: Array) -> Array:
    return (_HALVES @ corners[:, None]).reshape(-1, 3, 3)
