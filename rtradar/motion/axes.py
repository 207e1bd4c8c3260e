"""From the y-up axes of motion files to world axes: world (x, y, z) = mocap (z, x, y)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

WORLD_FROM_MOCAP = (2, 0, 1)
"""Component of the mocap vector that becomes world x, y, z: an even permutation, hence a rotation."""


def to_world(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (..., 3) from mocap to world axes."""
    return np.ascontiguousarray(vectors[..., WORLD_FROM_MOCAP])


def quaternions_to_world(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations (..., 4) of mocap axes as rotations of world axes; only their axes of rotation are renamed."""
    return np.ascontiguousarray(quaternions[..., (*WORLD_FROM_MOCAP, 3)])
