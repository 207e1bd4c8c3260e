"""Recordings of rotations: Acclaim's skeletons (ASF) and motions (AMC), and BVH.

In ASF a bone's vector is length x direction, and lengths are inches divided by the ``length`` unit
of the file. A bone's rotation in the world is that of its parent times C R C^-1, C the bone's
``axis`` and R its degrees of freedom, both applied about fixed axes in the order they are listed
(``rx ry rz``: R = Rz Ry Rx).

In a BVH file the global rotation of a joint applies to the offsets of its children, so joint j of
the `Motion` carries the rotation of its parent. End sites become joints named ``<parent>_end``, so
that the rotation of a last joint is kept even where its end site has no length.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rtradar.errors import InputError, ValidityWarning
from rtradar.motion.formats.skeletons import Array, Bone, carrier_of, chain_to, kept_rows, posed
from rtradar.motion.formats.text_file import TextFile
from rtradar.motion.motion import Motion
from rtradar.motion.reading import longest_chain, settled

_INCH_M = 0.0254
_FRAME_NUMBER = re.compile("-?[0-9]{1,9}")
_RATE_HZ = 120.0
"""AMC files do not state their rate; HDM05 and the CMU recordings here were made at 120 Hz."""

_CHANNELS = {"order": ("tx", "ty", "tz", "rx", "ry", "rz"), "dof": ("rx", "ry", "rz")}
"""Channels of the root, all of which it has, and of other bones."""


class Skeleton(NamedTuple):
    """Content of an ASF file: bones [m], parents before their children, and the units of angles."""

    path: Path
    bones: list[Bone]
    unit_m: float
    degrees: bool


def load_skeleton(path: Path) -> Skeleton:
    """Read an ASF file; an `InputError` names the file and the line."""
    bones, parents = {"root": Bone("root", 1)}, dict[str, str]()
    bone: Bone | None = None
    sections, inside, unit, degrees = [""], False, 1.0, True
    # A line belongs to the section whose heading came last, and in :bonedata to the bone between
    # begin and end.
    with TextFile(path, "ASF skeleton") as text:
        for raw in text:
            words = raw.split("#", 1)[0].split()
            if not words:
                continue
            key, section = words[0].lower(), sections[-1]
            if key.startswith(":"):
                sections.append(key)
            elif section == ":units" and key == "angle":
                degrees = not "".join(words[1:2]).lower().startswith("rad")
            elif section == ":units" and key == "length" and words[1:]:
                (unit,) = text.numbers(words[1:2])
                if not unit > 1e-6:
                    raise text.fail(f"length unit {unit}; it must be positive, and above 1e-6")
            elif section == ":root" and key in ("order", "axis", "orientation", "position"):
                _bone_line(bones["root"], key, words[1:], text)
            elif section == ":bonedata" and key in ("begin", "end"):
                if bone is not None and not bone.name:
                    raise text.fail("a bone without a name ends here")
                bone = Bone("", text.line) if key == "begin" else None
            elif section == ":bonedata":
                if bone is None:
                    raise text.fail(f"{words[0]!r} outside begin ... end")
                if key in ("order", "orientation", "position"):
                    continue  # which only a root has
                _bone_line(bone, key, words[1:], text)
                if key == "name" and bones.setdefault(bone.name, bone) is not bone:
                    raise text.fail(f"bone {bone.name!r} is there twice; names must differ")
            elif section == ":hierarchy" and key in ("begin", "end"):
                inside = key == "begin"
            elif section == ":hierarchy" and inside:
                _hierarchy_line(words, bones, parents, text)
    # The hierarchy is the last section: a file without its end was cut off.
    if ":root" not in sections or len(bones) == 1 or sections[-1] != ":hierarchy" or inside:
        raise InputError(
            f"{path}: no complete ASF skeleton (:root, :bonedata, :hierarchy); the file may be "
            "cut off"
        )
    if not bones["root"].channels:
        raise InputError(
            f"{path}: the root has no order; give TX TY TZ RX RY RZ in the AMC's order"
        )
    text.check_size(len(bones))
    # Lengths and angles to metres and degrees, and the order of the angles of each bone.
    unit_m = _INCH_M / unit
    for bone in bones.values():
        bone.offset = bone.offset * bone.length * unit_m
        bone.axis = bone.axis if degrees else np.degrees(bone.axis)
        # The root's angles are applied in the order of its axis, a bone's in their own order.
        bone.order = "".join(channel[1] for channel in bone.channels)
    bones["root"].order = bones["root"].axis_order
    return Skeleton(path, _parents_first(bones, parents, text), unit_m, degrees)


def _bone_line(bone: Bone, key: str, words: list[str], text: TextFile) -> None:
    if key == "name":
        if len(words) != 1:
            raise text.fail("a bone needs one name")
        if bone.name:
            raise text.fail(
                f"bone {bone.name!r} gets a second name; every bone needs its own begin ... end"
            )
        bone.name = words[0]
    elif key == "length":
        (bone.length,) = text.numbers(words[:1]) or (0.0,)
        if bone.length < 0:
            raise text.fail(f"bone {bone.name!r} has length {bone.length}; it must not be negative")
    elif key == "direction":
        bone.offset = _triple(words, text)
    elif key == "orientation":
        bone.axis = _triple(words, text)
    elif key == "position" and _triple(words, text).any():
        raise text.fail("a root position other than 0 0 0 is not supported; move it into the AMC")
    elif key == "axis":
        # The order stands alone or after the angles; a bone may leave it out, the root the angles.
        root = bone.name == "root"
        order = words[-1] if words and (root or len(words) > 3) else "" if root else "xyz"
        bone.axis = bone.axis if root else _triple(words, text)
        bone.axis_order = order.lower()
        if sorted(bone.axis_order) != ["x", "y", "z"]:
            raise text.fail(f"axis order {order!r}; it must be a permutation of XYZ")
    elif key in _CHANNELS:
        bone.channels, allowed = tuple(word.lower() for word in words), _CHANNELS[key]
        given, whole = set(bone.channels), len(words) == 6 or key == "dof"
        if not (whole and given <= set(allowed)) or len(given) < len(words):
            raise text.fail(
                f"{key} {' '.join(words)} of {bone.name!r}: only {', '.join(allowed)} are "
                f"supported, each once{' and all of them' * (key == 'order')}"
            )


def _triple(words: list[str], text: TextFile) -> Array:
    if len(words) < 3:
        raise text.fail(f"{len(words)} numbers where three are needed")
    return np.array(text.numbers(words[:3]))


def _hierarchy_line(
    words: list[str], bones: dict[str, Bone], parents: dict[str, str], text: TextFile
) -> None:
    for word in words:
        if word not in bones:
            raise text.fail(f"bone {word!r} is not in :bonedata")
    for child in words[1:]:
        if child in parents or child == "root":
            raise text.fail(f"bone {child!r} has two parents")
        parents[child] = words[0]


def _parents_first(bones: dict[str, Bone], parents: dict[str, str], text: TextFile) -> list[Bone]:
    names = ["root"]
    # Bones are listed in any order; each is taken once its parent is.
    while rest := [name for name in bones if name not in names]:
        ready = [name for name in rest if parents.get(name) in names]
        if not ready:
            alone = f"bone {rest[0]!r} does not hang on the root; list it in :hierarchy"
            raise text.fail(alone, bones[rest[0]].line)
        names += ready
    for name in names[1:]:
        bones[name].parent = names.index(parents[name])
    return [bones[name] for name in names]


def load_amc(path: Path, *, skeleton: Path | None, rate_hz: float | None, up: str | None) -> Motion:
    """Read an AMC file and pose its skeleton; an `InputError` names the file, line and bone.

    The joints of the motion are the root and the end of each bone.
    """
    if skeleton is None:
        raise InputError(
            f"{path}: an AMC file needs its skeleton; give the subject's .asf (--skeleton)"
        )
    known = load_skeleton(skeleton)
    with TextFile(path, "AMC motion") as text:
        values = kept_rows(_amc_frames(text, known), known.bones)
    _warn_of_another_person(path, skeleton)
    # Every bone is a joint that its own rotation carries.
    joints = [(number, number) for number in range(len(known.bones))]
    offsets = np.array([bone.offset for bone in known.bones])
    rate_hz = _RATE_HZ if rate_hz is None else rate_hz
    motion = posed(path, known.bones, values, joints, offsets, rate_hz)
    return settled(str(path), motion, unit_m=1.0, up=up, unit_by="metres by the skeleton")


def _warn_of_another_person(path: Path, skeleton: Path) -> None:
    """Warn where a skeleton beside a recording has its name, and another is given.

    Skeletons of one source fit each other's recordings, so only their names tell them apart.
    """
    found = path.parent.glob("*.asf")  # of a folder that was just read from
    own = [one.stem for one in found if path.stem.startswith(f"{one.stem}_")]
    if own and skeleton.stem not in own:
        warnings.warn(
            f"{path}: beside it is {max(own, key=len)}.asf, of its name, and {skeleton} is given; "
            "bones of another person make other ranges and speeds",
            ValidityWarning,
            stacklevel=3,
        )


def _amc_frames(text: TextFile, skeleton: Skeleton) -> Iterator[list[float]]:
    """Yield the values of the channels of all bones in each frame [m] [deg]."""
    # Bones may come in any order, so the values of a frame are gathered by bone. They are yielded
    # in the order of the skeleton once the next frame begins.
    widths = {bone.name: len(bone.channels) for bone in skeleton.bones}
    degrees, count = skeleton.degrees, 0
    frame: int | None = None
    values: dict[str, list[float]] = {}

    def complete(line: int) -> list[float]:
        missing = [name for name, width in widths.items() if width and name not in values]
        if missing:
            some = ", ".join(missing[:3]) + (" ..." if len(missing) > 3 else "")
            raise text.fail(
                f"frame {frame} lacks {len(missing)} bones ({some}); the file may be cut off", line
            )
        text.check_size(len(widths), count)
        # Lengths by the skeleton's unit, angles to degrees.
        factors = {"t": skeleton.unit_m, "r": 1.0 if degrees else 180 / math.pi}
        return [
            value * factors[channel[0]]
            for bone in skeleton.bones
            for channel, value in zip(bone.channels, values.get(bone.name, ()), strict=True)
        ]

    # A line is a comment, a keyword, the number of the next frame, or a bone with its values.
    for raw in text:
        words = raw.split()
        if not words or words[0].startswith("#"):
            continue
        name = words[0]
        if name.startswith(":"):
            if name.upper() in (":DEGREES", ":RADIANS"):
                if frame is not None and degrees != (name.upper() == ":DEGREES"):
                    raise text.fail(f"{name} after the first frame; it must be before it")
                degrees = name.upper() == ":DEGREES"
        elif len(words) == 1 and _FRAME_NUMBER.fullmatch(name):
            if frame is not None:
                whole = complete(text.line - 1)
                if int(name) != frame + 1:
                    raise text.fail(
                        f"frame {name} follows frame {frame}; frame numbers must be consecutive"
                    )
                yield whole
            frame, count, values = int(name), count + 1, {}
        elif frame is None:
            raise text.fail(f"{name[:40]!r} before the first frame number; this is not an AMC file")
        elif name not in widths:
            raise text.fail(
                f"bone {name[:40]!r} is not in the skeleton {skeleton.path}; give the ASF of "
                "this subject"
            )
        elif name in values:
            raise text.fail(f"bone {name!r} is there twice in frame {frame}")
        elif len(words) - 1 != widths[name]:
            raise text.fail(
                f"bone {name!r} has {len(words) - 1} values where the skeleton has {widths[name]}"
            )
        else:
            values[name] = text.numbers(words[1:])
    if frame is None:
        raise InputError(f"{text.path}: no frame in this AMC file; the file may be cut off")
    yield complete(text.line)


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
        values = kept_rows(_bvh_frames(text, n_frames, joints), joints)
    # Joints above the one that carries the body are left out; what they move goes into the root.
    top = carrier_of(joints, values)
    kept = [j for j in range(len(joints)) if top in chain_to(joints, j)]
    # Position channels of other joints say the same offset in every frame, but for rounding; how
    # far they spread is judged in metres, once the unit is known.
    offsets, spreads = np.zeros((len(kept), 3)), np.zeros(len(kept))
    for k, j in enumerate(kept[1:], start=1):
        places = joints[j].places(values)
        offsets[k] = np.median(places, axis=0)
        spreads[k] = np.linalg.norm(places - offsets[k], axis=1).max()
    # In BVH the rotation of the parent carries the bone that ends in a joint.
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
            names = key.upper() in ("ROOT", "JOINT", "END")  # any words, up to the brace
            if word.upper() not in _KEYS or (names and word != "{"):
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
    # Braces open and close joints: the stack holds those that are open, the parent last.
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
        # A joint, or the end site of one, hangs on the joint that was opened last.
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
        # Offset and channels belong to that joint, too.
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
    # Two lines, in any order, before the values.
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


def _bvh_frames(text: TextFile, n_frames: int, joints: list[Bone]) -> Iterator[list[float]]:
    """Yield the values of all channels, each frame on one line or on several."""
    width, read, begun = sum(len(joint.channels) for joint in joints), 0, list[float]()

    def wrong(line: int | None = None) -> InputError:
        return text.fail(
            f"frame {read + 1} has {len(begun)} values where the hierarchy has {width} channels",
            line,
        )

    # A frame may go on over several lines, but a line that is whole by itself may not follow one
    # that is not.
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
