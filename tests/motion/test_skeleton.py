from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError
from rtradar.motion import Motion
from rtradar.motion.quaternions import quaternion_multiply
from rtradar.motion.skeleton import NODES, plain, to_nodes


def bvh_like(
    spine: tuple[str, ...], *, toe_end: bool = True, hand_end: bool = True, seed: int = 0
) -> Motion:
    """A person with Mixamo names in random poses, with these joints between hips and neck."""
    tree: list[tuple[str, str, tuple[float, float, float]]] = [("Hips", "", (0, 0, 0))]
    below = "Hips"
    for name in spine:
        tree.append((name, below, (0, 0, 0.4 / (len(spine) + 1))))
        below = name
    tree += [
        ("Neck", below, (0, 0, 0.4 / (len(spine) + 1))),
        ("Head", "Neck", (0, 0, 0.1)),
        ("HeadTop_End", "Head", (0, 0, 0.2)),
    ]
    for side, sign in (("Left", 1), ("Right", -1)):
        tree += [
            (f"{side}UpLeg", "Hips", (0, sign * 0.1, -0.05)),
            (f"{side}Leg", f"{side}UpLeg", (0, 0, -0.4)),
            (f"{side}Foot", f"{side}Leg", (0, 0, -0.4)),
            (f"{side}ToeBase", f"{side}Foot", (0.12, 0, -0.05)),
            (f"{side}Shoulder", below, (0, sign * 0.05, 0.1)),
            (f"{side}Arm", f"{side}Shoulder", (0, sign * 0.12, 0)),
            (f"{side}ForeArm", f"{side}Arm", (0, sign * 0.28, 0)),
            (f"{side}Hand", f"{side}ForeArm", (0, sign * 0.25, 0)),
        ]
        if toe_end:
            tree.append((f"{side}ToeBase_end", f"{side}ToeBase", (0.06, 0, 0)))
        tree.append((f"{side}Hand_end", f"{side}Hand", (0, sign * (0.17 if hand_end else 0.0), 0)))
    names = [name for name, _, _ in tree]
    rng = np.random.default_rng(seed)
    frames = 6
    world: dict[str, Rotation] = {}
    rotations = []
    for (
        name,
        parent,
        _,
    ) in tree:  # the rotation of the bone that ends in a joint is the global one of its parent
        local = Rotation.from_rotvec(rng.normal(0, 0.2, (frames, 3)))
        rotations.append((world[parent] if parent else local).as_quat())
        world[name] = world[parent] * local if parent else local
    return Motion(
        name="someone",
        joints=tuple(f"mixamorig:{name}" for name in names),
        parents=tuple(names.index(parent) if parent else -1 for _, parent, _ in tree),
        offsets=np.array([offset for _, _, offset in tree]),
        root_positions=rng.normal(0, 0.1, (frames, 3)),
        rotations=np.stack(rotations, axis=1),
        rate_hz=30.0,
    )


@pytest.mark.parametrize(
    "spine", [(), ("Spine",), ("Spine", "Spine1"), ("Spine", "Spine1", "Spine2"), tuple("abcde")]
)
def test_any_spine_becomes_three_parts(spine: tuple[str, ...]) -> None:
    motion = bvh_like(spine)
    nodes = to_nodes(motion)
    assert nodes.joints == NODES
    lengths = np.linalg.norm(nodes.offsets[1:], axis=1)
    assert lengths.min() > 0.05
    three = sum(lengths[NODES.index(node) - 1] for node in ("lowerback", "upperback", "thorax"))
    # Where a chain has more joints than nodes, a part is the chord, which the bends of 0.2 rad make
    # shorter than the chain.
    assert three == pytest.approx(0.4, rel=0.03 if len(spine) > 2 else 1e-12)
    ends = (
        nodes.positions[:, NODES.index("thorax")]
        - motion.positions[:, motion.joints.index("mixamorig:Neck")]
    )
    assert np.abs(ends).max() < (0.02 if len(spine) > 2 else 1e-12)


def test_parts_that_are_bones_keep_their_places_exactly() -> None:
    motion = bvh_like(("Spine", "Spine1"))
    nodes = to_nodes(motion)
    for node, joint in (
        ("l_ankle", "LeftFoot"),
        ("r_knee", "RightLeg"),
        ("neck", "Head"),
        ("head", "HeadTop_End"),
    ):
        theirs = motion.positions[:, motion.joints.index(f"mixamorig:{joint}")]
        np.testing.assert_allclose(nodes.positions[:, NODES.index(node)], theirs, atol=1e-12)


def test_chained_part_points_along_its_chain() -> None:
    motion = bvh_like(("Spine", "Spine1"))
    nodes = to_nodes(motion)
    ankle, toe = (
        motion.positions[:, motion.joints.index(f"mixamorig:Left{name}")]
        for name in ("Foot", "ToeBase_end")
    )
    chord = toe - ankle
    lengths = np.linalg.norm(chord, axis=1)
    part = nodes.positions[:, NODES.index("l_toe")] - nodes.positions[:, NODES.index("l_ankle")]
    np.testing.assert_allclose(part, chord / lengths[:, None] * np.median(lengths), atol=1e-12)


def test_open_ends_are_extended_straight_on() -> None:
    nodes = to_nodes(bvh_like(("Spine", "Spine1"), toe_end=False, hand_end=False))
    lengths = dict(zip(NODES, np.linalg.norm(nodes.offsets, axis=1), strict=True))
    assert lengths["l_hand"] == pytest.approx(0.25 * 0.108 / 0.146)
    assert lengths["r_toe"] == pytest.approx(1.5 * np.hypot(0.12, 0.05))
    hand = nodes.offsets[NODES.index("r_hand")]
    np.testing.assert_allclose(hand / np.linalg.norm(hand), [0, -1, 0], atol=1e-12)


def test_missing_joint_is_named() -> None:
    motion = bvh_like(("Spine",))
    renamed = dataclasses.replace(
        motion, joints=tuple(name.replace("LeftFoot", "LeftThing") for name in motion.joints)
    )
    with pytest.raises(
        InputError,
        match=r"someone: joints leftfoot of .*Mixamo.* are missing",
    ):
        to_nodes(renamed)


def test_a_skeleton_of_no_known_kind_is_told_the_kinds() -> None:
    motion = Motion(
        name="robot",
        joints=("base", "arm"),
        parents=(-1, 0),
        offsets=np.array([[0.0, 0, 0], [0, 0, 1]]),
        root_positions=np.zeros((2, 3)),
        rotations=np.tile([0.0, 0, 0, 1], (2, 2, 1)),
        rate_hz=100.0,
    )
    with pytest.raises(
        InputError,
        match=r"robot: its joints \(base, arm, ...\) are named as in no set .*ASF \(HDM05, CMU\)",
    ):
        to_nodes(motion)


def test_part_without_length_is_refused() -> None:
    motion = bvh_like(("Spine",))
    offsets = motion.offsets.copy()
    offsets[motion.joints.index("mixamorig:LeftLeg")] = 0
    with pytest.raises(
        InputError, match=r"'l_knee' is 0 mm long \(mixamorig:LeftUpLeg to mixamorig:LeftLeg\)"
    ):
        to_nodes(dataclasses.replace(motion, offsets=offsets))


def test_names() -> None:
    assert (
        plain("mixamorig:LeftUpLeg")
        == plain("Left_UpLeg")
        == plain("mixamorig1LeftUpLeg")
        == "leftupleg"
    )
    assert plain("Hand_L_end") == "handlend"


def test_multiply_is_composition() -> None:
    a, b = Rotation.random(5, random_state=1), Rotation.random(5, random_state=2)
    np.testing.assert_allclose(
        Rotation.from_quat(quaternion_multiply(a.as_quat(), b.as_quat())).as_matrix(),
        (a * b).as_matrix(),
        atol=1e-12,
    )


@pytest.mark.parametrize("spine", [("Spine",), tuple("abcde")])
def test_nodes_in_pieces(
    spine: tuple[str, ...], in_pieces: Callable[[], None], same: Callable[[Motion, Motion], None]
) -> None:
    motion = bvh_like(spine)  # feet, hands and, of five joints, a spine that point along chains
    whole = to_nodes(motion)
    in_pieces()
    same(to_nodes(motion), whole)
