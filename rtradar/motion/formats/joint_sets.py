"""Sets of joints that cameras and body models give, and what of them makes the 22 nodes.

A set says for each node which joint it is, or how far along the line between two joints it lies:
``hip>knee 0.5`` is half way from the hip to the knee. Trunk nodes that a set lacks lie between
those that it has, near to where ASF skeletons have them. ``@`` stands for the side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.motion.skeleton import HAND_OF_FOREARM, NODES, plain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class JointSet:
    """Joints of one source, by node.

    ``joints`` has the plain name of a joint for each node, or two names and a fraction. Where it
    has alternatives the first one that is there counts. Joints of cameras jitter: ``cutoff_hz`` is
    the frequency of which their low-pass leaves half [Hz]. ``head_is_top`` tells whether the joint
    of the head is the top of the head.
    """

    name: str
    joints: Mapping[str, tuple[str, ...]]
    cutoff_hz: float | None
    head_is_top: bool


def _joint_set(
    name: str,
    middle: str,
    sided: str,
    *,
    sides: tuple[str, str] = ("left", "right"),
    cutoff_hz: float | None = None,
    top: bool = False,
) -> JointSet:
    """Make a set from texts such as ``root=hips; neck=neck>head 0.4, neck``."""
    joints = {}
    for prefix, text in (("", middle), ("l_", sided), ("r_", sided)):
        for entry in text.replace("@", sides[prefix == "r_"]).split(";"):
            node, found = entry.split("=")
            joints[prefix + node.strip()] = tuple(found.strip().split(", "))
    return JointSet(name, joints, cutoff_hz, top)


_KINECT_LIMBS = (
    "hip=hip@; knee=knee@; ankle=ankle@; toe=foot@; "
    "shoulder=shoulder@; elbow=elbow@; wrist=wrist@; hand=handtip@, hand@"
)
_HAND = 1 + HAND_OF_FOREARM

JOINT_SETS: tuple[JointSet, ...] = (
    _joint_set(
        "Kinect v1",
        "root=hipcenter; lowerback=spine; upperback=spine>shouldercenter 0.5; "
        "thorax=shouldercenter; neck=shouldercenter>head 0.36; head=head",
        _KINECT_LIMBS,
        cutoff_hz=8.0,
    ),
    _joint_set(
        "Kinect v2",
        "root=spinebase; lowerback=spinebase>spinemid 0.5; upperback=spinemid; "
        "thorax=spineshoulder; neck=neck; head=head",
        _KINECT_LIMBS,
        cutoff_hz=6.0,
    ),
    _joint_set(
        "Azure Kinect",
        # Its neck is where the trunk ends.
        "root=pelvis; lowerback=spinenavel; upperback=spinechest; thorax=neck; "
        "neck=neck>head 0.36; head=head",
        _KINECT_LIMBS,
        cutoff_hz=6.0,
    ),
    _joint_set(
        "Human3.6M",
        # Without toes and hands; the joint of the foot is the ankle.
        "root=hip, pelvis; lowerback=hip>spine 0.5, pelvis>spine 0.5; upperback=spine; "
        "thorax=thorax; neck=thorax>head 0.4; head=head",
        "hip=@hip; knee=@knee; ankle=@foot, @ankle; toe=@foot, @ankle; "
        f"shoulder=@shoulder; elbow=@elbow; wrist=@wrist; hand=@elbow>@wrist {_HAND}",
        sides=("l", "r"),
        top=True,
    ),
    _joint_set(
        "Berkeley MHAD",
        "root=hips; lowerback=spine1; upperback=spine2; thorax=spine2>neck 0.5; neck=neck; "
        "head=headend",
        # Its hand has an end that is where the hand begins.
        "hip=@upleg; knee=@leg; ankle=@foot; toe=@toeend, @toebase; "
        f"shoulder=@arm; elbow=@forearm; wrist=@hand; hand=@forearm>@hand {_HAND}",
        top=True,
    ),
    _joint_set(
        "SMPL, HumanML3D",
        "root=pelvis; lowerback=spine1; upperback=spine2; thorax=spine3; neck=neck; head=head",
        "hip=@hip; knee=@knee; ankle=@ankle; toe=@foot; "
        f"shoulder=@shoulder; elbow=@elbow; wrist=@wrist; hand=@elbow>@wrist {_HAND}",
    ),
)
"""Every set that is understood."""


def recognise(where: str, names: Sequence[str]) -> JointSet:
    """Return the set that the names of joints are of; an `InputError` names what is missing."""
    there = {plain(name) for name in names}
    lacking = [_missing(known, there) for known in JOINT_SETS]
    best = min(range(len(JOINT_SETS)), key=lambda k: len(lacking[k]))
    if not lacking[best]:
        return JOINT_SETS[best]
    if len(lacking[best]) > len(NODES) / 2:
        kinds = "; ".join(known.name for known in JOINT_SETS)
        raise InputError(
            f"{where}: its joints ({', '.join(names[:4])}, ...) are named as in no set that is "
            f"known: {kinds}; rename them after one of these"
        )
    raise InputError(
        f"{where}: joints {', '.join(lacking[best])} of {JOINT_SETS[best].name} are missing; "
        "rename or add them"
    )


def _missing(known: JointSet, there: set[str]) -> list[str]:
    """Names of the joints of a set that are not there, where no alternative is."""
    missing = []
    for choices in known.joints.values():
        wanted = [_parts(choice)[0] for choice in choices]
        if not any(there.issuperset(names) for names in wanted):
            missing += [name for name in wanted[-1] if name not in there]
    return list(dict.fromkeys(missing))


def _parts(choice: str) -> tuple[list[str], float]:
    """Names of one joint or two, and the fraction of the way from the first to the second."""
    names, _, fraction = choice.partition(" ")
    return names.split(">"), float(fraction or 0)


def node_positions(joint_set: JointSet, names: Sequence[str], positions: Array) -> Array:
    """Positions (frame, node, 3) of the nodes from those of joints (frame, joint, 3)."""
    column = {plain(name): k for k, name in reversed(list(enumerate(names)))}
    nodes = np.empty((len(positions), len(NODES), 3))
    for k, node in enumerate(NODES):
        choices = (_parts(choice) for choice in joint_set.joints[node])
        joints, fraction = next(found for found in choices if set(found[0]) <= column.keys())
        first, last = (positions[:, column[joint]] for joint in (joints[0], joints[-1]))
        nodes[:, k] = first + fraction * (last - first)
    return nodes
