"""Physical optics of one target over facets, for antennas anywhere.

A mesh is closed, or it is open and then a thin sheet that is lit from both sides. Its triangles are
flat, and stay so however they are divided. They are divided where spherical waves bend over them by
more than linear phase can follow, and where the edge of a shadow runs through them. Mitsuba finds
such edges at four points of each triangle, down to a quarter of a wavelength.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.facets.body import FacetShadows
from rtradar.scatter.facets.radiation import (
    FACETS_PER_SQUARE_KA,
    LARGEST_KA,
    MAXIMUM_FACETS,
    NEAR,
    Links,
    Seen,
    body_facets,
    check_count,
    directions_apart,
    facet_normals,
    hidden_parts,
    mesh_facets,
    radiated,
    smooth_bend,
    visible,
)
from rtradar.scatter.target import in_four, target_mesh
from rtradar.scene.mesh_files import Triangles
from rtradar.trace.backend import select, use
from rtradar.trace.tracers import MeshTracer

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# -- a mesh ----------------------------------------------------------------------------------------


_BENT_PHASE = 0.05
"""Phase that waves may depart from linear over a facet [rad]: at most 2 % of its field."""

_MOST_FACETS = 5_000_000
_DIVISIONS = 7
"""Most divisions of a facet on the edge of a shadow."""

_SAME = 1e-4
"""Fraction of the mesh's size within which a hit counts as the point itself: at shared edges
float32 does not tell which face was met."""

_FOUR = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
"""Middles of the four equal triangles that a triangle divides into, barycentric."""


def mesh_scattering(
    mesh: Triangles,
    tx: Array,
    rx: Array,
    wavenumber: Array,
    polarization: Polarization,
    variant: str,
) -> NDArray[np.complex128]:
    """Co-polar scattering length (n,) of a mesh, see `facet_scattering`.

    Antennas ``tx, rx (n, 3)`` are pair by pair [m], with their wavenumbers (n,) [rad/m].
    """
    _refuse_coarse(mesh, float(wavenumber.max()))
    # The mesh is traced once; facets are divided anew for each pair of antennas.
    corners = np.ascontiguousarray(mesh.corners)
    tracer = MeshTracer(use(select(variant)), corners, same=_SAME)
    solid = _Solid(tracer, smooth_bend(mesh.vertices, mesh.faces), mesh.closed)
    middle, one_pair = corners.mean(axis=(0, 1)), np.array([[0, 1]])
    field = np.empty(len(tx), dtype=np.complex128)
    for pair, k in enumerate(wavenumber):
        antennas = np.stack([tx[pair], rx[pair]])
        # First where waves bend over a facet, then where the edge of a shadow runs through it.
        divided, face = _divide_bent(corners, antennas, k)
        wide = bool(directions_apart(*(antennas - middle)) > NEAR)
        divided, face, seen = _divide_edges(solid, divided, face, antennas, k, wide)
        # About the middle of the mesh, so that paths keep their digits.
        own = (divided - middle).reshape(-1, 3), _own_faces(len(divided))
        facets = mesh_facets(*own, both_sides=not mesh.closed, bend=solid.bend[face])
        # The phase of the path over the origin, and the spreading to it, are taken out.
        ranges = np.linalg.norm(antennas, axis=1)
        path, k_there = np.full((1, 1, 1), ranges.sum()), np.full((1, 1), k)
        links = Links(antennas[None], one_pair, path, k_there, polarization, True, shadow=True)
        given = np.array([0]), (middle[None, None], np.eye(3)[None, None]), links
        value = radiated(facets, *given, Seen(given[0], seen), np.array([[0, 1]]))
        field[pair] = value.item() * ranges.prod()
    return field


def _own_faces(count: int) -> NDArray[np.int64]:
    """Faces (count, 3) whose corners are theirs alone."""
    return np.arange(3 * count).reshape(-1, 3)


def _refuse_coarse(triangles: Triangles, wavenumber: float) -> None:
    """Refuse a smooth mesh beyond ka = 400 that is coarser than a sphere of 6 (ka)^2 facets."""
    import trimesh  # slow to import

    vertices = triangles.vertices
    # The radius of the ball about the mesh stands for its radius of curvature.
    spread = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    radius = float(np.linalg.norm(spread, axis=1).max())
    ka = wavenumber * radius
    if ka <= LARGEST_KA:
        return
    mesh = trimesh.Trimesh(vertices, triangles.faces, process=False)
    angles = np.asarray(mesh.face_adjacency_angles)
    # Faces that meet at more than half a radian have an edge, those at less than a thousandth are
    # one plane: neither is part of a smooth surface.
    if np.count_nonzero((angles > 1e-3) & (angles < 0.5)) <= len(angles) / 2:
        return
    sphere = 4 * math.pi * radius**2
    needed = math.ceil(FACETS_PER_SQUARE_KA * ka**2 * float(mesh.area) / sphere)
    if len(mesh.faces) < needed:
        raise InputError(
            f"physical optics of a smooth mesh with ka = {ka:.0f}, above {LARGEST_KA:.0f}, needs "
            f"{needed} facets; it has {len(mesh.faces)}: mesh it finer"
        )


# -- division --------------------------------------------------------------------------------------


def _divide(
    corners: Array,
    face: NDArray[np.int64],
    coarse: Callable[[Array, NDArray[np.int64], int], tuple[NDArray[np.bool_], Array]],
    most: float = math.inf,
) -> tuple[Array, NDArray[np.int64], Array]:
    """Divide triangles (n, 3, 3), of the faces (n,), in four until none is too coarse.

    ``coarse(corners, face, level)`` returns which of them are, (n,), and a value of each, (n, ...);
    the values of the triangles that stay are returned.
    """
    done: list[tuple[Array, NDArray[np.int64], Array]] = []
    level = count = 0
    while len(corners):
        # Those that are fine enough stay, the others are cut in four and asked again.
        split, value = coarse(corners, face, level)
        done.append((corners[~split], face[~split], value[~split]))
        count += len(done[-1][0])
        corners, face, level = in_four(corners[split]), np.repeat(face[split], 4), level + 1
        if count + len(corners) > most:
            raise InputError(
                f"physical optics of this mesh from so near takes more than {_MOST_FACETS} facets; "
                "stand farther away, lower the frequency, or take 'specular' on ellipsoids"
            )
    corners, face, value = (np.concatenate(arrays) for arrays in zip(*done, strict=True))
    return corners, face, value


def _divide_bent(
    corners: Array, antennas: Array, wavenumber: float
) -> tuple[Array, NDArray[np.int64]]:
    """Divide facets until waves are plane over each; corners (n, 3, 3), and the triangles (n,)."""

    def coarse(corners: Array, _: NDArray[np.int64], __: int) -> tuple[NDArray[np.bool_], Array]:
        middle = corners.mean(axis=1)
        size = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        # The distance counts as no less than the size of the facet, so that an antenna on the
        # surface does not divide it for ever.
        distances = (np.maximum(np.linalg.norm(middle - a, axis=1), size) for a in antennas)
        bend = sum(wavenumber * size**2 / (2 * distance) for distance in distances)
        return bend > _BENT_PHASE, size

    return _divide(corners, np.arange(len(corners)), coarse, _MOST_FACETS)[:2]


def _divide_edges(
    solid: _Solid, corners: Array, face: Indices, antennas: Array, wavenumber: float, wide: bool
) -> tuple[Array, Indices, NDArray[np.float32]]:
    """Divide facets on edges of shadows of ``antennas``, a Tx and a Rx.

    Returns corners (n, 3, 3), the triangles (n,) that they belong to, and the fractions (2, n) that
    Tx lights and Rx receives. Antennas that are not ``wide`` apart both have to see a facet.
    """

    def coarse(corners: Array, face: Indices, level: int) -> tuple[NDArray[np.bool_], Array]:
        # Both antennas are asked, and facets in which the answers differ from point to point are
        # divided, down to a quarter of a wavelength.
        some = _Some.of(corners, face)
        lit = solid.lit(some, antennas[0])
        received = (
            solid.received(some, antennas[1], lit > 0) if wide else solid.lit(some, antennas[1])
        )
        seen = np.stack([lit, received], axis=1)
        edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        mixed = ((seen > 0) & (seen < 1)).any(axis=1) & (edge > math.pi / (2 * wavenumber))
        return mixed & (level < _DIVISIONS), seen

    corners, face, seen = _divide(corners, face, coarse)
    return corners, face, np.ascontiguousarray(seen.T, dtype=np.float32)


# -- what antennas see -----------------------------------------------------------------------------


class _Some(NamedTuple):
    """Facets: corners (n, 3, 3), the triangles (n,) they belong to, and unit normals (n, 3)."""

    corners: Array
    face: Indices
    normals: Array

    @classmethod
    def of(cls, corners: Array, face: Indices) -> _Some:
        normals, _ = facet_normals(corners.reshape(-1, 3), _own_faces(len(corners)))
        return cls(corners, face, normals)

    def facing(self, antenna: Array) -> Array:
        """Cosine (n,) between the normal and the way to an antenna."""
        way = antenna - self.corners.mean(axis=1)
        return np.asarray(np.sum(self.normals * way, axis=1) / np.linalg.norm(way, axis=1))


class _Solid(NamedTuple):
    """A mesh: its tracer, the ``bend (face,)`` of its triangles, and whether it is ``closed``."""

    tracer: MeshTracer
    bend: Array
    closed: bool

    def lit(self, some: _Some, antenna: Array) -> Array:
        """Fraction of four points of each facet that an antenna sees, 0 for those that face away.

        The smooth surface that a facet stands for may still face the antenna where the facet does
        not. Then the points are taken as far above the facet as that surface may be.
        """
        # Facets that face away count if their smooth surface may still face the antenna.
        facing = some.facing(antenna)
        chosen = np.flatnonzero((facing > -self.bend[some.face]) | (not self.closed))
        points = _FOUR @ some.corners[chosen]
        edges = some.corners[chosen] - np.roll(some.corners[chosen], 1, axis=1)
        lift = np.linalg.norm(edges, axis=2).max(axis=1) * self.bend[some.face[chosen]]
        lift = np.where((facing[chosen] <= 0) & self.closed, lift, 0.0)
        points = points + (lift[:, None] * some.normals[chosen])[:, None]
        return self._fractions(points, some.face[chosen], antenna, chosen, len(facing))

    def received(self, some: _Some, antenna: Array, lit: NDArray[np.bool_]) -> Array:
        """Fraction of four points of each lit facet from which nothing else hides an antenna.

        From a facet that faces away, the line leads through the solid first, which hides nothing.
        """
        # Facets that face the antenna are asked directly.
        behind = (some.facing(antenna) <= 0) & self.closed
        near, away = np.flatnonzero(lit & ~behind), np.flatnonzero(lit & behind)
        points = _FOUR @ some.corners[near]
        seen = self._fractions(points, some.face[near], antenna, near, len(lit))
        # From the others, rays leave through the solid, and are asked from where they come out.
        inside = (_FOUR @ some.corners[away]).reshape(-1, 3)
        normals, own = np.repeat(some.normals[away], 4, axis=0), np.repeat(some.face[away], 4)
        exits, met = self.tracer.way_out(inside, -normals, antenna, own)
        return seen + self._fractions(exits, met, antenna, away, len(lit))

    def _fractions(
        self, points: Array, own: Indices, antenna: Array, facets: Indices, count: int
    ) -> Array:
        """Fraction (count,) of four points of each of some facets that an antenna sees.

        ``points (n, 4, 3)`` or (4 n, 3) are on the faces ``own (n,)`` or (4 n,).
        """
        seen, places = np.zeros(count), points.reshape(-1, 3)
        if len(places):
            whose = np.repeat(own, len(places) // len(own))
            visible = self.tracer.sees(np.broadcast_to(antenna, places.shape), places, whose)
            seen[facets] = visible.reshape(-1, 4).mean(axis=1)
        return seen


# -- ellipsoids, and any target --------------------------------------------------------------------


_FEW_FACETS = 5120
"""Least number per ellipsoid."""

_VIEWS_AT_ONCE = 2**27
"""Size of the visibility that is held at a time [bytes]."""


def facet_scattering(
    target: Ellipsoids | trimesh.Trimesh,
    tx: Array,
    rx: Array,
    frequency: Array,
    polarization: Literal["v", "h"] = "v",
    variant: str = "auto",
    facets: int | None = None,
) -> NDArray[np.complex128]:
    """Co-polar scattering length (n,) by physical optics.

    Where Tx and Rx are up to 0.15 rad apart as the target sees them it is the reciprocal form of
    :eq:`po`, of what both see, as in a radar. More than 0.25 rad apart it is that of
    :eq:`po-bistatic`: the currents on all that Tx lights radiate to Rx wherever other parts do not
    stand between, through their own part too. Of a closed mesh, what stands between is what is met
    after the way has left it. There Tx and Rx may not be exchanged. In between one fades into the
    other. For each facet it is :eq:`facet`.

    Parameters, returns and errors are those of `scattering_length`; ``facets`` is the least number
    per ellipsoid, None for 0.1 dB up to ka = 400.
    """
    wavenumber = 2 * np.pi * np.asarray(frequency, dtype=np.float64) / SPEED_OF_LIGHT_MPS
    solid = target if isinstance(target, Ellipsoids) else target_mesh(target, tx, rx)
    if not isinstance(solid, Ellipsoids) and facets is not None:
        raise InputError(
            "facets: a mesh brings its own triangles; leave facets out, or subdivide the mesh"
        )
    sent = Polarization(polarization)
    if not isinstance(solid, Ellipsoids):
        return mesh_scattering(solid, tx, rx, wavenumber, sent, variant)
    count = partial(_enough_facets, solid, facets)
    field = _block_by_block(solid, (tx, rx, wavenumber), sent, variant, count, radiated).sum(axis=1)
    return np.asarray(field * np.linalg.norm(tx, axis=1) * np.linalg.norm(rx, axis=1))


def visible_fractions(
    target: Ellipsoids,
    tx: Array,
    rx: Array,
    frequency: Array,
    polarization: Literal["v", "h"],
    variant: str,
) -> NDArray[np.complex128]:
    """Visible fraction (n, part) of each part past the others, pair by pair.

    It is the sum over the facets of a part with shadows over the sum without, in the forms of
    `facet_scattering` but without forward scatter: 1 in full view, 0 where a part is hidden. There
    are four times as many facets as a moving body has, if a look at few facets tells that parts are
    cut.
    """
    # A look at few facets tells whether any part is cut at all.
    wavenumber = 2 * np.pi * np.asarray(frequency, dtype=np.float64) / SPEED_OF_LIGHT_MPS
    given = target, (tx, rx, wavenumber), Polarization(polarization), variant
    few = _block_by_block(*given, lambda *_: _FEW_FACETS, _hidden)
    if not few.any():
        return np.ones_like(few)

    def count(wavenumber: float) -> Indices:
        return np.minimum(4 * body_facets(target.semi_axes, wavenumber), MAXIMUM_FACETS)

    return _block_by_block(*given, count, visible)


def _hidden(*given: Any) -> NDArray[np.bool_]:
    """Whether parts are cut or hidden (pose, part, 1, 1), for what `visible` takes."""
    seen, index = given[-2:]
    return np.asarray(hidden_parts(seen)[index].any(axis=1)[..., None, None])


def _block_by_block(
    target: Ellipsoids,
    pairs: tuple[Array, Array, Array],
    polarization: Polarization,
    variant: str,
    count: Callable[[float], Indices | int],
    find: Callable[..., NDArray[Any]],
) -> NDArray[np.complex128]:
    """Return what `radiated` or `visible` finds of each part (n, part), near and far apart alike.

    ``pairs`` are Tx and Rx (n, 3) [m] and wavenumbers (n,) [rad/m]; ``count(wavenumber)`` gives the
    numbers of facets of the parts (part,), or one for all, that the largest of these needs.
    """
    tx, rx, wavenumber = pairs
    parts = np.arange(len(target.centres))
    found = np.empty((len(tx), len(parts)), dtype=np.complex128)
    # Pairs whose Tx and Rx are near each other need less of what is seen, so they are summed apart.
    to_tx, to_rx = (antennas[:, None] - target.centres for antennas in (tx, rx))
    apart = directions_apart(to_tx, to_rx).max(axis=1)
    for wide in (False, True):
        some = np.flatnonzero((apart > NEAR) == wide)
        if not len(some):
            continue
        enough = count(float(wavenumber[some].max()))
        shadows = FacetShadows(select(variant), target.semi_axes, enough)
        facets = shadows.facets
        # As many pairs at once as memory for their visibility allows.
        block = max(1, _VIEWS_AT_ONCE // (32 * len(facets.faces)))
        for first in range(0, len(some), block):
            own = some[first : first + block]
            ends = np.stack([tx[own], rx[own]], axis=1)
            # Visibility is asked once for each place where an antenna stands.
            antennas, index = np.unique(ends.reshape(-1, 3), axis=0, return_inverse=True)
            beyond = float(apart[own].max()) if wide else 0.0
            seen = shadows.seen(target.centres, target.frames, antennas, parts, apart=beyond)
            pose = tuple(
                np.repeat(array[None], len(own), axis=0)
                for array in (target.centres, target.frames)
            )
            # The path over the origin is the carrier of all parts, so that their fields can be
            # added.
            path = np.linalg.norm(ends, axis=2).sum(axis=1)[:, None, None]
            path = np.broadcast_to(path, (len(own), 1, len(parts)))
            k = wavenumber[own, None]
            links = Links(ends, np.array([[0, 1]]), path, k, polarization, True, shadow=True)
            given = facets, parts, pose, links, seen, index.reshape(-1, 2)
            found[own] = find(*given)[..., 0, 0]
    return found


def _enough_facets(target: Ellipsoids, facets: int | None, wavenumber: float) -> int:
    """Facets per part: those asked for, or as many as the thickest part takes."""
    # The thickest part decides, by its middle semi-axis.
    ka = wavenumber * float(np.median(target.semi_axes, axis=1).max())
    needed = max(_FEW_FACETS, math.ceil(FACETS_PER_SQUARE_KA * ka**2))
    if facets is not None:
        check_count(facets)
    if ka > LARGEST_KA and (facets is None or facets < needed):
        cure = (
            f"set facets={needed}"
            if needed <= MAXIMUM_FACETS
            else f"more than {MAXIMUM_FACETS} are not made: take 'specular'"
        )
        raise InputError(
            f"physical optics of a part with ka = {ka:.0f}, above {LARGEST_KA:.0f}, needs {needed} "
            f"facets an ellipsoid; {cure}"
        )
    return needed if facets is None else facets
