"""Closed meshes: the currents over their edges, and how mirror planes combine these."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from rtradar.errors import InputError
from rtradar.kernels.surface_integrals import Orbits, Triangles

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_SAME_PLACE = 1e-6
"""Distance over the size of the mesh below which a corner is the mirror image of another one."""


@dataclass(frozen=True, eq=False)
class ClosedMesh:
    """A closed surface of triangles, whose corners run anticlockwise as seen from outside.

    The current l / (2 A) (r - corner i), with the length l of the edge and the area A, flows across
    edge i of a triangle, which is opposite to its corner i. It flows out of one of the two
    triangles of the edge, and with the other sign into the other.

    Parameters
    ----------
    vertices : (vertex, 3) float64
        Corners [m].
    faces : (triangle, 3) int64
        Indices of the corners of each triangle.

    Raises
    ------
    InputError
        Where the mesh is not closed, or its triangles face inward.
    """

    vertices: Array
    faces: Indices

    def __post_init__(self) -> None:
        # In a closed mesh each edge has two triangles, which go along it in opposite directions.
        _, edge_of, signs = self._edges
        balance = np.bincount(edge_of.ravel(), weights=signs.ravel())
        if (np.bincount(edge_of.ravel()) != 2).any() or balance.any():
            raise InputError(
                "full-wave: the mesh is not closed; every edge must have two triangles, whose "
                "corners run anticlockwise as seen from outside"
            )
        # The volume inside is positive if all triangles face outward.
        corners = self.vertices[self.faces]
        if np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) <= 0:
            raise InputError(
                "full-wave: the corners of the mesh run clockwise as seen from outside; they must "
                "run anticlockwise: reverse each triangle"
            )

    @cached_property
    def _edges(self) -> tuple[Indices, Indices, Array]:
        """Ends of each edge (edge, 2), edges of triangles (triangle, 3), and their signs."""
        # Edge i goes from the corner after corner i to the one after that; its sign says whether
        # that is up or down in the numbers of the corners.
        ends = np.stack([np.roll(self.faces, -1, axis=1), np.roll(self.faces, -2, axis=1)], axis=2)
        forward = ends[..., 0] < ends[..., 1]
        edges, index = np.unique(np.sort(ends.reshape(-1, 2), axis=1), axis=0, return_inverse=True)
        return edges, index.reshape(self.faces.shape), np.where(forward, 1.0, -1.0)

    @property
    def edge_of(self) -> Indices:
        """Edge opposite to each corner (triangle, 3)."""
        return self._edges[1]

    @property
    def unknowns(self) -> int:
        """Number of edges, each with one current."""
        return len(self._edges[0])

    @cached_property
    def lengths(self) -> Array:
        """Length of each edge (edge,) [m]."""
        ends = self.vertices[self._edges[0]]
        return np.asarray(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))

    def divided(self) -> ClosedMesh:
        """Divide each triangle into four, at the middles of its edges.

        Returns
        -------
        ClosedMesh
        """
        edges, edge_of, _ = self._edges
        # A triangle at each corner, and one between the middles.
        middles = len(self.vertices) + edge_of
        corner = [
            np.stack([self.faces[:, i], middles[:, i - 1], middles[:, i - 2]], axis=1)
            for i in range(3)
        ]
        vertices = np.concatenate([self.vertices, self.vertices[edges].mean(axis=1)])
        return ClosedMesh(vertices, np.concatenate([*corner, middles]))

    @cached_property
    def triangles(self) -> Triangles:
        """Triangles as the compiled functions take them."""
        corners = self.vertices[self.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        doubled = np.linalg.norm(normals, axis=1)
        _, edge_of, signs = self._edges
        scales = signs * self.lengths[edge_of] / doubled[:, None]
        return Triangles(corners, self.faces, normals / doubled[:, None], doubled / 2, scales)

    @cached_property
    def mirror_axes(self) -> tuple[int, ...]:
        """Axes whose plane, across the axis through the mesh's middle, is a plane of symmetry."""
        return tuple(axis for axis in range(3) if self._reflected(axis) is not None)

    def _reflected(self, axis: int) -> tuple[Indices, Indices, Array] | None:
        """Return the mirror images of triangles and edges, and the signs of edges, if all exist."""
        # Every corner must have a corner at its mirror image, every triangle a triangle.
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        mirrored = self.vertices.copy()
        mirrored[:, axis] = low[axis] + high[axis] - mirrored[:, axis]
        distance, vertex = cKDTree(self.vertices).query(mirrored)
        if distance.max() > _SAME_PLACE * (high - low).max():
            return None
        triangle = _places_of(np.sort(vertex[self.faces], axis=1), np.sort(self.faces, axis=1))
        if triangle is None:
            return None
        edges, edge_of, signs = self._edges
        edge = _places_of(np.sort(vertex[edges], axis=1), edges)
        assert edge is not None  # edges are those of the triangles
        # A current that leaves a triangle leaves its mirror image.
        there = edge[edge_of][..., None] == edge_of[triangle][:, None, :]
        sign = np.empty(len(edges))
        sign[edge_of] = signs * (there * signs[triangle][:, None, :]).sum(axis=2)
        return triangle, edge, sign

    @cached_property
    def orbits(self) -> Orbits:
        """Currents of even and odd parity at the mirror planes, as the kernel takes them."""
        _, edge_of, _ = self._edges
        unknown, parity = self._parities
        # One triangle of each set of mirror images is tested, weighted for reflections that keep
        # it.
        images = self._images[0]
        tested = np.flatnonzero(images.min(axis=0) == np.arange(len(self.faces)))
        kept = (images[:, tested] == tested).sum(axis=0)
        return Orbits(tested, 1 / kept, unknown[edge_of], parity[:, edge_of])

    @cached_property
    def _images(self) -> tuple[Indices, Indices, Array]:
        """Images of triangles and of edges, and signs of the latter, under all reflections."""
        # Each mirror plane doubles the reflections: all so far, and all of them followed by its
        # own.
        triangle, edge = np.arange(len(self.faces))[None], np.arange(self.unknowns)[None]
        sign = np.ones((1, self.unknowns))
        for axis in self.mirror_axes:
            found = self._reflected(axis)
            assert found is not None
            triangle = np.concatenate([triangle, found[0][triangle]])
            sign = np.concatenate([sign, sign * found[2][edge]])
            edge = np.concatenate([edge, found[1][edge]])
        return triangle, edge, sign

    @cached_property
    def _parities(self) -> tuple[Indices, Array]:
        """Unknown of each edge (edge,), and its coefficient there (parity, edge)."""
        _, edge, sign = self._images
        # Edges that are mirror images of each other are one unknown.
        count = len(edge)
        first = edge.min(axis=0)
        representatives, unknown = np.unique(first, return_inverse=True)
        group = np.arange(count)
        # Each parity is a choice of even or odd at each plane; the sign of a reflection in it is
        # the product over the planes that it uses.
        odd = np.array([[(a & b).bit_count() % 2 for b in range(count)] for a in range(count)])
        characters = np.where(odd, -1.0, 1.0)  # (parity, reflections)
        parity = np.zeros((count, self.unknowns))
        # The sum over all reflections, which is 0 where the current cannot have that parity.
        for g in group:
            images = edge[g, representatives]
            parity[:, images] += characters[:, g, None] * sign[g, representatives]
        kept = (edge[:, representatives] == representatives).sum(axis=0)
        return unknown, parity / kept[unknown]

    @cached_property
    def sums_of_edges(self) -> list[sparse.csr_array]:
        """For each parity, the sums of edges that are one unknown: (unknown, edge)."""
        unknown, parity = self._parities
        shape = unknown.max() + 1, self.unknowns
        places = unknown, np.arange(self.unknowns)
        return [sparse.csr_array((signs, places), shape=shape) for signs in parity]


def _places_of(rows: Indices, among: Indices) -> Indices | None:
    """Index of each row among others, all of which are different; None if one is not there."""
    # Rows that are among the others add no new row to the sorted list of both.
    found, index = np.unique(np.concatenate([among, rows]), axis=0, return_inverse=True)
    if len(found) != len(among):
        return None
    place = np.empty(len(found), dtype=np.int64)
    place[index[: len(among)]] = np.arange(len(among))
    return place[index[len(among) :]]
