"""Ask Mitsuba, for every vertex of every part that faces an antenna, which other part stands before it.

Float32 decides visibility only. Each line of sight is brought to the axes in which the part that it may meet is the unit sphere,
so there is nothing to pose, and each ray starts two radii before what it may meet. Lines that pass outside a volume a tenth
larger than the part have no ray traced.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.facet_shadows import into_ball
from rtradar.kernels.scatter.near_rays import NEAR
from rtradar.trace.body_tracer import UnitSphere


@inlined(fastmath=True)
def _nearest(x, y, z, start, turn, shift, nearest):
    """Where the lines of sight to vertices come nearest to a part, as a fraction of the line; how many come near it.

    The part is the unit sphere in its own axes. ``nearest`` is -1 where the line passes outside the bounding volume.
    """
    s0, s1, s2 = start[0], start[1], start[2]
    square = s0 * s0 + s1 * s1 + s2 * s2
    bound = NEAR * NEAR
    count = 0
    for vertex in range(len(x)):
        w0 = turn[0, 0] * x[vertex] + turn[0, 1] * y[vertex] + turn[0, 2] * z[vertex]
        w1 = turn[1, 0] * x[vertex] + turn[1, 1] * y[vertex] + turn[1, 2] * z[vertex]
        w2 = turn[2, 0] * x[vertex] + turn[2, 1] * y[vertex] + turn[2, 2] * z[vertex]
        w0, w1, w2 = w0 + (shift[0] - s0), w1 + (shift[1] - s1), w2 + (shift[2] - s2)
        span = w0 * w0 + w1 * w1 + w2 * w2
        back = -(s0 * w0 + s1 * w1 + s2 * w2)
        # Least square of the distance along the line, times its span: no division.
        least = square * span - back * back if back < span else (square - 2 * back + span) * span
        near = least < bound * span
        nearest[vertex] = max(min(back / span, 1.0), 0.0) if near else -1.0
        count += near
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


@inlined()
def _may_stand_before(antenna, part, other, centres, longest):
    """Whether the bounding ball of a part may occlude that of another: it begins nearer, and their cones overlap."""
    to_part, to_other, along = 0.0, 0.0, 0.0
    for i in range(3):
        a, b = centres[part, i] - antenna[i], centres[other, i] - antenna[i]
        to_part += a * a
        to_other += b * b
        along += a * b
    to_part, to_other = math.sqrt(to_part), math.sqrt(to_other)
    own, its = NEAR * longest[part], NEAR * longest[other]
    if to_other - its >= to_part + own:
        return False
    if to_part <= own or to_other <= its:
        return True
    angle = math.acos(min(1.0, max(-1.0, along / (to_part * to_other))))
    return angle < math.asin(own / to_part) + math.asin(its / to_other)


@compiled()
def _rays(antennas, parts, centres, frames, semi_axes, vertices, margin):
    """Return the rays that decide which part occludes which vertex.

    Of each ray: start, direction and length in axes where the part that it may meet is the unit sphere (7,); place of the vertex
    in (antenna, n, vertex), and the part (2,); and where on the line of sight it comes nearest to that part.
    """
    every, n_vertices = len(centres), vertices.shape[2]
    turn, shift, start, local = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3)
    way, longest = np.empty(3), np.zeros(every)
    for part in range(every):
        for i in range(3):
            longest[part] = max(longest[part], semi_axes[part, i])
    chosen, places = np.empty(n_vertices, dtype=np.int64), np.empty((3, n_vertices))
    faces, begins, begin = np.empty(n_vertices), np.empty(n_vertices), np.empty(n_vertices)
    nearest = np.empty(n_vertices)
    rays, whose, count = (
        np.empty((8, 4096), dtype=np.float32),
        np.empty((2, 4096), dtype=np.int64),
        0,
    )
    for a in range(len(antennas)):
        for n in range(len(parts)):
            part = parts[n]
            facing = np.uint64(0)
            looked_at = False
            all_x, all_y, all_z = vertices[part, 0], vertices[part, 1], vertices[part, 2]
            x, y, z = places[0], places[1], places[2]
            slot = (a * len(parts) + n) * n_vertices
            for other in range(every):
                if other == part:
                    continue
                if not _may_stand_before(antennas[a], part, other, centres, longest):
                    continue
                if not looked_at:
                    # The vertices that face the antenna, once for all parts that may occlude them.
                    looked_at = True
                    for i in range(3):
                        local[i] = 0.0
                        for j in range(3):
                            local[i] += frames[part, j, i] * (antennas[a, j] - centres[part, j])
                    _facing(local, all_x, all_y, all_z, semi_axes[part], margin, faces, begins)
                    for vertex in range(n_vertices):
                        # The next one takes its place where this one is not wanted: no branch.
                        chosen[facing], begin[facing] = vertex, begins[vertex]
                        x[facing], y[facing] = all_x[vertex], all_y[vertex]
                        z[facing] = all_z[vertex]
                        facing += np.uint64(faces[vertex])
                x, y, z = places[0][:facing], places[1][:facing], places[2][:facing]
                into_ball(part, other, antennas[a], centres, frames, semi_axes, turn, shift, start)
                if _nearest(x, y, z, start, turn, shift, nearest) == 0:
                    continue
                for i in range(facing):
                    if nearest[i] < 0:
                        continue
                    if count == rays.shape[1]:
                        rays, whose = _grown(rays), _grown(whose)
                    span = 0.0
                    for j in range(3):
                        way[j] = turn[j, 0] * x[i] + turn[j, 1] * y[i] + turn[j, 2] * z[i]
                        way[j] += shift[j] - start[j]
                        span += way[j] * way[j]
                    distance = math.sqrt(span)
                    ahead = max(nearest[i] - 2 / distance, 0.0)
                    # What is met behind the near side of the vertex's own part does not count.
                    if ahead >= begin[i]:
                        continue
                    for j in range(3):
                        rays[j, count] = start[j] + ahead * way[j]
                        rays[3 + j, count] = way[j] / distance
                    rays[6, count] = (begin[i] - ahead) * distance
                    rays[7, count] = nearest[i]
                    whose[0, count], whose[1, count] = slot + chosen[i], other
                    count += 1
    return rays[:, :count], whose[:, :count]


@compiled()
def _settle(met, fraction, whose, occluder):
    """Name of each vertex the part that is met first, by where its rays come nearest to the parts that they meet."""
    first = np.full(len(occluder), np.inf, dtype=np.float32)
    for ray in range(len(met)):
        vertex = whose[0, ray]
        if met[ray] and fraction[ray] < first[vertex]:
            first[vertex], occluder[vertex] = fraction[ray], whose[1, ray]


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
        rays, whose = _rays(
            np.ascontiguousarray(antennas, dtype=np.float64),
            np.ascontiguousarray(parts, dtype=np.int64),
            np.ascontiguousarray(centres, dtype=np.float64),
            np.ascontiguousarray(frames, dtype=np.float64),
            self._semi_axes,
            vertices,
            float(margin),
        )
        _settle(self._sphere.meets(rays[:7]), rays[7], whose, hidden.ravel())
        return hidden
