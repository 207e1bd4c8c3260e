from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rtradar.errors import InputError
from rtradar.motion import Motion, cut, place, synthetic_motion
from rtradar.motion.placement import MARGIN_FRAMES, hip_headings, median_heading, walk_direction
from rtradar.motion.skeleton import NODES

WALK, KICK = synthetic_motion("walk"), synthetic_motion("kick")


def inside(motion: Motion) -> Motion:
    keep = (motion.frame_times >= -1e-9) & (motion.frame_times <= motion.duration_s + 1e-9)
    return motion.positions[keep]  # type: ignore[return-value]


@settings(max_examples=15)
@example(0.125, 0.0, 0.0)  # at which a median of each component was 1.7e-4 m off
@given(st.floats(-math.pi, math.pi), st.floats(-5, 5), st.floats(-5, 5))
def test_placement_undoes_any_yaw_and_shift(yaw: float, x: float, y: float) -> None:
    for motion in (WALK, KICK):
        expected = place(motion).positions
        np.testing.assert_allclose(
            place(motion.turned(yaw).shifted([x, y, 0])).positions, expected, atol=1e-9
        )


def test_a_part_of_a_recording_is_placed_like_the_whole() -> None:
    part = cut(WALK, 1.0, 0.5)
    assert len(part.root_positions) < len(WALK.root_positions) / 2
    whole, placed = place(WALK, 1.0, 0.5), place(part, 0.0, 0.5)
    np.testing.assert_array_equal(placed.positions, whole.positions)
    assert (placed.duration_s, placed.first_frame_s) == (whole.duration_s, whole.first_frame_s)


def test_walk_moves_toward_the_radar() -> None:
    root = inside(place(WALK.turned(1.0)))[:, 0]  # type: ignore[index]
    np.testing.assert_allclose(root[:, :2].mean(axis=0), 0, atol=1e-12)
    assert root[-1, 0] - root[0, 0] < -3
    assert abs(root[-1, 1] - root[0, 1]) < 0.1


def test_walk_there_and_back_goes_toward_the_radar_first() -> None:
    long = place(synthetic_motion("walk", duration_s=8.0).turned(2.0))
    root = long.positions[:, 0]
    assert np.argmin(root[:, 0]) in range(200, 700)
    assert np.ptp(root[:, 1]) < 0.4


def test_others_face_the_radar() -> None:
    placed = place(KICK.turned(-2.0))
    heading = median_heading(hip_headings(placed))
    assert (
        math.atan2(heading[1], heading[0]) == pytest.approx(math.pi, abs=0.02) or heading[0] < -0.99
    )
    assert walk_direction(placed.root_positions, hip_headings(placed)) is None
    # The kicking left foot is on the left, -y for someone who faces -x, and comes forward, to -x.
    feet = placed.positions[:, [NODES.index("l_toe"), NODES.index("r_toe")]]
    assert feet[:, 0, 1].mean() < feet[:, 1, 1].mean()
    assert feet[:, 0, 0].min() < -0.7


def test_heading_is_added_anticlockwise() -> None:
    straight, turned = place(KICK).positions, place(KICK, heading_deg=90).positions
    np.testing.assert_allclose(turned[..., 0], -straight[..., 1], atol=1e-12)
    np.testing.assert_allclose(turned[..., 1], straight[..., 0], atol=1e-12)


def test_interval_and_margin() -> None:
    cut = place(WALK, 1.003, 0.5)
    assert cut.duration_s == 0.5
    assert cut.first_frame_s == pytest.approx(
        math.floor(1.003 * 120) / 120 - MARGIN_FRAMES / 120 - 1.003
    )
    # The same poses as in the whole, up to the place: the ends see the frames beyond.
    times = np.array([0.0, 0.1, 0.5])
    whole, part = WALK.at(times + 1.003)[0], cut.at(times)[0]
    for a, b in zip(whole, part, strict=True):
        distances = (np.linalg.norm(p[:, None] - p[None], axis=2) for p in (a, b))
        np.testing.assert_allclose(*distances, atol=1e-7)


def test_straight_cut_of_a_walk_faces_the_same_way() -> None:
    cut = place(WALK.turned(0.7), 1.0, 0.4)
    root = cut.at([0.0, 0.4])[0][:, 0]
    assert root[1, 0] - root[0, 0] < -0.4
    assert abs(root[1, 1] - root[0, 1]) < 0.1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"start_s": 3.5}, "synthetic:walk, 3 s long: start_s = 3.5; .* a number from 0 to 3"),
        ({"start_s": -0.1}, "start_s = -0.1"),
        ({"start_s": math.nan}, "start_s = nan"),
        (
            {"start_s": 1.0, "duration_s": 2.5},
            "after 1 s, of which 2 s are left, duration_s = 2.5; .* to 2$",
        ),
        ({"duration_s": 0.0}, "duration_s = 0.0"),
        ({"duration_s": math.inf}, "duration_s = inf"),
        ({"heading_deg": math.nan}, "heading_deg = nan"),
    ],
)
def test_interval_outside_is_refused(arguments: dict[str, float], words: str) -> None:
    with pytest.raises(InputError, match=words):
        place(WALK, **arguments)  # type: ignore[arg-type]


def test_sideways_steps_are_no_walk() -> None:
    roots = np.stack([np.zeros(100), np.linspace(0, 3, 100), np.ones(100)], axis=1)
    sideways, ahead = np.tile([1.0, 0.0], (100, 1)), np.tile([0.0, 1.0], (100, 1))
    assert walk_direction(roots, sideways) is None
    np.testing.assert_allclose(walk_direction(roots, ahead), [0, 3])
    np.testing.assert_allclose(walk_direction(roots, -ahead), [0, 3])
    assert walk_direction(roots * 0.3, ahead) is None
