"""AMC motions (Acclaim): HDM05, the CMU database.

A bone's rotation in the world is that of its parent times C R C^-1, C the bone's ``axis`` and R its
degrees of freedom, both applied about fixed axes in the order they are listed (``rx ry rz``: R = Rz
Ry Rx).
"""

from __future__ import annotations

import re
from collections.abc import Generator
from contextlib import closing
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError
from rtradar.motion.formats.asf import Skeleton
from rtradar.motion.formats.text_file import FRAMES_AT_ONCE, check_size, fail, numbers, read_lines
from rtradar.motion.motion import Motion
from rtradar.motion.quaternions import quaternions_to_world, to_world
from rtradar.system.row_files import FileBackedRows

_FRAME_NUMBER = re.compile("-?[0-9]{1,9}")
_RATE_HZ = 120.0
"""AMC files do not tell their rate; HDM05 and the CMU recordings here were made at 120 Hz."""


def load_amc(path: Path, skeleton: Skeleton) -> Motion:
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
    roots, rotations = FileBackedRows(), FileBackedRows()
    with closing(_read_frames(path, skeleton)) as blocks:
        for values, degrees in blocks:
            root_positions, quaternions = _posed(skeleton, values, np.pi / 180 if degrees else 1.0)
            roots.append(to_world(root_positions))
            rotations.append(quaternions_to_world(quaternions))
    index = {bone.name: j for j, bone in enumerate(skeleton.bones)}
    offsets = np.array([bone.direction * bone.length * skeleton.unit_m for bone in skeleton.bones])
    return Motion(
        name=path.stem,
        joints=tuple(index),
        parents=tuple(-1 if bone.parent is None else index[bone.parent] for bone in skeleton.bones),
        offsets=to_world(offsets),
        root_positions=roots.rows(),
        rotations=rotations.rows(),
        rate_hz=_RATE_HZ,
    )


def _posed(
    skeleton: Skeleton, values: dict[str, NDArray[np.float64]], to_radians: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute positions of the root (frame, 3) [m] and rotations (frame, bone, 4), mocap axes."""
    frames = len(next(iter(values.values())))
    world: dict[str, Rotation] = {}
    root_positions = np.zeros((frames, 3))
    for bone in skeleton.bones:
        frame = Rotation.from_euler(bone.axis_order, bone.axis_rad)
        data = values.get(bone.name, np.zeros((frames, 0)))
        turns = [k for k, name in enumerate(bone.dof) if name[0] == "r"]
        if bone.name == "root":
            root_positions = (
                data[:, [bone.dof.index(name) for name in ("tx", "ty", "tz")]] * skeleton.unit_m
            )
            columns = [bone.dof.index("r" + letter) for letter in bone.axis_order]
            local = Rotation.from_euler(bone.axis_order, data[:, columns] * to_radians)
        elif turns:
            local = Rotation.from_euler("".join(bone.dof[k][1] for k in turns), data * to_radians)
        else:
            local = Rotation.identity(frames)
        posed = frame * local * frame.inv()
        world[bone.name] = posed if bone.parent is None else world[bone.parent] * posed
    return root_positions, np.stack([rotation.as_quat() for rotation in world.values()], axis=1)


def _read_frames(
    path: Path, skeleton: Skeleton
) -> Generator[tuple[dict[str, NDArray[np.float64]], bool]]:
    """Yield values (frame, degree of freedom) by bone in blocks, and whether they are degrees."""
    widths = {bone.name: len(bone.dof) for bone in skeleton.bones if bone.dof}
    table: dict[str, list[list[float]]] = {name: [] for name in widths}
    number, n_frames = 0, 0
    known = {bone.name for bone in skeleton.bones}
    degrees = skeleton.degrees
    frame: int | None = None
    seen: set[str] = set()

    def finish(line: int) -> None:
        missing = [name for name in widths if name not in seen]
        if missing:
            some = ", ".join(missing[:3]) + (" ..." if len(missing) > 3 else "")
            raise fail(
                path,
                line,
                f"frame {frame} lacks {len(missing)} bones ({some}); the file may be cut off",
            )
        check_size(path, len(skeleton.bones), n_frames)

    def taken() -> dict[str, NDArray[np.float64]]:
        values = {name: np.array(rows) for name, rows in table.items()}
        for rows in table.values():
            rows.clear()
        return values

    with closing(read_lines(path, "AMC motion")) as lines:
        for number, raw in enumerate(lines, start=1):
            words = raw.split()
            if not words or words[0].startswith("#"):
                continue
            if words[0].startswith(":"):
                if words[0].upper() in (":DEGREES", ":RADIANS"):
                    if frame is not None and degrees != (words[0].upper() == ":DEGREES"):
                        raise fail(
                            path,
                            number,
                            f"{words[0]} after the first frame; it must stand before it",
                        )
                    degrees = words[0].upper() == ":DEGREES"
            elif len(words) == 1 and _FRAME_NUMBER.fullmatch(words[0]):
                if frame is not None:
                    finish(number - 1)
                    if int(words[0]) != frame + 1:
                        raise fail(
                            path,
                            number,
                            f"frame {words[0]} follows frame {frame}; frame numbers must be "
                            "consecutive",
                        )
                    if n_frames % FRAMES_AT_ONCE == 0:
                        yield taken(), degrees
                frame, seen, n_frames = int(words[0]), set(), n_frames + 1
            elif frame is None:
                raise fail(
                    path,
                    number,
                    f"{words[0][:40]!r} before the first frame number; this is not an AMC file",
                )
            else:
                name = words[0]
                if name not in known:
                    raise fail(
                        path,
                        number,
                        f"bone {name[:40]!r} is not in the skeleton {skeleton.path}; give the ASF "
                        "of this subject",
                    )
                if name in seen:
                    raise fail(path, number, f"bone {name!r} is there twice in frame {frame}")
                if len(words) - 1 != widths.get(name, 0):
                    raise fail(
                        path,
                        number,
                        f"bone {name!r} has {len(words) - 1} values where the skeleton has "
                        f"{widths.get(name, 0)}",
                    )
                seen.add(name)
                if name in table:
                    table[name].append(numbers(words[1:], path, number))
    if frame is None:
        raise InputError(f"{path}: no frame in this AMC file; it may be cut off")
    finish(number)
    yield taken(), degrees
