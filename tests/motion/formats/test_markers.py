"""Rigid bones through joints that were measured one by one."""

from __future__ import annotations

import numpy as np
import pytest

from rtradar.errors import InputError
from rtradar.motion.formats.markers import CENTRES, NEEDED, SHANK_M, joint_centres
from rtradar.motion.formats.skeletons import rigid_motion
from rtradar.motion.quaternions import quaternion_rotate
from rtradar.motion.skeleton import NODE_PARENT, NODES

FRAMES = 200
PARENTS = [NODES.index(NODE_PARENT[node]) for node in NODES[1:]]
STILL = np.tile(np.eye(3), (FRAMES, 1, 1))


# A person at the origin who looks along +x, forearms forward, thumbs up [m]; the left side of what
# is on both.
STANDING = {
    "FHD": (0.10, 0.07, 1.62), "BHD": (-0.08, 0.05, 1.62), "C7": (-0.05, 0.0, 1.45),
    "CLAV": (0.05, 0.0, 1.45), "T10": (-0.10, 0.0, 1.15), "STRN": (0.10, 0.0, 1.15),
    "SHO": (0.0, 0.2, 1.42), "ELB": (0.0, 0.2, 1.12), "WRA": (0.28, 0.2, 1.16),
    "WRB": (0.28, 0.2, 1.08), "FIN": (0.37, 0.2, 1.12), "FWT": (0.12, 0.12, 0.95),
    "BWT": (-0.12, 0.08, 0.95), "KNE": (0.0, 0.12, 0.08 + SHANK_M), "ANK": (0.0, 0.12, 0.08),
    "TOE": (0.16, 0.12, 0.08),
}  # fmt: skip

FOREARM = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
"""Forward, left and up of the forearm in this pose: the thumb is up, the elbow behind."""


def place(name: str) -> np.ndarray:
    """A marker of the standing person."""
    if name in STANDING:
        return np.array(STANDING[name])
    return np.array(STANDING[name[1:]]) * [1, 1 if name[0] == "L" else -1, 1]


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_joints_stand_where_the_table_puts_them(unit: float) -> None:
    centres, *_ = joint_centres({name: unit * place(name)[None] for name in NEEDED})
    for number, node in enumerate(NODES):
        side = {"l_": "L", "r_": "R"}.get(node[:2], "")
        centre = CENTRES[node[2:] if side else node]
        forward, left, up = centre.offset_m
        axes = FOREARM if centre.segment == "forearm" else np.eye(3)
        offset = np.array([forward, -left if side == "R" else left, up]) @ axes
        about = np.mean([place(name.replace("@", side)) for name in centre.markers], axis=0)
        np.testing.assert_allclose(centres[0, number], unit * (about + offset), atol=1e-9 * unit)


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
