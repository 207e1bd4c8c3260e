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

from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.triangle_fraction import positive_share
from rtradar.scatter.facets.surfaces import Facets
from rtradar.trace.clearance import beside_ball, into_ball
from rtradar.trace.facet_visibility import FacetTracer


@inlined()
def _shares(
    occluder,
    antenna,
    part,
    centres,
    frames,
    semi_axes,
    vertices,
    corners,
    poses,
    clear,
    of,
    hidden,
    counts,
    out,
):
    """Shares of the facets of one part for one antenna; whether any of it is hidden.

    ``clear`` and ``of`` (vertex,) are room for what is known of the way to a vertex, and of which occluder; ``hidden
    (vertex,)`` and ``counts (facet,)``, for which vertices are hidden, and how many of a facet's.
    """
    any_hidden = 0
    for vertex in range(len(occluder)):
        hidden[vertex] = occluder[vertex] >= 0
        any_hidden |= hidden[vertex]
    if not any_hidden:
        return False
    for vertex in range(len(of)):
        of[vertex] = -1
    for other in range(len(poses)):
        poses[other, 3, 0] = math.nan  # not known yet
    first, second, third = corners[0], corners[1], corners[2]
    for f in range(len(first)):
        counts[f] = hidden[first[f]] + hidden[second[f]] + hidden[third[f]]
    for f in range(len(first)):
        out[f] = 1.0 if counts[f] == 0 else 0.0
    for f in range(len(first)):
        if counts[f] == 1 or counts[f] == 2:
            c0, c1, c2 = first[f], second[f], third[f]
            h0, h1, h2 = occluder[c0], occluder[c1], occluder[c2]
            v0, v1, v2 = math.inf, math.inf, math.inf
            for n in range(3):
                other = h0 if n == 0 else h1 if n == 1 else h2
                if other < 0 or (n > 0 and other == h0) or (n > 1 and other == h1):
                    continue
                if math.isnan(poses[other, 3, 0]):
                    own = poses[other]
                    into_ball(
                        part, other, antenna, centres, frames, semi_axes, own[:3], own[3], own[4]
                    )
                # Facets that meet at a vertex ask for the same way one after the other.
                for k in range(3):
                    corner = c0 if k == 0 else c1 if k == 1 else c2
                    if of[corner] != other:
                        x, y, z = vertices[corner, 0], vertices[corner, 1], vertices[corner, 2]
                        start_square, along, span = 0.0, 0.0, 0.0
                        for i in range(3):
                            start = poses[other, 4, i]
                            way = (
                                poses[other, i, 0] * x
                                + poses[other, i, 1] * y
                                + poses[other, i, 2] * z
                            )
                            way += poses[other, 3, i] - start
                            start_square += start * start
                            along += start * way
                            span += way * way
                        clear[corner], of[corner] = beside_ball(start_square, along, span), other
                v0, v1, v2 = min(v0, clear[c0]), min(v1, clear[c1]), min(v2, clear[c2])
            out[f] = positive_share(v0, v1, v2)
    return True


@compiled()
def _all_shares(
    hidden_by, antennas, parts, centres, frames, semi_axes, vertices, corners, row, out
):
    """Fill the rows from the second on; the first is that of parts in full view. How many are filled."""
    out[0] = 1.0
    count = 1
    # Of every part that may hide another: from that one's axes to those in which it is the unit ball, and the antenna in these.
    poses = np.empty((len(centres), 5, 3))
    clear, of = np.empty(vertices.shape[1]), np.empty(vertices.shape[1], dtype=np.int64)
    hidden, counts = (
        np.empty(vertices.shape[1], dtype=np.int32),
        np.empty(corners.shape[1], dtype=np.int32),
    )
    for a in range(len(antennas)):
        for n in range(len(parts)):
            part, occluder, own = parts[n], hidden_by[a, n], vertices[parts[n]]
            row[a, n] = 0
            given = (
                antennas[a],
                part,
                centres,
                frames,
                semi_axes,
                own,
                corners,
                poses,
                clear,
                of,
                hidden,
                counts,
            )
            if _shares(occluder, *given, out[count]):
                row[a, n] = count
                count += 1
    return count


class Shares(NamedTuple):
    """What antennas see of parts: ``share (row, facet)`` float32, and ``row (antenna, n)``, which of them is whose."""

    share: NDArray[np.float32]
    row: NDArray[np.int64]


class FacetShadows:
    """Shares of the facets of a posed body that antennas see.

    Parameters
    ----------
    tracer : FacetTracer
        Tracer of the same body.
    facets : Facets
        Facets of ellipsoids with these semi-axes.
    semi_axes : (part, 3) float64
        [m].
    """

    def __init__(self, tracer: FacetTracer, facets: Facets, semi_axes: NDArray[np.float64]) -> None:
        self._tracer, self._facets, self._semi_axes = (
            tracer,
            facets,
            np.ascontiguousarray(semi_axes, dtype=np.float64),
        )
        # Coordinate by coordinate, as the tracer takes them.
        self._places = np.ascontiguousarray(np.swapaxes(facets.vertices, 1, 2))
        # Without a sign: what may be counted from an array's end keeps a loop from vector lanes.
        self._corners = np.ascontiguousarray(facets.faces.T, dtype=np.uint32)
        # A facet is lit while its middle faces away by less than its bend; its corners by no more than thrice that.
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
        hidden_by = self._tracer.occluders(
            centres, frames, antennas, parts, self._places, self._margin
        )
        share = np.empty((1 + row.size, len(self._facets.faces)), dtype=np.float32)
        count = _all_shares(
            hidden_by,
            np.ascontiguousarray(antennas),
            np.ascontiguousarray(parts),
            np.ascontiguousarray(centres),
            np.ascontiguousarray(frames),
            self._semi_axes,
            self._facets.vertices,
            self._corners,
            row,
            share,
        )
        return Shares(share[:count], row)
