"""A synthetic walk: footprints first, then feet that roll over them, then the body that follows.

``traits.toml`` says how walkers differ.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from rtradar.motion.synthetic.figure import (
    ANKLE,
    HEEL_X,
    LEFT,
    NECK_BASE,
    OTHER,
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

_TURN_STEPS = 4


class Gait(SimpleNamespace):
    """How somebody walks: the traits of a table, and what follows from them."""

    def stance_of(self, lame: float) -> float:
        """Part of the cycle for which a foot stands, that of the lame side with ``lame`` = 1."""
        return self.stance + lame * self.lame_stance

    def midstance(self, lame: float = 0.0) -> float:
        """Part of the cycle from landing until the body is over the foot, later in long stances."""
        return 0.7 * self.stance_of(lame) ** 2

    def cycle_of(self, subject: Subject) -> float:
        """Duration of two steps [s]; it grows with the root of the height."""
        return self.cycle_s * math.sqrt(subject.height_m / 1.75 / subject.tempo)

    def step_of(self, subject: Subject) -> float:
        """Length of one step [m]; who walks faster takes longer and quicker steps alike."""
        return self.step * subject.height_m * subject.amplitude * math.sqrt(subject.tempo)


class Step(NamedTuple):
    """One footprint: side, landing time, body's position (2,) [m], heading [rad], relative step."""

    side: str
    time: float
    middle: Array
    heading: float
    vigour: float


def footprints(subject: Subject, gait: Gait, duration_s: float) -> list[Step]:
    """Make steps from more than a cycle before 0 to more than a cycle after ``duration_s``."""
    cycle_s, step_m = gait.cycle_of(subject), gait.step_of(subject)
    half_cycle = cycle_s / 2
    straight = step_m / half_cycle * duration_s <= STRAIGHT_M
    x = -step_m / half_cycle * duration_s / 2 if straight else -HALF_TRACK_M
    before = 4
    x -= (before + 1 + subject.phase) * step_m
    time = -(before + subject.phase) * half_cycle - gait.midstance() * cycle_s
    side, heading, turn_sign = subject.side, 0.0, 1.0
    uneven = np.random.default_rng(subject.manner)
    plan: list[tuple[float, float]] = []  # advance and rotation of the steps ahead
    steps: list[Step] = []
    while time < duration_s + 2 * cycle_s:
        direction = round(math.cos(heading))
        lame = 1.0 if side == subject.side else -1.0
        if not plan and not straight and direction * x + 1.5 * step_m > HALF_TRACK_M:
            rest = max(HALF_TRACK_M - direction * x, 0.0)
            plan = [(rest, 0.0)] if rest < 0.6 * step_m else [(rest / 2, 0.0)] * 2
            plan += [(0.0, turn_sign * math.pi / _TURN_STEPS)] * _TURN_STEPS + [(step_m / 2, 0.0)]
            turn_sign = -turn_sign
        own, late = 1 + gait.unsteady * np.clip(uneven.standard_normal(2), -2.0, 2.0)
        usual = step_m * (own + lame * gait.lame_step)
        advance, turning = plan.pop(0) if plan else (usual, 0.0)
        heading += turning
        x += advance * math.cos(heading)
        steps.append(Step(side, time, np.array([x, 0.0]), heading, min(advance / step_m, 1.0)))
        side = OTHER[side]
        # The foot of the other side lands next.
        time += half_cycle * (late - lame * gait.lame_late)
    return steps


def _foot(
    own: list[Step], subject: Subject, gait: Gait
) -> Callable[[Array], tuple[Array, Array, Array]]:
    """Ankle (n, 3), pitch (n,), positive with toes down, and yaw (n,) of one foot at times (n,)."""
    cycle, height = gait.cycle_of(subject), subject.height_m
    lame = float(own[0].side == subject.side)
    stance = gait.stance_of(lame)
    toe_off = gait.toe_off_deg + lame * gait.lame_toe_off_deg
    landing = -gait.heel_strike_deg + lame * gait.lame_landing_deg
    keys: list[tuple[float, float]] = []
    for step, following in itertools.pairwise([*own, own[-1]]):
        # Short steps roll less.
        lift = toe_off * min(max(subject.amplitude * following.vigour, 0.25), 1.1)
        keys += [
            (step.time, math.radians(landing) * subject.amplitude * step.vigour),
            (step.time + 0.10 * cycle, 0.0),
            (step.time + (stance - 0.24) * cycle, 0.0),
            (step.time + (stance + 0.07) * cycle, math.radians(lift)),
        ]
    pitch = partial(keyed, times=[time for time, _ in keys], values=[value for _, value in keys])
    landings = np.array([step.time for step in own])
    yawing = np.stack([landings - (1 - stance) * cycle, landings], axis=1).ravel()
    yaw = partial(keyed, times=yawing[1:], values=np.repeat([step.heading for step in own], 2)[:-1])
    beyond = lame * height * np.array([gait.lame_reach, gait.lame_aside, gait.lame_lift])
    beyond[1] *= SIDES[own[0].side]

    def standing(step: Step, t: Array) -> Array:
        """Ankle over its footprint, as the foot rolls about the toe or the heel."""
        heel = rolled(np.minimum(pitch(t), 0.0), height, HEEL_X, ANKLE)
        toe = rolled(np.maximum(pitch(t), 0.0), height)
        aside = SIDES[step.side] * gait.track * height
        across = aside * np.array([-math.sin(step.heading), math.cos(step.heading), 0.0])
        over = about(z=step.heading).apply(ANKLE * height * UP + heel + toe)
        return np.array([*step.middle, 0.0]) + across + over

    def foot(t: Array) -> tuple[Array, Array, Array]:
        ankle = np.zeros((len(t), 3))
        first, last = np.searchsorted(landings, (t[0], t[-1]), side="right")
        for step, after in itertools.pairwise(own[max(first - 1, 0) : last + 1]):
            lift = step.time + stance * cycle
            down = (t >= step.time) & (t < lift)
            ankle[down] = standing(step, t[down])
            swings = (t >= lift) & (t < after.time)
            ends = state(partial(standing, step), lift), state(partial(standing, after), after.time)
            path = hermite(t[swings], (lift, after.time), *ends)
            swung = (t[swings] - lift) / (after.time - lift)
            ankle[swings] = path + gait.clearance * height * bump(swung)[:, None] * UP
            # The swinging foot hurries less in the middle than in the least jerky move.
            even = gait.swing_even * bump(swung) * (0.5 - swung)
            ankle[swings] += even[:, None] * (ends[1][0] - ends[0][0])
            late = after.vigour * bump(swung**gait.lame_end)[:, None]
            ankle[swings] += late * about(z=after.heading).apply(beyond)
        return ankle, pitch(t), yaw(t)

    return foot


class _Body(NamedTuple):
    """What the whole body follows, at times (n,)."""

    path: Callable[[Array], Array]
    """Position over the floor (n, 2)."""
    heading: Callable[[Array], Array]
    phase: Callable[[Array], Array]
    """Angle that is 0 where the left foot lands, and pi where the right one does."""
    vigour: Callable[[Array], Array]


def _body(steps: list[Step], subject: Subject, gait: Gait) -> _Body:
    from scipy.interpolate import CubicSpline  # slow to import

    landings = np.array([step.time for step in steps])
    first = 0.0 if steps[0].side == "l" else np.pi
    headings = np.array([step.heading for step in steps])
    across = np.stack([-np.sin(headings), np.cos(headings)], axis=1)
    sway = gait.sway * gait.track * subject.height_m
    swayed = sway * np.array([SIDES[step.side] for step in steps])[:, None] * across
    # The body does not limp as much as the feet: it goes over the mean of three footprints.
    smoothed = [
        np.concatenate([some[:1], (some[:-2] + 2 * some[1:-1] + some[2:]) / 4, some[-1:]])
        for some in (landings, np.array([step.middle for step in steps]))
    ]
    middle = np.array([gait.midstance(float(step.side == subject.side)) for step in steps])
    over = smoothed[0] + middle * gait.cycle_of(subject)
    return _Body(
        path=CubicSpline(over, smoothed[1] + swayed),
        heading=CubicSpline(over, headings),
        phase=CubicSpline(landings, first + np.pi * np.arange(len(steps))),
        vigour=partial(keyed, times=over, values=[step.vigour for step in steps]),
    )


def walk(duration_s: float, subject: Subject) -> PosesAt:
    """A walk, facing and starting along +x."""
    return _steps(duration_s, subject, f"walk_{subject.style or 'normal'}")


def walk_in_place(duration_s: float, subject: Subject) -> PosesAt:
    """Steps on the spot, facing +x."""
    return _steps(duration_s, subject, "walk_in_place")


def _steps(duration_s: float, subject: Subject, table: str) -> PosesAt:
    gait = Gait(**vars(subject.traits(table)))
    steps = footprints(subject, gait, duration_s)
    body = _body(steps, subject, gait)
    foot_at = {
        side: _foot([step for step in steps if step.side == side], subject, gait) for side in SIDES
    }
    return partial(_pose, subject, gait, body, foot_at)


def _pose(
    subject: Subject,
    gait: Gait,
    body: _Body,
    foot_at: dict[str, Callable[[Array], tuple[Array, Array, Array]]],
    t: Array,
) -> Pose:
    height, toward = subject.height_m, SIDES[subject.side]
    path, heading, phase, vigour = (one(t) for one in body)
    lame = phase if subject.side == "l" else phase - np.pi  # 0 where the lame foot lands
    stance = gait.stance_of(1.0)

    def near(part: float) -> Array:
        """1 at a part of the cycle after the lame foot has landed, 0 half a cycle away."""
        return np.asarray(vigour * (0.5 + 0.5 * np.cos(lame - 2 * np.pi * part)) ** 2)

    loaded, swinging, landing = near(0.45 * stance), near((1 + stance) / 2), near(-0.05)
    twice = 2 * (phase - 2 * np.pi * gait.midstance(0.5))
    pulse_m = gait.pulse_mps * gait.cycle_of(subject) / (4 * np.pi)
    forward = -vigour * pulse_m * np.sin(twice)
    # The neck moves less than the hips do.
    rocking = -(1 - gait.trunk_pulse) * forward / ((NECK_BASE - ROOT) * height)
    back = math.radians(gait.lame_back_deg) * landing
    away = toward * math.radians(gait.lame_away_deg) * swinging
    aside = toward * height * gait.lame_sway * loaded
    root = xyz(
        path[:, 0] + forward * np.cos(heading) - aside * np.sin(heading),
        path[:, 1] + forward * np.sin(heading) + aside * np.cos(heading),
        height * (ROOT - 0.004 - vigour * gait.bob * (1 - np.cos(twice)) - gait.lame_dip * loaded),
    )
    over = np.sin(phase + 0.08 * np.pi)
    tipped = math.radians(gait.lame_drop_deg) * loaded + math.radians(gait.lame_hike_deg) * swinging
    lean, leant = math.radians(gait.lean_deg), math.radians(gait.lame_leant_deg) * loaded
    pelvis = about(
        z=heading - math.radians(gait.hip_yaw_deg) * vigour * np.cos(phase - 0.1 * np.pi),
        x=math.radians(gait.drop_deg) * vigour * np.sin(phase) + toward * tipped,
        y=0.5 * lean + rocking - 0.3 * back,
    )
    thorax = about(
        z=heading + math.radians(gait.chest_yaw_deg) * vigour * np.cos(phase),
        x=-math.radians(gait.lateral_deg) * vigour * over + away + toward * leant,
        y=lean + rocking - back,
    )
    ankles, feet, arms = {}, {}, {}
    for side, sign in SIDES.items():
        ankle, pitch, yaw = foot_at[side](t)
        ankles[side], feet[side] = ankle, about(z=yaw, y=pitch)
        # Each arm swings with the other leg.
        beat = -sign * np.cos(phase - math.radians(gait.arm_lag_deg))
        loss = 1 - gait.lame_arm * (side == subject.side)
        swing = math.radians(gait.arm_deg) * subject.amplitude * subject.uneven[side] * loss
        bent = math.radians(gait.elbow_swing_deg) * loss * vigour * (1 + beat) / 2
        arms[side] = swing_arm(
            thorax,
            side,
            forward=math.radians(gait.arm_forward_deg) + swing * vigour * beat + lean,
            outward=math.radians(gait.arm_outward_deg),
            elbow=math.radians(gait.elbow_deg) + bent,
        )
    return Pose(
        root=root,
        pelvis=pelvis,
        thorax=thorax,
        head=about(z=heading, y=math.radians(4) - 0.4 * back),
        ankles=ankles,
        feet=feet,
        arms=arms,
        left=about(z=heading).apply(LEFT),
    )
