from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError
from rtradar.motion import Motion
from rtradar.motion.quaternions import sign_continuous


def random_motion(seed: int, frames: int = 12, joints: int = 5, wild: float = 0.5) -> Motion:
    rng = np.random.default_rng(seed)
    start = Rotation.from_rotvec(rng.uniform(-3, 3, (joints, 3)))
    steps = rng.normal(0, wild, (frames, joints, 3))
    rotations, now = [], start
    for step in steps:
        now = Rotation.from_rotvec(step) * now
        rotations.append(
            now.as_quat() * rng.choice([-1.0, 1.0], (joints, 1))
        )  # either sign is the same rotation
    return Motion(
        name="random",
        joints=tuple(f"j{k}" for k in range(joints)),
        parents=(-1, *(int(rng.integers(0, k)) for k in range(1, joints))),
        offsets=rng.normal(0, 0.3, (joints, 3)),
        root_positions=rng.normal(0, 0.1, (frames, 3)).cumsum(axis=0),
        rotations=np.array(rotations),
        rate_hz=120.0,
    )


seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=40, deadline=None)
@given(seeds, st.floats(0.0, 1.0), st.floats(0.05, 1.5))
def test_bones_are_rigid_at_any_time(seed: int, share: float, wild: float) -> None:
    motion = random_motion(seed, wild=wild)
    positions, quaternions = motion.at([share * motion.duration_s])
    parents = np.array(motion.parents[1:])
    bones = positions[0, 1:] - positions[0, parents]
    # Rounding alone: positions are of the order of metres.
    np.testing.assert_allclose(
        bones, Rotation.from_quat(quaternions[0, 1:]).apply(motion.offsets[1:]), atol=1e-12
    )
    np.testing.assert_allclose(
        np.linalg.norm(bones, axis=1), np.linalg.norm(motion.offsets[1:], axis=1), rtol=1e-11
    )
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=-1), 1, rtol=1e-12)


@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(1, 12))
def test_frame_times_return_frames(seed: int, frames: int) -> None:
    motion = random_motion(seed, frames)
    positions, quaternions = motion.at(motion.frame_times)
    np.testing.assert_allclose(positions, motion.positions, atol=1e-11)
    # The sign of a quaternion means nothing.
    np.testing.assert_allclose(
        np.abs(np.sum(quaternions * motion.rotations, axis=-1)), 1, atol=1e-12
    )


@settings(max_examples=30, deadline=None)
@given(seeds, st.floats(-3.0, 3.0), st.floats(0.0, 1.0))
def test_turning_and_resampling_commute(seed: int, yaw: float, share: float) -> None:
    motion = random_motion(seed)
    time = [share * motion.duration_s]
    turn = Rotation.from_euler("z", yaw)
    # Turning first turns what the spline goes through: the same curve. PCHIP on the root does it
    # axis by axis and is not linear, so the root is left at the origin.
    still = dataclasses.replace(motion, root_positions=np.zeros_like(motion.root_positions))
    np.testing.assert_allclose(
        still.turned(yaw).at(time)[0][0], turn.apply(still.at(time)[0][0]), atol=1e-11
    )
    np.testing.assert_allclose(
        motion.turned(yaw).positions.reshape(-1, 3),
        turn.apply(motion.positions.reshape(-1, 3)),
        atol=1e-11,
    )


def test_constant_turn_is_met_between_frames() -> None:
    angles = 12 * np.arange(25) / 120  # 12 rad/s
    motion = Motion(
        name="turn",
        joints=("root", "tip"),
        parents=(-1, 0),
        offsets=np.array([[0, 0, 0], [1.0, 0, 0]]),
        root_positions=np.zeros((25, 3)),
        rotations=np.tile(Rotation.from_euler("z", angles[:, None]).as_quat()[:, None], (1, 2, 1)),
        rate_hz=120.0,
    )
    times = np.linspace(0.05, 0.15, 501)
    tip = motion.at(times)[0][:, 1]
    # h^4 / 384 of the fourth derivative of the half-angle sine: (6 / 120)^4 / 384 = 1.6e-8 rad,
    # doubled.
    np.testing.assert_allclose(
        tip, np.stack([np.cos(12 * times), np.sin(12 * times), 0 * times], axis=1), atol=1e-7
    )


def test_velocity_does_not_step_at_frames() -> None:
    motion = random_motion(3)
    d = 1e-6
    at = motion.frame_times[2:-2]
    before = (motion.at(at)[0] - motion.at(at - d)[0]) / d
    after = (motion.at(at + d)[0] - motion.at(at)[0]) / d
    # Over 1 us an acceleration of some 1e4 m/s^2 changes the velocity by 1e-2 m/s; steps would be
    # of some 10 m/s.
    assert np.abs(after - before).max() < 0.1
    assert np.abs(after).max() > 10


def test_times_outside_are_refused() -> None:
    motion = random_motion(0)
    for time in (-1e-3, motion.duration_s + 1e-3, np.nan):
        with pytest.raises(InputError, match="outside the recording"):
            motion.at([time])
    assert motion.at([-1e-12, motion.duration_s + 1e-12])[0].shape == (2, 5, 3)
    assert motion.at(0.0)[0].shape == (1, 5, 3)


def test_single_frame_stands_still() -> None:
    motion = random_motion(1, frames=1)
    assert motion.duration_s == 0
    np.testing.assert_array_equal(motion.at([0.0, 0.0])[0], np.repeat(motion.positions, 2, axis=0))


def test_lead_and_length() -> None:
    motion = dataclasses.replace(random_motion(2), first_frame_s=-3 / 120, length_s=5 / 120)
    assert motion.duration_s == 5 / 120
    np.testing.assert_allclose(motion.at([0.0])[0][0], motion.positions[3], atol=1e-12)
    with pytest.raises(InputError, match="outside"):
        motion.at([6 / 120])


def test_scaling() -> None:
    motion = random_motion(4)
    half = motion.scaled(0.5)
    np.testing.assert_allclose(half.positions, motion.positions / 2, atol=1e-14)
    assert half.girth == 0.5
    with pytest.raises(InputError, match="positive"):
        motion.scaled(0.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rate_hz": 0.0}, "rate_hz"),
        ({"parents": (-1, 2, 1, 0, 0)}, "parents"),
        ({"parents": (-1, -1, 1, 0, 0)}, "parents"),
        ({"joints": ("a", "a", "b", "c", "d")}, "repeat"),
        ({"offsets": np.zeros((4, 3))}, "offsets"),
        ({"offsets": np.full((5, 3), np.nan)}, "finite"),
        ({"rotations": np.ones((12, 5, 4))}, "unit quaternions"),
        ({"root_positions": np.zeros((0, 3)), "rotations": np.zeros((0, 5, 4))}, "shape"),
        ({"first_frame_s": 0.1}, "cover"),
        ({"length_s": 1.0}, "cover"),
    ],
)
def test_nonsense_is_refused(changes: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        dataclasses.replace(random_motion(0), **changes)  # type: ignore[arg-type]


def test_a_long_recording_is_one_spline() -> None:
    # Stretches of 256 frames with their own splines, against the spline of all 1000 frames.
    times = np.arange(1000) / 120
    angles = np.column_stack([np.sin(2 * times), 0.3 * np.cos(7 * times), 0.5 * times])
    rotations = Rotation.from_euler("xyz", angles).as_quat()[:, None]
    roots = np.column_stack([times, np.sin(times), np.cos(3 * times)])
    motion = Motion(
        name="long",
        joints=("root",),
        parents=(-1,),
        offsets=np.zeros((1, 3)),
        root_positions=roots,
        rotations=rotations,
        rate_hz=120.0,
    )
    at = np.linspace(0, motion.duration_s, 5003)
    positions, quaternions = motion.at(at)
    whole = CubicSpline(times, sign_continuous(rotations))(at)
    whole /= np.linalg.norm(whole, axis=-1, keepdims=True)
    np.testing.assert_allclose(
        quaternions, whole, atol=1e-13
    )  # rounding of two ways to solve for one spline
    np.testing.assert_allclose(positions[:, 0], PchipInterpolator(times, roots)(at), atol=1e-13)
    # What is asked for together does not matter, nor in which order.
    np.testing.assert_array_equal(motion.at(at[::-7])[1], quaternions[::-7])
