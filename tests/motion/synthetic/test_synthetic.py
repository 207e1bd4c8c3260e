from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtradar.errors import InputError
from rtradar.motion import ACTIVITIES, Motion, synthetic_motion
from rtradar.motion.quaternions import quaternion_rotate
from rtradar.motion.skeleton import NODES
from rtradar.motion.synthetic import STYLES
from rtradar.motion.synthetic.figure import (
    ANKLE,
    HEEL_X,
    TOE_HEIGHT,
    bend,
    bump,
    hermite,
    keyed,
    smooth,
)
from rtradar.system.registries import ACTIVITY_NAMES

NODE = NODES.index


def speeds(motion: Motion, node: str) -> np.ndarray:
    return np.linalg.norm(
        np.gradient(motion.positions[:, NODE(node)], 1 / motion.rate_hz, axis=0), axis=1
    )


def test_every_activity_has_the_name_that_is_checked() -> None:
    assert tuple(ACTIVITIES) == ACTIVITY_NAMES


subjects = st.fixed_dictionaries(
    {
        "activity": st.sampled_from(
            [
                *ACTIVITIES,
                *(f"{activity},style={style}" for activity in STYLES for style in STYLES[activity]),
            ]
        ),
        "seed": st.integers(0, 1000),
        "duration_s": st.floats(0.5, 6.0),
        "height_m": st.floats(1.2, 2.1),
        "tempo": st.floats(0.6, 1.4),
        "side": st.sampled_from(["left", "right"]),
        "amplitude": st.floats(0.5, 1.15),
    }
)


@settings(max_examples=40)
@given(subjects)
def test_feet_never_sink_nor_slide_and_bones_never_stretch(subject: dict) -> None:
    motion, height = synthetic_motion(**subject), subject["height_m"]
    toe, ankle = ([NODE(f"{side}_{end}") for side in "lr"] for end in ("toe", "ankle"))
    # The toe node stands TOE_HEIGHT above the sole: not even a millimetre below that.
    assert motion.positions[:, toe + ankle, 2].min() > TOE_HEIGHT * height - 1e-3
    # Between frames the spline may cut a corner, by less.
    between = motion.at(np.linspace(0, motion.duration_s, 997))[0]
    assert between[:, toe, 2].min() > TOE_HEIGHT * height - 2e-3
    lengths = np.linalg.norm(between[:, 1:] - between[:, np.array(motion.parents[1:])], axis=2)
    known = np.linalg.norm(motion.offsets[1:], axis=1)
    np.testing.assert_allclose(lengths, np.broadcast_to(known, lengths.shape), rtol=1e-10)
    toes, below = motion.positions[:, toe], height * np.array([HEEL_X, 0.0, -ANKLE])
    heels = motion.positions[:, ankle] + quaternion_rotate(motion.rotations[:, toe], below)
    carried = []
    for points, level in ((toes, TOE_HEIGHT * height), (heels, 0.0)):
        # On the floor (to 0.01 mm, in both frames) it stands still: what still moves there is about
        # to lift or just landed.
        down = np.maximum(points[1:, :, 2], points[:-1, :, 2]) < level + 1e-5
        across = np.linalg.norm(np.diff(points[..., :2], axis=0), axis=2)[down] * motion.rate_hz
        if across.size:  # heels may be in the air all the time
            assert np.quantile(across, 0.98) < 0.02
            assert across.max() < 0.2
        carried.append(down.any(axis=1))
    # At any time a toe or a heel carries who does not jump.
    if subject["activity"] not in ("jumping_jack", "jump"):
        assert (carried[0] | carried[1]).all()


@settings(max_examples=25)
@given(subjects)
def test_motion_is_smooth(subject: dict) -> None:
    """Halving the frame interval halves the steps of acceleration, so the motion is C2."""
    jumps = []
    for rate in (480.0, 960.0):
        motion = synthetic_motion(**subject | {"duration_s": 0.8}, rate_hz=rate)
        acceleration = np.diff(motion.positions, 2, axis=0) * rate**2
        jumps.append(np.abs(np.diff(acceleration, axis=0)).max())
    # A step would stay as large as it was: ratio 1.
    assert jumps[1] < 0.75 * jumps[0] or jumps[1] < 0.5


@pytest.mark.parametrize("seed", range(4))
def test_walk_looks_like_walking(seed: int) -> None:
    motion = synthetic_motion("walk", seed)
    root = motion.positions[:, 0]
    speed = (root[0, 0] - root[-1, 0]) / motion.duration_s  # toward the radar, -x
    assert 1.05 < speed < 1.4
    np.testing.assert_allclose(root[:, 1], 0, atol=0.05)
    assert 0.01 < np.ptp(root[:, 2]) < 0.07
    assert 3.5 < speeds(motion, "l_toe").max() < 6.5
    # Arms swing against legs.
    leg = motion.positions[:, NODE("l_ankle"), 0] - root[:, 0]
    arm = motion.positions[:, NODE("l_wrist"), 0] - root[:, 0]
    assert np.corrcoef(leg, arm)[0, 1] < -0.6


@pytest.mark.parametrize("side", ["left", "right"])
def test_lame_side_of_gaits(side: str) -> None:
    """What each gait is known by happens on the lame side, and not on the other."""
    lame, sound = ("l", "r") if side == "left" else ("r", "l")

    def gait(style: str) -> dict[str, np.ndarray]:
        motion = synthetic_motion("walk", 1, style=style, side=side, duration_s=6.0)
        nodes = {node: motion.positions[:, NODE(node)] for node in NODES}
        # Toward the radar is -x, and the left then -y.
        return {node: places * [-1, -1, 1] for node, places in nodes.items()}

    def ahead(nodes: dict[str, np.ndarray], one: str, other: str) -> np.ndarray:
        return nodes[f"{one}_ankle"][:, 0] - nodes[f"{other}_ankle"][:, 0]

    limps = gait("antalgic")
    assert ahead(limps, lame, sound).max() < 0.6 * ahead(limps, sound, lame).max()
    stiff = gait("stiff_legged")
    outward = {one: np.abs(stiff[f"{one}_ankle"][:, 1] - stiff["root"][:, 1]).max() for one in "lr"}
    assert outward[lame] > outward[sound] + 0.1
    steppage = gait("steppage")
    assert steppage[f"{lame}_knee"][:, 2].max() > steppage[f"{sound}_knee"][:, 2].max() + 0.06
    lurches = gait("lurch")
    back = lurches["root"][:, 0] - lurches["thorax"][:, 0]
    landing = ahead(lurches, lame, sound) > 0.9 * ahead(lurches, lame, sound).max()
    assert back[landing].mean() > back[~landing].mean() + 0.03
    drops = gait("trendelenburg")
    other_hip_up = drops[f"{sound}_hip"][:, 2] - drops[f"{lame}_hip"][:, 2]
    assert -other_hip_up.min() > other_hip_up.max() + 0.005


def test_long_walk_turns_round() -> None:
    motion = synthetic_motion("walk", duration_s=20.0)
    x = motion.positions[:, 0, 0]
    assert x.min() > -1.65
    assert x.max() < 1.65
    assert x[0] > 1
    turns = np.count_nonzero(np.diff(np.sign(x - x.mean())))
    assert turns >= 4
    left = motion.positions[:, NODE("l_hip"), 1] - motion.positions[:, NODE("r_hip"), 1]
    going = np.gradient(x, 1 / 120)
    brisk = np.abs(going) > 0.7
    # Who goes to -x has the left hip at -y, and the other way round: nobody walks backwards.
    assert (np.sign(left[brisk]) == np.sign(going[brisk])).all()


@pytest.mark.parametrize("seed", range(3))
def test_jumping_jack_flies_freely(seed: int) -> None:
    motion = synthetic_motion("jumping_jack", seed, duration_s=4.0)
    z = motion.positions[:, 0, 2]
    acceleration = np.diff(z, 2) * 120**2
    toes = motion.positions[1:-1, [NODE("l_toe"), NODE("r_toe")], 2].min(axis=1)
    flying = toes > TOE_HEIGHT * 1.75 + 2e-3
    assert 0.1 < flying.mean() < 0.5
    np.testing.assert_allclose(acceleration[flying], -9.81, atol=0.01)
    width = np.abs(motion.positions[:, NODE("l_toe"), 1] - motion.positions[:, NODE("r_toe"), 1])
    hands = motion.positions[:, NODE("l_hand"), 2]
    assert width.max() > 0.4
    assert width.min() < 0.3
    assert hands.max() > 0.818 * 1.75  # above the shoulders
    assert np.corrcoef(width, hands)[0, 1] > 0.7
    # Nobody stands still first.
    assert speeds(motion, "l_hand")[:60].max() > 1
    assert 4.1 < speeds(motion, "l_hand").max() < 8.3  # 10 to 90 % of recorded windows: actors.py


def test_knees_of_jumping_jacks_bend_more_slowly_in_flight_than_on_the_floor() -> None:
    found = []
    for seed in range(12):
        motion = synthetic_motion("jumping_jack", seed, duration_s=4.0)
        places = [motion.positions[:, NODE(f"l_{name}")] for name in ("hip", "knee", "ankle")]
        thigh, shank = (
            bone / np.linalg.norm(bone, axis=1, keepdims=True) for bone in np.diff(places, axis=0)
        )
        bend_deg = np.degrees(np.arccos(np.sum(thigh * shank, axis=1)))
        speed = np.abs(np.gradient(bend_deg, 1 / motion.rate_hz))
        toes = motion.positions[:, [NODE("l_toe"), NODE("r_toe")], 2].min(axis=1)
        flying = toes > TOE_HEIGHT * 1.75 + 2e-3
        found.append((speed[flying].mean(), speed[~flying].mean()))
    in_flight, on_the_floor = np.mean(found, axis=0)
    assert in_flight < 0.95 * on_the_floor


@pytest.mark.parametrize("seed", range(6))
def test_slow_jumpers_stand_between_jumps(seed: int) -> None:
    """Who has much time does not go deeper for that, as one curve over all of it would."""
    motion = synthetic_motion("jump", seed, duration_s=6.0, tempo=0.5)
    root, height = motion.positions[:, 0, 2] / 1.75, np.median(motion.positions[:, 0, 2]) / 1.75
    assert root.min() > height - 0.26


@pytest.mark.parametrize("seed", range(3))
def test_who_stands_sways_by_millimetres(seed: int) -> None:
    """Winter et al. 1998: an inverted pendulum; Prieto et al. 1996: 4 and 2 mm, slowly."""
    motion = synthetic_motion("stand", seed, duration_s=200.0, rate_hz=30.0)
    root, head = (motion.positions[:, NODE(node)] * 1e3 for node in ("root", "head"))
    forward, sideways, _ = root.std(axis=0)
    assert 3.0 < forward < 5.0
    assert 1.3 < sideways < 2.7
    # The head, nearly twice as high, sways with it.
    assert np.corrcoef(root[:, 0], head[:, 0])[0, 1] > 0.999
    assert 1.4 < head[:, 0].std() / forward < 2.0
    power = np.abs(np.fft.rfft(np.hanning(len(root)) * (root[:, 0] - root[:, 0].mean()))) ** 2
    frequency = np.fft.rfftfreq(len(root), 1 / motion.rate_hz)
    slow = power[frequency < 0.5].sum() / power.sum()
    assert 0.9 < slow < 0.999
    assert max(speeds(motion, "l_toe").max(), speeds(motion, "r_toe").max()) < 1e-6
    # Straight legs and hanging arms.
    height = motion.positions.mean(axis=0)[:, 2]
    assert height[NODE("l_wrist")] < height[NODE("l_hip")]
    leg = motion.positions[:, NODE("l_hip")] - motion.positions[:, NODE("l_ankle")]
    assert np.linalg.norm(leg, axis=1).min() > 0.99 * 0.491 * 1.75


def test_seed_is_the_subject() -> None:
    first, again, other = (synthetic_motion("walk", seed).positions for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 0.01


def test_another_take_of_a_subject_begins_elsewhere_in_the_same_movement() -> None:
    first, again, other = (synthetic_motion("kick", seed=3, take=take) for take in (0, 0, 7))
    np.testing.assert_array_equal(first.rotations, again.rotations)
    np.testing.assert_array_equal(first.rotations, synthetic_motion("kick", seed=3).rotations)
    assert not np.array_equal(first.rotations, other.rotations)


def test_traits_may_follow_the_name_of_the_activity() -> None:
    text = synthetic_motion("kick,side=right,tempo=0.9,take=2", 3, duration_s=0.5)
    given = synthetic_motion("kick", 3, side="right", tempo=0.9, take=2, duration_s=0.5)
    np.testing.assert_array_equal(text.rotations, given.rotations)


def test_height_and_build() -> None:
    tall = synthetic_motion("punch", height_m=1.9, build=1.2)
    assert tall.girth == pytest.approx(1.2 * 1.9 / 1.75)
    legs = [np.linalg.norm(tall.offsets[NODE(node)]) for node in ("l_knee", "l_ankle")]
    assert sum(legs) == pytest.approx(0.491 * 1.9)


def test_frames_cover_the_duration() -> None:
    motion = synthetic_motion("punch", duration_s=0.123)
    assert motion.duration_s == 0.123
    assert motion.frame_times[-1] >= 0.123
    motion.at([0.0, 0.123])


@pytest.mark.parametrize(
    "arguments",
    [
        {"activity": "fly"},
        {"side": "both"},
        {"seed": -1},
        {"seed": 1.5},
        {"duration_s": 0.0},
        {"height_m": 17.5},
        {"tempo": float("nan")},
        {"amplitude": 3.0},
        {"build": -1.0},
        {"rate_hz": 1.0},
        {"style": "moonwalk"},
        {"activity": "walk,speed=3"},
        {"activity": "walk,tempo=fast"},
    ],
)
def test_impossible_actors_are_refused(arguments: dict) -> None:
    refused = arguments.get("activity", next(iter(arguments))).removeprefix("walk,").split("=")[0]
    with pytest.raises(InputError, match=refused):
        synthetic_motion(**{"activity": "walk"} | arguments)


def test_curves() -> None:
    u = np.array([-1.0, 0.0, 0.5, 1.0, 2.0])
    np.testing.assert_allclose(smooth(u), [0, 0, 0.5, 1, 1])
    np.testing.assert_allclose(bump(u), [0, 0, 1, 0, 0])
    np.testing.assert_allclose(keyed(u, [0.0, 1.0, 2.0], [1.0, 3.0, 2.0]), [1, 1, 2, 3, 2])
    h = 1e-4
    t = np.array([2 - h, 2, 2 + h, 5 - h, 5, 5 + h])
    y = hermite(t, (2.0, 5.0), (1.0, -2.0, 3.0), (4.0, 0.5, -1.0))
    for k, expected in ((1, (1.0, -2.0, 3.0)), (4, (4.0, 0.5, -1.0))):
        found = (y[k], (y[k + 1] - y[k - 1]) / (2 * h), (y[k + 1] - 2 * y[k] + y[k - 1]) / h**2)
        np.testing.assert_allclose(found, expected, atol=1e-5)  # rounding, 1e-16 / h^2


def test_bend_reaches() -> None:
    rng = np.random.default_rng(0)
    reach = rng.normal(0, 1, (50, 3))
    reach *= rng.uniform(0.3, 0.85, (50, 1)) / np.linalg.norm(reach, axis=1, keepdims=True)
    upper, lower = bend(reach, 0.45, 0.42, rng.normal(0, 1, (50, 3)), 1.0)
    np.testing.assert_allclose(
        upper.apply([0, 0, -0.45]) + lower.apply([0, 0, -0.42]), reach, atol=1e-12
    )
