from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtradar.body import PART_NAMES, Body, Ellipsoids
from rtradar.errors import InputError
from rtradar.motion import ACTIVITIES, place, synthetic_motion
from rtradar.motion.skeleton import NODES
from rtradar.settings import Breathing

RADII = {
    "hip": 0.07,
    "thigh": 0.07,
    "shank": 0.06,
    "foot": 0.04,
    "clavicle": 0.05,
    "upper arm": 0.05,
    "forearm": 0.04,
    "hand": 0.04,
}


@pytest.fixture(scope="module")
def body() -> Body:
    return Body.from_motion(synthetic_motion("kick"))


def test_21_parts_of_the_given_thickness(body: Body) -> None:
    assert len(body.part_names) == len(set(body.part_names)) == 21
    expected = {
        f"{side} {name}": radius for side in ("left", "right") for name, radius in RADII.items()
    }
    expected |= {
        "lower torso": 0.10,
        "middle torso": 0.10,
        "upper torso": 0.10,
        "neck": 0.04,
        "head": 0.06,
    }
    assert set(body.part_names) == set(expected)
    for name, (a, b, _) in zip(body.part_names, body.semi_axes, strict=True):
        assert a == b == expected[name]


@cache
def body_of(activity: str) -> Body:
    return Body.from_motion(synthetic_motion(activity))


@settings(max_examples=15)
@given(st.sampled_from(list(ACTIVITIES)), st.floats(0.0, 1.0))
def test_ellipsoids_sit_on_their_bones(activity: str, share: float) -> None:
    body = body_of(activity)
    time = share * body.duration_s
    centres, frames, axes = body.at([time])
    joints, _ = body.motion.at([time])
    first, last = joints[0, list(body.motion.parents[1:])], joints[0, 1:]
    np.testing.assert_allclose(centres[0] + axes[:, 2:] * frames[0, :, :, 2], last, atol=1e-12)
    np.testing.assert_allclose(centres[0] - axes[:, 2:] * frames[0, :, :, 2], first, atol=1e-12)
    np.testing.assert_allclose(
        np.swapaxes(frames[0], 1, 2) @ frames[0], np.tile(np.eye(3), (21, 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(frames[0]), 1, atol=1e-12)


def test_frames_never_flip(body: Body) -> None:
    frames = body.at(np.arange(0, body.duration_s, 1e-3)).frames
    # Under 40 rad/s a frame turns by less than 0.04 rad in a millisecond; a flip would change an
    # entry by 1 or 2.
    assert np.abs(np.diff(frames, axis=0)).max() < 0.05


def test_frames_belong_to_the_bone(body: Body) -> None:
    frames = body.at([0.0, 0.4, 0.8]).frames
    _, quaternions = body.motion.at([0.0, 0.4, 0.8])
    from scipy.spatial.transform import Rotation

    local = Rotation.from_quat(quaternions[:, 1:].reshape(-1, 4)).as_matrix().reshape(3, 21, 3, 3)
    material = np.swapaxes(local, 2, 3) @ frames
    np.testing.assert_allclose(material[1:], material[:1].repeat(2, axis=0), atol=1e-12)


def test_scaling() -> None:
    motion = synthetic_motion("walk", height_m=1.6, build=1.1)
    plain, thick = (
        Body.from_motion(motion),
        Body.from_motion(replace(motion, girth=1.5 * motion.girth)),
    )
    np.testing.assert_allclose(thick.semi_axes, plain.semi_axes * [1.5, 1.5, 1.0])
    assert plain.semi_axes[PART_NAMES.index("head"), 0] == pytest.approx(0.06 * 1.1 * 1.6 / 1.75)
    big = Body.from_motion(motion.scaled(1.2))
    np.testing.assert_allclose(big.semi_axes, plain.semi_axes * 1.2)
    np.testing.assert_allclose(big.at([1.0]).centres, plain.at([1.0]).centres * 1.2, atol=1e-12)
    for girth in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="positive"):
            Body.from_motion(replace(motion, girth=girth))


def test_one_pose(body: Body) -> None:
    pose = body.ellipsoids(0.5)
    assert isinstance(pose, Ellipsoids)
    np.testing.assert_array_equal(pose.centres, body.at([0.5]).centres[0])
    with pytest.raises(InputError, match="outside the recording"):
        body.ellipsoids(99.0)


MIRROR, STRETCH = np.diag([1.0, 1.0, -1.0]), np.diag([1.0, 1.0, 1.0 + 1e-5])


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"centres": np.zeros((2, 2))}, r"centres has shape \(2, 2\); it must be \('part', 3\)"),
        ({"centres": np.zeros((3, 3))}, r"frames has shape \(2, 3, 3\)"),
        (
            {
                "centres": np.zeros((0, 3)),
                "frames": np.zeros((0, 3, 3)),
                "semi_axes": np.zeros((0, 3)),
            },
            "at least 1 in part",
        ),
        ({"centres": 0.0}, r"centres has shape \(\)"),
        ({"semi_axes": np.ones(3)}, r"semi_axes has shape \(3,\)"),
        ({"centres": np.full((2, 3), np.inf)}, "centres holds NaN or infinity"),
        ({"semi_axes": [[1.0, 1.0, np.nan]] * 2}, "semi_axes holds NaN or infinity"),
        (
            {"semi_axes": [[1.0, 1.0, 1.0], [1.0, 0.0, 1.0]]},
            "the least is 0.0 m; it must be positive",
        ),
        ({"frames": [np.eye(3), MIRROR]}, "orthonormal and right-handed"),
        ({"frames": [STRETCH, np.eye(3)]}, "orthonormal and right-handed"),
        ({"frames": [np.eye(3), -np.eye(3)]}, "orthonormal and right-handed"),
    ],
)
def test_what_is_no_pose_is_refused(changed: dict[str, object], said: str) -> None:
    good = {"centres": np.zeros((2, 3)), "frames": [np.eye(3)] * 2, "semi_axes": np.ones((2, 3))}
    with pytest.raises(InputError, match=said):
        Ellipsoids(**(good | changed))  # type: ignore[arg-type]
    Ellipsoids(**good | {"frames": [np.eye(3) + 1e-7] * 2})  # type: ignore[arg-type]  # rounding is none


def test_left_is_left(body: Body) -> None:
    centres = body.at([0.0]).centres[0]
    # Facing -x, toward the radar, the left side is -y.
    for name in RADII:
        assert (
            centres[PART_NAMES.index(f"left {name}"), 1]
            < centres[PART_NAMES.index(f"right {name}"), 1]
        )
    heights = [
        centres[PART_NAMES.index(name), 2]
        for name in ("left foot", "left shank", "left thigh", "lower torso", "neck", "head")
    ]
    assert heights == sorted(heights)


def test_needs_nodes() -> None:
    motion = synthetic_motion("punch", duration_s=0.1)
    with pytest.raises(InputError, match="from_motion"):
        Body(_renamed(motion), np.ones((21, 3)))
    with pytest.raises(InputError, match="semi_axes"):
        Body(motion, np.zeros((21, 3)))


def _renamed(motion):  # type: ignore[no-untyped-def]
    import dataclasses

    return dataclasses.replace(motion, joints=tuple(f"x{k}" for k in range(len(NODES))))


def test_breath_moves_the_front_of_the_chest_and_nothing_else() -> None:
    motion = place(synthetic_motion("stand", duration_s=3.0), heading_deg=30.0)
    breathing = Breathing(4.0, 0.4, phase_deg=20.0)
    times = np.linspace(0.0, 3.0, 40)
    still, poses = Body.from_motion(motion).at(times), Body.from_motion(motion, breathing).at(times)
    moved = poses.centres - still.centres
    chest = [PART_NAMES.index("upper torso"), PART_NAMES.index("middle torso")]
    # Who stands faces -x, 30 degrees turned, and leans forward by 2.5 degrees.
    lean = np.radians(2.5)
    ahead = [-np.cos(np.pi / 6) * np.cos(lean), -np.sin(np.pi / 6) * np.cos(lean), -np.sin(lean)]
    expected = 4e-3 * np.sin(2 * np.pi * 0.4 * times + np.radians(20.0))
    for part in chest:
        np.testing.assert_allclose(moved[:, part], expected[:, None] * ahead, atol=6e-5)
        np.testing.assert_allclose(
            np.linalg.norm(moved[:, part], axis=1), np.abs(expected), rtol=1e-9
        )
    assert not np.delete(moved, chest, axis=1).any()
    np.testing.assert_array_equal(poses.frames, still.frames)
