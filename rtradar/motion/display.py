"""What a motion shows of itself: who moves, for how long, how tall and where."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from rtradar.motion.motion import Motion


def rows(motion: Motion) -> dict[str, str]:
    """Return what the motion is, as texts with units by their labels."""
    joints = poses(motion, 5000)[1]
    roots, height_m = joints[:, 0], float(np.median(np.ptp(joints[..., 2], axis=1)))
    low, high = roots.min(axis=0), roots.max(axis=0)
    path_m = float(np.linalg.norm(np.diff(roots[:, :2], axis=0), axis=1).sum())
    girth = "" if motion.girth == 1 else f", {motion.girth:.3g} times as thick as the nominal body"
    first, last = motion.joints[0], motion.joints[-1]
    return {
        "Duration": f"{motion.duration_s:.4g} s",
        "Frames": f"{len(motion.root_positions):,} at {motion.rate_hz:.5g} Hz",
        "Joints": f"{len(motion.joints)}, from {first} to {last}",
        "Height": f"{height_m:.3g} m from the lowest to the highest joint{girth}",
        "Place": "root at "
        + ", ".join(
            f"{axis} {_span(least, most)}"
            for axis, least, most in zip("xyz", low, high, strict=True)
        )
        + " m",
        "Path": f"{path_m:.3g} m over the floor",
    }


def poses(motion: Motion, most: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times (pose,) [s] of ``most`` frames or fewer, and their joints (pose, joint, 3) [m].

    They are spread evenly over the motion. Other frames are not computed, for there may be a
    million of them.
    """
    times = motion.frame_times
    inside = np.flatnonzero((times > -0.5 / motion.rate_hz) & (times <= motion.duration_s + 1e-9))
    some = inside[np.unique(np.linspace(0, len(inside) - 1, most).astype(int))]
    taken = replace(
        motion,
        root_positions=motion.root_positions[some],
        rotations=motion.rotations[some],
        first_frame_s=0.0,
        length_s=None,
    )
    return times[some], taken.positions


def _span(least: float, most: float) -> str:
    low, high = (f"{round(value, 2) + 0.0:.2f}" for value in (least, most))  # never -0.00
    return low if low == high else f"{low} to {high}"
