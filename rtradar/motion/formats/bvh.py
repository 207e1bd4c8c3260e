"""BVH motions: any channel order, positions on any joint.

The global rotation of a joint applies to the offsets of its children, so joint j of the `Motion`
carries the rotation of its parent. End sites become joints named ``<parent>_end``, so that the
rotation of a last joint is kept even where its end site has no length.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rtradar.errors import InputError, ValidityWarning
from rtradar.motion.formats.skeletons import Array, Bone, chain_to, kept_rows, posed
from rtradar.motion.formats.text_file import TextFile
from rtradar.motion.motion import Motion
from rtradar.motion.reading import longest_chain, settled

_SHORTEST_S, _LONGEST_S = 1e-6, 10.0
"""Limits of the duration of a frame [s]."""

_STRETCH_M = 0.02
"""Largest movement of the position channels of a rigid bone [m]."""


def load_bvh(path: Path, *, unit_m: float | None, up: str | None, rate_hz: float | None) -> Motion:
    """Read a BVH file, which has its own skeleton; an `InputError` names the file and the line.

    Position channels below the root replace the joint's offset and must be constant, but for the
    joint that carries the body (Bandai-Namco: ``Hips`` under ``joint_Root``), which becomes root.
    """
    with TextFile(path, "BVH motion") as text:
        joints = _read_hierarchy(text)
        n_frames, rate_hz = _read_header(text, rate_hz)
        values = kept_rows(_frames(text, n_frames, joints), joints)
    top = _carrier(joints, values)
    kept = [j for j in range(len(joints)) if top in chain_to(joints, j)]
    offsets, spreads = np.zeros((len(kept), 3)), np.zeros(len(kept))
    for k, j in enumerate(kept[1:], start=1):
        places = joints[j].places(values)
        offsets[k] = np.median(places, axis=0)
        spreads[k] = np.linalg.norm(places - offsets[k], axis=1).max()
    carriers = [top, *(joints[j].parent for j in kept[1:])]
    raw = posed(path, joints, values, list(zip(kept, carriers, strict=True)), offsets, rate_hz)
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


_KEYS = frozenset(("ROOT", "JOINT", "END", "OFFSET", "CHANNELS", "MOTION", "{", "}"))


def _clauses(text: TextFile) -> Iterator[tuple[str, list[str], int]]:
    """Yield each key of a hierarchy, the words up to the next one, and the line of the key.

    Lines may end anywhere, and braces need no blanks about them. Words before the first key have
    an empty one.
    """
    key, words, line = "", list[str](), 1
    for raw in text:
        for word in raw.replace("{", " { ").replace("}", " } ").split():
            if word.upper() not in _KEYS:
                if key in ("{", "}"):
                    raise text.fail(f"{word[:40]!r} is not expected in a BVH hierarchy")
                words.append(word)
                continue
            yield key, words, line
            key, words, line = word, [], text.line
            if word.upper() == "MOTION":
                yield key, words, line
                return
    yield key, words, line


def _read_hierarchy(text: TextFile) -> list[Bone]:
    """Joints in the file's order (parents first), up to MOTION."""
    joints: list[Bone] = []
    stack: list[int] = []
    clauses = _clauses(text)
    for word, words, line in clauses:
        key = word.upper()
        if not key:
            if [given.upper() for given in words] != ["HIERARCHY"]:
                raise text.fail("no HIERARCHY at the beginning; this is not a BVH file", line)
            continue
        if key == "MOTION":
            if stack or not joints:
                raise text.fail("MOTION before the hierarchy ends; a brace is missing", line)
            return joints
        if key in ("ROOT", "JOINT", "END"):
            if (key == "ROOT") == bool(joints):
                raise text.fail("a BVH file must have exactly one ROOT, first", line)
            if key != "ROOT" and not stack:
                raise text.fail(f"{word} outside the braces of the root", line)
            name = " ".join(words)
            if next(clauses, ("",))[0] != "{":
                raise text.fail(f"{word} {name[:40]} without an opening brace", line)
            parent, taken = stack[-1] if stack else -1, {joint.name for joint in joints}
            if key == "END":
                name = f"{joints[parent].name}_end"
                # Another one is of no use to a body, but its channels would be counted.
                while name in taken:
                    name += "_"
            if not name or name in taken:
                raise text.fail(f"joint {name!r}: every joint needs a name of its own", line)
            joints.append(Bone(name, line, parent))
            text.check_size(len(joints))
            stack.append(len(joints) - 1)
        elif key == "}":
            if not stack:
                raise text.fail("a closing brace too many", line)
            stack.pop()
        elif key == "OFFSET" and stack:
            offset = text.numbers(words, line)
            if len(offset) != 3:
                raise text.fail(f"OFFSET has {len(offset)} values; it needs three", line)
            joints[stack[-1]].offset = np.array(offset)
        elif key == "CHANNELS" and stack:
            count, *names = [name.lower() for name in words or [""]]
            known = [name for name in names if re.fullmatch("[xyz](position|rotation)", name)]
            if count != str(len(names)) or len(set(known)) < len(names):
                raise text.fail(
                    "CHANNELS needs a count and as many different Xposition ... Zrotation", line
                )
            joint = joints[stack[-1]]
            joint.channels = tuple({"p": "t", "r": "r"}[name[1]] + name[0] for name in names)
            joint.order = "".join(name[0].upper() for name in names if name[1] == "r")
        else:
            raise text.fail(f"{word[:40]!r} is not expected in a BVH hierarchy", line)
    raise text.fail("no MOTION; the file may be cut off")


def _read_header(text: TextFile, rate_hz: float | None) -> tuple[int, float]:
    """Number of frames, and frames per second."""
    found = dict[str, float]()
    for raw in filter(str.strip, text):
        words, _, value = raw.lower().partition(":")
        key = " ".join(words.split())
        if key not in ("frames", "frame time"):
            raise text.fail("Frames: and Frame Time: must come before the values")
        (number,) = text.numbers(value.split()[:1]) or (0.0,)
        if key == "frame time" and rate_hz is not None:
            number = 1 / rate_hz
        if key == "frames" and not 1 <= number == int(number):
            raise text.fail("Frames: needs a positive whole number")
        if key == "frame time" and not _SHORTEST_S <= number <= _LONGEST_S:
            raise text.fail(
                f"Frame Time: is {number:g}; it needs the positive seconds of a frame, "
                f"{_SHORTEST_S:g} to {_LONGEST_S:g}, or give the frames a second (rate_hz, --rate)"
            )
        found[key] = number
        if len(found) == 2:
            rate = 1 / found["frame time"]
            # Frame times are written with few digits (0.0333333, .0083333): a whole rate is meant.
            whole = round(rate)
            return int(found["frames"]), whole if abs(rate - whole) < 1e-3 * rate else rate
    raise text.fail("no Frames: or Frame Time:; the file may be cut off")


def _frames(text: TextFile, n_frames: int, joints: list[Bone]) -> Iterator[list[float]]:
    """Yield the values of all channels, each frame on one line or on several."""
    width, read, begun = sum(len(joint.channels) for joint in joints), 0, list[float]()

    def wrong(line: int | None = None) -> InputError:
        return text.fail(
            f"frame {read + 1} has {len(begun)} values where the hierarchy has {width} channels",
            line,
        )

    for raw in text:
        row = text.numbers(raw.split())
        if begun and len(row) >= width:
            raise wrong(text.line - 1)
        begun += row
        if len(begun) < width or not row:
            continue
        if len(begun) > width:
            raise wrong()
        yield begun
        begun = []
        read += 1
        text.check_size(len(joints), read)
    if begun:
        raise wrong()
    promise = f"{text.path}: {read} frames where the header promises {n_frames}"
    if read < n_frames:
        raise InputError(f"{promise}; the file may be cut off")
    if read > n_frames:
        warnings.warn(f"{promise}; all are taken", ValidityWarning, stacklevel=4)


def _carrier(joints: list[Bone], values: Array) -> int:
    """Find the last joint of an unbranched chain from the root whose own position moves."""
    top, carrier = 0, 0
    while True:
        children = [j for j, joint in enumerate(joints) if joint.parent == top]
        if len(children) != 1:
            return carrier
        top = children[0]
        # A joint that moves in its parent by less than a millionth of its distance is a bone.
        least = 1e-6 * (1 + np.abs(joints[top].offset).max())
        if np.ptp(joints[top].places(values), axis=0).max() > least:
            carrier = top
