"""Edges of furniture and of moving objects: what these solids leave of a wave that passes them.

Seen along a leg, a solid is an outline. By Kirchhoff's integral over what the solid leaves free,
two waves pass it: the straight wave, where Mitsuba finds the leg free, and a wave from every piece
of the outline (the boundary wave of Maggi and Rubinowicz). A straight piece that is long against
the Fresnel zone sends what the edge of a wall does, a Fresnel integral of the detour over it
(`wall_edges`). A shorter piece sends a part of that, and two pieces at a right angle together send
the product of two Fresnel integrals.

A piece belongs to the outline of all solids together if a line just outside of it, parallel to the
leg, is free. Where a solid stands on a wall its outline goes on in the image behind it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.scatter.rooms import EdgeBalls, outline_near
from rtradar.radar import Radar
from rtradar.scatter.multipath.wall_edges import half_plane, touches
from rtradar.scene import Scene, Triangles, Wall
from rtradar.trace.occluders import Occluders
from rtradar.trace.rays import ball_around

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Bools = NDArray[np.bool_]
Indices = NDArray[np.int64]

_AT_ONCE = 1 << 16
"""Pieces of outlines that are looked at at once."""
_OUTSIDE_M = 1e-3
"""How far outside of the outline a line is asked whether it is free [m]."""
_ON_EDGE_M = 1e-4
"""Distance from an edge up to which it is Mitsuba that says on which side a leg is [m]."""
_FAR_RAD = 10.0
"""Phase along an edge from which its far end counts by the first terms of a series [rad]."""
_NODES, _WEIGHTS = (0.5 * own for own in np.polynomial.legendre.leggauss(10))


class _Edges(NamedTuple):
    """Edges of a mesh, with balls around all of them and around each.

    ``ends (edge, 2, 3)`` [m] are in the order in which the first of the two faces there runs
    anticlockwise. Where there is one face only, the second is its back.
    """

    ends: Array
    balls: EdgeBalls

    @classmethod
    def of(cls, mesh: Triangles, walls: Sequence[Wall] = ()) -> _Edges:
        """List the edges of a mesh without those that lie on a wall."""
        ends, normals = _of_faces(mesh)
        free = np.ones(len(ends), dtype=bool)
        # An edge on a wall is no edge of the outline. One that ends on a wall goes on in the image
        # behind it, as long again.
        for wall in walls:
            on_wall = touches(wall, ends.reshape(-1, 3)).reshape(-1, 2)
            free &= ~on_wall.all(axis=1)
            behind = on_wall & ~on_wall[:, ::-1]
            ends = np.where(behind[..., None], 2 * ends - ends[:, ::-1], ends)
        ends, normals = ends[free], normals[free]
        centre, radius = ball_around(mesh.vertices if not free.any() else ends.reshape(-1, 3))
        radii = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / 2
        return cls(ends, EdgeBalls(centre, radius, ends.mean(axis=1), radii, normals))


def _of_faces(mesh: Triangles) -> tuple[Array, Array]:
    """Ends of the edges (edge, 2, 3), and the normals of both faces at each (edge, 2, 3)."""
    corners, sides = np.asarray(mesh.faces, dtype=np.int64), mesh.corners
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    # Each side of each face, sorted so that the two faces of an edge are neighbours.
    every = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    order = np.lexsort(np.sort(every, axis=1).T)
    every, face = every[order], order // 3
    key = np.sort(every, axis=1)
    # Sides with the same corners are taken in pairs; one that is left over has a single face.
    new = np.append(True, (key[1:] != key[:-1]).any(axis=1))
    turn = np.arange(len(every)) - np.flatnonzero(new)[np.cumsum(new) - 1]
    first = np.flatnonzero(turn % 2 == 0)
    second = np.minimum(first + 1, len(every) - 1)
    alone = np.append(new, True)[first + 1]
    # A second face that goes along the edge as the first does is seen from behind.
    flips = alone | (every[second, 0] == every[first, 0])
    other = np.where(alone, face[first], face[second])
    both = np.stack([normals[face[first]], np.where(flips, -1, 1)[:, None] * normals[other]], 1)
    return mesh.vertices[every[first]], both


class _Pieces(NamedTuple):
    """Pieces of outlines near legs, each beside the ``leg (piece,)`` that it belongs to.

    In the plane across the leg, ``depth (piece,)`` is how far the line of the piece is from the
    leg, negative where the leg runs outside of the solid [m], and ``along (piece, 2)`` are both
    ends on that line, from the point nearest to the leg [m]. ``detour`` is the least detour over
    the piece [m], and ``bend`` is the detour over the square of its distance from the leg [1/m].
    ``beside (piece, 3)`` goes from the leg to just outside of the piece [m].
    """

    leg: Indices
    depth: Array
    along: Array
    detour: Array
    bend: Array
    beside: Array

    def take(self, which: Bools) -> _Pieces:
        """Return some of them."""
        return _Pieces(self.leg[which], *(own[which] for own in self[1:]))


class SolidEdges:
    """Furniture and moving objects of a scene with their edges, for the sweep of a radar.

    ``room`` tells what is in the way. Edges count at the middle of the sweep, as those of walls do.
    """

    def __init__(self, room: Occluders, scene: Scene, radar: Radar) -> None:
        self._room = room
        self._number = 2 * np.pi * radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS
        self._resolution_m = SPEED_OF_LIGHT_MPS / radar.bandwidth_hz
        self._still = [_Edges.of(piece.triangles(), scene.walls) for piece in scene.furniture]
        self._moving = [(moving, _Edges.of(moving.shape)) for moving in scene.objects]

    def left(self, origins: Array, targets: Array, times: Array, *, bent: bool = True) -> Field:
        """Compute what solids leave of straight waves from origins to targets (leg, 3) [m], (leg,).

        Objects are where they are at the ``times (leg,)`` [s]. Waves that are not ``bent`` go
        straight on or not at all.
        """
        if len(origins) == 0:
            return np.zeros(0, dtype=np.complex128)
        # The straight wave is there where the leg is free; edges then add what they send.
        lit = self._room.clear(origins, targets, times)
        field = lit.astype(np.complex128)
        if not bent:
            return field
        for edges in self._still:
            self._add(field, lit, edges, origins, targets, times)
        if self._moving:
            # The pose of an object is computed once for each instant.
            moments, moment = np.unique(times, return_inverse=True)
            for moving, edges in self._moving:
                pose = tuple(own[moment] for own in moving.pose(moments))
                self._add(field, lit, edges, origins, targets, times, pose)
        return field

    def _add(
        self,
        field: Field,
        lit: Bools,
        edges: _Edges,
        origins: Array,
        targets: Array,
        times: Array,
        pose: tuple[Array, ...] | None = None,
    ) -> None:
        """Add what the edges of one solid send; its ``pose`` has rotations and places by leg."""
        # In the axes of the solid, where its edges stand still.
        starts, stops = origins, targets
        if pose is not None:
            turned, place = pose
            starts, stops = (
                np.einsum("ri,rij->rj", points - place, turned) for points in (origins, targets)
            )
        ways = stops - starts
        # Only edges on the outline, and near enough to matter.
        near = outline_near(starts, ways, self._resolution_m, edges.balls)
        for first in range(0, near.shape[1], _AT_ONCE):
            leg, edge = near[:, first : first + _AT_ONCE]
            found = self._pieces(edges, starts[leg], ways[leg], leg, edge)
            leg, beside = found.leg, found.beside
            if pose is not None:
                beside = np.einsum("rij,rj->ri", pose[0][leg], beside)
            # A piece counts only if a line just outside of it is free of all solids.
            free = self._room.clear(origins[leg] + beside, targets[leg] + beside, times[leg])
            leg = leg[free]
            np.add.at(field, leg, self._sent(found.take(free), lit[leg]))

    def _pieces(
        self, edges: _Edges, origins: Array, way: Array, leg: Indices, edge: Indices
    ) -> _Pieces:
        """Find the pieces of outlines, by leg, with detours that are less than the resolution."""
        # Whether the first face at the edge looks along the leg, which settles the side of the
        # solid.
        away = np.einsum("pj,pj->p", edges.balls.normals[edge, 0], way) > 0
        length = np.linalg.norm(way, axis=1)
        way = way / length[:, None]
        ends = edges.ends[edge] - origins[:, None]
        # Cut the edges to what lies between both ends of the leg.
        heights = np.einsum("pej,pj->pe", ends, way)
        rise = heights[:, 1] - heights[:, 0]
        rise = np.where(rise == 0, 1e-300, rise)[:, None]
        cuts = np.sort(-heights[:, :1] / rise + np.stack([0 * length, length], 1) / rise, axis=1)
        cuts = np.clip(cuts, 0.0, 1.0)
        ends = ends[:, :1] + cuts[..., None] * (ends[:, 1:] - ends[:, :1])
        heights = np.einsum("pej,pj->pe", ends, way)
        # From here on in the plane across the leg: the direction of the piece, and that out of the
        # solid.
        ends -= heights[..., None] * way[:, None]
        sides = ends[:, 1] - ends[:, 0]
        wide = np.linalg.norm(sides, axis=1)
        sides /= np.where(wide > 0, wide, 1.0)[:, None]
        out = np.cross(way, sides) * np.where(away, -1.0, 1.0)[:, None]
        depth = np.einsum("pj,pj->p", ends[:, 0], out)
        along = np.einsum("pej,pj->pe", ends, sides)
        # The point of the piece that is nearest to the leg, and how far along the leg that is.
        nearest = np.clip(0.0, along[:, 0], along[:, 1])
        part = (nearest - along[:, 0]) / np.where(wide > 0, wide, 1.0)
        first = heights[:, 0] + part * (heights[:, 1] - heights[:, 0])
        # Both legs grow by square / (sqrt(r^2 + square) + r), without the loss of digits of a
        # difference.
        square = depth**2 + nearest**2
        bend = sum(
            1 / np.maximum(np.sqrt(one**2 + square) + one, 1e-12)
            for one in (first, np.maximum(length - first, 0.0))
        )
        # The line that is asked about is a little outside of the piece, and not just at one of its
        # ends.
        inner = np.minimum(_OUTSIDE_M, wide / 2)
        beside = (depth + _OUTSIDE_M)[:, None] * out
        beside += np.clip(nearest, along[:, 0] + inner, along[:, 1] - inner)[:, None] * sides
        found = _Pieces(leg, depth, along, square * bend, np.asarray(bend), beside)
        # Beside an end of the leg, rounding would settle which pieces are between both ends.
        between = (first > _OUTSIDE_M) & (first < length - _OUTSIDE_M)
        return found.take(between & (found.detour < self._resolution_m) & (wide > 0))

    def _sent(self, pieces: _Pieces, lit: Bools) -> Field:
        """Field that each piece sends over that of the straight wave, (piece,)."""
        # Lengths across the leg in units in which their squares are phases.
        scale = np.sqrt(self._number * pieces.bend)
        size = np.abs(pieces.depth) * scale
        start, stop = (pieces.along * scale[:, None]).T
        # On the edge itself rounding would settle the side: there the side is what Mitsuba found.
        on_edge = (np.abs(pieces.depth) < _ON_EDGE_M) & (start <= 0) & (stop >= 0)
        side = np.where(on_edge, np.where(lit, -1.0, 1.0), np.sign(pieces.depth))
        # Over the sweep, the wave of an edge turns against the straight one: its mean stays.
        kept = np.sinc(pieces.detour / self._resolution_m)
        return np.asarray(side * kept * (_wedge(size, stop) - _wedge(size, start)))


def _wedge(depth: Array, along: Array) -> Field:
    """Wave from part of a straight edge, from its point nearest to the leg to a place ``along`` it.

    Squares of both lengths (piece,), which are those across the leg, are the phases of the detours.
    Equation :eq:`solid-edge` of the theory page.
    """
    # Where the place is farther along the edge than the edge is from the leg, both lengths change
    # places: the two waves together are the product of Fresnel integrals at a right angle.
    size = np.abs(along)
    long, short = np.maximum(depth, size), np.minimum(depth, size)
    field = _narrow_wedge(long, short)
    whole = [half_plane(-np.sqrt(2 / np.pi) * own) for own in (depth, size)]
    other = whole[0] / 2 + whole[1] / 2 - whole[0] * whole[1] - field
    return np.asarray(np.sign(along) * np.where(size > depth, other, field))


def _narrow_wedge(depth: Array, along: Array) -> Field:
    """The same where the place is no further along the edge than the edge is from the leg."""
    field = np.empty(len(depth), dtype=np.complex128)
    slope = along / np.where(depth > 0, depth, 1.0)
    # Near by, Gauss's quadrature; far away, the whole half plane less the tail of the integral as a
    # series.
    close = along**2 < _FAR_RAD
    x, a = depth[close, None], slope[close, None]
    t = a * (_NODES + 0.5)
    field[close] = (np.exp(-1j * x**2 * (1 + t**2)) / (1 + t**2) * a) @ _WEIGHTS
    x, a = depth[~close], slope[~close]
    phase = 2j * x**2 * a
    more = 1 - (1 / a + 2 * a / (1 + a**2)) / phase
    beyond = np.exp(-1j * x**2 * (1 + a**2)) / ((1 + a**2) * phase) * more
    field[~close] = np.pi * half_plane(-np.sqrt(2 / np.pi) * x) - beyond
    return field / (2 * np.pi)
