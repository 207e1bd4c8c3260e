"""Compiled poses of skeletons and ellipsoids against their plain references."""

import numpy as np

from rtradar.kernels.motion import pose, pose_ellipsoids, pose_ellipsoids_reference, pose_reference


def test_pose_is_that_of_the_reference() -> None:
    rng = np.random.default_rng(1)
    joints, knots = 5, np.linspace(0.5, 2.0, 7)
    root = rng.normal(size=(4, 6, 3))
    rotation = rng.normal(size=(4, 6, joints * 4))
    offsets, parents = rng.normal(size=(joints, 3)), np.array([-1, 0, 1, 0, 3])
    times = rng.uniform(0.5, 2.0, 20)
    which = np.flatnonzero(rng.uniform(size=20) < 0.7)
    positions, quaternions = np.zeros((20, joints, 3)), np.zeros((20, joints * 4))
    pose(times, which, knots, root, rotation, offsets, parents, positions, quaternions)
    expected = pose_reference(times[which], knots, root, rotation, offsets, parents)
    # Rounding of some ten operations on numbers near 1.
    np.testing.assert_allclose(positions[which], expected[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        quaternions[which], expected[1].reshape(len(which), -1), rtol=0, atol=1e-12
    )
    rest = np.setdiff1d(np.arange(20), which)
    assert not positions[rest].any()


def test_ellipsoids_are_those_of_the_reference() -> None:
    rng = np.random.default_rng(2)
    parents = np.array([-1, 0, 1, 0, 3])
    positions, quaternions = rng.normal(size=(7, 5, 3)), rng.normal(size=(7, 5, 4))
    quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
    rest = rng.normal(size=(4, 3, 3))
    centres, frames = np.empty((7, 4, 3)), np.empty((7, 4, 3, 3))
    pose_ellipsoids(positions, quaternions, parents, rest, centres, frames)
    expected = pose_ellipsoids_reference(positions, quaternions, parents, rest)
    np.testing.assert_allclose(centres, expected[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(frames, expected[1], rtol=0, atol=1e-12)
