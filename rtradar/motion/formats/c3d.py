"""Recordings of points: C3D of optical systems, and TRC of OpenSim, OpenCap and Motion Analysis.

The points are markers of CMU, HDM05 or Plug-in Gait, from which joints are found, or joints.

Of C3D the world axes are those of the file: Vicon's z is up, and C3D (x, y, z) = AMC (z, x, y),
which is the world's (x, y, z). A file whose POINT:Y_SCREEN says that y is up is rotated.
"""

from __future__ import annotations

import io
import math
import os
import warnings
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from rtradar.errors import InputError
from rtradar.motion.formats.joint_files import checked
from rtradar.motion.formats.joints import motion_of
from rtradar.motion.formats.markers import NEEDED, joint_centres, rigid_motion, runs
from rtradar.motion.formats.text_file import TextFile
from rtradar.motion.motion import Motion
from rtradar.motion.names import OWN_NAMES, conventions, plain
from rtradar.motion.reading import to_world_from, warn_of_speed
from rtradar.recordings import UPWARD, Finding, rate_of
from rtradar.system.checks import brief
from rtradar.system.files import open_regular

_UNITS_M = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""Values of POINT:UNITS, and of Units of a TRC file."""

LONGEST_GAP_S = 0.1
"""Longest gap of a marker that is bridged [s]."""

_UPRIGHT_M = 0.5
"""Least median height of the head above the ankles [m]; below, z is not up or the unit is wrong."""

_SHANK_M = (0.2, 0.7)
"""Limits of the distance of knee and ankle markers of people, children included [m]."""


@dataclass(frozen=True)
class Markers:
    """Positions (frame, marker, 3) of some markers, world [m], NaN where one was not seen.

    ``first_frame`` is the number of the first frame in the file, and ``says_up`` tells whether the
    file, or the user, says which axis is up.
    """

    path: Path
    names: tuple[str, ...]
    positions: NDArray[np.float64]
    rate_hz: float
    first_frame: int
    says_up: bool
    findings: tuple[Finding, ...] = ()


class Points(NamedTuple):
    """Content of a file: labels, points (frame, point, 4), and what the file says of them.

    A point is three coordinates and a residual, negative where it was not seen. ``unit`` and
    ``upward`` are in the words of the file, ``keys`` what it calls its unit and its rate; ``usual``
    is the axis that is up where it says none.
    """

    labels: list[str]
    points: NDArray[np.floating]
    rate_hz: float
    first_frame: int
    unit: str
    upward: str
    usual: str = "z"
    keys: tuple[str, str] = ("POINT:UNITS", "POINT:RATE")


def load_c3d(
    path: Path,
    *,
    skeleton: Path | None,
    unit_m: float | None,
    up: str | None,
    rate_hz: float | None,
) -> Motion:
    """Read a C3D file, and find the 22 joints of a rigid skeleton from its points.

    An `InputError` names the marker and the frames, by the file's numbers.
    """
    if skeleton is not None:
        raise InputError(
            f"{path}: a C3D file holds markers, from which joints are found; leave {skeleton} out"
        )
    return _motion_of(path, _read_c3d(path), unit_m, up, rate_hz)


def load_trc(path: Path, *, unit_m: float | None, up: str | None, rate_hz: float | None) -> Motion:
    """Read a TRC file, and find the 22 joints of a rigid skeleton from its points.

    An `InputError` names the line, or the marker and the frames.
    """
    return _motion_of(path, _read_trc(path), unit_m, up, rate_hz)


def _motion_of(
    path: Path, read: Points, unit_m: float | None, up: str | None, rate_hz: float | None
) -> Motion:
    if rate_hz is not None:
        read = read._replace(rate_hz=rate_hz)
    there = {plain(label) for label in read.labels}
    joints = min(conventions("joints"), key=lambda known: len(known.missing(there)))
    if not joints.missing(there):
        return _motion_of_joints(path, read, unit_m, up)
    seen = _chosen(path, read, NEEDED, unit_m, up)
    positions = bridged(seen)
    markers = {name: positions[:, k] for k, name in enumerate(seen.names)}
    _check_person(seen, markers)
    centres, pelvis, thorax = joint_centres(markers)
    motion = rigid_motion(path.stem, centres, pelvis, thorax, seen.rate_hz)
    speed = warn_of_speed(str(path), motion.joints, motion.positions, seen.rate_hz)
    return replace(motion, findings=(*seen.findings, rate_of(seen.rate_hz), speed))


def _motion_of_joints(path: Path, read: Points, unit_m: float | None, up: str | None) -> Motion:
    """Read points that are joints, as archives and tables hold them."""
    _check_frames(path, read)
    points = read.points[..., :3].astype(np.float64)
    points[read.points[..., 3] < 0] = np.nan
    given = {
        "positions": points,
        "joints": np.array([label.strip(" \0") for label in read.labels]),
        "rate_hz": np.array(read.rate_hz),
    }
    recording = replace(checked(path, given, None), usual=_upward(read, None))
    return motion_of(recording, unit_m or _UNITS_M.get(read.unit.lower()), up)


def _upward(read: Points, up: str | None) -> str:
    return up or read.upward.lower().removeprefix("+") or read.usual


def read_markers(
    path: Path, names: tuple[str, ...], unit_m: float | None = None, up: str | None = None
) -> Markers:
    """Read some markers of a C3D file, gaps and all."""
    return _chosen(path, _read_c3d(path), names, unit_m, up)


def _read_c3d(path: Path) -> Points:
    try:
        with (
            _Bounded(open_regular(path).detach()) as handle,
            warnings.catch_warnings(record=True) as caught,
        ):
            warnings.simplefilter("always")
            read = _read(handle)
    except OSError as error:
        raise InputError(
            f"{path}: cannot read this C3D file ({error.strerror or error}); check the path"
        ) from None
    except MemoryError:
        raise
    except Exception as error:  # the reader fails in many ways on bytes that are no C3D file
        reason = " ".join(str(error).split())[:100]
        raise InputError(
            f"{path}: not a C3D file, or a damaged one ({reason}); export it again"
        ) from None
    if any("end of file" in str(warning.message) for warning in caught):
        raise InputError(
            f"{path}: ends after {len(read.points)} frames where its header promises more; the "
            "file is cut off"
        )
    return read


def _read_trc(path: Path) -> Points:
    """Read a table of tabs, below a header of five lines."""
    with TextFile(path, "TRC") as text:
        lines = iter(text)
        first = next(lines, "")
        names = next(lines, "").split()
        said = dict(zip(names, next(lines, "").split(), strict=False))
        if not first.startswith("PathFileType") or not {"DataRate", "Units"} <= said.keys():
            raise text.fail("not a TRC file (PathFileType, then DataRate, Units, ...)")
        labels = [word.strip() for word in next(lines, "").split("\t")[2:] if word.strip()]
        next(lines, "")
        rows, width = list[list[float]](), 2 + 3 * len(labels)
        for line in lines:
            cells = [cell.strip() for cell in line.rstrip("\r\n").split("\t")]
            if not any(cells):
                continue
            if len([cell for cell in cells[width:] if cell]) or len(cells) < 2:
                raise text.fail(f"{len(cells)} cells where {len(labels)} markers have {width}")
            cells = (cells + width * [""])[:width]
            seen = [k for k in range(2, width) if cells[k].lower() not in ("", "nan")]
            row = [math.nan] * (width - 2)
            for k, value in zip(seen, text.numbers([cells[k] for k in seen]), strict=True):
                row[k - 2] = value
            rows.append(row)
            text.check_size(len(labels), len(rows))
        (rate,) = text.numbers([said["DataRate"]], 3)
    places = np.array(rows).reshape(len(rows), len(labels), 3)
    unseen = np.isnan(places).any(axis=2)
    points = np.concatenate([np.nan_to_num(places), np.where(unseen, -1.0, 0.0)[..., None]], axis=2)
    return Points(labels, points, rate, 1, said["Units"], "", "y", ("Units", "DataRate"))


def _check_frames(path: Path, read: Points) -> None:
    """Refuse points without frames or a rate."""
    if not len(read.points):
        raise InputError(f"{path}: no frame of markers in this file; export it again")
    if not 1.0 <= read.rate_hz <= 100_000.0:
        raise InputError(
            f"{path}: {read.keys[1]} is {read.rate_hz:g} frames a second; it must be 1 to 100000, "
            "mend the file"
        )


def _chosen(
    path: Path, read: Points, names: tuple[str, ...], unit_m: float | None, up: str | None
) -> Markers:
    """Choose some markers, in the world."""
    scale = unit_m if unit_m is not None else _UNITS_M.get(read.unit.lower(), 0.0)
    upward = _upward(read, up)
    _check_frames(path, read)
    if upward not in UPWARD:
        raise InputError(
            f"{path}: POINT:Y_SCREEN is {read.upward[:20]!r}, and no axis; give up, one of "
            f"{', '.join(UPWARD)} (--up)"
        )
    if not 0 < scale < np.inf:
        unit = f"{read.keys[0]} is {read.unit[:20]!r}" if unit_m is None else f"unit_m is {unit_m}"
        raise InputError(
            f"{path}: {unit}; {', '.join(_UNITS_M)} are understood, give the unit (unit, --unit)"
        )
    chosen = read.points[:, [_column(path, read.labels, name) for name in names]]
    # Not seen: a negative residual, or the origin to the last bit, where other software puts it.
    unseen = (chosen[..., 3] < 0) | ~chosen[..., :3].any(axis=2)
    places = chosen[..., :3].astype(np.float64) * scale
    places = places @ to_world_from(upward).T
    places[unseen] = np.nan
    said = bool(up or read.upward)
    by_unit = "given" if unit_m is not None else "the file says"
    by_up = "given" if up else "the file says" if said else "usual"
    findings = (
        Finding("unit_m", scale, f"unit: {scale:g} m, as {by_unit}"),
        Finding("up", upward, f"up: {upward}, as {by_up}"),
    )
    return Markers(path, names, places, read.rate_hz, read.first_frame, said, findings)


def bridged(seen: Markers) -> NDArray[np.float64]:
    """Positions (frame, marker, 3) with gaps up to `LONGEST_GAP_S` bridged by cubic splines."""
    positions = seen.positions.copy()
    frames = np.arange(len(positions))
    for k, name in enumerate(seen.names):
        unseen = np.isnan(positions[:, k, 0])
        if not unseen.any():
            continue
        for begin, end in runs(unseen):
            first, last = seen.first_frame + begin, seen.first_frame + end - 1
            where = f"{seen.path}: marker {name} is not seen in frames {first} to {last}"
            if begin == 0 or end == len(positions):
                raise InputError(
                    f"{where}, at an end of the recording; cut these frames off, or fill the gap"
                )
            if end - begin > LONGEST_GAP_S * seen.rate_hz:
                raise InputError(
                    f"{where}, {(end - begin) / seen.rate_hz:.3g} s; gaps up to {LONGEST_GAP_S} s "
                    "are bridged, fill this one"
                )
        positions[unseen, k] = CubicSpline(frames[~unseen], positions[~unseen, k])(frames[unseen])
    return positions


class _Bounded(io.BufferedReader):
    """A file that never reserves more memory for a read than the file has bytes."""

    def read(self, size: int | None = -1, /) -> bytes:
        return super().read(
            size if size is None or size < 0 else min(size, os.fstat(self.fileno()).st_size)
        )


def _read(handle: object) -> Points:
    import c3d  # not before a file asks for it

    reader = c3d.Reader(handle)
    if reader.point_used < 1:
        raise ValueError("it holds no points")

    def text(key: str) -> str:
        parameter = reader.get(key)
        return "" if parameter is None else str(parameter.string_value).strip(" \0")

    labels = [str(label) for label in reader.point_labels]
    frames = [points for _, points, _ in reader.read_frames(copy=True)]
    points = np.array(frames, dtype=np.float32).reshape(len(frames), -1, 5)
    rate, first = float(reader.point_rate), int(reader.first_frame)
    return Points(
        labels, points[..., :4], rate, first, text("POINT:UNITS"), text("POINT:Y_SCREEN").upper()
    )


def _column(path: Path, labels: list[str], name: str) -> int:
    """Column of a marker, by its name in the set of CMU or by that of another set."""
    key = f"{name[0]}_{name[1:]}" if len(name) > 3 and name[0] in "LR" else name
    others = (known.joints.get(key.lower(), ()) for known in conventions("markers"))
    wanted = [plain(name), *chain.from_iterable(others)]
    there = [plain(label) for label in labels]
    found = next((one for one in wanted if one in there), None)
    if found is None:
        some = brief(", ".join(label.strip(" \0") for label in labels[:4]))[1:-1]
        raise InputError(
            f"{path}: marker {name} is missing ({len(labels)} there: {some}, ...); the markers of "
            f"CMU, HDM05 and Plug-in Gait are understood, rename or add it ({OWN_NAMES})"
        )
    if there.count(found) > 1:
        raise InputError(
            f"{path}: marker {name} is there {there.count(found)} times; keep one person's markers"
        )
    return there.index(found)


def _check_person(seen: Markers, markers: dict[str, NDArray[np.float64]]) -> None:
    shanks = [
        np.linalg.norm(markers[f"{side}KNE"] - markers[f"{side}ANK"], axis=1) for side in "LR"
    ]
    shank = float(np.median(shanks))
    if not _SHANK_M[0] <= shank <= _SHANK_M[1]:
        raise InputError(
            f"{seen.path}: knee and ankle markers are {shank:.3g} m apart, a person's "
            f"{_SHANK_M[0]} to {_SHANK_M[1]} m; check POINT:UNITS and the markers' names"
        )
    ankles = (markers["LANK"][:, 2] + markers["RANK"][:, 2]) / 2
    above = float(np.median(markers["LFHD"][:, 2] - ankles))
    if above < _UPRIGHT_M and not seen.says_up:
        raise InputError(
            f"{seen.path}: the head is {above:.3g} m above the ankles along z, in the median; to "
            "tell what is up, give one who stands, or up (--up)"
        )
