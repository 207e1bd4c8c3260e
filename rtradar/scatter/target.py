"""Targets: ellipsoids, sums of their echoes, checked meshes, and facets at which rays are aimed.

A mesh of one's own is a `trimesh.Trimesh` in metres, given as the target of `scattering_length`; in
a room it is furniture (`rtradar.scene.objects`).

Facets are small and fixed in the material. A facet seen from a Tx is a tube: rays go to its corners
and its middle. As the facets move with the body, each tube keeps its place in the material, and the
sum over tubes changes as smoothly from chirp to chirp as the body moves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.scene.mesh_files import Triangles, checked_triangles

Array = NDArray[np.float64]

_ON_SURFACE = 1e-9
"""Fraction of a mesh's size: an antenna no farther from the surface is on it."""


def target_geometry(
    target: Ellipsoids, tx: NDArray[np.float64], rx: NDArray[np.float64]
) -> Geometry:
    """Ellipsoids with antennas (n, 3), pair by pair, as one chirp with one receiver each."""
    centres, frames = (
        np.broadcast_to(array, (len(tx), *array.shape)) for array in (target.centres, target.frames)
    )
    return Geometry(tx, rx[:, None], centres, frames, target.semi_axes)


def sum_of_echoes(
    length: NDArray[np.float64],
    amplitude: NDArray[np.generic],
    at: Geometry,
    frequency: NDArray[np.float64],
) -> NDArray[np.complex128]:
    """Field of each pair of echoes (pair, 1, part), relative to the path over the origin."""
    # The phase of the path over the origin is taken out, and the spreading that amplitudes have.
    range_tx, range_rx = np.linalg.norm(at.tx, axis=1), np.linalg.norm(at.rx[:, 0], axis=1)
    excess = length[:, 0] - (range_tx + range_rx)[:, None]
    phase = np.exp(-2j * np.pi * frequency[:, None] / SPEED_OF_LIGHT_MPS * excess)
    return np.asarray((amplitude[:, 0] * phase).sum(axis=1) * range_tx * range_rx)


def target_mesh(target: object, tx: NDArray[np.float64], rx: NDArray[np.float64]) -> Triangles:
    """Triangles of a target that is a mesh, with antennas (n, 3) in its coordinates [m].

    An `InputError` is raised if the target is no mesh or cannot be used, or an antenna is inside of
    it or on its surface.
    """
    import trimesh  # slow to import

    if not isinstance(target, trimesh.Trimesh):
        raise InputError(
            f"scattering_length: the target is a {type(target).__name__}; "
            "allowed: rt.Ellipsoids or trimesh.Trimesh"
        )
    vertices = np.asarray(target.vertices, dtype=np.float64)
    mesh = checked_triangles(
        "scattering_length: the mesh", vertices, np.asarray(target.faces, dtype=np.int64)
    )
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    nearest = _ON_SURFACE * float((high - low).max())
    for name, antennas in (("tx", tx), ("rx", rx)):
        # Only antennas in its box are worth a look at every triangle.
        for index in np.flatnonzero(
            ((antennas >= low - nearest) & (antennas <= high + nearest)).all(axis=1)
        ):
            if mesh.distance_m(antennas[index]) <= nearest:
                where = "inside the mesh or on it" if mesh.closed else "on the mesh"
                raise InputError(
                    f"scattering_length: {name}[{index}] is {where}; antennas must stand outside "
                    "the target"
                )
    return mesh


# -- facets for rays -------------------------------------------------------------------------------


_THOMSEN = 1.6075

MOST_TUBES = 4_000_000
"""Some 1.5 GB; a body at 77 GHz with 3 rays per wavelength has 2.4 million."""


class Tubes(NamedTuple):
    """Facets at which rays are aimed.

    ``places`` and ``normals (tube, 4, 3)`` are three corners and the centroid of each facet [m],
    and the unit normals of the smooth surface there; ``surface (tube,)`` is the part or face.
    """

    places: Array
    normals: Array
    surface: NDArray[np.int64]


@dataclass(frozen=True)
class EllipsoidGrid:
    """Facets of the parts of a body, in the axes in which each part is a unit sphere.

    ``corners (tube, 3, 3)`` are on a sphere a little larger than 1, so that the mean of |x|^2 over
    the facets is 1; ``part (tube,)`` is the part of each. In one ``pose`` the body is `Ellipsoids`.
    """

    corners: Array
    part: NDArray[np.int64]
    pose: Ellipsoids | None = None

    @classmethod
    def cover(cls, semi_axes: Array, edge: float) -> EllipsoidGrid:
        """Cover each part with as many facets as equilateral triangles of that edge [m] would need.

        They are stretched with the part and long where it bends little. That costs no accuracy,
        because the phase over each is integrated exactly as far as it is linear. An `InputError` is
        raised if they would be more than `MOST_TUBES`.
        """
        # An icosahedron whose faces are cut n-fold has 20 n^2 facets.
        divisions = np.maximum(2, np.ceil(_sides(ellipsoid_areas(semi_axes) / 20, edge)))
        _refuse_many(20 * divisions**2)
        grids = [_sphere(int(n)) for n in divisions]
        return cls(
            np.concatenate(grids), np.repeat(np.arange(len(grids)), [len(grid) for grid in grids])
        )

    def split(self, which: NDArray[np.int64]) -> EllipsoidGrid:
        """Cut some of the facets into four; their corners move in as finer facets require."""
        quarters = in_four(self.corners[which])
        # How far corners stand out of the sphere goes with the square of the edge: with half the
        # edge it is a quarter.
        out = np.linalg.norm(self.corners[which, 0], axis=-1) - 1
        size = np.linalg.norm(quarters, axis=-1, keepdims=True)
        quarters *= (1 + np.repeat(out, 4)[:, None, None] / 4) / size
        return EllipsoidGrid(quarters, np.repeat(self.part[which], 4), self.pose)

    @cached_property
    def tubes(self) -> Tubes:
        """The facets in the world, in their pose."""
        assert self.pose is not None
        u, part = _with_middle(self.corners), self.part
        place, normal = np.empty_like(u), np.empty_like(u)
        # The parts follow one another, so each has a slice of the facets.
        each = zip(self.pose.centres, self.pose.frames, self.pose.semi_axes, strict=True)
        for index, (centre, frame, axes) in enumerate(each):
            # Stretching the unit sphere by the semi-axes stretches its normals by their inverses.
            own = slice(*np.searchsorted(part, [index, index + 1]))
            place[own] = centre + (u[own] * axes) @ frame.T
            normal[own] = (u[own] / axes) @ frame.T
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        return Tubes(place, normal, part)


@dataclass(frozen=True)
class MeshGrid:
    """Facets of the faces of a mesh: ``corners (tube, 3, 3)`` [m], and the face of each."""

    corners: Array
    face: NDArray[np.int64]

    @staticmethod
    def divisions(triangles: Array, edge: float, *, by_area: bool = False) -> NDArray[np.int64]:
        """Return how often to cut triangles (face, 3, 3) until no side is longer than ``edge`` [m].

        With ``by_area`` facets get the area that those of `EllipsoidGrid` have: no triangle of a
        skin is so long and thin that its sides would have to be cut. An `InputError` is raised if
        the facets would be more than `MOST_TUBES`.
        """
        if by_area:
            wanted = np.round(_sides(np.linalg.norm(_across(triangles), axis=1) / 2, edge))
        else:
            wanted = np.ceil(_longest(triangles) / edge * (1 - 1e-12))
        divisions = np.maximum(1, wanted)
        _refuse_many(divisions**2)
        return divisions.astype(np.int64)

    @classmethod
    def cut(cls, triangles: Array, divisions: NDArray[np.int64]) -> MeshGrid:
        """Cut triangles (face, 3, 3) evenly, each so often; those without area are left out."""
        flat = np.linalg.norm(_across(triangles), axis=1) <= 1e-12 * _longest(triangles) ** 2
        corners, face = [np.empty((0, 3, 3))], [np.empty(0, dtype=np.int64)]
        # All triangles that are cut alike at once.
        for n in np.unique(divisions[~flat]).tolist():
            own = np.flatnonzero((divisions == n) & ~flat)
            corners.append(np.einsum("fkc,tci->tfki", _cut(n), triangles[own]).reshape(-1, 3, 3))
            face.append(np.repeat(own, n * n))
        return cls(np.concatenate(corners), np.concatenate(face))

    @cached_property
    def tubes(self) -> Tubes:
        """The facets with flat normals, from whose side their corners run anticlockwise."""
        normal = _across(self.corners)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        places = _with_middle(self.corners)
        return Tubes(places, np.broadcast_to(normal[:, None], places.shape), self.face)

    def split(self, which: NDArray[np.int64]) -> MeshGrid:
        """Cut some of the facets into four."""
        return MeshGrid(in_four(self.corners[which]), np.repeat(self.face[which], 4))


Grid = EllipsoidGrid | MeshGrid
"""Facets, fixed in the material, that can be split."""


def _with_middle(corners: Array) -> Array:
    return np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)


def _longest(triangles: Array) -> Array:
    """Longest side of each triangle (face,) [m]."""
    sides = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=-1)
    return np.asarray(sides.max(axis=1))


def _sides(areas: Array, edge: float) -> Array:
    """How many edges long the sides of equilateral triangles of these areas [m^2] are."""
    return np.sqrt(areas / (np.sqrt(3) / 4)) / edge


def _across(triangles: Array) -> Array:
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _refuse_many(counts: Array) -> None:
    if counts.sum() > MOST_TUBES:
        raise InputError(
            f"rays: {counts.sum():.3g} tubes are more than {MOST_TUBES}; "
            "lower rays_per_wavelength or the frequency"
        )


def ellipsoid_areas(semi_axes: Array) -> Array:
    """Surface (part,) of ellipsoids (part, 3) by K. Thomsen's formula, 1 % off at most [m^2]."""
    a, b, c = np.asarray(semi_axes).T ** _THOMSEN
    return np.asarray(4 * np.pi * ((a * b + a * c + b * c) / 3) ** (1 / _THOMSEN))


@lru_cache(maxsize=64)
def _cut(n: int) -> Array:
    """Barycentric weights (n^2, 3 corners, 3) of a triangle cut into n^2 similar ones."""
    # Places on a grid along two sides: upright triangles at each, and between them those upside
    # down.
    i, j = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    up, down = i + j < n, i + j < n - 1

    def at(i: NDArray[np.int64], j: NDArray[np.int64]) -> Array:
        return np.stack([n - i - j, i, j], axis=-1) / n

    upright = np.stack([at(i[up], j[up]), at(i[up] + 1, j[up]), at(i[up], j[up] + 1)], axis=1)
    i, j = i[down], j[down]
    turned = np.stack([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)], axis=1)
    return np.concatenate([upright, turned])


@lru_cache(maxsize=64)
def _sphere(n: int) -> Array:
    """Corners (20 n^2, 3, 3) of an icosahedron cut n-fold, on a sphere with the mean |x|^2 of 1."""
    import trimesh  # slow to import

    ball = trimesh.creation.icosahedron()
    triangles = np.asarray(ball.vertices, dtype=np.float64)[np.asarray(ball.faces)]
    corners = np.einsum("fkc,tci->tfki", _cut(n), triangles).reshape(-1, 3, 3)
    corners /= np.linalg.norm(corners, axis=-1, keepdims=True)
    areas = np.linalg.norm(_across(corners), axis=1)
    # Mean of |x|^2 over a triangle with corners of length 1: (3 + |a + b + c|^2) / 12.
    means = (3 + (corners.sum(axis=1) ** 2).sum(axis=-1)) / 12
    return corners / np.sqrt((areas * means).sum() / areas.sum())


def in_four(triangles: Array) -> Array:
    """Cut triangles (n, 3, 3) into four like ones each, (4 n, 3, 3)."""
    return np.einsum("fkc,tci->tfki", _cut(2), triangles).reshape(-1, 3, 3)
