"""Closed meshes of curved bodies whose flat triangles are, on average, on the curved surface.

With corners on the surface, all triangles would be inside of it, by an eighth of the square of the
edges times the mean curvature: that would be most of the error of a full-wave calculation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from rtradar.body import body

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_FINE = 2001


def geodesic_sphere(radius_m: float, divisions: int) -> Any:
    """Sphere of 30 n^2 edges, n divisions of each edge of an icosahedron; its volume is exact."""
    mesh = trimesh.Trimesh(*body.geodesic_sphere(divisions))
    mesh.apply_scale((4 / 3 * np.pi * radius_m**3 / mesh.volume) ** (1 / 3))
    return mesh


@dataclass(frozen=True)
class EllipticBody:
    """A body along x whose cross-sections are ellipses of one ratio of axes, about the x axis.

    ``width`` gives the half-width along y [m] at some x [m], from ``first`` to ``last``, where it
    is zero; the half-width along z is that times ``ratio``, at most 1.
    """

    width: Callable[[Array], Array]
    first: float
    last: float
    ratio: float

    def mesh(self, edge_m: float) -> Any:
        """Mesh with edges of about this length, and with the mirror planes y = 0 and z = 0."""
        vertices, faces = _quarter(self, edge_m)
        whole = [
            (vertices * [1, y, z], (faces if y == z else faces[:, ::-1]))
            for y in (1, -1)
            for z in (1, -1)
        ]
        mesh = trimesh.util.concatenate([trimesh.Trimesh(*of, process=False) for of in whole])
        mesh.merge_vertices()
        if mesh.volume < 0:
            mesh.invert()
        return self._moved_out(mesh)

    def _moved_out(self, mesh: Any) -> Any:
        """Move corners along their normals by the mean height of the surface above the faces."""
        corners = mesh.vertices[mesh.faces]
        # The middles of the edges integrate quadratic functions.
        middles = (corners + np.roll(corners, 1, axis=1)) / 2
        heights = self._height(middles).mean(axis=1) * mesh.area_faces
        total, area = np.zeros((2, len(mesh.vertices)))
        for corner in range(3):
            np.add.at(total, mesh.faces[:, corner], heights)
            np.add.at(area, mesh.faces[:, corner], mesh.area_faces)
        moved = mesh.vertices + mesh.vertex_normals * (total / area)[:, None]
        return trimesh.Trimesh(moved, mesh.faces, process=False)

    def _height(self, points: Array) -> Array:
        """Height of the surface above points near it, to first order [m]."""
        size = self.last - self.first
        x = np.clip(points[..., 0], self.first + 1e-9 * size, self.last - 1e-9 * size)
        step = 1e-9 * size
        slope = (self.width(x + step) - self.width(x - step)) / (2 * step)
        y, z = points[..., 1], points[..., 2] / self.ratio
        across = np.maximum(np.hypot(y, z), 1e-9 * size)
        gradient = np.sqrt(slope**2 + (y**2 + (z / self.ratio) ** 2) / across**2)
        return np.asarray((self.width(x) - across) / gradient)


def _quarter(body: EllipticBody, edge_m: float) -> tuple[Array, NDArray[np.int64]]:
    """Triangles between rings of corners where y and z are not negative."""
    middle, half = (body.first + body.last) / 2, (body.last - body.first) / 2
    x = middle - half * np.cos(np.linspace(0, np.pi, _FINE))
    width = body.width(x)
    width[[0, -1]] = 0.0
    along = _arc(x, width)
    turn = np.linspace(0, np.pi / 2, _FINE)
    around = _arc(np.cos(turn), body.ratio * np.sin(turn))
    count = int(np.ceil(along[-1] / edge_m))
    rings, corners = [], []
    for place in np.interp(np.linspace(0, along[-1], count + 1), along, x):
        at_end = len(rings) in (0, count)
        wide = 0.0 if at_end else float(body.width(np.array(place)))
        steps = 0 if at_end else max(1, round(wide * around[-1] / edge_m))
        angle = np.interp(np.linspace(0, around[-1], steps + 1), around, turn)
        rings.append(np.arange(steps + 1) + sum(map(len, rings)))
        ring = [np.full(steps + 1, place), wide * np.cos(angle), wide * body.ratio * np.sin(angle)]
        ring[1][angle >= np.pi / 2] = 0.0
        corners.append(np.stack(ring, axis=1))
    vertices = np.concatenate(corners)
    faces = [face for two in pairwise(rings) for face in _between(vertices, *two)]
    return vertices, np.array(faces)


def _arc(x: Array, y: Array) -> Array:
    """Length of a curve up to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])


def _between(
    vertices: Array, one: NDArray[np.int64], other: NDArray[np.int64]
) -> list[tuple[int, int, int]]:
    """Triangles between two rings, each across the shorter diagonal."""
    faces, i, j = [], 0, 0
    while i < len(one) - 1 or j < len(other) - 1:
        diagonals = [np.inf, np.inf]
        if i < len(one) - 1:
            diagonals[0] = float(np.linalg.norm(vertices[one[i + 1]] - vertices[other[j]]))
        if j < len(other) - 1:
            diagonals[1] = float(np.linalg.norm(vertices[other[j + 1]] - vertices[one[i]]))
        if diagonals[0] < diagonals[1]:
            faces.append((one[i], one[i + 1], other[j]))
            i += 1
        else:
            faces.append((one[i], other[j + 1], other[j]))
            j += 1
    return faces


def spheroid(half_length_m: float, radius_m: float) -> EllipticBody:
    """Ellipsoid of revolution about x."""

    def width(x: Array) -> Array:
        return np.asarray(radius_m * np.sqrt(np.maximum(1 - (x / half_length_m) ** 2, 0.0)))

    return EllipticBody(width, -half_length_m, half_length_m, 1.0)


def limit(coarse: Complex, fine: Complex, squares: list[float]) -> Complex:
    """Field for edges of no length, from two meshes and the squares of their edges."""
    weight = squares[0] / (squares[0] - squares[1])
    return weight * fine + (1 - weight) * coarse
