"""Retargeting of any skeleton to the 22 nodes of the paper's body, a rigid tree.

Where one bone of the recording joins two nodes, that bone is taken as it is. Where a chain joins
them (ankle to toe tip over the ball of the foot, elbow to wrist over the twist joint, wrist to
finger tips, base to top of the head, thorax to shoulder in a BVH whose neck and collar are
separate) the part is one rigid bone that always points from the one joint to the other and has the
median of their distances as its length. Toe tips are up to 3 cm off by that in push-off, the others
millimetres.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.motion.motion import Motion
from rtradar.motion.quaternions import quaternion_multiply, quaternion_rotate
from rtradar.motion.skeleton_names import CONVENTIONS, NODE_PARENT, NODES, Convention, plain
from rtradar.system.row_files import FileBackedRows, in_blocks

MINIMUM_PART_M = 0.01
"""No body part is shorter than this; joints nearer to each other count as one."""

HEAD_OF_THIGH = 0.130 / 0.245
"""Ratio of the head's height to the thigh's length (Drillis and Contini 1966).

Skeletons that end at the base of the head need it."""

HAND_OF_FOREARM = 0.108 / 0.146
"""Ratio of the lengths of hand and forearm (Drillis and Contini 1966).

Skeletons that end at the wrist need it."""

TOES_OF_FOOT = 0.5
"""Ratio of the distances from ball to toe tip and from ankle to ball of the foot (HDM05).

Skeletons that end at the ball of the foot need it."""


@dataclass(frozen=True)
class _Bone:
    """A vector in the bone's own axes, and a function that gives its rotations (frame, 4).

    The function takes the positions and rotations of all joints in some frames.
    """

    offset: NDArray[np.float64]
    rotations: Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.offset))


def to_nodes(motion: Motion) -> Motion:
    """Retarget a motion to the 22-node skeleton, a rigid tree whose 21 bones are the body parts.

    Raises
    ------
    InputError
        Where the skeleton is of no known kind (naming the joint that is missing), or a part would
        have no length.
    """
    if motion.joints == NODES:
        return motion
    convention, joints = _recognise(motion)
    named = [node for node in joints if node not in ("root", "thorax")]
    bones = {node: _between(motion, joints[NODE_PARENT[node]], joints[node]) for node in named}
    bones |= _spine(motion, joints["root"], joints["thorax"])
    if convention.open_ended:
        for side in ("l", "r"):
            bones[f"{side}_toe"] = _foot(
                motion, joints[f"{side}_ankle"], bones[f"{side}_toe"], joints[f"{side}_toe"]
            )
            forearm = bones[f"{side}_wrist"].length
            bones[f"{side}_hand"] = _extended(
                motion, bones[f"{side}_hand"], joints, f"{side}_wrist", forearm * HAND_OF_FOREARM
            )
        bones["head"] = _extended(
            motion, bones["head"], joints, "neck", bones["l_knee"].length * HEAD_OF_THIGH
        )
    for node in NODES[1:]:
        if bones[node].length < MINIMUM_PART_M:
            ends = [
                motion.joints[joints[end]] for end in (NODE_PARENT[node], node) if end in joints
            ]
            raise InputError(
                f"{motion.name}: the part that ends in {node!r} is {bones[node].length * 1e3:.3g} "
                f"mm long ({' to '.join(ends)}); "
                f"every body part needs at least {MINIMUM_PART_M * 1e3:.0f} mm, mend the skeleton"
            )
    root_positions, rotations = FileBackedRows(), FileBackedRows()
    for frames in in_blocks(motion.positions, motion.rotations):
        root_positions.append(frames[0][:, joints["root"]])
        own = [bones[node].rotations(*frames) for node in NODES[1:]]
        rotations.append(np.stack([frames[1][:, joints["root"]], *own], axis=1))
    return dataclasses.replace(
        motion,
        joints=NODES,
        parents=(-1, *(NODES.index(NODE_PARENT[node]) for node in NODES[1:])),
        offsets=np.array([np.zeros(3), *(bones[node].offset for node in NODES[1:])]),
        root_positions=root_positions.rows(),
        rotations=rotations.rows(),
    )


def _recognise(motion: Motion) -> tuple[Convention, dict[str, int]]:
    """The convention whose names fit, and the joint of each node it names."""
    there = {plain(name): j for j, name in reversed(list(enumerate(motion.joints)))}
    best: tuple[int, str] | None = None
    for convention in CONVENTIONS:
        found = {
            node: there[name]
            for node, names in convention.joints.items()
            for name in reversed(names)
            if name in there
        }
        missing = [node for node in convention.joints if node not in found]
        if convention.open_ended:
            # No end site at all: the part starts and ends in one joint, and is extended from there.
            for node in list(missing):
                if node == "head" or node.endswith("_hand"):
                    if NODE_PARENT[node] in found:
                        found[node] = found[NODE_PARENT[node]]
                    missing.remove(node)
        if not missing:
            return convention, found
        if best is None or len(missing) < best[0]:
            wanted = " or ".join(convention.joints[missing[0]])
            best = (
                len(missing),
                f"joint {wanted!r} (node {missing[0]!r}) is missing from this {convention.name} "
                "skeleton",
            )
    if best is None or best[0] > len(NODES) / 2:
        known = "; ".join(convention.name for convention in CONVENTIONS)
        raise InputError(
            f"{motion.name}: its joints ({', '.join(motion.joints[:4])}, ...) are named as in no "
            "kind of skeleton that is "
            f"known: {known}; rename them after one of these"
        )
    raise InputError(
        f"{motion.name}: {best[1]}; {len(NODES)} nodes are needed, rename or add the joint"
    )


def _between(motion: Motion, first: int, last: int) -> _Bone:
    """Make a rigid bone between two joints: the recording's own, or one along the chain between."""

    def carried(_: NDArray[np.float64], rotations: NDArray[np.float64]) -> NDArray[np.float64]:
        return rotations[:, last]

    if motion.parents[last] == first or last == first:
        return _Bone(motion.offsets[last] if last != first else np.zeros(3), carried)

    def chord(
        positions: NDArray[np.float64], rotations: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return quaternion_rotate(
            rotations[:, last] * [-1, -1, -1, 1], positions[:, last] - positions[:, first]
        )

    chords = np.concatenate(
        [chord(*frames) for frames in in_blocks(motion.positions, motion.rotations)]
    )
    length = float(np.median(np.linalg.norm(chords, axis=1)))
    if length < MINIMUM_PART_M:
        return _Bone(np.array([0.0, 0.0, length]), carried)
    rest = np.median(_directions(chords), axis=0)
    rest /= max(float(np.linalg.norm(rest)), 1e-12)

    def pointing(
        positions: NDArray[np.float64], rotations: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        # The smallest rotation that takes the rest direction to where the chord points in this
        # frame.
        directions = _directions(chord(positions, rotations))
        swing = np.concatenate([np.cross(rest, directions), 1 + directions @ rest[:, None]], axis=1)
        norms = np.linalg.norm(swing, axis=1, keepdims=True)
        swing = np.where(norms > 1e-9, swing / np.maximum(norms, 1e-9), [1.0, 0.0, 0.0, 0.0])
        return quaternion_multiply(rotations[:, last], swing)

    return _Bone(length * rest, pointing)


def _directions(chords: NDArray[np.float64]) -> NDArray[np.float64]:
    return chords / np.maximum(np.linalg.norm(chords, axis=1), MINIMUM_PART_M)[:, None]


def _spine(motion: Motion, root: int, thorax: int) -> dict[str, _Bone]:
    """Three bones from root to thorax, whatever the number of joints between.

    Three bones are taken as they are; of fewer the longest is split; of more, the joints nearest to
    each third stay.
    """
    chain = [thorax]
    while chain[0] != root:
        if motion.parents[chain[0]] < 0:
            raise InputError(
                f"{motion.name}: {motion.joints[thorax]!r} does not hang on "
                f"{motion.joints[root]!r}; mend the skeleton"
            )
        chain.insert(0, motion.parents[chain[0]])
    lengths = np.linalg.norm(motion.offsets[chain[1:]], axis=1)
    heights = np.concatenate([[0.0], np.cumsum(lengths)])
    # Joints that coincide count once; the last of them bends the next bone. The thorax itself
    # always stays.
    distinct = [
        0,
        *(
            k
            for k in range(1, len(chain) - 1)
            if MINIMUM_PART_M < heights[k] < heights[-1] - MINIMUM_PART_M
        ),
    ]
    distinct = [
        k
        for n, k in enumerate(distinct)
        if n == 0 or heights[k] - heights[distinct[n - 1]] > MINIMUM_PART_M
    ]
    distinct.append(len(chain) - 1)
    while len(distinct) > 4:
        inner = distinct[1:-1]
        spare = max(
            inner,
            key=lambda k: min(abs(heights[k] / heights[-1] - third) for third in (1 / 3, 2 / 3)),
        )
        distinct.remove(spare)
    pieces = [(chain[a], chain[b], 1.0) for a, b in itertools.pairwise(distinct)]
    spans = [heights[b] - heights[a] for a, b in itertools.pairwise(distinct)]
    while len(pieces) < 3:
        longest = int(np.argmax(spans))
        parts = 2 if len(pieces) == 2 else 3
        pieces[longest : longest + 1] = [(*pieces[longest][:2], 1 / parts)] * parts
    bones = [(_between(motion, a, b), fraction) for a, b, fraction in pieces]
    return {
        node: _Bone(bone.offset * fraction, bone.rotations)
        for node, (bone, fraction) in zip(("lowerback", "upperback", "thorax"), bones, strict=True)
    }


def _foot(motion: Motion, ankle: int, foot: _Bone, toe: int) -> _Bone:
    """Lengthen the foot by `TOES_OF_FOOT` where the skeleton ends at the ball of the foot."""
    between = motion.parents[toe]
    ends_at_ball = between == ankle or float(np.linalg.norm(motion.offsets[toe])) < MINIMUM_PART_M
    return _Bone(foot.offset * (1 + TOES_OF_FOOT), foot.rotations) if ends_at_ball else foot


def _extended(
    motion: Motion, end: _Bone, joints: Mapping[str, int], base: str, length: float
) -> _Bone:
    """Extend an end part without length straight on from the bone before it; return others as is.

    Straight on is meant in the axes of the joint at its base: in the rest pose of a BVH these are
    the same for both.
    """
    if end.length >= MINIMUM_PART_M:
        return end
    before = motion.offsets[joints[base]]
    return _Bone(before * (length / max(float(np.linalg.norm(before)), 1e-12)), end.rotations)
