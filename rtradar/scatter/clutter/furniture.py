"""Furniture: physical optics over its facets, as each Tx lights them and each Rx sees them; sheets with several bounces.

The machinery is that of the model `rays`: facets are tubes, Mitsuba says which of them an antenna sees past all furniture,
lengths and phases are float64. A closed piece returns one bounce: each facet is a mirror by the Fresnel coefficients of a
half-space of its material, TE and TM apart, at its own angle and the sweep's centre frequency. A thin sheet, which is of metal,
reflects on both sides and up to `SHEET_BOUNCES` times: a corner reflector. Bounces between different pieces, and between
pieces and walls, are left out; walls on the way let through what their slabs do, taken once a group.

Facets that lie within half a range bin of each other, and side by side, are one echo: the phase that is left over the sweep
is small enough for a polynomial through `FURNITURE_NODES` frequencies.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from rtradar.conventions import MINIMUM_ANTENNA_DISTANCE_M, SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.clutter.behind_walls import behind_walls
from rtradar.scatter.clutter.facet_groups import FacetGroups, PathGroups
from rtradar.scatter.clutter.returns import FURNITURE_NODES, RoomEchoes
from rtradar.scatter.common.nodes import sweep_nodes
from rtradar.scatter.common.polarization import apply_te_tm
from rtradar.scatter.ray_tubes.footprints import Footprints, radiate
from rtradar.scatter.ray_tubes.shooting import Shooter, exits
from rtradar.scatter.ray_tubes.tubes import MeshGrid
from rtradar.scene import Furniture, Material, Scene, reflection
from rtradar.trace.bounces import MeshSurfaces, Surfaces

Array = NDArray[np.float64]
SHEET_BOUNCES = 3
"""Of a trihedral."""
MOST_FACETS = 1_000_000
_BOW_RAD = 0.3
"""By which paths over a facet may bow; three quarters of that are made good."""
_OF_PIECE = 0.125
"""Of a piece's longest extent, where nothing else asks for smaller facets: what corners and other pieces hide is hidden by
whole facets. A trihedral is then within 0.1 dB of closed form."""
_PATIENCE_S = 2.0
"""What lasts longer shows a bar."""

_POLARIZATIONS: tuple[Literal["te"], Literal["tm"]] = ("te", "tm")


class _Piece:
    """The surfaces of all furniture, of which rays bounce on one piece only: what meets another is lost."""

    flat = True

    def __init__(self, surfaces: MeshSurfaces, first: int, last: int) -> None:
        self._all, self._first, self._last = surfaces, first, last
        self.sees, self.distance, self.normal = surfaces.sees, surfaces.distance, surfaces.normal

    def meets(
        self, points: Array, normals: Array, directions: Array, own: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Array]:
        """As `Surfaces.meets`."""
        face, distance = self._all.meets(points, normals, directions, own)
        other = (face < self._first) | (face >= self._last)
        return np.where(other, -1, face), np.where(other, np.inf, distance)


def furniture_returns(mi: Any, radar: Radar, scene: Scene) -> Iterator[RoomEchoes]:
    """Returns of every piece of furniture.

    Parameters
    ----------
    mi : module
        Mitsuba with its variant set.
    radar : Radar
    scene : Scene

    Yields
    ------
    RoomEchoes
        ``furniture``, or ``reflector`` for sheets, of pieces that some channel sees.

    Raises
    ------
    InputError
        Where a mesh cannot be used, or would take too many facets.
    """
    pieces = [(piece, piece.triangles()) for piece in scene.furniture]
    if not pieces:
        return
    corners = np.concatenate([triangles.corners for _, triangles in pieces])
    surfaces = MeshSurfaces(mi, corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    first = 0
    # A tenth of a second a piece, so a hall of chairs takes minutes.
    bar = tqdm(pieces, desc="furniture", unit="piece", disable=None, leave=False, delay=_PATIENCE_S)
    for piece, triangles in bar:
        last = first + len(triangles.faces)
        grid = _facets(triangles.corners, first, _facet_edge(triangles.corners, radar))
        returns = _returns(
            piece, triangles.closed, _Piece(surfaces, first, last), grid, radar, scene
        )
        if returns is not None:
            yield returns
        first = last


def _facet_edge(corners: Array, radar: Radar) -> float:
    """Longest side of facets [m]: paths bow over it by no more than `_BOW_RAD`, it fits into a group and into the piece."""
    antennas = np.concatenate([radar.tx, radar.rx])
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    nearest = np.linalg.norm(antennas - np.clip(antennas, low, high), axis=1).min()
    wavenumber = 2 * np.pi * (radar.start_frequency_hz + radar.bandwidth_hz) / SPEED_OF_LIGHT_MPS
    # Two legs bow by (edge / 2)^2 / 2R each over half a square.
    flat = 2 * np.sqrt(_BOW_RAD * max(nearest, MINIMUM_ANTENNA_DISTANCE_M) / wavenumber)
    return float(min(flat, 2 * radar.range_bin_m, _OF_PIECE * (high - low).max()))


def _facets(corners: Array, first: int, edge: float) -> MeshGrid:
    """Faces, numbered from ``first`` on, halved across their longest sides until none is longer: few where they are slender."""
    face = np.arange(first, first + len(corners))
    done: list[tuple[Array, NDArray[np.int64]]] = []
    count = 0
    while len(corners):
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        area = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        flat = area <= 1e-12 * sides.max(axis=1) ** 2
        small = sides.max(axis=1) <= edge
        done.append((corners[small & ~flat], face[small & ~flat]))
        count += len(done[-1][0])
        corners, face, sides = (array[~small & ~flat] for array in (corners, face, sides))
        if count + 2 * len(corners) > MOST_FACETS:
            raise InputError(
                f"furniture: more than {MOST_FACETS} facets of {edge:.3g} m; leave pieces out or move them away"
            )
        # The longest side from corner 0 to corner 1.
        turned = np.take_along_axis(
            corners, ((sides.argmax(axis=1)[:, None] + np.arange(3)) % 3)[..., None], axis=1
        )
        middle = (turned[:, 0] + turned[:, 1]) / 2
        halves = [
            np.stack([turned[:, 0], middle, turned[:, 2]], axis=1),
            np.stack([middle, turned[:, 1], turned[:, 2]], axis=1),
        ]
        corners, face = np.concatenate(halves), np.tile(face, 2)
    return MeshGrid(
        np.concatenate([part for part, _ in done]), np.concatenate([part for _, part in done])
    )


def _returns(
    piece: Furniture, closed: bool, surfaces: Surfaces, grid: MeshGrid, radar: Radar, scene: Scene
) -> RoomEchoes | None:
    bounces = 1 if closed else SHEET_BOUNCES
    wavenumber = 2 * np.pi * (radar.start_frequency_hz + radar.bandwidth_hz) / SPEED_OF_LIGHT_MPS
    shooter = Shooter(
        surfaces=surfaces,
        grid=grid,
        bounces=bounces,
        wavenumber=wavenumber,
        polarization=radar.polarization,
        two_sided=not closed,
    )
    groups = FacetGroups(grid.tubes.places[:, 3], radar)
    chains = [PathGroups(grid.tubes.places, radar, order) for order in range(2, bounces + 1)]
    nodes = sweep_nodes(radar, FURNITURE_NODES)
    shots = [
        _shot(
            shooter.shoot(tx),
            surfaces,
            piece.material,
            groups,
            chains,
            tx,
            radar.rx[radar.rx_of_tx[index]],
            nodes,
            radar,
        )
        for index, tx in enumerate(radar.tx)
    ]
    amplitude = np.stack([shot.amplitude for shot in shots], axis=1)
    if not amplitude.any():
        return None
    centres = np.concatenate([groups.centres, *(chain.centres() for chain in chains)])
    bounced = [
        np.ones(len(groups.centres)),
        *(np.full(chain.count, chain.order) for chain in chains),
    ]
    returns = RoomEchoes(
        name=piece.name,
        kind="furniture" if closed else "reflector",
        length=np.stack([shot.length for shot in shots]),
        amplitude=amplitude,
        frequency=nodes,
        bounces=np.concatenate(bounced).astype(np.int64),
        points=centres[None, None, :, None],
    ).heard(radar)
    if returns.n_echoes == 0:
        return None
    return behind_walls(returns, radar, scene).heard(radar)


class _Shot(NamedTuple):
    """``length (rx, echo)`` [m] and ``amplitude (node, rx, echo)`` of one Tx."""

    length: Array
    amplitude: NDArray[np.complex128]


def _shot(
    sets: list[Footprints],
    surfaces: Surfaces,
    material: Material,
    groups: FacetGroups,
    chains: list[PathGroups],
    tx: Array,
    rx: Array,
    nodes: Array,
    radar: Radar,
) -> _Shot:
    wavenumber = 2 * np.pi * nodes / SPEED_OF_LIGHT_MPS
    lengths = [
        np.linalg.norm(rx[:, None] - groups.centres, axis=-1)
        + np.linalg.norm(tx - groups.centres, axis=-1)
    ]
    sums = []
    for order, footprints in enumerate(sets):
        group = (
            chains[order - 1].of(footprints, tx) if order else groups.of(footprints.places[:, 3])
        )
        if order:
            lengths.append(chains[order - 1].lengths(footprints, group, tx, rx))
        visible = exits(surfaces, footprints, rx)
        turn, lit = _reflected(footprints, material, radar.centre_frequency_hz)
        total = turn * radiate(
            lit, visible, group, rx, wavenumber, lengths[-1], polarization=radar.polarization
        )
        sums.append(total)
    return _Shot(np.concatenate(lengths, axis=-1), np.concatenate(sums, axis=-1).conj())


def _reflected(
    footprints: Footprints, material: Material, frequency_hz: float
) -> tuple[complex, Footprints]:
    """Footprints whose fields, sent back by a conductor, times this factor, are what the material sends back.

    The factor is the turn of the phase straight on; how it changes with the angle, 1 % of the field in wood, is left out.
    """
    if material.conducts or len(footprints) == 0:
        return 1.0, footprints
    ways, normals = footprints.directions[:, 3], footprints.normals[:, 3]
    cosine = np.clip(-np.einsum("ti,ti->t", ways, normals), 0.0, 1.0)
    eta = material.eta(frequency_hz)
    straight = reflection(eta, 1.0, "tm")
    turn = complex(straight / abs(straight)) if straight != 0 else 1.0 + 0j
    te, tm = ((reflection(eta, cosine, kind) / turn).real for kind in _POLARIZATIONS)
    # A conductor, whose coefficients are -1 and +1, leaves these fields as they are.
    return turn, replace(
        footprints, field=apply_te_tm(footprints.field, ways, ways, normals, -te, tm)
    )
