"""Actors who sit, bend, squat, wave, jump, fall and step on the spot: what bodies can do."""

from __future__ import annotations

import numpy as np
import pytest

from rtradar.motion import Motion, synthetic_motion
from rtradar.motion.skeleton import NODES
from rtradar.motion.synthetic.figure import TOE_HEIGHT

HEIGHT_M = 1.75
SEEDS = range(3)

PARTS = {
    ("root", "thorax"): (0.497, 0.5),
    ("thorax", "head"): (0.081, 0.5),
    ("shoulder", "elbow"): (0.028, 0.436),
    ("elbow", "wrist"): (0.016, 0.43),
    ("wrist", "hand"): (0.006, 0.506),
    ("hip", "knee"): (0.1, 0.433),
    ("knee", "ankle"): (0.0465, 0.433),
    ("ankle", "toe"): (0.0145, 0.5),
}
"""Mass of each part relative to the body, and its centre between the ends (Winter, table 4.1)."""


def node(motion: Motion, name: str) -> np.ndarray:
    """Positions of a node, which faces +x and has the left at +y here."""
    return motion.positions[:, NODES.index(name)] * [-1.0, -1.0, 1.0]


def centre_of_mass(motion: Motion) -> np.ndarray:
    total, centre = 0.0, np.zeros((len(motion.positions), 3))
    for (first, last), (mass, part) in PARTS.items():
        for side in ("",) if last in NODES else ("l_", "r_"):
            ends = [node(motion, f"{side}{end}") for end in (first, last)]
            centre += mass * (ends[0] + part * (ends[1] - ends[0]))
            total += mass
    assert total == pytest.approx(1.0)
    return centre / total


def tilt_deg(motion: Motion) -> np.ndarray:
    spine = node(motion, "thorax") - node(motion, "root")
    return np.degrees(np.arccos(spine[:, 2] / np.linalg.norm(spine, axis=1)))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("activity", ["bend", "squat", "wave", "stand"])
def test_weight_stays_over_the_feet(activity: str, seed: int) -> None:
    motion = synthetic_motion(activity, seed, duration_s=6.0, rate_hz=30.0)
    ahead = centre_of_mass(motion)[:, 0] - node(motion, "l_ankle")[:, 0]
    # The feet reach from 7 cm behind the ankles to 20 cm ahead.
    assert ahead.min() > 0.01
    assert ahead.max() < 0.10


@pytest.mark.parametrize("seed", SEEDS)
def test_bends_and_squats_go_down(seed: int) -> None:
    bends, squats = (
        synthetic_motion(activity, seed, duration_s=6.0, rate_hz=30.0)
        for activity in ("bend", "squat")
    )
    assert 55 < tilt_deg(bends).max() < 125
    assert tilt_deg(bends).min() < 10
    hands = node(bends, "l_hand")[:, 2]
    assert 0 < hands.min() < 0.3 * HEIGHT_M
    height = node(squats, "root")[:, 2]
    assert 0.15 * HEIGHT_M < np.ptp(height) < 0.4 * HEIGHT_M
    assert tilt_deg(squats).max() < 60


@pytest.mark.parametrize("seed", SEEDS)
def test_a_seat_carries_who_sits_and_the_feet_who_does_not(seed: int) -> None:
    motion = synthetic_motion("sit", seed, duration_s=10.0, rate_hz=30.0)
    root, height = node(motion, "root"), node(motion, "root")[:, 2]
    seat = height.min()
    assert 0.18 * HEIGHT_M < height.max() - seat < 0.29 * HEIGHT_M
    seated = height < seat + 0.03
    assert seated.any()
    # The seat stays where it is, and thighs are level on it.
    assert np.ptp(root[seated, 0]) < 0.05
    knee = node(motion, "l_knee")[seated, 2] - node(motion, "l_hip")[seated, 2]
    assert np.abs(knee).max() < 0.15
    ahead = centre_of_mass(motion)[:, 0] - node(motion, "l_ankle")[:, 0]
    rising = height > seat + 0.6 * np.ptp(height)
    assert (ahead[rising] > -0.07).all()
    assert (ahead < 0.2).all()


@pytest.mark.parametrize("side", ["left", "right"])
def test_one_hand_waves_or_both_do(side: str) -> None:
    own, other = ("l", "r") if side == "left" else ("r", "l")
    one, both = (
        synthetic_motion("wave", 2, style=style, side=side, duration_s=6.0)
        for style in ("one_hand", "two_hands")
    )
    assert node(one, f"{own}_hand")[:, 2].max() > 0.85 * HEIGHT_M
    assert np.ptp(node(one, f"{other}_hand")[:, 2]) < 0.02
    assert np.ptp(node(both, f"{other}_hand")[:, 2]) > 0.3


def test_hops_are_low_and_their_arms_quiet() -> None:
    """A flight of 0.26 s rises by g t^2 / 8, 8 cm; arms of jumps swing by up to 50 degrees."""

    def reach(style: str, seed: int) -> tuple[float, float]:
        motion = synthetic_motion("jump", seed, duration_s=4.0, style=style)
        ahead = node(motion, "l_hand")[:, 0] - node(motion, "thorax")[:, 0]
        return float(np.ptp(node(motion, "root")[:, 2])), float(np.ptp(ahead))

    hops, jumps = (
        np.array([reach(style, seed) for seed in range(12)]) for style in ("hop", "high")
    )
    assert np.median(hops, axis=0)[0] < 0.6 * np.median(jumps, axis=0)[0]
    assert np.median(hops, axis=0)[1] < 0.5 * np.median(jumps, axis=0)[1]


@pytest.mark.parametrize("seed", SEEDS)
def test_jumps_fly_freely(seed: int) -> None:
    motion = synthetic_motion("jump", seed, duration_s=4.0)
    toes = np.minimum(node(motion, "l_toe"), node(motion, "r_toe"))[1:-1, 2]
    flying = toes > TOE_HEIGHT * HEIGHT_M + 2e-3
    assert 0.1 < flying.mean() < 0.6
    acceleration = np.diff(node(motion, "root")[:, 2], 2) * motion.rate_hz**2
    np.testing.assert_allclose(acceleration[flying], -9.81, atol=0.01)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("style", "toward"), [("backward", -1), ("forward", 1)])
def test_falls_end_on_the_floor(style: str, toward: int, seed: int) -> None:
    motion = synthetic_motion("fall", seed, style=style, duration_s=12.0)
    root, head = node(motion, "root"), node(motion, "head")
    # A part's axis lies on the floor or above, with the trunk level and as wide as a trunk.
    assert motion.positions[..., 2].min() > 0.015
    lying = root[:, 2] < root[:, 2].min() + 0.01
    assert lying.any()
    assert 0.09 < root[lying, 2].min() < 0.25
    assert head[lying, 2].min() < 0.35
    assert root[lying, 0].mean() * toward > 0.3
    assert (head[lying, 0] - root[lying, 0]).mean() * toward > 0.3
    # Nobody falls faster than gravity, nor gets up by a jump.
    speed = np.diff(root[:, 2]) * motion.rate_hz
    assert -3.2 < speed.min() < -1.3
    assert speed.max() < 1.2
    assert np.diff(speed).min() * motion.rate_hz > -9.81


@pytest.mark.parametrize("seed", SEEDS)
def test_steps_in_place_stay_there(seed: int) -> None:
    motion = synthetic_motion("walk_in_place", seed, duration_s=4.0)
    root = node(motion, "root")
    assert np.ptp(root[:, :2], axis=0).max() < 0.2
    for side in "lr":
        assert node(motion, f"{side}_ankle")[:, 2].max() > 0.12
