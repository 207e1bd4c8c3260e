"""The facets of a posed or moving body, and what antennas see of them past other parts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.scatter.facet_shadows import shade
from rtradar.kernels.scatter.facets import Facets, Views, Waves
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayNodes, sweep_nodes
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.common.poses import ChirpPoses
from rtradar.scatter.facets.obliquity import NEAR, directions_apart, with_obliquity
from rtradar.scatter.facets.surfaces import (
    body_facets,
    ellipsoid_facets,
    facet_integral,
    subdivisions_for,
)
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer

Array = NDArray[np.float64]


class Seen(NamedTuple):
    """What antennas see: ``fraction (row, facet)``, and ``row (antenna, n)``, which is whose."""

    fraction: NDArray[np.float32]
    row: NDArray[np.int64]

    def of(self, chosen: NDArray[np.int64]) -> Seen:
        """What they see of some of the parts."""
        return self._replace(row=self.row[:, chosen])

    def unhidden(self) -> Seen:
        """The same antennas and parts without any shadow."""
        return Seen(np.ones_like(self.fraction[:1]), np.zeros_like(self.row))


_MOST_LEFT = 2.0
"""Most that a visible fraction may be: what the first Fresnel zone alone sends."""


def visible_fraction(
    shadowed: NDArray[np.complex128], free: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Sums over facets with shadows over those without: exactly 1 where they are the same.

    It is 0 where there is nothing, and no more than `_MOST_LEFT` where the whole sum nearly
    cancels, as past the end of optics.
    """
    some = free != 0
    fraction = np.where(some, shadowed / np.where(some, free, 1.0), 0.0)
    fraction /= np.maximum(np.abs(fraction) / _MOST_LEFT, 1.0)
    return np.where(some & (shadowed == free), 1.0, fraction)


class FacetShadows:
    """Fractions of the facets of a posed body that antennas see.

    The tracer is that of a body of ellipsoids with ``semi_axes (part, 3)`` [m], the facets theirs.
    """

    def __init__(self, tracer: BodyTracer, facets: Facets, semi_axes: Array) -> None:
        self._tracer, self._facets = tracer, facets
        self._semi_axes = np.ascontiguousarray(semi_axes, dtype=np.float64)
        # Coordinate by coordinate, as the tracer takes them.
        self._places = np.ascontiguousarray(np.swapaxes(facets.vertices, 1, 2))
        # Without a sign: what may be counted from an array's end keeps a loop from vector lanes.
        self._corners = np.ascontiguousarray(facets.faces.T, dtype=np.uint32)
        # A facet is lit while its middle faces away by less than its bend; its corners by no more
        # than thrice that.
        self._margin = 3 * float(facets.bend.max())

    def seen(
        self,
        centres: Array,
        frames: Array,
        antennas: Array,
        parts: NDArray[np.int64],
        apart: float = 0.0,
    ) -> Seen:
        """Fraction of each facet of some parts (n,) that antennas (antenna, 3) see past the others.

        ``centres (part, 3)`` and ``frames (part, 3, 3)`` are the pose of the whole body, world [m].
        Facets that face an antenna away, by a cosine of more than ``apart``, are not looked at.
        """
        facets, row = self._facets, np.zeros((len(antennas), len(parts)), dtype=np.int64)
        if len(centres) == 1:
            return Seen(np.ones((1, len(facets.faces)), dtype=np.float32), row)
        hidden_by = self._tracer.occluders(
            centres, frames, antennas, parts, self._places, self._margin + apart
        )
        fraction = np.empty((1 + row.size, len(facets.faces)), dtype=np.float32)
        given = (
            hidden_by,
            np.ascontiguousarray(antennas),
            np.ascontiguousarray(parts),
            (np.ascontiguousarray(centres), np.ascontiguousarray(frames), self._semi_axes),
        )
        count = shade(*given, facets.vertices, self._corners, row, fraction)
        return Seen(fraction[:count], row)


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
        count = body_facets(body.semi_axes, radar.centre_frequency_hz) if facets is None else facets
        self._facets = ellipsoid_facets(body.semi_axes, subdivisions_for(count))
        self.frequency = sweep_nodes(radar, nodes)
        backend = select(variant)
        self.variant = backend.kind
        tracer = BodyTracer(use(backend), body.semi_axes)
        self._shadows = FacetShadows(tracer, self._facets, body.semi_axes)

    def carriers(self, at: Geometry | ChirpPoses) -> tuple[Array, Array]:
        """Path [m] and strength of each part (chirp, rx, part) by its specular point.

        The strength is without polarisation: that of the part may vanish elsewhere.
        """
        length, strength, _ = solve_specular_points(at, spreading=self._spreading)
        return length, strength

    def seen(
        self, centres: Array, frames: Array, antennas: Array, parts: NDArray[np.int64]
    ) -> Seen:
        """See `FacetShadows.seen`, for antennas of which any may light and any receive."""
        ways = antennas[:, None] - centres[parts]
        apart = float(directions_apart(ways[:, None], ways[None]).max())
        return self._shadows.seen(
            centres, frames, antennas, parts, apart=apart if apart > NEAR else 0.0
        )

    def at_chirps(
        self, chirps: NDArray[np.int64], at: ChirpPoses, length: Array
    ) -> NDArray[np.complex128]:
        """Amplitude (node, chirp, rx, part) at every chirp, for paths (chirp, rx, part) [m].

        What is seen is asked in the middle of each TDM cycle.
        """
        radar, parts = self._radar, np.arange(length.shape[2])
        amplitude = np.empty((len(self.frequency), *length.shape), dtype=np.complex128)
        pairs = np.stack([np.zeros(radar.n_rx, dtype=np.int64), 1 + np.arange(radar.n_rx)], axis=1)
        cycles = chirps // radar.n_tx
        for cycle in np.unique(cycles):
            inside = np.flatnonzero(cycles == cycle)
            # Tx and Rx of these chirps, each once.
            rx_index = radar.rx_of_tx[at.tx_index[inside]] + radar.n_tx
            named = np.concatenate([at.tx_index[inside, None], rx_index], axis=1)
            views, index = np.unique(named, return_inverse=True)
            time = min(float(radar.cycle_times(cycle + 0.5)), self._body.duration_s)
            middle, there = self._body.at([time]), radar.at(time)
            antennas = np.concatenate([there.tx, there.rx])[views]
            amplitude[:, inside] = self.amplitude(
                (at.centres[inside], at.frames[inside]),
                np.concatenate([at.tx[inside, None], at.rx[inside]], axis=1),
                pairs,
                length[inside],
                self.seen(middle.centres[0], middle.frames[0], antennas, parts),
                index.reshape(named.shape),
                parts,
                at.axes[inside],
            )
        return amplitude

    def field(
        self, time: float, pose: Poses, nodes: ArrayNodes, length: Array, parts: NDArray[np.int64]
    ) -> NDArray[np.complex128]:
        """Amplitude (node, pair, n) of parts (n,) in one pose, for paths (pair, n) [m]."""
        antennas = nodes.antennas
        seen = self.seen(pose.centres[0], pose.frames[0], antennas, parts)
        index = np.arange(len(antennas))[None]
        places = (pose.centres, pose.frames), antennas[None], nodes.pairs
        axes = self._radar.at(time).axes
        return self.amplitude(*places, length[None], seen, index, parts, axes)[:, 0]

    def visible(
        self, time: float, pose: Poses, nodes: ArrayNodes, length: Array, parts: NDArray[np.int64]
    ) -> NDArray[np.complex128]:
        """What shadows leave (node, pair, n) of the amplitudes of parts (n,): 1 in full view.

        It is the sum over the facets with shadows over that without, at paths (pair, n) [m].
        """
        antennas = nodes.antennas
        seen = self.seen(pose.centres[0], pose.frames[0], antennas, parts)
        left = np.ones((len(self.frequency), len(nodes.pairs), len(parts)), dtype=np.complex128)
        # Parts in full view need no sum.
        cut = np.flatnonzero(seen.row.any(axis=0))
        if len(cut):
            index, seen = np.arange(len(antennas))[None], seen.of(cut)
            places = (pose.centres, pose.frames), antennas[None], nodes.pairs, length[None, :, cut]
            axes = self._radar.at(time).axes
            shadowed, free = (
                self.amplitude(*places, own, index, parts[cut], axes)[:, 0]
                for own in (seen, seen.unhidden())
            )
            left[..., cut] = visible_fraction(shadowed, free)
        return left

    def amplitude(
        self,
        pose: tuple[Array, Array],
        antennas: Array,
        pairs: NDArray[np.int64],
        length: Array,
        seen: Seen,
        index: NDArray[np.integer],
        parts: NDArray[np.int64],
        axes: Array,
    ) -> NDArray[np.complex128]:
        """Amplitude (node, pose, pair, n) of `Echoes` for poses and pairs of antennas [m].

        ``pose`` are centres and frames of the body, ``antennas (pose, antenna, 3)``, world [m];
        ``pairs (pair, 2)`` Tx and Rx among these; ``length (pose, pair, n)`` the carriers [m] of
        the ``parts (n,)``; ``seen`` what some antennas see of them, and ``index (pose, antenna)``
        the number of each antenna among those; ``axes (pose, 3, 3)``, or (3, 3) for all poses,
        those of the radar.
        """
        centres, frames = (array[:, parts] for array in pose)
        tasks, nodes = centres.shape[0] * len(parts), len(self.frequency)
        local = np.einsum("tpji,tpaj->tpai", frames, antennas[:, None] - centres[:, :, None])
        views = Views(
            np.tile(parts, len(centres)),
            local.reshape(tasks, *local.shape[2:]),
            np.swapaxes(seen.row[index], 1, 2).reshape(tasks, index.shape[1]),
            seen.fraction,
        )
        carrier = np.swapaxes(length, 1, 2).reshape(tasks, len(pairs))
        k = 2 * np.pi * self.frequency / SPEED_OF_LIGHT_MPS
        waves = Waves(pairs, carrier, np.broadcast_to(k, (tasks, nodes)), self._spreading)
        to_tx, to_rx = (antennas[:, None, pairs[:, side]] - centres[:, :, None] for side in (0, 1))
        ways = to_tx, to_rx, frames
        polarization = Polarization(self._radar.polarization, axes)
        waves, factor = with_obliquity(waves, *ways, polarization, shadow=False)
        field = facet_integral(self._facets, views, waves)
        field = field.reshape(*factor.shape, nodes) * factor[..., None]
        return np.asarray(np.conj(np.moveaxis(field, (3, 0, 2, 1), (0, 1, 2, 3))))
