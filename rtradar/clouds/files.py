"""Files of point clouds: NumPy archives, and PLY and PCD for viewers.

A file is written beside its place and then renamed. Readers raise errors of many types if a file is
none of theirs; `rtradar.exchange.read_cloud` makes one line of them.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.clouds.spatial import SPATIAL_AXES, SPATIAL_UNITS, SpatialCloud, measured_alone
from rtradar.errors import InputError
from rtradar.system.files import atomic_file, read_arrays, read_bytes

RDT_AXES = ("time", "range", "velocity")
"""Coordinate names of an RDT cloud."""

RDT_UNITS = ("s", "m", "m/s")
"""Units of `RDT_AXES`."""

_EXTRA_UNITS = {"velocity": "m/s", "power": "m2", "time": "s"}
"""Columns of a spatial cloud beside the coordinates, with their units."""

_PLY_TYPES = {
    "char": "i1", "uchar": "u1", "short": "<i2", "ushort": "<u2",
    "int": "<i4", "uint": "<u4", "float": "<f4", "double": "<f8",
}  # fmt: skip
_MEANING = re.compile(r"\b(\w{1,64}) = (\w{1,64}) \[([ -\\^-~]{0,64})\]", re.ASCII)
"""Meaning of one column. Bounded, as a search in a hostile comment takes quadratic time."""
_MOST_HEADER_BYTES = 65536
_MOST_BYTES = 1_000_000_000


@dataclass(frozen=True)
class CloudTable:
    """Table of points with coordinates and further columns.

    Parameters
    ----------
    names : tuple of str
        Names of the columns: three coordinates, then the others.
    units : tuple of str
        Units of the columns, empty if a file does not state them.
    values : (point, column) float64
        Values of all points.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: NDArray[np.float64]

    def _fields(self) -> tuple[str, ...]:
        """Names of the columns in files for viewers, which expect x, y and z."""
        return ("x", "y", "z", *self.names[3:])

    def _meaning(self) -> str:
        table = zip(self._fields(), self.names, self.units, strict=True)
        meaning = ", ".join(f"{field} = {name} [{unit}]" for field, name, unit in table)
        # A viewer shows NaN as nothing: the comment says why.
        missing = np.flatnonzero(np.isnan(self.values).any(axis=0))
        return meaning + "".join(
            f"; {self.names[column]} is not measured: NaN" for column in missing
        )


def save_cloud_npz(path: str | os.PathLike[str], points: ArrayLike) -> None:
    """Write an RDT cloud as a NumPy archive.

    The archive holds ``points (n, 3) float64``, ``axes (3,)`` and ``units (3,)``.

    Parameters
    ----------
    path : path
        Output file, which is replaced if it exists.
    points : (n, 3) float
        Time [s], range [m] and velocity [m/s] of each point; n may be 0.

    Raises
    ------
    InputError
        If the shape is wrong, a coordinate is not finite, or the file cannot be written.
    """
    write_npz(Path(path), _rdt_table(points))


def save_ply(path: str | os.PathLike[str], points: ArrayLike) -> None:
    """Write an RDT cloud as a binary little-endian PLY file with coordinates of type double.

    A comment line of the header states what x, y and z are.

    Parameters
    ----------
    path, points
        Output file and points: see `save_cloud_npz`, which raises the same errors.
    """
    write_ply(Path(path), _rdt_table(points))


def _rdt_table(points: ArrayLike) -> CloudTable:
    places = np.asarray(points, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 3:
        raise InputError(f"cloud: points have shape {places.shape}; they must be (n, 3)")
    if not np.isfinite(places).all():
        raise InputError("cloud: points hold NaN or infinity; every coordinate must be finite")
    return CloudTable(RDT_AXES, RDT_UNITS, places)


def save_spatial_npz(path: str | os.PathLike[str], cloud: SpatialCloud) -> None:
    """Write a spatial cloud as a NumPy archive.

    The archive holds ``points (n, 3)``, ``velocity``, ``power`` and ``time (n,)``, ``axes`` and
    ``units (3,)``, and ``source`` and ``part (n,) int64`` if the cloud has them. A coordinate that
    is not measured is NaN in every point.

    Parameters
    ----------
    path : path
        Output file: see `save_cloud_npz`.
    cloud : SpatialCloud
        Cloud to write, which may be empty.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    columns = [cloud.points, *(getattr(cloud, name)[:, None] for name in _EXTRA_UNITS)]
    names, units = (*SPATIAL_AXES, *_EXTRA_UNITS), (*SPATIAL_UNITS, *_EXTRA_UNITS.values())
    who = {"source": cloud.source, "part": cloud.part}
    known = {name: own for name, own in who.items() if own is not None}
    write_npz(Path(path), CloudTable(names, units, np.concatenate(columns, axis=1)), **known)


def write_npz(path: Path, cloud: CloudTable, **more: NDArray[Any]) -> dict[str, Any]:
    """Write ``points (n, 3)``, ``axes``, ``units`` and further columns by their names, float64.

    Arrays of other types are given by name.
    """
    # Coordinates together, every other column by its name.
    extra = {name: cloud.values[:, 3 + k] for k, name in enumerate(cloud.names[3:])}
    with atomic_file(path) as file:
        axes, units = np.array(cloud.names[:3]), np.array(cloud.units[:3])
        np.savez_compressed(
            file,
            allow_pickle=False,
            points=cloud.values[:, :3],
            axes=axes,
            units=units,
            **extra,
            **more,
        )
    return {"type": "float64"}


def write_ply(path: Path, cloud: CloudTable) -> dict[str, Any]:
    """Write a binary little-endian PLY, all columns as double; a comment says what they are."""
    properties = "".join(f"property double {field}\n" for field in cloud._fields())
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment rtradar: {cloud._meaning()}\n"
        f"element vertex {len(cloud.values)}\n{properties}end_header\n"
    )
    _write(path, header, cloud.values.astype("<f8"))
    return {"type": "float64"}


def write_pcd(path: Path, cloud: CloudTable) -> dict[str, Any]:
    """Write a binary PCD with float32 columns, because the point types of PCL have no double."""
    count = len(cloud._fields())
    header = (
        f"# .PCD v0.7 - Point Cloud Data file format\n# rtradar: {cloud._meaning()}\nVERSION 0.7\n"
        f"FIELDS {' '.join(cloud._fields())}\n"
        f"SIZE {' '.join('4' * count)}\nTYPE {' '.join('F' * count)}\n"
        f"COUNT {' '.join('1' * count)}\nWIDTH {len(cloud.values)}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(cloud.values)}\nDATA binary\n"
    )
    _write(path, header, cloud.values.astype("<f4"))
    return {"type": "float32"}


def _write(path: Path, header: str, values: NDArray[np.floating]) -> None:
    with atomic_file(path) as file:
        file.write(header.encode("ascii"))
        file.write(values.tobytes())


def read_npz(path: Path) -> CloudTable:
    """Read a cloud of a run or a data set; errors of many types if the file is none."""
    arrays = read_arrays(path)
    points = np.asarray(arrays["points"], dtype=np.float64)
    rows = points.shape[:1]
    # Columns beside the coordinates, if there are any, and if they are as long.
    known = [name for name in _EXTRA_UNITS if name in arrays and arrays[name].shape == rows]
    axes = tuple(map(str, arrays["axes"])) if "axes" in arrays else RDT_AXES
    units = tuple(map(str, arrays["units"])) if "units" in arrays else RDT_UNITS
    columns = [np.asarray(arrays[name], dtype=np.float64) for name in known]
    if points.ndim != 2 or points.shape[1] != 3 or len(axes) != 3 or len(units) != 3:
        raise ValueError(f"points have shape {points.shape}")
    # Names and units go into comments of other formats, so that they must be as short and plain as
    # those.
    words = [f"x = {axis} [{unit}]" for axis, unit in zip(axes, units, strict=True)]
    if not all(map(_MEANING.fullmatch, words)):
        raise ValueError("axes or units are no short words")
    extra_units = tuple(_EXTRA_UNITS[name] for name in known)
    return CloudTable((*axes, *known), (*units, *extra_units), np.column_stack([points, *columns]))


def read_ply(path: Path) -> CloudTable:
    """Read the vertices of a binary little-endian PLY; errors of many types if it is none."""
    text, body = _parted(path, b"end_header\n")
    lines = [line.split() for line in text.splitlines()]
    if lines[:2] != [["ply"], ["format", "binary_little_endian", "1.0"]]:
        raise ValueError("no header of a binary little-endian PLY")
    # The first element must be the vertices, because its rows come first.
    elements = [k for k, line in enumerate(lines) if line[:1] == ["element"]]
    if not elements or lines[elements[0]][1] != "vertex":
        raise ValueError("its first element is no vertex")
    own = lines[elements[0] + 1 : elements[1] if len(elements) > 1 else None]
    fields = [(line[2], _PLY_TYPES[line[1]]) for line in own if line[0] == "property"]
    return _table(text, fields, int(lines[elements[0]][2]), body)


def read_pcd(path: Path) -> CloudTable:
    """Read a binary PCD with one number per field; errors of many types if it is none."""
    text, body = _parted(path, b"DATA binary\n")
    lines = [line.split() for line in text.splitlines()]
    # The header is words and values, line by line.
    entries = {line[0]: line[1:] for line in lines if len(line) > 1 and line[0][0] != "#"}
    if any(count != "1" for count in entries.get("COUNT", [])):
        raise ValueError("no header of a binary PCD with one number a field")
    letters = {"F": "f", "I": "i", "U": "u"}
    kinds = zip(entries["TYPE"], entries["SIZE"], strict=True)
    types = [f"<{letters[letter]}{int(size)}" for letter, size in kinds]
    fields = list(zip(entries["FIELDS"], types, strict=True))
    return _table(text, fields, int(entries["POINTS"][0]), body)


def _parted(path: Path, end: bytes) -> tuple[str, bytes]:
    """Return the text of a header before its last line, and what follows it."""
    head, found, body = read_bytes(path, _MOST_BYTES).partition(end)
    if not found:
        raise ValueError(f"no header that ends with '{end.decode().strip()}'")
    return head[:_MOST_HEADER_BYTES].decode("ascii"), body


def _table(text: str, fields: list[tuple[str, str]], count: int, body: bytes) -> CloudTable:
    kind = np.dtype(fields)
    if count < 0 or len(body) < count * kind.itemsize:
        told = f"its header tells of {count} points of {kind.itemsize}"
        raise ValueError(f"{len(body)} bytes where {told}; it is cut off")
    rows = np.frombuffer(body, dtype=kind, count=count)
    # Coordinates first, and of each column what the comment of rtradar says that it means.
    order = ["x", "y", "z", *(name for name, _ in fields if name not in ("x", "y", "z"))]
    meant = {field: (name, unit) for field, name, unit in _MEANING.findall(text)}
    names, units = zip(*(meant.get(field, (field, "")) for field in order), strict=True)
    with np.errstate(invalid="ignore"):  # signalling NaNs become NaNs, which `checked` reports
        values = np.column_stack([rows[field].astype(np.float64) for field in order])
    return CloudTable(names, units, values)


def checked(cloud: CloudTable, path: Path) -> CloudTable:
    """Return a cloud; InputError if a value is not finite, but for a coordinate not measured."""
    places, rest = cloud.values[:, :3], cloud.values[:, 3:]
    own = measured_alone(places) if cloud.names[:3] == SPATIAL_AXES else np.isfinite(places).all()
    if not (own and np.isfinite(rest).all()):
        raise InputError(f"'{path}' holds NaN or infinity; every value of a cloud must be finite")
    return cloud
