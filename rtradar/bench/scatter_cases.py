"""Cases of `rtradar.bench.kernel_table` for kernels of the tracer, of echo models and of rooms."""

from __future__ import annotations

from typing import Any

import numpy as np

from rtradar.bench.kernel_table import Calls, filled, kernel_case
from rtradar.kernels.scatter.facets import Views, Waves
from rtradar.kernels.scatter.nearby_points import Ellipsoids
from rtradar.kernels.scatter.specular_point import Geometry, Options, solve_reference
from rtradar.kernels.scatter.zones.fresnel_zones import CELLS, MERIDIANS, ZoneMaps, lay_zones
from rtradar.kernels.surface_currents import Equation
from rtradar.scatter.facets.surfaces import ellipsoid_facets

# -- tracing ---------------------------------------------------------------------------------------


@kernel_case("scatter.near_rays.near_rays", "rays of 3000 lines near 21 parts, counted by line", 0)
def _near_rays(k: Any) -> Calls:
    rng, parts = np.random.default_rng(0), 21
    origins = np.array([-4.0, 0, 0]) + rng.uniform(-0.2, 0.2, (3000, 3))
    lines = origins, rng.uniform(-0.9, 0.9, (3000, 3)), rng.integers(0, parts, 3000)
    frames = np.linalg.qr(rng.normal(size=(parts, 3, 3)))[0]
    body = rng.uniform(-0.9, 0.9, (parts, 3)), frames, rng.uniform(0.05, 0.3, (parts, 3))
    whose = np.arange(parts), np.zeros(parts, dtype=np.int64), body[0][None], body[1][None]

    def count() -> Any:
        return np.bincount(k.near_rays(*lines, *whose, body[2])[1], minlength=3000)

    return count, lambda: k.near_lines_reference(*lines, *body).sum(axis=1)


_WAVENUMBER = 300.0


def _zones(zones: int) -> Any:
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


@kernel_case("scatter.zones.fresnel_zones.lay_zones", "tangents of 200 Fresnel zones", 1e-9)
def _lay_zones(k: Any) -> Calls:
    maps, given = _zones(200)

    def tangents() -> Any:
        k.lay_zones(*given, np.full(200, _WAVENUMBER), maps)
        return np.einsum("zkj,zij->zki", maps.along, maps.stretch)

    def reference() -> Any:
        lay: Any = k.lay_zones_reference
        return np.stack([lay(*zone, _WAVENUMBER) for zone in zip(*given, strict=True)])

    return tangents, reference


@kernel_case(
    "scatter.zones.fresnel_zones.zone_points", "10 000 points on ellipsoids, along great circles"
)
def _zone_points(k: Any) -> Calls:
    rng, (maps, _) = np.random.default_rng(0), _zones(200)
    given = maps, rng.integers(0, 200, 10_000), *rng.uniform(-7, 7, (2, 10_000))
    call = filled(k.zone_points, *given, out=(np.empty((10_000, 3)),))
    return call, lambda: k.zone_points_reference(*given)


@kernel_case(
    "scatter.zones.edge_search.expected_edges", "edge of a shadow on sides of 100 zones", 0
)
def _expected_edges(k: Any) -> Calls:
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

    out = np.empty(100, dtype=np.int64)
    call = filled(k.expected_edges, *sides, *body, bisections, out=(out,))
    return call, lambda: k.expected_edges_reference(*sides[:4], hidden, bisections)


@kernel_case(
    "scatter.zones.zone_edges.open_fractions", "cells of a zone cut by an edge, counted", 0.06
)
def _open_fractions(k: Any) -> Calls:
    (maps, _), line = _zones(1), (np.cos(0.4), np.sin(0.4), 1.7)
    bounds = np.arange(0, CELLS + 1, 4)
    given = maps, k.straight_edge(maps, line, bounds), bounds
    call = filled(k.open_fractions, *given, out=(np.empty((1, 1, MERIDIANS, CELLS)),))
    return call, lambda: k.open_fractions_reference(maps.rim[0], line)


@kernel_case("scatter.zones.fresnel_zones.zone_sums", "V of a zone, 3 antennas", 1e-9)
def _zone_sums(k: Any) -> Calls:
    rng, (maps, given) = np.random.default_rng(0), _zones(1)
    antennas, pairs = given[0] + rng.normal(0, 0.1, (3, 3)), np.array([[0, 1], [2, 1]])
    fractions = np.clip(rng.uniform(-0.5, 1.5, (3, k.MERIDIANS, k.CELLS)), 0, 1)
    wavenumber, out = np.array([[_WAVENUMBER]]), np.empty((1, 1, 2), dtype=np.complex128)
    rest = given[5], antennas[None], pairs, wavenumber, fractions[None]
    call = filled(k.zone_sums, maps, *rest, out=(out,))
    return call, lambda: k.zone_sums_reference(maps, 0, antennas, pairs, _WAVENUMBER, fractions)


@kernel_case(
    "scatter.zones.fresnel_zones.blend_fractions", "fractions of 21 parts at 100 chirps, 8 Rx"
)
def _blend_fractions(k: Any) -> Calls:
    rng = np.random.default_rng(0)
    nodes, slopes = rng.normal(size=(2, 9, 3, 18, 21, 2)) @ [1, 1j]
    fine, where = rng.uniform(size=21) < 0.3, np.sort(rng.uniform(0, 8, 100))
    given = nodes, slopes, fine, where, rng.normal(size=(100, 8, 18))
    out = np.empty((3, 100, 8, 21), dtype=np.complex128)
    call = filled(k.blend_fractions, *given, np.arange(100), out=(out,))
    return call, lambda: k.blend_fractions_reference(*given)


@kernel_case("scatter.facet_rays.facet_rays", "rays to 300 vertices of 6 parts, counted", 0)
def _facet_rays(k: Any) -> Calls:
    rng, parts, antennas = np.random.default_rng(0), np.array([4, 1, 2]), 2
    u = rng.normal(size=(6, 3, 300))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    axes, centres = rng.uniform(0.05, 0.25, (6, 3)), rng.uniform(-0.4, 0.4, (6, 3))
    frames = np.linalg.qr(rng.normal(size=(6, 3, 3)))[0]
    places = np.array([-4.0, 0, 0]) + rng.normal(0, 0.3, (antennas, 3))
    given = places, parts, centres, frames, axes, u * axes[:, :, None]

    def count() -> Any:
        slots = k.facet_rays(*given, 0.0)[1][0]
        return np.bincount(slots, minlength=antennas * 900).reshape(antennas, 3, 300)

    return count, lambda: k.facet_rays_reference(*given)


@kernel_case("scatter.facet_rays.first_occluders", "the part met first of 5000 rays", 0)
def _first_occluders(k: Any) -> Calls:
    rng, found = np.random.default_rng(0), np.empty(3000, dtype=np.int16)
    rays = rng.uniform(size=5000) < 0.5, rng.uniform(size=5000).astype(np.float32)
    whose = np.stack([rng.integers(0, 3000, 5000), rng.integers(0, 21, 5000)])

    def call() -> Any:
        found[:] = -1
        k.first_occluders(*rays, whose, found)
        return found

    return call, lambda: k.first_occluders_reference(*rays, whose, 3000)


@kernel_case("scatter.footprints.radiate_tubes", "2000 footprints of ray tubes to one Rx", 1e-3)
def _radiate_tubes(k: Any) -> Calls:
    rng, count = np.random.default_rng(0), 2000
    places = rng.normal(0, 0.3, (count, 1, 3)) + rng.normal(0, 0.004, (count, 4, 3))
    places[:, 3] = places[:, :3].mean(axis=1)
    directions, fields = rng.normal(size=(2, count, 3))
    path = 4 + rng.uniform(0, 0.01, (count, 4))
    tubes = k.Tubes(places, path, directions, -directions, fields, np.zeros(count, dtype=np.int64))
    rx, wavenumber = np.array([[-4.0, 0.5, 0.2]]), np.array([_WAVENUMBER])
    out, length = np.empty((8, 1, 1, 1), dtype=np.complex128), np.full((1, 1), 8.0)
    given = tubes, np.ones((1, count), dtype=np.bool_), rx, wavenumber, length
    call = filled(k.radiate_tubes, 0, 8, *given, False, True, False, out=(out,), adds=True)
    reference = (tubes, rx[0], _WAVENUMBER, 8.0)
    return lambda: call()[0].sum(), lambda: k.radiate_tubes_reference(*reference)


# -- specular points and facets --------------------------------------------------------------------


def _geometry(chirps: int, receivers: int, parts: int) -> Any:
    rng = np.random.default_rng(0)
    frames = np.linalg.qr(rng.normal(size=(chirps, parts, 3, 3)))[0]
    return Geometry(
        rng.normal(0, 0.2, (chirps, 3)),
        rng.normal(0, 0.2, (chirps, receivers, 3)),
        np.array([4.0, 0.0, 1.0]) + rng.normal(0, 0.4, (chirps, parts, 3)),
        frames * np.linalg.det(frames)[..., None, None],
        rng.uniform(0.06, 0.2, (parts, 3)),
    )


@kernel_case("scatter.specular_point.solve", "21 ellipsoids, 100 chirps, 8 receivers", 1e-6)
def _specular_points(k: Any) -> Calls:
    at = _geometry(100, 8, 21)
    start, shape = np.full(at.centres.shape, np.nan), (100, 8, 21)
    given = 0, 100, at, start, k.Options(polarized=False, horizontal=False, spreading=True)
    out = np.empty(shape), np.empty(shape), np.empty((*shape, 3))
    return filled(k.solve, *given, out=out), lambda: k.solve_reference(at)


@kernel_case(
    "scatter.double_reflections.solve_double", "3 pairs of ellipsoids, one chirp, 2 receivers", 2e-3
)
def _double_reflections(k: Any) -> Calls:
    # In a row across the line of sight, so that all pairs reflect.
    at = _geometry(1, 2, 3)._replace(
        centres=np.array([[[4.0, 0.7 * n, 1.0 - 0.1 * n] for n in range(3)]])
    )
    pairs = np.array([[0, 1], [2, 1], [0, 2]])
    options = Options(polarized=True, horizontal=False, spreading=True)
    shape, start = (1, 2, 3), np.full((1, 3, 2, 3), np.nan)
    out = np.empty(shape), np.empty(shape)
    points = np.empty((*shape, 2, 3))

    def run() -> tuple[np.ndarray, ...]:
        k.solve_double(0, 1, at, pairs, start.copy(), options, *out, points)
        return out

    return run, lambda: k.solve_double_reference(at, pairs, horizontal=False)


@kernel_case("scatter.nearby_points.nearby_echoes", "147 echoes, 100 chirps, 8 receivers", 0.03)
def _nearby_points(k: Any) -> Calls:
    at, part, zero = _geometry(1, 8, 147), np.arange(147), np.zeros(100, dtype=np.int64)
    points = solve_reference(at._replace(rx=at.rx.mean(axis=1, keepdims=True)))[2][0, 0]
    local = np.einsum("pji,pj->pi", at.frames[0], points - at.centres[0]).astype(np.float32)
    places = np.broadcast_to(local, (1, 1, 2, 147, 3)).copy()
    ends = np.broadcast_to([0.5, 0.5], (100, 2)).copy()
    wanted = np.ones((1, 1, 147), dtype=bool)
    near = k.Nearby(places, places, wanted, zero, zero, np.linspace(0, 1, 100), ends)
    rx = np.ascontiguousarray(at.rx[None, :1].swapaxes(2, 3))
    middle = at.rx.mean(axis=1)[None]
    images = k.Images(at.tx[None], rx, middle, 0 * part, 0 * part, part)
    centres, frames = (np.repeat(array, 100, axis=0) for array in at[2:4])
    given = images, zero, k.Ellipsoids(centres, frames, at.semi_axes)
    out = np.empty((100, 8, 147)), np.empty((100, 8, 147))
    call = filled(k.nearby_echoes, 0, 100, *given, near, out=out)
    return call, lambda: k.nearby_echoes_reference(*given)


@kernel_case("scatter.far_field.far_field", "21 ellipsoids, 1000 chirps, 8 receivers")
def _far_field(k: Any) -> Calls:
    at = _geometry(1000, 8, 21)
    out = np.empty((1000, 8, 21)), np.empty((1000, 8, 21))
    return filled(k.far_field, 0, 1000, at, True, out=out), lambda: k.far_field_reference(at, True)


def _views(parts: int) -> tuple[Any, Any, Any]:
    at = _geometry(1, 2, parts)
    facets, rows = ellipsoid_facets(at.semi_axes, 3), np.arange(2 * parts).reshape(parts, 2)
    local = np.einsum("pji,paj->pai", at.frames[0], at.rx[0] - at.centres[0][:, None])
    # Facets that both antennas see by a margin.
    height = np.einsum("pfi,pai->paf", facets.normals, local)
    plane = np.einsum("pfi,pfi->pf", facets.normals, facets.vertices[:, facets.faces[:, 0]])
    seen = np.repeat((height > plane[:, None] + 0.5).all(axis=1), 2, axis=0).astype(np.float32)
    pair, k = np.array([[0, 1]]), np.full((parts, 1), 250.0)
    carrier = np.linalg.norm(local, axis=2).sum(axis=1)[:, None]
    return facets, Views(np.arange(parts), local, rows, seen), Waves(pair, carrier, k, True)


@kernel_case("scatter.facets.integrate", "1280 facets of 21 ellipsoids, one pair", 1e-3)
def _facet_integral(k: Any) -> Calls:
    given, out = _views(21), np.empty((21, 1, 1), dtype=np.complex128)
    return filled(k.integrate, 0, 21, *given, out=(out,)), lambda: k.integrate_reference(*given)


@kernel_case("scatter.facet_shadows.shade", "1280 facets of 21 ellipsoids, two antennas", 0.06)
def _facet_shadows(k: Any) -> Calls:
    at = _geometry(1, 2, 21)
    facets, pose = ellipsoid_facets(at.semi_axes, 3), (*(array[0] for array in at[2:4]), at[4])
    rng, parts = np.random.default_rng(1), np.arange(21)
    # Vertices on one side of a plane through each part are occluded by the next part.
    hidden = facets.vertices @ rng.normal(size=3) > 0.02
    hidden_by = np.where(hidden, (parts[:, None] + 1) % 21, -1)[None].repeat(2, axis=0)
    corners = np.ascontiguousarray(facets.faces.T, dtype=np.uint32)
    given = hidden_by, at.rx[0].copy(), parts, pose, facets.vertices, corners
    row, out = np.empty((2, 21), dtype=np.int64), np.empty((43, 1280), dtype=np.float32)

    def call() -> Any:
        k.shade(*given, row, out)
        return out[row]

    return call, lambda: k.shade_reference(*given)


def _courses() -> tuple[Any, ...]:
    """Three neighbouring intervals of an envelope, each known at some of the places."""
    rng, size = np.random.default_rng(0), (9, 3, 16, 21)
    known = rng.uniform(size=(3, 9, 21)) < 0.4
    known[:, [0, 8]] = True
    ratio = rng.normal(size=(3, *size)) + 1j * rng.normal(size=(3, *size))
    ratio[1:, 0] = ratio[:2, 8]
    intervals = [(r * k[:, None, None], k) for r, k in zip(ratio, known, strict=True)]
    return tuple(intervals)


@kernel_case("scatter.envelope.find_slopes", "9 places, 3 nodes, 16 pairs, 21 parts")
def _slopes(k: Any) -> Calls:
    given, slope = _courses(), np.zeros((9, 3, 16, 21), dtype=np.complex128)
    return filled(k.find_slopes, True, *given, out=(slope,)), lambda: k.find_slopes_reference(
        *given
    )


@kernel_case("scatter.envelope.fill_envelope", "50 chirps, 3 nodes, 16 pairs, 8 receivers")
def _envelope(k: Any) -> Calls:
    rng, (ratio, known) = np.random.default_rng(2), _courses()[1]
    course = ratio, rng.normal(size=ratio.shape) + 0j, known
    tx, weights = np.arange(50) % 6, rng.normal(size=(6, 8, 16))
    strength = rng.normal(size=(50, 8, 21))
    given = np.arange(50), np.arange(50) / 50, tx, weights, course, strength
    out = np.empty((3, 50, 8, 21), dtype=np.complex128)
    return filled(k.fill_envelope, *given, out=(out,)), lambda: k.fill_envelope_reference(*given)


# -- rooms -----------------------------------------------------------------------------------------


@kernel_case("scatter.rooms.path_amplitudes", "273 echoes, 100 chirps, 8 receivers, 3 nodes", 1e-5)
def _path_amplitudes(k: Any) -> Calls:
    rng, shape = np.random.default_rng(0), (2, 2, 4, 273)
    before, after = (
        k.PathFactors(
            rng.normal(size=(2, 3, *shape, 2)).astype(np.float32).view(np.complex64)[..., 0],
            rng.random((2, *shape)) > 0.2,
        )
        for _ in range(2)
    )
    interval, line = rng.integers(0, 2, (2, 100))
    ends = rng.random((100, 2)), rng.random((100, 8, 4))
    at = k.Blend(interval, rng.random(100), line, *ends)
    given = rng.normal(size=(100, 8, 273)), before, after, at
    out = (np.empty((3, 100, 8, 273), dtype=np.complex64),)
    call = filled(k.path_amplitudes, 0, 100, *given, out=out)
    return call, lambda: k.path_amplitudes_reference(*given)


@kernel_case("scatter.rooms.delayed_lengths", "273 echoes, 100 chirps, 8 receivers, 3 passages")
def _delayed_lengths(k: Any) -> Calls:
    rng, at = np.random.default_rng(0), _geometry(100, 8, 21)
    antennas = k.LegAntennas(*(rng.normal(-5, 1, shape) for shape in ((2, 4, 3), (2, 4, 8, 3))))
    points = k.PartPoints(rng.normal(size=(100, 273, 3)), np.arange(273) % 21)
    slabs = [[1.0, 0, 0, 0.1, 4.0], [0, 0.6, 0.8, 0.2, 3.0], [0, 1.0, 0, 0.05, 2.5]]
    # Without a slab, with two of them on the way out, and with one on each way.
    legs = [[[0, 0, 0], [1, 0, 0]], [[0, 0, 2], [0, 2, 2]], [[1, 1, 2], [0, 2, 3]]] * 91
    passes = np.array([1, 2, 3])
    delays = k.SlabDelays(np.arange(273), np.array(legs), passes, np.array(slabs))
    bodies, tx = Ellipsoids(*at[2:]), rng.integers(0, 4, 100)
    given = antennas, tx, points, bodies, delays, 8 + rng.random((100, 8, 273))
    call = filled(k.delayed_lengths, 0, 100, *given, out=(np.empty((100, 8, 273)),))
    return call, lambda: k.delayed_lengths_reference(*given)


def _unit_vectors(rng: np.random.Generator, *shape: int) -> np.ndarray:
    vectors = rng.normal(size=(*shape, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _fields(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.normal(size=(*shape, 3, 2)).view(np.complex128)[..., 0]


@kernel_case("scatter.mirrors.slab_fields", "5000 waves at 3 nodes after five terms of a slab")
def _slab_fields(k: Any) -> Calls:
    rng = np.random.default_rng(0)
    normal, wavenumber = np.array([0.48, 0.6, 0.64]), _WAVENUMBER * np.array([0.9, 1.0, 1.1])
    slab = normal, np.array([5.2 - 0.3j, 5.1 - 0.3j, 5.0 - 0.2j]), wavenumber, 0.1, 1e-3
    kinds = [(0.0, 0, True), (0.0, 1, True), (5.1, 0, False), (5.1, 3, False), (5.1, 4, True)]
    slabs = [k.SlabPass(*slab, *kind) for kind in kinds]
    given = _fields(rng, 3, 5000), _unit_vectors(rng, 5000)
    out = np.empty((len(slabs), 3, 5000, 3), dtype=np.complex128)

    def call() -> np.ndarray:
        for one, own in zip(slabs, out, strict=True):
            k.slab_fields(*given, one, own)
        return out

    return call, lambda: np.array([k.slab_fields_reference(*given, one) for one in slabs])


@kernel_case("scatter.mirrors.received_from_conductors", "273 echoes, 8 keyframes, 3 nodes")
def _received_from_conductors(k: Any) -> Calls:
    rng, ends = np.random.default_rng(0), (8, 2, 2, 273)
    given = *(_fields(rng, 3, *ends) for _ in "tr"), *(_unit_vectors(rng, *ends) for _ in "tr")
    out = (np.empty((3, 8, 2, 2, 2, 273), dtype=np.complex128),)
    call = filled(k.received_from_conductors, 0, 8, *given, out=out)
    return call, lambda: k.received_from_conductors_reference(*given)


# -- objects that move -----------------------------------------------------------------------------


@kernel_case(
    "scatter.facets_by_length.facets_by_length", "echoes of 32 facets at 8 chirps, added up", 2e-3
)
def _facets_by_length(k: Any) -> Calls:
    rng, chirps, receivers = np.random.default_rng(0), 8, 4
    across = np.linspace(-0.06, 0.06, 5)
    corner = np.stack(np.meshgrid([0.0], across, across), axis=-1).reshape(-1, 3)
    square = (np.arange(4)[:, None] * 5 + np.arange(4)).reshape(-1, 1)
    faces = np.concatenate([np.add(square, [0, 1, 6]), np.add(square, [0, 6, 5])])
    vertices = np.concatenate([corner, corner[faces].mean(axis=1)]).T
    count = len(faces)
    normals, areas = np.tile([1.0, 0.0, 0.0], (count, 1)), np.full(count, 0.03**2 / 2)
    facets = k.RigidFacets(
        np.ascontiguousarray(vertices), faces, normals, np.zeros(count), areas, False
    )
    angle, pose = rng.uniform(-1, 1, chirps), np.arange(chirps)
    tx = 40 * np.stack([np.cos(angle), np.sin(angle), np.zeros(chirps)], axis=1)
    rx = tx[:, None] + rng.uniform(-0.05, 0.05, (chirps, receivers, 3))
    factor = rng.normal(size=(chirps, 3, count)) + 1j * rng.normal(size=(chirps, 3, count))
    views = k.RigidViews(
        tx, rx, pose, pose, np.zeros(chirps), np.ones((chirps, 1, count), dtype=np.float32),
        np.ones((chirps, 1)), np.ones((chirps, receivers, 1)), factor,
    )  # fmt: skip
    wavenumber, step = _WAVENUMBER * np.array([0.9, 1.0, 1.1]), 0.025
    grid = k.LengthGrid(-40, step, wavenumber, 0.14, np.exp(-1j * wavenumber * step))
    out = np.empty((chirps, receivers, 3, 80), dtype=np.complex128)
    fill = filled(k.facets_by_length, 0, chirps, facets, views, grid, True, out=(out,), adds=True)
    turned = np.exp(1j * wavenumber[:, None] * step * (grid.first + np.arange(80)))

    def added() -> Any:
        fill()
        return (out * turned).sum(axis=3)

    return added, lambda: k.facets_by_length_reference(facets, views, grid, True)


# -- static clutter --------------------------------------------------------------------------------


@kernel_case(
    "scatter.silhouettes.occluded_fractions", "shadow of 4 parts and a triangle on 20 legs", 3e-3
)
def _occluded_fractions(k: Any) -> Calls:
    rng, table = np.random.default_rng(1), k.wave_table(0.1)
    starts = np.array([-4.0, 0, 1.0]) + rng.uniform(-0.3, 0.3, (20, 3))
    ends = np.array([3.0, 0, 1.2]) + rng.uniform(-0.5, 0.5, (20, 3))
    length = np.linalg.norm(ends - starts, axis=1)
    axes, frames = rng.uniform(0.05, 0.25, (4, 3)), np.linalg.qr(rng.normal(size=(4, 3, 3)))[0]
    centres = np.array([0, 0, 1.1]) + rng.uniform(-0.3, 0.3, (4, 3))
    maps = np.ascontiguousarray(np.swapaxes(frames, 1, 2) / axes[:, :, None])
    triangle = np.array([[[0.3, -0.4, 0.7], [0.1, 0.3, 0.8], [-0.2, 0.1, 1.4]]])
    body = centres, maps, axes.max(axis=1), triangle, np.zeros(1, dtype=bool)
    given = (starts, ends, np.zeros(20), 1.3 * length), 0.0214, body
    scales = np.array([0.87, 1.13])
    out = np.empty((20, 2), dtype=np.complex128)
    call = filled(k.occluded_fractions, *given, 4.0, 400, scales, table, out=(out,))
    return call, lambda: (k.occluded_fractions_reference(*given, scales, 0.1),)


@kernel_case("elementary.add_blended", "four keyframes of a room, blended over 500 chirps", 1e-5)
def _add_blended(k: Any) -> Calls:
    rng = np.random.default_rng(0)
    fields = rng.normal(size=(5, 4, 2, 3000)).view(np.complex128).astype(np.complex64)[..., :1500]
    keyframes, whole = fields[:4], np.ascontiguousarray(fields[4].reshape(4, -1))
    keyframes = np.ascontiguousarray(keyframes.reshape(4, 4, -1))
    weights = k.cubic_weights(np.linspace(0, 1, 500)).astype(np.float32)
    tx, out = np.arange(500) % 4, np.zeros((500, 3000), dtype=np.complex64)
    call = filled(k.add_blended, tx, weights, keyframes, whole, out=(out,), adds=True)
    return call, lambda: (k.add_blended_reference(tx, weights, keyframes, whole),)


# -- full wave -------------------------------------------------------------------------------------


def _octahedron() -> Any:
    """Octahedron with two mirror planes, whose opposite triangles are near without touching."""
    from rtradar.full_wave.surfaces_mesh import ClosedMesh
    from rtradar.full_wave.surfaces_quadrature import rules

    vertices = np.array([[1.2, 0, 0], [-0.9, 0, 0], *np.eye(3)[1:], *-np.eye(3)[1:]])
    ring = [2, 3, 4, 5]
    faces = [
        face
        for one, other in zip(ring, np.roll(ring, -1), strict=True)
        for face in ((0, one, other), (1, other, one))
    ]
    return ClosedMesh(vertices, np.array(faces)), rules(3)


@kernel_case(
    "surface_integrals.fill_matrices", "matrices of an octahedron with two mirror planes", 1e-9
)
def _fill_matrices(k: Any) -> Calls:
    mesh, rules = _octahedron()
    given = mesh.triangles, mesh.orbits, rules, Equation(3.0, 0.8)
    count = 1 + int(mesh.orbits.unknown.max())
    out = np.zeros((4, count, count), dtype=np.complex128)
    call = filled(k.fill_matrices, *given, out=(out,), adds=True)
    return call, lambda: k.matrices_reference(*given)


@kernel_case("surface_currents.fill_moments", "fields of two dipoles on 8 triangles", 1e-9)
def _fill_moments(k: Any) -> Calls:
    mesh, rules = _octahedron()
    dipoles = np.array([[[2.0, 1.0, 1.0], [0.0, 0.6, 0.8]], [[30.0, 20.0, -1.0], [1.0, 0.0, 0.0]]])
    given = mesh.triangles, mesh.edge_of, rules, Equation(3.0, 0.8), dipoles
    out = np.zeros((2, 2, mesh.unknowns), dtype=np.complex128)
    call = filled(k.fill_moments, *given, out=(out,), adds=True)
    return call, lambda: k.moments_reference(*given)
