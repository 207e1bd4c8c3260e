"""Files of joint positions: archives of NumPy (.npz), and tables with a header (.csv).

Both hold ``positions (frame, joint, 3)``, the names of the ``joints``, which axis is ``up``,
and ``rate_hz`` or ``time_s (frame,)``. In a table each coordinate of a joint has a column, such as
``HipLeft_x``; ``time_s``, ``rate_hz`` and ``up`` have one each. What is not seen is NaN, an empty
cell, or the origin to the last bit.

An archive may hold rotations of the body models SMPL, SMPL+H and SMPL-X instead, as AMASS has them:
``trans`` (frame, 3) [m] and, about each joint of the tree, axis times angle [rad]: ``poses``
(frame, 3 x joint), or ``root_orient``, ``pose_body`` and others. The 22 joints of the body come
first and are the same in all of these models; ``body_models.toml`` has them. The joint at the root
is at ``trans`` plus where it is in the rest pose. Shape (``betas``) and the files of the models,
which have a licence of their own, are not read: the skeleton is that of the models' mean person.

References
----------
M. Loper, N. Mahmood, J. Romero, G. Pons-Moll, M. J. Black, SMPL: A skinned multi-person linear
model, ACM Transactions on Graphics 34, 2015. N. Mahmood, N. Ghorbani, N. F. Troje, G. Pons-Moll,
M. J. Black, AMASS: Archive of motion capture as surface shapes, ICCV 2019.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError
from rtradar.motion.formats.text_file import TextFile
from rtradar.motion.skeleton import plain
from rtradar.recordings import UPWARD, Finding
from rtradar.system.checks import brief, check_number
from rtradar.system.files import read_arrays

Array = NDArray[np.float64]

LEAST_FRAMES = 5
"""Least number of frames, which the low-pass needs."""

_NEEDED = "joint positions need positions, joints, up, and rate_hz or time_s"
_MOST_JOINTS, _MOST_PLACES = 1000, 5_000_000
_FARTHEST, _LEAST_STEP_S = 1e9, 1e-6

_RATES = ("mocap_framerate", "mocap_frame_rate", "fps", "rate_hz")
"""Names of the rate in archives of rotations."""

_LEAST_STEP = 0.1
"""Least step of time over the median; a spline through places that are nearer in time would swing
by metres."""


@dataclass(frozen=True)
class JointRecording:
    """Positions (frame, joint, 3) of named joints in the file's axes and unit, NaN where not seen.

    ``times`` (frame,) ascend from 0 [s]. ``up`` is one of `UPWARD`, or empty where the file does
    not say it; ``usual`` the axis that files of this kind have. ``joined`` frames were left out,
    for another is hardly a moment before them.
    """

    path: Path
    names: tuple[str, ...]
    positions: Array
    times: Array
    up: str
    joined: int = 0
    usual: str = ""
    findings: tuple[Finding, ...] = ()


def read_npz(path: Path, rate_hz: float | None = None) -> JointRecording:
    """Read an archive of NumPy, of positions or of the rotations of a body model (AMASS).

    An `InputError` tells what is wrong with it.
    """
    try:
        arrays = read_arrays(path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot read this NPZ file ({error.strerror}); check the path"
        ) from None
    except ValueError as error:
        raise InputError(
            f"{path}: not an archive of NumPy, or a damaged one ({brief(str(error))[1:-1]}); "
            f"{_NEEDED}, written with numpy.savez"
        ) from None
    if "positions" not in arrays and {"poses", "root_orient", "pose_body"} & arrays.keys():
        text = "body: rotations on the skeleton of a mean person; betas are not read"
        made = checked(path, _as_positions(path, arrays), rate_hz)
        return replace(made, usual="z", findings=(Finding("body_model", "mean", text),))
    return checked(path, arrays, rate_hz)


def read_csv(path: Path, rate_hz: float | None = None) -> JointRecording:
    """Read a table with a header; an `InputError` names the line."""
    with TextFile(path, "table of joint positions") as text:
        header = [cell.strip(" \"'\t\r\n") for cell in next(iter(text)).split(",")]
        columns, joints = _columns(text, header)
        rows, up = list[list[float]](), ""
        for line in text:
            cells = [cell.strip(" \"'\t\r\n") for cell in line.split(",")]
            if cells == [""]:
                continue
            if len(cells) != len(header):
                raise text.fail(f"{len(cells)} cells where the header has {len(header)} columns")
            # The axis is text among numbers, so it is taken out before the cells are converted.
            if "up" in columns:
                own, cells[columns["up"]] = cells[columns["up"]], ""
                if rows and own != up:
                    raise text.fail(f"up is {brief(own)}, and was {brief(up)}; it must not change")
                up = own
            rows.append(text.cells(cells))
            rate = columns.get("rate_hz")
            if rate is not None and rows[-1][rate] != rows[0][rate]:
                was = f"{rows[-1][rate]:g}, and was {rows[0][rate]:g}"
                raise text.fail(f"rate_hz is {was}; it must not change, give time_s")
            text.check_size(len(joints), len(rows))
    # The table in the form of an archive, so that both are checked alike.
    values = np.array(rows).reshape(len(rows), len(header))
    places = values[:, list(joints.values())]
    arrays = {"joints": np.array(list(joints)), "positions": places, "up": np.array(up)}
    arrays |= {key: values[:, k] for key, k in columns.items() if key == "time_s"}
    arrays |= {key: values[:1, k] for key, k in columns.items() if key == "rate_hz"}
    return checked(path, arrays, rate_hz)


def _columns(text: TextFile, header: list[str]) -> tuple[dict[str, int], dict[str, list[int]]]:
    """Columns of what is not a coordinate, and three of each joint."""
    others, joints = dict[str, int](), dict[str, dict[str, int]]()
    # A column is a coordinate of a joint by its ending, or one of the few known names.
    for k, cell in enumerate(header):
        found = re.fullmatch(r"(.+)[_. ]([xyz])", cell, re.IGNORECASE)
        if found:
            first = joints.setdefault(found[1], {}).setdefault(found[2].lower(), k)
        elif cell in ("time_s", "rate_hz", "up", "frame"):
            first = others.setdefault(cell, k)
        else:
            raise text.fail(
                f"column {brief(cell)} is not understood; allowed are time_s, rate_hz, up, frame, "
                "and NAME_x, NAME_y, NAME_z of each joint"
            )
        if first != k:
            raise text.fail(f"column {brief(cell)} is there twice")
    for name, place in joints.items():
        if missing := [axis for axis in "xyz" if axis not in place]:
            raise text.fail(
                f"joint {brief(name)} has no column for {missing[0]}; each joint needs NAME_x, "
                "NAME_y, NAME_z"
            )
    return others, {name: [place[axis] for axis in "xyz"] for name, place in joints.items()}


def checked(
    path: Path, arrays: Mapping[str, NDArray[Any]], rate_hz: float | None
) -> JointRecording:
    """Make a recording of what a file holds; a rate that is given counts in place of the file's."""
    # The user's rate also takes the place of times.
    if rate_hz is not None:
        arrays = {name: array for name, array in arrays.items() if name != "time_s"}
        arrays["rate_hz"] = np.array(rate_hz)
    for needed in ("positions", "joints", "rate_hz or time_s"):
        if not any(name in arrays for name in needed.split(" or ")):
            raise InputError(f"{path}: {needed} is missing; {_NEEDED}")
    given, named = arrays["positions"], arrays["joints"]
    check_array(path, "positions", given, ("frame", "joint", 3))
    check_array(path, "joints", named, given.shape[1:2], "U")
    if len(given) < LEAST_FRAMES or given.shape[1] > _MOST_JOINTS or given.size > 3 * _MOST_PLACES:
        raise InputError(
            f"{path}: {given.shape[0]} frames of {given.shape[1]} joints; there must be at least "
            f"{LEAST_FRAMES} frames, and at most {_MOST_JOINTS} joints and {_MOST_PLACES} places "
            "of joints: cut it into shorter ones"
        )
    # Names that differ in case or namespace alone would be one node later.
    names = tuple(map(str, named))
    known = [plain(name) for name in names]
    for name in names:
        if known.count(plain(name)) > 1:
            raise InputError(f"{path}: joint {brief(name)} is there twice; keep one person's")
    positions = check_places(path, given)
    up = str(arrays["up"]).strip().lower() if "up" in arrays else ""
    if up and up not in UPWARD:
        raise InputError(f"{path}: up is {brief(up)}; it must be one of {', '.join(UPWARD)}")
    # Frames hardly a moment after another are left out, because a spline would swing between them.
    times = _times(path, arrays, len(given))
    kept = _apart(times)
    return JointRecording(path, names, positions[kept], times[kept], up, len(times) - kept.sum())


def check_array(
    path: Path, name: str, array: NDArray[Any], shape: tuple[int | str, ...], kinds: str = "fiu"
) -> None:
    """Refuse an array of another shape or kind than a file must have; a name is any length."""
    wrong = [
        own for own, size in zip(shape, array.shape, strict=False) if own not in (size, str(own))
    ]
    if wrong or len(shape) != array.ndim or array.dtype.kind not in kinds:
        raise InputError(
            f"{path}: {name} is {array.dtype} of shape {array.shape}; it must be "
            f"{'names' if kinds == 'U' else 'real numbers'} of shape ({', '.join(map(str, shape))})"
        )


def check_places(path: Path, places: NDArray[Any]) -> Array:
    """Places (frame, joint, 3), NaN where one was not seen or is the origin to the last bit."""
    positions = places.astype(np.float64)
    if (np.abs(positions) > _FARTHEST).any():  # NaN is not
        raise InputError(f"{path}: positions reach beyond {_FARTHEST:g}; what is not seen is NaN")
    positions[np.isnan(positions).any(axis=2) | ~positions.any(axis=2)] = np.nan
    return positions


def _apart(times: Array) -> NDArray[np.bool_]:
    """Which frames (frame,) are to be kept: those a step after the last one that is kept."""
    least = _LEAST_STEP * float(np.median(np.diff(times)))
    kept, last = np.ones(len(times), dtype=bool), times[0]
    # Against the last frame that was kept, so that a row of tiny steps is not kept whole.
    for frame in range(1, len(times)):
        kept[frame] = times[frame] - last >= least
        last = times[frame] if kept[frame] else last
    return kept


def _times(path: Path, arrays: Mapping[str, NDArray[Any]], frames: int) -> Array:
    """Times (frame,) that ascend from 0 [s]."""
    if "time_s" not in arrays:
        rate = arrays["rate_hz"]
        number = rate.item() if rate.size == 1 else rate
        return np.arange(frames) / check_number(str(path), "rate_hz", number, 1.0, 100_000.0)
    times = arrays["time_s"]
    check_array(path, "time_s", times, (frames,))
    times = times.astype(np.float64)
    for frame in np.flatnonzero(~np.isfinite(times)):
        raise InputError(f"{path}: time_s is {times[frame]} in frame {frame + 1}; mend it")
    steps = np.diff(times)
    for frame in np.flatnonzero(steps < _LEAST_STEP_S):
        raise InputError(
            f"{path}: time_s is {times[frame + 1]:g} in frame {frame + 2}, after "
            f"{times[frame]:g}; times must ascend, by a microsecond at least"
        )
    check_number(str(path), "frames a second by time_s", 1 / np.median(steps), 1.0, 100_000.0)
    return np.asarray(times - times[0])


# -- rotations of body models ----------------------------------------------------------------------


def _as_positions(path: Path, arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Positions (frame, joint, 3) of the joints, in the axes of the file [m], and the rate.

    They have the keys of an archive of joint positions.
    """
    person = _mean_person()
    joints = person["joints"]
    turned = _rotations_of(path, arrays, len(joints))
    if "trans" not in arrays:
        raise InputError(f"{path}: trans is missing; rotations need it, as in AMASS")
    trans = arrays["trans"]
    check_array(path, "trans", trans, (len(turned), 3))
    for name, values in (("trans", trans), ("rotations", turned)):
        for frame in np.flatnonzero(~np.isfinite(values).all(axis=1)):
            raise InputError(f"{path}: {name} are not finite in frame {frame + 1}; mend them")
    # The rest pose of SMPL-X has its pelvis elsewhere.
    kind = "smplx" if "x" in str(arrays.get("surface_model_type", "")) else "others"
    places, world = dict[str, Array](), dict[str, Rotation]()
    # Forward kinematics down the tree: the rotation of a joint carries the offsets of its children.
    for number, (joint, own) in enumerate(joints.items()):
        local, above = Rotation.from_rotvec(turned[:, 3 * number : 3 * number + 3]), own["parent"]
        if above:
            places[joint] = places[above] + world[above].apply(own["offset"])
            world[joint] = world[above] * local
        else:
            places[joint], world[joint] = trans + np.array(person["pelvis"][kind]), local
    found = {"positions": np.stack(list(places.values()), axis=1), "joints": np.array(list(joints))}
    rates = [arrays[name] for name in _RATES if name in arrays]
    return found | ({"rate_hz": rates[0]} if rates else {})


@cache
def _mean_person() -> Mapping[str, Any]:
    """Joints and pelvis of the mean person."""
    text = Path(__file__).with_name("body_models.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def _rotations_of(path: Path, arrays: Mapping[str, NDArray[Any]], joints: int) -> Array:
    """Axis times angle (frame, 3 a joint) of the joints of the body [rad]."""
    if "poses" in arrays:
        given = arrays["poses"]
        # Hands and face come after the body.
        body = given[:, : 3 * joints] if given.ndim == 2 else given
        check_array(path, "poses", body, ("frame", 3 * joints))
        return np.asarray(body, dtype=np.float64)
    parts = [arrays.get(name, np.empty(0)) for name in ("root_orient", "pose_body")]
    check_array(path, "root_orient", parts[0], ("frame", 3))
    check_array(path, "pose_body", parts[1], (len(parts[0]), 3 * joints - 3))
    return np.concatenate(parts, axis=1).astype(np.float64)
