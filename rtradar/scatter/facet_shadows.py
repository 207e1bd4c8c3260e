"""How much of each facet an antenna sees past the other parts: told at the vertices, the edge exact between them.

A `FacetTracer` says which part hides which vertex. Where it hides some vertices of a facet and not others, the edge of the shadow
runs through that facet, and the share that it leaves is taken from how far the rays to its vertices pass outside the
hiding ellipsoids, in float64, as linear over the facet. So a shadow moves over the body without jumps.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.compiled import compiled, taken_in
from rtradar.scatter.facets import Facets
from rtradar.scatter.triangle_share import positive_share
from rtradar.trace.clearance import clearance
from rtradar.trace.facet_visibility import FacetTracer


@taken_in()
def _shares(hider, antenna, part, centres, frames, semi_axes, vertices, faces, around, out):  # type: ignore[no-untyped-def]
    """Shares of the facets of one part for one antenna; whether any of it is hidden."""
    corner, value, hiders = np.empty(3), np.empty(3), np.empty(3, dtype=np.int64)
    hidden = False
    for vertex in range(len(hider)):
        if hider[vertex] < 0:
            continue
        if not hidden:
            out[:] = 1.0
            hidden = True
        for f in around[vertex]:
            if f < 0:
                break
            corners, first, count = faces[f], -1, 0
            for k in range(3):
                hiders[k] = hider[corners[k]]
                if hiders[k] >= 0:
                    first = corners[k] if count == 0 else first
                    count += 1
            # Once a facet: from the first of its corners that is hidden.
            if first != vertex:
                continue
            if count == 3:
                out[f] = 0.0
                continue
            for k in range(3):
                for i in range(3):
                    corner[i] = centres[part, i]
                    for j in range(3):
                        corner[i] += frames[part, i, j] * vertices[corners[k], j]
                value[k] = math.inf
                for other in hiders:
                    if other >= 0:
                        value[k] = min(value[k], clearance(antenna, corner, centres[other], frames[other], semi_axes[other]))
            out[f] = positive_share(value[0], value[1], value[2])
    return hidden


@compiled()
def _all_shares(hidden_by, antennas, parts, centres, frames, semi_axes, vertices, faces, around, row, out):  # type: ignore[no-untyped-def]
    """Fill the rows from the second on; the first is that of parts in full view. How many are filled."""
    out[0] = 1.0
    count = 1
    for a in range(len(antennas)):
        for n in range(len(parts)):
            part = parts[n]
            row[a, n] = 0
            if _shares(hidden_by[a, n], antennas[a], part, centres, frames, semi_axes, vertices[part], faces, around, out[count]):
                row[a, n] = count
                count += 1
    return count


def _facets_around(faces: NDArray[np.int32], n_vertices: int) -> NDArray[np.int32]:
    """Facets that meet at each vertex (vertex, most), filled up with -1."""
    corners = faces.ravel()
    order = np.argsort(corners, kind="stable")
    counts = np.bincount(corners, minlength=n_vertices)
    column = np.arange(len(corners)) - np.repeat(np.cumsum(counts) - counts, counts)
    around = np.full((n_vertices, int(counts.max())), -1, dtype=np.int32)
    around[corners[order], column] = order // 3
    return around


class Shares(NamedTuple):
    """What antennas see of parts: ``share (row, facet)`` float32, and ``row (antenna, n)``, which of them is whose."""

    share: NDArray[np.float32]
    row: NDArray[np.int64]


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
        self._around = _facets_around(facets.faces, facets.vertices.shape[1])
        self._margin = 3 * float(facets.bend.max())

    def shares(
        self,
        centres: NDArray[np.float64],
        frames: NDArray[np.float64],
        antennas: NDArray[np.float64],
        parts: NDArray[np.int64],
    ) -> Shares:
        """Share of each facet that no other part hides.

        Parameters
        ----------
        centres, frames : (part, 3), (part, 3, 3) float64
            Pose of the whole body, world [m].
        antennas : (antenna, 3) float64
            World [m].
        parts : (n,) int64
            Whose facets.
        """
        row = np.zeros((len(antennas), len(parts)), dtype=np.int64)
        if len(centres) == 1:
            return Shares(np.ones((1, len(self._facets.faces)), dtype=np.float32), row)
        hidden_by = self._tracer.occluders(centres, frames, antennas, parts, self._facets.vertices, self._margin)
        share = np.empty((1 + row.size, len(self._facets.faces)), dtype=np.float32)
        count = _all_shares(
            hidden_by,
            np.ascontiguousarray(antennas),
            np.ascontiguousarray(parts),
            np.ascontiguousarray(centres),
            np.ascontiguousarray(frames),
            self._semi_axes,
            self._facets.vertices,
            self._facets.faces,
            self._around,
            row,
            share,
        )
        return Shares(share[:count], row)
