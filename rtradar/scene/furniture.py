"""Furniture: a mesh with a material and a position."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtradar.errors import InputError
from rtradar.scene.materials import Material
from rtradar.scene.mesh_files import MESH_ENDINGS, Triangles, mesh_names, meshes_folder, read_mesh
from rtradar.system.checks import Vector, check_number, check_text, check_vector, shown

SMALLEST_M, LARGEST_M = 1e-3, 100.0
"""Limits of the size of furniture along its longest axis [m]."""


@dataclass(frozen=True, kw_only=True)
class Furniture:
    """A mesh in a scene.

    Parameters
    ----------
    name : str
        Name that reports show.
    mesh : str or Path
        Name of a mesh that comes with rtradar, or a file of ``.ply .obj .stl .glb``.
    material : Material
        Material of the surface.
    position_m : tuple of float
        Position of the mesh's own origin, world [m].
    yaw_deg : float
        Rotation about the vertical through that origin, anticlockwise seen from above [deg].
    scale : float
        Factor by which the mesh is enlarged.
    metres_per_unit : float, optional
        Unit of a file [m]: 1 for metres, 0.001 for millimetres. Meshes by name are in metres, and
        take none.
    sheet : bool
        Whether the mesh of a file is a thin sheet. A mesh that is not closed must be one, and must
        be of metal.

    Raises
    ------
    InputError
        Where a value has no meaning. The mesh itself is read and checked by `triangles`.
    """

    name: str
    mesh: str | Path
    material: Material
    position_m: Vector
    yaw_deg: float = 0.0
    scale: float = 1.0
    metres_per_unit: float | None = None
    sheet: bool = False

    def __post_init__(self) -> None:
        check_text("furniture", "name", self.name)
        where = f"furniture '{self.name}'"
        if not isinstance(self.material, Material):
            raise InputError(
                f"{where}: material = {shown(self.material)}; it must be a Material, as "
                "material('wood') gives"
            )
        position = check_vector(where, "position_m", self.position_m, 3)
        object.__setattr__(self, "position_m", position)
        yaw = check_number(where, "yaw_deg", self.yaw_deg, -360.0, 360.0)
        object.__setattr__(self, "yaw_deg", yaw)
        object.__setattr__(self, "scale", check_number(where, "scale", self.scale, 1e-3, 1e3))
        if not isinstance(self.sheet, bool):
            raise InputError(f"{where}: sheet = {shown(self.sheet)}; it must be true or false")
        if self._comes_along:
            if self.mesh not in mesh_names():
                raise InputError(
                    f"{where}: mesh = {shown(self.mesh)} is unknown; allowed: "
                    f"{', '.join(mesh_names())}, or a file of {' '.join(MESH_ENDINGS)}"
                )
            if self.metres_per_unit is not None or self.sheet:
                raise InputError(
                    f"{where}: metres_per_unit and sheet belong to a file of one's own; "
                    f"'{self.mesh}' has both settled"
                )
        elif self.metres_per_unit is None:
            raise InputError(
                f"{where}: metres_per_unit is missing; say how long a unit of '{self.mesh}' is: "
                "1 for m, 0.001 for mm"
            )
        else:
            unit = check_number(where, "metres_per_unit", self.metres_per_unit, 1e-6, 1e3)
            object.__setattr__(self, "metres_per_unit", unit)

    @property
    def _comes_along(self) -> bool:
        return isinstance(self.mesh, str) and not Path(self.mesh).suffix

    @property
    def path(self) -> Path:
        """File of the mesh."""
        return meshes_folder() / f"{self.mesh}.ply" if self._comes_along else Path(self.mesh)

    def triangles(self) -> Triangles:
        """Read the mesh, and move it to its position in the scene.

        Returns
        -------
        Triangles
            Mesh in world coordinates [m].

        Raises
        ------
        InputError
            Where the file cannot be read or used, the mesh is open without being a sheet, or has an
            impossible size.
        """
        where = f"furniture '{self.name}'"
        read = read_mesh(self.path)
        if not (read.closed or self.sheet or self._comes_along):
            raise InputError(
                f"{where}: mesh '{self.mesh}' is not closed; close its holes, or say sheet = true "
                "if it is a thin sheet"
            )
        if read.closed and self.sheet:
            raise InputError(
                f"{where}: mesh '{self.mesh}' is closed, so it is no thin sheet; leave sheet out"
            )
        if not read.closed and not self.material.conducts:
            raise InputError(
                f"{where}: material '{self.material.name}' of a thin sheet; allowed: metal, "
                "perfect-conductor"
            )
        vertices = read.vertices * (self.scale * (self.metres_per_unit or 1.0))
        size = float(np.ptp(vertices, axis=0).max())
        if not SMALLEST_M <= size <= LARGEST_M:
            raise InputError(
                f"{where}: its mesh measures {size:.3g} m; allowed are {SMALLEST_M:g} to "
                f"{LARGEST_M:g} m: see to metres_per_unit and scale"
            )
        angle = np.radians(self.yaw_deg)
        cosine, sine = np.cos(angle), np.sin(angle)
        rotation = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
        vertices = vertices @ rotation.T + np.array(self.position_m)
        vertices.setflags(write=False)
        return Triangles(vertices, read.faces, read.closed)
