"""Diffraction by silhouettes, by sums over a grid."""

from __future__ import annotations

import numpy as np

from references.cases import Pair, filled, kernel_case
from rtradar.kernels.scatter.silhouettes import _FAR, _LEAST_M2, occluded_fractions, wave_table


def occluded_fractions_reference(legs, wavelength, body, scales, fade, step=0.02):
    """`occluded_fractions` by a sum over a grid of offsets, which it has to converge to."""
    across, found = np.arange(-_FAR, _FAR, step) + step / 2, []
    for start, end, before, length in zip(*legs, strict=True):
        way = (end - start) / np.linalg.norm(end - start)
        side = np.cross(way, np.eye(3)[np.abs(way).argmin()])
        side /= np.linalg.norm(side)
        covered = np.zeros((len(across), len(across)), dtype=bool)
        for triangle in body[3]:
            covered |= _inside(triangle, start, way, side, before, length, wavelength, across).T
        for centre, to_sphere in zip(*body[:2], strict=True):
            leg = way, side, before, length, wavelength
            covered |= _inside_ellipsoid(centre - start, to_sphere, *leg, across)
        square = np.add.outer(across**2, across**2)[covered]
        wave = [np.exp((1j - fade) * np.pi * square * scale).sum() * scale for scale in scales]
        found.append((fade - 1j) * step**2 * np.array(wave))
    return np.array(found)


def _inside_ellipsoid(away, to_sphere, way, side, before, length, wavelength, across):
    """Which offsets (x, y) of a grid are inside the outline of an ellipsoid."""
    x, y = to_sphere @ away, to_sphere @ way
    along, nearest = away @ way, x @ y / (y @ y)
    aside = max(np.linalg.norm(x - nearest * y), 1)
    past = before + along + (nearest - along) / aside
    zone = np.sqrt(wavelength * past * (length - past) / length)
    # Of the offset from the outline's centre only what is across the way counts.
    drop = np.eye(3) - np.outer(y, y) / (y @ y)
    a, b = (zone * drop @ to_sphere @ axis for axis in (side, np.cross(way, side)))
    c, u, v = drop @ x, across[:, None], across
    # The square of u a + v b - c.
    squares = u * (u * (a @ a) - 2 * (a @ c)) + v * (v * (b @ b) - 2 * (b @ c)) + c @ c
    return squares + 2 * (a @ b) * u * v <= 1


def _inside(triangle, start, way, side, before, length, wavelength, across):
    """Which offsets (y, x) of a grid are inside the silhouette of a triangle."""
    along = (triangle - start) @ way
    past = before + np.clip(along, 0, length - before)
    zone = np.sqrt(np.maximum(wavelength * past * (length - past) / length, _LEAST_M2))
    x, y = ((triangle - start) @ axis / zone for axis in (side, np.cross(way, side)))
    right = [
        (x[j] - x[i]) * (across[:, None] - y[i]) - (y[j] - y[i]) * (across - x[i])
        for i, j in ((0, 1), (1, 2), (2, 0))
    ]
    return np.all(np.array(right) > 0, axis=0) | np.all(np.array(right) < 0, axis=0)


@kernel_case(occluded_fractions, 3e-3)
def _occluded_fractions() -> Pair:
    rng, legs = np.random.default_rng(1), 8
    starts = np.array([-4.0, 0, 1.0]) + rng.uniform(-0.3, 0.3, (legs, 3))
    ends = np.array([3.0, 0, 1.2]) + rng.uniform(-0.5, 0.5, (legs, 3))
    length = np.linalg.norm(ends - starts, axis=1)
    axes, frames = rng.uniform(0.05, 0.25, (4, 3)), np.linalg.qr(rng.normal(size=(4, 3, 3)))[0]
    centres = np.array([0, 0, 1.1]) + rng.uniform(-0.3, 0.3, (4, 3))
    maps = np.ascontiguousarray(np.swapaxes(frames, 1, 2) / axes[:, :, None])
    triangle = np.array([[[0.3, -0.4, 0.7], [0.1, 0.3, 0.8], [-0.2, 0.1, 1.4]]])
    body = centres, maps, axes.max(axis=1), triangle, np.zeros(1, dtype=bool)
    given = (starts, ends, np.zeros(legs), 1.3 * length), 0.0214, body
    scales, out = np.array([0.87, 1.13]), (np.empty((legs, 2), dtype=np.complex128),)
    found = filled(occluded_fractions, *given, 4.0, 400, scales, wave_table(0.1), out=out)
    return found, occluded_fractions_reference(*given, scales, 0.1)
