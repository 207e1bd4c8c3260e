"""One pose of a body: ellipsoids somewhere in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError

_SAME = 1e-4
"""Distance of two parts, relative to the least semi-axis, at which rays find the same surface."""


@dataclass(frozen=True)
class Ellipsoids:
    """One pose of ellipsoids.

    Parameters
    ----------
    centres : (part, 3) float64
        Centres, world [m].
    frames : (part, 3, 3) float64
        Proper rotations: world = centre + frame @ local, so the COLUMNS are the directions of the
        semi-axes.
    semi_axes : (part, 3) float64
        Lengths a, b, c of the semi-axes [m].

    Raises
    ------
    InputError
        Where shapes do not fit, a value is not finite, a semi-axis is not positive, or a frame is
        no rotation.
    """

    centres: NDArray[np.float64]
    frames: NDArray[np.float64]
    semi_axes: NDArray[np.float64]

    def __init__(self, centres: ArrayLike, frames: ArrayLike, semi_axes: ArrayLike) -> None:
        centre_array, frame_array, axis_array = (
            np.asarray(value, dtype=np.float64) for value in (centres, frames, semi_axes)
        )
        parts = centre_array.shape[:1]
        for name, array, shape in (
            ("centres", centre_array, (*parts, 3)),
            ("frames", frame_array, (*parts, 3, 3)),
            ("semi_axes", axis_array, (*parts, 3)),
        ):
            if array.shape != shape or not parts or parts[0] == 0:
                raise InputError(
                    f"Ellipsoids.{name} has shape {array.shape}; it must be "
                    f"{('part', *shape[1:])}, alike and at least 1 in part"
                )
            if not np.isfinite(array).all():
                raise InputError(
                    f"Ellipsoids.{name} holds NaN or infinity; every value must be finite"
                )
            object.__setattr__(self, name, array)
        if not (axis_array > 0).all():
            raise InputError(
                f"Ellipsoids.semi_axes: the least is {axis_array.min()} m; every semi-axis must be "
                "positive"
            )
        error = np.abs(np.swapaxes(frame_array, 1, 2) @ frame_array - np.eye(3)).max(initial=0.0)
        if error > 1e-6 or (np.linalg.det(frame_array) < 0).any():
            raise InputError(
                "Ellipsoids.frames: not proper rotations; columns must be orthonormal and "
                "right-handed"
            )

    def without_repeats(self) -> Ellipsoids:
        """Leave out each part that coincides with one before it.

        Two of those are one body: whichever of them rays meet first is an accident of rounding.

        Returns
        -------
        Ellipsoids
        """
        # x.S^-1 x = 1 on the surface about the centre: frames that differ in signs or order of axes
        # make the same S.
        stretch = self.frames * self.semi_axes[:, None]
        shape = stretch @ np.swapaxes(stretch, 1, 2)
        kept: list[int] = []
        for part, (centre, own, least) in enumerate(
            zip(self.centres, shape, self.semi_axes.min(axis=1), strict=True)
        ):
            away = np.linalg.norm(self.centres[kept] - centre, axis=-1)
            # S differs by 2 a da where a semi-axis a differs by da.
            differs = np.abs(shape[kept] - own).max(axis=(1, 2), initial=0.0)
            if not ((away <= _SAME * least) & (differs <= 2 * _SAME * least**2)).any():
                kept.append(part)
        return (
            self
            if len(kept) == len(self.centres)
            else Ellipsoids(self.centres[kept], self.frames[kept], self.semi_axes[kept])
        )
