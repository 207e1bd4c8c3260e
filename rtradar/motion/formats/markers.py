"""Recordings of points: C3D of optical systems, and TRC of OpenSim, OpenCap and Motion Analysis.

The points are markers of CMU, HDM05 or Plug-in Gait, from which joints are found, or joints.

The axes of C3D files are usually those of the world: Vicon's z is up, and C3D (x, y, z) = AMC
(z, x, y). A file may say another axis in POINT:Y_SCREEN.

The marker set is the one of 41 markers that CMU and HDM05 recordings carry, in Vicon's names: four
on the head (LFHD, RFHD, LBHD, RBHD), C7, T10, CLAV and STRN about the chest, four on the waist
(LFWT, RFWT, LBWT, RBWT), and on each side shoulder, elbow, a wrist bar with two ends (WRA on the
side of the thumb, WRB), knuckle (FIN), knee, ankle, toe. Only the 28 markers that are named here
are asked for.

A joint's centre is the middle of its markers - pairs before and behind, or on both sides of it -
or, where one marker alone marks it, that marker; from there an offset in the axes of its segment
leads inward. Offsets belong to a person whose knee and ankle markers are `SHANK_M` apart, and grow
with that distance. They are medians over the first half of the CMU take 135_02, which exists as AMC
too; ``validation/measurements/c3d_take.py`` judges by its second half. Markers on waist and wrist
bars are centimetres off the bone, and a solver's shoulder lies lower than the marker on it:
without the offsets hips are 18 cm off.

References
----------
Carnegie Mellon University Motion Capture Database, marker placement guide (mocap.cs.cmu.edu). M.
Mueller, T. Roeder, M. Clausen, B. Eberhardt, B. Krueger, A. Weber, Documentation Mocap Database
HDM05, technical report CG-2007-2, Universitaet Bonn, 2007.
"""

from __future__ import annotations

import io
import os
import tomllib
import warnings
from collections.abc import Mapping
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from rtradar.errors import InputError
from rtradar.motion.formats.joint_files import check_places, checked
from rtradar.motion.formats.joints import motion_of
from rtradar.motion.formats.skeletons import level_axes, rigid_motion, runs, unit
from rtradar.motion.formats.text_file import TextFile
from rtradar.motion.motion import Motion
from rtradar.motion.reading import settled_nodes, warn_of_speed
from rtradar.motion.skeleton import NODES, OWN_NAMES, conventions, plain
from rtradar.recordings import UNITS_M, UPWARD, rate_of
from rtradar.system.checks import brief, check_number
from rtradar.system.files import open_regular

LONGEST_GAP_S = 0.1
"""Longest gap of a marker that is bridged [s]."""


class Points(NamedTuple):
    """Points (frame, point, 3) in the axes and the unit of a file, NaN where one was not seen.

    ``first_frame`` is the number of the first frame in the file, ``rate_key`` what the file calls
    its rate, ``unit`` is in its words, and ``up`` the axis that is up, as the file or the format
    says.
    """

    path: Path
    names: tuple[str, ...]
    positions: NDArray[Any]
    rate_hz: float
    first_frame: int
    unit: str
    up: str
    rate_key: str


def load_c3d(path: Path, *, unit_m: float | None, up: str | None, rate_hz: float | None) -> Motion:
    """Read a C3D file, and find the 22 joints of a rigid skeleton from its points.

    An `InputError` names the marker and the frames, by the file's numbers.
    """
    return _motion_of(read_c3d(path), unit_m, up, rate_hz)


def load_trc(path: Path, *, unit_m: float | None, up: str | None, rate_hz: float | None) -> Motion:
    """Read a TRC file, and find the 22 joints of a rigid skeleton from its points.

    An `InputError` names the line, or the marker and the frames.
    """
    return _motion_of(_read_trc(path), unit_m, up, rate_hz)


def _motion_of(read: Points, unit_m: float | None, up: str | None, rate_hz: float | None) -> Motion:
    path, where = read.path, str(read.path)
    if rate_hz is not None:
        read = read._replace(rate_hz=rate_hz)
    if not len(read.positions):
        raise InputError(f"{path}: no frame of markers in this file; export it again")
    check_number(where, f"{read.rate_key} [frames a second]", read.rate_hz, 1.0, 100_000.0)
    by, unit_m = "given" if unit_m else "the file says", unit_m or UNITS_M.get(read.unit.lower())
    # A file of points may hold joints in place of markers: where all joints of a known set are
    # there, it is read as a recording of joints.
    there = {plain(label) for label in read.names}
    known = min(conventions("joints"), key=lambda known: len(known.missing(there)))
    if not known.missing(there):
        names, rate = np.array([name.strip(" \0") for name in read.names]), np.array(read.rate_hz)
        given = {"positions": read.positions, "joints": names, "rate_hz": rate}
        return motion_of(replace(checked(path, given, None), usual=read.up), unit_m, up)
    # Markers: gaps are bridged, centres of joints are found inward of the skin, and all is turned
    # to the world.
    places = np.moveaxis(bridged(chosen(read, NEEDED)), 1, 0)
    centres, pelvis, thorax = joint_centres(dict(zip(NEEDED, places, strict=True)))
    to_world, unit_m, found = settled_nodes(
        where, centres, unit_m=unit_m, unit_by=by, up=up or "", usual=read.up
    )
    turned = unit_m * centres @ to_world.T, to_world @ pelvis, to_world @ thorax
    motion = rigid_motion(path.stem, *turned, read.rate_hz)
    speed = warn_of_speed(where, motion.joints, motion.positions, read.rate_hz)
    return replace(motion, findings=(*found, rate_of(read.rate_hz), speed))


def read_c3d(path: Path) -> Points:
    """Read the points of a C3D file, gaps and all, in its axes and its unit."""
    try:
        # The reader warns, and does not fail, where a file ends early.
        with (
            _Bounded(open_regular(path).detach()) as handle,
            warnings.catch_warnings(record=True) as caught,
        ):
            warnings.simplefilter("always")
            read = _read(path, handle)
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
            f"{path}: ends after {len(read.positions)} frames where its header promises more; the "
            "file is cut off"
        )
    return read


def _read_trc(path: Path) -> Points:
    """Read a table of tabs, below a header of five lines."""
    with TextFile(path, "TRC") as text:
        # A header of five lines: the kind of file, names of its values, these values, the labels of
        # the markers, and the labels of their coordinates.
        lines = iter(text)
        first = next(lines, "")
        names = next(lines, "").split()
        said = dict(zip(names, next(lines, "").split(), strict=False))
        if not first.startswith("PathFileType") or not {"DataRate", "Units"} <= said.keys():
            raise text.fail("not a TRC file (PathFileType, then DataRate, Units, ...)")
        labels = [word.strip() for word in next(lines, "").split("\t")[2:] if word.strip()]
        next(lines, "")
        # A row may end early, where the last markers are not seen, but has no cells beyond them.
        rows, width = list[list[float]](), 2 + 3 * len(labels)
        for line in lines:
            cells = [cell.strip() for cell in line.rstrip("\r\n").split("\t")]
            if not any(cells):
                continue
            if len([cell for cell in cells[width:] if cell]) or len(cells) < 2:
                raise text.fail(f"{len(cells)} cells where {len(labels)} markers have {width}")
            rows.append(text.cells((cells + width * [""])[2:width]))
            text.check_size(len(labels), len(rows))
        (rate,) = text.numbers([said["DataRate"]], 3)
    places = np.array(rows).reshape(len(rows), len(labels), 3)
    return Points(path, tuple(labels), places, rate, 1, said["Units"], "y", "DataRate")


def chosen(read: Points, names: tuple[str, ...]) -> Points:
    """Choose some markers; one at the origin to the last bit was not seen."""
    columns = [_column(read.path, read.names, name) for name in names]
    return read._replace(names=names, positions=check_places(read.path, read.positions[:, columns]))


def bridged(seen: Points) -> NDArray[np.float64]:
    """Positions (frame, marker, 3) with gaps up to `LONGEST_GAP_S` bridged by cubic splines."""
    positions = seen.positions.astype(np.float64)
    frames = np.arange(len(positions))
    for k, name in enumerate(seen.names):
        unseen = np.isnan(positions[:, k, 0])
        if not unseen.any():
            continue
        # A gap at an end has no neighbours on one side, and a long one could hide any movement.
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
        length = os.fstat(self.fileno()).st_size
        return super().read(size if size is None or size < 0 else min(size, length))


def _read(path: Path, handle: object) -> Points:
    import c3d  # not before a file asks for it

    reader = c3d.Reader(handle)
    if reader.point_used < 1:
        raise ValueError("it holds no points")

    def text(key: str) -> str:
        parameter = reader.get(key)
        return "" if parameter is None else str(parameter.string_value).strip(" \0")

    frames = [points for _, points, _ in reader.read_frames(copy=True)]
    points = np.array(frames, dtype=np.float32).reshape(len(frames), -1, 5)
    # A negative residual is how C3D says that a point was not seen.
    places = np.where(points[..., 3:4] < 0, np.float32(np.nan), points[..., :3])
    up = text("POINT:Y_SCREEN").lower().removeprefix("+")
    return Points(
        path,
        tuple(str(label) for label in reader.point_labels),
        places,
        float(reader.point_rate),
        int(reader.first_frame),
        text("POINT:UNITS"),
        up if up in UPWARD else "z",
        "POINT:RATE",
    )


def _column(path: Path, labels: tuple[str, ...], name: str) -> int:
    """Column of a marker, by its name in the set of CMU or by that of another set."""
    # The tables of names have sides as `l_` and `r_`.
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


Array = NDArray[np.float64]


class Centre(NamedTuple):
    """Position of a joint's centre relative to the mean of its markers.

    ``markers.toml`` explains the fields.
    """

    markers: tuple[str, ...]
    segment: str
    offset_m: tuple[float, float, float]


_TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))

SHANK_M: float = _TABLE["shank_m"]
"""Distance of knee and ankle markers of the person whom the offsets belong to."""

NEEDED: tuple[str, ...] = tuple(_TABLE["needed"])
"""The markers that must be there."""

CENTRES = {
    node: Centre(tuple(markers.split()), *place)
    for node, (markers, *place) in _TABLE["centres"].items()
}
"""Centre of each node; those of the limbs serve both sides."""

_STRAIGHT = 0.15
"""Angle [rad] below which the plane of an arm's bend comes more and more from the shoulder.

A straight arm has no such plane of its own."""


def joint_centres(markers: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    """Find the 22 nodes, and the orientations of pelvis and chest.

    ``markers`` are the positions (frame, 3) of all of `NEEDED`, in any axes and unit, as are the
    nodes (frame, node, 3); the rotations of pelvis and thorax (frame, 3, 3) have columns forward,
    left and up.
    """
    # The offsets of the table grow with the person, whose size is measured by the shanks.
    frames = _segments(markers)
    knees, ankles = ([markers[side + end] for side in "LR"] for end in ("KNE", "ANK"))
    shanks = np.linalg.norm(np.subtract(knees, ankles), axis=2)
    size = float(np.median(shanks)) / SHANK_M
    centres = []
    # Offsets are given for the left side; those of the right are mirrored.
    for node in NODES:
        side = node[0].upper()
        centre = CENTRES[node if node in CENTRES else node[2:]]
        forward, left, up = centre.offset_m
        frame = frames.get(centre.segment, frames.get(f"{side} {centre.segment}"))
        assert frame is not None  # every segment of the table is made
        offset = size * np.array([forward, -left if node.startswith("r_") else left, up])
        own = (marker.replace("@", side) for marker in centre.markers)
        centres.append(_middle(markers, *own) + frame @ offset)
    return np.stack(centres, axis=1), frames["pelvis"], frames["thorax"]


def _segments(markers: Mapping[str, Array]) -> dict[str, Array]:
    """Axes (frame, 3, 3) of the segments: columns forward, left, up."""

    def middle(*names: str) -> Array:
        return _middle(markers, *names)

    thorax = _axes(
        up=middle("C7", "CLAV") - middle("T10", "STRN"),
        forward=middle("CLAV", "STRN") - middle("C7", "T10"),
    )
    frames = {"thorax": thorax}
    # Four markers around waist and head: left is between the sides, forward between front and back.
    for name, end in (("pelvis", "WT"), ("head", "HD")):
        frames[name] = level_axes(
            middle(f"LF{end}", f"LB{end}") - middle(f"RF{end}", f"RB{end}"),
            middle(f"LF{end}", f"RF{end}") - middle(f"LB{end}", f"RB{end}"),
        )
    # Limbs: up along the bone, and forward by toes, by the bend of the elbow and by the wrist bar.
    for side, sign in (("L", 1.0), ("R", -1.0)):
        shoulder, elbow = markers[f"{side}SHO"], markers[f"{side}ELB"]
        knee, ankle = markers[f"{side}KNE"], markers[f"{side}ANK"]
        wrist = middle(f"{side}WRA", f"{side}WRB")
        frames[f"{side} shank"] = _axes(up=knee - ankle, forward=markers[f"{side}TOE"] - ankle)
        bend = _bend(shoulder, elbow, wrist, thorax, sign)
        frames[f"{side} upper arm"] = _axes(up=shoulder - elbow, forward=bend)
        frames[f"{side} forearm"] = _axes(up=elbow - wrist, forward=markers[f"{side}WRA"] - wrist)
    return frames


def _bend(shoulder: Array, elbow: Array, wrist: Array, thorax: Array, sign: float) -> Array:
    """Direction (frame, 3) in which the forearm leaves the upper arm's line, or would leave it."""
    arm, fore = unit(elbow - shoulder), unit(wrist - elbow)
    bent = fore - np.sum(fore * arm, axis=1, keepdims=True) * arm
    # An arm that hangs down, out and forward bends forward and up; the smallest rotation takes it
    # to where this arm points.
    rest, ahead = unit(np.array([0.5, 0.5 * sign, -0.7])), unit(np.array([0.7, 0.0, 0.5]))
    local = np.einsum("tji,tj->ti", thorax, arm)
    half = rest + local
    # Two reflections, along rest and along rest + local, are that rotation. Opposite to rest there
    # is none, and any will do.
    reflected = ahead - 2 * np.dot(ahead, rest) * rest
    along = np.sum(half * half, axis=1, keepdims=True)
    held = reflected - 2 * half * (half @ reflected)[:, None] / np.maximum(along, 1e-9)
    # The straighter the arm, the more of the direction that the shoulder suggests.
    lacking = np.maximum(_STRAIGHT - np.linalg.norm(bent, axis=1, keepdims=True), 0.0)
    return np.asarray(bent + lacking * np.einsum("tij,tj->ti", thorax, held))


def _middle(markers: Mapping[str, Array], *names: str) -> Array:
    return np.asarray(np.mean([markers[name] for name in names], axis=0))


def _axes(*, up: Array, forward: Array) -> Array:
    """Axes with this up, and forward as near to ``forward`` as that allows."""
    z = unit(up)
    y = unit(np.cross(z, forward))
    return np.stack([np.cross(y, z), y, z], axis=2)
