"""Rays along lines of sight past the parts that they come near."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.kernels.scatter.near_rays import NEAR, near_lines_reference, near_rays

Array = NDArray[np.float64]


def body_and_lines(seed: int, poses: int = 2) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
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


@pytest.mark.parametrize("seed", [4, 5])
def test_no_part_near_a_line_is_ruled_out(seed: int) -> None:
    """Every pair of a line and a part that comes within its volume has a ray, and no other pair."""
    body, (origins, targets, group, own, pose) = body_and_lines(seed)
    _, line = near_rays(origins, targets, group, own, pose, *body)
    for number in range(2):
        ours = np.flatnonzero(pose[group] == number)
        posed = body[0][number], body[1][number], body[2]
        near = near_lines_reference(origins[ours], targets[ours], own[group[ours]], *posed)
        np.testing.assert_array_equal(np.bincount(line, minlength=300)[ours], near.sum(axis=1))


def test_rays_start_two_radii_before_a_part_and_end_at_the_target() -> None:
    (centres, frames, axes), (origins, targets, group, own, pose) = body_and_lines(7, poses=1)
    rays, line = near_rays(origins, targets, group, own, pose, centres, frames, axes)
    assert rays.dtype == np.float32
    assert len(line) > 25
    np.testing.assert_allclose(np.linalg.norm(rays[3:6], axis=0), 1, atol=1e-6)
    assert np.linalg.norm(rays[:3], axis=0).max() < 2 + NEAR + 1e-5
    # In axes of some part other than its own, each ray ends at its target.
    ends = rays[:3] + rays[6] * rays[3:6]
    local = np.einsum("pji,npj->npi", frames[0], targets[line][:, None] - centres[0]) / axes
    gap = np.linalg.norm(local - ends.T[:, None], axis=-1)
    part = own[group[line]]
    gap[np.flatnonzero(part >= 0), part[part >= 0]] = np.inf
    assert gap.min(axis=1).max() < 1e-4
