"""Real recordings, where RTRADAR_MOCAP says they are."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rtradar.motion import Motion, load_motion, place
from rtradar.motion.skeleton import NODES, to_nodes

BVH = "bandai_namco_CC-BY-NC/dataset-1_{}_normal_001.bvh"
FILES = {
    "hdm05 kick": ("hdm05/HDM_bd_kickLFront1Reps_001_120.amc", "hdm05/HDM_bd.asf", 161),
    "cmu walk": ("cmu/02_01.amc", "cmu/02.asf", 343),
    "cmu punch": ("cmu/143_23.amc", "cmu/143_reconstructed.asf", 814),
    "cmu jack": ("cmu/14_14.amc", "cmu/14_reconstructed.asf", 4653),
    "bvh walk": (BVH.format("walk"), None, 195),
    "bvh kick": (BVH.format("kick"), None, 358),
    "bvh punch": (BVH.format("punch"), None, 224),
}


@cache
def load(folder: Path, key: str) -> Motion:
    file, skeleton, _ = FILES[key]
    return load_motion(folder / file, folder / skeleton if skeleton else None)


@pytest.mark.parametrize("key", FILES)
def test_sizes_and_floor(mocap: Path, key: str) -> None:
    motion = load(mocap, key)
    assert len(motion.root_positions) == FILES[key][2]
    nodes = to_nodes(motion)
    lengths = dict(zip(NODES, np.linalg.norm(nodes.offsets, axis=1), strict=True))
    # Bones of people between 1.4 and 2 m tall.
    for node, low, high in (
        ("l_knee", 0.33, 0.50),
        ("r_ankle", 0.36, 0.52),
        ("l_toe", 0.14, 0.25),
        ("r_elbow", 0.22, 0.36),
        ("l_wrist", 0.20, 0.35),
        ("r_hand", 0.05, 0.20),
        ("lowerback", 0.08, 0.17),
        ("head", 0.15, 0.25),
        ("l_shoulder", 0.08, 0.27),
    ):
        assert low < lengths[node] < high, (node, lengths[node])
    lowest = nodes.positions[..., 2].min(axis=1)
    assert -0.03 < np.median(lowest) < 0.08
    head = nodes.positions[:, NODES.index("head"), 2]
    assert 1.3 < np.median(head) < 1.9


@pytest.mark.parametrize(
    ("key", "mm"), [("hdm05 kick", 25), ("cmu walk", 25), ("cmu jack", 25), ("bvh kick", 25)]
)
def test_nodes_stand_where_the_joints_are(mocap: Path, key: str, mm: float) -> None:
    motion = load(mocap, key)
    nodes = to_nodes(motion)
    bvh = key.startswith("bvh")
    pairs = (
        {
            "l_knee": "LowerLeg_L",
            "r_ankle": "Foot_R",
            "thorax": "Neck",
            "l_elbow": "LowerArm_L",
            "r_wrist": "Hand_R",
        }
        if bvh
        else {
            "l_knee": "lfemur",
            "l_toe": "ltoes",
            "thorax": "thorax",
            "head": "head",
            "r_wrist": "rwrist",
            "l_hand": "lfingers",
        }
    )
    for node, joint in pairs.items():
        gap = np.linalg.norm(
            nodes.positions[:, NODES.index(node)] - motion.positions[:, motion.joints.index(joint)],
            axis=1,
        )
        assert gap.max() * 1e3 < mm, (node, gap.max())


def test_kick_is_a_left_kick_toward_the_radar(mocap: Path) -> None:
    nodes = to_nodes(place(load(mocap, "hdm05 kick")))
    toe = nodes.positions[:, NODES.index("l_toe")]
    assert 1.3 < toe[:, 2].max() < 1.5
    assert toe[np.argmax(toe[:, 2]), 0] < -0.5
    assert (
        nodes.positions[:, NODES.index("l_hip"), 1].mean()
        < nodes.positions[:, NODES.index("r_hip"), 1].mean()
    )
    speed = np.linalg.norm(np.gradient(toe, 1 / 120, axis=0), axis=1).max()
    assert 7 < speed < 10


@pytest.mark.parametrize("key", ["cmu walk", "bvh walk"])
def test_walks_move_toward_the_radar(mocap: Path, key: str) -> None:
    placed = place(load(mocap, key), 0.5, 2.0)
    nodes = to_nodes(placed)
    ends = nodes.at([0.0, 2.0])[0]
    assert -1.5 * 2 < ends[1, 0, 0] - ends[0, 0, 0] < -0.9 * 2
    assert abs(ends[1, 0, 1] - ends[0, 0, 1]) < 0.2
    assert (ends[:, NODES.index("l_hip"), 1] < ends[:, NODES.index("r_hip"), 1]).all()


@pytest.fixture(scope="module")
def spikes(mocap: Path) -> Motion:
    """The nodes of 135_02, in which hands jump."""
    return to_nodes(load_motion(mocap / "cmu/135_02.amc", mocap / "cmu/135.asf"))


def test_spikes_of_135_02_stay_rigid(spikes: Motion) -> None:
    nodes = spikes
    assert len(nodes.root_positions) == 5202
    times = np.arange(0, 43.0, 1 / 397)
    positions, _ = nodes.at(times)
    lengths = np.linalg.norm(positions[:, 1:] - positions[:, list(nodes.parents[1:])], axis=2)
    np.testing.assert_allclose(
        lengths, np.linalg.norm(nodes.offsets[1:], axis=1)[None].repeat(len(times), 0), rtol=1e-10
    )
    # Hand spikes included, nothing leaves the room between the frames: the splines do not run away.
    frames = nodes.positions
    assert (positions.max(axis=(0, 1)) < frames.max(axis=(0, 1)) + 0.05).all()
    assert (positions.min(axis=(0, 1)) > frames.min(axis=(0, 1)) - 0.05).all()


def test_c3d_and_amc_of_one_take_agree(mocap: Path, spikes: Motion) -> None:
    c3d, amc = load_motion(mocap / "cmu/135_02.c3d"), spikes
    assert c3d.rate_hz == amc.rate_hz
    # The offsets of the markers were set by the other half of the take
    # (validation/measurements/c3d_take.py).
    apart = np.linalg.norm(c3d.positions - amc.positions, axis=2)[2601:]
    assert (np.median(apart, axis=0) < 0.06).all()


def test_skeleton_of_another_kind_is_refused(mocap: Path) -> None:
    amc = (mocap / FILES["hdm05 kick"][0]).read_bytes()
    assert b"\r\n" in amc
    assert b"\xfc" in amc  # Latin-1: the header holds a u with dots
