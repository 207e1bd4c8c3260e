"""Unit quaternions, scalar last, and the change from mocap axes to world axes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rtradar.system.row_files import file_backed, in_blocks

Array = NDArray[np.float64]

WORLD_FROM_MOCAP = (2, 0, 1)
"""Component of a y-up mocap vector that becomes world x, y, z: world (x, y, z) = mocap (z, x, y).

It is an even permutation, hence a rotation."""


def to_world(vectors: Array) -> Array:
    """Convert vectors (..., 3) from mocap to world axes."""
    return np.ascontiguousarray(vectors[..., WORLD_FROM_MOCAP])


def quaternions_to_world(quaternions: Array) -> Array:
    """Convert rotations (..., 4) from mocap to world axes; only their vector parts are permuted."""
    return np.ascontiguousarray(quaternions[..., (*WORLD_FROM_MOCAP, 3)])


def quaternion_rotate(quaternions: Array, vectors: Array) -> Array:
    """Rotate vectors (..., 3) by unit quaternions (..., 4); leading axes broadcast."""
    x, y, z, w = (quaternions[..., k] for k in range(4))
    a, b, c = (vectors[..., k] for k in range(3))
    # Rodrigues' form v + w t + u x t with t = 2 u x v, several times faster than numpy.cross or
    # scipy's Rotation on short last axes.
    tx, ty, tz = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return np.stack(
        [a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx],
        axis=-1,
    )


def quaternion_multiply(left: Array, right: Array) -> Array:
    """Multiply quaternions (..., 4): the rotation by ``right``, followed by that by ``left``."""
    x, y, z, w = (left[..., k] for k in range(4))
    a, b, c, d = (right[..., k] for k in range(4))
    return np.stack(
        [
            w * a + d * x + (y * c - z * b),
            w * b + d * y + (z * a - x * c),
            w * c + d * z + (x * b - y * a),
            w * d - (x * a + y * b + z * c),
        ],
        axis=-1,
    )


def smallest_rotation(before: Array, after: Array) -> Array:
    """Quaternions (..., 4) of the smallest rotations that take unit vectors (..., 3) to others.

    Between opposite vectors half a turn about any line across them will do.
    """
    cosine = np.sum(before * after, axis=-1, keepdims=True)
    # With (sin a n, 1 + cos a), twice cos(a/2) times (sin(a/2) n, cos(a/2)): half the angle without
    # trigonometric functions.
    rotation = np.concatenate([np.cross(before, after), 1 + cosine], axis=-1)
    norms = np.linalg.norm(rotation, axis=-1, keepdims=True)
    across = np.cross(before, np.eye(3)[np.argmin(np.abs(before), axis=-1)])
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    half = np.concatenate([across, np.zeros((*across.shape[:-1], 1))], axis=-1)
    return np.where(norms > 1e-6, rotation / np.maximum(norms, 1e-6), half)


def sign_continuous(quaternions: Array) -> Array:
    """Choose the signs of quaternions (frame, ..., 4) so that each is nearest to the one before."""
    if all(same_side.all() for _, same_side in _sides(quaternions)):
        return quaternions  # without a copy, which a recording that was only moved need not have
    return file_backed(_with_signs(quaternions))


def _with_signs(quaternions: Array) -> Iterator[Array]:
    sign = np.ones(quaternions.shape[1:-1])
    for frames, same_side in _sides(quaternions):
        # Each change of side turns the sign of all frames after it.
        signs = sign * np.cumprod(np.where(same_side, 1.0, -1.0), axis=0)
        sign = signs[-1]
        yield frames * signs[..., None]


def _sides(quaternions: Array) -> Iterator[tuple[Array, NDArray[np.bool_]]]:
    """Yield blocks of frames, and whether each is in the half-space of the frame before it."""
    before = quaternions[:1]
    for (frames,) in in_blocks(quaternions):
        with_before = np.concatenate([before, frames])
        yield frames, np.sum(with_before[1:] * with_before[:-1], axis=-1) >= 0
        before = with_before[-1:]
