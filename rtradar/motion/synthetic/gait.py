"""A synthetic walk: footprints first, then feet that roll over them, then the body that follows.

``traits.toml`` says how walkers differ.
"""

from __future__ import annotations

import itertools
import math
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING, NamedTuple

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

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

HALF_TRACK_M, STRAIGHT_M = 1.5, 4.2
"""Distance from the middle at which long walks turn round, and the length of straight walks [m]."""

_TURN_STEPS = 4


class Step(NamedTuple):
    """One footprint: side, landing time, body's position (2,) [m], heading [rad], relative step."""

    side: str
    time: float
    middle: Array
    heading: float
    vigour: float


def walk(duration_s: float, subject: Subject, table: str = "") -> PosesAt:
    """A walk, facing and starting along +x; by default that of the subject's style."""
    return _Walker(duration_s, subject, table or f"walk_{subject.style or 'normal'}").poses


class _Walker:
    """Footprints of a walker, and what feet and body follow over them."""

    def __init__(self, duration_s: float, subject: Subject, table: str) -> None:
        traits = vars(subject.traits(table))
        angles = {name: math.radians(value) for name, value in traits.items() if "_deg" in name}
        radians = {name.removesuffix("_deg"): angle for name, angle in angles.items()}
        self.own = SimpleNamespace(**traits, **radians)
        self.subject, height = subject, subject.height_m
        self.cycle_s = self.own.cycle_s * math.sqrt(height / 1.75 / subject.tempo)
        """Duration of two steps [s]; it grows with the root of the height."""
        # Who walks faster takes longer and quicker steps alike.
        self.step_m = self.own.step * height * subject.amplitude * math.sqrt(subject.tempo)
        steps = self._footprints(duration_s)
        self.feet = {
            side: _Foot(self, [step for step in steps if step.side == side]) for side in SIDES
        }
        self._follow(steps)

    def stance(self, lame: float) -> float:
        """Part of the cycle for which a foot stands, that of the lame side with ``lame`` = 1."""
        return float(self.own.stance + lame * self.own.lame_stance)

    def midstance(self, lame: float = 0.0) -> float:
        """Part of the cycle from landing until the body is over the foot, later in long stances."""
        return 0.7 * self.stance(lame) ** 2

    def _footprints(self, duration_s: float) -> list[Step]:
        """Make steps from more than a cycle before 0 to more than a cycle after ``duration_s``."""
        own, step_m, half_cycle = self.own, self.step_m, self.cycle_s / 2
        # A short walk goes through the middle at half its time; a long one goes up and down between
        # two points where it turns round.
        straight = step_m / half_cycle * duration_s <= STRAIGHT_M
        x = -step_m / half_cycle * duration_s / 2 if straight else -HALF_TRACK_M
        x -= (5 + self.subject.phase) * step_m
        time = -(4 + self.subject.phase) * half_cycle - self.midstance() * self.cycle_s
        side, heading, turn = self.subject.side, 0.0, math.pi / _TURN_STEPS
        uneven = np.random.default_rng(self.subject.manner)
        plan: list[tuple[float, float]] = []  # advance and rotation of the steps ahead
        steps: list[Step] = []
        # Near the end of the track the steps ahead are planned: up to the end, some steps on the
        # spot that turn, and a short one back.
        while time < duration_s + 2 * self.cycle_s:
            direction = round(math.cos(heading))
            lame = 1.0 if side == self.subject.side else -1.0
            if not plan and not straight and direction * x + 1.5 * step_m > HALF_TRACK_M:
                rest = max(HALF_TRACK_M - direction * x, 0.0)
                plan = [(rest, 0.0)] if rest < 0.6 * step_m else [(rest / 2, 0.0)] * 2
                plan += [(0.0, turn)] * _TURN_STEPS + [(step_m / 2, 0.0)]
                turn = -turn
            # People step unevenly, and the lame side also differs in length and time.
            far, late = 1 + own.unsteady * np.clip(uneven.standard_normal(2), -2.0, 2.0)
            usual = step_m * (far + lame * own.lame_step)
            advance, turning = plan.pop(0) if plan else (usual, 0.0)
            heading += turning
            x += advance * math.cos(heading)
            steps.append(Step(side, time, np.array([x, 0.0]), heading, min(advance / step_m, 1.0)))
            side = OTHER[side]
            # The foot of the other side lands next.
            time += half_cycle * (late - lame * own.lame_late)
        return steps

    def _follow(self, steps: list[Step]) -> None:
        """Plan what the whole body follows: curves by time."""
        from scipy.interpolate import CubicSpline  # slow to import

        landings = np.array([step.time for step in steps])
        headings = np.array([step.heading for step in steps])
        across = np.stack([-np.sin(headings), np.cos(headings)], axis=1)
        sway = self.own.sway * self.own.track * self.subject.height_m
        # The body sways toward the foot that carries.
        swayed = sway * np.array([SIDES[step.side] for step in steps])[:, None] * across
        # The body does not limp as much as the feet: it goes over the mean of three footprints.
        smoothed = [
            np.concatenate([some[:1], (some[:-2] + 2 * some[1:-1] + some[2:]) / 4, some[-1:]])
            for some in (landings, np.array([step.middle for step in steps]))
        ]
        lame = [float(step.side == self.subject.side) for step in steps]
        # The body is over each footprint some time after the foot has landed there.
        over = smoothed[0] + np.array([self.midstance(one) for one in lame]) * self.cycle_s
        places = np.column_stack([smoothed[1] + swayed, headings])
        self.way = CubicSpline(over, places)
        """Position over the floor [m], and heading."""
        # 0 where the lame foot lands, and pi where the other does.
        self.phase = CubicSpline(landings, np.pi * (np.arange(len(steps)) + 1 - lame[0]))
        self.vigour = partial(keyed, times=over, values=[step.vigour for step in steps])

    def poses(self, t: Array) -> Pose:
        """Poses at times (n,) [s]."""
        own, height, toward = self.own, self.subject.height_m, SIDES[self.subject.side]
        (x, y, heading), lame, vigour = self.way(t).T, self.phase(t), self.vigour(t)
        phase = lame if self.subject.side == "l" else lame + np.pi  # 0 where the left foot lands
        stance = self.stance(1.0)

        def near(part: float) -> Array:
            """1 at a part of the cycle after the lame foot has landed, 0 half a cycle away."""
            return np.asarray(vigour * (0.5 + 0.5 * np.cos(lame - 2 * np.pi * part)) ** 2)

        # When the lame leg carries, swings, and is about to land.
        loaded, swinging, landing = near(0.45 * stance), near((1 + stance) / 2), near(-0.05)
        # Twice a cycle, once a step, the body slows down and speeds up, and sinks while both feet
        # carry.
        twice = 2 * (phase - 2 * np.pi * self.midstance(0.5))
        forward = -vigour * own.pulse_mps * self.cycle_s / (4 * np.pi) * np.sin(twice)
        # The neck moves less than the hips do.
        rocking = -(1 - own.trunk_pulse) * forward / ((NECK_BASE - ROOT) * height)
        back, lean = own.lame_back * landing, own.lean
        # A limp: while the lame leg carries, the root sways to its side and dips, and the other hip
        # drops; while it swings, its hip is raised.
        aside = toward * height * own.lame_sway * loaded
        down = vigour * own.bob * (1 - np.cos(twice)) + own.lame_dip * loaded
        tipped = own.lame_drop * loaded + own.lame_hike * swinging
        # Hips turn with the step and drop on the side of the swinging leg; the chest turns against
        # them.
        pelvis = about(
            z=heading - own.hip_yaw * vigour * np.cos(phase - 0.1 * np.pi),
            x=own.drop * vigour * np.sin(phase) + toward * tipped,
            y=0.5 * lean + rocking - 0.3 * back,
        )
        tilted = own.lame_away * swinging + own.lame_leant * loaded
        thorax = about(
            z=heading + own.chest_yaw * vigour * np.cos(phase),
            x=-own.lateral * vigour * np.sin(phase + 0.08 * np.pi) + toward * tilted,
            y=lean + rocking - back,
        )
        ankles, feet, arms = {}, {}, {}
        for side, sign in SIDES.items():
            ankles[side], feet[side] = self.feet[side].at(t)
            # Each arm swings with the other leg.
            beat = -sign * np.cos(phase - own.arm_lag)
            loss = 1 - own.lame_arm * (side == self.subject.side)
            swing = own.arm * self.subject.amplitude * self.subject.uneven[side] * loss
            ahead = own.arm_forward + swing * vigour * beat + lean
            elbow = own.elbow + own.elbow_swing * loss * vigour * (1 + beat) / 2
            arms[side] = swing_arm(thorax, side, ahead, own.arm_outward, elbow)
        # Along and across the way, turned to where the walker heads.
        root_x = x + forward * np.cos(heading) - aside * np.sin(heading)
        root_y = y + forward * np.sin(heading) + aside * np.cos(heading)
        return Pose(
            root=xyz(root_x, root_y, height * (ROOT - 0.004 - down)),
            pelvis=pelvis,
            thorax=thorax,
            head=about(z=heading, y=math.radians(4) - 0.4 * back),
            ankles=ankles,
            feet=feet,
            arms=arms,
            left=about(z=heading).apply(LEFT),
        )


class _Foot:
    """One foot of a walker, which rolls over its footprints."""

    def __init__(self, walker: _Walker, steps: list[Step]) -> None:
        own, subject, cycle = walker.own, walker.subject, walker.cycle_s
        self.own, self.steps, self.height = own, steps, subject.height_m
        self.side = SIDES[steps[0].side]
        lame = float(steps[0].side == subject.side)
        stance = walker.stance(lame)
        self.stance_s = stance * cycle
        toe_off = own.toe_off_deg + lame * own.lame_toe_off_deg
        landing = math.radians(-own.heel_strike_deg + lame * own.lame_landing_deg)
        keys: list[tuple[float, float]] = []
        # The pitch of the foot over time: it lands on its heel, is soon flat, and late in the
        # stance begins to roll over its toe, which goes on for a moment after it has left the
        # floor.
        for step, following in itertools.pairwise([*steps, steps[-1]]):
            # Short steps roll less.
            lift = toe_off * min(max(subject.amplitude * following.vigour, 0.25), 1.1)
            keys += [
                (step.time, landing * subject.amplitude * step.vigour),
                (step.time + 0.10 * cycle, 0.0),
                (step.time + (stance - 0.24) * cycle, 0.0),
                (step.time + (stance + 0.07) * cycle, math.radians(lift)),
            ]
        times, pitches = zip(*keys, strict=True)
        self.pitch = partial(keyed, times=times, values=pitches)
        """Pitch (n,) by time, positive with toes down."""
        self.landings = np.array([step.time for step in steps])
        # A foot turns in the air, between leaving the floor and landing.
        yawing = np.stack([self.landings - (1 - stance) * cycle, self.landings], axis=1).ravel()
        headings = np.repeat([step.heading for step in steps], 2)
        self.yaw = partial(keyed, times=yawing[1:], values=headings[:-1])
        reach = np.array([own.lame_reach, self.side * own.lame_aside, own.lame_lift])
        self.beyond = lame * self.height * reach

    def _standing(self, step: Step, t: Array) -> Array:
        """Ankle over its footprint, as the foot rolls about the toe or the heel."""
        height, pitch = self.height, self.pitch(t)
        heel = rolled(np.minimum(pitch, 0.0), height, HEEL_X, ANKLE)
        toe = rolled(np.maximum(pitch, 0.0), height)
        across = np.array([-math.sin(step.heading), math.cos(step.heading), 0.0])
        over = about(z=step.heading).apply(ANKLE * height * UP + heel + toe)
        return np.array([*step.middle, 0.0]) + self.side * self.own.track * height * across + over

    def at(self, t: Array) -> tuple[Array, Rotation]:
        """Ankle (n, 3) and orientation (n) at times (n,)."""
        ankle, own = np.zeros((len(t), 3)), self.own
        first, last = np.searchsorted(self.landings, (t[0], t[-1]), side="right")
        for step, after in itertools.pairwise(self.steps[max(first - 1, 0) : last + 1]):
            # On the floor the ankle follows from the roll of the foot over its footprint.
            lift = step.time + self.stance_s
            down = (t >= step.time) & (t < lift)
            ankle[down] = self._standing(step, t[down])
            # In the air a quintic goes on from where, how fast and how accelerated the ankle left
            # the floor, to the same of its landing, with some clearance.
            swings = (t >= lift) & (t < after.time)
            begin = state(partial(self._standing, step), lift)
            end = state(partial(self._standing, after), after.time)
            path = hermite(t[swings], (lift, after.time), begin, end)
            swung = (t[swings] - lift) / (after.time - lift)
            ankle[swings] = path + own.clearance * self.height * bump(swung)[:, None] * UP
            # The swinging foot hurries less in the middle than in the least jerky move.
            even = own.swing_even * bump(swung) * (0.5 - swung)
            ankle[swings] += even[:, None] * (end[0] - begin[0])
            late = after.vigour * bump(swung**own.lame_end)[:, None]
            ankle[swings] += late * about(z=after.heading).apply(self.beyond)
        return ankle, about(z=self.yaw(t), y=self.pitch(t))
