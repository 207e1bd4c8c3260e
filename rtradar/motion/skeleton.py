"""The 22 nodes of the paper's body, and the retargeting of any skeleton to them, a rigid tree.

HDM05 and CMU have 31 joints. The chain of 24 joints (that of SMPL) leaves out the thumbs, and the
joints inside what moves as one: upper neck, ball of the foot, radius, hand. Its neck and collars
are not separated in HDM05, they are all at the thorax; without the three and with the top of the
head added, 22 nodes and 21 bones remain, one a body part.

Where one bone of the recording joins two nodes, that bone is taken as it is. Where a chain joins
them (ankle to toe tip over the ball of the foot, elbow to wrist over the twist joint, wrist to
finger tips, base to top of the head, thorax to shoulder in a BVH whose neck and collar are
separate) the part is one rigid bone that always points from the one joint to the other and has the
median of their distances as its length. Toe tips are up to 3 cm off by that in push-off, the others
millimetres.

Joints are known by their names in the files of many programs. The table is ``names.toml`` beside
this module. Of one's own names a file of the same kind is made, and named by the environment
variable ``RTRADAR_NAMES``.
"""

from __future__ import annotations

import dataclasses
import itertools
import os
import re
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError, prefixed
from rtradar.motion.motion import Motion
from rtradar.motion.quaternions import quaternion_multiply, quaternion_rotate, smallest_rotation
from rtradar.system.checks import brief, check_keys, read_toml, tables_at
from rtradar.system.row_files import FileBackedRows, in_blocks

Array = NDArray[np.float64]

OWN_NAMES = "RTRADAR_NAMES"
"""Environment variable that names a table of one's own."""

_Kind = Literal["skeletons", "joints", "markers"]
_KEYS = ("sides", "middle", "sided", "like", "complete", "low_pass_hz", "head_is_top", "up")


@dataclass(frozen=True)
class Convention:
    """Joint names of one kind of file, as `plain` gives them.

    ``joints`` has the alternatives for each node, of which the first one that is there counts. The
    others are described in ``names.toml``; ``open_ended`` is not ``complete``, and such a skeleton
    may lack some nodes.
    """

    name: str
    joints: Mapping[str, tuple[str, ...]]
    open_ended: bool = True
    low_pass_hz: float | None = None
    head_is_top: bool = False
    up: str = ""
    may_lack: tuple[str, ...] = ()

    def found(self, there: Container[str]) -> dict[str, str]:
        """First alternative for each node whose joints are all there."""
        known = {}
        for node, choices in self.joints.items():
            whole = [choice for choice in choices if all(one in there for one in _names(choice))]
            if whole:
                known[node] = whole[0]
        return known

    def missing(self, there: Container[str]) -> list[str]:
        """Joints that are not there, with their alternatives, where none of these is."""
        known = self.found(there)
        known |= dict.fromkeys(self.may_lack, "")
        lacking = dict[str, None]()
        # A node by one joint lacks one of its alternatives; one by several joints lacks those that
        # are not there.
        for choices in (self.joints[node] for node in self.joints if node not in known):
            if all(_names(choice) == [choice] for choice in choices):
                lacking[" or ".join(choices)] = None
            else:
                lacking |= dict.fromkeys(one for one in _names(choices[-1]) if one not in there)
        return list(lacking)


def plain(name: str) -> str:
    """A joint's name without namespace (``mixamorig:``, ``Bip01``), case, spaces, underscores."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"^(.*:|mixamorig\d*|[Bb]ip\d+)", "", name).lower())


def conventions(kind: _Kind) -> tuple[Convention, ...]:
    """Every kind of skeleton, joints or markers that is understood; one's own come first."""
    own, known = os.environ.get(OWN_NAMES, ""), _read(Path(__file__).with_name("names.toml"), kind)
    return (*(_read(Path(own), kind) if own else ()), *known)


@lru_cache(maxsize=4)
def _read(path: Path, kind: str) -> tuple[Convention, ...]:
    named = dict[str, Mapping[str, Any]]()
    content = read_toml(path, "names of joints", "check the path")
    with prefixed(f"{path}: "):
        tables = list(tables_at(kind, content))
    for where, table in tables:
        check_keys(f"{path}: {where}", table, ("name",), _KEYS)
        named[table["name"]] = {**named.get(table.get("like", ""), {}), **table}
    return tuple(_convention(path, table, kind) for table in named.values())


def _convention(path: Path, table: Mapping[str, Any], kind: str) -> Convention:
    open_ended = not table.get("complete", False)
    try:
        # Names of the limbs are written once, with a place for the side.
        texts = dict(table["middle"])
        for side, name in zip("lr", table["sides"], strict=True):
            for node, text in table["sided"].items():
                texts[f"{side}_{node}"] = text.replace("@", name)
        joints = {node: tuple(re.split(r",\s*", text)) for node, text in texts.items()}
        for choice in itertools.chain(*joints.values()):
            _fraction(choice)
            if kind == "skeletons" and _names(choice) != [choice]:
                raise ValueError(f"{choice}: a node of a skeleton is one joint")
        if kind == "skeletons" and open_ended:
            # No end site at all: the part starts and ends in one joint, and is extended from there.
            for end in ("head", "l_hand", "r_hand"):
                joints[end] += joints[NODE_PARENT[end]]
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{path}: {table['name']}: sides, middle and sided are needed, as in names.toml of "
            f"rtradar ({brief(str(error))[1:-1]})"
        ) from None
    own = {key: table[key] for key in ("low_pass_hz", "head_is_top", "up") if key in table}
    if kind == "skeletons" and open_ended:
        own["may_lack"] = ("thorax",)
    return Convention(table["name"], joints, open_ended, **own)


def _names(choice: str) -> list[str]:
    """Names of the joints in a text such as ``a+b>c 0.4``."""
    return re.split("[+>]", choice.partition(" ")[0])


def _fraction(choice: str) -> float:
    return float(choice.partition(" ")[2] or 0)


def recognise(where: str, names: Sequence[str], kind: _Kind = "joints") -> Convention:
    """Return the convention of joints by their names; an `InputError` names what is missing."""
    there = {plain(name) for name in names}
    tried = [(known, known.missing(there)) for known in conventions(kind)]
    best, lacking = min(tried, key=lambda one: len(one[1]))
    if lacking:
        raise unknown(where, names, tried)
    return best


def unknown(
    where: str, names: Sequence[str], tried: Sequence[tuple[Convention, Sequence[str]]]
) -> InputError:
    """Return the error for names of joints that fit no convention, of which these are lacking."""
    nearest, lacking = min(tried, key=lambda one: len(one[1]))
    if len(lacking) > len(nearest.joints) / 2:
        return InputError(
            f"{where}: its joints ({', '.join(names[:4])}, ...) are named as in no set that is "
            f"known: {'; '.join(one.name for one, _ in tried)}; rename them after one of these, or "
            f"name them in a table of your own ({OWN_NAMES})"
        )
    return InputError(
        f"{where}: joints {', '.join(lacking)} of {nearest.name} are missing; rename or add them"
    )


def node_positions(
    convention: Convention, names: Sequence[str], positions: Array, nodes: Sequence[str]
) -> Array:
    """Positions (frame, node, 3) of the nodes from those of joints (frame, joint, 3)."""
    # Reversed, so that of names that are alike the first one counts.
    column = {plain(name): k for k, name in reversed(list(enumerate(names)))}
    found, choices = np.empty((len(positions), len(nodes), 3)), convention.found(column)
    for k, node in enumerate(nodes):
        # A node is the mean of joints `a+b`, or lies a fraction of the way from one such mean to
        # another, `a+b>c 0.4`.
        ends = [
            np.mean([positions[:, column[name]] for name in end.split("+")], axis=0)
            for end in choices[node].partition(" ")[0].split(">")
        ]
        found[:, k] = ends[0] + _fraction(choices[node]) * (ends[-1] - ends[0])
    return found


def _chain(side: str, *nodes: str) -> dict[str, str]:
    """Parents of a limb's nodes; the first name is that of the node from which it starts."""
    limb = [nodes[0], *(f"{side}_{node}" for node in nodes[1:])]
    return {node: parent for parent, node in itertools.pairwise(limb)}


NODE_PARENT: Mapping[str, str] = {
    **_chain("l", "root", "hip", "knee", "ankle", "toe"),
    **_chain("r", "root", "hip", "knee", "ankle", "toe"),
    "lowerback": "root",
    "upperback": "lowerback",
    "thorax": "upperback",
    "neck": "thorax",
    "head": "neck",
    **_chain("l", "thorax", "shoulder", "elbow", "wrist", "hand"),
    **_chain("r", "thorax", "shoulder", "elbow", "wrist", "hand"),
}
"""Parent of each node but the root, parents first: the 21 bones."""

NODES: tuple[str, ...] = ("root", *NODE_PARENT)
"""The paper's 22 nodes."""

NODE_PARENTS: tuple[int, ...] = (-1, *(NODES.index(parent) for parent in NODE_PARENT.values()))
"""Index of the parent of each node, -1 for the root."""


def of_node(places: Array, name: str) -> Array:
    """Positions (..., 3) of a node among all (..., node, 3)."""
    return places[..., NODES.index(name), :]


def middle(places: Array, name: str) -> Array:
    """Positions (..., 3) of the middle between both sides of a node."""
    return (of_node(places, f"l_{name}") + of_node(places, f"r_{name}")) / 2


MINIMUM_PART_M = 0.01
"""No body part is shorter than this; joints nearer to each other count as one."""

HEAD_OF_THIGH, HAND_OF_FOREARM, TOES_OF_FOOT = 0.130 / 0.245, 0.108 / 0.146, 0.5
"""Ratios of lengths for skeletons that end at the base of the head, the wrist, or the ball of the
foot: head and thigh, hand and forearm (Drillis and Contini 1966), and ball to toe tip and ankle to
ball (HDM05)."""


@dataclass(frozen=True)
class _Bone:
    """A vector in the bone's own axes, and a function that gives its rotations (frame, 4).

    The function takes the positions and rotations of all joints in some frames.
    """

    offset: Array
    rotations: Callable[[Array, Array], Array]

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.offset))


def to_nodes(motion: Motion) -> Motion:
    """Retarget a motion to the 22 nodes; an `InputError` names a joint that is missing."""
    if motion.joints == NODES:
        return motion
    convention, joints = _recognise(motion)
    # A bone for every part: those between two named joints, and the three of the spine.
    named = [node for node in joints if node not in ("root", "thorax")]
    bones = {node: _between(motion, joints[NODE_PARENT[node]], joints[node]) for node in named}
    bones |= _spine(motion, joints["root"], joints["thorax"])
    # Skeletons that end at wrist, neck or ball of the foot get hands, heads and toes of usual
    # length.
    if convention.open_ended:
        for side in ("l", "r"):
            ankle, wrist, toe = (f"{side}_{node}" for node in ("ankle", "wrist", "toe"))
            bones[toe] = _foot(motion, joints[ankle], bones[toe], joints[toe])
            length = bones[wrist].length * HAND_OF_FOREARM
            bones[f"{side}_hand"] = _extended(motion, bones[f"{side}_hand"], joints[wrist], length)
        length = bones["l_knee"].length * HEAD_OF_THIGH
        bones["head"] = _extended(motion, bones["head"], joints["neck"], length)
    # A part without length has no direction.
    for node, parent in NODE_PARENT.items():
        if bones[node].length < MINIMUM_PART_M:
            known = [joints[end] for end in (parent, node) if end in joints]
            ends = " to ".join(motion.joints[joint] for joint in known)
            raise InputError(
                f"{motion.name}: the part that ends in {node!r} is {bones[node].length * 1e3:.3g} "
                f"mm long ({ends}); every body part needs at least {MINIMUM_PART_M * 1e3:.0f} mm, "
                "mend the skeleton"
            )
    # Rotations of all bones, some frames at a time.
    root_positions, rotations = FileBackedRows(), FileBackedRows()
    for frames in in_blocks(motion.positions, motion.rotations):
        root_positions.append(frames[0][:, joints["root"]])
        own = [bones[node].rotations(*frames) for node in NODES[1:]]
        rotations.append(np.stack([frames[1][:, joints["root"]], *own], axis=1))
    return dataclasses.replace(
        motion,
        joints=NODES,
        parents=NODE_PARENTS,
        offsets=np.array([np.zeros(3), *(bones[node].offset for node in NODES[1:])]),
        root_positions=root_positions.rows(),
        rotations=rotations.rows(),
    )


def _recognise(motion: Motion) -> tuple[Convention, dict[str, int]]:
    """The convention whose names fit, and the joint of each node it names."""
    there = {plain(name): j for j, name in reversed(list(enumerate(motion.joints)))}
    convention = recognise(motion.name, motion.joints, "skeletons")
    found = {node: there[name] for node, name in convention.found(there).items()}
    if "thorax" not in found:  # without a neck the head's own parent is where the trunk ends
        found["thorax"] = motion.parents[found["neck"]]
        if found["thorax"] < 0:
            raise unknown(
                motion.name,
                motion.joints,
                [(convention, [" or ".join(convention.joints["thorax"])])],
            )
    return convention, found


def _between(motion: Motion, first: int, last: int) -> _Bone:
    """Make a rigid bone between two joints: the recording's own, or one along the chain between."""

    def carried(_: Array, rotations: Array) -> Array:
        return rotations[:, last]

    if motion.parents[last] == first or last == first:
        return _Bone(motion.offsets[last] if last != first else np.zeros(3), carried)

    # A chain of joints becomes one bone: the chord between its ends, in the axes of the last joint.
    def chord(positions: Array, rotations: Array) -> Array:
        apart = positions[:, last] - positions[:, first]
        return quaternion_rotate(rotations[:, last] * [-1, -1, -1, 1], apart)

    frames = in_blocks(motion.positions, motion.rotations)
    chords = np.concatenate([chord(*some) for some in frames])
    length = float(np.median(np.linalg.norm(chords, axis=1)))
    if length < MINIMUM_PART_M:
        return _Bone(np.array([0.0, 0.0, length]), carried)
    # The bone's own vector is the usual direction of the chord, from which it swings a little.
    rest = np.median(_directions(chords), axis=0)
    rest /= max(float(np.linalg.norm(rest)), 1e-12)

    def pointing(positions: Array, rotations: Array) -> Array:
        directions = _directions(chord(positions, rotations))
        swing = smallest_rotation(np.broadcast_to(rest, directions.shape), directions)
        return quaternion_multiply(rotations[:, last], swing)

    return _Bone(length * rest, pointing)


def _directions(chords: Array) -> Array:
    return chords / np.maximum(np.linalg.norm(chords, axis=1), MINIMUM_PART_M)[:, None]


def _spine(motion: Motion, root: int, thorax: int) -> dict[str, _Bone]:
    """Three bones from root to thorax, whatever the number of joints between.

    Three bones are taken as they are; of fewer the longest is split; of more, the joints nearest to
    each third stay.
    """
    # The joints from root to thorax, and how far along the trunk each is.
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
    inner = range(1, len(chain) - 1)
    far = [k for k in inner if MINIMUM_PART_M < heights[k] < heights[-1] - MINIMUM_PART_M]
    pairs = itertools.pairwise([0, *far])
    distinct = [0, *(k for before, k in pairs if heights[k] - heights[before] > MINIMUM_PART_M)]
    distinct.append(len(chain) - 1)

    def off_thirds(k: int) -> float:
        return min(abs(heights[k] / heights[-1] - third) for third in (1 / 3, 2 / 3))

    # Four ends make three bones.
    while len(distinct) > 4:
        distinct.remove(max(distinct[1:-1], key=off_thirds))
    ends = list(itertools.pairwise(distinct))
    parts = [(chain[a], chain[b], 1.0) for a, b in ends]
    if len(parts) < 3:
        longest = int(np.argmax([heights[b] - heights[a] for a, b in ends]))
        count = 4 - len(parts)
        parts[longest : longest + 1] = [(*parts[longest][:2], 1 / count)] * count
    bones = [(_between(motion, a, b), fraction) for a, b, fraction in parts]
    return {
        node: _Bone(bone.offset * fraction, bone.rotations)
        for node, (bone, fraction) in zip(("lowerback", "upperback", "thorax"), bones, strict=True)
    }


def _foot(motion: Motion, ankle: int, foot: _Bone, toe: int) -> _Bone:
    """Lengthen the foot by `TOES_OF_FOOT` where the skeleton ends at the ball of the foot."""
    between = motion.parents[toe]
    ends_at_ball = between == ankle or float(np.linalg.norm(motion.offsets[toe])) < MINIMUM_PART_M
    return _Bone(foot.offset * (1 + TOES_OF_FOOT), foot.rotations) if ends_at_ball else foot


def _extended(motion: Motion, end: _Bone, base: int, length: float) -> _Bone:
    """Extend an end part without length straight on from the bone before it; return others as is.

    Straight on is meant in the axes of the joint at its base: in the rest pose of a BVH these are
    the same for both.
    """
    if end.length >= MINIMUM_PART_M:
        return end
    before = motion.offsets[base]
    return _Bone(before * (length / max(float(np.linalg.norm(before)), 1e-12)), end.rotations)
