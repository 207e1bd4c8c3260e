"""How much of an ellipsoid's return is left behind others: its Fresnel zones, added up.

On cells along the meridians of `rtradar.kernels.scatter.zones.fresnel_zones`

    V = sum w g f exp(-jk dL) / sum w g exp(-jk dL),     g = (n.s_T + n.s_R) / (R_T R_R) dS,

with dL exact in float64 for each pair of antennas, f the open fraction of a cell, and w a window
that falls to 0 at the rim: without it the rim itself would diffract. Mitsuba decides whether an
antenna sees a corner of a cell. Where it sees one end of a side and not the other, a closed form
says where to look for the edge, and more rays confirm it to 1 / 16384 of the side. So V changes
smoothly as an edge wanders over the zones, and is exactly 1 in full view and 0 behind.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.errors import InputError
from rtradar.kernels.scatter.zones.edge_search import expected_edges
from rtradar.kernels.scatter.zones.fresnel_zones import (
    CELLS,
    MERIDIANS,
    ZoneMaps,
    lay_zones,
    zone_points,
    zone_sums,
)
from rtradar.kernels.scatter.zones.zone_edges import Edges, open_fractions
from rtradar.system.checks import is_whole
from rtradar.system.threads import thread_map
from rtradar.trace.body_tracer import BodyTracer

BISECTIONS = 13
"""How often a side of a cell is halved for the piece that its edge is on. As an edge wanders in
steps of 0.002 zones, second differences of V are 2e-4 if 11 times, 6e-5 if 13 times, and would be
5e-6 with exact edges."""

_PIECES = 1 << BISECTIONS

_AT_ONCE = 216
"""Pairs of a zone and an antenna whose rays are traced together, `SHADOW_RAYS` to each zone."""

SHADOW_RAYS, LEAST_SHADOW_RAYS, MOST_SHADOW_RAYS = 400, 8, 4096
"""Points on each part to which rays are traced from each antenna, before edges are looked for."""

Array = NDArray[np.float64]
Bounds = NDArray[np.int64]


class Zones(NamedTuple):
    """Fresnel zones on parts of a body.

    ``tx``, ``rx``, ``points (zone, 3)``: the pair that a zone is laid out for, and its specular
    point [m]; ``part``, ``pose (zone,)``: which part of the body it is on, in which pose;
    ``antennas (zone, antenna, 3)`` that look at it [m]; ``laid_for (zone,)``: the wavenumber that
    it is laid out for [rad/m].
    """

    tx: Array
    rx: Array
    points: Array
    part: NDArray[np.int64]
    pose: NDArray[np.int64]
    antennas: Array
    laid_for: Array


def zone_fractions(
    tracer: BodyTracer,
    zones: Zones,
    poses: Poses,
    pairs: NDArray[np.int64],
    wavenumber: Array,
    shadow_rays: int = SHADOW_RAYS,
) -> NDArray[np.complex128]:
    """Fraction V that is left of the return of each zone's part, for exp(+j omega t).

    The result is (zone, frequency, pair): 1 in full view, 0 occluded; in between its modulus may
    pass 1, as it does beyond any edge, but never 2. Zones come pose after pose of the tracer's
    body; ``pairs (pair, 2)`` are Tx and Rx among their antennas, ``wavenumber (zone, frequency)``
    those at which V is wanted [rad/m]. To about ``shadow_rays`` points on each part rays are traced
    from each antenna: a whole number on each meridian. An `InputError` is raised if it is out of
    range.
    """
    bounds = bounds_of(shadow_rays)
    out = np.ones((len(zones.part), wavenumber.shape[1], len(pairs)), dtype=np.complex128)
    step = max(1, _AT_ONCE * SHADOW_RAYS // (shadow_rays * zones.antennas.shape[1]))

    def fill(begin: int) -> None:
        own = slice(begin, begin + step)
        some = Zones._make(np.ascontiguousarray(field[own]) for field in zones)
        maps = _maps(some, poses)
        edges = _edges(tracer, some, poses, maps, bounds)
        cut = np.flatnonzero(edges.blocked.any(axis=(1, 2, 3)) & maps.exists)
        if len(cut):
            maps, edges = ZoneMaps._make(a[cut] for a in maps), Edges._make(a[cut] for a in edges)
            given = (some.points[cut], some.antennas[cut], pairs, wavenumber[own][cut])
            out[begin + cut] = _sums(maps, edges, bounds, *given)

    thread_map(fill, range(0, len(out), step))
    return out


@lru_cache(maxsize=64)
def bounds_of(shadow_rays: int) -> Bounds:
    """Return where wide cells begin and end along a meridian, counted in cells.

    Near the specular point each is one cell, and farther out as wide as a fixed fraction of the
    distance from it, because what an edge does near that point counts most
    (`validation/other_methods/fresnel.py`, power beside the Doppler line). An `InputError` is
    raised if ``shadow_rays`` is out of range.
    """
    if not (is_whole(shadow_rays) and LEAST_SHADOW_RAYS <= shadow_rays <= MOST_SHADOW_RAYS):
        raise InputError(
            f"fresnel: shadow_rays = {shadow_rays!r}; it must be a whole number from "
            f"{LEAST_SHADOW_RAYS} to {MOST_SHADOW_RAYS}"
        )
    growths = [*((1, n) for n in range(1, CELLS + 1)), *((n, 1) for n in (2, 4, 8, CELLS))]
    graded = (_graded(*growth) for growth in growths)
    nearest = min(graded, key=lambda bounds: abs(len(bounds) - 1 - shadow_rays / MERIDIANS))
    nearest.flags.writeable = False  # shared
    return nearest


def _graded(times: int, over: int) -> Bounds:
    """Return bounds of wide cells, each ``times / over`` of its distance wide, and at least 1."""
    bounds = [0]
    while bounds[-1] < CELLS:
        bounds.append(min(bounds[-1] + max(1, bounds[-1] * times // over), CELLS))
    return np.array(bounds)


def _maps(zones: Zones, poses: Poses) -> ZoneMaps:
    maps = ZoneMaps.empty(len(zones.part))
    body = (poses.centres[zones.pose, zones.part], poses.frames[zones.pose, zones.part])
    shape = poses.semi_axes[zones.part]
    lay_zones(zones.tx, zones.rx, *body, shape, zones.points, zones.laid_for, maps)
    return maps


def _edges(tracer: BodyTracer, zones: Zones, poses: Poses, maps: ZoneMaps, bounds: Bounds) -> Edges:
    """Trace rays to the corners of the wide cells, and find the edges on the sides between them."""
    n, antennas = zones.antennas.shape[:2]
    bands = len(bounds) - 1
    rho = maps.rim[:, :, None] * bounds / CELLS
    angle = np.arange(MERIDIANS)[:, None] * 2 * np.pi / MERIDIANS
    # (zone, meridian, corner, x or y) in the plane of rho.
    corners = np.stack([rho * np.cos(angle), rho * np.sin(angle)], axis=-1)
    # The specular point once, and all others.
    places = corners[:, :, 1:].reshape(n, -1, 2)
    places = np.concatenate([np.zeros((n, 1, 2)), places], axis=1)
    count = places.shape[1]
    zone = np.repeat(np.arange(n), count)
    targets = _points(maps, zone, places.reshape(-1, 2)).reshape(n, 1, count, 3)
    shape = (n, antennas, count, 3)
    origins = np.broadcast_to(zones.antennas[:, :, None], shape).reshape(-1, 3)
    ends = np.broadcast_to(targets, shape).reshape(-1, 3)
    whose = (zones.part, zones.pose, poses)
    group = np.repeat(np.arange(n), antennas * count)
    seen = tracer.clear(origins, ends, group, *whose)
    hidden = ~seen.reshape(n, antennas, count)
    blocked = np.empty((n, antennas, MERIDIANS, bands + 1), dtype=np.bool_)
    blocked[..., 0] = hidden[..., :1]
    blocked[..., 1:] = hidden[..., 1:].reshape(n, antennas, MERIDIANS, bands)

    # The sides of cells whose ends differ: first along the meridians, then from one to the next.
    after = np.roll(blocked, -1, axis=2)
    sides = [np.nonzero(blocked[..., 1:] != blocked[..., :-1]), np.nonzero(after != blocked)]
    lengths = [len(side[0]) for side in sides]
    z, a, m, j = (np.concatenate(index) for index in zip(*sides, strict=True))
    along = np.arange(len(z)) < lengths[0]
    first = corners[z, m, j]
    last = np.where(
        along[:, None], corners[z, m, np.minimum(j + 1, bands)], corners[z, (m + 1) % MERIDIANS, j]
    )
    # From the open end to the blocked one.
    swap = blocked[z, a, m, j][:, None]
    start, way = np.where(swap, last, first), np.where(swap, first - last, last - first)
    piece = _pieces(tracer, maps, (z, start, way, zones.antennas[z, a]), whose)
    found = start + ((piece + 0.5) / _PIECES)[:, None] * way
    radial = np.zeros((n, antennas, MERIDIANS, bands, 2))
    ring = np.zeros((n, antennas, MERIDIANS, bands + 1, 2))
    radial[sides[0]], ring[sides[1]] = np.split(found, lengths[:1])
    return Edges(blocked, radial, ring)


def _pieces(
    tracer: BodyTracer,
    maps: ZoneMaps,
    sides: tuple[NDArray[np.int64], Array, Array, Array],
    whose: tuple[NDArray[np.int64], NDArray[np.int64], Poses],
) -> NDArray[np.int64]:
    """On which of `_PIECES` equal pieces of each side (zone, start, way, antenna) the edge is.

    Rays are traced to both ends of the piece on which a closed form expects the edge. Where they do
    not confirm it, rays go to the pieces beside it, ever farther away, and to the middle of what is
    left.
    """
    zone, start, way, origins = sides
    expected = _expected(maps, sides, whose)
    low, high = np.zeros_like(expected), np.full_like(expected, _PIECES)  # open, and blocked
    reach = 0
    while len(rest := np.flatnonzero(high - low > 1)):
        middle = (low[rest] + high[rest]) // 2
        asked = [expected[rest] - reach, expected[rest] + 1 + reach]
        asked = [np.where((low[rest] < at) & (at < high[rest]), at, middle) for at in asked]
        side, at = np.tile(rest, 2), np.concatenate(asked)
        places = _points(maps, zone[side], start[side] + (at / _PIECES)[:, None] * way[side])
        seen = tracer.clear(origins[side], places, zone[side], *whose)
        for one, is_open in zip(asked, np.split(seen, 2), strict=True):
            inside = (low[rest] < one) & (one < high[rest])
            low[rest[inside & is_open]] = one[inside & is_open]
            high[rest[inside & ~is_open]] = one[inside & ~is_open]
        reach = 2 * reach + 1
    return low


def _expected(
    maps: ZoneMaps,
    sides: tuple[NDArray[np.int64], Array, Array, Array],
    whose: tuple[NDArray[np.int64], NDArray[np.int64], Poses],
) -> NDArray[np.int64]:
    part, pose, poses = whose
    out = np.empty(len(sides[0]), dtype=np.int64)
    some = [*sides, part, pose, poses.centres, poses.frames, poses.semi_axes]
    expected_edges(maps, *(np.ascontiguousarray(a) for a in some), BISECTIONS, out)
    return out


def _points(maps: ZoneMaps, zone: NDArray[np.int64], places: Array) -> Array:
    """Points (n, 3) on the ellipsoids [m] at places (n, 2) in the plane of rho."""
    out = np.empty((len(zone), 3))
    zone_points(maps, zone, *np.ascontiguousarray(places.T), out)
    return out


def _sums(
    maps: ZoneMaps,
    edges: Edges,
    bounds: Bounds,
    points: Array,
    antennas: Array,
    pairs: NDArray[np.int64],
    wavenumber: Array,
) -> NDArray[np.complex128]:
    out = np.empty((len(points), wavenumber.shape[1], len(pairs)), dtype=np.complex128)
    fractions = np.empty((*edges.blocked.shape[:3], CELLS))
    open_fractions(maps, edges, bounds, fractions)
    wavenumber = np.ascontiguousarray(wavenumber)
    zone_sums(maps, points, antennas, pairs, wavenumber, fractions, out)
    return out
