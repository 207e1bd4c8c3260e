"""Paths from antennas to the body over walls: which there are, and where their legs run.

A leg over walls is straight from the mirror image of its antenna (image method). A wall has two
faces: its front is the rectangle itself, and waves from behind meet the back, one thickness deeper.
All of this is closed form in float64; nothing is traced.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar
from rtradar.scene import Wall

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]


class Face(NamedTuple):
    """A wall, and whether its back reflects, not its front."""

    wall: Wall
    back: bool


Leg = tuple[Face, ...]
"""Faces that reflect on the way from an antenna, in this order; none where the leg is straight."""


@dataclass(frozen=True)
class WallPath:
    """A path: the leg from Tx to the body, and the leg from Rx to the body."""

    out: Leg
    back: Leg

    @property
    def order(self) -> int:
        """Number of reflections at walls."""
        return len(self.out) + len(self.back)

    @property
    def name(self) -> str:
        """Walls in the order in which the wave meets them, as in ``floor > body``."""
        out, back = ([face.wall.name for face in leg] for leg in (self.out, self.back))
        return " > ".join([*out, "body", *reversed(back)])


def wall_paths(
    walls: Sequence[Wall], place: Array, order: int, others: Sequence[Face] = ()
) -> tuple[WallPath, ...]:
    """List all paths with up to ``order`` reflections at walls, the direct one first.

    The middle of the array, ``place (3,)`` [m], or its image, settles which face of a wall
    reflects. Each of the ``others``, faces of furniture, reflects once on a path, without walls.
    """
    legs: list[Leg] = [()]
    for depth in range(1, order + 1):
        legs += [
            (*leg, Face(wall, bool(height(wall, images(leg, place)) < 0)))
            for leg in legs
            if len(leg) == depth - 1
            for wall in walls
            if not leg or leg[-1].wall is not wall
        ]
    paths = [WallPath(*both) for both in product(legs, legs)]
    for face in others if order else ():
        paths += [WallPath((), (face,)), WallPath((face,), ())]
    return tuple(
        sorted((path for path in paths if path.order <= order), key=lambda path: path.order)
    )


# -- geometry of one wall --------------------------------------------------------------------------


def height(wall: Wall, points: Array, *, back: bool = False) -> Array:
    """Height of points (..., 3) [m] above the front or the back, away from the slab (...) [m]."""
    above = (np.asarray(points) - np.array(wall.corner_m)) @ wall.normal
    return np.asarray(-above - wall.thickness_m if back else above)


def image(wall: Wall, points: Array, *, back: bool = False) -> Array:
    """Mirror images (..., 3) of points (..., 3) in the plane of the front or the back [m].

    Equation :eq:`image` of the theory page.
    """
    normal = -wall.normal if back else wall.normal
    return np.asarray(points - 2 * height(wall, points, back=back)[..., None] * normal)


def inside(wall: Wall, points: Array, margin_m: float | Array = 0.0) -> Bools:
    """Whether points (..., 3) [m], projected onto the front, lie in its rectangle and a margin."""
    away = np.asarray(points) - np.array(wall.corner_m)
    within = np.ones(away.shape[:-1], dtype=bool)
    for edge in (np.array(wall.edge_u_m), np.array(wall.edge_v_m)):
        length = np.linalg.norm(edge)
        along = away @ (edge / length)
        within &= (along >= -margin_m) & (along <= length + margin_m)
    return within


def specular_point(
    wall: Wall,
    origins: Array,
    targets: Array,
    *,
    back: bool = False,
    margin_m: float = 0.0,
    beside_m: float = 0.0,
) -> tuple[Array, Bools]:
    """Find where a wall reflects a wave from origins to targets (..., 3) [m].

    The margin [m] is added to the rectangle, and before the face for the target. Returned are the
    point on the plane of the front, or of the back (..., 3) [m], which is NaN where the ends are on
    different sides, and whether both ends are before that face and the point lies in the rectangle,
    or as far beside it as ``beside_m`` (...).
    """
    origins, targets = np.broadcast_arrays(origins, targets)
    first, second = height(wall, origins, back=back), height(wall, targets, back=back)
    before = (first > abs(margin_m)) & (second > -margin_m)
    fraction = np.where(before, first, np.nan) / np.where(before, first + second, 1.0)
    point = origins + fraction[..., None] * (image(wall, targets, back=back) - origins)
    return point, before & inside(wall, point, margin_m + beside_m)


# -- legs over several walls -----------------------------------------------------------------------


def image_chain(leg: Leg, antennas: Array) -> list[Array]:
    """Return antennas (..., 3) and their images after each face of a leg [m]."""
    return list(
        accumulate(
            leg,
            lambda points, face: image(face.wall, points, back=face.back),
            initial=np.asarray(antennas),
        )
    )


def images(leg: Leg, antennas: Array) -> Array:
    """Return the images (..., 3) of antennas (..., 3) over all faces of a leg [m]."""
    return image_chain(leg, antennas)[-1]


def corners(
    leg: Leg, antennas: Array, points: Array, margin_m: float = 0.0, *, beside_m: float = 0.0
) -> tuple[list[Array], Bools]:
    """Find where a leg from antennas to points (..., 3) [m] runs.

    Returned are the antenna, the places of reflection and the point at the other end, a list of
    (..., 3) [m], and whether each place of reflection lies in its rectangle, before the face (...),
    with the margins of `specular_point`. Where both ends are on different sides of a face, the next
    corner takes the place of the missing one.
    """
    antennas, points = np.broadcast_arrays(antennas, points)
    valid = np.ones(points.shape[:-1], dtype=bool)
    along = [points]
    sources = image_chain(leg, antennas)[:-1]
    for (wall, back), source in zip(reversed(leg), reversed(sources), strict=True):
        margins = {"margin_m": margin_m, "beside_m": beside_m}
        place, holds = specular_point(wall, source, along[-1], back=back, **margins)
        along.append(np.where(np.isnan(place), along[-1], place))
        valid &= holds
    return [antennas, *reversed(along)], valid


# -- the radar over a path -------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, repr=False)
class ImageRadar(Radar):
    """A radar whose Tx stand at their images over one leg, and whose Rx at those over another.

    What mirrors do to polarisation and to the patterns of antennas belongs to the legs: here
    antennas are isotropic, and turned as those of the radar are.
    """

    out: Leg = ()
    back: Leg = ()

    @classmethod
    def over(cls, radar: Radar, path: WallPath) -> Radar:
        """Return the radar as it is seen over a path."""
        given = {field.name: getattr(radar, field.name) for field in dataclasses.fields(radar)}
        isotropic = {"tx_antenna": None, "rx_antenna": None}
        return cls(**{**given, **isotropic}, out=path.out, back=path.back)

    def __post_init__(self) -> None:
        """Check nothing: the radar was checked, and its legs are no fields of a radar."""

    @cached_property
    def tx(self) -> NDArray[np.float64]:
        """Images of the transmitters (tx, 3) [m], world."""
        return images(self.out, self._in_world(self.tx_m))

    @cached_property
    def rx(self) -> NDArray[np.float64]:
        """Images of the receivers (rx, 3) [m], world."""
        return images(self.back, self._in_world(self.rx_m))
