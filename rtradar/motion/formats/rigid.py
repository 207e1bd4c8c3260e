"""Conversion of joints that were measured one by one to the nearest rigid skeleton."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError
from rtradar.motion.motion import Motion
from rtradar.motion.quaternions import quaternion_multiply, quaternion_rotate, sign_continuous
from rtradar.motion.retarget import MINIMUM_PART_M
from rtradar.motion.skeleton_names import NODE_PARENT, NODES

_ON_THE_PELVIS = (
    "l_hip",
    "r_hip",
    "l_knee",
    "r_knee",
    "l_ankle",
    "r_ankle",
    "l_toe",
    "r_toe",
    "lowerback",
    "upperback",
)
"""Nodes whose bones turn with the pelvis where they do not bend; the others turn with the chest."""


def rigid_motion(
    name: str,
    centres: NDArray[np.float64],
    pelvis: NDArray[np.float64],
    thorax: NDArray[np.float64],
    rate_hz: float,
) -> Motion:
    """Make the motion of a rigid skeleton whose bones point as the joints do.

    A bone is as long as its joints are apart in the median, and points from one to the other in
    every frame. Joints say nothing of how a bone is turned about itself: seen from pelvis or chest
    it takes from frame to frame the shortest turn to its next direction, so that nothing on it
    spins.

    Parameters
    ----------
    name : str
        Name of the motion.
    centres : (frame, node, 3) float64
        Positions of the 22 nodes, world [m].
    pelvis, thorax : (frame, 3, 3) float64
        Orientations of pelvis and chest, as rotation matrices.
    rate_hz : float
        Number of frames per second [Hz].

    Raises
    ------
    InputError
        Where two joints of a bone coincide, or a value is not finite.
    """
    parents = [NODES.index(NODE_PARENT[node]) for node in NODES[1:]]
    bones = centres[:, 1:] - centres[:, parents]
    spans = np.linalg.norm(bones, axis=2)
    for bone, frame in np.argwhere(~(spans.T > MINIMUM_PART_M / 2)):
        ends = f"{NODE_PARENT[NODES[1 + bone]]!r} and {NODES[1 + bone]!r}"
        raise InputError(
            f"{name}: {ends} are {spans[frame, bone] * 1e3:.3g} mm apart in frame {frame + 1}; "
            "every body part needs at least "
            f"{MINIMUM_PART_M * 1e3 / 2:g} mm, mend the markers about it"
        )
    held = {
        key: sign_continuous(Rotation.from_matrix(axes).as_quat())
        for key, axes in (("pelvis", pelvis), ("thorax", thorax))
    }
    carriers = np.stack(
        [held["pelvis" if node in _ON_THE_PELVIS else "thorax"] for node in NODES[1:]], axis=1
    )
    directions = quaternion_rotate(carriers * [-1, -1, -1, 1], bones / spans[..., None])
    rotations = quaternion_multiply(carriers, _followed(directions))
    lengths = np.median(spans, axis=0)
    return Motion(
        name=name,
        joints=NODES,
        parents=(-1, *parents),
        offsets=np.concatenate([np.zeros((1, 3)), directions[0] * lengths[:, None]]),
        root_positions=centres[:, 0],
        rotations=np.concatenate(
            [held["pelvis"][:, None], rotations / np.linalg.norm(rotations, axis=2, keepdims=True)],
            axis=1,
        ),
        rate_hz=rate_hz,
    )


def _followed(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations (frame, bone, 4) of directions (frame, bone, 3) from the first to each frame."""
    before, after = directions[:-1], directions[1:]
    steps = np.concatenate(
        [np.cross(before, after), 1 + np.sum(before * after, axis=2, keepdims=True)], axis=2
    )
    norms = np.linalg.norm(steps, axis=2, keepdims=True)
    # A bone that points the other way in the next frame has no shortest turn: half a turn about any
    # line across it will do.
    across = np.cross(before, np.eye(3)[np.argmin(np.abs(before), axis=2)])
    half = np.concatenate(
        [across / np.linalg.norm(across, axis=2, keepdims=True), np.zeros_like(norms)], axis=2
    )
    steps = np.where(norms > 1e-6, steps / np.maximum(norms, 1e-6), half)
    turns = np.empty((*directions.shape[:2], 4))
    turns[0] = [0.0, 0.0, 0.0, 1.0]
    for frame, step in enumerate(steps):
        turns[frame + 1] = quaternion_multiply(step, turns[frame])
    return turns / np.linalg.norm(turns, axis=2, keepdims=True)
