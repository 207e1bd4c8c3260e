"""Physical optics of one target over facets: of ellipsoids, and of any triangle mesh.

A mesh is closed, or open and then a thin sheet lit from both sides. Its triangles are flat, and
stay so however they are divided: they are divided where spherical waves bend over them by more than
linear phase can follow, and where the edge of a shadow runs through them, as Mitsuba finds at four
points of each, down to a quarter of a wavelength.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.scatter.facets import Facets, Views, Waves
from rtradar.scatter.common.polarization import copolar
from rtradar.scatter.facets.body import FacetShadows
from rtradar.scatter.facets.surfaces import (
    MAXIMUM_FACETS,
    ellipsoid_facets,
    facet_integral,
    mesh_facets,
    subdivisions_for,
)
from rtradar.scatter.ray_tubes.tubes import in_four
from rtradar.scatter.target import target_mesh
from rtradar.scene.mesh_files import Triangles
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer
from rtradar.trace.bounces import MeshSurfaces

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

LARGEST_KA = 400.0
"""Facets for 0.1 dB are chosen up to here; above, the user names them, or gives a finer mesh."""

_FACETS_PER_SQUARE_KA = 6.0
"""Facets of a sphere over (ka)^2 for 0.07 dB of the closed form, which its terminator takes."""

_VIEWS_AT_ONCE = 2**27
"""Size of the visibility that is held at a time [bytes]."""

_BENT_PHASE = 0.05
"""Phase that waves may depart from linear over a facet [rad]: at most 2 % of its field."""

_MOST_FACETS = 5_000_000
_DIVISIONS = 7
"""Most divisions of a facet on the edge of a shadow."""

_SAME = 1e-4
"""Fraction of the mesh's size within which a hit is the point itself: at shared edges float32 does
not know which face it met."""

_FOUR = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""Middles of the four equal triangles that a triangle divides into, barycentric."""


def facet_scattering(
    target: Ellipsoids | trimesh.Trimesh,
    tx: Array,
    rx: Array,
    frequency: Array,
    polarization: Literal["v", "h"] = "v",
    variant: str = "auto",
    facets: int | None = None,
) -> NDArray[np.complex128]:
    """Co-polar scattering length (n,) by physical optics over the facets that both antennas see.

    Parameters, returns and errors are those of `scattering_length`; ``facets`` is the least number
    per ellipsoid, None for 0.1 dB up to ka = 400. Equations :eq:`po` and :eq:`facet` of the theory
    page.
    """
    wavenumber = 2 * np.pi * np.asarray(frequency, dtype=np.float64) / SPEED_OF_LIGHT_MPS
    solid = target if isinstance(target, Ellipsoids) else target_mesh(target, tx, rx)
    if not isinstance(solid, Ellipsoids) and facets is not None:
        raise InputError(
            "facets: a mesh brings its own triangles; leave facets out, or subdivide the mesh"
        )
    if len(tx) == 0:
        return np.zeros(0, dtype=np.complex128)
    if not isinstance(solid, Ellipsoids):
        return _mesh(solid, tx, rx, wavenumber, polarization, variant)
    backend = select(variant)
    surface = ellipsoid_facets(
        solid.semi_axes, subdivisions_for(_enough_facets(solid, float(wavenumber.max()), facets))
    )
    shadows = FacetShadows(BodyTracer(use(backend), solid.semi_axes), surface, solid.semi_axes)
    field = np.empty(len(tx), dtype=np.complex128)
    block = max(1, _VIEWS_AT_ONCE // (8 * len(solid.centres) * len(surface.faces)))
    for first in range(0, len(tx), block):
        some = slice(first, first + block)
        pairs = tx[some], rx[some], wavenumber[some]
        field[some] = _ellipsoids(solid, surface, shadows, *pairs, polarization)
    return field


def _enough_facets(target: Ellipsoids, wavenumber: float, facets: int | None) -> int:
    """Facets per part: those asked for, or as many as the thickest part takes."""
    ka = wavenumber * float(np.median(target.semi_axes, axis=1).max())
    needed = max(5120, math.ceil(_FACETS_PER_SQUARE_KA * ka**2))
    if facets is not None:
        subdivisions_for(facets)
    if ka > LARGEST_KA and (facets is None or facets < needed):
        cure = (
            f"set facets={needed}"
            if needed <= MAXIMUM_FACETS
            else f"more than {MAXIMUM_FACETS} are not made: take 'specular'"
        )
        raise InputError(
            f"physical optics of a part with ka = {ka:.0f}, above {LARGEST_KA:.0f}, needs {needed} "
            f"facets an ellipsoid; {cure}"
        )
    return min(needed, MAXIMUM_FACETS) if facets is None else facets


def _ellipsoids(
    target: Ellipsoids,
    surface: Facets,
    shadows: FacetShadows,
    tx: Array,
    rx: Array,
    wavenumber: Array,
    polarization: Literal["v", "h"],
) -> NDArray[np.complex128]:
    n, parts = len(tx), np.arange(len(target.centres))
    antennas, view = np.unique(np.concatenate([tx, rx]), axis=0, return_inverse=True)
    seen = shadows.seen(target.centres, target.frames, antennas, parts)
    to_antennas = np.stack([tx, rx], axis=1)[:, None] - target.centres[:, None]
    local = np.einsum("pji,npaj->npai", target.frames, to_antennas)
    row = np.moveaxis(seen.row[view.reshape(2, n)], (0, 1, 2), (2, 0, 1))
    ranges = np.linalg.norm(tx, axis=1), np.linalg.norm(rx, axis=1)
    carrier, k = (np.repeat(a, len(parts))[:, None] for a in (ranges[0] + ranges[1], wavenumber))
    views = Views(np.tile(parts, n), local.reshape(-1, 2, 3), row.reshape(-1, 2), seen.fraction)
    field = facet_integral(surface, views, Waves(np.array([[0, 1]]), carrier, k, spreading=True))
    factor = copolar(to_antennas[:, :, 0], to_antennas[:, :, 1], polarization)
    return np.asarray((field.reshape(n, len(parts)) * factor).sum(axis=1) * ranges[0] * ranges[1])


# -- meshes ----------------------------------------------------------------------------------------


def _mesh(
    mesh: Triangles,
    tx: Array,
    rx: Array,
    wavenumber: Array,
    polarization: Literal["v", "h"],
    variant: str,
) -> NDArray[np.complex128]:
    _refuse_coarse(mesh, float(wavenumber.max()))
    corners, closed = np.ascontiguousarray(mesh.corners), mesh.closed
    triangles = corners.reshape(-1, 3), _own_faces(len(corners))
    tracer = MeshSurfaces(use(select(variant)), *triangles, same=_SAME)
    middle, one_pair = corners.mean(axis=(0, 1)), np.array([[0, 1]])
    field = np.empty(len(tx), dtype=np.complex128)
    for pair, k in enumerate(wavenumber):
        antennas = np.stack([tx[pair], rx[pair]])
        divided, face = _divide_bent(corners, antennas, k)
        divided, seen = _divide_edges(tracer, divided, face, antennas, closed, k)
        facets = mesh_facets(
            divided.reshape(-1, 3), _own_faces(len(divided)), both_sides=not closed
        )
        ranges = np.linalg.norm(antennas, axis=1)
        views = Views(np.zeros(1, dtype=np.int64), antennas[None], one_pair, seen)
        waves = Waves(one_pair, np.array([[ranges.sum()]]), np.array([[k]]), spreading=True)
        field[pair] = facet_integral(facets, views, waves)[0, 0, 0] * ranges.prod()
    return field * copolar(tx - middle, rx - middle, polarization)


def _own_faces(count: int) -> NDArray[np.int64]:
    """Faces (count, 3) whose corners are theirs alone."""
    return np.arange(3 * count).reshape(-1, 3)


def _refuse_coarse(triangles: Triangles, wavenumber: float) -> None:
    """A smooth mesh beyond ka = 400 needs its part of the 6 (ka)^2 facets of its sphere."""
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
    sphere = 4 * math.pi * radius**2
    needed = math.ceil(_FACETS_PER_SQUARE_KA * ka**2 * float(mesh.area) / sphere)
    if len(mesh.faces) < needed:
        raise InputError(
            f"physical optics of a smooth mesh with ka = {ka:.0f}, above {LARGEST_KA:.0f}, needs "
            f"{needed} facets; it has {len(mesh.faces)}: mesh it finer"
        )


def _divide(
    corners: Array,
    face: NDArray[np.int64],
    coarse: Callable[[Array, NDArray[np.int64], int], tuple[NDArray[np.bool_], Array]],
    most: float = math.inf,
) -> tuple[Array, NDArray[np.int64], Array]:
    """Divide triangles (n, 3, 3), of the faces (n,), in four until none is too coarse.

    ``coarse(corners, face, level)`` returns which are, (n,), and a value of each, (n, ...); the
    values of those that stay are returned.
    """
    done: list[tuple[Array, NDArray[np.int64], Array]] = []
    level = count = 0
    while len(corners):
        split, value = coarse(corners, face, level)
        done.append((corners[~split], face[~split], value[~split]))
        count += len(done[-1][0])
        corners, face, level = in_four(corners[split]), np.repeat(face[split], 4), level + 1
        if count + len(corners) > most:
            raise InputError(
                f"physical optics of this mesh from so near takes more than {_MOST_FACETS} facets; "
                "stand farther away, lower the frequency, or take 'specular' on ellipsoids"
            )
    corners, face, value = (np.concatenate(arrays) for arrays in zip(*done, strict=True))
    return corners, face, value


def _divide_bent(
    corners: Array, antennas: Array, wavenumber: float
) -> tuple[Array, NDArray[np.int64]]:
    """Divide facets until waves are plane over each; corners (n, 3, 3), and the triangles (n,)."""

    def coarse(corners: Array, _: NDArray[np.int64], __: int) -> tuple[NDArray[np.bool_], Array]:
        middle = corners.mean(axis=1)
        size = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        # No nearer than the facet's own middle less its size; an antenna on the surface divides
        # only so far.
        distances = (np.maximum(np.linalg.norm(middle - a, axis=1), size) for a in antennas)
        bend = sum(wavenumber * size**2 / (2 * distance) for distance in distances)
        return bend > _BENT_PHASE, size

    return _divide(corners, np.arange(len(corners)), coarse, _MOST_FACETS)[:2]


def _divide_edges(
    tracer: MeshSurfaces,
    corners: Array,
    face: NDArray[np.int64],
    antennas: Array,
    closed: bool,
    wavenumber: float,
) -> tuple[Array, NDArray[np.float32]]:
    """Divide facets on edges of shadows; corners (n, 3, 3), and fractions seen (antenna, n)."""

    def coarse(
        corners: Array, face: NDArray[np.int64], level: int
    ) -> tuple[NDArray[np.bool_], Array]:
        seen = np.stack([_sampled(tracer, corners, face, a, closed) for a in antennas], axis=1)
        edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        mixed = ((seen > 0) & (seen < 1)).any(axis=1) & (edge > math.pi / (2 * wavenumber))
        return mixed & (level < _DIVISIONS), seen

    corners, _, seen = _divide(corners, face, coarse)
    return corners, np.ascontiguousarray(seen.T, dtype=np.float32)


def _sampled(
    tracer: MeshSurfaces, corners: Array, face: NDArray[np.int64], antenna: Array, closed: bool
) -> Array:
    """Fraction of four points of each facet that the antenna sees, 0 for those that face away."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    facing = np.flatnonzero((np.sum(normal * (antenna - corners[:, 0]), axis=1) > 0) | (not closed))
    points = (_FOUR @ corners[facing]).reshape(-1, 3)
    seen = np.zeros(len(corners))
    from_there = np.broadcast_to(antenna, points.shape)
    visible = tracer.sees(from_there, points, np.repeat(face[facing], 4))
    seen[facing] = visible.reshape(-1, 4).mean(axis=1)
    return seen
