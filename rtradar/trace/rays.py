"""Rays for the variants of Mitsuba that trace many at once, so that one compiled kernel serves any number of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_LANES = 16
"""Of float32 in the widest vectors."""


def rays_of(mi: Any, starts: ArrayLike, ways: ArrayLike, reach: ArrayLike | None = None) -> Any:
    """Rays from starts along directions.

    Dr.Jit compiles anew for memory that does not begin where a vector may, and for rows cut from one array of another width:
    so each row is handed over by itself, from where a vector may begin.

    Parameters
    ----------
    mi : module
        Mitsuba with a variant that is not scalar.
    starts, ways : (ray, 3) float
        Where they begin, and unit vectors; at least one ray, as Dr.Jit takes the process down over arrays without entries.
    reach : (ray,) float, optional
        How far they go; as far as there is anything unless given.

    Returns
    -------
    mitsuba.Ray3f
    """
    rows = np.concatenate(
        [np.transpose(starts), np.transpose(ways)]
        + ([] if reach is None else [np.asarray(reach)[None]])
    )
    values = [mi.Float(row) for row in _aligned(rows)]
    ray = mi.Ray3f(mi.Point3f(*values[:3]), mi.Vector3f(*values[3:6]))
    if reach is not None:
        ray.maxt = values[6]
    return ray


def _aligned(rows: NDArray[Any]) -> NDArray[np.float32]:
    """The rows (row, column), each beginning at a multiple of `_LANES` numbers in memory."""
    count, columns = rows.shape
    width = -(-columns // _LANES) * _LANES
    memory = np.empty(count * width + _LANES, dtype=np.float32)
    first = -(memory.ctypes.data // memory.itemsize) % _LANES
    aligned = memory[first : first + count * width].reshape(count, width)[:, :columns]
    aligned[:] = rows
    return aligned
