"""Fresnel zones on ellipsoids: points on them, edges through them, and sums over them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from references.cases import Pair, filled, kernel_case
from rtradar.kernels.scatter.zones.edge_search import expected_edges
from rtradar.kernels.scatter.zones.fresnel_zones import (
    _TAPER,
    CELLS,
    MERIDIANS,
    RIM,
    ZoneMaps,
    blend_fractions,
    lay_zones,
    zone_points,
    zone_sums,
)
from rtradar.kernels.scatter.zones.zone_edges import Edges, open_fractions

_WAVENUMBER = 300.0


def _zones(zones: int) -> tuple[ZoneMaps, tuple[np.ndarray, ...]]:
    """Zones of a monostatic radar 4 m from ellipsoids: maps, and the arguments of `lay_zones`."""
    rng = np.random.default_rng(0)
    axes, centres = rng.uniform(0.05, 0.2, (zones, 3)), rng.uniform(-0.5, 0.5, (zones, 3))
    frames = np.linalg.qr(rng.normal(size=(zones, 3, 3)))[0]
    u = rng.normal(size=(zones, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    points = centres + np.einsum("zij,zj->zi", frames, axes * u)
    normals = np.einsum("zij,zj->zi", frames, u / axes)
    radars = points + 4 * normals / np.linalg.norm(normals, axis=1, keepdims=True)
    given, maps = (radars, radars, centres, frames, axes, points), ZoneMaps.empty(zones)
    lay_zones(*given, np.full(zones, _WAVENUMBER), maps)
    return maps, given


# -- zones and points on them ----------------------------------------------------------------------


def lay_zones_reference(tx, rx, centre, frame, axes, point, wavenumber):
    """Tangents (2, 3) of one zone on the ellipsoid [m], whose Gram matrix is 2 / k H^-1."""
    normal = frame @ ((point - centre) @ frame / axes**2)
    size = np.linalg.norm(normal)
    normal /= size
    e = np.array([-normal[1], normal[0], 0.0]) / np.hypot(normal[0], normal[1])
    tangents = np.stack([e, np.cross(normal, e)])
    hessian = np.zeros((2, 2))
    for antenna in (tx, rx):
        distance = np.linalg.norm(antenna - point)
        way = (antenna - point) / distance
        ahead = tangents @ way
        curved = tangents @ frame / axes
        hessian += (np.eye(2) - np.outer(ahead, ahead)) / distance
        hessian += way @ normal / size * curved @ curved.T
    values, vectors = np.linalg.eigh(hessian)
    return (vectors / np.sqrt(wavenumber / 2 * values) @ vectors.T) @ tangents


@kernel_case(lay_zones, 1e-9)
def _lay_zones() -> Pair:
    maps, given = _zones(50)
    tangents = np.einsum("zkj,zij->zki", maps.along, maps.stretch)
    zones = zip(*given, strict=True)
    return tangents, np.stack([lay_zones_reference(*zone, _WAVENUMBER) for zone in zones])


def zone_points_reference(maps, zone, x, y):
    """Points (n, 3) of `zone_points` along great circles."""
    tangent = np.einsum("nk,nki->ni", np.stack([x, y], axis=1), maps.along[zone])
    turn = np.linalg.norm(tangent, axis=1)[:, None]
    u = np.cos(turn) * maps.pole[zone] + np.sinc(turn / np.pi) * tangent
    return maps.centre[zone] + np.einsum("nij,nj->ni", maps.stretch[zone], u)


@kernel_case(zone_points, 1e-13)
def _zone_points() -> Pair:
    rng, (maps, _) = np.random.default_rng(0), _zones(50)
    given = maps, rng.integers(0, 50, 1000), *rng.uniform(-7, 7, (2, 1000))
    return filled(zone_points, *given, out=(np.empty((1000, 3)),)), zone_points_reference(*given)


# -- edges -----------------------------------------------------------------------------------------


def expected_edges_reference(maps, zone, start, way, hidden, bisections):
    """Pieces (side,) of `expected_edges`, where ``hidden`` says it of points seen on a side."""
    pieces, found = np.arange(1 << bisections) / (1 << bisections), []
    for side, (z, first, along) in enumerate(zip(zone, start, way, strict=True)):
        x, y = (first + pieces[:, None] * along).T
        seen = ~hidden(side, zone_points_reference(maps, np.full(len(x), z), x, y))
        found.append(np.flatnonzero(seen)[-1])
    return np.array(found)


@kernel_case(expected_edges, 0)
def _expected_edges() -> Pair:
    (maps, (radars, *_, points)), bisections = _zones(100), 8
    # The zone of each pose is on part 0, and a ball stands before its specular point.
    zone, ball, radius = np.arange(100), points + 0.1 * (radars - points), 0.01
    start, angles = maps.rim[:, 0].max() * np.ones((100, 2)), np.linspace(0, 6, 100)
    start *= np.stack([np.cos(angles), np.sin(angles)], axis=1)
    sides = maps, zone, start, -start, radars
    centres, frames = np.stack([points, ball], axis=1), np.tile(np.eye(3), (100, 2, 1, 1))
    body = np.zeros(100, dtype=np.int64), zone, centres, frames, np.full((2, 3), radius)

    def hidden(n: int, ends: Any) -> Any:
        line, there = ends - radars[n], ball[n] - radars[n]
        square = np.sum(line * line, axis=1)
        return there @ there - (line @ there) ** 2 / square < radius**2

    found = filled(expected_edges, *sides, *body, bisections, out=(np.empty(100, dtype=np.int64),))
    return found, expected_edges_reference(*sides[:4], hidden, bisections)


def straight_edge(maps, line, bounds):
    """Make the `Edges` of one zone and antenna along a x + b y + c = 0, blocked where negative."""
    angle = 2j * np.pi * np.arange(MERIDIANS)[:, None] / MERIDIANS
    corners = maps.rim[0, :, None] * bounds / CELLS * np.exp(angle)
    value = line[0] * corners.real + line[1] * corners.imag + line[2]
    found = [value < 0]
    # Sides along meridians, and from each meridian to the next.
    pairs = [((a[:, :-1], a[:, 1:]), (a, np.roll(a, -1, axis=0))) for a in (corners, value)]
    for (first, last), (low, high) in zip(*pairs, strict=True):
        rise = np.where(low == high, 1.0, low - high)
        place = first + (last - first) * low / rise
        found.append(np.stack([place.real, place.imag], axis=-1))
    return Edges._make(array[None, None] for array in found)


def open_fractions_reference(rim, line, samples=64):
    """Fractions (meridian, cell) of one zone on the positive side of a x + b y + c, by counting."""
    a, b, c = line
    part = (np.arange(samples) + 0.5) / samples
    t, j = part[:, None], np.arange(CELLS)[:, None, None] + part
    out = np.empty((MERIDIANS, CELLS))
    for m in range(MERIDIANS):
        ends = [rim[k % MERIDIANS] * np.exp(2j * np.pi * k / MERIDIANS) / CELLS for k in (m, m + 1)]
        # Chords from one meridian to the next.
        place = j * ((1 - t) * ends[0] + t * ends[1])
        inside = a * place.real + b * place.imag + c > 0
        weight = np.broadcast_to(j, inside.shape)
        out[m] = (inside * weight).sum(axis=(1, 2)) / weight.sum(axis=(1, 2))
    return out


# The reference counts places; cells next to the specular point are far from parallelograms.
@kernel_case(
    open_fractions,
    0.06,
    bounds=((0, 16, 32, 48), (0, 1, 2, 4, 7, 12, 20, 33, 48), range(49)),
    distance=(0.3, 1.7, -2.6),
)
def _open_fractions(bounds: Sequence[int], distance: float) -> Pair:
    maps, ends = ZoneMaps.empty(1), np.array(bounds)
    maps.rim[0] = np.random.default_rng(0).uniform(5, 7, MERIDIANS)
    line, out = (np.cos(0.4), np.sin(0.4), distance), (np.empty((1, 1, MERIDIANS, CELLS)),)
    (found,) = filled(open_fractions, maps, straight_edge(maps, line, ends), ends, out=out)
    assert 0.1 < (found == 1).mean() < 0.9
    return found, open_fractions_reference(maps.rim[0], line)


# -- sums ------------------------------------------------------------------------------------------


def meridians_reference(maps, zone):
    """Directions (meridian, 3) between corners, paces and rims (meridian, 1) of `_meridian`."""
    angle = (np.arange(MERIDIANS)[:, None] + 0.5) * 2 * np.pi / MERIDIANS
    step = np.cos(angle) * maps.along[zone, 0] + np.sin(angle) * maps.along[zone, 1]
    pace = np.linalg.norm(step, axis=1, keepdims=True)
    ahead, aside = maps.caps[zone] @ maps.pole[zone], step / pace @ maps.caps[zone].T
    ends = np.arctan2(aside, ahead) + np.arccos(np.minimum(1, 1 / np.hypot(ahead, aside)))
    return step / pace, pace, np.minimum(RIM, ends.min(axis=1, keepdims=True) / pace)


def zone_sums_reference(maps, zone, antennas, pairs, wavenumber, fractions):
    """V (pair,) of one zone at one wavenumber, for ``fractions (antenna, meridian, cell)``."""
    step, pace, rim = meridians_reference(maps, zone)
    part = (np.arange(CELLS) + 0.5) / CELLS
    turn = (part * rim * pace)[..., None]
    u = np.cos(turn) * maps.pole[zone] + np.sin(turn) * step[:, None]
    window = np.cos(np.pi / 2 * np.maximum(part - _TAPER, 0) / (1 - _TAPER)) ** 2
    legs = antennas[:, None, None] - maps.centre[zone] - u @ maps.stretch[zone].T
    length = np.linalg.norm(legs, axis=-1)
    facing = (legs * (u @ maps.back[zone])).sum(axis=-1) / length
    wave = np.where(facing > 0, np.exp(-1j * wavenumber * length) / length, 0)
    t, r = pairs.T
    field = np.sin(turn[..., 0]) * rim / pace * window * (facing[t] + facing[r]) * wave[t] * wave[r]
    left = (np.minimum(fractions[t], fractions[r]) * field).sum(axis=(1, 2))
    return left / field.sum(axis=(1, 2))


@kernel_case(zone_sums, 1e-9)
def _zone_sums() -> Pair:
    rng, (maps, given) = np.random.default_rng(0), _zones(1)
    antennas, pairs = given[0] + rng.normal(0, 0.1, (3, 3)), np.array([[0, 1], [2, 1]])
    fractions = np.clip(rng.uniform(-0.5, 1.5, (3, MERIDIANS, CELLS)), 0, 1)
    wavenumber, out = np.array([[_WAVENUMBER]]), (np.empty((1, 1, 2), dtype=np.complex128),)
    rest = given[5], antennas[None], pairs, wavenumber, fractions[None]
    found = filled(zone_sums, maps, *rest, out=out)
    return found, zone_sums_reference(maps, 0, antennas, pairs, _WAVENUMBER, fractions)


def blend_fractions_reference(nodes, slopes, fine, where, spread):
    """Fractions (frequency, chirp, rx, part) of `blend_fractions`, by SciPy's cubics."""
    last = len(nodes) - 1
    out = np.empty((nodes.shape[1], *spread.shape[:2], nodes.shape[3]), dtype=np.complex128)
    for part in range(nodes.shape[3]):
        used = np.arange(last + 1) if fine[part] else np.array([0, last])
        cubic = CubicHermiteSpline(used, nodes[used, ..., part], slopes[used, ..., part])
        out[..., part] = np.einsum("crp,cfp->fcr", spread, cubic(where))
    return out


@kernel_case(blend_fractions)
def _blend_fractions() -> Pair:
    rng = np.random.default_rng(0)
    nodes, slopes = rng.normal(size=(2, 9, 3, 18, 21, 2)) @ [1, 1j]
    fine, where = rng.uniform(size=21) < 0.3, np.sort(rng.uniform(0, 8, 31))
    given, out = (nodes, slopes, fine, where, rng.normal(size=(31, 3, 18))), (3, 31, 3, 21)
    out = (np.empty(out, dtype=np.complex128),)
    found = filled(blend_fractions, *given, np.arange(31), out=out)
    return found, blend_fractions_reference(*given)
