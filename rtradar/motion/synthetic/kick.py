"""Kicks: front, side and roundhouse kicks, spinning back kicks, and kicks at a ball.

A kicker steps in, brings the knee up, extends the leg, draws it back and returns to the stance.
What differs between people is drawn for each subject (`Habits`), what differs between kicks of one
person for each kick.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rtradar.motion.synthetic.fighter import Bearing, Fighter
from rtradar.motion.synthetic.figure import SIDES, TOE_X, PosesAt, Subject


@dataclass(frozen=True, kw_only=True)
class Kind:
    """How a kind of kick goes, angles in degrees, as with the left leg.

    ``chamber``, ``impact`` and ``recoil`` are azimuth and elevation of the ankle from the hip, and
    the reach in leg lengths. The axis of the knee rolls by ``roll`` from the left up, and the foot
    is stretched by ``flexion``. The hips turn to the right by ``turn`` and the support foot by
    ``pivot``; the trunk leans away by ``away`` and to the right by ``aside``.
    The leg is out after ``out_s`` [s].
    """

    chamber: tuple[float, float, float]
    impact: tuple[float, float, float]
    recoil: tuple[float, float, float]
    roll: float
    flexion: float
    turn: float
    pivot: float
    away: float
    aside: float = 0.0
    out_s: float = 0.20


KINDS: Mapping[str, Kind] = {
    "front": Kind(
        chamber=(0, -42, 0.70), impact=(0, 0, 0.97), recoil=(0, -40, 0.66),
        roll=6, flexion=28, turn=26, pivot=30, away=20,
    ),
    "side": Kind(
        chamber=(8, -32, 0.50), impact=(0, -2, 0.97), recoil=(4, -30, 0.52),
        roll=48, flexion=-8, turn=86, pivot=105, away=34, out_s=0.22,
    ),
    "roundhouse": Kind(
        chamber=(58, -26, 0.60), impact=(-4, 2, 0.96), recoil=(-30, -22, 0.62),
        roll=72, flexion=42, turn=84, pivot=100, away=24, aside=8, out_s=0.26,
    ),
    "spin": Kind(
        chamber=(180, -130, 0.60), impact=(180, -174, 0.96), recoil=(180, -135, 0.66),
        roll=0, flexion=-6, turn=-180, pivot=-165, away=36, out_s=0.27,
    ),
    "ball": Kind(
        chamber=(0, -128, 0.86), impact=(0, -72, 0.97), recoil=(-6, -42, 0.95),
        roll=4, flexion=24, turn=20, pivot=16, away=12,
    ),
}  # fmt: skip
"""All kinds of kicks."""

STYLES = tuple(KINDS)


@dataclass(frozen=True, kw_only=True)
class Habits:
    """How a subject kicks, apart from its stance.

    ``shares`` are probabilities of the kinds, ``alternating`` and ``forward`` those that the other
    leg kicks next and that the leg lands in front. Steps in are up to ``step``, relative to the
    height; ``swing`` is how far the arms swing, ``tilt`` and ``turn`` factors of those of the kind,
    ``height_deg`` is added to the elevation, ``load`` is how far the root sinks before a kick and
    ``recoil`` how far it goes back after it. ``pace`` is the speed of strikes and ``rest_s`` the
    longest time between them [s].
    """

    shares: tuple[float, ...]
    alternating: float
    forward: float
    step: float
    swing: float
    tilt: float
    turn: float
    height_deg: float
    load: float
    recoil: float
    pace: float
    rest_s: float

    @classmethod
    def of(cls, subject: Subject) -> Habits:
        """Draw the habits of a subject."""
        if subject.style:
            shares = np.array([float(kind == subject.style) for kind in KINDS])
        else:
            # Each has one or two favourites; spins are rare.
            rng = np.random.default_rng([subject.manner, 1])
            shares = rng.dirichlet([0.9, 0.35, 0.6, 0.12, 0.5])
        drawn = subject.drawn
        load = drawn("load", 0.0, 1.0)
        return cls(
            shares=tuple(shares.tolist()),
            alternating=drawn("alternating", 0.0, 0.9),
            forward=drawn("forward", 0.0, 0.9),
            step=drawn("step", 0.04, 0.62) * min(subject.amplitude, 1.0),
            swing=drawn("swing", 0.15, 1.0),
            tilt=drawn("tilt", 0.4, 1.5),
            turn=drawn("turn", 0.75, 1.25),
            height_deg=drawn("height", -22.0, 16.0) + 30 * (subject.amplitude - 1),
            load=-0.01 + 0.12 * load + 0.12 * load**4,
            recoil=drawn("recoil", 0.0, 0.2),
            pace=drawn("pace", 0.82, 1.18) * subject.tempo,
            rest_s=drawn("rest", 0.1, 1.0),
        )


def _bearing(subject: Subject) -> Bearing:
    drawn = subject.drawn
    depth = drawn("depth", 0.0, 1.0)
    behind = drawn("behind", 0.0, 1.0) < 0.7  # the leg behind kicks
    return Bearing(
        lead=subject.other if behind else subject.side,
        stagger=0.04 + 0.10 * drawn("stagger", 0.0, 1.0) + 0.12 * depth**3,
        spread=drawn("spread", 0.10, 0.16),
        bladed=math.radians(drawn("bladed", 4.0, 42.0)),
        depth=0.018 + 0.03 * depth + 0.15 * depth**3,
        lean=math.radians(drawn("lean", 0.0, 12.0)),
        heel=math.radians(max(drawn("heel", -12.0, 18.0), 0.0)),
        guard=(drawn("ahead", 0.28, 0.55), drawn("inward", 0.0, 0.14), drawn("up", -0.5, 0.12)),
        elbow=math.radians(drawn("elbow", 10.0, 40.0)),
        bounce=drawn("bounce", 0.0, 0.007),
        pulse_hz=drawn("pulse", 1.2, 2.6),
        sway=drawn("sway", 0.001, 0.009),
        restless=drawn("restless", 0.01, 0.05),
    )


def kick(duration_s: float, subject: Subject) -> PosesAt:
    """Kicks of any kind, facing +x."""
    habits, fighter = Habits.of(subject), Fighter(subject, _bearing(subject))
    rng = np.random.default_rng([subject.manner, int(2**32 * subject.phase)])
    leg, t = subject.side, -1.6 * subject.phase
    while t < duration_s + 0.5:
        kind = KINDS[STYLES[int(rng.choice(len(KINDS), p=habits.shares))]]
        t = _plan(fighter, habits, kind, leg, t, rng)
        t += float(rng.uniform(0.03, habits.rest_s)) / subject.tempo
        if rng.random() < habits.alternating:
            leg = "r" if leg == "l" else "l"
    return fighter.poses


def _plan(
    fighter: Fighter, habits: Habits, kind: Kind, leg: str, t: float, rng: np.random.Generator
) -> float:
    """Plan one kick that begins at a time [s], and return when the kicker stands again."""
    own, sign = fighter.bearing, SIDES[leg]
    support = "r" if leg == "l" else "l"
    pace = habits.pace * float(rng.uniform(0.92, 1.08))

    def at(seconds: float) -> float:
        return t + seconds / pace

    # The support foot steps in, and the weight comes over it.
    x, y = fighter.ankle(support)
    step = habits.step * float(rng.uniform(0.3, 1.3)) * (1.0 if x < 0.25 else 0.3)
    step = min(step, 0.52 - abs(x - fighter.ankle(leg)[0]))
    turned = fighter.facing - sign * math.radians(0.25 * kind.pivot)
    spinning = kind.turn < -120
    begin = 0.0
    if step > 0.03:
        to = x + step + TOE_X * math.cos(turned), 0.4 * y + TOE_X * math.sin(turned), turned
        fighter.step(support, at(0.0), at(0.30), to, 0.02 + 0.12 * step)
        begin = 0.16
    fighter.depth.move(at(0.0), at(0.24), own.depth + habits.load)
    x, y = fighter.ankle(support)
    fighter.root.move(at(0.0), at(begin + 0.42), x - 0.01, 0.85 * y)

    # Knee up, leg out, leg back.
    lift = max(begin + 0.20, (fighter.stepped - t) * pace + 0.03)
    chambered = lift + 0.26
    out = chambered + kind.out_s * float(rng.uniform(0.85, 1.2))
    back = out + float(rng.uniform(0.16, 0.30))
    land = back + float(rng.uniform(0.26, 0.40))
    raised = habits.height_deg + float(rng.normal(0, 4))
    foot = fighter.feet[leg]

    def leg_to(
        key: tuple[float, float, float], share: float, roll: float = 1.0
    ) -> tuple[float, ...]:
        azimuth, elevation, reach = key
        # Beyond straight down, backward, it goes up as the elevation falls.
        higher = share * raised * (1 if elevation > -90 else -1)
        angles = np.radians([sign * azimuth, elevation + higher, roll * kind.roll, kind.flexion])
        return fighter.facing + angles[0], angles[1], reach, angles[2], angles[3]

    low = (0.0, -105.0 if spinning else -75.0, 0.93)
    foot.leg.move(at(lift) - 0.1, at(lift), *leg_to(low, 0.0, 0.0))
    foot.leg.move(at(lift), at(chambered), *leg_to(kind.chamber, 0.35))
    foot.leg.move(at(chambered - 0.02), at(out), *leg_to(kind.impact, 1.0))
    foot.leg.move(at(out + 0.01), at(back), *leg_to(kind.recoil, 0.35))
    foot.air.move(at(lift), at(chambered - 0.04), 1.0)
    foot.free.move(at(lift), at(chambered), 0.5)
    foot.heel.move(at(lift - 0.18), at(lift + 0.04), math.radians(40))

    # Hips and support foot turn with it, the trunk leans away.
    turn = -sign * math.radians(kind.turn) * (1.0 if spinning else habits.turn)
    turn, away = fighter.facing + turn, math.radians(kind.away) * habits.tilt
    away *= 0.6 + 0.4 * math.sin(math.radians(max(60.0 + raised, 0.0)))
    aside = sign * math.radians(kind.aside) * habits.tilt
    fighter.pivot(support, at(lift), at(out), fighter.facing - sign * math.radians(kind.pivot))
    (x, y), (toe_x, toe_y) = fighter.ankle(support), fighter.feet[support].toe.last
    over = 0.6 * x + 0.4 * toe_x - 0.02, 0.6 * y + 0.4 * toe_y
    fighter.root.move(at(begin + 0.42), at(out), *over)
    fighter.pelvis.move(at(lift - 0.06), at(out - 0.02), turn, -0.6 * away, 0.6 * aside)
    shoulders = fighter.facing + 0.8 * (turn - fighter.facing)
    fighter.thorax.move(at(lift - 0.02), at(out + 0.02), shoulders, -away, aside)
    foot.yaw.move(at(lift), at(chambered), fighter.facing + 0.7 * (turn - fighter.facing))
    fighter.depth.move(at(lift), at(out), 0.006 + 0.2 * own.depth)
    _swing(fighter, habits, leg, (at(lift), at(out), at(back)), rng)

    # The leg lands behind or in front, and the stance follows.
    if spinning:
        fighter.facing += sign * 2 * math.pi
    ahead = rng.random() < habits.forward and x < 0.3
    fighter.lead = leg if ahead else support
    middle = float(rng.uniform(-0.04, 0.04)) - habits.recoil
    middle += (x if ahead else x - step) * 0.8
    reach = 0.36 - own.stagger / 2
    middle = float(np.clip(middle, x - reach, x + reach))
    place = fighter.place(leg, middle, 0.0)
    fighter.turn_home(at(out + 0.06), at(land + 0.08))
    if spinning:
        fighter.pivot(support, at(back - 0.05), at(land), fighter.place(support, 0.0, 0.0)[2])
    foot.toe.move(at(out), at(out) + 0.05, *place[:2])
    foot.yaw.move(at(back - 0.05), at(land), place[2])
    foot.leg.move(at(back), at(land), *leg_to((0.0, -72.0, 0.94), 0.0, 0.0))
    foot.air.move(at(land - 0.24), at(land), 0.0)
    foot.free.move(at(back - 0.1), at(land - 0.02), 0.0)
    foot.heel.move(at(back), at(land), 0.0 if ahead else own.heel)
    fighter.stepped = at(land)
    fighter.root.move(at(land - 0.22), at(land + 0.12), *fighter.middle())
    return fighter.into_stance(at(land + 0.02), at(land + 0.5), middle, 0.0, 0.035)


def _swing(
    fighter: Fighter,
    habits: Habits,
    leg: str,
    times: tuple[float, float, float],
    rng: np.random.Generator,
) -> None:
    """Swing the arm of the kicking side down and back, and the other forward and aside."""
    for side, sign in SIDES.items():
        down = (-0.15, 0.35 * sign, -0.78) if side == leg else (0.42, 0.42 * sign, -0.05)
        size = habits.swing * float(rng.uniform(0.6, 1.15))
        guard = np.array(fighter.guard(side))
        place = guard + min(size, 1.0) * (np.array(down) - guard)
        fighter.wrists[side].move(times[0], times[1] + 0.02, *place.tolist())
