"""The unit sphere in a Mitsuba scene: Mitsuba decides which rays meet it.

Every ellipsoid is this sphere in axes of its own, so there is nothing to pose. Its answers for rays
that start two radii away are held against float64 in `validation/other_methods/occlusion.py`.
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.trace.rays import rays_of

_LEAST_RAYS = 4096
"""Traced at once, with idle ones among them: what Dr.Jit keeps for itself would else grow with the most that ever came."""


_ONE_AT_A_TIME = threading.Lock()


class UnitSphere:
    """The unit sphere in a Mitsuba scene of its own.

    Parameters
    ----------
    mi : module
        Mitsuba with its variant set.
    """

    def __init__(self, mi: Any) -> None:
        self._mi = mi
        self._scene = mi.load_dict({"type": "scene", "unit_sphere": {"type": "sphere"}})

    def meets(self, rays: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Which rays (7, ray) meet it: start and direction in its axes, and how far they go."""
        mi = self._mi
        if rays.shape[1] == 0:  # Dr.Jit takes the process down over arrays without entries
            return np.zeros(0, dtype=np.bool_)
        if mi.variant().startswith("scalar"):
            found = []
            for x, y, z, *way, reach in rays.T.tolist():
                ray = mi.Ray3f(mi.Point3f(x, y, z), mi.Vector3f(*way))
                ray.maxt = reach
                found.append(bool(self._scene.ray_test(ray)))
            return np.array(found)
        count = rays.shape[1]
        padded = np.zeros((7, max(count, _LEAST_RAYS)), dtype=np.float32)
        padded[:, :count] = rays
        padded[3, count:] = 1  # from the middle, no way at all
        with _ONE_AT_A_TIME:
            ray = rays_of(mi, padded[:3].T, padded[3:6].T, padded[6])
            return np.asarray(self._scene.ray_test(ray, coherent=True).numpy())[:count]
