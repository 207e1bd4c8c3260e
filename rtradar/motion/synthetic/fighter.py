"""A fighter: feet that step and pivot, a trunk over them, hands, and legs that leave the floor.

Kicks and punches plan the moves of each part ahead, one strike after another; here they become
poses. Lengths are relative to the standing height, those of hands and kicks to the arm and the leg.
A foot on the floor stands on its toe, about which it pivots and its heel rises. How high the root
may be follows from the legs that carry.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from rtradar.motion.synthetic.figure import (
    ANKLE,
    FOREARM,
    HIP,
    HIP_Y,
    LEFT,
    OTHER,
    ROOT,
    SHANK,
    SIDES,
    THIGH,
    TOE_HEIGHT,
    TOE_X,
    UPPER_ARM,
    Array,
    Pose,
    Subject,
    about,
    bend,
    bump,
    keyed,
    reach_arm,
    smooth,
    xyz,
)

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

TOE = np.array([TOE_X, 0.0, TOE_HEIGHT - ANKLE])
"""Toe from the ankle."""

_LEG, _LONGEST = THIGH + SHANK, 0.992
"""Length of a leg, and how far one that carries is stretched at most, so that knees stay bent."""

_SHARPNESS = 260.0
"""How sharply the root turns from the wanted height to what legs allow: 4 mm below where equal."""

_SHORTEST_S, _BETWEEN_S = 0.06, 0.025
"""No move is shorter, and both feet are on the floor at least as long between steps."""

CLEARANCE = 0.135
"""Height of the ankle of a leg in the air, so that a stretched foot does not touch the floor."""


class Track:
    """A quantity of some numbers that rests or makes minimum-jerk moves, planned in order."""

    def __init__(self, *start: float) -> None:
        self._times, self._values = [-101.0, -100.0], [start, start]

    @property
    def last(self) -> tuple[float, ...]:
        """Value after all moves planned so far."""
        return self._values[-1]

    @property
    def end(self) -> float:
        """End of the last move planned so far [s]."""
        return self._times[-1]

    def move(self, begin: float, end: float, *value: float) -> None:
        """Move to a value from ``begin`` to ``end`` [s], or as soon as the last move is over."""
        begin = max(begin, self._times[-1])
        if begin > self._times[-1] + 1e-6:
            self._times.append(begin)
            self._values.append(self.last)
        self._times.append(max(end, begin + _SHORTEST_S))
        self._values.append(value)

    def at(self, t: Array) -> Array:
        """Values (number, n) at times (n,) [s]."""
        # Moves long before and after do not matter.
        first = max(int(np.searchsorted(self._times, t[0], side="right")) - 2, 0)
        last = int(np.searchsorted(self._times, t[-1], side="right")) + 2
        return keyed(t, self._times[first:last], self._values[first:last]).T


@dataclass(kw_only=True)
class _Foot:
    """Plans of one foot: its toe, yaw and raised heel on the floor, and the leg in the air.

    ``leg`` is azimuth, elevation (beyond -90 degrees it points back) and reach of the ankle from
    the hip, roll of the knee's axis about the leg, and flexion of the foot; ``air`` is 1 where that
    holds. While ``free`` is above 0 the root may be higher than the leg would reach from its
    foothold, by as much of the height. ``lifts`` are begins, ends, clearances and pitches of steps.
    """

    toe: Track
    yaw: Track
    heel: Track
    air: Track = field(default_factory=lambda: Track(0.0))
    free: Track = field(default_factory=lambda: Track(0.0))
    leg: Track = field(default_factory=lambda: Track(0.0, -1.55, 0.97, 0.0, 0.0))
    lifts: list[tuple[float, float, float, float]] = field(default_factory=list)

    def lifted(self, t: Array) -> tuple[Array, Array]:
        """Clearance and pitch (n,) of steps."""
        if not self.lifts:
            return np.zeros(len(t)), np.zeros(len(t))
        begins, ends, clearances, pitches = np.array(self.lifts).T
        step = np.maximum(np.searchsorted(begins, t, side="right") - 1, 0)
        up = bump((t - begins[step]) / (ends - begins)[step])
        return clearances[step] * up, pitches[step] * up


class Fighter:
    """Plans of a fighter, who begins in a stance, facing +x.

    The ``bearing`` is a stance of ``traits.toml``, whose ``lead`` is the side of the foot in front,
    and ``habits`` are how the subject strikes. What differs from strike to strike is drawn as the
    plan goes on.
    """

    def __init__(self, subject: Subject, bearing: SimpleNamespace, habits: SimpleNamespace) -> None:
        bearing.heel = max(bearing.heel, 0.0)
        for angle in ("bladed", "lean", "heel", "elbow"):
            setattr(bearing, angle, math.radians(getattr(bearing, angle)))
        self.subject, self.bearing, self.lead = subject, bearing, bearing.lead
        self.habits = habits
        self.rng = np.random.default_rng([subject.manner, int(2**32 * subject.phase)])
        self.facing = 0.0
        """Yaw of the opponent [rad], a multiple of full turns."""
        # Everything begins in the stance, and rests there until a move is planned.
        self.feet = {}
        for side in SIDES:
            x, y, yaw = self.place(side, 0.0, 0.0)
            heel = bearing.heel * (side != self.lead)
            self.feet[side] = _Foot(toe=Track(x, y), yaw=Track(yaw), heel=Track(heel))
        self.root = Track(*self.middle())
        self.depth = Track(bearing.depth)
        turned = -SIDES[self.lead] * bearing.bladed
        # Yaw, and tilt forward and to the right in world axes.
        self.pelvis = Track(turned, 0.5 * bearing.lean, 0.0)
        self.thorax = Track(turned, bearing.lean, 0.0)
        self.wrists = {side: Track(*self.guard(side)) for side in SIDES}
        self.elbows = {side: Track(bearing.elbow) for side in SIDES}
        self.stepped = -100.0
        """When the last step ended, or a leg came down."""
        phases = np.random.default_rng(subject.manner).uniform(0, 2 * math.pi, 12)
        self._phases = phases + 2 * math.pi * subject.phase

    def between(self, low: float, high: float) -> float:
        """Draw a number, uniform from ``low`` to ``high``."""
        return float(self.rng.uniform(low, high))

    # -- where things are in the stance ------------------------------------------------------------

    def guard(self, side: str) -> tuple[float, float, float]:
        """Wrist of a side from its shoulder, in arm lengths along the axes of the thorax."""
        own = self.bearing
        return own.ahead + 0.12 * (side == self.lead), -SIDES[side] * own.inward, own.up

    def place(self, side: str, x: float, y: float) -> tuple[float, float, float]:
        """Toe and yaw of a foot in a stance about the point (x, y)."""
        own = self.bearing
        front = 0.5 if side == self.lead else -0.5
        yaw = SIDES[side] * (math.radians(6) if side == self.lead else 0.75 * own.bladed)
        return (
            x + front * own.stagger + TOE_X * math.cos(yaw),
            y + SIDES[side] * own.spread / 2 + TOE_X * math.sin(yaw),
            self.facing + yaw,
        )

    def ankle(self, side: str) -> tuple[float, float]:
        """Place of an ankle over the floor after all moves planned so far."""
        foot = self.feet[side]
        (x, y), (yaw,) = foot.toe.last, foot.yaw.last
        return x - TOE_X * math.cos(yaw), y - TOE_X * math.sin(yaw)

    def middle(self) -> tuple[float, float]:
        """Place of the root between both feet, more over the one in front."""
        front, back = (np.array(self.ankle(side)) for side in (self.lead, self.rear))
        x, y = 0.54 * front + 0.46 * back
        return float(x), float(y)

    @property
    def rear(self) -> str:
        """The side of the foot behind."""
        return OTHER[self.lead]

    # -- plans -------------------------------------------------------------------------------------

    def step(self, side: str, begin: float, end: float, to: Sequence[float], lift: float) -> float:
        """Step with a foot to toe and yaw ``to``, after the last step; return its end."""
        foot, (x, y, yaw) = self.feet[side], to
        duration, begin = end - begin, max(begin, self.stepped + _BETWEEN_S)
        self.stepped = begin + duration
        # Steps follow one another: a step that is asked for too early begins when the last foot is
        # down.
        foot.lifts.append((begin, self.stepped, lift, math.radians(28)))
        # The foot moves while it is off the floor.
        foot.toe.move(begin + 0.06 * duration, self.stepped - 0.04 * duration, x, y)
        foot.yaw.move(begin, self.stepped, yaw)
        heel = self.bearing.heel * (side != self.lead)
        foot.heel.move(begin, self.stepped, heel)
        return self.stepped

    def pivot(self, side: str, begin: float, end: float, yaw: float) -> None:
        """Turn a foot on the floor about its toe, with the heel raised, to a yaw [rad]."""
        foot = self.feet[side]
        begin = max(begin, foot.lifts[-1][1] if foot.lifts else begin)
        end = max(end, begin + 2 * _SHORTEST_S)
        foot.lifts.append((begin, end, 0.0, math.radians(9)))
        foot.yaw.move(begin, end, yaw)

    def turn_home(self, begin: float, end: float) -> None:
        """Turn hips and shoulders back to the stance, and upright."""
        turned, lean = self.facing - SIDES[self.lead] * self.bearing.bladed, self.bearing.lean
        self.pelvis.move(begin, end, turned, 0.5 * lean, 0.0)
        self.thorax.move(begin + 0.03, end + 0.03, turned, lean, 0.0)

    def into_stance(self, begin: float, end: float, x: float, y: float, lift: float) -> float:
        """Bring feet, hips, shoulders and hands back to the stance about a point; return when."""
        own, at = self.bearing, begin
        # A foot that is far from its place steps there, the rear one first; one that is near stays.
        for side, other in ((self.rear, self.lead), (self.lead, self.rear)):
            to, foot = self.place(side, x, y), self.feet[side]
            far = math.dist(to[:2], foot.toe.last)
            if far > 0.015 or abs(to[2] - foot.yaw.last[0]) > 0.5:
                # First the weight comes over the foot that stays.
                at = max(at, self.root.end + 0.14, self.stepped + _BETWEEN_S)
                over = 0.7 * np.array(self.ankle(other)) + 0.3 * np.array(self.middle())
                self.root.move(at - 0.14, at + 0.14, *over.tolist())
                at = self.step(side, at, at + 0.5 * (end - begin), to, lift * min(1.0, far / 0.1))
            else:
                foot.heel.move(at, end, own.heel * (side != self.lead))
        # Trunk and hands come back meanwhile.
        end = max(at + 0.16, end)
        self.root.move(at - 0.16, end, *self.middle())
        self.turn_home(begin, end)
        self.depth.move(begin, end, own.depth)
        for side in SIDES:
            self.wrists[side].move(begin, end, *self.guard(side))
            self.elbows[side].move(begin, end, own.elbow)
        return end

    # -- poses -------------------------------------------------------------------------------------

    def _idle(self, t: Array, number: int, hz: float) -> Array:
        """A restless number of root mean square about 0.6, of two tones without common period."""
        angle = 2 * math.pi * hz * self.subject.tempo * t
        return 0.7 * np.sin(angle + self._phases[number]) + 0.5 * np.sin(
            1.618 * angle + self._phases[(number + 5) % 12]
        )

    def poses(self, t: Array) -> Pose:
        """Poses at times (n,) [s]."""
        own, height, hz = self.bearing, self.subject.height_m, self.bearing.pulse
        # The plan with small restless motions on top, those of hips and shoulders alike in phase.
        x, y = self.root.at(t)
        x, y = x + own.sway * self._idle(t, 0, 0.5 * hz), y + own.sway * self._idle(t, 1, 0.5 * hz)
        idle = 2.5 * own.sway * np.stack([self._idle(t, k, 0.5 * hz) for k in (2, 3, 4)])
        yaw, ahead, aside = self.pelvis.at(t) + idle
        pelvis = about(y=ahead, x=aside, z=yaw)
        turned, lean, side_lean = self.thorax.at(t) + 1.6 * idle
        thorax = about(y=lean, x=side_lean, z=turned)

        # The wanted height of the root, softly limited to just below standing upright.
        wanted = ROOT - self.depth.at(t)[0] + own.bounce * self._idle(t, 5, hz)
        wanted = -np.logaddexp(-_SHARPNESS * wanted, -_SHARPNESS * (ROOT - 0.012)) / _SHARPNESS
        root, limits = xyz(x, y, wanted), []
        # How high each leg lets the root be: a leg that is all but stretched from its foothold to
        # the hip. A leg in the air is freed of it by `free`.
        for side in SIDES:
            foot = self.feet[side]
            hip = pelvis.apply([0.0, SIDES[side] * HIP_Y, HIP - ROOT])
            flat, toe = self._flat(foot, t)
            ankle = toe - flat.apply(TOE)
            gap = np.sum((root + hip - ankle)[:, :2] ** 2, axis=1)
            leg = ankle[:, 2] + np.sqrt(np.maximum((_LONGEST * _LEG) ** 2 - gap, 0.01))
            limits.append(leg - hip[:, 2] + foot.free.at(t)[0])
        # The root rises as wanted, but no higher than both legs allow. The soft minimum of these
        # heights has no kink in time.
        levels = -_SHARPNESS * np.stack([wanted, *limits])
        root[:, 2] = -np.logaddexp.reduce(levels) / _SHARPNESS

        # With the root known, legs and arms follow.
        legs = {side: self._leg(side, t, root, pelvis, yaw) for side in SIDES}
        arm, arms = (UPPER_ARM + FOREARM) * height, {}
        for number, side in enumerate(SIDES):
            moved = [self._idle(t, 6 + 3 * number + k, 0.8 * hz) for k in range(3)]
            wrist = self.wrists[side].at(t) + own.restless * np.stack(moved)
            reach = arm * thorax.apply(wrist.T)
            arms[side] = reach_arm(thorax, side, reach, height, self.elbows[side].at(t)[0])
        return Pose(
            root=height * root,
            pelvis=pelvis,
            thorax=thorax,
            # The eyes stay on the opponent, as far as the neck allows.
            head=about(y=0.5 * lean, z=turned - 0.5 * np.sin(turned)),
            ankles={side: height * legs[side][0] for side in SIDES},
            feet={side: legs[side][1] for side in SIDES},
            arms=arms,
            left={side: legs[side][2] for side in SIDES},
            shrug=math.radians(3),
        )

    def _flat(self, foot: _Foot, t: Array) -> tuple[Rotation, Array]:
        """Orientation and toe (n, 3) of a foot as if it were not in the air."""
        lift, pitch = foot.lifted(t)
        flat = about(z=foot.yaw.at(t)[0], y=pitch + foot.heel.at(t)[0])
        x, y = foot.toe.at(t)
        return flat, xyz(x, y, TOE_HEIGHT + lift)

    def _leg(
        self, side: str, t: Array, root: Array, pelvis: Rotation, pelvis_yaw: Array
    ) -> tuple[Array, Rotation, Array]:
        """Ankle (n, 3), orientation of the foot, and axis of the knee (n, 3)."""
        foot = self.feet[side]
        (yaw,), (air,) = foot.yaw.at(t), foot.air.at(t)
        flat, toe = self._flat(foot, t)
        turned = 0.6 * yaw + 0.4 * pelvis_yaw
        if not air.any():
            return toe - flat.apply(TOE), flat, about(z=turned).apply(LEFT)
        # In the air the ankle is where azimuth, elevation and reach put it from the hip, kept above
        # the floor.
        azimuth, elevation, reach, roll, flexion = foot.leg.at(t)
        hip = root + pelvis.apply([0.0, SIDES[side] * HIP_Y, HIP - ROOT])
        level, up = np.cos(elevation), np.sin(elevation)
        along = xyz(np.cos(azimuth) * level, np.sin(azimuth) * level, up)
        flying = hip + (_LEG * reach)[:, None] * along
        flying[:, 2] = np.logaddexp(90 * flying[:, 2], 90 * CLEARANCE) / 90
        # The knee's axis goes with the leg, and rolls about it.
        turned, raised = turned + air * (azimuth - turned), air * (elevation + math.pi / 2)
        rolling = about(z=-SIDES[side] * roll * air)
        hinge = (about(z=turned, y=-raised) * rolling).apply(LEFT)
        # Up before forward, and forward before down.
        ankle = toe - flat.apply(TOE) + air[:, None] * (flying - toe + flat.apply(TOE))
        ankle[:, 2] += 0.16 * air * (1 - air)
        _, shank = bend(_within_reach(ankle - hip), THIGH, SHANK, hinge, 1.0)
        change = (flat.inv() * shank * about(y=flexion)).as_rotvec()
        turning = flat * type(flat).from_rotvec(air[:, None] * change)
        # While it is partly on the floor the foot rolls about its toe, so that this does not sink.
        rolled = (1 - air)[:, None] * (flat.apply(TOE) - turning.apply(TOE))
        ankle = ankle + rolled
        gap = ankle - hip
        held = smooth(air / 0.1)[:, None]
        return ankle + held * (_within_reach(gap) - gap), turning, hinge


def _within_reach(leg: Array) -> Array:
    """Vectors from hips to ankles (n, 3), shortened smoothly to less than a leg."""
    far = np.linalg.norm(leg, axis=1, keepdims=True)
    near = -np.logaddexp(-_SHARPNESS * far, -_SHARPNESS * 0.996 * _LEG) / _SHARPNESS
    return np.asarray(leg * near / far)
