"""Integrals of the full-wave method over surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np

from references.cases import Pair, filled, kernel_case
from rtradar.full_wave.surfaces import rules
from rtradar.full_wave.surfaces_mesh import ClosedMesh
from rtradar.kernels.surface_integrals import DEEPEST, FAR, Equation, fill_matrices


def _octahedron() -> Any:
    """Octahedron with two mirror planes, whose opposite triangles are near without touching."""
    vertices = np.array([[1.2, 0, 0], [-0.9, 0, 0], *np.eye(3)[1:], *-np.eye(3)[1:]])
    ring = [2, 3, 4, 5]
    faces = [
        face
        for one, other in zip(ring, np.roll(ring, -1), strict=True)
        for face in ((0, one, other), (1, other, one))
    ]
    return ClosedMesh(vertices, np.array(faces))


def matrices_reference(triangles, orbits, rules, equation):
    """Elements of `fill_matrices`, block by block in plain NumPy."""
    count = int(orbits.unknown.max()) + 1
    out = np.zeros((len(orbits.parity), count, count), dtype=np.complex128)
    for t, weight in zip(orbits.tested, orbits.weights, strict=True):
        for s in range(len(triangles.areas)):
            block = _block_reference(t, s, triangles, rules, equation)
            block *= weight * np.outer(triangles.scales[t], triangles.scales[s])
            for of_parity, sign in zip(out, orbits.parity, strict=True):
                where = np.ix_(orbits.unknown[t], orbits.unknown[s])
                np.add.at(of_parity, where, np.outer(sign[t], sign[s]) * block)
    return out


def _block_reference(t, s, triangles, rules, equation):
    """Integrals of both triangles, (edge, edge), but for the scales."""
    k, electric, normal = equation.wavenumber, equation.electric, triangles.normals[t]
    one, other, weight = _pairs_reference(t, s, triangles, rules)
    weight = weight * triangles.areas[t] * triangles.areas[s]
    f, g = one[:, None] - triangles.corners[t], other[:, None] - triangles.corners[s]
    away = one - other
    distance = np.linalg.norm(away, axis=1)
    green = weight * np.exp(-1j * k * distance) / (4 * np.pi * distance)
    slope = green * (1 + 1j * k * distance) / distance**2
    block = 1j * k * (np.einsum("p,pix,pjx->ij", green, f, g) - 4 / k**2 * green.sum())
    magnetic = np.einsum("p,pix,px,pjy,y->ij", slope, f, away, g, normal)
    magnetic -= np.einsum("p,pix,pjx,py,y->ij", slope, f, g, away, normal)
    if s == t:
        f = (rules.places @ triangles.corners[t])[:, None] - triangles.corners[t]
        magnetic += triangles.areas[t] / 2 * np.einsum("p,pix,pjx->ij", rules.weights, f, f)
    return electric * block + (1 - electric) * magnetic


def _pairs_reference(t, s, triangles, rules):
    """Points on both triangles (pair, 3), twice, and their weights (pair,)."""
    ones = sorted(range(3), key=lambda i: triangles.faces[t, i] not in triangles.faces[s])
    known = list(triangles.faces[t, ones])
    others = sorted(
        range(3), key=lambda j: known.index(f) if (f := triangles.faces[s, j]) in known else 3
    )
    shared = np.isin(triangles.faces[t], triangles.faces[s]).sum()
    pieces = [(triangles.corners[t, ones], triangles.corners[s, others], 1.0)]
    for _ in range(DEEPEST if shared == 0 else 0):
        pieces = [piece for whole in pieces for piece in _divided_reference(*whole)]
    pairs = rules.pairs[shared]
    points = [
        (pairs[:, :3] @ one, pairs[:, 3:6] @ other, part * pairs[:, 6])
        for one, other, part in pieces
    ]
    return (np.concatenate(of) for of in zip(*points, strict=True))


def _divided_reference(one, other, part):
    """Quarters of both triangles, all with all; or both as they are, where they are far."""
    middles, radii = [], []
    for corners in (one, other):
        middles.append(corners.mean(axis=0))
        radii.append(np.linalg.norm(corners - middles[-1], axis=1).max())
    if np.linalg.norm(middles[0] - middles[1]) > FAR * sum(radii):
        return [(one, other, part)]
    quarters = [
        [*((corners[i] + corners) / 2 for i in range(3)), (corners + np.roll(corners, -1, 0)) / 2]
        for corners in (one, other)
    ]
    return [(a, b, part / 16) for a in quarters[0] for b in quarters[1]]


@kernel_case(fill_matrices, 1e-9)
def _fill_matrices() -> Pair:
    mesh = _octahedron()
    given = mesh.triangles, mesh.orbits, rules(3), Equation(3.0, 0.8)
    count = 1 + int(mesh.orbits.unknown.max())
    out = (np.zeros((4, count, count), dtype=np.complex128),)
    return filled(fill_matrices, *given, out=out, adds=True), matrices_reference(*given)
