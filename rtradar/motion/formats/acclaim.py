"""Acclaim's skeletons (ASF) and motions (AMC): HDM05, the CMU database.

A bone's vector is length x direction, and lengths are inches divided by the ``length`` unit of the
ASF file. A bone's rotation in the world is that of its parent times C R C^-1, C the bone's ``axis``
and R its degrees of freedom, both applied about fixed axes in the order they are listed (``rx ry
rz``: R = Rz Ry Rx).
"""

from __future__ import annotations

import itertools
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError, ValidityWarning
from rtradar.motion.formats.text_file import FRAMES_AT_ONCE, TextFile
from rtradar.motion.motion import Motion
from rtradar.motion.quaternions import quaternions_to_world, to_world
from rtradar.motion.reading import settled
from rtradar.motion.skeleton import ASF_JOINTS
from rtradar.system.row_files import FileBackedRows

_INCH_M = 0.0254
_FRAME_NUMBER = re.compile("-?[0-9]{1,9}")
_RATE_HZ = 120.0
"""AMC files do not state their rate; HDM05 and the CMU recordings here were made at 120 Hz."""


@dataclass
class _Bone:
    """One bone as the file describes it; the root is a bone without a vector."""

    name: str
    line: int
    direction: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axis: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    axis_order: str = "xyz"
    dof: tuple[str, ...] = ()
    parent: str | None = None


@dataclass(frozen=True)
class Skeleton:
    """Content of an ASF file, with parents before their children; angles are degrees or radians."""

    path: Path
    bones: tuple[_Bone, ...]
    unit_m: float
    degrees: bool


def load_skeleton(path: Path) -> Skeleton:
    """Read an ASF file; an `InputError` names the file and the line."""
    bones = {"root": _Bone("root", 1)}
    bone: _Bone | None = None
    section, inside, has_root, unit, degrees = "", False, False, 1.0, True
    with TextFile(path, "ASF skeleton") as text:
        for raw in text:
            words = raw.split("#", 1)[0].split()
            if not words:
                continue
            key = words[0].lower()
            if key.startswith(":"):
                section = key
                has_root |= key == ":root"
            elif section == ":units" and len(words) > 1:
                if key == "angle":
                    degrees = not words[1].lower().startswith("rad")
                elif key == "length":
                    (unit,) = text.numbers(words[1:2])
                    if not unit > 1e-6:
                        raise text.fail(f"length unit {unit}; it must be positive, and above 1e-6")
            elif section == ":root":
                _root_line(bones["root"], key, words, text)
            elif section == ":bonedata":
                if key == "begin":
                    bone = _Bone("", text.line)
                elif key == "end":
                    if bone is not None:
                        _check_bone(bone, text)
                    bone = None
                elif bone is None:
                    raise text.fail(f"{words[0]!r} outside begin ... end")
                else:
                    _bone_line(bone, key, words, bones, text)
            elif section == ":hierarchy":
                if key in ("begin", "end"):
                    inside = key == "begin"
                elif inside:
                    _hierarchy_line(words, bones, text)
    if not has_root or len(bones) == 1 or section != ":hierarchy":
        raise InputError(
            f"{path}: no complete ASF skeleton (:root, :bonedata, :hierarchy); the file may be "
            "cut off"
        )
    if not bones["root"].dof:
        raise InputError(
            f"{path}: the root has no order; give TX TY TZ RX RY RZ in the AMC's order"
        )
    if inside:
        raise text.fail("the hierarchy does not end; the file may be cut off")
    text.check_size(len(bones))
    return Skeleton(path, _parents_first(bones, text), _INCH_M / unit, degrees)


def _root_line(root: _Bone, key: str, words: list[str], text: TextFile) -> None:
    if key == "order":
        root.dof = tuple(word.lower() for word in words[1:])
        if sorted(root.dof) != ["rx", "ry", "rz", "tx", "ty", "tz"]:
            given = " ".join(words[1:])
            raise text.fail(f"root order {given}; it must hold TX TY TZ RX RY RZ, in any order")
    elif key == "axis":
        root.axis_order = _order(words[-1], text)
    elif key == "orientation":
        root.axis = _triple(words[1:], text)
    elif key == "position" and _triple(words[1:], text).any():
        raise text.fail("a root position other than 0 0 0 is not supported; move it into the AMC")


def _bone_line(
    bone: _Bone, key: str, words: list[str], bones: dict[str, _Bone], text: TextFile
) -> None:
    if key == "name":
        if len(words) != 2:
            raise text.fail("a bone needs one name")
        if bone.name:
            raise text.fail(
                f"bone {bone.name!r} gets a second name; every bone needs its own begin ... end"
            )
        bone.name = words[1]
        if bone.name in bones:
            raise text.fail(f"bone {bone.name!r} is there twice; names must differ")
        bones[bone.name] = bone
    elif key == "direction":
        bone.direction = _triple(words[1:], text)
    elif key == "length":
        (bone.length,) = text.numbers(words[1:2]) or (0.0,)
        if bone.length < 0:
            raise text.fail(f"bone {bone.name!r} has length {bone.length}; it must not be negative")
    elif key == "axis":
        bone.axis = _triple(words[1:4], text)
        bone.axis_order = _order(words[4] if len(words) > 4 else "xyz", text)
    elif key == "dof":
        bone.dof = tuple(word.lower() for word in words[1:])
        if not set(bone.dof) <= {"rx", "ry", "rz"}:
            raise text.fail(
                f"dof {' '.join(words[1:])} of {bone.name!r}: only rx, ry, rz are supported "
                "(rigid bones)"
            )


def _check_bone(bone: _Bone, text: TextFile) -> None:
    if not bone.name:
        raise text.fail("a bone without a name ends here")
    if bone.name in ASF_JOINTS and not bone.length * np.abs(bone.direction).max() > 0:
        raise text.fail(
            f"bone {bone.name!r} has no length; a body part hangs on it, give its length and "
            "direction",
            bone.line,
        )


def _triple(words: list[str], text: TextFile) -> NDArray[np.float64]:
    values = text.numbers(words[:3])
    if len(values) != 3:
        raise text.fail(f"{len(values)} numbers where three are needed")
    return np.array(values)


def _order(word: str, text: TextFile) -> str:
    if sorted(word.lower()) != ["x", "y", "z"]:
        raise text.fail(f"axis order {word!r}; it must be a permutation of XYZ")
    return word.lower()


def _hierarchy_line(words: list[str], bones: dict[str, _Bone], text: TextFile) -> None:
    for word in words:
        if word not in bones:
            raise text.fail(f"bone {word!r} is not in :bonedata")
    for child in words[1:]:
        if bones[child].parent is not None or child == "root":
            raise text.fail(f"bone {child!r} has two parents")
        bones[child].parent = words[0]


def _parents_first(bones: dict[str, _Bone], text: TextFile) -> tuple[_Bone, ...]:
    done = {"root": bones["root"]}
    while len(done) < len(bones):
        rest = [bone for bone in bones.values() if bone.name not in done]
        ready = {bone.name: bone for bone in rest if bone.parent in done}
        if not ready:
            raise text.fail(
                f"bone {rest[0].name!r} does not hang on the root; list it in :hierarchy",
                rest[0].line,
            )
        done |= ready
    return tuple(done.values())


def load_amc(path: Path, *, skeleton: Path | None, rate_hz: float | None, up: str | None) -> Motion:
    """Read an AMC file and pose its skeleton; an `InputError` names the file, line and bone.

    The joints of the motion are the root and the end of each bone.
    """
    if skeleton is None:
        raise InputError(
            f"{path}: an AMC file needs its skeleton; give the subject's .asf (--skeleton)"
        )
    known = load_skeleton(skeleton)
    roots, rotations = FileBackedRows(), FileBackedRows()
    with TextFile(path, "AMC motion") as text:
        frames = _frames(text, known)
        while block := list(itertools.islice(frames, FRAMES_AT_ONCE)):
            values = {
                bone.name: np.array([frame[bone.name] for frame, _ in block])
                for bone in known.bones
                if bone.dof
            }
            positions, quaternions = _posed(known, values, degrees=block[0][1])
            roots.append(to_world(positions))
            rotations.append(quaternions_to_world(quaternions))
    _warn_of_another_person(path, skeleton)
    index = {bone.name: j for j, bone in enumerate(known.bones)}
    offsets = np.array([bone.direction * bone.length * known.unit_m for bone in known.bones])
    motion = Motion(
        name=path.stem,
        joints=tuple(index),
        parents=tuple(-1 if bone.parent is None else index[bone.parent] for bone in known.bones),
        offsets=to_world(offsets),
        root_positions=roots.rows(),
        rotations=rotations.rows(),
        rate_hz=_RATE_HZ if rate_hz is None else rate_hz,
    )
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


def _posed(
    skeleton: Skeleton, values: dict[str, NDArray[np.float64]], *, degrees: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute positions of the root (frame, 3) [m] and rotations (frame, bone, 4), mocap axes."""
    frames = len(values["root"])
    world: dict[str, Rotation] = {}
    for bone in skeleton.bones:
        frame = Rotation.from_euler(bone.axis_order, bone.axis, degrees=skeleton.degrees)
        # The root's angles are applied in the order of its axis, a bone's in their own order.
        order = bone.axis_order if bone.name == "root" else "".join(dof[1] for dof in bone.dof)
        if order:
            angles = values[bone.name][:, [bone.dof.index("r" + letter) for letter in order]]
            local = Rotation.from_euler(order, angles, degrees=degrees)
        else:
            local = Rotation.identity(frames)
        posed = frame * local * frame.inv()
        world[bone.name] = posed if bone.parent is None else world[bone.parent] * posed
    columns = [skeleton.bones[0].dof.index(name) for name in ("tx", "ty", "tz")]
    return (
        values["root"][:, columns] * skeleton.unit_m,
        np.stack([rotation.as_quat() for rotation in world.values()], axis=1),
    )


def _frames(text: TextFile, skeleton: Skeleton) -> Iterator[tuple[dict[str, list[float]], bool]]:
    """Yield the values of the bones in each frame, and whether they are degrees."""
    widths = {bone.name: len(bone.dof) for bone in skeleton.bones}
    degrees, count = skeleton.degrees, 0
    frame: int | None = None
    values: dict[str, list[float]] = {}

    def complete(line: int) -> tuple[dict[str, list[float]], bool]:
        missing = [name for name, width in widths.items() if width and name not in values]
        if missing:
            some = ", ".join(missing[:3]) + (" ..." if len(missing) > 3 else "")
            raise text.fail(
                f"frame {frame} lacks {len(missing)} bones ({some}); the file may be cut off", line
            )
        text.check_size(len(widths), count)
        return values, degrees

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
