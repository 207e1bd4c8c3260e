"""A synthetic walk: footprints first, then feet that roll over them, then the body that follows."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.interpolate import CubicSpline

from rtradar.motion.synthetic.curves import bump, hermite, keyed, state
from rtradar.motion.synthetic.figure import (
    ANKLE,
    HEEL_X,
    ROOT,
    SIDES,
    Array,
    Pose,
    PosesAt,
    roll_about_toe,
    swing_arm,
    turn,
)
from rtradar.motion.synthetic.traits import Traits

HALF_TRACK_M = 1.5
"""Long walks turn round at this distance from the middle."""

STRAIGHT_M = 4.2
"""Walks up to this length just go straight."""

STANCE = 0.57
"""Fraction of the cycle for which a foot is on the floor: both are for 7 % of it, twice.

Winter has 60 %."""

MIDSTANCE = 0.22
"""Part of the cycle from landing until the body is over the foot."""

_TURN_STEPS = 4


@dataclass(frozen=True)
class Step:
    """One footprint: side, landing time, body's position (2,) [m], heading [rad], relative step."""

    side: str
    time: float
    middle: Array
    heading: float
    vigour: float


def footprints(traits: Traits, duration_s: float) -> list[Step]:
    """Make steps from more than a cycle before 0 to more than a cycle after ``duration_s``."""
    half_cycle = traits.cycle_s / 2
    step_m = traits.step_m
    straight = step_m / half_cycle * duration_s <= STRAIGHT_M
    x = -step_m / half_cycle * duration_s / 2 if straight else -HALF_TRACK_M
    before = 4
    x -= (before + 1 + traits.phase) * step_m
    time = -(before + traits.phase) * half_cycle - MIDSTANCE * traits.cycle_s
    side, heading, turn_sign = traits.side, 0.0, 1.0
    plan: list[tuple[float, float]] = []  # advance and turn of the steps that are decided already
    steps: list[Step] = []
    while time < duration_s + 1.6 * traits.cycle_s:
        direction = round(math.cos(heading))
        if not plan and not straight and direction * x + 1.5 * step_m > HALF_TRACK_M:
            rest = max(HALF_TRACK_M - direction * x, 0.0)
            plan = [(rest, 0.0)] if rest < 0.6 * step_m else [(rest / 2, 0.0)] * 2
            plan += [(0.0, turn_sign * math.pi / _TURN_STEPS)] * _TURN_STEPS + [(step_m / 2, 0.0)]
            turn_sign = -turn_sign
        advance, turning = plan.pop(0) if plan else (step_m, 0.0)
        heading += turning
        x += advance * math.cos(heading)
        steps.append(Step(side, time, np.array([x, 0.0]), heading, advance / step_m))
        side, time = _other(side), time + half_cycle
    return steps


def _other(side: str) -> str:
    return "r" if side == "l" else "l"


def _rolled(pitch: Array, height_m: float) -> Array:
    """Ankle over its footprint (n, 3), heading +x, as the foot rolls about the toe or the heel."""
    toes_up = np.minimum(pitch, 0.0)
    about_heel = height_m * np.stack(
        [
            HEEL_X * (1 - np.cos(toes_up)) + ANKLE * np.sin(toes_up),
            np.zeros_like(pitch),
            HEEL_X * np.sin(toes_up) - ANKLE * (1 - np.cos(toes_up)),
        ],
        axis=1,
    )
    return (
        np.array([0.0, 0.0, ANKLE * height_m])
        + about_heel
        + roll_about_toe(np.maximum(pitch, 0.0), height_m)
    )


def _foot(own: list[Step], traits: Traits) -> Callable[[Array], tuple[Array, Array, Array]]:
    """Ankle (n, 3), pitch (n,), positive with toes down, and yaw (n,) of one foot at times (n,)."""
    cycle, height = traits.cycle_s, traits.height_m
    sign = SIDES[own[0].side]
    keys: list[tuple[float, float]] = []
    for k, step in enumerate(own):
        # Short steps roll less.
        following = traits.amplitude * (own[k + 1].vigour if k + 1 < len(own) else step.vigour)
        keys += [
            (step.time, -math.radians(18) * traits.amplitude * step.vigour),
            (step.time + 0.10 * cycle, 0.0),
            (step.time + (STANCE - 0.20) * cycle, 0.0),
            (
                step.time + (STANCE + 0.09) * cycle,
                math.radians(60) * min(max(following, 0.25), 1.1),
            ),
        ]

    pitch = partial(
        keyed, times=np.array([key[0] for key in keys]), values=np.array([key[1] for key in keys])
    )
    yaw = partial(
        keyed,
        times=np.array(
            [time for step in own for time in (step.time - (1 - STANCE) * cycle, step.time)][1:]
        ),
        values=np.array([step.heading for step in own for _ in (0, 1)][:-1]),
    )
    landings = np.array([step.time for step in own])

    def foot(t: Array) -> tuple[Array, Array, Array]:
        ankle = np.zeros((len(t), 3))
        first, last = np.searchsorted(landings, (t[0], t[-1]), side="right")
        for step, after in itertools.pairwise(own[max(first - 1, 0) : last + 1]):
            lift = step.time + STANCE * cycle

            def standing(at: Array, step: Step = step) -> Array:
                across = (
                    sign
                    * traits.track_m
                    * np.array([-math.sin(step.heading), math.cos(step.heading), 0.0])
                )
                return (
                    np.array([*step.middle, 0.0])
                    + across
                    + turn("z", step.heading).apply(_rolled(pitch(at), height))
                )

            def landing(at: Array, after: Step = after) -> Array:
                return standing(at, after)

            stands = (t >= step.time) & (t < lift)
            ankle[stands] = standing(t[stands])
            swings = (t >= lift) & (t < after.time)
            path = hermite(
                t[swings], (lift, after.time), state(standing, lift), state(landing, after.time)
            )
            clearance = traits.clearance_m * bump((t[swings] - lift) / (after.time - lift))
            ankle[swings] = path + clearance[:, None] * np.array([0.0, 0.0, 1.0])
        return ankle, pitch(t), yaw(t)

    return foot


def walk(duration_s: float, traits: Traits) -> PosesAt:
    """A walk, facing and starting along +x."""
    steps = footprints(traits, duration_s)
    over = np.array([step.time + MIDSTANCE * traits.cycle_s for step in steps])
    middles = np.array([step.middle for step in steps])
    headings = np.array([step.heading for step in steps])
    across = np.stack([-np.sin(headings), np.cos(headings)], axis=1)
    sway = 0.3 * traits.track_m * np.array([SIDES[step.side] for step in steps])
    course = _Course(
        path=CubicSpline(over, middles + sway[:, None] * across),
        heading=CubicSpline(over, headings),
        vigour=partial(keyed, times=over, values=np.array([step.vigour for step in steps])),
        first_left_s=next(step.time for step in steps if step.side == "l"),
        feet={side: _foot([step for step in steps if step.side == side], traits) for side in SIDES},
    )
    return partial(_walk, traits, course)


@dataclass(frozen=True)
class _Course:
    """The path of a walk over time: the root on the floor, the heading, step lengths, and feet."""

    path: Callable[[Array], Array]
    heading: Callable[[Array], Array]
    vigour: Callable[[Array], Array]
    first_left_s: float
    feet: Mapping[str, Callable[[Array], tuple[Array, Array, Array]]]


def _walk(traits: Traits, course: _Course, t: Array) -> Pose:
    height = traits.height_m
    path, heading, vigour = course.path(t), course.heading(t), course.vigour(t)
    phase = 2 * np.pi * (t - course.first_left_s) / traits.cycle_s  # 0 where the left foot lands
    bob = np.cos(2 * (phase - 2 * np.pi * MIDSTANCE))
    root = np.concatenate(
        [path, (height * (ROOT - 0.006 - vigour * (0.010 - 0.011 * bob)))[:, None]], axis=1
    )
    pelvis_yaw = -math.radians(5) * vigour * np.cos(phase)
    thorax_yaw = math.radians(6) * vigour * np.cos(phase)
    pelvis = (
        turn("z", heading + pelvis_yaw)
        * turn("x", math.radians(3) * vigour * np.sin(phase))
        * turn("y", math.radians(3))
    )
    thorax = turn("z", heading + thorax_yaw) * turn(
        "y", math.radians(4) + math.radians(1) * vigour * np.cos(2 * phase)
    )
    ankles, feet, arms = {}, {}, {}
    for side, sign in SIDES.items():
        ankle, pitch, yaw = course.feet[side](t)
        ankles[side], feet[side] = ankle, turn("z", yaw) * turn("y", pitch)
        # Each arm swings with the other leg.
        beat = -sign * np.cos(phase - math.radians(15))
        arms[side] = swing_arm(
            thorax,
            side,
            forward=math.radians(3) + traits.arm_swing_rad * traits.uneven[side] * vigour * beat,
            outward=np.full(len(t), math.radians(9)),
            elbow=math.radians(22) + math.radians(12) * vigour * (1 + beat) / 2,
        )
    return Pose(
        root=root,
        pelvis=pelvis,
        thorax=thorax,
        head=turn("z", heading) * turn("y", np.full(len(t), math.radians(4))),
        ankles=ankles,
        feet=feet,
        left=turn("z", heading).apply([0.0, 1.0, 0.0]),
        arms=arms,
        shrug=np.zeros(len(t)),
    )
