"""Data of the 3D views of pages: a moving body and clouds, packed compactly."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body import Body
from rtradar.clouds.spatial import SpatialCloud
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.report.canvas import place_limits

MOST_POINTS = 20_000
"""Largest number of points of a cloud that a browser still rotates smoothly."""

_PARALLELS, _MERIDIANS = 9, 18
_MARGIN_M = 0.4


def drawn_sphere() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices (vertex, xyz) and faces (face, corner) of a unit sphere, to be looked at.

    It is finest at its poles. The one to compute with is `rtradar.body.unit_sphere`, which needs
    trimesh, a package that is slow to import and that a page needs for nothing else.
    """
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, _PARALLELS + 1),
        np.linspace(0, 2 * np.pi, _MERIDIANS, endpoint=False),
        indexing="ij",
    )
    places = np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)
    # Two triangles for each field of the grid, but one where a pole is a corner of both.
    at = np.arange(polar.size).reshape(polar.shape)
    east = np.roll(at, -1, axis=1)
    lower = np.stack([at[:-1], at[1:], east[1:]], axis=-1)[:-1]  # none at the south pole
    upper = np.stack([at[:-1], east[1:], east[:-1]], axis=-1)[1:]  # none at the north pole
    return np.stack(places, axis=-1).reshape(-1, 3), np.concatenate([lower, upper]).reshape(-1, 3)


def semi_axis_poses(body: Body, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return centre and semi-axes of each part at ``times`` [s], (time, part, 4, 3) [m]."""
    centres, frames, semi_axes = body.at(times)
    # Columns of a frame are directions: after the swap, row k is semi-axis k.
    axes = np.swapaxes(frames * semi_axes[:, None, :], 2, 3)
    return np.concatenate([centres[:, :, None, :], axes], axis=2)


def posed_figure(
    part_names: Sequence[str],
    times: NDArray[np.float64],
    poses: NDArray[np.floating],
    radar: Radar,
    *,
    alone: bool = False,
) -> dict[str, Any]:
    """Return what pages draw of a moving body before a radar, as plain values for JSON.

    ``poses`` is float32 (frame, part, 4, xyz): centre and the three semi-axes of each part in world
    coordinates [m]; ``times`` [s]; ``vertices`` and ``faces`` of the unit sphere; ``tx``, ``rx``
    [m] of every frame, or once of a radar at rest; ``ranges`` of the axes x, y, z [m], which hold
    the radar unless the body is to be seen ``alone``, and as large as it can.
    """
    centres, axes = poses[:, :, 0], poses[:, :, 1:]
    vertices, faces = drawn_sphere()
    # Half the extent of an ellipsoid along a world axis is the root of the sum of squares of its
    # semi-axes' components.
    extent = np.sqrt((axes**2).sum(axis=2))
    places = [(centres - extent).reshape(-1, 3), (centres + extent).reshape(-1, 3)]
    # A radar at rest is sent once.
    radars = [radar.at(time) for time in times.tolist()] if radar.is_moving else [radar]
    tx, rx = np.array([own.tx for own in radars]), np.array([own.rx for own in radars])
    antennas = np.concatenate([tx, rx], axis=1).reshape(-1, 3)
    return {
        "parts": list(part_names),
        "times": np.round(times, 4).tolist(),
        "poses": packed(poses),
        "vertices": packed(vertices),
        "faces": faces.ravel().tolist(),
        "tx": np.round(tx, 4).tolist(),
        "rx": np.round(rx, 4).tolist(),
        "ranges": _ranges(np.concatenate(places), antennas[:0] if alone else antennas),
        "window_s": radar.frame_duration_s,
    }


def rdt_data(points: ArrayLike) -> dict[str, Any]:
    """Return the range-Doppler-time cloud, thinned evenly to `MOST_POINTS`, for JSON.

    The values are ``count``, ``shown``, and ``points`` as float32 (point, 3). InputError if the
    shape is wrong or a value is not finite.
    """
    places = np.asarray(points, dtype=np.float64)
    if places.ndim != 2 or places.shape[1] != 3:
        raise InputError(
            f"report: rdt_points has shape {places.shape}; "
            "it must be (point, 3): time, range, velocity"
        )
    if not np.isfinite(places).all():
        raise InputError("report: rdt_points holds NaN or infinity; every value must be finite")
    return _thinned(points=places)


def spatial_data(cloud: SpatialCloud, radar: Radar) -> dict[str, Any]:
    """Return the strongest points of the spatial cloud, thinned evenly to `MOST_POINTS`, for JSON.

    The values are ``count``, ``shown``, ``measured`` of x, y and z, and as float32 ``points``
    (point, 3), ``velocity`` and ``time`` (point,), perhaps ``source``; ``radar_m``, and the
    ``ranges`` of the axes that show it and all points but outliers, as the pictures do [m].
    """
    cloud = cloud.strongest()
    measured, place = cloud.measured.tolist(), radar.position_m
    ranges = [
        place_limits(cloud.points[:, axis], place[axis]) if measured[axis] else None
        for axis in range(3)
    ]
    found = _thinned(points=cloud.points, velocity=cloud.velocity, time=cloud.time)
    if cloud.source is not None:
        found["source"] = cloud.source[:: _every(len(cloud.points))].tolist()
    return {"measured": measured, "radar_m": list(place), "ranges": ranges} | found


def _every(count: int) -> int:
    return max(1, math.ceil(count / MOST_POINTS))


def _thinned(points: NDArray[np.float64], **values: NDArray[np.float64]) -> dict[str, Any]:
    every = _every(len(points))
    arrays = {"points": points, **values}
    found = {name: packed(array[::every]) for name, array in arrays.items()}
    return {"count": len(points), "shown": len(points[::every]), **found}


def packed(array: NDArray[np.floating] | NDArray[np.integer]) -> str:
    """Base64 of little-endian float32, or int32 of whole numbers, last axis fastest."""
    kind = "<f4" if array.dtype.kind == "f" else "<i4"
    return base64.b64encode(np.ascontiguousarray(array, dtype=kind).tobytes()).decode()


def _ranges(body: NDArray[np.floating], antennas: NDArray[np.float64]) -> list[list[float]]:
    """Box about all poses, the radar and the floor, in half metres."""
    places = np.concatenate([body, antennas])
    least, most = places.min(axis=0), places.max(axis=0)
    least[:2] -= _MARGIN_M
    most[:2] += _MARGIN_M
    # The floor is z = 0: a heel a little below it needs no more room.
    least[2] = 0.0 if least[2] > -0.1 else least[2]
    box = np.stack([np.floor(2 * least) / 2, np.ceil(2 * most) / 2], axis=1)
    return [[float(a), float(b)] for a, b in box]
