"""ASF skeletons and AMC motions (Acclaim): HDM05, the CMU database.

A bone's rotation in the world is that of its parent times C R C^-1, C the bone's ``axis`` and R its degrees of freedom,
both applied about fixed axes in the order they are listed (``rx ry rz``: R = Rz Ry Rx). The bone's vector is
length x direction, and lengths are inches divided by the ``length`` unit of the file.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError
from rtradar.motion.axes import quaternions_to_world, to_world
from rtradar.motion.motion import Motion
from rtradar.motion.names import ASF_JOINTS
from rtradar.motion.textfile import check_size, fail, numbers, read_lines

_INCH_M = 0.0254
_FRAME_NUMBER = re.compile("-?[0-9]{1,9}")
_RATE_HZ = 120.0
"""AMC files do not tell their rate; HDM05 and the CMU recordings here were made at 120 Hz."""


@dataclass
class Bone:
    """One bone as the file describes it; the root is a bone without a vector."""

    name: str
    line: int
    direction: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axis_rad: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    axis_order: str = "xyz"
    dof: tuple[str, ...] = ()
    parent: str | None = None


@dataclass(frozen=True)
class Skeleton:
    """An ASF file: bones in an order that puts parents first, the root at the head.

    Parameters
    ----------
    path : Path
        Where it came from, for messages.
    bones : tuple of Bone
    unit_m : float
        Metres in one length unit.
    degrees : bool
        Whether angles, here and in the AMC unless that says otherwise, are degrees.
    """

    path: Path
    bones: tuple[Bone, ...]
    unit_m: float
    degrees: bool


def load_skeleton(path: Path) -> Skeleton:
    """Read an ASF file.

    Raises
    ------
    InputError
        Naming file and line.
    """
    lines = read_lines(path, "ASF skeleton")
    bones: dict[str, Bone] = {"root": Bone("root", 1)}
    units = {"length": 1.0, "angle": 1.0}
    bone: Bone | None = None
    section, inside, has_root = "", False, False
    for number, raw in enumerate(lines, start=1):
        words = raw.split("#", 1)[0].split()
        if not words:
            continue
        key = words[0].lower()
        if key.startswith(":"):
            section = key
            has_root |= key == ":root"
        elif section == ":units" and len(words) > 1:
            if key == "angle":
                units["angle"] = 0.0 if words[1].lower().startswith("rad") else 1.0
            elif key == "length":
                (units["length"],) = numbers(words[1:2], path, number)
                if not units["length"] > 1e-6:
                    raise fail(path, number, f"length unit {units['length']}; it must be positive, and above 1e-6")
        elif section == ":root":
            _root_line(bones["root"], key, words, path, number)
        elif section == ":bonedata":
            if key == "begin":
                bone = Bone("", number)
            elif key == "end":
                if bone is not None:
                    _check_bone(bone, path, number)
                bone = None
            elif bone is None:
                raise fail(path, number, f"{words[0]!r} outside begin ... end")
            else:
                _bone_line(bone, key, words, bones, path, number)
        elif section == ":hierarchy":
            if key in ("begin", "end"):
                inside = key == "begin"
            elif inside:
                _hierarchy_line(words, bones, path, number)
    if not has_root or len(bones) == 1 or section != ":hierarchy":
        raise InputError(f"{path}: no complete ASF skeleton (:root, :bonedata, :hierarchy); the file may be cut off")
    if not bones["root"].dof:
        raise InputError(f"{path}: the root has no order; give TX TY TZ RX RY RZ under :root, in the order of the AMC")
    if inside:
        raise fail(path, len(lines), "the hierarchy does not end; the file may be cut off")
    check_size(path, len(bones))
    degrees = bool(units["angle"])
    if degrees:
        for each in bones.values():
            each.axis_rad = np.deg2rad(each.axis_rad)
    return Skeleton(path, _parents_first(bones, path), _INCH_M / units["length"], degrees)


def _root_line(root: Bone, key: str, words: list[str], path: Path, line: int) -> None:
    if key == "order":
        root.dof = tuple(word.lower() for word in words[1:])
        if sorted(root.dof) != ["rx", "ry", "rz", "tx", "ty", "tz"]:
            raise fail(path, line, f"root order {' '.join(words[1:])}; it must hold TX TY TZ RX RY RZ, in any order")
    elif key == "axis":
        root.axis_order = _order(words[-1], path, line)
    elif key == "orientation":
        root.axis_rad = np.array(_triple(words[1:], path, line))
    elif key == "position" and any(_triple(words[1:], path, line)):
        raise fail(path, line, "a root position other than 0 0 0 is not supported; move it into the AMC")


def _bone_line(bone: Bone, key: str, words: list[str], bones: dict[str, Bone], path: Path, line: int) -> None:
    if key == "name":
        if len(words) != 2:
            raise fail(path, line, "a bone needs one name")
        bone.name = words[1]
        if bone.name in bones:
            raise fail(path, line, f"bone {bone.name!r} is there twice; names must differ")
        bones[bone.name] = bone
    elif key == "direction":
        bone.direction = np.array(_triple(words[1:], path, line))
    elif key == "length":
        (bone.length,) = numbers(words[1:2], path, line) or (0.0,)
        if bone.length < 0:
            raise fail(path, line, f"bone {bone.name!r} has length {bone.length}; it must not be negative")
    elif key == "axis":
        bone.axis_rad = np.array(_triple(words[1:4], path, line))
        bone.axis_order = _order(words[4] if len(words) > 4 else "xyz", path, line)
    elif key == "dof":
        bone.dof = tuple(word.lower() for word in words[1:])
        if not set(bone.dof) <= {"rx", "ry", "rz"}:
            raise fail(path, line, f"dof {' '.join(words[1:])} of {bone.name!r}: only rx, ry, rz are supported (rigid bones)")


def _check_bone(bone: Bone, path: Path, line: int) -> None:
    if not bone.name:
        raise fail(path, line, "a bone without a name ends here")
    if bone.name in ASF_JOINTS.values() and not bone.length * np.abs(bone.direction).max() > 0:
        raise fail(path, bone.line, f"bone {bone.name!r} has no length; a body part hangs on it, give its length and direction")


def _triple(words: list[str], path: Path, line: int) -> list[float]:
    values = numbers(words[:3], path, line)
    if len(values) != 3:
        raise fail(path, line, f"{len(values)} numbers where three are needed")
    return values


def _order(word: str, path: Path, line: int) -> str:
    if sorted(word.lower()) != ["x", "y", "z"]:
        raise fail(path, line, f"axis order {word!r}; it must be a permutation of XYZ")
    return word.lower()


def _hierarchy_line(words: list[str], bones: dict[str, Bone], path: Path, line: int) -> None:
    for word in words:
        if word not in bones:
            raise fail(path, line, f"bone {word!r} is not in :bonedata")
    for child in words[1:]:
        if bones[child].parent is not None or child == "root":
            raise fail(path, line, f"bone {child!r} has two parents")
        bones[child].parent = words[0]


def _parents_first(bones: dict[str, Bone], path: Path) -> tuple[Bone, ...]:
    done: dict[str, Bone] = {"root": bones["root"]}
    while len(done) < len(bones):
        ready = [bone for bone in bones.values() if bone.name not in done and bone.parent in done]
        if not ready:
            loose = next(bone for bone in bones.values() if bone.name not in done)
            raise fail(path, loose.line, f"bone {loose.name!r} does not hang on the root; list it in :hierarchy")
        done |= {bone.name: bone for bone in ready}
    return tuple(done.values())


def load_amc(path: Path, skeleton: Skeleton, rate_hz: float = _RATE_HZ) -> Motion:
    """Read an AMC file and pose its skeleton.

    Returns
    -------
    Motion
        One joint a bone (its end) and the root; offsets and rotations in world axes.

    Raises
    ------
    InputError
        Naming file, line and bone.
    """
    values, degrees = _read_frames(path, skeleton)
    to_radians = np.pi / 180 if degrees else 1.0
    frames = len(next(iter(values.values())))
    index = {bone.name: j for j, bone in enumerate(skeleton.bones)}
    world: list[Rotation] = []
    root_positions = np.zeros((frames, 3))
    for bone in skeleton.bones:
        frame = Rotation.from_euler(bone.axis_order, bone.axis_rad)
        data = values.get(bone.name, np.zeros((frames, 0)))
        turns = [k for k, name in enumerate(bone.dof) if name[0] == "r"]
        if bone.name == "root":
            root_positions = data[:, [bone.dof.index(name) for name in ("tx", "ty", "tz")]] * skeleton.unit_m
            columns = [bone.dof.index("r" + letter) for letter in bone.axis_order]
            local = Rotation.from_euler(bone.axis_order, data[:, columns] * to_radians)
        elif turns:
            local = Rotation.from_euler("".join(bone.dof[k][1] for k in turns), data * to_radians)
        else:
            local = Rotation.identity(frames)
        posed = frame * local * frame.inv()
        world.append(posed if bone.parent is None else world[index[bone.parent]] * posed)
    offsets = np.array([bone.direction * bone.length * skeleton.unit_m for bone in skeleton.bones])
    rotations = np.stack([rotation.as_quat() for rotation in world], axis=1)
    return Motion(
        name=path.stem,
        joints=tuple(index),
        parents=tuple(-1 if bone.parent is None else index[bone.parent] for bone in skeleton.bones),
        offsets=to_world(offsets),
        root_positions=to_world(root_positions),
        rotations=quaternions_to_world(rotations),
        rate_hz=rate_hz,
    )


def _read_frames(path: Path, skeleton: Skeleton) -> tuple[dict[str, NDArray[np.float64]], bool]:
    lines = read_lines(path, "AMC motion")
    widths = {bone.name: len(bone.dof) for bone in skeleton.bones if bone.dof}
    table: dict[str, list[list[float]]] = {name: [] for name in widths}
    known = {bone.name for bone in skeleton.bones}
    degrees = skeleton.degrees
    frame: int | None = None
    seen: set[str] = set()

    def finish(line: int) -> None:
        missing = [name for name in widths if name not in seen]
        if frame is not None and missing:
            some = ", ".join(missing[:3]) + (" ..." if len(missing) > 3 else "")
            raise fail(path, line, f"frame {frame} lacks {len(missing)} bones ({some}); the file may be cut off")

    for number, raw in enumerate(lines, start=1):
        words = raw.split()
        if not words or words[0].startswith("#"):
            continue
        if words[0].startswith(":"):
            if words[0].upper() in (":DEGREES", ":RADIANS"):
                degrees = words[0].upper() == ":DEGREES"
        elif len(words) == 1 and _FRAME_NUMBER.fullmatch(words[0]):
            finish(number - 1)
            if frame is not None and int(words[0]) != frame + 1:
                raise fail(path, number, f"frame {words[0]} follows frame {frame}; frame numbers must be consecutive")
            frame, seen = int(words[0]), set()
        elif frame is None:
            raise fail(path, number, f"{words[0][:40]!r} before the first frame number; this is not an AMC file")
        else:
            name = words[0]
            if name not in known:
                raise fail(
                    path, number, f"bone {name[:40]!r} is not in the skeleton {skeleton.path}; give the ASF of this subject"
                )
            if name in seen:
                raise fail(path, number, f"bone {name!r} is there twice in frame {frame}")
            if len(words) - 1 != widths.get(name, 0):
                raise fail(
                    path, number, f"bone {name!r} has {len(words) - 1} values where the skeleton has {widths.get(name, 0)}"
                )
            seen.add(name)
            if name in table:
                table[name].append(numbers(words[1:], path, number))
    if frame is None:
        raise InputError(f"{path}: no frame in this AMC file; it may be cut off")
    finish(len(lines))
    check_size(path, len(skeleton.bones), len(table["root"]) if "root" in table else 1)
    return {name: np.array(rows) for name, rows in table.items()}, degrees
