"""How much of each facet an antenna sees past the other parts: traced at the vertices, the edge exact between them.

Mitsuba says which part hides which vertex. Where it hides some vertices of a facet and not others, the edge of the shadow
runs through that facet, and the share that it leaves is taken from how far the rays to its vertices pass outside the
hiding ellipsoids, in float64, as linear over the facet. So a shadow moves over the body without jumps.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rtradar.scatter.facets import Facets
from rtradar.scatter.triangle_share import positive_share
from rtradar.trace.clearance import clearance
from rtradar.trace.facet_visibility import FacetTracer


@njit(cache=True, error_model="numpy")
def _shares(hidden_by, antennas, parts, centres, frames, semi_axes, vertices, faces, out):  # type: ignore[no-untyped-def]
    for task in range(len(antennas) * len(parts)):
        a, n = task // len(parts), task % len(parts)
        part = parts[n]
        corner, value = np.empty(3), np.empty(3)
        for f in range(faces.shape[0]):
            first, second, third = hidden_by[a, n, faces[f, 0]], hidden_by[a, n, faces[f, 1]], hidden_by[a, n, faces[f, 2]]
            seen = (first < 0) + (second < 0) + (third < 0)
            if seen == 3 or seen == 0:
                out[a, n, f] = seen / 3
                continue
            for k in range(3):
                for i in range(3):
                    corner[i] = centres[part, i]
                    for j in range(3):
                        corner[i] += frames[part, i, j] * vertices[part, faces[f, k], j]
                value[k] = math.inf
                for hider in (first, second, third):
                    if hider >= 0:
                        outside = clearance(antennas[a], corner, centres[hider], frames[hider], semi_axes[hider])
                        value[k] = min(value[k], outside)
            out[a, n, f] = positive_share(value[0], value[1], value[2])


class FacetShadows:
    """Shares of the facets of a posed body that antennas see.

    Parameters
    ----------
    tracer : FacetTracer
        Of the same body.
    facets : Facets
        Of ellipsoids with these semi-axes.
    semi_axes : (part, 3) float64
        [m].
    """

    def __init__(self, tracer: FacetTracer, facets: Facets, semi_axes: NDArray[np.float64]) -> None:
        self._tracer, self._facets, self._semi_axes = tracer, facets, np.ascontiguousarray(semi_axes, dtype=np.float64)
        # A facet is lit while its middle faces away by less than its bend; its corners by no more than thrice that.
        self._margin = 3 * float(facets.bend.max())

    def shares(
        self,
        centres: NDArray[np.float64],
        frames: NDArray[np.float64],
        antennas: NDArray[np.float64],
        parts: NDArray[np.int64],
    ) -> NDArray[np.float32]:
        """Share of each facet that no other part hides, (antenna, n, facet) float32.

        Parameters
        ----------
        centres, frames : (part, 3), (part, 3, 3) float64
            Pose of the whole body, world [m].
        antennas : (antenna, 3) float64
            World [m].
        parts : (n,) int64
            Whose facets.
        """
        out = np.ones((len(antennas), len(parts), len(self._facets.faces)), dtype=np.float32)
        if len(centres) == 1:
            return out
        self._tracer.pose(centres, frames)
        hidden_by = self._tracer.occluders(antennas, parts, self._facets.vertices, self._margin)
        _shares(
            hidden_by,
            np.ascontiguousarray(antennas),
            np.ascontiguousarray(parts),
            np.ascontiguousarray(centres),
            np.ascontiguousarray(frames),
            self._semi_axes,
            self._facets.vertices,
            self._facets.faces,
            out,
        )
        return out
