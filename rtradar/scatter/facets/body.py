"""The facets of a posed or moving body, and what antennas see of them past other parts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.scatter.facet_shadows import shade
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import sweep_nodes
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.common.poses import ChirpPoses
from rtradar.scatter.facets.radiation import (
    NEAR,
    Links,
    Seen,
    as_amplitude,
    body_facets,
    check_count,
    directions_apart,
    ellipsoid_facets,
    radiated,
    visible,
)
from rtradar.scatter.specular_points import solve_specular_points
from rtradar.trace.backend import Backend, select, use
from rtradar.trace.tracers import BodyTracer

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class FacetShadows:
    """The facets of posed ellipsoids, and the fractions of these that antennas see.

    ``counts (part,)``, or one for all, are the least numbers of facets of the ellipsoids,
    ``semi_axes (part, 3)`` [m].
    """

    def __init__(self, backend: Backend, semi_axes: Array, counts: Indices | int) -> None:
        self._tracer = BodyTracer(use(backend), semi_axes)
        self.facets = facets = ellipsoid_facets(semi_axes, counts)
        self._semi_axes = np.ascontiguousarray(semi_axes, dtype=np.float64)
        # The tracer takes places coordinate by coordinate.
        self._places = np.ascontiguousarray(facets.vertices.T)
        self._first = np.ascontiguousarray(facets.ends[:, 0])
        # Unsigned, because an index that may be negative keeps a loop from vector lanes.
        self._corners = np.ascontiguousarray(facets.faces.T, dtype=np.uint32)
        # A facet is lit while its middle faces away by less than its bend; its corners by no more
        # than thrice that.
        self._margin = 3 * float(facets.bend.max())

    def seen(
        self,
        centres: Array,
        frames: Array,
        antennas: Array,
        parts: Indices,
        apart: float = 0.0,
    ) -> Seen:
        """Return what antennas (antenna, 3) see of the facets of some parts (n,) past the others.

        ``centres (part, 3)`` and ``frames (part, 3, 3)`` are the pose of the whole body, world [m].
        Facets that face away from an antenna, by a cosine of more than ``apart``, are left out.
        """
        facets = self.facets
        first = np.cumsum([0, *np.diff(facets.ends[:, 1])[parts]])
        fraction = np.ones((len(antennas), first[-1]), dtype=np.float32)
        # A single part has nothing before it.
        if len(centres) == 1:
            return Seen(first[:-1], fraction)
        # Which part occludes which vertex, and from that how much of each facet is seen.
        hidden_by = self._tracer.occluders(
            centres, frames, antennas, parts, self._places, self._first, self._margin + apart
        )
        given = (
            hidden_by,
            np.ascontiguousarray(antennas),
            np.ascontiguousarray(parts),
            (np.ascontiguousarray(centres), np.ascontiguousarray(frames), self._semi_axes),
        )
        edge = np.empty((*fraction.shape, 3), dtype=np.float32)
        shade(*given, facets.vertices, self._corners, facets.ends, first, fraction, edge)
        return Seen(first[:-1], fraction, edge)


class FacetBody:
    """The facets of a moving body, which several models share.

    ``facets`` is the least number per part, None for `body_facets`; ``nodes`` the number of
    frequencies over the sweep, ``frequency (node,)`` [Hz]; ``variant`` the backend in use.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str,
        spreading: bool,
        facets: int | None,
        nodes: int,
    ) -> None:
        self._radar, self._body, self._spreading = radar, body, spreading
        counts: Indices | int
        if facets is None:
            wavenumber = 2 * np.pi * radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS
            counts = body_facets(body.semi_axes, wavenumber)
        else:
            check_count(facets)
            counts = facets
        self.frequency = sweep_nodes(radar, nodes)
        backend = select(variant)
        self.variant = backend.kind
        self._shadows = FacetShadows(backend, body.semi_axes, counts)

    def carriers(self, at: Geometry | ChirpPoses) -> tuple[Array, Array]:
        """Path [m] and strength of each part (chirp, rx, part) by its specular point.

        The strength is without polarisation: that of the part may vanish elsewhere.
        """
        length, strength, _ = solve_specular_points(at, spreading=self._spreading)
        return length, strength

    def seen(self, centres: Array, frames: Array, antennas: Array, parts: Indices) -> Seen:
        """Do as `FacetShadows.seen`, for antennas of which any may transmit and any receive."""
        # Where antennas are far apart, facets that face one of them away still radiate to it.
        ways = antennas[:, None] - centres[parts]
        apart = float(directions_apart(ways[:, None], ways[None]).max())
        return self._shadows.seen(
            centres, frames, antennas, parts, apart=apart if apart > NEAR else 0.0
        )

    def field(
        self,
        time: float,
        pose: Poses,
        antennas: Array,
        pairs: Indices,
        length: Array,
        parts: Indices,
        *,
        left: bool = False,
    ) -> NDArray[np.complex128]:
        """Amplitude (node, pair, n) of parts (n,) in one pose, for paths (pair, n) [m].

        ``pairs (pair, 2)`` are Tx and Rx among the ``antennas (antenna, 3)``, world [m]. With
        ``left`` it is what shadows leave of these amplitudes, 1 in full view.
        """
        find = visible if left else radiated
        seen = self.seen(pose.centres[0], pose.frames[0], antennas, parts)
        # The sum over the facets for all pairs, or what shadows leave of it.
        k = 2 * np.pi * self.frequency[None] / SPEED_OF_LIGHT_MPS
        sent = Polarization(self._radar.polarization, self._radar.at(time).axes)
        links = Links(antennas[None], pairs, length[None], k, sent, self._spreading, shadow=False)
        own = pose.centres[:, parts], pose.frames[:, parts]
        index = np.arange(len(antennas))[None]
        return as_amplitude(find(self._shadows.facets, parts, own, links, seen, index))[:, 0]
