"""Rays past parts that they come near."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from references.cases import Pair, kernel_case
from rtradar.kernels.scatter.rays import NEAR, facet_rays, first_occluders, near_rays


def body_and_lines(poses: int, seed: int = 0) -> tuple[tuple[np.ndarray, ...], ...]:
    """A body of 6 parts in some poses; 300 lines, of each to one part or to none, in one of
    them."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-0.6, 0.6, (poses, 6, 3))
    frames = Rotation.random(poses * 6, rng=rng).as_matrix().reshape(poses, 6, 3, 3)
    origins = np.array([-4.0, 0.0, 0.0]) + rng.uniform(-0.2, 0.2, (300, 3))
    own, pose = np.tile(np.arange(-1, 6), poses), np.repeat(np.arange(poses), 7)
    group = rng.integers(0, len(own), 300)
    lines = origins, rng.uniform(-0.6, 0.6, (300, 3)), group, own, pose
    return (centres, frames, rng.uniform(0.05, 0.3, (6, 3))), lines


def unit_maps(frames: np.ndarray, semi_axes: np.ndarray) -> np.ndarray:
    """Maps (..., part, 3, 3) to the axes where a part is the unit sphere."""
    return np.ascontiguousarray(np.swapaxes(frames, -1, -2) / semi_axes[:, :, None])


def near_lines_reference(origins, targets, own, centres, frames, semi_axes):
    """Pairs (line, part) bool of `near_rays` for one pose: the line enters the volume `NEAR`."""
    starts = np.einsum("pji,lpj->lpi", frames, origins[:, None] - centres) / semi_axes
    lines = np.einsum("pji,lj->lpi", frames, targets - origins) / semi_axes
    nearest = np.clip(-np.sum(starts * lines, axis=2) / np.sum(lines * lines, axis=2), 0, 1)
    distance = np.linalg.norm(starts + nearest[..., None] * lines, axis=2)
    return (distance <= NEAR) & (np.arange(len(semi_axes)) != own[:, None])


@kernel_case(near_rays, 0, poses=(1, 2), seed=(4, 5))
def _near_rays(poses: int, seed: int) -> Pair:
    """Number of rays of each line: one past each part within whose volume it comes."""
    (centres, frames, axes), lines = body_and_lines(poses, seed)
    origins, targets, group, own, pose = lines
    expected = np.zeros(len(origins), dtype=int)
    for number in range(poses):
        ours = np.flatnonzero(pose[group] == number)
        posed = centres[number], frames[number], axes
        near = near_lines_reference(origins[ours], targets[ours], own[group[ours]], *posed)
        expected[ours] = near.sum(axis=1)
    found = np.bincount(
        near_rays(*lines, centres, unit_maps(frames, axes), axes.max(axis=1))[1][0],
        minlength=len(origins),
    )
    return found, expected


def facet_rays_reference(antennas, parts, centres, frames, semi_axes, vertices, first):
    """Number of rays (antenna, vertex) of `facet_rays` to vertices on ellipsoids, margin 0."""
    out = np.zeros((len(antennas), vertices.shape[1]), dtype=np.int64)
    for a, antenna in enumerate(antennas):
        for part in parts:
            own = slice(first[part], first[part + 1])
            local = vertices[:, own].T
            world = centres[part] + local @ frames[part].T
            normals = local / semi_axes[part] ** 2 @ frames[part].T
            lines = np.broadcast_to(antenna, world.shape), world, np.full(len(world), part)
            near = near_lines_reference(*lines, centres, frames, semi_axes)
            facing = np.einsum("vi,vi->v", normals, antenna - world) >= 0
            out[a, own] = near.sum(axis=1) * facing
    return out


@kernel_case(facet_rays, 0)
def _facet_rays() -> Pair:
    rng, parts, antennas = np.random.default_rng(0), np.array([4, 1, 2]), 2
    u = rng.normal(size=(3, 1800))
    u /= np.linalg.norm(u, axis=0)
    # Of each part as many as it takes.
    first = np.array([0, 300, 500, 900, 1200, 1500, 1800])
    axes, centres = rng.uniform(0.05, 0.25, (6, 3)), rng.uniform(-0.4, 0.4, (6, 3))
    frames = np.linalg.qr(rng.normal(size=(6, 3, 3)))[0]
    places = np.array([-4.0, 0, 0]) + rng.normal(0, 0.3, (antennas, 3))
    vertices = np.ascontiguousarray(u * np.repeat(axes, np.diff(first), axis=0).T)
    posed = places, parts, centres, frames, axes
    slots = facet_rays(*posed, axes.max(axis=1), vertices, first, 0.0)[1][0]
    count = np.bincount(slots, minlength=antennas * 1800).reshape(antennas, 1800)
    return count, facet_rays_reference(*posed, vertices, first)


def first_occluders_reference(met, fraction, whose, vertices):
    """Part (vertex,) among those that are met with the least fraction, -1 for none."""
    occluder = np.full(vertices, -1, dtype=np.int16)
    hits = np.flatnonzero(met)
    farthest_first = hits[np.argsort(-fraction[hits], kind="stable")]
    for ray in farthest_first:
        occluder[whose[0, ray]] = whose[1, ray]
    return occluder


@kernel_case(first_occluders, 0)
def _first_occluders() -> Pair:
    rng, found = np.random.default_rng(0), np.full(3000, -1, dtype=np.int16)
    rays = rng.uniform(size=5000) < 0.5, rng.uniform(size=5000).astype(np.float32)
    whose = np.stack([rng.integers(0, 3000, 5000), rng.integers(0, 21, 5000)])
    first_occluders(*rays, whose, found)
    return found, first_occluders_reference(*rays, whose, 3000)
