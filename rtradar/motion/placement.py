"""Placement of a recording before the radar: an interval, a position on the floor, and a yaw."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from rtradar.motion.motion import Motion
from rtradar.motion.skeleton import NODES, to_nodes
from rtradar.system.checks import check_number
from rtradar.system.row_files import column

MARGIN_FRAMES = 16
"""Frames kept before and after the interval, where there are any.

What lies further away moves a cubic spline by less than 3.7^-16, 1e-9: the ends are as good as the
middle."""

WALK_DISTANCE_M, WALK_STRAIGHTNESS, WALK_ALONG_HEADING = 1.1, 0.5, 0.5
"""Least distance of a walk from its beginning [m], where a kick steps less; least ratio of the
straight line to the path; and least median cosine between path and the hips' heading, because a
fighter who steps sideways does not walk. Short intervals of straight walks fall below the distance,
and then face by their hips, which look the same way."""


def place(
    motion: Motion, start_s: float = 0.0, duration_s: float | None = None, heading_deg: float = 0.0
) -> Motion:
    """Cut an interval out of a recording and put it before the radar.

    The interval's mean horizontal root position goes to the origin; heights stay as recorded. One
    yaw rotates the whole: a walk, as of `walk_direction`, moves along -x, toward the radar;
    everything else faces -x by the median heading of its hips.

    Parameters
    ----------
    motion : Motion
        Recording whose skeleton is of a known kind.
    start_s, duration_s : float
        Begin and duration of the interval [s]; by default it ends with the recording. ``start_s``
        becomes time zero.
    heading_deg : float
        Angle added to the yaw, anticlockwise seen from above [deg].

    Returns
    -------
    Motion
        Interval with up to `MARGIN_FRAMES` frames beyond it on each side, for interpolation only.

    Raises
    ------
    InputError
        Where the interval is not inside the recording.
    """
    part = _interval(motion, start_s, duration_s, heading_deg)
    nodes = to_nodes(part)
    # Frames beyond the interval are there for interpolation, and do not count for where the person
    # is.
    inside = (part.frame_times >= -1e-9) & (part.frame_times <= part.duration_s + 1e-9)
    if not inside.any():  # an interval between two frames
        inside[:] = True
    roots = nodes.root_positions[inside]
    headings = hip_headings(nodes)[inside]
    # Heading before the radar: the walk's direction, or else that of the hips, is turned to -x.
    facing = median_heading(headings)
    direction = walk_direction(roots, headings)
    along = facing if direction is None else direction
    yaw = math.pi - math.atan2(along[1], along[0]) + math.radians(heading_deg)
    middle = roots.mean(axis=0)
    return part.shifted([-middle[0], -middle[1], 0.0]).turned(yaw)


def keep_place(
    motion: Motion, start_s: float = 0.0, duration_s: float | None = None, heading_deg: float = 0.0
) -> Motion:
    """Cut an interval out of a recording where it was recorded, turned about the origin there.

    Parameters, returns and errors are those of `place`.
    """
    part = _interval(motion, start_s, duration_s, heading_deg)
    return part.turned(math.radians(heading_deg)) if heading_deg else part


def _interval(
    motion: Motion, start_s: float, duration_s: float | None, heading_deg: float
) -> Motion:
    where = f"{motion.name}, {motion.duration_s:.6g} s long"
    start_s = check_number(where, "start_s", start_s, 0.0, motion.duration_s)
    check_number(where, "heading_deg", heading_deg, -1e6, 1e6)
    rest = motion.duration_s - start_s
    if duration_s is not None:
        what = f"after {start_s:g} s, of which {rest:g} s are left, duration_s"
        duration_s = check_number(where, what, duration_s, 1e-9, rest + 1e-6)
    return cut(motion, start_s, rest if duration_s is None else min(duration_s, rest))


def cut(motion: Motion, start_s: float, length_s: float) -> Motion:
    """Cut an interval out of a recording; ``start_s`` becomes time zero.

    Parameters
    ----------
    motion : Motion
        Recording.
    start_s, length_s : float
        Begin and length of the interval [s].

    Returns
    -------
    Motion
        Interval with up to `MARGIN_FRAMES` frames more on each side, which `place` needs.
    """
    frames = len(motion.root_positions)
    # In frames of the recording. A time on a frame but for rounding is that frame.
    begin = (start_s - motion.first_frame_s) * motion.rate_hz
    end = begin + length_s * motion.rate_hz
    first = max(0, math.floor(begin + 1e-6) - MARGIN_FRAMES)
    last = min(frames - 1, math.ceil(end - 1e-6) + MARGIN_FRAMES)
    # A rounding error must not put the first frame after time zero.
    lead = min(0.0, motion.first_frame_s + first / motion.rate_hz - start_s)
    return dataclasses.replace(
        motion,
        root_positions=motion.root_positions[first : last + 1],
        rotations=motion.rotations[first : last + 1],
        first_frame_s=lead,
        length_s=length_s,
    )


def hip_headings(nodes: Motion) -> NDArray[np.float64]:
    """Horizontal unit vectors (frame, 2) of the hips' heading, at right angles to the hip axis."""
    hips = [column(nodes.positions, NODES.index(hip)) for hip in ("l_hip", "r_hip")]
    left = hips[0][:, :2] - hips[1][:, :2]
    ahead = np.stack([left[:, 1], -left[:, 0]], axis=1)
    return ahead / np.maximum(np.linalg.norm(left, axis=1, keepdims=True), 1e-9)


def median_heading(headings: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vector (2,) along the median of the angles of headings (frame, 2) to their mean.

    A median of each component would not rotate with the recording.
    """
    mean = headings.mean(axis=0)
    # Where the headings cancel out, their mean says nothing, and the first frame is used instead.
    along = mean if float(np.linalg.norm(mean)) > 1e-6 else headings[0]
    to_the_left = along[0] * headings[:, 1] - along[1] * headings[:, 0]
    away = float(np.median(np.arctan2(to_the_left, headings @ along)))
    angle = math.atan2(along[1], along[0]) + away
    return np.array([math.cos(angle), math.sin(angle)])


def walk_direction(
    roots: NDArray[np.float64], headings: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Direction (2,) of a walk by its roots (frame, 3), or None where it is none.

    The direction is that of the farthest point, so a walk there and back counts, and goes there
    first.
    """
    away = roots[:, :2] - roots[0, :2]
    last = int(np.argmax(np.linalg.norm(away, axis=1)))
    farthest = np.asarray(away[last])
    distance = float(np.linalg.norm(farthest))
    path = float(np.linalg.norm(np.diff(roots[: last + 1, :2], axis=0), axis=1).sum())
    # Who stays near the beginning, or goes by a way that is far from straight, does not walk.
    if distance < max(WALK_DISTANCE_M, WALK_STRAIGHTNESS * path):
        return None
    # Backward counts as along, hence the magnitude; a sidestep does not.
    along = float(np.median(np.abs(headings @ farthest))) / distance
    return farthest if along >= WALK_ALONG_HEADING else None
