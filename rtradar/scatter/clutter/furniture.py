"""Furniture: physical optics over its facets; sheets with several bounces.

The machinery is that of the model `rays`: facets are tubes, Mitsuba says which of them an antenna
sees past all furniture, and lengths and phases are float64. A closed piece returns one bounce: each
facet reflects by the Fresnel coefficients of a half-space of its material, TE and TM apart, at its
own angle and the sweep's centre frequency. A thin sheet, which is of metal, reflects on both sides
and up to `SHEET_BOUNCES` times, as a corner reflector does. Bounces between different pieces, and
between pieces and walls, are left out. What walls on the way transmit is applied once to each
group.

Facets that are within half a range bin of each other, and side by side, are one echo: the phase
that is left over the sweep is small enough for a polynomial through `FURNITURE_NODES` frequencies.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from rtradar.conventions import MINIMUM_ANTENNA_DISTANCE_M, SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.clutter.returns import FURNITURE_NODES, RoomEchoes, behind_walls
from rtradar.scatter.common.interpolation import sweep_nodes
from rtradar.scatter.common.polarization import POLARIZATIONS, Polarization, apply_te_tm, pattern_of
from rtradar.scatter.ray_tubes import Footprints, Shooter, exits, radiate
from rtradar.scatter.target import MeshGrid
from rtradar.scene import Furniture, Material, Scene, reflection
from rtradar.trace.tracers import MeshTracer, Surfaces

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SHEET_BOUNCES = 3
"""Bounces of a trihedral."""
MOST_FACETS = 1_000_000
_BOW_RAD = 0.3
"""Largest bow of paths over a facet [rad]; three quarters of it are corrected."""
_OF_PIECE = 0.125
"""Largest facet over the longest extent of a piece, where nothing else asks for smaller ones.

Corners and other pieces occlude whole facets. With facets of this size a trihedral is within 0.1 dB
of the closed form (`validation/closed_forms/room_clutter.py`).
"""
_PATIENCE_S = 2.0
"""Time after which a progress bar is shown [s]."""
_WIDTH_BINS = 4.0
"""Width of a group of facets across the line of sight, in range bins.

Seen from the ends of the array, the group stays within its half bin.
"""


def furniture_returns(mi: Any, radar: Radar, scene: Scene) -> Iterator[RoomEchoes]:
    """Yield the returns of every piece of furniture that some channel sees.

    They are of the kind ``furniture``, or ``reflector`` for sheets. Mitsuba, ``mi``, has its
    variant set. An `InputError` is raised if a mesh cannot be used, or would take too many facets.
    """
    # All pieces are traced as one mesh, because they occlude one another.
    pieces = [(piece, piece.triangles()) for piece in scene.furniture]
    if not pieces:
        return
    corners = np.concatenate([triangles.corners for _, triangles in pieces])
    surfaces = MeshTracer(mi, corners)
    first = 0
    # A tenth of a second a piece, so a hall of chairs takes minutes.
    bar = tqdm(pieces, desc="furniture", unit="piece", disable=None, leave=False, delay=_PATIENCE_S)
    for piece, triangles in bar:
        last = first + len(triangles.faces)
        grid = small_facets(triangles.corners, first, _facet_edge(triangles.corners, radar))
        own = surfaces.of_piece(first, last)
        returns = _returns(piece, triangles.closed, own, grid, radar, scene)
        if returns is not None:
            yield returns
        first = last


# -- facets ----------------------------------------------------------------------------------------


def _facet_edge(corners: Array, radar: Radar) -> float:
    """Longest side of facets [m], by the bow of paths over it, the group and the piece."""
    # The distance from the nearest antenna to the box of the mesh bounds the bow of the paths.
    antennas, (low, high) = np.concatenate([radar.tx, radar.rx]) @ radar.axes, _box(corners, radar)
    nearest = np.linalg.norm(antennas - np.clip(antennas, low, high), axis=1).min()
    wavenumber = 2 * np.pi * (radar.start_frequency_hz + radar.bandwidth_hz) / SPEED_OF_LIGHT_MPS
    edge = flat_edge(float((high - low).max()), float(nearest), wavenumber)
    return min(edge, 2 * radar.range_bin_m)


def _box(places: Array, radar: Radar) -> Array:
    """Least and largest coordinates (2, 3) of places (..., 3), in the radar's axes [m].

    In these axes the result is the same however radar and room are turned together.
    """
    seen = places.reshape(-1, 3) @ radar.axes
    return np.stack([seen.min(axis=0), seen.max(axis=0)])


def flat_edge(extent: float, nearest: float, wavenumber: float) -> float:
    """Longest side of facets [m], by the longest extent of a mesh and the nearest antenna [m]."""
    # Two legs bow by (edge / 2)^2 / 2R each over half a square.
    flat = 2 * math.sqrt(_BOW_RAD * max(nearest, MINIMUM_ANTENNA_DISTANCE_M) / wavenumber)
    return min(flat, _OF_PIECE * extent)


def small_facets(corners: Array, first: int, edge: float) -> MeshGrid:
    """Halve faces, numbered from ``first`` on, across their longest sides until these fit."""
    face = np.arange(first, first + len(corners))
    done: list[tuple[Array, Indices]] = []
    count = 0
    while len(corners):
        # Triangles without area are dropped, small ones are done.
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        flat = np.linalg.norm(normals, axis=1) <= 1e-12 * sides.max(axis=1) ** 2
        small = sides.max(axis=1) <= edge
        done.append((corners[small & ~flat], face[small & ~flat]))
        count += len(done[-1][0])
        corners, face, sides = (array[~small & ~flat] for array in (corners, face, sides))
        if count + 2 * len(corners) > MOST_FACETS:
            raise InputError(
                f"furniture: more than {MOST_FACETS} facets of {edge:.3g} m; leave pieces out or "
                "move them away"
            )
        # Roll each face so that its longest side goes from corner 0 to corner 1.
        order = (sides.argmax(axis=1)[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(corners, order[..., None], axis=1), 1, 0)
        middle = (a + b) / 2
        halves = np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)
        corners, face = np.concatenate(halves), np.tile(face, 2)
    return MeshGrid(*(np.concatenate(parts) for parts in zip(*done, strict=True)))


# -- groups of facets ------------------------------------------------------------------------------


class FacetGroups:
    """Groups of facets that are one echo each: half a range bin deep, `_WIDTH_BINS` wide.

    The depth is that from the array's centre, the width across the way to the piece. ``centres
    (group, 3)`` are the means of the facets' middles [m].
    """

    def __init__(self, middles: Array, radar: Radar) -> None:
        # Depth along the range, and two axes across the line of sight.
        self._origin, self._bin = np.array(radar.position_m), radar.range_bin_m
        way = (middles - self._origin).mean(axis=0)
        # The axes across are chosen in the radar's axes, for the reason given in `_box`.
        self._sides = np.linalg.svd((way @ radar.axes)[None])[2][1:] @ radar.axes.T
        cells = self._cells(middles)
        self._least, self._count = cells.min(axis=0), np.ptp(cells, axis=0) + 1
        self._keys, own, counts = np.unique(
            self._key(cells), return_inverse=True, return_counts=True
        )
        sums = np.stack([np.bincount(own, weights=middles[:, axis]) for axis in range(3)], axis=-1)
        self.centres = sums / counts[:, None]

    def of(self, points: Array) -> Indices:
        """Return the group of each of the middles, (point,)."""
        return np.searchsorted(self._keys, self._key(self._cells(points)))

    def _cells(self, points: Array) -> Indices:
        # Axis by axis, so that a point is rounded alike whatever other points come with it.
        x, y, z = (points[:, axis] - self._origin[axis] for axis in range(3))
        width = _WIDTH_BINS * self._bin
        across = [(x * side[0] + y * side[1] + z * side[2]) / width for side in self._sides]
        deep = np.sqrt(x * x + y * y + z * z) / (self._bin / 2)
        return np.floor(np.stack([deep, *across], axis=-1)).astype(np.int64)

    def _key(self, cells: Indices) -> Indices:
        deep, left, up = np.moveaxis(cells - self._least, -1, 0)
        return np.asarray((deep * self._count[1] + left) * self._count[2] + up)


class PathGroups:
    """Groups of echoes with one number of bounces, half a range bin of path length each.

    ``places (facet, 4, 3)`` are the corners and middles of the object's facets [m].
    """

    def __init__(self, places: Array, radar: Radar, order: int) -> None:
        # The middle of the piece's box is the point of reference of all paths.
        low, high = _box(places, radar)
        self._middle = radar.axes @ (low + high) / 2
        self._step, self.order = radar.range_bin_m, order
        self._origin = np.array(radar.position_m)
        # No path from face to face and back differs by more from the one over the middle.
        self._half = int(np.ceil((order + 1) * np.linalg.norm(high - low) / self._step))
        self.count = 2 * self._half + 1
        self._weight, self._sum = np.zeros(self.count), np.zeros((self.count, 3))

    def of(self, footprints: Footprints, tx: Array) -> Indices:
        """Return the group of each footprint, and add these to its `centres`."""
        # The path in steps of half a bin, against that over the middle.
        places = footprints.places[:, 3]
        path = footprints.path[:, 3] + np.linalg.norm(places - self._origin, axis=1)
        middle = np.linalg.norm(tx - self._middle) + np.linalg.norm(self._origin - self._middle)
        number = np.rint((path - middle) / self._step).astype(np.int64)
        group = np.clip(number + self._half, 0, self.count - 1)
        # The mean place of a group, weighted by power, is summed up over all Tx.
        power = footprints.power()
        self._weight += np.bincount(group, weights=power, minlength=self.count)
        self._sum += np.stack(
            [np.bincount(group, weights=power * along, minlength=self.count) for along in places.T],
            axis=-1,
        )
        return group

    def lengths(self, footprints: Footprints, group: Indices, tx: Array, rx: Array) -> Array:
        """Return the mean path of each group, (rx, echo) [m]; over the middle if it is empty."""
        over_middle = np.linalg.norm(tx - self._middle) + np.linalg.norm(rx - self._middle, axis=1)
        return footprints.mean_paths(group, rx, np.repeat(over_middle[:, None], self.count, axis=1))

    def centres(self) -> Array:
        """Return the mean place of the last bounce of each group, (echo, 3) [m]."""
        weight, middle = self._weight[:, None], np.tile(self._middle, (self.count, 1))
        return np.divide(self._sum, weight, out=middle, where=weight > 0)


# -- returns ---------------------------------------------------------------------------------------


def _returns(
    piece: Furniture, closed: bool, surfaces: Surfaces, grid: MeshGrid, radar: Radar, scene: Scene
) -> RoomEchoes | None:
    # Tubes of rays to the facets of this piece, which a sheet reflects from either side.
    bounces, places = 1 if closed else SHEET_BOUNCES, grid.tubes.places
    wavenumber = 2 * np.pi * (radar.start_frequency_hz + radar.bandwidth_hz) / SPEED_OF_LIGHT_MPS
    polarization = Polarization(radar.polarization, radar.axes)
    shooter = Shooter(
        surfaces=surfaces,
        grid=grid,
        bounces=bounces,
        wavenumber=wavenumber,
        polarization=polarization,
        antenna=radar.tx_antenna,
        two_sided=not closed,
    )
    # Single bounces are grouped by where they are, several bounces by the length of their path.
    groups = FacetGroups(places[:, 3], radar)
    chains = [PathGroups(places, radar, order) for order in range(2, bounces + 1)]
    # The shortest waves settle how rough tubes may be; the sums are at nodes over the sweep.
    nodes = sweep_nodes(radar, FURNITURE_NODES)
    k = 2 * np.pi * nodes / SPEED_OF_LIGHT_MPS

    def shot(tx: Array, rx: Array) -> tuple[Array, NDArray[np.complex128]]:
        """Lengths (rx, echo) [m] and amplitudes (node, rx, echo) of the footprints of one Tx."""
        lengths = [
            np.linalg.norm(rx[:, None] - groups.centres, axis=-1)
            + np.linalg.norm(tx - groups.centres, axis=-1)
        ]
        sums = []
        for order, footprints in enumerate(shooter.shoot(tx)):
            if order:
                group = chains[order - 1].of(footprints, tx)
                lengths.append(chains[order - 1].lengths(footprints, group, tx, rx))
            else:
                group = groups.of(footprints.places[:, 3])
            # The sum of each group's footprints, with what the material reflects.
            visible = exits(surfaces, footprints, rx)
            turn, lit = _reflected(footprints, piece.material, radar.centre_frequency_hz)
            lit = replace(lit, surface=group)
            own = radiate(lit, visible, rx, k, lengths[-1], polarization=polarization)
            sums.append(turn * own)
        return np.concatenate(lengths, axis=-1), np.concatenate(sums, axis=-1).conj()

    # Every Tx with the Rx that are kept with it; a piece that nobody sees returns nothing.
    shots = list(map(shot, radar.tx, radar.rx[radar.rx_of_tx]))
    amplitude = np.stack([amplitude for _, amplitude in shots], axis=1)
    if not amplitude.any():
        return None
    centres = np.concatenate([groups.centres, *(chain.centres() for chain in chains)])
    # A pattern changes little over a group, so the place of its last bounce stands for all of it.
    ways = centres - radar.rx[radar.rx_of_tx][:, :, None]
    amplitude *= pattern_of(radar.rx_antenna, ways, polarization)
    # The groups of one bounce, then those of each further number of bounces.
    orders = [1, *(chain.order for chain in chains)]
    counts = [len(groups.centres), *(chain.count for chain in chains)]
    returns = RoomEchoes(
        name=piece.name,
        kind="furniture" if closed else "reflector",
        length=np.stack([length for length, _ in shots]),
        amplitude=amplitude,
        frequency=nodes,
        bounces=np.repeat(orders, counts),
        points=centres[None, None, :, None],
    ).received(radar)
    if returns.n_echoes == 0:
        return None
    return behind_walls(returns, radar, scene).received(radar)


def _reflected(
    footprints: Footprints, material: Material, frequency_hz: float
) -> tuple[complex, Footprints]:
    """Footprints and a factor that, for a conductor, give what the material reflects.

    The factor is the phase at normal incidence. How it changes with the angle is left out: by
    `reflection`, in wood at 14 GHz, that is 1 % of the incident field at 60 degrees and 7 % at
    grazing incidence.
    """
    if material.conducts or len(footprints) == 0:
        return 1.0, footprints
    # The angle of incidence on each facet gives both coefficients.
    ways, normals = footprints.directions[:, 3], footprints.normals[:, 3]
    cosine = np.clip(-np.einsum("ti,ti->t", ways, normals), 0.0, 1.0)
    # The phase at normal incidence is taken out of both, which leaves real factors.
    eta = material.eta(frequency_hz)
    straight = reflection(eta, 1.0, "tm")
    turn = complex(straight / abs(straight)) if straight != 0 else 1.0 + 0j
    te, tm = ((reflection(eta, cosine, kind) / turn).real for kind in POLARIZATIONS)
    # A conductor, whose coefficients are -1 and +1, leaves these fields as they are.
    field = apply_te_tm(footprints.field, ways, ways, normals, -te, tm)
    return turn, replace(footprints, field=field)
