"""Writers of point cloud files. A file is written beside its place and then renamed."""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.system.files import atomic_file

RDT_AXES = ("time", "range", "velocity")
"""Coordinate names of an RDT cloud."""

RDT_UNITS = ("s", "m", "m/s")
"""Units of `RDT_AXES`."""


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
    places = _checked(points)
    with atomic_file(path) as file:
        np.savez_compressed(file, points=places, axes=np.array(RDT_AXES), units=np.array(RDT_UNITS))


def save_ply(path: str | os.PathLike[str], points: ArrayLike) -> None:
    """Write an RDT cloud as a binary little-endian PLY file with coordinates of type double.

    A comment line of the header states what x, y and z are.

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
    places = _checked(points)
    meaning = ", ".join(
        f"{letter} = {axis} [{unit}]"
        for letter, axis, unit in zip("xyz", RDT_AXES, RDT_UNITS, strict=True)
    )
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment rtradar: {meaning}\n"
        f"element vertex {len(places)}\n"
        "property double x\nproperty double y\nproperty double z\nend_header\n"
    )
    with atomic_file(path) as file:
        file.write(header.encode("ascii"))
        file.write(places.astype("<f8").tobytes())


def _checked(points: ArrayLike) -> NDArray[np.float64]:
    places = np.asarray(points, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 3:
        raise InputError(f"cloud: points have shape {places.shape}; they must be (n, 3)")
    if not np.isfinite(places).all():
        raise InputError("cloud: points hold NaN or infinity; every coordinate must be finite")
    return places
