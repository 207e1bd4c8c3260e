"""Poses of a skeleton, from splines of its root and its bones, and of the ellipsoids on it."""

from __future__ import annotations

import math

from rtradar.kernels.elementary import cross, scaled
from rtradar.kernels.jit import compiled, inlined


@inlined(fastmath={"contract"})
def _fill_cubics(t, powers, interval, out):
    # Horner's scheme.
    a, b, c, d = powers[0, interval], powers[1, interval], powers[2, interval], powers[3, interval]
    for i in range(len(out)):
        out[i] = d[i] + t * (c[i] + t * (b[i] + t * a[i]))


@compiled(fastmath={"contract"})
def pose(times, which, knots, root, rotation, offsets, parents, positions, quaternions):
    """Fill positions (time, joint, 3) and quaternions (time, joint * 4) at ``times[which]``.

    ``knots (knot,)`` are equally far apart; ``root (power, interval, 3)`` and ``rotation (power,
    interval, joint * 4)`` are the cubics from each knot to the next, the highest power first, as in
    `scipy.interpolate.PPoly`. Quaternions are scalar last, and are normalised here.
    """
    rate, last = (len(knots) - 1) / (knots[-1] - knots[0]), len(knots) - 2
    for k in range(len(which)):
        # Find the interval; at a knot both cubics have the same value, so rounding may take either.
        interval = min(max(int((times[which[k]] - knots[0]) * rate), 0), last)
        t = times[which[k]] - knots[interval]
        own, place = quaternions[which[k]], positions[which[k]]
        # Evaluate the cubics of all quaternions, and of the root's position.
        _fill_cubics(t, rotation, interval, own)
        _fill_cubics(t, root, interval, place[0])
        for joint in range(len(parents)):
            # Normalise the quaternion.
            four = own[4 * joint : 4 * joint + 4]
            square = four[0] * four[0] + four[1] * four[1] + four[2] * four[2] + four[3] * four[3]
            scale = 1 / math.sqrt(square)
            for i in range(4):
                four[i] *= scale
            if joint > 0:
                # Rotate the bone by Rodrigues' form, and add it to the parent's position.
                bone, parent = offsets[joint], place[parents[joint]]
                across = scaled(cross(four, bone), 2.0)
                again = cross(four, across)
                for axis in range(3):
                    moved = bone[axis] + four[3] * across[axis] + again[axis]
                    place[joint, axis] = parent[axis] + moved


@compiled(fastmath={"contract"})
def pose_ellipsoids(positions, quaternions, parents, rest, centres, frames):
    """Fill centres (time, part, 3) and frames (time, part, 3, 3) from joints (time, joint, 3).

    The frames are ``rest (part, 3, 3)`` rotated by unit quaternions (time, joint, 4), scalar last.
    The first joint is the root, which has no bone.
    """
    for time in range(frames.shape[0]):
        for part in range(frames.shape[1]):
            # The centre is the middle of the bone.
            for axis in range(3):
                ends = positions[time, part + 1, axis] + positions[time, parents[part + 1], axis]
                centres[time, part, axis] = 0.5 * ends
            # The rotation matrix of the unit quaternion, row by row.
            q = quaternions[time, part + 1]
            x, y, z, w = q[0], q[1], q[2], q[3]
            a, b, c = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
            d, e, f = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
            g, h, k = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
            # It turns each column of the frame, the direction of one semi-axis.
            own, rotated = rest[part], frames[time, part]
            for column in range(3):
                u, v, s = own[0, column], own[1, column], own[2, column]
                rotated[0, column] = a * u + b * v + c * s
                rotated[1, column] = d * u + e * v + f * s
                rotated[2, column] = g * u + h * v + k * s
