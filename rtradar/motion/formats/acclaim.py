"""Acclaim's skeletons (ASF) and motions (AMC): HDM05, the CMU database.

A bone's vector is length x direction, and lengths are inches divided by the ``length`` unit of the
ASF file. A bone's rotation in the world is that of its parent times C R C^-1, C the bone's ``axis``
and R its degrees of freedom, both applied about fixed axes in the order they are listed (``rx ry
rz``: R = Rz Ry Rx).
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rtradar.errors import InputError, ValidityWarning
from rtradar.motion.formats.skeletons import Array, Bone, kept_rows, posed
from rtradar.motion.formats.text_file import TextFile
from rtradar.motion.motion import Motion
from rtradar.motion.reading import settled

_INCH_M = 0.0254
_FRAME_NUMBER = re.compile("-?[0-9]{1,9}")
_RATE_HZ = 120.0
"""AMC files do not state their rate; HDM05 and the CMU recordings here were made at 120 Hz."""

_CHANNELS = {"order": ("tx", "ty", "tz", "rx", "ry", "rz"), "dof": ("rx", "ry", "rz")}
"""Channels of the root, all of which it has, and of other bones."""


@dataclass(frozen=True)
class Skeleton:
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
        values = kept_rows(_frames(text, known), known.bones)
    _warn_of_another_person(path, skeleton)
    joints = [(number, number) for number in range(len(known.bones))]
    offsets = np.array([bone.offset for bone in known.bones])
    rate_hz = _RATE_HZ if rate_hz is None else rate_hz
    motion = posed(path, known.bones, values, joints, offsets, rate_hz)
    return settled(str(path), motion, unit_m=1.0, up=up, unit_by="metres by the skeleton")


def _warn_of_another_person(path: Path, skeleton: Path) -> None:
    """Warn where a skeleton beside a recording has its name, and another is given.

    Skeletons of one source fit each other's recordings: only names tell whose is whose.
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


def _frames(text: TextFile, skeleton: Skeleton) -> Iterator[list[float]]:
    """Yield the values of the channels of all bones in each frame [m] [deg]."""
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
        factors = {"t": skeleton.unit_m, "r": 1.0 if degrees else 180 / math.pi}
        return [
            value * factors[channel[0]]
            for bone in skeleton.bones
            for channel, value in zip(bone.channels, values.get(bone.name, ()), strict=True)
        ]

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
