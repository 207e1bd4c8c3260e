"""Rigid bones through joints that were measured one by one."""

from __future__ import annotations

import numpy as np
import pytest

from rtradar.errors import InputError
from rtradar.motion.formats.markers import rigid_motion
from rtradar.motion.quaternions import quaternion_rotate
from rtradar.motion.skeleton import NODE_PARENT, NODES

FRAMES = 200
PARENTS = [NODES.index(NODE_PARENT[node]) for node in NODES[1:]]
STILL = np.tile(np.eye(3), (FRAMES, 1, 1))


def swinging() -> np.ndarray:
    """Joints (frame, node, 3) whose bones all swing far and differently, and keep their lengths."""
    random = np.random.default_rng(2)
    time = np.arange(FRAMES)[:, None] / 60
    rates, phases = random.uniform(1, 4, (2, 21)), random.uniform(0, 6, (2, 21))
    polar, azimuth = 1.5 + 1.3 * np.sin(rates[0] * time + phases[0]), rates[1] * time + phases[1]
    directions = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=2
    )
    bones = directions * random.uniform(0.1, 0.4, 21)[:, None]
    joints = np.zeros((FRAMES, 22, 3))
    for child, parent in enumerate(PARENTS, start=1):
        joints[:, child] = joints[:, parent] + bones[:, child - 1]
    return joints


def test_joints_of_rigid_bones_are_met() -> None:
    joints = swinging()
    motion = rigid_motion("swing", joints, STILL, STILL, 60.0)
    np.testing.assert_allclose(motion.positions, joints, atol=1e-12)


def test_bones_do_not_spin() -> None:
    joints = swinging()
    motion = rigid_motion("swing", joints, STILL, STILL, 60.0)
    bones = joints[:, 1:] - joints[:, PARENTS]
    bones /= np.linalg.norm(bones, axis=2, keepdims=True)
    # The angle of the turn from frame to frame is that between the directions: not more.
    turned = 2 * np.arccos(
        np.clip(np.abs(np.sum(motion.rotations[1:, 1:] * motion.rotations[:-1, 1:], axis=2)), 0, 1)
    )
    between = np.arctan2(
        np.linalg.norm(np.cross(bones[1:], bones[:-1]), axis=2),
        np.sum(bones[1:] * bones[:-1], axis=2),
    )
    np.testing.assert_allclose(turned, between, atol=1e-7)  # arccos near 1 keeps half of the digits


def test_a_bone_that_turns_about_in_one_frame_is_followed() -> None:
    joints = np.tile(swinging()[:1], (FRAMES, 1, 1))
    toe, ankle = NODES.index("l_toe"), NODES.index("l_ankle")
    joints[50:, toe] = 2 * joints[50:, ankle] - joints[50:, toe]
    motion = rigid_motion("flip", joints, STILL, STILL, 60.0)
    np.testing.assert_allclose(motion.positions, joints, atol=1e-12)


def test_lengths_are_the_median() -> None:
    joints = swinging()
    joints[:30, NODES.index("head")] += 0.02
    motion = rigid_motion("stretch", joints, STILL, STILL, 60.0)
    head, neck = NODES.index("head"), NODES.index("neck")
    np.testing.assert_allclose(
        np.linalg.norm(motion.offsets[head]), np.linalg.norm(joints[100, head] - joints[100, neck])
    )
    np.testing.assert_allclose(
        quaternion_rotate(motion.rotations[:, head], motion.offsets[head]),
        (motion.positions[:, head] - motion.positions[:, neck]),
    )


def test_joints_that_coincide_are_refused() -> None:
    joints = swinging()
    joints[7, NODES.index("r_toe")] = joints[7, NODES.index("r_ankle")]
    with pytest.raises(InputError, match="'r_ankle' and 'r_toe' are 0 mm apart in frame 8"):
        rigid_motion("point", joints, STILL, STILL, 60.0)
