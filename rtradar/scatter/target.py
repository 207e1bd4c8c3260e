"""Targets of `scattering_length`: the geometry of ellipsoids, sums of echoes, and checked meshes.

A mesh of one's own is a `trimesh.Trimesh` in metres, given as the target of `scattering_length`; in
a room it is furniture (`rtradar.scene.objects`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.scene.mesh_files import Triangles, checked_triangles

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
