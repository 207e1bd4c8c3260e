"""Echoes of rigid objects that move: physical optics over their facets at every chirp.

Facets are fixed in the object's axes, into which antennas are brought by the pose at each chirp, in
float64. The integral over a facet is exact but for the bow of the path over it. It is multiplied by
the Fresnel coefficients of a half-space of its material at its own angle. They are those of the
centre frequency and the middle of the array, for the whole sweep and all antennas
(`rtradar.scatter.rigid_legs`). What the array sees past furniture, other objects, people and the
object itself changes slowly: Mitsuba is asked at keyframes, for the middle of each facet, and
visibility fades smoothly in between; so do the coefficients.

An object has one echo at each of some lengths about the path over its point of reference. Each
facet is shared between the two echoes next to its path
(`rtradar.kernels.scatter.facets_by_length`). Where phases change slowly against those at the point
of reference, the field is computed at knots in time for all pairs of antennas, with polynomials in
between; else it is computed at every chirp. A sheet reflects several times, too (`RigidSheet`, in
`rtradar.scatter.rigid_sheets`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rtradar.conventions import MINIMUM_ANTENNA_DISTANCE_M, SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.kernels.scatter.facets_by_length import (
    LengthGrid,
    RigidFacets,
    RigidViews,
    facets_by_length,
)
from rtradar.radar import Radar
from rtradar.scatter.clutter.furniture import flat_edge, small_facets
from rtradar.scatter.common.interpolation import interpolation_weights, sweep_nodes
from rtradar.scatter.common.poses import KeyframeCache, antennas_in_use
from rtradar.scatter.multipath.image_paths import WallPath, images
from rtradar.scatter.multipath.slabs import WallResponse, room_series
from rtradar.scatter.multipath.wall_edges import WallEdges
from rtradar.scatter.rigid_legs import RigidLegs
from rtradar.scatter.validity import Limit
from rtradar.scene import Object, Wall
from rtradar.system.threads import thread_map
from rtradar.trace.occluders import Occluders

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

DIRECT = WallPath((), ())
"""The path that no wall reflects."""

_WALL_ERROR = 0.015
"""Error of the field behind walls that polynomials over the sweep may have."""

_NODES = 3
"""Frequencies over the sweep: one pass of `synthesize` in float32 takes as many."""

_LENGTHS_A_CELL = 4.0
"""Echoes to a range cell of path, c / bandwidth: at three nodes, 0.1 % of a facet's field is lost
at the ends of the sweep."""

_KNOT_RAD = 1.1
"""Phase against the point of reference from one knot to the next: a polynomial through eight is off
by 0.2 %."""

_KEYFRAME_S, _KEYFRAME_RAD = 20e-3, math.radians(10.0)
"""Most time and most rotation from one keyframe to the next."""

_KEPT_KEYFRAMES, _PASSING, _KEPT_KNOTS = 512, 64, 8
_SAMPLES, _STEP_S = 200, 1e-5
"""Instants of a capture at which velocities and distances are looked at, and the time for both."""

_TASKS_AT_ONCE = 4

_COUNT = 8
_OFFSETS = np.arange(_COUNT) - _COUNT // 2 + 1
"""Knots of a polynomial in time, from the one before."""


class _Keyframe(NamedTuple):
    """Visibility (place, facet) float32; what is left of a conductor's field (3, facet)."""

    seen: NDArray[np.float32]
    factor: NDArray[np.complex128]


class RigidEchoes:
    """Echoes of one moving object over one path, for any chirps.

    The direct path goes through the ``walls`` of the room, others over them. ``past`` is what may
    hide the object, None for nothing. ``limits`` are the limits of validity that it meets.

    An `InputError` is raised if the mesh cannot be used, or comes within 0.3 m of an antenna while
    the capture lasts.
    """

    def __init__(
        self,
        radar: Radar,
        moving: Object,
        duration_s: float,
        past: Occluders | None,
        *,
        walls: Sequence[Wall] = (),
        path: WallPath = DIRECT,
        spreading: bool = True,
    ) -> None:
        self.moving, self.path = moving, path
        self._radar, self._spreading = radar, spreading
        self.frequency = sweep_nodes(radar, _NODES)
        series = room_series(
            walls, radar, most_nodes=_NODES, enough=_WALL_ERROR, bounces=path.order
        )
        response = WallResponse(WallEdges.of(walls, radar), series.walls, self.frequency)
        self._meets = path, response, past
        self._legs = RigidLegs(radar.at(0.0), *self._meets)
        # The point of reference is the middle of the mesh's box, so that all its points are near.
        shape = moving.shape
        low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
        self._reference = (low + high) / 2
        self._corners = shape.corners - self._reference
        radius = float(np.linalg.norm(self._corners, axis=-1).max())
        # How it moves settles how small facets are, and how far knots and keyframes are apart.
        nearest, rates, speeds, turning = self._kinematics(duration_s)
        wavenumber = 2 * np.pi * self.frequency / SPEED_OF_LIGHT_MPS
        k = wavenumber[-1]
        edge = flat_edge(float((high - low).max()), nearest, k)
        self._small = small_facets(self._corners, 0, edge)
        self._facets = _rigid_facets(self._small.corners, not shape.closed)
        # Echoes at fixed steps of length. No facet's path differs from that over the point of
        # reference by more than twice the radius.
        step = SPEED_OF_LIGHT_MPS / (_LENGTHS_A_CELL * radar.bandwidth_hz)
        half = math.ceil(2 * radius / step) + 1
        sweep = radar.bandwidth_hz / (2 * radar.centre_frequency_hz)
        self._grid, self._count = (
            LengthGrid(-half, step, wavenumber, sweep, np.exp(-1j * wavenumber * step)),
            2 * half + 2,
        )
        # A knot at least as often as a keyframe, and at every `_KNOT_RAD` of phase against the
        # point of reference.
        self._knot_s = _KNOT_RAD / max(k * rates, _KNOT_RAD / _KEYFRAME_S)
        self._keyframe_s = min(_KEYFRAME_S, _KEYFRAME_RAD / max(turning, 1e-9))
        self._keyframes: KeyframeCache[int, _Keyframe] = KeyframeCache(_KEPT_KEYFRAMES, _PASSING)
        self._knots: KeyframeCache[int, NDArray[np.complex128]] = KeyframeCache(0, _KEPT_KNOTS)
        self.limits = tuple(self._limits(speeds)) if path.order == 0 else ()
        # The length that slabs add is taken as the same all the time; the rest is in the factors.
        self._longer_m = self._legs.longer_m(self._pose(np.zeros(1))[1][0])

    def _kinematics(self, duration_s: float) -> tuple[float, float, Array, float]:
        """Least distance [m], largest rates, and range rates of the mesh over the capture.

        Returned are the least distance from the radar to the ball about the object; the largest
        rate of paths against that over the point of reference [m/s]; range rates (instant, vertex)
        [m/s]; and the largest rate of rotation [rad/s].
        """
        shape = self.moving.shape
        # Instants that are evenly spaced could all fall on one phase of a rotation.
        random = np.random.default_rng(0).uniform(0.0, duration_s, _SAMPLES)
        times = np.array([0.0, *np.sort(random), duration_s])
        points = np.concatenate([shape.vertices, self._reference[None]])
        ranges, seen = [], []
        # Two instants shortly one after the other give all rates as differences.
        for at in (times, times + _STEP_S):
            rotation, place = self.moving.pose(at)
            axes, middle = self._radar.poses_at(at)
            now = np.einsum("tij,vj->tvi", rotation, points) + place[:, None]
            # Distances over both legs (2, instant, vertex).
            middles = np.stack([images(leg, middle) for leg in (self.path.out, self.path.back)])
            ranges.append(np.linalg.norm(now - middles[:, :, None], axis=-1))
            seen.append(np.einsum("tji,tjk->tik", axes, rotation))
        ranges, later = ranges
        # Rates of the whole path, over both legs.
        speeds = (later - ranges).sum(axis=0) / _STEP_S
        if self.path.order == 0:
            self._refuse_too_near(times, ranges[0])
        rates = float(np.abs(speeds[:, :-1] - speeds[:, -1:]).max())
        # The chord of a small rotation, over all three axes, is sqrt(2) of its angle.
        change = np.linalg.norm(seen[1] - seen[0], axis=(1, 2)) / math.sqrt(2)
        return float(ranges.min()), rates, speeds[:, :-1] / 2, float(change.max()) / _STEP_S

    def _refuse_too_near(self, times: Array, ranges: Array) -> None:
        radar = self._radar
        # A face can be too near to an antenna only while some vertex is this near to the middle of
        # the array: only these instants are looked at closely.
        around = float(np.linalg.norm(np.concatenate([radar.tx_m, radar.rx_m]), axis=1).max())
        size = float(np.ptp(self.moving.shape.vertices, axis=0).max())
        least = MINIMUM_ANTENNA_DISTANCE_M
        for number in np.flatnonzero(ranges.min(axis=1) < least + around + size):
            mesh = self.moving.triangles(float(times[number]))
            antennas = np.concatenate(radar.antennas_at(times[[number]]), axis=1)[0]
            gap = min(mesh.distance_m(antenna) for antenna in antennas)
            if gap < least:
                raise InputError(
                    f"at {times[number]:.2f} s the object '{self.moving.name}' is {gap:.2f} m from "
                    f"an antenna of radar '{radar.name}'; at least {least} m is allowed: move the "
                    "radar (position_m) or the object"
                )

    def _limits(self, speeds: Array) -> list[Limit]:
        radar, fastest = self._radar, float(np.abs(speeds).max())
        if fastest <= radar.max_velocity_mps:
            return []
        fraction = float((np.abs(speeds) > radar.max_velocity_mps).mean())
        return [
            Limit(
                "object_velocity_ambiguous",
                fraction,
                f"corners of object '{self.moving.name}', the fastest at {fastest:.2f} m/s, beyond "
                f"the unambiguous {radar.max_velocity_mps:.2f} m/s: they show at another velocity",
            )
        ]

    # -- echoes ------------------------------------------------------------------------------------

    def echoes(self, chirps: Indices) -> Echoes:
        """Echoes of the object at these chirps, all of part 0.

        If the chirps lie close together, only lengths at which something is seen are there, so
        their number changes from call to call; else all are.
        """
        radar = self._radar
        times, tx = radar.centres_of(chirps), radar.tx_of_chirp(chirps)
        # If the knots about these chirps are fewer than the chirps, the field is computed there and
        # interpolated; else it is computed at every chirp.
        knots = PolynomialsInTime(times, self._knot_s)
        count = len(knots.numbers)
        if count * radar.n_tx < len(chirps):
            # The knots about the end of these chirps serve the next call.
            field = np.stack(
                [self._knots.get(one, partial(self._knot, one)) for one in knots.numbers.tolist()]
            )
            # Lengths at which nothing is seen are left out.
            used = field.any(axis=(0, 1, 2, 3))
            field = field[..., used]
            amplitude = knots.between(field, tx)
        else:
            field = self._field(times, tx)
            used = field.any(axis=(0, 1, 2)) | far_apart(chirps)
            amplitude = np.moveaxis(field[..., used], 2, 0).astype(np.complex64)
        # The exact path over the point of reference carries the Doppler; the steps stay the same.
        steps = (self._grid.first + np.flatnonzero(used)) * self._grid.step
        return Echoes(
            length=self._over_reference(times, tx)[..., None] + self._longer_m + steps,
            amplitude=np.ascontiguousarray(amplitude),
            frequency=self.frequency,
            tx=tx,
            part=np.zeros(len(steps), dtype=np.int64),
            bounces=np.full(len(steps), 1 + self.path.order),
        )

    def _knot(self, number: int) -> NDArray[np.complex128]:
        """Amplitudes (tx, rx, node, echo) at one knot."""
        tx = np.arange(self._radar.n_tx)
        return self._field(np.full(len(tx), number * self._knot_s), tx)

    def _pose(self, times: Array) -> tuple[Array, Array]:
        """Rotations (time, 3, 3), and the point of reference (time, 3), world [m]."""
        rotation, place = self.moving.pose(times)
        return rotation, place + rotation @ self._reference

    def _over_reference(self, times: Array, tx: Indices) -> Array:
        """Paths over the point of reference (task, rx) [m]."""
        at, (from_tx, to_rx) = self._pose(times)[1], self._images(times, tx)
        out = np.linalg.norm(from_tx - at, axis=1)
        return np.asarray(out[:, None] + np.linalg.norm(to_rx - at[:, None], axis=2))

    def _images(self, times: Array, tx: Indices) -> tuple[Array, Array]:
        """Images of the Tx (task, 3) of tasks and of the Rx (task, rx, 3) kept with them [m]."""
        from_tx, to_rx = antennas_in_use(self._radar, times, tx)
        return images(self.path.out, from_tx), images(self.path.back, to_rx)

    def _field(self, times: Array, tx: Indices) -> NDArray[np.complex128]:
        """Amplitudes (task, rx, node, echo) at the times of tasks and for their Tx."""
        legs, (rotation, at) = self._legs, self._pose(times)
        from_tx, to_rx = self._images(times, tx)
        # The keyframes on both sides of each task hold visibility and materials.
        place = times / self._keyframe_s
        before = np.floor(place).astype(np.int64)
        numbers = np.unique([before, before + 1])
        keyframes = [
            self._keyframes.get(number, partial(self._keyframe, number))
            for number in numbers.tolist()
        ]
        rx = self._radar.rx_of_tx[tx]
        # Antennas are brought into the axes of the mesh, where its facets stand still.
        views = RigidViews(
            tx=np.einsum("tji,tj->ti", rotation, from_tx - at),
            rx=np.einsum("tji,trj->tri", rotation, to_rx - at[:, None]),
            before=np.searchsorted(numbers, before),
            after=np.searchsorted(numbers, before + 1),
            fraction=place - before,
            seen=np.stack([own.seen for own in keyframes]),
            tx_weight=legs.tx_weight[tx],
            rx_weight=legs.rx_weight[rx],
            factor=np.stack([own.factor for own in keyframes]),
        )
        out = np.zeros((len(times), self._radar.n_rx, _NODES, self._count), dtype=np.complex128)
        given = self._facets, views, self._grid, self._spreading, out
        thread_map(
            lambda first: facets_by_length(first, min(first + _TASKS_AT_ONCE, len(out)), *given),
            range(0, len(out), _TASKS_AT_ONCE),
        )
        return out

    # -- keyframes ---------------------------------------------------------------------------------

    def _keyframe(self, number: int) -> _Keyframe:
        time_s, facets = number * self._keyframe_s, self._facets
        legs, middles, normals = self._facets_at(time_s)
        # Facets of a closed mesh that face away are not asked about.
        facing = np.einsum("fi,pfi->pf", normals, legs.places[:, None] - middles)
        asked = np.ones(facing.shape, dtype=bool) if facets.both_sides else facing > 0
        seen = legs.seen(time_s, middles, asked)
        given = middles, normals, self.moving.material, self._longer_m
        return _Keyframe(seen.astype(np.float32), legs.factor(*given))

    def _facets_at(self, time_s: float) -> tuple[RigidLegs, Array, Array]:
        """Legs at a time, with the middles [m] and the normals (facet, 3) of facets, world."""
        facets, ((rotation,), (at,)) = self._facets, self._pose(np.array([time_s]))
        # The last vertices are the middles of the facets, about the point of reference.
        middles = facets.vertices[:, -len(facets.faces) :].T @ rotation.T + at
        legs = RigidLegs(self._radar.at(time_s), *self._meets)
        return legs, middles, facets.normals @ rotation.T


def far_apart(chirps: Indices) -> bool:
    """Whether chirps are so far apart that all echoes are asked for, also those that are 0."""
    return len(chirps) > 0 and bool(chirps[-1] - chirps[0] >= 2 * len(chirps))


def _rigid_facets(corners: Array, both_sides: bool) -> RigidFacets:
    """Facets of triangles (facet, 3, 3), whose equal corners become one vertex."""
    vertices, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(across, axis=1)
    normals = across / twice[:, None]
    return RigidFacets(
        vertices=np.ascontiguousarray(np.concatenate([vertices, corners.mean(axis=1)]).T),
        faces=np.ascontiguousarray(faces.reshape(-1, 3), dtype=np.int64),
        normals=np.ascontiguousarray(normals),
        planes=np.einsum("fi,fi->f", normals, corners[:, 0]),
        areas=twice / 2,
        both_sides=both_sides,
    )


class PolynomialsInTime:
    """Polynomials through the fields at the eight knots about each time.

    Knots are at multiples of ``apart`` seconds, ``numbers (knot,)`` those about the times [s].
    """

    def __init__(self, times: NDArray[np.float64], apart: float) -> None:
        # Eight knots about each time, and the weights of the polynomial through them, as one sparse
        # matrix.
        before = np.floor(times / apart).astype(np.int64)
        around = before[:, None] + _OFFSETS
        self.numbers = np.unique(around)
        weights = interpolation_weights(_OFFSETS.astype(np.float64), times / apart - before)
        ends = np.arange(len(times) + 1) * _COUNT
        given = weights.ravel(), np.searchsorted(self.numbers, around).ravel(), ends
        self._weights = csr_array(given, shape=(len(times), len(self.numbers)))

    def between(
        self, field: NDArray[np.complex128], tx: NDArray[np.int64]
    ) -> NDArray[np.complex64]:
        """Compute amplitudes (node, chirp, rx, echo) of chirps, each of its Tx ``tx (chirp,)``.

        They are those of the polynomials through ``field (knot, tx, rx, node, echo)``.
        """
        _, _, receivers, nodes, echoes = field.shape
        out = np.empty((nodes, len(tx), receivers, echoes), dtype=np.complex64)
        for number in np.unique(tx):
            own = np.flatnonzero(tx == number)
            # Weights are real: real and imaginary parts are columns of their own.
            columns = np.ascontiguousarray(field[:, number]).reshape(len(field), -1)
            found = np.ascontiguousarray(self._weights[own] @ columns.view(np.float64))
            shaped = found.view(np.complex128).reshape(len(own), receivers, nodes, echoes)
            out[:, own] = np.moveaxis(shaped, 2, 0)
        return out
