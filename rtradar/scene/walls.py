"""Walls: rectangular slabs of one material; six of them make a room."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.scene.materials import Material
from rtradar.system.checks import Vector, check_number, check_text, check_vector, shown

ROOM_SIDES = ("near", "far", "right", "left", "floor", "ceiling")
"""Sides at the least x, largest x, least y, largest y, z = 0 and the top."""

_SHORTEST_M = 0.01
_SQUARE = 1e-6
"""Largest cosine between the edges of a rectangle: 1 um of skew a metre."""


@dataclass(frozen=True, kw_only=True)
class Wall:
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

    Raises
    ------
    InputError
        Where a value has no physical meaning; the message names the wall, the field and what is
        allowed.
    """

    name: str
    corner_m: Vector
    edge_u_m: Vector
    edge_v_m: Vector
    material: Material
    thickness_m: float
    roughness_m: float = 0.0

    def __post_init__(self) -> None:
        check_text("wall", "name", self.name)
        where = f"wall '{self.name}'"
        for key in ("corner_m", "edge_u_m", "edge_v_m"):
            object.__setattr__(self, key, check_vector(where, key, getattr(self, key), 3))
        for key in ("edge_u_m", "edge_v_m"):
            if np.linalg.norm(getattr(self, key)) < _SHORTEST_M:
                raise InputError(
                    f"{where}: {key} = {shown(getattr(self, key))}; an edge must be {_SHORTEST_M} "
                    "m long or more"
                )
        u, v = np.array(self.edge_u_m), np.array(self.edge_v_m)
        if abs(u @ v) > _SQUARE * np.linalg.norm(u) * np.linalg.norm(v):
            raise InputError(
                f"{where}: edge_u_m = {shown(self.edge_u_m)} and edge_v_m = {shown(self.edge_v_m)} "
                "are not at right angles; a wall is a rectangle"
            )
        if not isinstance(self.material, Material):
            raise InputError(
                f"{where}: material = {shown(self.material)}; it must be a Material, as "
                "material('concrete') gives"
            )
        for key, least, most in (("thickness_m", 1e-4, 10.0), ("roughness_m", 0.0, 0.1)):
            value = check_number(where, key, getattr(self, key), least, most)
            object.__setattr__(self, key, value)

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

    @property
    def area_m2(self) -> float:
        """Area of one face [m^2]."""
        return float(np.linalg.norm(self.edge_u_m) * np.linalg.norm(self.edge_v_m))

    def depth_m(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the depth of points behind the front face.

        Parameters
        ----------
        points : (..., 3) float64
            Points, world [m].

        Returns
        -------
        (...) float64
            Depth [m], from 0 to `thickness_m` inside the slab; NaN beside the rectangle.
        """
        away = np.asarray(points, dtype=np.float64) - np.array(self.corner_m)
        inside = np.ones(away.shape[:-1], dtype=bool)
        for edge in (np.array(self.edge_u_m), np.array(self.edge_v_m)):
            fraction = away @ edge / (edge @ edge)
            inside &= (fraction >= 0) & (fraction <= 1)
        return np.where(inside, -(away @ self.normal), np.nan)

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
        Root mean square of the height of the faces [m].
    """

    material: Material
    thickness_m: float
    roughness_m: float = 0.0


def room_walls(
    size_m: Vector, corner_m: tuple[float, float], surfaces: Mapping[str, Surface]
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
    x, y = check_vector("room", "corner_m", corner_m, 2, 100.0)
    lengths = check_vector("room", "size_m", size_m, 3, 100.0)
    if min(lengths) < 0.1:
        raise InputError(f"room: size_m = {shown(size_m)}; each must be from 0.1 to 100 m")
    a, b, h = lengths
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
