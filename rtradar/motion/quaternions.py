"""Unit quaternions, scalar last."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


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
    return np.stack([a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx], axis=-1)


def sign_continuous(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Choose the sign of each quaternion (frame, ..., 4) so that it lies in the half-space of the frame before it."""
    if len(quaternions) < 2:
        return quaternions
    same_side = np.sum(quaternions[1:] * quaternions[:-1], axis=-1) >= 0
    if same_side.all():
        return quaternions  # not copied: a recording that was only moved shares its rotations with the one before
    signs = np.cumprod(np.where(same_side, 1.0, -1.0), axis=0)
    return np.concatenate([quaternions[:1], quaternions[1:] * signs[..., None]])
