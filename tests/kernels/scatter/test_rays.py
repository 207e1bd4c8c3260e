"""Rays along lines of sight past the parts that they come near."""

from __future__ import annotations

import numpy as np

from references.rays import body_and_lines, unit_maps
from rtradar.kernels.scatter.rays import NEAR, near_rays


def test_rays_start_two_radii_before_a_part_and_end_at_the_target() -> None:
    (centres, frames, axes), (origins, targets, group, own, pose) = body_and_lines(poses=1, seed=7)
    rays, (line, met) = near_rays(
        origins, targets, group, own, pose, centres, unit_maps(frames, axes), axes.max(axis=1)
    )
    assert rays.dtype == np.float32
    assert len(line) > 25
    np.testing.assert_allclose(np.linalg.norm(rays[3:6], axis=0), 1, atol=1e-6)
    assert np.linalg.norm(rays[:3], axis=0).max() < 2 + NEAR + 1e-5
    # In axes of the part that it may meet, which is not its own, each ray ends at its target.
    ends = rays[:3] + rays[6] * rays[3:6]
    local = np.einsum("pji,npj->npi", frames[0], targets[line][:, None] - centres[0]) / axes
    gap = np.linalg.norm(local - ends.T[:, None], axis=-1)
    assert (met != own[group[line]]).all()
    assert gap[np.arange(len(line)), met].max() < 1e-4
