"""Poses of skeletons and ellipsoids."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from references.cases import UNTOUCHED, Pair, filled, kernel_case
from rtradar.kernels.motion import pose, pose_ellipsoids


def pose_reference(times, knots, root, rotation, offsets, parents):
    """Positions (time, joint, 3) and quaternions (time, joint, 4) of `pose`, by SciPy."""
    interval = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    powers = (times - knots[interval]) ** np.arange(3, -1, -1)[:, None]
    quaternions = np.einsum("pt,pti->ti", powers, rotation[:, interval])
    quaternions = quaternions.reshape(len(times), -1, 4)
    quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
    rotations = Rotation.from_quat(quaternions.reshape(-1, 4)).as_matrix()
    positions = (rotations.reshape(len(times), -1, 3, 3) @ offsets[:, :, None])[..., 0]
    positions[:, 0] = np.einsum("pt,pti->ti", powers, root[:, interval])
    for joint in range(1, len(parents)):
        positions[:, joint] += positions[:, parents[joint]]
    return positions, quaternions


# Rounding of some ten operations on each number.
@kernel_case(pose, 1e-13, joints=(5, 23))
def _pose(joints: int) -> Pair:
    rng, knots = np.random.default_rng(1), np.linspace(0.5, 2.0, 31)
    root, rotation = rng.normal(size=(4, 30, 3)), rng.normal(size=(4, 30, 4 * joints))
    offsets, parents = rng.normal(size=(joints, 3)), np.maximum(np.arange(-1, joints - 1) // 2, -1)
    times = rng.uniform(0.5, 2.0, 200)
    which = np.flatnonzero(rng.uniform(size=200) < 0.7)
    skeleton = knots, root, rotation, offsets, parents
    out = np.empty((200, joints, 3)), np.empty((200, 4 * joints))
    found = filled(pose, times, which, *skeleton, out=out)
    # Times that are not asked for are left as they are.
    expected = tuple(np.full(array.shape, float(UNTOUCHED)) for array in out)
    for whole, own in zip(expected, pose_reference(times[which], *skeleton), strict=True):
        whole[which] = own.reshape(len(which), *whole.shape[1:])
    return found, expected


def pose_ellipsoids_reference(positions, quaternions, parents, rest):
    """Centres (time, part, 3) and frames (time, part, 3, 3) of `pose_ellipsoids`, by SciPy."""
    centres = (positions[:, 1:] + positions[:, parents[1:]]) / 2
    rotations = Rotation.from_quat(quaternions[:, 1:].reshape(-1, 4)).as_matrix()
    return centres, rotations.reshape(len(positions), -1, 3, 3) @ rest


@kernel_case(pose_ellipsoids, 1e-13, joints=(5, 22))
def _pose_ellipsoids(joints: int) -> Pair:
    rng, parents = np.random.default_rng(2), np.maximum(np.arange(-1, joints - 1) // 2, -1)
    positions, quaternions = rng.normal(size=(7, joints, 3)), rng.normal(size=(7, joints, 4))
    quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
    given = positions, quaternions, parents, rng.normal(size=(joints - 1, 3, 3))
    out = np.empty((7, joints - 1, 3)), np.empty((7, joints - 1, 3, 3))
    return filled(pose_ellipsoids, *given, out=out), pose_ellipsoids_reference(*given)
