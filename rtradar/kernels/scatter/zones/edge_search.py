"""Where an edge is expected on the side of a cell of Fresnel zones: a closed form, in float64.

It only says where rays are worth tracing. Whether a line of sight is clear is for Mitsuba to say.
"""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.elementary import apply, dot, subtract
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.near_rays import longest_axes, unit_sphere_maps
from rtradar.kernels.scatter.zones.fresnel_zones import zone_point


@inlined()
def _meets_sphere(start, way):
    """Whether the line from ``start`` to ``start + way`` (3,) comes within 1 of the origin."""
    span, back, square = dot(way, way), -dot(start, way), dot(start, start)
    if back <= 0:
        return square < 1
    if back >= span:
        return square - 2 * back + span < 1
    return square * span - back * back < span


@inlined()
def _candidates(origin, target, far, own, centres, longest, found):
    """Fill in the parts whose balls the lines from an antenna to within ``far`` of a point meet."""
    way, gap, count = np.empty(3), np.empty(3), 0
    subtract(target, origin, way)
    span = dot(way, way)
    for part in range(len(longest)):
        if part != own:
            subtract(centres[part], origin, gap)
            fraction = min(1.0, max(0.0, dot(gap, way) / span))
            for i in range(3):
                gap[i] -= fraction * way[i]
            if dot(gap, gap) < (longest[part] + far) ** 2:
                found[count] = part
                count += 1
    return count


@compiled()
def expected_edges(
    maps, zone, start, way, origins, own, pose, centres, frames, semi_axes, bisections, out
):
    """Fill in on which of 2^bisections equal pieces of each side the edge is expected, (side,).

    Sides go from ``start`` by ``way (side, 2)`` in the plane of rho of their ``zone (side,)``, from
    the open end to the blocked one, as the antennas at ``origins (side, 3)`` [m] see them. Zones
    are on the part ``own (zone,)``, which does not occlude itself, in the pose ``pose (zone,)`` of
    a body: ``centres (pose, part, 3)``, ``frames (pose, part, 3, 3)``, ``semi_axes (part, 3)`` [m].
    """
    parts, longest = len(semi_axes), longest_axes(semi_axes)
    to_spheres = unit_sphere_maps(frames, semi_axes)
    u, point, end, line, gap = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    eyes, way_there, near = np.empty((parts, 3)), np.empty(3), np.empty(parts, dtype=np.int64)
    for side in range(len(zone)):
        z, origin = zone[side], origins[side]
        x, y, dx, dy = start[side, 0], start[side, 1], way[side, 0], way[side, 1]
        body, there = centres[pose[z]], to_spheres[pose[z]]
        zone_point(maps, z, x, y, u, point)
        zone_point(maps, z, x + dx, y + dy, u, end)
        subtract(end, point, gap)
        count = _candidates(origin, point, math.sqrt(dot(gap, gap)), own[z], body, longest, near)
        for n in range(count):
            subtract(origin, body[near[n]], gap)
            apply(there[near[n]], gap, eyes[n])
        low, step = 0, 1 << bisections
        for _ in range(bisections):
            step >>= 1
            fraction = (low + step) / (1 << bisections)
            zone_point(maps, z, x + fraction * dx, y + fraction * dy, u, point)
            subtract(point, origin, line)
            blocked = False
            for n in range(count):
                apply(there[near[n]], line, way_there)
                if _meets_sphere(eyes[n], way_there):
                    blocked = True
                    break
            if not blocked:
                low += step
        out[side] = low
