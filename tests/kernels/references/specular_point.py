"""Specular points of ellipsoids, echoes over them, and echoes in the far field."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from references.cases import OfEach, Pair, filled, kernel_case
from rtradar.kernels.scatter.nearby_points import Ellipsoids, Images, nearby_echoes
from rtradar.kernels.scatter.specular_point import (
    _NO_BISECTOR,
    ROOT_PI,
    Geometry,
    Options,
    far_field,
    solve,
)
from rtradar.scatter.common.polarization import Polarization, copolar


def geometry(chirps: int, receivers: int, parts: int) -> Geometry:
    """Antennas 4 m before parts at random places, of random sizes and turned at random."""
    rng, count = np.random.default_rng(receivers), chirps * parts
    frames = Rotation.random(count, random_state=1).as_matrix()
    return Geometry(
        rng.normal(0, 0.2, (chirps, 3)),
        rng.normal(0, 0.2, (chirps, receivers, 3)),
        np.array([4.0, 0.0, 1.0]) + rng.normal(0, 0.4, (chirps, parts, 3)),
        frames.reshape(chirps, parts, 3, 3),
        rng.uniform(0.06, 0.2, (parts, 3)),
    )


def in_part_axes(at):
    """Tx and Rx in the axes of the parts, (chirp, rx, part, 3) each."""
    away = (a - at.centres[:, None] for a in (at.tx[:, None, None], at.rx[:, :, None]))
    return [np.einsum("cpji,crpj->crpi", at.frames, a) for a in np.broadcast_arrays(*away)]


def bisected(at):
    """Points whose normals bisect both ways, these as unit vectors, and their lengths.

    All in the axes of the parts, by iteration, for antennas far beside the radii of curvature.
    """
    antennas, point = in_part_axes(at), np.zeros(3)
    for _ in range(60):
        ranges = [np.linalg.norm(a - point, axis=-1)[..., None] for a in antennas]
        ways = [(a - point) / size for a, size in zip(antennas, ranges, strict=True)]
        scale = np.linalg.norm(at.semi_axes * sum(ways), axis=-1, keepdims=True)
        point = at.semi_axes**2 * sum(ways) / scale
    return point, ways, ranges


def solve_reference(at):
    """Length, return over R1 R2 without polarisation, and point of `solve`."""
    point, ways, ranges = bisected(at)
    gradient = point / at.semi_axes**2
    size = np.linalg.norm(gradient, axis=-1, keepdims=True)
    n, eye = gradient / size, np.eye(3)
    facing = np.sum(sum(ways) * n, axis=-1)
    h = (facing / size[..., 0])[..., None, None] * eye / at.semi_axes[:, None] ** 2
    for way, distance in zip(ways, ranges, strict=True):
        h = h + (eye - way[..., None] * way[..., None, :]) / distance[..., None]
    # On the plane across n the determinant is that of the whole, times n.H^-1 n.
    plane = np.linalg.det(h) * np.sum(n * np.linalg.solve(h, n[..., None])[..., 0], axis=-1)
    value = ROOT_PI * facing / np.sqrt(plane) / (ranges[0] * ranges[1])[..., 0]
    world = at.centres[:, None] + np.einsum("cpij,crpj->crpi", at.frames, point)
    return (ranges[0] + ranges[1])[..., 0], value, world


# The last step is at most 1e-7 of the least semi-axis.
@kernel_case(
    solve,
    (OfEach(1e-13), OfEach(1e-6), 2e-8),
    receivers=(1, 8, 11),
    polarization=(None, "v", "h"),
)
def _solve(receivers: int, polarization: str | None) -> Pair:
    at, shape = geometry(5, receivers, 6), (5, receivers, 6)
    options, turn = Options(polarization == "h", spreading=True), Rotation.random(random_state=2)
    sent = Polarization(polarization or "v", turn.as_matrix())
    up = np.tile(sent.up if polarization else np.zeros(3), (5, 1))
    given, start = Geometry.of(at), np.full(at.centres.shape, np.nan)
    out = np.empty(shape), np.empty(shape), np.empty((*shape, 3))
    found = filled(solve, 0, 5, given, up, start, options, out=out)
    length, amplitude, point = solve_reference(at)
    if polarization is not None:
        away = [a - point for a in (at.tx[:, None, None], at.rx[:, :, None])]
        amplitude *= copolar(*away, sent)
    return found, (length, amplitude, point)


def nearby_echoes_reference(images, tx_index, ellipsoids):
    """Lengths and returns of `nearby_echoes`, all of them wanted."""
    found = []
    centres, frames, axes = ellipsoids
    for out, back, part in zip(images.out, images.back, images.part, strict=True):
        antennas = images.tx[out, tx_index], np.swapaxes(images.rx[back, tx_index], 1, 2)
        found.append((*antennas, centres[:, [part]], frames[:, [part]], axes[[part]]))
    results = [solve_reference(Geometry(*at)) for at in found]
    return tuple(np.concatenate([result[i] for result in results], axis=2) for i in range(2))


# Receivers near one another are given the curvature at the specular point of their middle; for
# those farther apart points are searched for.
@kernel_case(nearby_echoes, (1e-7, 0.03), wide_m=(0.1, 0.8))
def _nearby(wide_m: float) -> Pair:
    at, part, zero = geometry(1, 8, 21), np.arange(21), np.zeros(5, dtype=np.int64)
    at.rx[0] = np.linspace(-wide_m, wide_m, 8)[:, None] * [0.0, 0.5, 0.1]
    points = solve_reference(at._replace(rx=at.rx.mean(axis=1, keepdims=True)))[2][0, 0]
    local = np.einsum("pji,pj->pi", at.frames[0], points - at.centres[0]).astype(np.float32)
    near = np.repeat(local[None], 5, axis=0)
    rx = np.ascontiguousarray(at.rx[None, :1].swapaxes(2, 3))
    middle = at.rx.mean(axis=1)[None]
    images = Images(at.tx[None], rx, middle, 0 * part, 0 * part, part)
    centres, frames = (np.repeat(array, 5, axis=0) for array in at[2:4])
    given = images, zero, Ellipsoids(centres, frames, at.semi_axes)
    out = np.empty((5, 8, 21)), np.empty((5, 8, 21))
    found = filled(nearby_echoes, 0, 5, *given, near, out=out)
    return found, nearby_echoes_reference(*given)


def far_field_reference(at, spreading):
    """Length and amplitude of `far_field`."""
    to_tx, to_rx = in_part_axes(at)
    norms = [np.linalg.norm(way, axis=-1) for way in (to_tx, to_rx)]
    normal = to_tx / norms[0][..., None] + to_rx / norms[1][..., None]
    square = np.sum(normal**2, axis=-1)
    there = square >= _NO_BISECTOR
    support = np.where(there, np.linalg.norm(at.semi_axes * normal, axis=-1), 1.0)
    point = at.semi_axes**2 * normal / support[..., None]
    ranges = [np.linalg.norm(way - point, axis=-1) for way in (to_tx, to_rx)]
    root = math.sqrt(math.pi) * np.prod(at.semi_axes, axis=1) * square / support**2
    root = root / (ranges[0] * ranges[1]) if spreading else root
    return np.where(there, sum(ranges), sum(norms)), np.where(there, root, 0.0)


@kernel_case(
    far_field, (OfEach(1e-13), OfEach(1e-12)), receivers=(1, 8, 11), spreading=(False, True)
)
def _far_field(receivers: int, spreading: bool) -> Pair:
    at, shape = geometry(5, receivers, 6), (5, receivers, 6)
    # Straight between both antennas there is no bisector.
    at.tx[0], at.centres[0, 0], at.rx[0, 0] = [0, 0, 0], [4, 0, 0], [8, 0, 0]
    out = np.empty(shape), np.empty(shape)
    return filled(far_field, 0, 5, at, spreading, out=out), far_field_reference(at, spreading)
