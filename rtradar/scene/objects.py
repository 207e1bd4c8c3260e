"""Walls, rectangular slabs of one material of which six make a room, and furniture: meshes.

A mesh of one's own is a file of `MESH_ENDINGS` that `Furniture` names with its length unit: closed,
or of metal where ``sheet`` says that it is a thin sheet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.scene.materials import Material
from rtradar.scene.mesh_files import (
    MESH_ENDINGS,
    Triangles,
    checked_triangles,
    mesh_names,
    read_mesh,
)
from rtradar.system.checks import Vector, brief
from rtradar.system.fields import Angle, Limits, Point, check_fields, read_value
from rtradar.system.files import shipped_folder

ROOM_SIDES = ("near", "far", "right", "left", "floor", "ceiling")
"""Sides at the least x, largest x, least y, largest y, z = 0 and the top."""

SMALLEST_M, LARGEST_M = 1e-3, 100.0
"""Limits of the size of furniture along its longest axis [m]."""

_LENGTHS = f"it must be 3 numbers, lengths of {SMALLEST_M:g} to {LARGEST_M:g} m"
BOX = Annotated[Vector, Limits(SMALLEST_M, LARGEST_M, _LENGTHS)]

_SHORTEST_M = 0.01
"""Least length of a wall's edge [m]."""

Opening = tuple[float, float, float, float]
"""Rectangle in a wall: its beginning along both edges, its width and its height [m]."""

_Thickness = Annotated[float, Limits(1e-4, 10)]
_Roughness = Annotated[float, Limits(0, 0.1)]
_Openings = Annotated[
    tuple[Opening, ...],
    Limits(-1000, 1000, "it must be a list of [u, v, width, height] in metres"),
]
_Material = Annotated[
    Material, Limits(wanted="it must be a Material, as material('concrete') gives")
]
_Size = Annotated[Vector, Limits(0.1, 100)]
_Corner = Annotated[tuple[float, float], Limits(-100, 100)]

_SQUARE = 1e-6
"""Largest cosine between the edges of a rectangle: 1 um of skew a metre."""


@dataclass(frozen=True, kw_only=True)
class Surface:
    """Material and thickness of one side of a room.

    Parameters
    ----------
    material : Material
        Material of the whole slab.
    thickness_m : float
        Thickness [m].
    roughness_m : float
        Root mean square of the height of the faces about their planes [m].
    openings : tuple of tuple of float
        Doorways and other openings, each as (u, v, width, height) [m]: where it begins along both
        edges, from the lower left corner seen from inside, those of the floor and the ceiling along
        x and y, and its size along them.
    """

    material: _Material
    thickness_m: _Thickness
    roughness_m: _Roughness = 0.0
    openings: _Openings = ()


@dataclass(frozen=True, kw_only=True)
class Wall(Surface):
    """A rectangular slab, given by its front face and its thickness.

    The front is the side to which ``edge_u_m x edge_v_m`` points: in a room the inside. The slab
    lies behind the front face, so that the rectangle is what one measures in the room.

    Parameters
    ----------
    name : str
        Name that reports show.
    corner_m : tuple of float
        One corner of the front face, world [m].
    edge_u_m, edge_v_m : tuple of float
        Vectors from that corner to its two neighbours [m], at right angles.
    material : Material
        Material of the whole slab.
    thickness_m : float
        Distance between the two faces [m].
    roughness_m : float
        Root mean square of the height of the faces about their planes [m].
    openings : tuple of tuple of float
        Doorways and other openings, each as (u, v, width, height) [m]: where it begins along both
        edges, from the corner, and its size along them.

    Raises
    ------
    InputError
        Where a value has no physical meaning; the message names the wall, the field and what is
        allowed.
    """

    name: str
    corner_m: Point
    edge_u_m: Point
    edge_v_m: Point

    def __post_init__(self) -> None:
        where = f"wall {brief(self.name)}"
        check_fields(self, f"{where}: ")
        edges = f"{where}: edge_u_m = {brief(self.edge_u_m)} and edge_v_m = {brief(self.edge_v_m)}"
        if min(self.size_m) < _SHORTEST_M:
            raise InputError(f"{edges}; an edge must be {_SHORTEST_M} m long or more")
        if abs(np.dot(self.edge_u_m, self.edge_v_m)) > _SQUARE * self.area_m2:
            raise InputError(f"{edges} are not at right angles; a wall is a rectangle")
        self._check_openings(where)

    def _check_openings(self, where: str) -> None:
        """Refuse openings that do not lie in the wall, or lie in each other."""
        width, height = self.size_m
        for number, (u, v, wide, high) in enumerate(self.openings):
            inside = min(u, v) >= 0 and u + wide <= width + 1e-9 and v + high <= height + 1e-9
            if not inside or min(wide, high) < _SHORTEST_M:
                raise InputError(
                    f"{where}: opening {brief([u, v, wide, high])} is [u, v, width, height] in "
                    f"metres; it must lie in the wall of {width:g} by {height:g} m, and measure "
                    f"{_SHORTEST_M} m or more"
                )
            # Two rectangles overlap if they do along both edges.
            for a, b, c, d in self.openings[:number]:
                if u < a + c and a < u + wide and v < b + d and b < v + high:
                    raise InputError(
                        f"{where}: openings {brief([a, b, c, d])} and "
                        f"{brief([u, v, wide, high])} overlap; make them one, or two apart"
                    )

    @cached_property
    def normal(self) -> NDArray[np.float64]:
        """Unit normal of the front, away from the slab, (3,)."""
        normal = np.cross(self.edge_u_m, self.edge_v_m)
        return np.asarray(normal / np.linalg.norm(normal))

    @cached_property
    def corners(self) -> NDArray[np.float64]:
        """Corners of the front face, anticlockwise seen from the front, (4, 3) [m]."""
        corner, u, v = map(np.array, (self.corner_m, self.edge_u_m, self.edge_v_m))
        return np.stack([corner, corner + u, corner + u + v, corner + v])

    @cached_property
    def size_m(self) -> tuple[float, float]:
        """Lengths of both edges [m]."""
        return float(np.linalg.norm(self.edge_u_m)), float(np.linalg.norm(self.edge_v_m))

    @property
    def area_m2(self) -> float:
        """Area of one face [m^2]."""
        return self.size_m[0] * self.size_m[1]

    def depth_m(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the depth of points behind the front face.

        Parameters
        ----------
        points : (..., 3) float64
            Points, world [m].

        Returns
        -------
        (...) float64
            Depth [m], from 0 to `thickness_m` inside the slab; NaN beside the rectangle and in an
            opening.
        """
        # Beside the rectangle and in an opening there is no slab.
        away, across = self._across(points)
        inside = ((across >= 0) & (across <= 1)).all(axis=-1) & ~self.in_opening(points)
        return np.where(inside, -(away @ self.normal), np.nan)

    def in_opening(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell whether points, projected onto the front, lie in an opening.

        Parameters
        ----------
        points : (..., 3) float64
            Points, world [m].

        Returns
        -------
        (...) bool
        """
        along, up = np.moveaxis(self._across(points)[1] * self.size_m, -1, 0)
        open_here = np.zeros(along.shape, dtype=bool)
        for u, v, wide, high in self.openings:
            open_here |= (along > u) & (along < u + wide) & (up > v) & (up < v + high)
        return open_here

    def _across(
        self, points: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Vectors from the corner (..., 3) [m], and fractions of both edges they reach (..., 2)."""
        away = np.asarray(points, dtype=np.float64) - np.array(self.corner_m)
        edges = np.array([self.edge_u_m, self.edge_v_m])
        return away, away @ edges.T / np.square(self.size_m)

    def holds(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell whether points lie inside the slab.

        Parameters
        ----------
        points : (..., 3) float64
            Points, world [m].

        Returns
        -------
        (...) bool
        """
        depth = self.depth_m(points)
        return np.asarray((depth >= 0) & (depth <= self.thickness_m))


def room_walls(
    size_m: _Size, corner_m: _Corner, surfaces: Mapping[str, Surface]
) -> tuple[Wall, ...]:
    """Make the six walls of a box, their fronts inward; its floor is z = 0.

    Parameters
    ----------
    size_m : tuple of float
        Inner size along x, y and z [m].
    corner_m : tuple of float
        Least x and least y inside [m].
    surfaces : mapping of str to Surface
        Surface of each of `ROOM_SIDES`.

    Returns
    -------
    tuple of Wall
        Walls with the names and the order of `ROOM_SIDES`.

    Raises
    ------
    InputError
        Where a size is not positive, or a surface has a value without meaning.
    """
    x, y = read_value(_Corner, "room: ", "corner_m", corner_m)
    a, b, h = read_value(_Size, "room: ", "size_m", size_m)
    # A corner and two edges of each side, whose cross product points into the room.
    faces: dict[str, tuple[Vector, Vector, Vector]] = {
        "near": ((x, y, 0.0), (0.0, b, 0.0), (0.0, 0.0, h)),
        "far": ((x + a, y + b, 0.0), (0.0, -b, 0.0), (0.0, 0.0, h)),
        "right": ((x + a, y, 0.0), (-a, 0.0, 0.0), (0.0, 0.0, h)),
        "left": ((x, y + b, 0.0), (a, 0.0, 0.0), (0.0, 0.0, h)),
        "floor": ((x, y, 0.0), (a, 0.0, 0.0), (0.0, b, 0.0)),
        "ceiling": ((x, y + b, h), (a, 0.0, 0.0), (0.0, -b, 0.0)),
    }
    return tuple(
        Wall(name=side, corner_m=corner, edge_u_m=u, edge_v_m=v, **vars(surfaces[side]))
        for side, (corner, u, v) in faces.items()
    )


@dataclass(frozen=True)
class Furniture:
    """A mesh in a scene.

    Parameters
    ----------
    name : str
        Name that reports show.
    mesh : str, Path, (float, float, float) or trimesh.Trimesh
        Name of a mesh that comes with rtradar, or a file: ``.ply``, ``.obj``, ``.stl`` or ``.glb``;
        or the lengths of a box along x, y and z [m], whose origin is in the middle of its bottom;
        or a mesh in metres.
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
    mesh: Any  # str, Path, lengths or a mesh itself
    material: _Material
    _: KW_ONLY
    position_m: Point
    yaw_deg: Angle = 0.0
    scale: Annotated[float, Limits(1e-3, 1e3)] = 1.0
    metres_per_unit: Annotated[float | None, Limits(1e-6, 1e3)] = None
    sheet: bool = False

    def __post_init__(self) -> None:
        where = f"{self._where}: "
        check_fields(self, where)
        if isinstance(self.mesh, list | tuple):
            object.__setattr__(self, "mesh", read_value(BOX, where, "box", self.mesh))
        mesh = f"{where}mesh = {brief(self.mesh)}"
        endings = " ".join(MESH_ENDINGS)
        if self._built_in and self.mesh not in mesh_names():
            raise InputError(
                f"{mesh} is unknown; allowed: {', '.join(mesh_names())}, or a file of {endings}"
            )
        # A mesh that is shipped, a box and one in memory are in metres; only a file needs to be
        # told its unit.
        if self._settled:
            if self.metres_per_unit is not None or self.sheet:
                raise InputError(
                    f"{where}metres_per_unit and sheet belong to a file of one's own; "
                    f"{brief(self.mesh)} has both settled"
                )
        elif not isinstance(self.mesh, str | Path):
            raise InputError(f"{mesh}; it must be a name, a file, a box or a trimesh.Trimesh")
        elif self.path.suffix.lower() not in MESH_ENDINGS:
            raise InputError(f"{where}mesh = {brief(self.path.name)}; allowed: {endings}")
        elif self.metres_per_unit is None:
            raise InputError(
                f"{where}metres_per_unit is missing; say how long a unit of '{self.mesh}' is: "
                "1 for m, 0.001 for mm"
            )

    @property
    def _where(self) -> str:
        return f"{type(self).__name__.lower()} {brief(self.name)}"

    @property
    def _built_in(self) -> bool:
        return isinstance(self.mesh, str) and not Path(self.mesh).suffix

    @property
    def _settled(self) -> bool:
        """Whether the mesh itself says its unit, and whether it is a sheet."""
        return self._built_in or isinstance(self.mesh, tuple) or self.in_memory

    @property
    def in_memory(self) -> bool:
        """Whether the mesh is one of Python's, which no file has."""
        return hasattr(self.mesh, "vertices") and hasattr(self.mesh, "faces")

    @property
    def path(self) -> Path:
        """File of the mesh."""
        return shipped_folder("meshes") / f"{self.mesh}.ply" if self._built_in else Path(self.mesh)

    @property
    def axes(self) -> NDArray[np.float64]:
        """Rotation (3, 3) about the vertical from the mesh's own axes to the world's."""
        cosine, sine = np.cos(np.radians(self.yaw_deg)), np.sin(np.radians(self.yaw_deg))
        return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])

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
        own = self._own_triangles()
        return own.moved(own.vertices @ self.axes.T + np.array(self.position_m))

    def _own_triangles(self) -> Triangles:
        """Mesh in its own axes, scaled to metres, once it is checked."""
        # An open mesh has no inside: it can only be a thin sheet, through which nothing passes if
        # it conducts.
        where, read = self._where, self._read()
        if not (read.closed or self.sheet or self._settled):
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
        return read.moved(vertices)

    def _read(self) -> Triangles:
        if self.in_memory:
            return checked_triangles(self._where, self.mesh.vertices, self.mesh.faces)
        if not isinstance(self.mesh, tuple):
            return read_mesh(self.path)
        import trimesh  # slow to import

        box = trimesh.creation.box(self.mesh)
        vertices = np.asarray(box.vertices) + np.array([0, 0, self.mesh[2] / 2])
        return Triangles(vertices, np.array(box.faces, dtype=np.int64), closed=True)
