"""Ask Mitsuba, for every vertex of every part that faces an antenna, which other part stands before it.

Float32 decides visibility only. A line of sight that passes an ellipsoid by more than a hundredth of its semi-axes, or goes
through it deeper than that, needs no ray: no triangle stands out or in as far. What is left lies along outlines, where
triangles decide. A ray is brought to the axes in which the part that it may meet is the unit sphere: the same triangles
for every part, so there is nothing to pose, and each ray starts two radii before what it may meet.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined
from rtradar.trace.clearance import into_ball
from rtradar.trace.outlines import VIEWS, may_hide, outlines
from rtradar.trace.unit_sphere import UnitSphere

_NEAR = 0.01
"""Lines of sight are traced that pass a part, outside or inside of its outline, by less than this share of its semi-axes."""


@inlined(fastmath=True)
def _pass(x, y, z, start, turn, shift, occluder, entry, first, nearest):
    """What a occluder, the unit ball in its own axes, does to the ways to vertices; how many come near its outline.

    ``first`` becomes its number where it certainly hides a vertex, and does so before ``entry``, the share of the way at
    which what hides it was met. ``nearest`` is the share at which the way comes nearest to the occluder's middle, where that
    is near its outline; else -1.
    """
    s0, s1, s2 = start[0], start[1], start[2]
    square = s0 * s0 + s1 * s1 + s2 * s2
    outside, inside = (1 + _NEAR) ** 2, (1 - _NEAR) ** 2
    count = 0
    for vertex in range(len(x)):
        w0 = (
            turn[0, 0] * x[vertex]
            + turn[0, 1] * y[vertex]
            + turn[0, 2] * z[vertex]
            + (shift[0] - s0)
        )
        w1 = (
            turn[1, 0] * x[vertex]
            + turn[1, 1] * y[vertex]
            + turn[1, 2] * z[vertex]
            + (shift[1] - s1)
        )
        w2 = (
            turn[2, 0] * x[vertex]
            + turn[2, 1] * y[vertex]
            + turn[2, 2] * z[vertex]
            + (shift[2] - s2)
        )
        span = w0 * w0 + w1 * w1 + w2 * w2
        back = -(s0 * w0 + s1 * w1 + s2 * w2)
        # Least square of the distance along the way, times its span: no division.
        least = square * span - back * back if back < span else (square - 2 * back + span) * span
        hides, near = least < inside * span, least < outside * span
        met = (back - math.sqrt(max(back * back - span * (square - 1), 0.0))) / span
        before = hides and met < entry[vertex]
        first[vertex] = occluder if before else first[vertex]
        entry[vertex] = met if before else entry[vertex]
        doubt = near and not hides
        nearest[vertex] = min(back / span, 1.0) if doubt else -1.0
        count += doubt
    return count


@inlined(fastmath={"contract"})
def _facing(local, x, y, z, axes, margin, faces, begin):
    """Whether a vertex ``faces`` an antenna, or not away by more than the margin.

    A vertex that faces away is seen through its own part: only what is met before the share ``begin`` of the way, where
    that is met, counts as hiding it.
    """
    s0, s1, s2 = 1 / axes[0] ** 2, 1 / axes[1] ** 2, 1 / axes[2] ** 2
    l0, l1, l2 = local[0], local[1], local[2]
    outside = s0 * l0**2 + s1 * l1**2 + s2 * l2**2 - 1
    for vertex in range(len(x)):
        n0, n1, n2 = s0 * x[vertex], s1 * y[vertex], s2 * z[vertex]
        a0, a1, a2 = l0 - x[vertex], l1 - y[vertex], l2 - z[vertex]
        along = n0 * a0 + n1 * a1 + n2 * a2
        size = (n0 * n0 + n1 * n1 + n2 * n2) * (a0 * a0 + a1 * a1 + a2 * a2)
        span = s0 * a0 * a0 + s1 * a1 * a1 + s2 * a2 * a2
        back = s0 * l0 * a0 + s1 * l1 * a1 + s2 * l2 * a2
        # Vertices stand out a little: from behind the edge some are seen past their own part.
        chord = back * back - span * outside
        met = (back - math.sqrt(max(chord, 0.0))) / span
        faces[vertex] = 0.0 if along < 0 and along * along > margin * margin * size else 1.0
        begin[vertex] = met if along < 0 and chord > 0 else 1.0


@inlined()
def _grown(rays):
    """Twice the room; number by number, as to assign slices takes seconds to compile."""
    rows, columns = rays.shape
    out = np.empty((rows, 2 * columns), dtype=rays.dtype)
    for row in range(rows):
        for column in range(columns):
            out[row, column] = rays[row, column]
    return out


@compiled()
def _choose(antennas, parts, centres, frames, semi_axes, vertices, margin, hidden):
    """Name what certainly hides a vertex, and the rays that have to be followed for others.

    Of each ray: where it starts, which way it goes and how far, in axes in which what it may meet is the unit ball (7,);
    the place in ``hidden`` that it answers for, and what hides it if the ray meets anything (2,).
    """
    every, n_vertices = len(centres), vertices.shape[2]
    turn, shift, start, local, way = (
        np.empty((3, 3)),
        np.empty(3),
        np.empty(3),
        np.empty(3),
        np.empty(3),
    )
    low, high, near, far = (
        np.empty((every, VIEWS)),
        np.empty((every, VIEWS)),
        np.empty(every),
        np.empty(every),
    )
    chosen, occluders = np.empty(n_vertices, dtype=np.int64), np.empty(every, dtype=np.int64)
    faces, begins, begin, places = (
        np.empty(n_vertices),
        np.empty(n_vertices),
        np.empty(n_vertices),
        np.empty((3, n_vertices)),
    )
    rays, whose, count = (
        np.empty((7, 4096), dtype=np.float32),
        np.empty((2, 4096), dtype=np.int64),
        0,
    )
    entry, first, nearest = np.empty(n_vertices), np.empty(n_vertices), np.empty(n_vertices)
    wider = np.empty((every, 3))
    for part in range(every):
        for i in range(3):
            wider[part, i] = semi_axes[part, i] * (1 + _NEAR)
    for a in range(len(antennas)):
        outlines(antennas[a], centres, frames, wider, low, high, near, far)
        for n in range(len(parts)):
            part = parts[n]
            found = 0
            for other in range(every):
                if other != part and may_hide(part, other, low, high, near, far):
                    occluders[found] = other
                    found += 1
            if found == 0:
                continue
            for i in range(3):
                local[i] = 0.0
                for j in range(3):
                    local[i] += frames[part, j, i] * (antennas[a, j] - centres[part, j])
            # Occluder by occluder and coordinate by coordinate: these loops run in vector lanes.
            all_x, all_y, all_z = vertices[part, 0], vertices[part, 1], vertices[part, 2]
            _facing(local, all_x, all_y, all_z, semi_axes[part], margin, faces, begins)
            x, y, z, facing = places[0], places[1], places[2], np.uint64(0)
            for vertex in range(n_vertices):
                # The next one takes its place where this one is not wanted: no branch.
                chosen[facing], begin[facing] = vertex, begins[vertex]
                x[facing], y[facing], z[facing] = all_x[vertex], all_y[vertex], all_z[vertex]
                facing += np.uint64(faces[vertex])
            x, y, z = x[:facing], y[:facing], z[:facing]
            for i in range(facing):
                entry[i], first[i] = math.inf, -1.0
            before, slot = count, (a * len(parts) + n) * n_vertices
            for k in range(found):
                into_ball(
                    part, occluders[k], antennas[a], centres, frames, semi_axes, turn, shift, start
                )
                if (
                    _pass(x, y, z, start, turn, shift, float(occluders[k]), entry, first, nearest)
                    == 0
                ):
                    continue
                for i in range(facing):
                    if nearest[i] < 0 or nearest[i] > begin[i]:
                        continue
                    if count == rays.shape[1]:
                        rays, whose = _grown(rays), _grown(whose)
                    span = 0.0
                    for j in range(3):
                        way[j] = (
                            turn[j, 0] * x[i]
                            + turn[j, 1] * y[i]
                            + turn[j, 2] * z[i]
                            + shift[j]
                            - start[j]
                        )
                        span += way[j] * way[j]
                    distance = math.sqrt(span)
                    ahead = max(nearest[i] - 2 / distance, 0.0)
                    for j in range(3):
                        rays[j, count], rays[3 + j, count] = (
                            start[j] + ahead * way[j],
                            way[j] / distance,
                        )
                    rays[6, count] = (1 - ahead) * distance
                    whose[0, count], whose[1, count] = i, occluders[k]
                    count += 1
            # What certainly hides a vertex needs no rays to what stands behind it.
            kept = before
            for ray in range(before, count):
                i = whose[0, ray]
                for row in range(7):
                    rays[row, kept] = rays[row, ray]
                whose[0, kept], whose[1, kept] = slot + chosen[i], whose[1, ray]
                kept += entry[i] >= begin[i]
            count = kept
            for i in range(facing):
                if entry[i] < begin[i]:
                    hidden[a, n, chosen[i]] = int(first[i])
    return rays[:, :count], whose[:, :count]


class FacetTracer:
    """A body that tells which part hides which vertex.

    Parameters
    ----------
    mi : module
        Mitsuba with its variant set.
    semi_axes : (part, 3) float64
        [m].
    """

    def __init__(self, mi: Any, semi_axes: NDArray[np.float64]) -> None:
        self._semi_axes = np.ascontiguousarray(semi_axes, dtype=np.float64)
        self._sphere = UnitSphere(mi)

    def occluders(
        self,
        centres: NDArray[np.float64],
        frames: NDArray[np.float64],
        antennas: NDArray[np.float64],
        parts: NDArray[np.int64],
        vertices: NDArray[np.float64],
        margin: float,
    ) -> NDArray[np.int16]:
        """Part that stands before each vertex, as each antenna sees it.

        Parameters
        ----------
        centres, frames : (part, 3), (part, 3, 3) float64
            Pose of the body, world [m].
        antennas : (antenna, 3) float64
            World [m].
        parts : (n,) int64
            Which parts are asked about; all parts may hide them.
        vertices : (part, 3, vertex) float64
            Of every part of the body, on its ellipsoid, in its own axes [m].
        margin : float
            Vertices that face away by more than this sine are not asked about.

        Returns
        -------
        (antenna, n, vertex) int16
            Another part that hides it, nearer to the antenna than its own part on the same line; else -1.
        """
        hidden = np.full((len(antennas), len(parts), vertices.shape[2]), -1, dtype=np.int16)
        rays, (slot, occluder) = _choose(
            np.ascontiguousarray(antennas, dtype=np.float64),
            np.ascontiguousarray(parts, dtype=np.int64),
            np.ascontiguousarray(centres, dtype=np.float64),
            np.ascontiguousarray(frames, dtype=np.float64),
            self._semi_axes,
            vertices,
            float(margin),
            hidden,
        )
        met = self._sphere.meets(rays)
        hidden.ravel()[slot[met]] = occluder[met]
        return hidden
