"""A synthetic walk: footprints first, then feet that roll over them, then the body that follows."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from rtradar.motion.synthetic.figure import (
    ANKLE,
    HEEL_X,
    LEFT,
    ROOT,
    SIDES,
    UP,
    Array,
    Pose,
    PosesAt,
    Subject,
    about,
    bump,
    hermite,
    keyed,
    rolled,
    state,
    swing_arm,
    xyz,
)

HALF_TRACK_M, STRAIGHT_M = 1.5, 4.2
"""Distance from the middle at which long walks turn round, and the length of straight walks [m]."""

STANCE, MIDSTANCE = 0.57, 0.22
"""Fractions of the cycle for which a foot is on the floor (Winter has 60 %; both are for 7 % of it,
twice), and from landing until the body is over the foot."""

_TURN_STEPS = 4


class Step(NamedTuple):
    """One footprint: side, landing time, body's position (2,) [m], heading [rad], relative step."""

    side: str
    time: float
    middle: Array
    heading: float
    vigour: float


def footprints(subject: Subject, duration_s: float) -> list[Step]:
    """Make steps from more than a cycle before 0 to more than a cycle after ``duration_s``."""
    half_cycle, step_m = subject.cycle_s / 2, subject.step_m
    straight = step_m / half_cycle * duration_s <= STRAIGHT_M
    x = -step_m / half_cycle * duration_s / 2 if straight else -HALF_TRACK_M
    before = 4
    x -= (before + 1 + subject.phase) * step_m
    time = -(before + subject.phase) * half_cycle - MIDSTANCE * subject.cycle_s
    side, heading, turn_sign = subject.side, 0.0, 1.0
    plan: list[tuple[float, float]] = []  # advance and rotation of the steps ahead
    steps: list[Step] = []
    while time < duration_s + 1.6 * subject.cycle_s:
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
        side, time = "r" if side == "l" else "l", time + half_cycle
    return steps


def _foot(own: list[Step], subject: Subject) -> Callable[[Array], tuple[Array, Array, Array]]:
    """Ankle (n, 3), pitch (n,), positive with toes down, and yaw (n,) of one foot at times (n,)."""
    cycle, height = subject.cycle_s, subject.height_m
    keys: list[tuple[float, float]] = []
    for step, following in itertools.pairwise([*own, own[-1]]):
        # Short steps roll less.
        lift = 60 * min(max(subject.amplitude * following.vigour, 0.25), 1.1)
        keys += [
            (step.time, -math.radians(18) * subject.amplitude * step.vigour),
            (step.time + 0.10 * cycle, 0.0),
            (step.time + (STANCE - 0.20) * cycle, 0.0),
            (step.time + (STANCE + 0.09) * cycle, math.radians(lift)),
        ]
    pitch = partial(keyed, times=[time for time, _ in keys], values=[value for _, value in keys])
    landings = np.array([step.time for step in own])
    yawing = np.stack([landings - (1 - STANCE) * cycle, landings], axis=1).ravel()
    yaw = partial(keyed, times=yawing[1:], values=np.repeat([step.heading for step in own], 2)[:-1])

    def standing(step: Step, t: Array) -> Array:
        """Ankle over its footprint, as the foot rolls about the toe or the heel."""
        heel = rolled(np.minimum(pitch(t), 0.0), height, HEEL_X, ANKLE)
        toe = rolled(np.maximum(pitch(t), 0.0), height)
        aside = SIDES[step.side] * subject.track_m
        across = aside * np.array([-math.sin(step.heading), math.cos(step.heading), 0.0])
        over = about(z=step.heading).apply(ANKLE * height * UP + heel + toe)
        return np.array([*step.middle, 0.0]) + across + over

    def foot(t: Array) -> tuple[Array, Array, Array]:
        ankle = np.zeros((len(t), 3))
        first, last = np.searchsorted(landings, (t[0], t[-1]), side="right")
        for step, after in itertools.pairwise(own[max(first - 1, 0) : last + 1]):
            lift = step.time + STANCE * cycle
            down = (t >= step.time) & (t < lift)
            ankle[down] = standing(step, t[down])
            swings = (t >= lift) & (t < after.time)
            ends = state(partial(standing, step), lift), state(partial(standing, after), after.time)
            path = hermite(t[swings], (lift, after.time), *ends)
            clearance = 0.042 * height * bump((t[swings] - lift) / (after.time - lift))
            ankle[swings] = path + clearance[:, None] * UP
        return ankle, pitch(t), yaw(t)

    return foot


def walk(duration_s: float, subject: Subject) -> PosesAt:
    """A walk, facing and starting along +x."""
    from scipy.interpolate import CubicSpline  # slow to import

    steps = footprints(subject, duration_s)
    over = np.array([step.time + MIDSTANCE * subject.cycle_s for step in steps])
    middles = np.array([step.middle for step in steps])
    headings = np.array([step.heading for step in steps])
    across = np.stack([-np.sin(headings), np.cos(headings)], axis=1)
    sway = 0.3 * subject.track_m * np.array([SIDES[step.side] for step in steps])
    path_at = CubicSpline(over, middles + sway[:, None] * across)
    heading_at = CubicSpline(over, headings)
    vigour_at = partial(keyed, times=over, values=[step.vigour for step in steps])
    first_left_s = next(step.time for step in steps if step.side == "l")
    foot_at = {
        side: _foot([step for step in steps if step.side == side], subject) for side in SIDES
    }
    height = subject.height_m

    def poses(t: Array) -> Pose:
        path, heading, vigour = path_at(t), heading_at(t), vigour_at(t)
        phase = 2 * np.pi * (t - first_left_s) / subject.cycle_s  # 0 where the left foot lands
        bob = np.cos(2 * (phase - 2 * np.pi * MIDSTANCE))
        z = height * (ROOT - 0.006 - vigour * (0.010 - 0.011 * bob))
        pelvis = about(
            z=heading - math.radians(5) * vigour * np.cos(phase),
            x=math.radians(3) * vigour * np.sin(phase),
            y=math.radians(3),
        )
        thorax = about(
            z=heading + math.radians(6) * vigour * np.cos(phase),
            y=math.radians(4) + math.radians(1) * vigour * np.cos(2 * phase),
        )
        ankles, feet, arms = {}, {}, {}
        for side, sign in SIDES.items():
            ankle, pitch, yaw = foot_at[side](t)
            ankles[side], feet[side] = ankle, about(z=yaw, y=pitch)
            # Each arm swings with the other leg.
            beat = -sign * np.cos(phase - math.radians(15))
            swing = math.radians(20) * subject.amplitude * subject.uneven[side] * vigour
            arms[side] = swing_arm(
                thorax,
                side,
                forward=math.radians(3) + swing * beat,
                outward=math.radians(9),
                elbow=math.radians(22) + math.radians(12) * vigour * (1 + beat) / 2,
            )
        root, head = xyz(path[:, 0], path[:, 1], z), about(z=heading, y=math.radians(4))
        left = about(z=heading).apply(LEFT)
        return Pose(
            root=root,
            pelvis=pelvis,
            thorax=thorax,
            head=head,
            ankles=ankles,
            feet=feet,
            arms=arms,
            left=left,
        )

    return poses
