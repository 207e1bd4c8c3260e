"""Files of joint positions: archives of NumPy (.npz), and tables with a header (.csv).

Both hold ``positions (frame, joint, 3)``, the names of the ``joints``, which axis is ``up``,
and ``rate_hz`` or ``time_s (frame,)``. In a table each coordinate of a joint has a column, such as
``HipLeft_x``; ``time_s``, ``rate_hz`` and ``up`` have one each. What is not seen is NaN, an empty
cell, or the origin to the last bit.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.motion.formats import body_models
from rtradar.motion.formats.text_file import TextFile
from rtradar.motion.names import plain
from rtradar.recordings import UPWARD, Finding
from rtradar.system.checks import brief, check_number
from rtradar.system.files import read_arrays

Array = NDArray[np.float64]

LEAST_FRAMES = 5
"""Least number of frames, which the low-pass needs."""

_NEEDED = "joint positions need positions, joints, up, and rate_hz or time_s"
_MOST_JOINTS, _MOST_PLACES = 1000, 5_000_000
_FARTHEST, _LEAST_STEP_S = 1e9, 1e-6

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
    if body_models.holds_rotations(arrays):
        text = "body: rotations on the skeleton of a mean person; betas are not read"
        made = checked(path, body_models.as_positions(path, arrays), rate_hz)
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
            if "up" in columns:
                own = cells[columns["up"]]
                if rows and own != up:
                    raise text.fail(f"up is {brief(own)}, and was {brief(up)}; it must not change")
                up, cells[columns["up"]] = own, ""
            seen = [k for k, cell in enumerate(cells) if cell.lower() not in ("", "nan")]
            row = [math.nan] * len(cells)
            for k, value in zip(seen, text.numbers([cells[k] for k in seen]), strict=True):
                row[k] = value
            rate = columns.get("rate_hz", -1)
            if rate >= 0 and rows and row[rate] != rows[0][rate]:
                raise text.fail(f"rate_hz is {row[rate]:g}, and was {rows[0][rate]:g}; give time_s")
            rows.append(row)
            text.check_size(len(joints), len(rows))
    values = np.array(rows).reshape(len(rows), len(header))
    named = list(joints.values())
    arrays: dict[str, Any] = {"joints": np.array(list(joints)), "positions": values[:, named]}
    if "up" in columns:
        arrays["up"] = np.array(up)
    if "time_s" in columns:
        arrays["time_s"] = values[:, columns["time_s"]]
    if "rate_hz" in columns and len(rows):
        arrays["rate_hz"] = values[0, columns["rate_hz"]]
    return checked(path, arrays, rate_hz)


def _columns(text: TextFile, header: list[str]) -> tuple[dict[str, int], dict[str, list[int]]]:
    """Columns of what is not a coordinate, and three of each joint."""
    others, joints = dict[str, int](), dict[str, list[int]]()
    for k, cell in enumerate(header):
        found = re.fullmatch(r"(.+)[_. ]([xyz])", cell, re.IGNORECASE)
        if found:
            place = joints.setdefault(found[1], [-1, -1, -1])
            axis = "xyz".index(found[2].lower())
            if place[axis] >= 0:
                raise text.fail(f"column {brief(cell)} is there twice")
            place[axis] = k
        elif cell in ("time_s", "rate_hz", "up", "frame"):
            others[cell] = k
        else:
            raise text.fail(
                f"column {brief(cell)} is not understood; allowed are time_s, rate_hz, up, frame, "
                "and NAME_x, NAME_y, NAME_z of each joint"
            )
    for name, place in joints.items():
        if min(place) < 0:
            raise text.fail(
                f"joint {brief(name)} has no column for {'xyz'[place.index(-1)]}; each joint needs "
                "NAME_x, NAME_y, NAME_z"
            )
    return others, joints


def checked(
    path: Path, arrays: Mapping[str, NDArray[Any]], rate_hz: float | None
) -> JointRecording:
    """Make a recording of what a file holds; a rate that is given counts in place of the file's."""
    if rate_hz is not None:
        arrays = {name: array for name, array in arrays.items() if name != "time_s"}
        arrays["rate_hz"] = np.array(rate_hz)
    for needed in ("positions", "joints", "rate_hz or time_s"):
        if not any(name in arrays for name in needed.split(" or ")):
            raise InputError(f"{path}: {needed} is missing; {_NEEDED}")
    given, named = arrays["positions"], arrays["joints"]
    if given.ndim != 3 or given.shape[2] != 3 or given.dtype.kind not in "fiu":
        raise InputError(
            f"{path}: positions are {given.dtype} of shape {given.shape}; they must be real "
            "numbers of shape (frame, joint, 3)"
        )
    if named.shape != given.shape[1:2] or named.dtype.kind != "U":
        raise InputError(
            f"{path}: joints are {named.dtype} of shape {named.shape}; they must be "
            f"{given.shape[1]} names, one for each of the positions"
        )
    if len(given) < LEAST_FRAMES or given.shape[1] > _MOST_JOINTS:
        raise InputError(
            f"{path}: {len(given)} frames of {given.shape[1]} joints; there must be at least "
            f"{LEAST_FRAMES} frames, and at most {_MOST_JOINTS} joints"
        )
    if given.shape[0] * given.shape[1] > _MOST_PLACES:
        raise InputError(
            f"{path}: {given.shape[0]} frames of {given.shape[1]} joints; at most "
            f"{_MOST_PLACES} places of joints are read: cut it into shorter ones"
        )
    names = tuple(map(str, named))
    known = [plain(name) for name in names]
    for name in names:
        if known.count(plain(name)) > 1:
            raise InputError(f"{path}: joint {brief(name)} is there twice; keep one person's")
    positions = check_places(path, given)
    up = str(arrays["up"]).strip().lower() if "up" in arrays else ""
    if up and up not in UPWARD:
        raise InputError(f"{path}: up is {brief(up)}; it must be one of {', '.join(UPWARD)}")
    times = _times(path, arrays, len(given))
    kept = _apart(times)
    return JointRecording(path, names, positions[kept], times[kept], up, len(times) - kept.sum())


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
    if times.shape != (frames,) or times.dtype.kind not in "fiu":
        raise InputError(
            f"{path}: time_s is {times.dtype} of shape {times.shape}; it must be {frames} "
            "numbers, one for each frame"
        )
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
