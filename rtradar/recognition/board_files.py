"""Points that boards list, read from tables, from what ROS prints, and from TI's visualiser.

All give a table (point, 5): time [s], x ahead, y to the left, z up from the radar [m] and velocity
[m/s], positive receding.
"""

from __future__ import annotations

import csv
import itertools
import math
import re
import struct
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.recognition.points import Grid
from rtradar.system.checks import brief
from rtradar.system.files import read_arrays, read_bytes

Array = NDArray[np.float64]

COLUMNS = ("time_s", "x_m", "y_m", "z_m", "velocity_mps")
"""Columns of a table of points; others beside them are passed over."""

_MOST_BYTES = 1_000_000_000
_AHEAD = 0.99  # of the points, which lie before the radar


def read_points(path: Path, grid: Grid, ahead: str | None = None) -> tuple[Array, str]:
    """Read points that a board has listed.

    Parameters
    ----------
    path : path
        ``.csv`` or ``.npz`` with `COLUMNS`, ``.txt`` as ``rostopic echo`` prints the topic of
        ``ti_mmwave_rospkg``, or ``.dat`` as TI's visualiser records.
    grid : Grid
        Cells of the radar. Files of the visualiser count frames instead of telling their times, and
        those of older chips velocities in cells.

    ahead : {"x", "y"}, optional
        Axis of a table that points away from the radar, x as in ROS with y to the left, or y as TI
        has it with x to the right; by default that along which all points are positive.

    Returns
    -------
    table : (point, 5) float64
        Time [s], x ahead, y to the left, z up [m] and velocity [m/s].
    said : str
        How the axes of the file were understood.

    Raises
    ------
    InputError
        Where the file cannot be read, has no points, or does not tell which axis is ahead.
    """
    read = _READERS.get(path.suffix.lower())
    if read is None:
        raise InputError(f"'{path}': points are read from {', '.join(_READERS)}; give such a file")
    try:
        table, said = read(path, grid)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read ({error.strerror or error})") from None
    except (ValueError, KeyError, struct.error) as error:
        raise InputError(
            f"'{path}' holds no points of a board ({' '.join(str(error).split())}); needed are "
            f"columns {', '.join(COLUMNS)}"
        ) from None
    if not len(table):
        raise InputError(f"'{path}' has no points; give a recording that has some")
    table, said = (table, said) if said else _turned(path, table, ahead)
    away_m = np.linalg.norm(np.nan_to_num(table[:, 1:4]), axis=1)
    if (median_m := float(np.median(away_m))) > grid.max_range_m:
        raise InputError(
            f"'{path}': points lie {median_m:.3g} m away, beyond the {grid.max_range_m:.3g} m of "
            "the radar; give them in metres"
        )
    return table, said


def _turned(path: Path, table: Array, ahead: str | None) -> tuple[Array, str]:
    """Turn a table of which it is unknown whether x (as ROS has it) or y (as TI) is ahead."""
    positive = [float((table[:, column] > 0).mean()) >= _AHEAD for column in (1, 2)]
    if ahead == "x" or (ahead is None and positive == [True, False]):
        return table, "x is ahead and y to the left"
    if ahead == "y" or (ahead is None and positive == [False, True]):
        return _of_ti(table), "y is ahead and x to the right"
    both = "both x and y are" if all(positive) else "neither x nor y is"
    raise InputError(
        f"'{path}': {both} positive in {_AHEAD:.0%} of the points, so that it is unknown which is "
        "ahead of the radar; say it (--ahead x, as in ROS, or --ahead y, as TI has it)"
    )


def _of_ti(table: Array) -> Array:
    """Turn x to the right and y ahead, as TI has them, into x ahead and y to the left."""
    return np.column_stack([table[:, 0], table[:, 2], -table[:, 1], table[:, 3:]])


def _read_csv(path: Path, grid: Grid) -> tuple[Array, str]:
    rows = csv.reader(read_bytes(path, _MOST_BYTES).decode().splitlines())
    head = [name.strip().lower() for name in next(rows, [])]
    places = [_place(name, head) for name in COLUMNS]
    found = []
    for number, row in enumerate(rows, start=2):
        try:
            found.append([float(row[place]) for place in places])
        except (ValueError, IndexError):
            if row:
                raise ValueError(f"line {number} is {brief(','.join(row))}") from None
    return np.array(found, dtype=np.float64).reshape(-1, len(COLUMNS)), ""


def _place(name: str, names: list[str]) -> int:
    if name not in names:
        raise ValueError(f"column {name} is missing")
    return names.index(name)


def _read_npz(path: Path, grid: Grid) -> tuple[Array, str]:
    arrays = read_arrays(path, _MOST_BYTES)
    if missing := [name for name in COLUMNS if name not in arrays]:
        raise ValueError(f"array {missing[0]} is missing")
    columns = [np.asarray(arrays[name], dtype=np.float64) for name in COLUMNS]
    if len({column.shape for column in columns}) > 1 or columns[0].ndim != 1:
        raise ValueError(f"{', '.join(COLUMNS)} must have one axis and one length")
    return np.column_stack(columns), ""


# -- ROS -------------------------------------------------------------------------------------------


def _read_ros(path: Path, grid: Grid) -> tuple[Array, str]:
    text = read_bytes(path, _MOST_BYTES).decode()
    names = ("secs", "nsecs", "x", "y", "z", "velocity")
    number = r"([-+.\w]+)"
    columns = [re.findall(rf"^\s*{name}:\s*{number}", text, re.MULTILINE) for name in names]
    if len({len(column) for column in columns}) > 1:
        raise ValueError("not every message has secs, nsecs, x, y, z and velocity")
    secs, nsecs, *rest = (np.array(column, dtype=np.float64) for column in columns)
    return np.column_stack([secs + 1e-9 * nsecs, *rest]), "x is ahead and y to the left, as in ROS"


# -- TI's visualiser -------------------------------------------------------------------------------

_MAGIC = bytes((2, 1, 4, 3, 6, 5, 8, 7))
_HEADER = struct.Struct("<8s8I")
"""Magic word, version, length, platform, frame, cycles, points, pieces and subframe."""

_POINTS, _MOST_PIECES = 1, 64  # number of the piece that has them, and how many there may be


def _read_ti(path: Path, grid: Grid) -> tuple[Array, str]:
    data, found = read_bytes(path, _MOST_BYTES), list[tuple[int, Array]]()
    starts = [match.start() for match in re.finditer(re.escape(_MAGIC), data)]
    for start, end in itertools.pairwise([*starts, len(data)]):
        packet = data[start:end]
        with suppress(struct.error):  # of a packet that was cut off
            *_, frame, _, count, pieces, subframe = _HEADER.unpack_from(packet)
            # Headers of SDK 1 of the xWR14xx end before the subframe: a piece begins in its place.
            place = _HEADER.size - (4 if subframe == _POINTS else 0)
            for _ in range(min(pieces, _MOST_PIECES)):
                kind, size = struct.unpack_from("<2I", packet, place)
                body, place = packet[place + 8 : place + 8 + size], place + 8 + size
                if kind == _POINTS and len(body) == size:
                    found.append((frame, _points_of(body, count, grid)))
                    break
    if not found:
        raise ValueError("no frame with points was found")
    first = found[0][0]
    tables = [
        np.column_stack([np.full(len(points), (frame - first) * grid.frame_s), points])
        for frame, points in found
    ]
    return _of_ti(np.concatenate(tables)), "y is ahead and x to the right, as TI has it"


def _points_of(body: bytes, count: int, grid: Grid) -> Array:
    """Points (point, 4) of a piece: floats from SDK 3 on, before that cells and fixed point."""
    if len(body) == 16 * count:
        return np.frombuffer(body, "<f4").reshape(-1, 4).astype(np.float64)
    count, shift = struct.unpack_from("<2H", body)
    if len(body) < 4 + 12 * count or shift > 15:
        raise ValueError("a list of points is damaged")
    rows = np.frombuffer(body, "<i2", 6 * count, 4).reshape(-1, 6).astype(np.float64)
    return np.column_stack([rows[:, 3:] / 2**shift, rows[:, 1] * grid.velocity_bin_mps])


_READERS: Mapping[str, Callable[[Path, Grid], tuple[Array, Any]]] = {
    ".csv": _read_csv,
    ".npz": _read_npz,
    ".txt": _read_ros,
    ".dat": _read_ti,
}


def beside_cells(table: Array, grid: Grid) -> float:
    """Return the fraction of moving points whose velocity lies between the cells of a grid."""
    cells = table[:, 4] / grid.velocity_bin_mps
    moving = np.abs(cells) > 0.5
    off = np.abs(cells - np.rint(cells))[moving] > 0.2
    return float(off.mean()) if len(off) else math.nan
