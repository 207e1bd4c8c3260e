"""Surfaces as flat triangles fixed in the material, and what these radiate from Tx to Rx.

Triangles move and turn with the part they belong to, so that what they add stays coherent from
chirp to chirp. Their vertices are kept in the axes of the part; antennas are brought there, not
triangles to the antennas.

What they radiate is, for a radar, the reciprocal form of physical optics, over what both antennas
see. Where Tx and Rx are far apart as the target sees them, the currents on all that Tx lights
count. From `NEAR` to `WIDE` the one form fades into the other.
"""

from __future__ import annotations

from collections.abc import Sequence, Sized
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import MAXIMUM_SUBDIVISIONS, geodesic_sphere
from rtradar.errors import InputError
from rtradar.kernels.elementary import smoothstep
from rtradar.kernels.scatter.facets import Facets, Views, Waves, integrate
from rtradar.scatter.common.polarization import Polarization, copolar, driven_currents, unit
from rtradar.system.checks import is_whole
from rtradar.system.threads import thread_map

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Indices = NDArray[np.int64]

MAXIMUM_FACETS = 20 * 4**MAXIMUM_SUBDIVISIONS
"""Facets of one ellipsoid beyond which no sphere is built."""

_LEAST_FACETS = 1280
"""Least number of facets of a part of a body, where the wavelength would take fewer."""

LARGEST_KA = 400.0
"""Facets for 0.1 dB are chosen up to this ka; above it users name them or give a finer mesh."""

FACETS_PER_SQUARE_KA = 6.0
"""Facets of a sphere over (ka)^2 for 0.07 dB of the closed form, which its terminator takes."""

_EDGE = 0.5
"""Angle between the normals of a triangle and a vertex [rad] above which a mesh has an edge."""


def check_count(facets: int) -> None:
    """Raise `InputError` where a number of facets of an ellipsoid is out of range."""
    if not is_whole(facets) or not 20 <= facets <= MAXIMUM_FACETS:
        raise InputError(
            f"facets = {facets!r}; it must be a whole number from 20 to {MAXIMUM_FACETS}, "
            "counted per ellipsoid"
        )


def body_facets(semi_axes: NDArray[np.float64], wavenumber: float) -> Indices:
    """Facets (part,) that a body takes, for ``semi_axes (part, 3)`` [m] and a wavenumber [rad/m].

    The sag of a facet, seen as phase, is about 10 ka / facets; 100 a unit of ka keep it near
    0.1 rad, where a is the geometric mean of the middle and the longest semi-axis: seen from its
    end a long part bends over its length. A grown person takes 1280 to 4500 at 12 to 16 GHz, and
    7000 to 22 000 at 77 to 81 GHz. What is left out of the field is measured in
    ``validation/other_methods/facets.py``.
    """
    _, middle, longest = np.sort(semi_axes, axis=1).T
    wanted = np.ceil(100 * wavenumber * np.sqrt(middle * longest))
    return np.clip(wanted, _LEAST_FACETS, MAXIMUM_FACETS).astype(np.int64)


def ellipsoid_facets(semi_axes: NDArray[np.float64], counts: Indices | int) -> Facets:
    """Return the facets of ellipsoids, ``semi_axes (part, 3)`` [m]: stretched spheres.

    Each has at least as many facets as ``counts`` asks for. Their rise is :eq:`facet-rise` of the
    theory page.
    """
    # A geodesic sphere of frequency n has 20 n^2 facets; each part is one, stretched by its
    # semi-axes.
    frequencies = np.ceil(np.sqrt(np.broadcast_to(counts, len(semi_axes)) / 20)).astype(int)
    spheres = [geodesic_sphere(frequency) for frequency in frequencies.tolist()]
    faces, ends = joined(spheres)
    points = np.concatenate([own for own, _ in spheres])
    # A copy, for a read-only array is another type to Numba.
    own = np.array(semi_axes, dtype=np.float64)
    axes = np.repeat(own, np.diff(ends[:, 0]), axis=0)
    # The normal of the ellipsoid at a vertex is along the place over the squared semi-axes.
    vertices, smooth = points * axes, points / axes
    smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
    normals, areas = facet_normals(vertices, faces)
    # Half the width of a uniform spread with the variance that a linear function has over the
    # triangle, by the mean over directions along the surface: sum u^2 / 12 = h^2 / 3, and half of
    # |n_i - n|^2 lies along any one of them.
    swing = np.sum((smooth[faces] - normals[:, None]) ** 2, axis=(1, 2))
    # (1 - |x|^2) / 2 in the mean over a triangle in the unit sphere, stretched along the normal.
    square = (points[faces] ** 2).sum(axis=(1, 2)) + (points[faces].sum(axis=1) ** 2).sum(axis=1)
    stretched = np.linalg.norm(normals * axes[faces[:, 0]], axis=1)
    rise = (1 - square / 12) / 2 * stretched
    bend = np.sqrt(swing / 8)
    return Facets(vertices, faces, normals, areas, bend, rise, ends, semi_axes=own)


def joined(parts: Sequence[tuple[Sized, Indices]]) -> tuple[NDArray[np.int32], Indices]:
    """Put parts one after the other: vertices, and faces (n, 3); return all faces and the ends."""
    ends = np.cumsum([(0, 0), *((len(own), len(faces)) for own, faces in parts)], axis=0)
    faces = one_after_the_other([own for _, own in parts], np.diff(ends[:, 0]).tolist())
    return faces.astype(np.int32), ends


def one_after_the_other(several: Sequence[Indices], counts: Sequence[int]) -> Indices:
    """Join indices into arrays of these lengths to indices into all arrays put together."""
    firsts = np.cumsum([0, *counts[:-1]])
    return np.concatenate([own + first for own, first in zip(several, firsts, strict=True)])


def mesh_facets(
    vertices: NDArray[np.float64],
    faces: NDArray[np.integer],
    *,
    both_sides: bool,
    bend: NDArray[np.float64] | None = None,
) -> Facets:
    """Facets of a mesh, ``vertices (vertex, 3)`` [m], ``faces (facet, 3)``, without empty ones.

    Their ``bend (facet,)`` is that of `smooth_bend`, or none.
    """
    whole, chosen = np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int32)
    normals, areas = facet_normals(whole, chosen)
    solid = areas > 0
    swing = (np.zeros(len(chosen)) if bend is None else bend)[solid]
    ends = np.array([(0, 0), (len(whole), len(swing))])
    rise = np.zeros_like(swing)
    return Facets(whole, chosen[solid], normals[solid], areas[solid], swing, rise, ends, both_sides)


def smooth_bend(vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> NDArray[np.float64]:
    """Estimate how far the normal swings over the surface that a flat triangle stands for (facet,).

    See `Facets`. The normal at a vertex is the mean of those around it, weighted by area; where one
    of them is more than half a radian off, the mesh has an edge, which is sharp.
    """
    corners = np.asarray(faces, dtype=np.int32)
    normals, areas = facet_normals(vertices, corners)
    # The normal at each vertex, as the mean of its facets' by area.
    total = np.zeros_like(vertices)
    np.add.at(total, corners, (normals * areas[:, None])[:, None])
    size = np.linalg.norm(total, axis=1, keepdims=True)
    total /= np.where(size > 0, size, 1.0)
    # How far each facet's normal is from those at its corners, except at vertices on an edge.
    apart = np.sum((total[corners] - normals[:, None]) ** 2, axis=2)
    farthest = np.zeros(len(vertices))
    np.maximum.at(farthest, corners, apart)
    return np.sqrt(np.where(farthest[corners] < _EDGE**2, apart, 0.0).sum(axis=1) / 8)


def facet_normals(
    vertices: NDArray[np.float64], faces: NDArray[np.integer]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit normals (facet, 3) and areas (facet,) [m^2] of triangles."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    twice = np.linalg.norm(normals, axis=1)
    normals /= np.where(twice > 0, twice, 1.0)[:, None]
    return normals, twice / 2


# -- radiation -------------------------------------------------------------------------------------


NEAR, WIDE = 0.15, 0.25
"""Distances of the unit vectors to Tx and to Rx between which the forms fade into each other."""

FORWARD = 2 * np.sin(np.radians([165.0, 175.0]) / 2)
"""Distances between which the reciprocal form, which has no forward scatter, returns where a body
is not to cast its shadow on the way from Tx to Rx: clutter has that already."""

_MOST_LEFT = 2.0
"""Most that a visible fraction may be: what the first Fresnel zone alone sends."""

_PARALLEL_TERMS = 4_000_000
"""Facets times pairs times frequencies, 12 ms, below which waking threads costs as much as work."""


class Links(NamedTuple):
    """Pairs of antennas before a target in some poses, and the waves between them.

    ``antennas (pose, antenna, 3)`` [m], world, of which ``pairs (pair, 2)`` are Tx and Rx;
    ``length (pose, pair, part)`` is the path whose phase is taken out [m], ``wavenumber (pose,
    node)`` [rad/m], or (1, node) for all poses. With ``spreading`` fields are divided by R_T R_R;
    without ``shadow`` there is no scatter straight ahead.
    """

    antennas: Array
    pairs: Indices
    length: Array
    wavenumber: Array
    polarization: Polarization
    spreading: bool
    shadow: bool


class Seen(NamedTuple):
    """What eyes, the places from which visibility is asked, see of the facets of parts.

    The facets of each part begin at ``first (part,)``. Seen is their ``fraction (eye, facet)``,
    which need not mark facets that face away, and ``edge`` as in `Views`.
    """

    first: Indices
    fraction: NDArray[np.float32]
    edge: NDArray[np.float32] = np.empty((0, 0, 3), dtype=np.float32)


Pose = tuple[Array, Array]
"""Centres (pose, part, 3) [m] and axes (pose, part, 3, 3) of parts."""


def radiated(
    facets: Facets,
    parts: Indices,
    pose: Pose,
    links: Links,
    seen: Seen,
    index: NDArray[np.integer],
) -> Field:
    """Return the scattering length F of posed parts (pose, part, pair, node) [m].

    It is for exp(+j omega t), and 0 where nothing is lit. ``parts (part,)`` are the numbers, among
    the parts of the facets, of the parts of the pose; ``index (pose, antenna)`` is the eye that
    each antenna of the links is.
    """
    centres, frames = pose
    nodes, shape = links.wavenumber.shape[1], centres.shape[:2]
    # One task for each pose and part, with the antennas in the axes of the part.
    ways = links.antennas[:, None] - centres[:, :, None]
    views = Views(
        np.tile(parts, shape[0]),
        np.einsum("tpji,tpaj->tpai", frames, ways).reshape(-1, *ways.shape[2:]),
        np.repeat(index, shape[1], axis=0),
        np.tile(seen.first, shape[0]),
        seen.fraction,
        seen.edge,
    )
    carrier = np.swapaxes(links.length, 1, 2).reshape(-1, len(links.pairs))
    k = np.broadcast_to(links.wavenumber[:, None], (*shape, nodes)).reshape(-1, nodes)
    waves = Waves(links.pairs, carrier, k, links.spreading)
    # Reciprocal form or currents, by how far Tx and Rx are apart.
    to_tx, to_rx = (ways[:, :, links.pairs[:, side]] for side in (0, 1))
    given = to_tx, to_rx, frames, links.polarization
    waves, factor = with_obliquity(waves, *given, shadow=links.shadow)
    field = facet_integral(facets, views, waves).reshape(*factor.shape, nodes)
    return np.asarray(field * factor[..., None])


def visible(
    facets: Facets,
    parts: Indices,
    pose: Pose,
    links: Links,
    seen: Seen,
    index: NDArray[np.integer],
) -> Field:
    """Return the fraction of the `radiated` field that shadows leave, without forward scatter.

    It is the sum over the facets of a part with shadows over the sum without: 0 where there is
    nothing, and no more than `_MOST_LEFT` where the whole sum nearly cancels, as beyond the limits
    of optics.
    """
    # Parts in full view need no sum.
    cut = np.flatnonzero(hidden_parts(seen).any(axis=0))
    size = *pose[0].shape[:2], len(links.pairs), links.wavenumber.shape[1]
    left = np.ones(size, dtype=np.complex128)
    if len(cut):
        own = parts[cut], (pose[0][:, cut], pose[1][:, cut])
        links = links._replace(length=links.length[..., cut], shadow=False)
        seen = seen._replace(first=seen.first[cut])
        # The same sum with what the eyes see, and with all facets seen.
        shadowed = radiated(facets, *own, links, seen, index)
        all_seen = Seen(np.zeros_like(cut), np.ones_like(seen.fraction[:1]))
        free = radiated(facets, *own, links, all_seen, np.zeros_like(index))
        some = free != 0
        fraction = np.where(some, shadowed / np.where(some, free, 1.0), 0.0)
        # Where the whole sum nearly cancels the fraction would grow without limit.
        fraction /= np.maximum(np.abs(fraction) / _MOST_LEFT, 1.0)
        left[:, cut] = np.where(some & (shadowed == free), 1.0, fraction)
    return left


def hidden_parts(seen: Seen) -> NDArray[np.bool_]:
    """Whether anything of a part is hidden from an eye, (eye, part)."""
    least: Array = np.minimum.reduceat(seen.fraction, seen.first, axis=1)
    return np.asarray(least < 1)


def as_amplitude(field: Field) -> Field:
    """Turn scattering lengths (pose, part, pair, node) into amplitudes (node, pose, pair, part)."""
    return np.asarray(np.conj(np.moveaxis(field, (3, 0, 2, 1), (0, 1, 2, 3))))


def directions_apart(to_tx: Array, to_rx: Array) -> Array:
    """Distance (...) between the unit vectors along ``to_tx`` and ``to_rx (..., 3)``, 0 to 2."""
    return np.asarray(np.linalg.norm(unit(to_tx) - unit(to_rx), axis=-1))


def with_obliquity(
    waves: Waves,
    to_tx: Array,
    to_rx: Array,
    frames: Array,
    polarization: Polarization,
    *,
    shadow: bool,
) -> tuple[Waves, Array]:
    """Return waves with the obliquities of their pairs, and the factor (pose, part, pair) left.

    ``to_tx`` and ``to_rx (pose, part, pair, 3)`` are the ways from the parts to the antennas [m],
    ``frames (pose, part, 3, 3)`` the axes of the parts. Where all antennas are near each other the
    factor is the co-polar fraction, and no currents are computed. Without ``shadow`` there is no
    scatter straight ahead. Unit vectors of polarisation are those at the middle of a part: for a
    sphere of radius a between antennas at R, that leaves forward scatter too weak by 4 a / (3 R).
    """
    apart = directions_apart(to_tx, to_rx)
    factor = copolar(to_tx, to_rx, polarization)
    if not (apart > NEAR).any():
        return waves, factor
    # The weight of the currents: 0 for antennas near each other, 1 for antennas far apart.
    fade = smoothstep(np.clip((apart - NEAR) / (WIDE - NEAR), 0.0, 1.0))[..., None]
    if not shadow:
        ahead = np.clip((apart - FORWARD[0]) / (FORWARD[1] - FORWARD[0]), 0.0, 1.0)
        fade = fade * (1 - smoothstep(ahead))[..., None]
    # Coefficients of both obliquities; the vector is brought into the axes of the part, where the
    # normals are.
    along, across = driven_currents(to_tx, to_rx, polarization)
    across = np.einsum("...ji,...nj->...ni", frames, across)
    parts = [fade * along[..., None], fade * across, (1 - fade) * factor[..., None], fade]
    currents = np.concatenate(parts, axis=-1).reshape(-1, apart.shape[-1], 6)
    return waves._replace(currents=currents), np.ones_like(factor)


def facet_integral(facets: Facets, views: Views, waves: Waves) -> NDArray[np.complex128]:
    """Scattering length F of posed parts, the phase of a carrier taken out, (task, pair, node) [m].

    It is for exp(+j omega t), and 0 where nothing is lit. `Views` need not mark what faces away.
    """
    views, waves = Views(*map(_own, views)), Waves(*map(_own, waves))
    tasks = len(views.part)
    shape = tasks, len(waves.pairs), waves.wavenumber.shape[1]
    out = np.empty(shape, dtype=np.complex128)
    # Few terms are summed in one thread, for waking others would cost as much.
    terms = out.size * len(facets.faces) / (len(facets.ends) - 1)
    at_once = 1 if terms >= _PARALLEL_TERMS else max(1, tasks)
    thread_map(
        lambda first: integrate(first, min(first + at_once, tasks), facets, views, waves, out),
        range(0, tasks, at_once),
    )
    return out


def _own(value: Any) -> Any:
    # A read-only array is another type to Numba, for which it would compile everything again.
    return np.require(value, None, ["C", "W"]) if isinstance(value, np.ndarray) else value
