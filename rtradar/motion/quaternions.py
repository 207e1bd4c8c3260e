"""Unit quaternions, scalar last."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rtradar.system.row_files import file_backed, in_blocks


def rotate(quaternions: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotate vectors by unit quaternions; leading axes broadcast.

    Parameters
    ----------
    quaternions : (..., 4) float64
        Scalar last: x, y, z, w.
    vectors : (..., 3) float64

    Returns
    -------
    (..., 3) float64
    """
    x, y, z, w = (quaternions[..., k] for k in range(4))
    a, b, c = (vectors[..., k] for k in range(3))
    # Rodrigues' form v + w t + u x t with t = 2 u x v; numpy.cross is several times slower on short last axes.
    tx, ty, tz = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return np.stack(
        [a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx],
        axis=-1,
    )


def sign_continuous(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Choose the sign of each quaternion (frame, ..., 4) so that it lies in the half-space of the frame before it."""
    if all(same_side.all() for _, same_side in _sides(quaternions)):
        return quaternions  # not copied: a recording that was only moved shares its rotations with the one before
    return file_backed(_turned_over(quaternions))


def _turned_over(quaternions: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    sign = np.ones(quaternions.shape[1:-1])
    for frames, same_side in _sides(quaternions):
        signs = sign * np.cumprod(np.where(same_side, 1.0, -1.0), axis=0)
        sign = signs[-1]
        yield frames * signs[..., None]


def _sides(
    quaternions: NDArray[np.float64],
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.bool_]]]:
    """Some frames at a time, and whether each is in the half-space of the frame before it; the first frame is in its own."""
    before = quaternions[:1]
    for (frames,) in in_blocks(quaternions):
        with_before = np.concatenate([before, frames])
        yield frames, np.sum(with_before[1:] * with_before[:-1], axis=-1) >= 0
        before = with_before[-1:]
