"""BVH motions: any channel order, positions on any joint, y up.

The global rotation of a joint turns the offsets of its children, so joint j of the `Motion` carries the rotation of its
parent. End sites become joints named ``<parent>_end``, so that the rotation of a last joint is kept even where its end
site has no length.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError
from rtradar.motion.axes import quaternions_to_world, to_world
from rtradar.motion.motion import Motion
from rtradar.motion.quaternions import rotate
from rtradar.motion.textfile import check_size, fail, numbers, read_lines

UNITS_M = {"metre": 1.0, "CMU unit (0.45 inch)": 0.0254 / 0.45, "inch": 0.0254, "centimetre": 0.01, "millimetre": 0.001}
"""Length units that BVH files use; the format itself has none."""

_REACH_M = (0.7, 1.5)
"""Length of bones from the root to the farthest end, person: 0.56 to 0.72 of a standing height of 1.25 to 2.1 m."""

_SHORTEST_S, _LONGEST_S = 1e-6, 10.0
"""What a frame may last."""

_STRETCH_M = 0.02
"""Bones whose position channels move more than this are not rigid."""


@dataclass
class _Joint:
    name: str
    parent: int
    line: int
    offset: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    channels: tuple[str, ...] = ()


def load_bvh(path: Path, unit_m: float | None = None) -> Motion:
    """Read a BVH file.

    Position channels of joints below the root replace the joint's offset; they must be constant but for the joint
    that carries the whole body (Bandai-Namco: ``Hips`` under a still ``joint_Root``), which becomes the root.

    Parameters
    ----------
    path : Path
    unit_m : float, optional
        Metres in one unit of the file; found from the size of the person where not given.

    Raises
    ------
    InputError
        Naming file and line.
    """
    lines = read_lines(path, "BVH motion")
    joints, first = _read_hierarchy(lines, path)
    rate_hz, values = _read_frames(lines, first, sum(len(joint.channels) for joint in joints), path)
    check_size(path, len(joints), len(values))
    local, positions = _channels(joints, values)
    world: list[Rotation] = []
    for joint, rotation in zip(joints, local, strict=True):
        world.append(rotation if joint.parent < 0 else world[joint.parent] * rotation)
    quaternions = np.stack([rotation.as_quat() for rotation in world], axis=1)

    places = np.zeros((len(values), 3))
    top = _carrier(joints, positions)
    for ancestor in _chain(joints, top):  # from the file's root down to the joint that carries the body
        parent = joints[ancestor].parent
        places = positions[ancestor] if parent < 0 else places + rotate(quaternions[:, parent], positions[ancestor])

    kept = [j for j in range(len(joints)) if top in _chain(joints, j)]
    renumber = {j: k for k, j in enumerate(kept)}
    offsets = np.array([np.median(positions[j], axis=0) for j in kept])
    offsets[0] = 0.0
    scale = _unit(joints, kept, offsets, path) if unit_m is None else unit_m
    if not 0 < scale < np.inf:
        raise InputError(f"{path}: unit_m = {scale}; it must be positive (0.01 for centimetres)")
    for k, j in enumerate(kept[1:], start=1):
        stretch = float(np.linalg.norm(positions[j] - offsets[k], axis=1).max()) * scale
        if stretch > _STRETCH_M:
            raise fail(
                path, joints[j].line, f"bone to {joints[j].name!r} stretches by {stretch * 100:.1f} cm; bones must be rigid"
            )
    carriers = [kept[0]] + [joints[j].parent for j in kept[1:]]
    return Motion(
        name=path.stem,
        joints=tuple(joints[j].name for j in kept),
        parents=(-1, *(renumber[joints[j].parent] for j in kept[1:])),
        offsets=to_world(offsets * scale),
        root_positions=to_world(places * scale),
        rotations=quaternions_to_world(quaternions[:, carriers]),
        rate_hz=rate_hz,
    )


def _read_hierarchy(lines: list[str], path: Path) -> tuple[list[_Joint], int]:
    """Joints in the file's order (parents first), and the line number of MOTION."""
    joints: list[_Joint] = []
    stack: list[int] = []
    pending = -1
    if not any(line.split()[:1] == ["HIERARCHY"] for line in lines):
        raise fail(path, 1, "no HIERARCHY; this is not a BVH file")
    for number, raw in enumerate(lines, start=1):
        words = raw.split()
        if not words or words[0] == "HIERARCHY":
            continue
        key = words[0].upper()
        if key == "MOTION":
            if stack or not joints:
                raise fail(path, number, "MOTION before the hierarchy ends; a brace is missing")
            return joints, number
        if key in ("ROOT", "JOINT", "END"):
            if (key == "ROOT") == bool(joints):
                raise fail(path, number, "a BVH file must have exactly one ROOT, first")
            if key != "ROOT" and not stack:
                raise fail(path, number, f"{words[0]} outside the braces of the root")
            parent = stack[-1] if stack else -1
            name = f"{joints[parent].name}_end" if key == "END" else " ".join(words[1:])
            if not name or any(joint.name == name for joint in joints):
                raise fail(path, number, f"joint {name!r}: every joint needs a name of its own")
            joints.append(_Joint(name, parent, number))
            check_size(path, len(joints))
            pending = len(joints) - 1
        elif key == "{":
            if pending < 0:
                raise fail(path, number, "an opening brace without a joint before it")
            stack.append(pending)
            pending = -1
        elif key == "}":
            if not stack:
                raise fail(path, number, "a closing brace too many")
            stack.pop()
        elif key == "OFFSET" and stack:
            offset = numbers(words[1:], path, number)
            if len(offset) != 3:
                raise fail(path, number, f"OFFSET has {len(offset)} values; it needs three")
            joints[stack[-1]].offset = np.array(offset)
        elif key == "CHANNELS" and stack:
            joints[stack[-1]].channels = _channel_names(words, path, number)
        else:
            raise fail(path, number, f"{words[0][:40]!r} is not expected in a BVH hierarchy")
    raise fail(path, len(lines), "no MOTION; the file may be cut off")


def _channel_names(words: list[str], path: Path, line: int) -> tuple[str, ...]:
    names = tuple(word.lower() for word in words[2:])
    allowed = {axis + kind for axis in "xyz" for kind in ("position", "rotation")}
    if len(words) < 2 or words[1] != str(len(names)) or not set(names) <= allowed or len(set(names)) != len(names):
        raise fail(path, line, "CHANNELS needs a count and as many different Xposition ... Zrotation")
    return names


def _read_frames(lines: list[str], first: int, width: int, path: Path) -> tuple[float, NDArray[np.float64]]:
    rows: list[list[float]] = []
    frames: int | None = None
    interval: float | None = None
    for number, raw in enumerate(lines[first:], start=first + 1):
        words = raw.replace(":", ": ").split()
        if not words:
            continue
        if words[0].lower() == "frames:":
            count = numbers(words[1:2], path, number)
            if not count or count[0] < 1 or count[0] != int(count[0]):
                raise fail(path, number, "Frames: needs a positive whole number")
            frames = int(count[0])
        elif [word.lower() for word in words[:2]] == ["frame", "time:"]:
            time = numbers(words[2:3], path, number)
            if not time or not _SHORTEST_S <= time[0] <= _LONGEST_S:
                raise fail(path, number, f"Frame Time: needs a positive number of seconds, {_SHORTEST_S:g} to {_LONGEST_S:g}")
            interval = time[0]
        elif frames is None or interval is None:
            raise fail(path, number, "Frames: and Frame Time: must stand before the values")
        else:
            row = numbers(words, path, number)
            if len(row) != width:
                raise fail(path, number, f"frame {len(rows) + 1} has {len(row)} values where the hierarchy has {width} channels")
            rows.append(row)
    if frames is None or interval is None:
        raise fail(path, len(lines), "no Frames: or Frame Time:; the file may be cut off")
    if len(rows) != frames:
        raise InputError(f"{path}: {len(rows)} frames where the header promises {frames}; the file may be cut off")
    rate_hz = 1 / interval
    # Frame times are written with few digits (0.0333333, .0083333): a whole rate is meant.
    return (round(rate_hz) if abs(rate_hz - round(rate_hz)) < 1e-3 * rate_hz else rate_hz), np.array(rows)


def _channels(joints: list[_Joint], values: NDArray[np.float64]) -> tuple[list[Rotation], list[NDArray[np.float64]]]:
    """Local rotation and position (frame, 3) of each joint."""
    rotations: list[Rotation] = []
    positions: list[NDArray[np.float64]] = []
    column = 0
    for joint in joints:
        data = values[:, column : column + len(joint.channels)]
        column += len(joint.channels)
        turns = [k for k, name in enumerate(joint.channels) if name.endswith("rotation")]
        order = "".join(joint.channels[k][0].upper() for k in turns)
        rotations.append(Rotation.from_euler(order, data[:, turns], degrees=True) if order else Rotation.identity(len(values)))
        place = np.tile(joint.offset, (len(values), 1))
        for k, name in enumerate(joint.channels):
            if name.endswith("position"):
                place[:, "xyz".index(name[0])] = data[:, k]
        positions.append(place)
    return rotations, positions


def _chain(joints: list[_Joint], joint: int) -> list[int]:
    chain = [joint]
    while joints[chain[0]].parent >= 0:
        chain.insert(0, joints[chain[0]].parent)
    return chain


def _carrier(joints: list[_Joint], positions: list[NDArray[np.float64]]) -> int:
    """The joint that carries the body: the last of an unbranched chain from the root whose own position moves."""
    top, carrier = 0, 0
    while True:
        children = [j for j, joint in enumerate(joints) if joint.parent == top]
        if len(children) != 1:
            return carrier
        top = children[0]
        # A joint that holds its place in its parent to a millionth of its distance is a bone, not a carrier.
        if joints[top].channels and np.ptp(positions[top], axis=0).max() > 1e-6 * (1 + np.abs(joints[top].offset).max()):
            carrier = top


def _unit(joints: list[_Joint], kept: list[int], offsets: NDArray[np.float64], path: Path) -> float:
    reach = {kept[0]: 0.0}
    for j, offset in zip(kept[1:], offsets[1:], strict=True):
        reach[j] = reach[joints[j].parent] + float(np.linalg.norm(offset))
    longest = max(reach.values())
    fitting = [unit for unit in UNITS_M.values() if _REACH_M[0] <= longest * unit <= _REACH_M[1]]
    if len(fitting) != 1:
        raise InputError(
            f"{path}: a person {longest:.4g} units from hip to farthest end fits none of {', '.join(UNITS_M)}; "
            f"give unit_m (metres a unit)"
        )
    return fitting[0]
