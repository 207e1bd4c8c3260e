"""The one check of meshes whose scattering length is asked for, whatever the model.

A mesh of one's own is a `trimesh.Trimesh` in metres, given as the target of `scattering_length`; in
a room it is furniture (`rtradar.scene.objects`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.scene.mesh_files import Triangles, checked_triangles

_ON_SURFACE = 1e-9
"""Of the size of a mesh: an antenna no farther from its surface stands on it."""


def target_mesh(target: object, tx: NDArray[np.float64], rx: NDArray[np.float64]) -> Triangles:
    """The triangles of a target that is no `Ellipsoids`.

    Parameters
    ----------
    target : trimesh.Trimesh
        [m].
    tx, rx : (n, 3) float64
        Antennas, in its coordinates [m].

    Returns
    -------
    Triangles

    Raises
    ------
    InputError
        Where the target is no mesh or cannot be used, or an antenna is inside of it or on its surface.
    """
    import trimesh  # slow to import

    if not isinstance(target, trimesh.Trimesh):
        raise InputError(
            f"scattering_length: the target is a {type(target).__name__}; allowed: rt.Ellipsoids or trimesh.Trimesh"
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
                    f"scattering_length: {name}[{index}] is {where}; antennas must stand outside the target"
                )
    return mesh
