"""Rays along lines of sight past the parts of a body that they come near.

Each ray is in the axes where that part is the unit sphere, and starts two radii before what it may
meet. A part is ruled out only where a line passes outside a ball or an ellipsoid that is a tenth
larger than the part. Whether a ray meets the part itself is for Mitsuba to say. `near_rays` are
those of any lines, `facet_rays` those to the vertices of facets.
"""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.elementary import dot, minus, scaled, turned, turned_back
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.facet_shadows import into_ball

NEAR = 1.1
"""Size of the bounding volumes over that of the parts: lines outside of them have no ray traced."""


@inlined()
def _grown(rays):
    """Return a copy with twice the room, made number by number: slices take seconds to compile."""
    rows, columns = rays.shape
    out = np.empty((rows, 2 * columns), dtype=rays.dtype)
    for row in range(rows):
        for column in range(columns):
            out[row, column] = rays[row, column]
    return out


@compiled()
def near_rays(origins, targets, group, own, pose, centres, maps, longest):
    """Return one ray for each line of sight and each part that this line comes near.

    Lines (line, 3) go from ``origins`` to ``targets`` [m]. Lines of one ``group (line,)`` end on
    the part ``own (group,)``, which cannot occlude them, or on none where it is -1. The body is in
    the pose ``pose (group,)`` then: ``centres (pose, part, 3)``, ``maps (pose, part, 3, 3)`` to the
    axes where a part is the unit sphere, and its ``longest (part,)`` semi-axis [m].

    Returned are rays (7, ray) float32, with the line and the part of each (2, ray). A ray is its
    start, at most two radii before the point nearest to the centre of the unit sphere; its unit
    direction; and its length.
    """
    rays, whose = np.empty((7, 4096), dtype=np.float32), np.empty((2, 4096), dtype=np.int64)
    count = 0
    for line in range(len(group)):
        g, origin = group[line], origins[line]
        way, at = minus(targets[line], origin), pose[g]
        # A line of no length must not divide by zero.
        over_square = 1 / max(dot(way, way), 1e-300)
        for part in range(len(longest)):
            # The bounding ball comes first, because it rules out most parts.
            gap, reach = minus(centres[at, part], origin), NEAR * longest[part]
            aside = minus(gap, scaled(way, dot(gap, way) * over_square))
            if part == own[g] or dot(aside, aside) > reach * reach:
                continue
            m = maps[at, part]
            # The line in the axes where the part is the unit sphere.
            start, along = turned(m, minus(origin, centres[at, part])), turned(m, way)
            span, back = dot(along, along), -dot(start, along)
            # The least squared distance from the centre, times the square of the line's length, so
            # that nothing is divided: it is reached within the line, at its end or at its start.
            square = dot(start, start)
            least = (
                square * span - back * back if back < span else (square - 2 * back + span) * span
            )
            if (least if back > 0 else square * span) > NEAR * NEAR * span:
                continue
            if count == rays.shape[1]:
                rays, whose = _grown(rays), _grown(whose)
            # float32 is too coarse for a far antenna: the ray starts two radii before that point.
            scale = 1 / math.sqrt(span)
            ahead = max(min(1.0, max(0.0, back * scale * scale)) - 2 * scale, 0.0)
            for i in range(3):
                rays[i, count] = start[i] + ahead * along[i]
                rays[3 + i, count] = along[i] * scale
            rays[6, count] = (1 - ahead) * span * scale
            whose[0, count], whose[1, count] = line, part
            count += 1
    return rays[:, :count].copy(), whose[:, :count].copy()


@inlined(fastmath=True)
def _nearest(x, y, z, start, turn, shift, nearest):
    """Fill in where lines of sight come nearest to a part, as fractions; return how many come near.

    In the axes of the lines the part is the unit sphere. ``nearest`` is -1 where the line passes
    outside the bounding volume.
    """
    s0, s1, s2 = start[0], start[1], start[2]
    square = s0 * s0 + s1 * s1 + s2 * s2
    bound = NEAR * NEAR
    count = 0
    for vertex in range(len(x)):
        w0 = turn[0, 0] * x[vertex] + turn[0, 1] * y[vertex] + turn[0, 2] * z[vertex]
        w1 = turn[1, 0] * x[vertex] + turn[1, 1] * y[vertex] + turn[1, 2] * z[vertex]
        w2 = turn[2, 0] * x[vertex] + turn[2, 1] * y[vertex] + turn[2, 2] * z[vertex]
        # From the antenna to the vertex.
        w0, w1, w2 = w0 + (shift[0] - s0), w1 + (shift[1] - s1), w2 + (shift[2] - s2)
        span = w0 * w0 + w1 * w1 + w2 * w2
        back = -(s0 * w0 + s1 * w1 + s2 * w2)
        # The least squared distance from the centre, times the square of the line's length, so that
        # nothing is divided.
        least = square * span - back * back if back < span else (square - 2 * back + span) * span
        near = least < bound * span
        nearest[vertex] = max(min(back / span, 1.0), 0.0) if near else -1.0
        count += near
    return count


@inlined(fastmath={"contract"})
def _facing(local, x, y, z, axes, margin, faces, begin):
    """Fill in whether a vertex ``faces`` an antenna, or faces away by no more than the margin.

    A vertex that faces away is seen through its own part: only what is met before that part, at the
    fraction ``begin`` of the line, occludes it.
    """
    s0, s1, s2 = 1 / axes[0] ** 2, 1 / axes[1] ** 2, 1 / axes[2] ** 2
    l0, l1, l2 = local[0], local[1], local[2]
    # How far the antenna is outside of the part, in the part's own measure.
    outside = s0 * l0**2 + s1 * l1**2 + s2 * l2**2 - 1
    for vertex in range(len(x)):
        # Whether the normal of the surface there is toward the antenna.
        n0, n1, n2 = s0 * x[vertex], s1 * y[vertex], s2 * z[vertex]
        a0, a1, a2 = l0 - x[vertex], l1 - y[vertex], l2 - z[vertex]
        along = n0 * a0 + n1 * a1 + n2 * a2
        size = (n0 * n0 + n1 * n1 + n2 * n2) * (a0 * a0 + a1 * a1 + a2 * a2)
        # Where the line from the antenna enters the vertex's own part.
        span = s0 * a0 * a0 + s1 * a1 * a1 + s2 * a2 * a2
        back = s0 * l0 * a0 + s1 * l1 * a1 + s2 * l2 * a2
        # Vertices stand out of the ellipsoid a little: some behind its edge are seen past it.
        chord = back * back - span * outside
        met = (back - math.sqrt(max(chord, 0.0))) / span
        faces[vertex] = 0.0 if along < 0 and along * along > margin * margin * size else 1.0
        begin[vertex] = met if along < 0 and chord > 0 else 1.0


@inlined()
def _may_stand_before(antenna, part, other, centres, longest):
    """Whether one bounding ball may occlude another: it begins nearer, and their cones overlap."""
    # Both parts as balls, as the antenna sees them.
    a, b = minus(centres[part], antenna), minus(centres[other], antenna)
    to_part, to_other, along = math.sqrt(dot(a, a)), math.sqrt(dot(b, b)), dot(a, b)
    own, its = NEAR * longest[part], NEAR * longest[other]
    # The other part begins behind the end of this one.
    if to_other - its >= to_part + own:
        return False
    # The antenna is in one of the balls: no cone holds it.
    if to_part <= own or to_other <= its:
        return True
    angle = math.acos(min(1.0, max(-1.0, along / (to_part * to_other))))
    return angle < math.asin(own / to_part) + math.asin(its / to_other)


@inlined(fastmath={"contract"})
def _write_rays(lines, axes, out):
    """Write the rays of the ``near`` lines; return the count with those that begin in time."""
    x, y, z, begin, chosen, nearest, near = lines
    turn, shift, start, slot, other = axes
    rays, whose, count = out
    t00, t01, t02 = turn[0, 0], turn[0, 1], turn[0, 2]
    t10, t11, t12 = turn[1, 0], turn[1, 1], turn[1, 2]
    t20, t21, t22 = turn[2, 0], turn[2, 1], turn[2, 2]
    s0, s1, s2 = start[0], start[1], start[2]
    d0, d1, d2 = shift[0] - s0, shift[1] - s1, shift[2] - s2
    place = np.uint64(count)
    for i in near:
        w0 = t00 * x[i] + t01 * y[i] + t02 * z[i] + d0
        w1 = t10 * x[i] + t11 * y[i] + t12 * z[i] + d1
        w2 = t20 * x[i] + t21 * y[i] + t22 * z[i] + d2
        distance = math.sqrt(w0 * w0 + w1 * w1 + w2 * w2)
        inverse = 1 / distance
        # The ray starts two radii before the point that is nearest, and ends where the vertex's own
        # part, or the vertex itself, is met.
        ahead = max(nearest[i] - 2 * inverse, 0.0)
        rays[0, place] = s0 + ahead * w0
        rays[1, place] = s1 + ahead * w1
        rays[2, place] = s2 + ahead * w2
        rays[3, place] = w0 * inverse
        rays[4, place] = w1 * inverse
        rays[5, place] = w2 * inverse
        rays[6, place] = (begin[i] - ahead) * distance
        rays[7, place] = nearest[i]
        whose[0, place], whose[1, place] = slot + chosen[i], other
        # What is met behind the near side of the vertex's own part does not count: a ray that would
        # begin there is overwritten by the next one.
        place += np.uint64(ahead < begin[i])
    return np.int64(place)


@compiled()
def facet_rays(antennas, parts, centres, frames, semi_axes, longest, vertices, first, margin):
    """Return the rays that decide which part occludes which vertex, as `BodyTracer.occluders` asks.

    ``rays (8, ray)`` float32: start, direction and length in axes where the part that it may meet
    is the unit sphere, and the fraction of the line of sight at which it comes nearest to it.
    ``whose (2, ray)``: the place of the vertex in (antenna, vertex), and that part. ``vertices (3,
    vertex)`` are those of all parts; the vertices of each part begin at ``first (part + 1,)``.
    """
    every, most = len(centres), np.diff(first).max()
    turn, shift, start = np.empty((3, 3)), np.empty(3), np.empty(3)
    chosen, places = np.empty(most, dtype=np.int64), np.empty((3, most))
    faces, begins, begin = np.empty(most), np.empty(most), np.empty(most)
    nearest, near = np.empty(most), np.empty(most, dtype=np.int64)
    rays, whose = np.empty((8, 4096), dtype=np.float32), np.empty((2, 4096), dtype=np.int64)
    count = 0
    for a in range(len(antennas)):
        for n in range(len(parts)):
            part = parts[n]
            facing = np.uint64(0)
            checked = False
            own = slice(first[part], first[part + 1])
            all_x, all_y, all_z = vertices[0, own], vertices[1, own], vertices[2, own]
            x, y, z = places[0], places[1], places[2]
            slot = a * vertices.shape[1] + first[part]
            for other in range(every):
                if other == part:
                    continue
                if not _may_stand_before(antennas[a], part, other, centres, longest):
                    continue
                if not checked:
                    # The vertices that face the antenna, once for all parts that may occlude them.
                    checked = True
                    local = turned_back(frames[part], minus(antennas[a], centres[part]))
                    _facing(local, all_x, all_y, all_z, semi_axes[part], margin, faces, begins)
                    for vertex in range(len(all_x)):
                        # A vertex that does not face the antenna is overwritten by the next one,
                        # which needs no branch.
                        chosen[facing], begin[facing] = vertex, begins[vertex]
                        x[facing], y[facing] = all_x[vertex], all_y[vertex]
                        z[facing] = all_z[vertex]
                        facing += np.uint64(faces[vertex])
                x, y, z = places[0][:facing], places[1][:facing], places[2][:facing]
                into_ball(part, other, antennas[a], centres, frames, semi_axes, turn, shift, start)
                if _nearest(x, y, z, start, turn, shift, nearest) == 0:
                    continue
                # Places of the lines that come near, then their rays: a loop without branches.
                close = np.uint64(0)
                for i in range(facing):
                    near[close] = i
                    close += np.uint64(nearest[i] >= 0)
                while count + close > rays.shape[1]:
                    rays, whose = _grown(rays), _grown(whose)
                count = _write_rays(
                    (x, y, z, begin, chosen, nearest, near[:close]),
                    (turn, shift, start, slot, other),
                    (rays, whose, count),
                )
    return rays[:, :count], whose[:, :count]


@compiled()
def first_occluders(met, fraction, whose, occluder):
    """Fill in for each vertex the part that its line of sight is halfway through first.

    Where parts overlap, another of them may be met before. Each of them occludes the vertex, which
    is all that counts but on facets that an edge cuts: there `shade` takes the edge of the part
    that is named, where the edge of all together may lie up to a facet beside it.
    """
    first = np.full(len(occluder), np.inf, dtype=np.float32)
    for ray in range(len(met)):
        vertex = whose[0, ray]
        if met[ray] and fraction[ray] < first[vertex]:
            first[vertex], occluder[vertex] = fraction[ray], whose[1, ray]
