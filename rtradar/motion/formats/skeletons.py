"""Rigid motions, of files whose bones rotate and of joints that were measured one by one.

A bone has channels, whose values follow each other in a frame: positions, and angles about the axes
of the bone. It rotates with its parent, and on top of that by its own angles.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError
from rtradar.motion.motion import Motion
from rtradar.motion.quaternions import (
    quaternion_multiply,
    quaternion_rotate,
    quaternions_to_world,
    sign_continuous,
    smallest_rotation,
    to_world,
)
from rtradar.motion.skeleton import MINIMUM_PART_M, NODE_PARENT, NODES
from rtradar.system.row_files import FileBackedRows, column, in_blocks

Array = NDArray[np.float64]

FRAMES_AT_ONCE = 512
"""Number of frames kept as Python's numbers, which take four times the memory of an array's."""


@dataclass
class Bone:
    """One bone as the file describes it.

    ``channels`` are "tx" to "rz", and ``order`` is that in which the angles are applied, in
    capitals about axes that rotate along. They are meant in axes that ``axis`` [deg] rotates, in
    its own order. ``column`` is the index of the first channel among those of all bones; the
    parent is -1 for the root.
    """

    name: str
    line: int
    parent: int = -1
    offset: Array = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axis: Array = field(default_factory=lambda: np.zeros(3))
    axis_order: str = "xyz"
    channels: tuple[str, ...] = ()
    order: str = ""
    column: int = 0

    def places(self, values: Array) -> Array:
        """Positions relative to the parent, (frame, 3); (1, 3) without channels for it."""
        moved = [k for k, name in enumerate(self.channels) if name[0] == "t"]
        if not moved:
            return self.offset[None]
        places = np.tile(self.offset, (len(values), 1))
        axes = ["xyz".index(self.channels[k][1]) for k in moved]
        places[:, axes] = column(values, [self.column + k for k in moved])
        return places


def kept_rows(rows: Iterable[list[float]], bones: Sequence[Bone]) -> Array:
    """Array (frame, channel) of rows, in a file where they are many; bones get their columns."""
    width = 0
    for bone in bones:
        bone.column, width = width, width + len(bone.channels)
    found, rest = FileBackedRows(), iter(rows)
    while block := list(itertools.islice(rest, FRAMES_AT_ONCE)):
        found.append(np.array(block).reshape(-1, width))
    return found.rows()


def chain_to(bones: Sequence[Bone], last: int) -> list[int]:
    """Indices of the bones from the root to one of them."""
    chain = [last]
    while bones[chain[0]].parent >= 0:
        chain.insert(0, bones[chain[0]].parent)
    return chain


def carrier_of(joints: Sequence[Bone], values: Array) -> int:
    """Find the last joint of an unbranched chain from the root whose own position moves."""
    top, carrier = 0, 0
    while True:
        # Where the tree branches the body begins, and the chain ends.
        children = [j for j, joint in enumerate(joints) if joint.parent == top]
        if len(children) != 1:
            return carrier
        top = children[0]
        # A joint that moves in its parent by less than a millionth of its distance is a bone.
        least = 1e-6 * (1 + np.abs(joints[top].offset).max())
        if np.ptp(joints[top].places(values), axis=0).max() > least:
            carrier = top


def posed(
    path: Path,
    bones: Sequence[Bone],
    values: Array,
    joints: Sequence[tuple[int, int]],
    offsets: Array,
    rate_hz: float,
) -> Motion:
    """Make the motion of a rigid skeleton, as if y were up in the file.

    ``joints`` has a pair of indices for each joint, the root first: the bone that becomes the
    joint, and the bone whose rotation it takes. ``offsets`` (joint, 3) are the joints' offsets.
    """
    roots, rotations = FileBackedRows(), FileBackedRows()
    # Recordings may be larger than memory, so some frames are posed at a time. The place of the
    # root is the sum of the chain above it.
    for (frames,) in in_blocks(values):
        turned = _rotations(bones, frames)
        places = np.zeros((len(frames), 3))
        for number in chain_to(bones, joints[0][0]):
            parent, own = bones[number].parent, bones[number].places(frames)
            places += own if parent < 0 else quaternion_rotate(turned[:, parent], own)
        roots.append(to_world(places))
        rotations.append(quaternions_to_world(turned[:, [carrier for _, carrier in joints]]))
    # Bones that are left out do not count in the indices of parents.
    index = {bone: joint for joint, (bone, _) in enumerate(joints)}
    return Motion(
        name=path.stem,
        joints=tuple(bones[bone].name for bone in index),
        parents=tuple(index.get(bones[bone].parent, -1) for bone in index),
        offsets=to_world(offsets),
        root_positions=roots.rows(),
        rotations=rotations.rows(),
        rate_hz=rate_hz,
    )


def _rotations(bones: Sequence[Bone], values: Array) -> Array:
    """Rotations of all bones (frame, bone, 4) in the axes of the file."""
    world: list[Rotation] = []
    for bone in bones:
        local = Rotation.identity(len(values))
        if bone.order:
            own = [bone.column + bone.channels.index("r" + axis) for axis in bone.order.lower()]
            local = Rotation.from_euler(bone.order, values[:, own], degrees=True)
        # ASF: the angles are meant in axes of the bone, C R C^-1.
        if bone.axis.any():
            axes = Rotation.from_euler(bone.axis_order, bone.axis, degrees=True)
            local = axes * local * axes.inv()
        world.append(local if bone.parent < 0 else world[bone.parent] * local)
    return np.stack([rotation.as_quat() for rotation in world], axis=1)


# -- from places of joints -------------------------------------------------------------------------

_ON_THE_PELVIS = ("lowerback", "upperback", "hip", "knee", "ankle", "toe")
"""Nodes whose bones rotate with the pelvis where they do not bend, the others with the chest."""


def rigid_motion(name: str, centres: Array, pelvis: Array, thorax: Array, rate_hz: float) -> Motion:
    """Make the motion of a rigid skeleton whose bones point as the joints do.

    A bone is as long as its joints are apart in the median. Joints do not say how a bone is rotated
    about itself: seen from pelvis or chest it takes from frame to frame the smallest rotation to
    its next direction, so that nothing on it spins. Arguments are as `joint_centres` gives them, in
    the world [m].
    """
    # Bones from joint to joint, each of which needs a direction in every frame.
    parents = [NODES.index(NODE_PARENT[node]) for node in NODES[1:]]
    bones = centres[:, 1:] - centres[:, parents]
    spans = np.linalg.norm(bones, axis=2)
    for bone, frame in np.argwhere(~(spans.T > MINIMUM_PART_M / 2)):
        ends = f"{NODE_PARENT[NODES[1 + bone]]!r} and {NODES[1 + bone]!r}"
        raise InputError(
            f"{name}: {ends} are {spans[frame, bone] * 1e3:.3g} mm apart in frame {frame + 1}; "
            f"every body part needs at least {MINIMUM_PART_M * 1e3 / 2:g} mm, mend the markers "
            "about it"
        )
    # Each bone is followed as seen from the part of the trunk that carries it, so that a person who
    # turns round does not twist their limbs.
    hips, chest = (
        sign_continuous(Rotation.from_matrix(axes).as_quat()) for axes in (pelvis, thorax)
    )
    below = [node.split("_")[-1] in _ON_THE_PELVIS for node in NODES[1:]]
    carriers = np.stack([hips if low else chest for low in below], axis=1)
    directions = quaternion_rotate(carriers * [-1, -1, -1, 1], bones / spans[..., None])
    rotations = quaternion_multiply(carriers, _followed(directions))
    rotations /= np.linalg.norm(rotations, axis=2, keepdims=True)
    # The offset is the first direction with the median length, and rotations lead on from there.
    lengths = np.median(spans, axis=0)
    return Motion(
        name=name,
        joints=NODES,
        parents=(-1, *parents),
        offsets=np.concatenate([np.zeros((1, 3)), directions[0] * lengths[:, None]]),
        root_positions=centres[:, 0],
        rotations=np.concatenate([hips[:, None], rotations], axis=1),
        rate_hz=rate_hz,
    )


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Begin and end, which is one past the last, of each run of True in a mask (frame,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask, [0]]))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _followed(directions: Array) -> Array:
    """Rotations (frame, bone, 4) of directions (frame, bone, 3) from the first to each frame."""
    rotations = np.empty((*directions.shape[:2], 4))
    rotations[0] = [0.0, 0.0, 0.0, 1.0]
    # The smallest rotation from frame to frame, on top of all before it.
    for frame, step in enumerate(smallest_rotation(directions[:-1], directions[1:])):
        rotations[frame + 1] = quaternion_multiply(step, rotations[frame])
    return rotations / np.linalg.norm(rotations, axis=2, keepdims=True)


def unit(vectors: Array) -> Array:
    """Unit vectors along some."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def level_axes(left: Array, forward: Array) -> Array:
    """Axes with this left, and forward as near to ``forward`` as that allows."""
    y = unit(left)
    z = unit(np.cross(forward, y))
    return np.stack([np.cross(y, z), y, z], axis=2)
