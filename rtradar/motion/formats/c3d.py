"""C3D recordings of optical markers, with the marker set of CMU and HDM05.

World axes are those of the file: Vicon's z is up, and C3D (x, y, z) = AMC (z, x, y), which is the
world's (x, y, z). A file whose POINT:Y_SCREEN says that y is up is rotated.
"""

from __future__ import annotations

import io
import os
import re
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from rtradar.errors import InputError
from rtradar.motion.formats.markers import NEEDED, joint_centres, rigid_motion, runs
from rtradar.motion.motion import Motion
from rtradar.motion.reading import to_world_from, warn_of_speed
from rtradar.recordings import UPWARD, Finding, rate_of
from rtradar.system.checks import brief
from rtradar.system.files import open_regular

_UNITS_M = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""Values of POINT:UNITS."""

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


class _Content(NamedTuple):
    """Content of a C3D file: labels, points (frame, point, 5), and what the file says of them."""

    labels: list[str]
    points: NDArray[np.float32]
    rate_hz: float
    first_frame: int
    unit: str
    upward: str


def load_c3d(
    path: Path,
    *,
    skeleton: Path | None,
    unit_m: float | None,
    up: str | None,
    rate_hz: float | None,
) -> Motion:
    """Read a C3D file, and find the 22 joints of a rigid skeleton from its markers (`markers`).

    An `InputError` names the marker and the frames, by the file's numbers.
    """
    if skeleton is not None:
        raise InputError(
            f"{path}: a C3D file holds markers, from which joints are found; leave {skeleton} out"
        )
    seen = read_markers(path, NEEDED, unit_m, up)
    if rate_hz is not None:
        seen = replace(seen, rate_hz=rate_hz)
    positions = bridged(seen)
    markers = {name: positions[:, k] for k, name in enumerate(seen.names)}
    _check_person(seen, markers)
    centres, pelvis, thorax = joint_centres(markers)
    motion = rigid_motion(path.stem, centres, pelvis, thorax, seen.rate_hz)
    speed = warn_of_speed(str(path), motion.joints, motion.positions, seen.rate_hz)
    return replace(motion, findings=(*seen.findings, rate_of(seen.rate_hz), speed))


def read_markers(
    path: Path, names: tuple[str, ...], unit_m: float | None = None, up: str | None = None
) -> Markers:
    """Read some markers of a C3D file, gaps and all."""
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
    scale = unit_m if unit_m is not None else _UNITS_M.get(read.unit.lower(), 0.0)
    upward = up or read.upward.lower().removeprefix("+") or "z"
    unit = f"unit_m is {unit_m}" if unit_m is not None else f"POINT:UNITS is {read.unit[:20]!r}"
    for wrong, what in (
        (
            any("end of file" in str(warning.message) for warning in caught),
            f"ends after {len(read.points)} frames where its header promises more; the file is "
            "cut off",
        ),
        (not len(read.points), "no frame of markers in this C3D file; export it again"),
        (
            not 1.0 <= read.rate_hz <= 100_000.0,
            f"POINT:RATE is {read.rate_hz:g} frames a second; it must be 1 to 100000, mend the "
            "file",
        ),
        (
            upward not in UPWARD,
            f"POINT:Y_SCREEN is {read.upward[:20]!r}, and no axis; give up, one of "
            f"{', '.join(UPWARD)} (--up)",
        ),
        (
            not 0 < scale < np.inf,
            f"{unit}; {', '.join(_UNITS_M)} are understood, give the unit (unit, --unit)",
        ),
    ):
        if wrong:
            raise InputError(f"{path}: {what}")
    chosen = read.points[:, [_column(path, read.labels, name) for name in names]]
    # Not seen: a negative residual, or the origin to the last bit, where other software puts it.
    unseen = (chosen[..., 3] < 0) | ~chosen[..., :3].any(axis=2)
    places = chosen[..., :3].astype(np.float64) * scale
    places = places @ to_world_from(upward).T
    places[unseen] = np.nan
    said = bool(up or read.upward)
    by_unit = "given" if unit_m is not None else "POINT:UNITS says"
    by_up = "given" if up else "POINT:Y_SCREEN says" if said else "usual"
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


def _read(handle: object) -> _Content:
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
    return _Content(
        labels, points, rate, first, text("POINT:UNITS"), text("POINT:Y_SCREEN").upper()
    )


def _column(path: Path, labels: list[str], name: str) -> int:
    plain = [re.sub(r"^.*:", "", label.strip(" \0")).upper() for label in labels]
    if name not in plain:
        some = brief(", ".join(label.strip(" \0") for label in labels[:4]))[1:-1]
        raise InputError(
            f"{path}: marker {name} is missing ({len(labels)} there: {some}, ...); the 41 markers "
            "of CMU and HDM05 are understood, rename or add it"
        )
    if plain.count(name) > 1:
        raise InputError(
            f"{path}: marker {name} is there {plain.count(name)} times; keep one person's markers"
        )
    return plain.index(name)


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
