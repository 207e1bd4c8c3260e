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
from rtradar.trace.clearance import beside_ball, into_ball
from rtradar.trace.facet_visibility import FacetTracer


@taken_in()
def _shares(hider, antenna, part, centres, frames, semi_axes, vertices, faces, around, poses, clear, of, out):  # type: ignore[no-untyped-def]
    """Shares of the facets of one part for one antenna; whether any of it is hidden."""
    hidden = False
    for vertex in range(len(hider)):
        if hider[vertex] < 0:
            continue
        if not hidden:
            for f in range(len(out)):
                out[f] = 1.0
            for i in range(len(of)):
                of[i] = -1
            for other in range(len(poses)):
                poses[other, 3, 0] = math.nan  # not known yet
            hidden = True
        for column in range(around.shape[1]):
            f = around[vertex, column]
            if f < 0:
                break
            c0, c1, c2 = faces[f, 0], faces[f, 1], faces[f, 2]
            h0, h1, h2 = hider[c0], hider[c1], hider[c2]
            # Once a facet: from the first of its corners that is hidden.
            if vertex != (c0 if h0 >= 0 else c1 if h1 >= 0 else c2):
                continue
            if h0 >= 0 and h1 >= 0 and h2 >= 0:
                out[f] = 0.0
                continue
            v0, v1, v2 = math.inf, math.inf, math.inf
            for n in range(3):
                other = h0 if n == 0 else h1 if n == 1 else h2
                if other < 0 or (n > 0 and other == h0) or (n > 1 and other == h1):
                    continue
                if math.isnan(poses[other, 3, 0]):
                    own = poses[other]
                    into_ball(part, other, antenna, centres, frames, semi_axes, own[:3], own[3], own[4])
                # Facets that meet at a vertex ask for the same way one after the other.
                for k in range(3):
                    corner = c0 if k == 0 else c1 if k == 1 else c2
                    if of[corner] != other:
                        x, y, z = vertices[corner, 0], vertices[corner, 1], vertices[corner, 2]
                        start_square, along, span = 0.0, 0.0, 0.0
                        for i in range(3):
                            start = poses[other, 4, i]
                            way = poses[other, i, 0] * x + poses[other, i, 1] * y + poses[other, i, 2] * z
                            way += poses[other, 3, i] - start
                            start_square += start * start
                            along += start * way
                            span += way * way
                        clear[corner], of[corner] = beside_ball(start_square, along, span), other
                v0, v1, v2 = min(v0, clear[c0]), min(v1, clear[c1]), min(v2, clear[c2])
            out[f] = positive_share(v0, v1, v2)
    return hidden


@compiled()
def _all_shares(hidden_by, antennas, parts, centres, frames, semi_axes, vertices, faces, around, row, out):  # type: ignore[no-untyped-def]
    """Fill the rows from the second on; the first is that of parts in full view. How many are filled."""
    out[0] = 1.0
    count = 1
    # Of every part that may hide another: from that one's axes to those in which it is the unit ball, and the antenna in these.
    poses = np.empty((len(centres), 5, 3))
    # What is known of the way to each vertex, and of which part.
    clear, of = np.empty(vertices.shape[1]), np.empty(vertices.shape[1], dtype=np.int64)
    for a in range(len(antennas)):
        for n in range(len(parts)):
            part, hider, own = parts[n], hidden_by[a, n], vertices[parts[n]]
            row[a, n] = 0
            if _shares(hider, antennas[a], part, centres, frames, semi_axes, own, faces, around, poses, clear, of, out[count]):
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
        # Coordinate by coordinate, as the tracer takes them.
        self._places = np.ascontiguousarray(np.swapaxes(facets.vertices, 1, 2))
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
        hidden_by = self._tracer.occluders(centres, frames, antennas, parts, self._places, self._margin)
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
