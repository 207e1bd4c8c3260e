"""Kicks, punches and boxing: what each style looks like, and that a body can do it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from rtradar.motion import Motion, synthetic_motion
from rtradar.motion.quaternions import quaternion_multiply
from rtradar.motion.skeleton import NODES
from rtradar.motion.synthetic import STYLES
from rtradar.motion.synthetic.figure import MAXIMUM_REACH, SHANK, THIGH, TOE_HEIGHT

NODE = NODES.index
HEIGHT_M = 1.75
STRIKES = [(name, style) for name in ("kick", "punch", "boxing") for style in STYLES[name]]


@cache
def actor(activity: str, style: str, seed: int) -> Motion:
    return synthetic_motion(activity, seed, style=style, duration_s=5.0)


def speeds(motion: Motion, node: str) -> np.ndarray:
    return np.linalg.norm(
        np.gradient(motion.positions[:, NODE(node)], 1 / motion.rate_hz, axis=0), axis=1
    )


def hips_turn_deg(motion: Motion) -> float:
    left = motion.positions[:, NODE("l_hip")] - motion.positions[:, NODE("r_hip")]
    return float(np.degrees(np.ptp(np.unwrap(np.arctan2(left[:, 1], left[:, 0])))))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("style", "least_m", "most_deg"),
    [("front", 0.6, 150), ("side", 0.6, 220), ("roundhouse", 0.6, 220), ("ball", 0.2, 150)],
)
def test_kicks_go_forward_and_up(style: str, least_m: float, most_deg: float, seed: int) -> None:
    motion = actor("kick", style, seed)
    toes = motion.positions[:, [NODE("l_toe"), NODE("r_toe")]]
    assert 4.0 < max(speeds(motion, "l_toe").max(), speeds(motion, "r_toe").max()) < 13.0
    frame, side = np.unravel_index(np.argmax(-toes[..., 0]), toes.shape[:2])
    # The farther foot is in the air, toward -x, and the other one carries.
    assert toes[frame, side, 2] > least_m * 0.7
    assert toes[frame, side, 0] < motion.positions[frame, 0, 0] - 0.5
    assert toes[frame, 1 - side, 2] < 0.05
    assert hips_turn_deg(motion) < most_deg


@pytest.mark.parametrize("seed", range(3))
def test_spins_turn_all_the_way_round(seed: int) -> None:
    assert hips_turn_deg(actor("kick", "spin", seed)) > 330


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("style", STYLES["punch"])
def test_punches_reach_the_opponent_and_come_back(style: str, seed: int) -> None:
    motion = actor("punch", style, seed)
    wrists = motion.positions[:, [NODE("l_wrist"), NODE("r_wrist")]]
    ahead = motion.positions[:, :1, 0] - wrists[..., 0]  # forward is -x
    height = wrists[..., 2].ravel()[np.argmax(ahead)] / motion.positions[:, NODE("thorax"), 2].max()
    assert ahead.max() > (0.38 if style in ("hook", "uppercut") else 0.48)
    assert 0.6 < height < 1.25
    assert np.quantile(ahead.max(axis=1), 0.2) < 0.75 * ahead.max()
    assert 1.5 < max(speeds(motion, "l_hand").max(), speeds(motion, "r_hand").max()) < 14.0


def test_kinds_of_punches_use_their_hands() -> None:
    """A jab is of the hand in front, a cross of the other; hooks come round, uppercuts up."""

    def path(style: str, side: str) -> np.ndarray:
        motion = actor("punch", style, 1)
        places = [motion.positions[:, NODE(f"{side}_{end}")] for end in ("wrist", "shoulder")]
        return np.ptp(places[0] - places[1], axis=0)

    # The right hand is in front where the left one is asked to strike.
    assert path("jab", "r")[0] > path("jab", "l")[0]
    assert path("cross", "l")[0] > path("cross", "r")[0]
    assert path("hook", "l")[1] > path("cross", "l")[1]
    assert path("uppercut", "l")[2] > path("jab", "r")[2]


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_side_is_behind_in_punches(side: str) -> None:
    motion = synthetic_motion("punch", 2, side=side)
    left, right = (np.median(motion.positions[:, NODE(f"{s}_ankle"), 0]) for s in "lr")
    assert (left > right) == (side == "left")


@pytest.mark.parametrize("seed", range(3))
def test_steady_boxers_punch_in_turn_and_stay_in_place(seed: int) -> None:
    motion = actor("boxing", "steady", seed)
    ahead = [
        motion.positions[:, NODE(f"{side}_shoulder"), 0]
        - motion.positions[:, NODE(f"{side}_wrist"), 0]  # forward is -x
        for side in "lr"
    ]
    difference = ahead[0] - ahead[1]
    leads = np.sign(difference[np.abs(difference) > 0.1])
    turns = np.count_nonzero(np.diff(leads))
    assert turns >= 5, "in 5 s"
    for side in "lr":
        assert np.ptp(motion.positions[:, NODE(f"{side}_toe"), :2], axis=0).max() < 0.02


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("activity", "style"), STRIKES)
def test_a_body_can_do_it(activity: str, style: str, seed: int) -> None:
    """Legs reach their feet with bent knees, the spine twists little, weight is over the feet."""
    motion = actor(activity, style, seed)
    found = motion.positions / HEIGHT_M
    feet = []
    for side in "lr":
        hip, ankle, toe = (found[:, NODE(f"{side}_{end}")] for end in ("hip", "ankle", "toe"))
        leg = np.linalg.norm(hip - ankle, axis=1) / (THIGH + SHANK)
        down = toe[:, 2] < TOE_HEIGHT + 1e-4
        assert leg.max() < MAXIMUM_REACH
        # Knees bend by no more than 155 degrees.
        assert leg.min() > np.sin(np.radians(25 / 2))
        feet.append(np.where(down[:, None], 0.6 * ankle[:, :2] + 0.4 * toe[:, :2], np.nan))
    # The root is not far from the line between the feet that carry, nor from one of them alone.
    left, right = (np.where(np.isnan(one), other, one) for one, other in (feet, feet[::-1]))
    along = right - left
    share = np.sum((found[:, 0, :2] - left) * along, axis=1) / np.maximum(
        np.sum(along**2, axis=1), 1e-9
    )
    nearest = left + np.clip(share, 0, 1)[:, None] * along
    assert np.quantile(np.linalg.norm(found[:, 0, :2] - nearest, axis=1), 0.9) < 0.15
    inverse = motion.rotations[:, 0] * [-1, -1, -1, 1]
    twist = quaternion_multiply(inverse, motion.rotations[:, NODE("thorax")])
    assert np.degrees(2 * np.arccos(np.abs(twist[:, 3]).min())) < 75


def test_subjects_have_ways_of_their_own() -> None:
    """What was the same for all before: tilt and turn of the trunk, and the arms."""
    many = [actor("kick", "", seed) for seed in range(12)]
    turns = [hips_turn_deg(motion) for motion in many]
    hands = [speeds(motion, "l_hand").max() for motion in many]
    assert max(turns) > 2 * min(turns)
    assert max(hands) > 1.3 * min(hands)
