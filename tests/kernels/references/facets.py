"""Integrals over facets and footprints, and the shadows on them, by small pieces of each."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from scipy.spatial.transform import Rotation

from references.cases import Pair, filled, kernel_case
from references.specular_point import geometry
from rtradar.kernels.scatter.facet_shadows import shade
from rtradar.kernels.scatter.facets import Facets, Views, Waves, integrate
from rtradar.kernels.scatter.facets_by_length import (
    LengthGrid,
    RigidFacets,
    RigidViews,
    facets_by_length,
)
from rtradar.kernels.scatter.triangles import Tubes, radiate_tubes
from rtradar.scatter.facets.radiation import ellipsoid_facets

_WAVENUMBER = 300.0


def midpoints(cuts):
    """Barycentric middles (cuts^2, 3) of small triangles that one is cut into."""
    i, j = (index.ravel() for index in np.indices((cuts, cuts)))
    both = np.concatenate([np.stack([i + t, j + t], axis=1) for t in (1 / 3, 2 / 3)])
    places = np.column_stack([both, cuts - both.sum(axis=1)]) / cuts
    return places[places[:, 2] > 0]


def integrate_reference(facets, views, waves):
    """`integrate` without currents over facets that are lit, by middles of small triangles."""
    corners = facets.vertices[facets.faces] + (facets.rise[:, None] * facets.normals)[:, None]
    out = np.empty((*waves.carrier.shape, waves.wavenumber.shape[1]), dtype=complex)
    for task, part in enumerate(views.part):
        own = slice(*facets.ends[part : part + 2, 1])
        away = views.antennas[task][:, None, None] - corners[own]
        ranges = np.linalg.norm(away, axis=-1)
        middle = ranges.mean(axis=2)
        facing = np.einsum("afx,fx->af", away[:, :, 0], facets.normals[own]) / middle
        size = views.seen[views.row[task], own] * facets.areas[own]
        for pair, (t, r) in enumerate(waves.pairs):
            strength = (facing[t] + facing[r]) / 2 * np.minimum(size[t], size[r])
            strength /= middle[t] * middle[r] if waves.spreading else 1.0
            some = strength > 0
            path = (ranges[t] + ranges[r])[some] @ midpoints(20).T - waves.carrier[task, pair]
            for node, k in enumerate(waves.wavenumber[task]):
                total = strength[some] @ np.exp(-1j * k * path).mean(axis=1)
                out[task, pair, node] = 1j * k / math.sqrt(math.pi) * total
    return out


def _views(parts: int) -> tuple[Facets, Views, Waves]:
    at = geometry(1, 2, parts)
    # Of each part as many as it takes.
    facets, rows = ellipsoid_facets(at.semi_axes, 1280 >> np.arange(parts)), np.array([[0, 1]])
    local = np.einsum("pji,paj->pai", at.frames[0], at.rx[0] - at.centres[0][:, None])
    # Facets that both antennas see by a margin.
    whose = np.repeat(np.arange(parts), np.diff(facets.ends[:, 1]))
    height = np.einsum("fi,fai->af", facets.normals, local[whose])
    plane = np.einsum("fi,fi->f", facets.normals, facets.vertices[facets.faces[:, 0]])
    seen = np.tile((height > plane + 0.5).all(axis=0).astype(np.float32), (2, 1))
    rows = np.repeat(rows, parts, axis=0)
    pair, k = np.array([[0, 1]]), np.full((parts, 1), 250.0)
    carrier = np.linalg.norm(local, axis=2).sum(axis=1)[:, None]
    views = Views(np.arange(parts), local, rows, facets.ends[:-1, 1].copy(), seen)
    return facets, views, Waves(pair, carrier, k, True)


@kernel_case(integrate, 1e-3)
def _integrate() -> Pair:
    given, out = _views(2), (np.empty((2, 1, 1), dtype=np.complex128),)
    return filled(integrate, 0, 2, *given, out=out), integrate_reference(*given)


def shade_reference(hidden_by, antennas, parts, pose, vertices, corners, ends):
    """Fractions (antenna, facet) of `shade`, by many points of each facet."""
    (centres, frames, axes), out = pose, np.empty((len(antennas), corners.shape[1]))
    for a, part in product(range(len(antennas)), parts):
        (first, begin), (_, end) = ends[part : part + 2]
        faces, fraction = corners.T[begin:end] - first, out[a, begin:end]
        occluder = hidden_by[a][corners.T[begin:end]]
        world = centres[part] + vertices[first : ends[part + 1, 0]] @ frames[part].T
        least = np.full(faces.shape, np.inf)
        for other in set(occluder.ravel()) - {-1}:
            clear = _clearance(antennas[a], world, centres[other], frames[other], axes[other])
            own = (occluder == other).any(axis=1)
            least[own] = np.minimum(least[own], clear[faces[own]])
        fraction[:] = (occluder < 0).any(axis=1)
        some = (least[:, 0] < np.inf) & (fraction > 0)
        fraction[some] = (least[some] @ midpoints(40).T > 0).mean(axis=1)
    return out


def _clearance(antenna, places, centre, frame, axes):
    """Distance at which lines to places (n, 3) pass a part, in axes where it is a unit sphere."""
    start, end = ((p - centre) @ frame / axes for p in (antenna, places))
    along = np.clip(-((end - start) @ start) / ((end - start) ** 2).sum(axis=1), 0, 1)
    return np.linalg.norm(start + along[:, None] * (end - start), axis=1) - 1


@kernel_case(shade, 0.02)
def _shade() -> Pair:
    at = geometry(1, 2, 3)
    # Each part but the last has the next one beside the lines of sight to it.
    centres = np.array([[4.0, 0.1, 1.0], [3.5, 0.0, 0.9], [3.0, 0.1, 0.7]])
    (frames,), axes, antennas = at.frames, at.semi_axes, at.rx[0].copy()
    facets, parts = ellipsoid_facets(axes, np.array([1280, 980, 500])), np.arange(3)
    hidden_by = np.full((2, len(facets.vertices)), -1)
    for a, n in np.ndindex(2, 2):
        first, last = facets.ends[n : n + 2, 0]
        world = centres[n] + facets.vertices[first:last] @ frames[n].T
        clear = _clearance(antennas[a], world, centres[n + 1], frames[n + 1], axes[n + 1])
        # A tracer in float32 takes some vertices for occluded that are not.
        hidden_by[a, first:last][clear < 0.02] = n + 1
    corners = np.ascontiguousarray(facets.faces.T, dtype=np.uint32)
    given = hidden_by, antennas, parts, (centres, frames, axes), facets.vertices, corners
    given = *given, facets.ends
    out = np.ones((2, len(facets.faces)), dtype=np.float32)
    shade(*given, facets.ends[:-1, 1].copy(), out, np.empty((*out.shape, 3), dtype=np.float32))
    expected = shade_reference(*given)
    assert ((expected > 0) & (expected < 1)).sum() > 100
    return out, expected


def facets_by_length_reference(facets, views, grid, spreading):
    """Field (task, rx, node) of facets all seen, by middles of small triangles and not shared."""
    corners, out = facets.vertices.T[facets.faces], []
    points = np.einsum("mc,fcx->fmx", midpoints(48), corners)
    for tx, receivers, pose in zip(views.tx, views.rx, views.before, strict=True):
        for rx in receivers:
            path, along, size = 0.0, [], facets.areas
            for antenna in (tx, rx):
                path = path + np.linalg.norm(points - antenna, axis=-1) - np.linalg.norm(antenna)
                middle = np.linalg.norm(corners.mean(axis=1) - antenna, axis=-1)
                along.append((facets.normals @ antenna - facets.planes) / middle)
                size = size / (middle if spreading else 1.0)
            size = size * (np.min(along, axis=0) > 0) * np.mean(along, axis=0)
            k = grid.wavenumber[:, None, None]
            phases = np.exp(-1j * k * path).mean(axis=2)
            field = (phases * views.factor[pose]) @ size
            out.append(np.conj(1j * grid.wavenumber / np.sqrt(np.pi) * field))
    return np.reshape(out, (*views.rx.shape[:2], -1))


@kernel_case(facets_by_length, 2e-3)
def _facets_by_length() -> Pair:
    rng, chirps, receivers = np.random.default_rng(0), 2, 2
    across = np.linspace(-0.06, 0.06, 5)
    corner = np.stack(np.meshgrid([0.0], across, across), axis=-1).reshape(-1, 3)
    square = (np.arange(4)[:, None] * 5 + np.arange(4)).reshape(-1, 1)
    faces = np.concatenate([np.add(square, [0, 1, 6]), np.add(square, [0, 6, 5])])
    vertices = np.concatenate([corner, corner[faces].mean(axis=1)]).T
    count = len(faces)
    normals, areas = np.tile([1.0, 0.0, 0.0], (count, 1)), np.full(count, 0.03**2 / 2)
    facets = RigidFacets(
        np.ascontiguousarray(vertices), faces, normals, np.zeros(count), areas, False
    )
    angle, pose = rng.uniform(-1, 1, chirps), np.arange(chirps)
    tx = 40 * np.stack([np.cos(angle), np.sin(angle), np.zeros(chirps)], axis=1)
    rx = tx[:, None] + rng.uniform(-0.05, 0.05, (chirps, receivers, 3))
    factor = rng.normal(size=(chirps, 3, count)) + 1j * rng.normal(size=(chirps, 3, count))
    views = RigidViews(
        tx, rx, pose, pose, np.zeros(chirps), np.ones((chirps, 1, count), dtype=np.float32),
        np.ones((chirps, 1)), np.ones((chirps, receivers, 1)), factor,
    )  # fmt: skip
    wavenumber, step = _WAVENUMBER * np.array([0.9, 1.0, 1.1]), 0.025
    grid = LengthGrid(-40, step, wavenumber, 0.14, np.exp(-1j * wavenumber * step))
    out = (np.empty((chirps, receivers, 3, 80), dtype=np.complex128),)
    (shared,) = filled(facets_by_length, 0, chirps, facets, views, grid, True, out=out, adds=True)
    turned = np.exp(1j * wavenumber[:, None] * step * (grid.first + np.arange(80)))
    return (shared * turned).sum(axis=3), facets_by_length_reference(facets, views, grid, True)


def amplitudes_reference(tubes, rx, axes):
    """Amplitudes (tube,) of `_amplitude` over the distance, not tapered, for v and one Rx (3,).

    ``axes`` (3, 3) are those of the receiver.
    """
    corners, d, e = tubes.places[:, :3], tubes.direction, tubes.field
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    n *= np.sign(np.sum(n * tubes.normal, axis=1))[:, None]
    s = rx - tubes.places[:, 3]
    leg = np.linalg.norm(s, axis=1, keepdims=True)
    s = s / leg
    p = np.cross(s, np.cross(axes[:, 2], s))
    p /= np.linalg.norm(p, axis=1, keepdims=True)
    ahead, across = np.sum(n * (s - d), axis=1), np.sum(d * p, axis=1) * np.sum(n * e, axis=1)
    aside = np.sum(e * s, axis=1) * np.sum(n * p, axis=1)
    return (np.sum(e * p, axis=1) * ahead + across - aside) / 2 / leg[:, 0]


def radiate_tubes_reference(tubes, rx, axes, wavenumber, length):
    """What visible tubes send to one receiver (3,), not tapered, for v, by sums over triangles."""
    path = tubes.path + np.linalg.norm(rx - tubes.places, axis=2) - length
    corners = path[:, :3]
    bow = 0.75 * (path[:, 3:] - corners.mean(axis=1, keepdims=True))
    phase = corners @ midpoints(48).T + bow
    mean = np.exp(-1j * wavenumber * phase).mean(axis=1)
    return np.sum(amplitudes_reference(tubes, rx, axes) * mean)


@kernel_case(radiate_tubes, 1e-3)
def _radiate_tubes() -> Pair:
    rng, count = np.random.default_rng(0), 200
    places = rng.normal(0, 0.3, (count, 1, 3)) + rng.normal(0, 0.004, (count, 4, 3))
    places[:, 3] = places[:, :3].mean(axis=1)
    directions, fields = rng.normal(size=(2, count, 3))
    path = 4 + rng.uniform(0, 0.01, (count, 4))
    tubes = Tubes(places, path, directions, -directions, fields, np.zeros(count, dtype=np.int64))
    rx, wavenumber = np.array([[-4.0, 0.5, 0.2]]), np.array([_WAVENUMBER])
    out, length = (np.empty((8, 1, 1, 1), dtype=np.complex128),), np.full((1, 1), 8.0)
    axes = np.ascontiguousarray(Rotation.random(random_state=0).as_matrix())
    given = tubes, np.ones((1, count), dtype=np.bool_), rx, axes, wavenumber, length
    (found,) = filled(radiate_tubes, 0, 8, *given, False, True, False, out=out, adds=True)
    return found.sum(), radiate_tubes_reference(tubes, rx[0], axes, _WAVENUMBER, 8.0)
