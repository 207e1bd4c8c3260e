"""BVH motions: any channel order, positions on any joint.

The global rotation of a joint applies to the offsets of its children, so joint j of the `Motion`
carries the rotation of its parent. End sites become joints named ``<parent>_end``, so that the
rotation of a last joint is kept even where its end site has no length.
"""

from __future__ import annotations

import itertools
import re
import warnings
from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError, ValidityWarning
from rtradar.motion.formats.text_file import FRAMES_AT_ONCE, TextFile
from rtradar.motion.motion import Motion
from rtradar.motion.quaternions import quaternion_rotate, quaternions_to_world, to_world
from rtradar.motion.reading import longest_chain, settled
from rtradar.system.row_files import FileBackedRows, column, in_blocks

_SHORTEST_S, _LONGEST_S = 1e-6, 10.0
"""Limits of the duration of a frame [s]."""

_STRETCH_M = 0.02
"""Largest movement of the position channels of a rigid bone [m]."""


@dataclass
class _Joint:
    name: str
    parent: int
    line: int
    offset: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    channels: tuple[str, ...] = ()
    column: int = 0
    """Index of the joint's first channel among those of all joints."""


def load_bvh(
    path: Path,
    *,
    skeleton: Path | None,
    unit_m: float | None,
    up: str | None,
    rate_hz: float | None,
) -> Motion:
    """Read a BVH file; an `InputError` names the file and the line.

    Position channels below the root replace the joint's offset and must be constant, but for the
    joint that carries the body (Bandai-Namco: ``Hips`` under ``joint_Root``), which becomes root.
    """
    if skeleton is not None:
        raise InputError(f"{path}: a BVH file holds its own skeleton; leave {skeleton} out")
    with TextFile(path, "BVH motion") as text:
        joints = _read_hierarchy(text)
        n_frames, rate_hz = _read_header(text, rate_hz)
        values = _read_frames(text, n_frames, joints)

    top = _carrier(joints, values)
    kept = [j for j in range(len(joints)) if top in _chain(joints, j)]
    renumber = {j: k for k, j in enumerate(kept)}
    offsets, spreads = np.zeros((len(kept), 3)), np.zeros(len(kept))
    for k, j in enumerate(kept[1:], start=1):
        places = _places(joints[j], values)
        offsets[k] = np.median(places, axis=0)
        spreads[k] = np.linalg.norm(places - offsets[k], axis=1).max()
    carriers = [kept[0], *(joints[j].parent for j in kept[1:])]
    roots, rotations = FileBackedRows(), FileBackedRows()
    for (frames,) in in_blocks(values):
        quaternions = _quaternions(joints, frames)
        places = np.zeros((len(frames), 3))
        # From the file's root down to the joint that carries the body.
        for ancestor in _chain(joints, top):
            parent, own = joints[ancestor].parent, _places(joints[ancestor], frames)
            places += own if parent < 0 else quaternion_rotate(quaternions[:, parent], own)
        roots.append(to_world(places))
        rotations.append(quaternions_to_world(quaternions[:, carriers]))
    raw = Motion(
        name=path.stem,
        joints=tuple(joints[j].name for j in kept),
        parents=(-1, *(renumber[joints[j].parent] for j in kept[1:])),
        offsets=to_world(offsets),
        root_positions=roots.rows(),
        rotations=rotations.rows(),
        rate_hz=rate_hz,
    )
    motion = settled(str(path), raw, unit_m=unit_m, up=up)
    scale = longest_chain(motion) / longest_chain(raw)
    for j, stretch in zip(kept, spreads * scale, strict=True):
        if stretch > _STRETCH_M:
            raise text.fail(
                f"bone to {joints[j].name!r} stretches by {stretch * 100:.1f} cm; bones must be "
                "rigid",
                joints[j].line,
            )
    return motion


class _Words:
    """Words of the text one after the other, wherever its lines end; braces stand alone."""

    def __init__(self, text: TextFile) -> None:
        self._text = text
        self._words = self._read()
        self._next: list[tuple[str, int]] = []
        self.line = 0

    def _read(self) -> Iterator[tuple[str, int]]:
        for raw in self._text:
            for word in raw.replace("{", " { ").replace("}", " } ").split():
                yield word, self._text.line

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        word, self.line = self._next.pop() if self._next else next(self._words)
        return word

    def until(self, ends: Container[str]) -> list[str]:
        """Take the words before one of these, in capitals, or all that are left."""
        found = list[str]()
        for word in self:
            if word.upper() in ends:
                self._next.append((word, self.line))
                break
            found.append(word)
        return found


_KEYS = frozenset(("ROOT", "JOINT", "END", "OFFSET", "CHANNELS", "MOTION", "{", "}"))


def _read_hierarchy(text: TextFile) -> list[_Joint]:
    """Joints in the file's order (parents first), up to MOTION."""
    joints: list[_Joint] = []
    stack: list[int] = []
    words = _Words(text)
    if next(words, "").upper() != "HIERARCHY":
        raise text.fail("no HIERARCHY at the beginning; this is not a BVH file")
    for word in words:
        key, line = word.upper(), words.line
        if key == "MOTION":
            if stack or not joints:
                raise text.fail("MOTION before the hierarchy ends; a brace is missing", line)
            for before, joint in itertools.pairwise(joints):
                joint.column = before.column + len(before.channels)
            return joints
        if key in ("ROOT", "JOINT", "END"):
            if (key == "ROOT") == bool(joints):
                raise text.fail("a BVH file must have exactly one ROOT, first", line)
            if key != "ROOT" and not stack:
                raise text.fail(f"{word} outside the braces of the root", line)
            name = " ".join(words.until("{"))
            if next(words, "") != "{":
                raise text.fail(f"{word} {name[:40]} without an opening brace", line)
            parent, taken = stack[-1] if stack else -1, {joint.name for joint in joints}
            if key == "END":
                name = f"{joints[parent].name}_end"
                # Another one is of no use to a body, but its channels would be counted.
                while name in taken:
                    name += "_"
            if not name or name in taken:
                raise text.fail(f"joint {name!r}: every joint needs a name of its own", line)
            joints.append(_Joint(name, parent, line))
            text.check_size(len(joints))
            stack.append(len(joints) - 1)
        elif key == "}":
            if not stack:
                raise text.fail("a closing brace too many", line)
            stack.pop()
        elif key == "OFFSET" and stack:
            offset = text.numbers(words.until(_KEYS), line)
            if len(offset) != 3:
                raise text.fail(f"OFFSET has {len(offset)} values; it needs three", line)
            joints[stack[-1]].offset = np.array(offset)
        elif key == "CHANNELS" and stack:
            count, *given = words.until(_KEYS) or [""]
            names = tuple(name.lower() for name in given)
            whole = count == str(len(names)) and len(set(names)) == len(names)
            if not whole or not all(
                re.fullmatch("[xyz](position|rotation)", name) for name in names
            ):
                raise text.fail(
                    "CHANNELS needs a count and as many different Xposition ... Zrotation", line
                )
            joints[stack[-1]].channels = names
        else:
            raise text.fail(f"{word[:40]!r} is not expected in a BVH hierarchy", line)
    raise text.fail("no MOTION; the file may be cut off")


def _read_header(text: TextFile, rate_hz: float | None) -> tuple[int, float]:
    """Number of frames, and frames per second."""
    frames, interval = 0, 0.0
    for raw in text:
        words = raw.replace(":", ": ").split()
        if not words:
            continue
        if words[0].lower() == "frames:":
            count = text.numbers(words[1:2])
            if not count or count[0] < 1 or count[0] != int(count[0]):
                raise text.fail("Frames: needs a positive whole number")
            frames = int(count[0])
        elif [word.lower() for word in words[:2]] == ["frame", "time:"]:
            time = text.numbers(words[2:3])
            if rate_hz is not None:
                interval = 1 / rate_hz
            elif not time or not _SHORTEST_S <= time[0] <= _LONGEST_S:
                said = f"{time[0]:g}" if time else "nothing"
                raise text.fail(
                    f"Frame Time: is {said}; it needs the positive seconds of a frame, "
                    f"{_SHORTEST_S:g} to {_LONGEST_S:g}, or give the frames a second (rate_hz, "
                    "--rate)"
                )
            else:
                interval = time[0]
        else:
            raise text.fail("Frames: and Frame Time: must come before the values")
        if frames and interval:
            found, whole = 1 / interval, round(1 / interval)
            # Frame times are written with few digits (0.0333333, .0083333): a whole rate is meant.
            return frames, whole if abs(found - whole) < 1e-3 * found else found
    raise text.fail("no Frames: or Frame Time:; the file may be cut off")


def _read_frames(text: TextFile, n_frames: int, joints: list[_Joint]) -> NDArray[np.float64]:
    """Values (frame, channel), each frame on one line or on several."""
    width, read = joints[-1].column + len(joints[-1].channels), 0
    values, rows, begun = FileBackedRows(), list[list[float]](), list[float]()

    def wrong(count: int, line: int | None = None) -> InputError:
        return text.fail(
            f"frame {read + 1} has {count} values where the hierarchy has {width} channels", line
        )

    for raw in text:
        row = text.numbers(raw.split())
        if begun and len(row) >= width:
            raise wrong(len(begun), text.line - 1)
        begun += row
        if len(begun) < width or not row:
            continue
        if len(begun) > width:
            raise wrong(len(begun))
        rows.append(begun)
        begun = []
        read += 1
        text.check_size(len(joints), read)
        if len(rows) == FRAMES_AT_ONCE:
            values.append(np.array(rows))
            rows.clear()
    if begun:
        raise wrong(len(begun))
    if read < n_frames:
        raise InputError(
            f"{text.path}: {read} frames where the header promises {n_frames}; the file may be "
            "cut off"
        )
    if read > n_frames:
        warnings.warn(
            f"{text.path}: {read} frames where the header promises {n_frames}; all are taken",
            ValidityWarning,
            stacklevel=3,
        )
    values.append(np.array(rows).reshape(-1, width))
    return values.rows()


def _places(joint: _Joint, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Position of a joint relative to its parent, (frame, 3); (1, 3) without position channels."""
    moved = [k for k, name in enumerate(joint.channels) if name.endswith("position")]
    if not moved:
        return joint.offset[None]
    places = np.tile(joint.offset, (len(values), 1))
    axes = ["xyz".index(joint.channels[k][0]) for k in moved]
    places[:, axes] = column(values, [joint.column + k for k in moved])
    return places


def _quaternions(joints: list[_Joint], values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations of all joints (frame, joint, 4) in the axes of the file."""
    world: list[Rotation] = []
    for joint in joints:
        rotations = [k for k, name in enumerate(joint.channels) if name.endswith("rotation")]
        order = "".join(joint.channels[k][0].upper() for k in rotations)
        angles = values[:, [joint.column + k for k in rotations]]
        local = Rotation.identity(len(values))
        if order:
            local = Rotation.from_euler(order, angles, degrees=True)
        world.append(local if joint.parent < 0 else world[joint.parent] * local)
    return np.stack([rotation.as_quat() for rotation in world], axis=1)


def _chain(joints: list[_Joint], joint: int) -> list[int]:
    chain = [joint]
    while joints[chain[0]].parent >= 0:
        chain.insert(0, joints[chain[0]].parent)
    return chain


def _carrier(joints: list[_Joint], values: NDArray[np.float64]) -> int:
    """Find the last joint of an unbranched chain from the root whose own position moves."""
    top, carrier = 0, 0
    while True:
        children = [j for j, joint in enumerate(joints) if joint.parent == top]
        if len(children) != 1:
            return carrier
        top = children[0]
        # A joint that moves in its parent by less than a millionth of its distance is a bone.
        least = 1e-6 * (1 + np.abs(joints[top].offset).max())
        if np.ptp(_places(joints[top], values), axis=0).max() > least:
            carrier = top
