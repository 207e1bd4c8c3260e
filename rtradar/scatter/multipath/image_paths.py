"""Paths from antenna to body over walls: which there are, mirror images of the antennas, and where the legs run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.scatter.multipath.wall_interaction import height, image, specular_point
from rtradar.scene import Wall

Array = NDArray[np.float64]


class Face(NamedTuple):
    """A wall, and which of its two faces reflects."""

    wall: Wall
    back: bool


Leg = tuple[Face, ...]
"""Faces that reflect on the way from an antenna to the body, in that order; none where it is straight."""


@dataclass(frozen=True)
class WallPath:
    """The way out, from Tx to the body, and the way back, told from Rx to the body."""

    out: Leg
    back: Leg

    @property
    def order(self) -> int:
        """Reflections at walls."""
        return len(self.out) + len(self.back)

    @property
    def name(self) -> str:
        """Walls in the order in which the wave meets them, the body between them: ``floor > body``."""
        return " > ".join(
            [
                *(face.wall.name for face in self.out),
                "body",
                *(face.wall.name for face in reversed(self.back)),
            ]
        )


def wall_paths(walls: Sequence[Wall], place: Array, order: int) -> tuple[WallPath, ...]:
    """All paths with up to ``order`` reflections at walls, the direct one first.

    Parameters
    ----------
    walls : sequence of Wall
    place : (3,) float64
        Middle of the array [m]; it, or its image, settles which face of a wall reflects.
    order : int
        0: the direct path alone.
    """
    legs: list[Leg] = [()]
    for depth in range(1, order + 1):
        legs += [
            (*leg, _met(wall, images(leg, place)))
            for leg in legs
            if len(leg) == depth - 1
            for wall in walls
            if not leg or leg[-1].wall is not wall
        ]
    paths = [
        WallPath(out, back) for out, back in product(legs, legs) if len(out) + len(back) <= order
    ]
    return tuple(sorted(paths, key=lambda path: path.order))


def _met(wall: Wall, place: Array) -> Face:
    return Face(wall, bool(height(wall, place) < 0))


def images(leg: Leg, antennas: Array) -> Array:
    """Images (..., 3) of antennas (..., 3) in the faces of a leg, one after the other [m]."""
    for wall, back in leg:
        antennas = image(wall, antennas, back=back)
    return np.asarray(antennas)


def corners(leg: Leg, antennas: Array, points: Array) -> tuple[list[Array], NDArray[np.bool_]]:
    """Where a leg runs.

    Parameters
    ----------
    leg : Leg
    antennas, points : (..., 3) float64
        Its ends [m]; they broadcast.

    Returns
    -------
    corners : list of (..., 3) float64
        The antenna, the places of reflection, the point on the body [m].
    valid : (...) bool
        Whether each place of reflection lies in its rectangle, before the face. Where two are on different sides of a face there
        is none: the point stands for it, and ``valid`` is False.
    """
    antennas, points = np.broadcast_arrays(antennas, points)
    chain = [antennas]
    for wall, back in leg:
        chain.append(image(wall, chain[-1], back=back))
    valid = np.ones(points.shape[:-1], dtype=bool)
    along = [points]
    for (wall, back), source in zip(reversed(leg), reversed(chain[:-1]), strict=True):
        place, holds = specular_point(wall, source, along[-1], back=back)
        along.append(np.where(np.isnan(place), along[-1], place))
        valid &= holds
    return [antennas, *reversed(along)], valid
