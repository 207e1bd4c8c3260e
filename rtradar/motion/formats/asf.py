"""ASF skeletons (Acclaim): HDM05, the CMU database.

A bone's vector is length x direction, and lengths are inches divided by the ``length`` unit of the
file.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.motion.formats.text_file import check_size, fail, numbers, read_lines
from rtradar.motion.skeleton_names import ASF_JOINTS

_INCH_M = 0.0254


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
        File that error messages name.
    bones : tuple of Bone
    unit_m : float
        Length unit of the file [m].
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
    bones: dict[str, Bone] = {"root": Bone("root", 1)}
    units = {"length": 1.0, "angle": 1.0}
    bone: Bone | None = None
    section, inside, has_root = "", False, False
    number = 0
    with closing(read_lines(path, "ASF skeleton")) as lines:
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
                        raise fail(
                            path,
                            number,
                            f"length unit {units['length']}; it must be positive, and above 1e-6",
                        )
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
        raise InputError(
            f"{path}: no complete ASF skeleton (:root, :bonedata, :hierarchy); the file may be cut "
            "off"
        )
    if not bones["root"].dof:
        raise InputError(
            f"{path}: the root has no order; give TX TY TZ RX RY RZ under :root, in the order of "
            "the AMC"
        )
    if inside:
        raise fail(path, number, "the hierarchy does not end; the file may be cut off")
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
            raise fail(
                path,
                line,
                f"root order {' '.join(words[1:])}; it must hold TX TY TZ RX RY RZ, in any order",
            )
    elif key == "axis":
        root.axis_order = _order(words[-1], path, line)
    elif key == "orientation":
        root.axis_rad = np.array(_triple(words[1:], path, line))
    elif key == "position" and any(_triple(words[1:], path, line)):
        raise fail(
            path, line, "a root position other than 0 0 0 is not supported; move it into the AMC"
        )


def _bone_line(
    bone: Bone, key: str, words: list[str], bones: dict[str, Bone], path: Path, line: int
) -> None:
    if key == "name":
        if len(words) != 2:
            raise fail(path, line, "a bone needs one name")
        if bone.name:
            raise fail(
                path,
                line,
                f"bone {bone.name!r} gets a second name; every bone needs its own begin ... end",
            )
        bone.name = words[1]
        if bone.name in bones:
            raise fail(path, line, f"bone {bone.name!r} is there twice; names must differ")
        bones[bone.name] = bone
    elif key == "direction":
        bone.direction = np.array(_triple(words[1:], path, line))
    elif key == "length":
        (bone.length,) = numbers(words[1:2], path, line) or (0.0,)
        if bone.length < 0:
            raise fail(
                path, line, f"bone {bone.name!r} has length {bone.length}; it must not be negative"
            )
    elif key == "axis":
        bone.axis_rad = np.array(_triple(words[1:4], path, line))
        bone.axis_order = _order(words[4] if len(words) > 4 else "xyz", path, line)
    elif key == "dof":
        bone.dof = tuple(word.lower() for word in words[1:])
        if not set(bone.dof) <= {"rx", "ry", "rz"}:
            raise fail(
                path,
                line,
                f"dof {' '.join(words[1:])} of {bone.name!r}: only rx, ry, rz are supported (rigid "
                "bones)",
            )


def _check_bone(bone: Bone, path: Path, line: int) -> None:
    if not bone.name:
        raise fail(path, line, "a bone without a name ends here")
    if bone.name in ASF_JOINTS.values() and not bone.length * np.abs(bone.direction).max() > 0:
        raise fail(
            path,
            bone.line,
            f"bone {bone.name!r} has no length; a body part hangs on it, give its length and "
            "direction",
        )


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
            raise fail(
                path,
                loose.line,
                f"bone {loose.name!r} does not hang on the root; list it in :hierarchy",
            )
        done |= {bone.name: bone for bone in ready}
    return tuple(done.values())
