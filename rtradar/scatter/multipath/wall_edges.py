"""Edges of walls and openings: what a face of finite extent leaves of a wave.

Physical optics sums over the face what each of its points sends on. About the specular point that
sum is a product of two Fresnel integrals, one for each direction along the rectangle, between its
edges (Born and Wolf, Principles of Optics, section 8.7). Each edge counts by the detour, which is
how much longer the path over the edge is: this is exact for a straight edge alone, at any
incidence. By Babinet's principle a wave goes past a wall with 1 minus what its face would send on,
and an opening takes its own part from its wall.

An edge that lies on another wall is not free: there the face goes on in the image of the other
wall, and ends as the image method has it. What comes over an edge with a delay beyond the range
resolution of the sweep shows elsewhere, and weakly: it is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fresnel

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.multipath.image_paths import (
    Face,
    Leg,
    SolidFace,
    corners,
    height,
    image,
    image_chain,
    inside,
)
from rtradar.scene import Wall

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Bools = NDArray[np.bool_]

_TOUCHES_M = 1e-3
"""Distance up to which an edge lies on a wall [m]."""
_PLACES = np.linspace(0.01, 0.99, 9)
"""Places along an edge, as fractions of it: it is free if one of them is."""


class Sides(NamedTuple):
    """A rectangle on a face: ``ends (2, 2)`` along each edge [m], and which of these are free."""

    ends: Array
    free: Bools


@dataclass(frozen=True, eq=False)
class WallEdges:
    """The walls of a room, and faces of furniture, with their edges, for the sweep of a radar.

    Edges count at the wavelength in the middle of the sweep, ``wavelength_m``; its range resolution
    ``resolution_m`` is c / B, of the whole path.
    """

    walls: Sequence[Wall]
    wavelength_m: float
    resolution_m: float
    faces: Sequence[Face] = ()

    @cached_property
    def surfaces(self) -> tuple[Wall, ...]:
        """The walls, then the faces."""
        return *self.walls, *(face.wall for face in self.faces)

    @classmethod
    @lru_cache(maxsize=8)
    def of(cls, walls: tuple[Wall, ...], radar: Radar, faces: tuple[Face, ...] = ()) -> WallEdges:
        """Make the edges for the sweep of a radar."""
        light = SPEED_OF_LIGHT_MPS
        return cls(walls, light / radar.centre_frequency_hz, light / radar.bandwidth_hz, faces)

    @cached_property
    def _sides(self) -> tuple[tuple[Sides, ...], ...]:
        """The rectangle of each wall, then its openings; the patches of each face."""
        return tuple(
            tuple(Sides(ends, _free(wall, ends, self.walls)) for ends in _rectangles(wall))
            for wall in self.surfaces
        )

    def leg(
        self, leg: Leg, antennas: Array, points: Array, margin_m: float = 0.0
    ) -> tuple[list[Array], Field]:
        """Find where a leg runs, and what the extents of its faces leave of its wave.

        Returned are the corners of `rtradar.scatter.multipath.image_paths.corners`, where places of
        reflection may also lie beside their rectangles, and the factor (...) for the field, 0 where
        there is no such leg. The margin [m] moves the edges that are not free.
        """
        # The leg as if its faces were endless; each face then weights it by its own extent.
        along, valid = corners(leg, antennas, points, margin_m, beside_m=np.inf)
        weight = valid.astype(np.complex128)
        sources = np.broadcast_arrays(*image_chain(leg, antennas), points)[1:-1]
        ends = np.broadcast_to(points, along[0].shape)
        # Each face is passed by the straight line from the image before it to the far end, which is
        # mirrored in turn.
        for face, source in zip(reversed(leg), reversed(sources), strict=True):
            number = self.surfaces.index(face.wall)
            weight[valid] *= self.weight(
                number, source[valid], ends[valid], back=face.back, margin_m=margin_m
            )
            ends = image(face.wall, ends, back=face.back)
        return along, weight

    def crossed(self, origins: Array, targets: Array) -> list[int]:
        """Return the walls whose middle planes any of some straight legs cross.

        The ends (..., 3) [m] broadcast against each other. Most legs in a room cross none.
        """
        # A leg crosses a wall if its ends are on different sides of the middle plane.
        sides = [np.asarray(ends) @ self._normals.T - self._middles for ends in (origins, targets)]
        across = sides[0] * sides[1] < 0
        return np.flatnonzero(across.any(axis=tuple(range(across.ndim - 1)))).tolist()

    @cached_property
    def _normals(self) -> Array:
        return np.array([wall.normal for wall in self.walls]).reshape(-1, 3)

    @cached_property
    def _middles(self) -> Array:
        """Places of the middle planes of all walls along their normals [m]."""
        corners = np.array([wall.corner_m for wall in self.walls]).reshape(-1, 3)
        deep = np.array([wall.thickness_m for wall in self.walls]) / 2
        return np.asarray((corners * self._normals).sum(axis=1) - deep)

    def passage(self, number: int, origins: Array, targets: Array) -> tuple[Bools, Field]:
        """Tell which straight legs pass through a wall, and how much of each.

        The ends (..., 3) [m] of those that do are on different sides of the slab's middle plane, so
        a leg that ends on a face does not cross it. Returned are which legs pass (...), and the
        factor (crossing,) of what meets the wall; the rest goes past it, or through its openings.
        """
        wall = self.walls[number]
        origins, targets = np.broadcast_arrays(origins, targets)
        half = wall.thickness_m / 2
        across = (height(wall, origins) + half) * (height(wall, targets) + half) < 0
        if not across.any():
            return across, np.zeros(0, dtype=np.complex128)
        # Extents count where legs pass the front: the fronts of a room meet, but the middles of its
        # slabs do not.
        met = self.weight(number, origins[across], targets[across])
        across[across] = met != 0
        return across, met[met != 0]

    def weight(
        self,
        number: int,
        sources: Array,
        targets: Array,
        *,
        back: bool = False,
        margin_m: float = 0.0,
    ) -> Field:
        """Compute the fraction of a wave that a face sends on, an endless one being 1, (leg,).

        The straight legs from sources to targets (leg, 3) [m] cross the plane of the front, or of
        the back; in a reflection sources are images.
        """
        wall = self.surfaces[number]
        # An opening takes its own part from that of its wall; patches of a face add up.
        source, target = (_on_face(wall, points, back) for points in (sources, targets))
        parts = [self._between(sides, source, target, margin_m) for sides in self._sides[number]]
        if isinstance(wall, SolidFace):
            return np.asarray(wall.fraction * sum(parts))
        return np.asarray(parts[0] - sum(parts[1:]))

    def _between(self, sides: Sides, source: Array, target: Array, margin_m: float) -> Field:
        """Do as `weight` for one rectangle; source and target (3, leg) are in the face's axes."""
        # Where the straight leg meets the plane of the face.
        gap = source[2] - target[2]
        fraction = source[2] / np.where(gap == 0, 1.0, gap)
        places = source[:2] + fraction * (target[:2] - source[:2])
        whole = np.ones(source.shape[1], dtype=np.complex128)
        # The product of the two directions; along each it is the sum over both edges, less 1.
        for axis, (ends, free) in enumerate(zip(sides.ends, sides.free, strict=True)):
            part = np.full(whole.shape, -1.0 + 0j)
            for side, end, soft in zip((1, -1), ends, free, strict=True):
                depth = side * (places[axis] - end)
                if soft:
                    detour = _detour(source, target, axis, end)
                    part += self._past_edge(depth, detour)
                else:
                    part += depth >= -margin_m
            whole *= part
        return whole

    def _past_edge(self, depth: Array, detour: Array) -> Field:
        """Field of a half plane over that of a whole one, by the depth of the leg within it [m]."""
        out = (depth >= 0).astype(np.complex128)
        # Over the sweep, the wave of an edge turns against the straight one: its mean stays.
        near = detour < self.resolution_m
        # A detour over the range resolution shows elsewhere: there the edge counts as sharp.
        longer, lit = detour[near], out[near]
        number = np.copysign(2 * np.sqrt(longer / self.wavelength_m), depth[near])
        out[near] += (half_plane(number) - lit) * np.sinc(longer / self.resolution_m)
        return out


def half_plane(number: Array) -> Field:
    """Field of a half plane over that of a whole one, by the Fresnel number of its edge.

    It is positive on the lit side. Equation :eq:`wall-edge` of the theory page.
    """
    sine, cosine = fresnel(number)
    return np.asarray(0.5 + (1 + 1j) / 2 * (cosine - 1j * sine))


def _detour(source: Array, target: Array, axis: int, end: float) -> Array:
    """How much longer the shortest way over the line of an edge is than the straight leg [m]."""
    # The distances of both ends from the line of the edge. Unfolded about that line, the shortest
    # path over it is straight.
    one, other = (np.stack([place[axis] - end, place[2]]) for place in (source, target))
    first, last = np.hypot(*one), np.hypot(*other)
    over = np.hypot(first + last, source[1 - axis] - target[1 - axis])
    straight = np.sqrt(((source - target) ** 2).sum(axis=0))
    # The difference of both squares over their sum, which keeps its digits.
    more = 2 * np.maximum(first * last + (one * other).sum(axis=0), 0.0)
    total = over + straight
    return np.asarray(more / np.where(total > 0, total, 1.0))


def _on_face(wall: Wall, points: Array, back: bool) -> Array:
    """Places along both edges of a face, and heights above its plane, (3, point) [m]."""
    corner = np.array(wall.corner_m) - (wall.thickness_m if back else 0.0) * wall.normal
    return np.asarray(_axes(wall) @ (points - corner).T)


def _axes(wall: Wall) -> Array:
    edges = [np.array(edge) / np.linalg.norm(edge) for edge in (wall.edge_u_m, wall.edge_v_m)]
    return np.stack([*edges, wall.normal])


def _rectangles(wall: Wall) -> list[Array]:
    """Ends of a wall along its edges, and those of its openings, (2, 2) each [m]."""
    of_wall = (0.0, 0.0, *wall.size_m), *wall.openings
    own = wall.patches if isinstance(wall, SolidFace) else of_wall
    return [np.array([[u, u + a], [v, v + b]]) for u, v, a, b in own]


def _free(wall: Wall, ends: Array, walls: Sequence[Wall]) -> Bools:
    """Which edges of a rectangle do not lie on another wall, (2, 2)."""
    along_u, along_v, _ = _axes(wall)
    # An edge is free if some place along it lies on no other wall.
    free = np.empty((2, 2), dtype=bool)
    for axis, side in np.ndindex(2, 2):
        across = ends[1 - axis, 0] + _PLACES * np.ptp(ends[1 - axis])
        fixed = np.full_like(across, ends[axis, side])
        u, v = (fixed, across) if axis == 0 else (across, fixed)
        points = np.array(wall.corner_m) + u[:, None] * along_u + v[:, None] * along_v
        held = np.zeros(len(points), dtype=bool)
        for other in walls:
            if other is not wall:
                held |= touches(other, points)
        free[axis, side] = not held.all()
    return free


def touches(wall: Wall, points: Array) -> Bools:
    """Tell whether points (point, 3) [m] lie on a wall or inside it."""
    above = height(wall, points)
    near = (above <= _TOUCHES_M) & (above >= -wall.thickness_m - _TOUCHES_M)
    return near & inside(wall, points, _TOUCHES_M)
