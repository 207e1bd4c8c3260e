"""What rays can meet, and bounce off: a posed body or a mesh."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Surfaces(Protocol):
    """Surfaces go by their numbers, parts of a body or faces of a mesh; -1 is none.

    ``flat`` tells whether they are flat faces. Mitsuba, which works in float32, decides which of
    them a ray meets; where it meets it follows in float64 from the ray and that surface.
    """

    flat: bool

    def sees(self, origins: Array, targets: Array, own: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether no surface but ``own (ray,)`` is between origins and targets (ray, 3) on it."""
        ...

    def meets(
        self, points: Array, normals: Array, directions: Array, own: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Array]:
        """Surface (ray,) met first from points on surfaces ``own``, and how far it is [m].

        Rays leave on the side of the normals, along unit vectors ``directions (ray, 3)``. The
        distance is infinite where nothing is met.
        """
        ...

    def distance(self, surface: NDArray[np.int64], origins: Array, directions: Array) -> Array:
        """Distance to that surface along lines (..., 3), float64 [m]; NaN where they miss it."""
        ...

    def normal(self, surface: NDArray[np.int64], points: Array, directions: Array) -> Array:
        """Unit normals at points on surfaces, on the side that rays along them come from."""
        ...
