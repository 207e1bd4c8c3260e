"""Kicks and punches: of one kind or of several, alone, one after the other, and in boxing.

A kicker steps in, brings the knee up, extends the leg, draws it back and returns to the stance. Of
punches, the hips lead, the shoulders follow, the hand arrives last and comes back; the foot behind
pivots, steps are short and bring the other foot after. What differs between people is drawn for
each subject (``traits.toml``), what differs between strikes of one person for each strike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, partial
from types import SimpleNamespace

import numpy as np
from numpy.typing import ArrayLike

from rtradar.motion.synthetic.fighter import Fighter
from rtradar.motion.synthetic.figure import (
    OTHER,
    SIDES,
    STYLES,
    TOE_X,
    Array,
    PosesAt,
    Subject,
    about,
    table_of,
)

_BOXERS = (0.25, 0.25, 0.5)
"""Probabilities of the styles; the people of Berkeley MHAD, asked to box, do so steadily."""


@cache
def _kind(activity: str, style: str) -> SimpleNamespace:
    """How a kind of kick or punch goes."""
    return SimpleNamespace(**table_of(f"{activity}_{style}"))


def _shares(activity: str, style: str, rng: np.random.Generator, favourites: ArrayLike) -> Array:
    """Probabilities of the kinds of a strike; a style that is one of them excludes the others."""
    if style in STYLES[activity]:
        return np.array([float(kind == style) for kind in STYLES[activity]])
    return rng.dirichlet(np.asarray(favourites))


# -- kicks -----------------------------------------------------------------------------------------


def kick(duration_s: float, subject: Subject) -> PosesAt:
    """Kicks of any kind, facing +x."""
    own = subject.traits("kick")
    stance = subject.traits("kick_stance")
    # Traits from 0 to 1 become lengths and angles; cubes make the extremes rare.
    stance.lead = subject.other if stance.behind < 0.7 else subject.side
    stance.stagger = 0.04 + 0.10 * stance.stagger + 0.12 * stance.depth**3
    stance.depth = 0.018 + 0.03 * stance.depth + 0.15 * stance.depth**3
    own.step *= min(subject.amplitude, 1.0)
    own.height += 30 * (subject.amplitude - 1)
    own.load = -0.01 + 0.12 * own.load + 0.12 * own.load**4
    own.pace *= subject.tempo
    # Each has one or two favourites; spins are rare.
    rng = np.random.default_rng([subject.manner, 1])
    shares = _shares("kick", subject.style, rng, [0.9, 0.35, 0.6, 0.12, 0.5])
    fighter = Fighter(subject, stance, own)
    # One kick after another until the capture ends; the same leg again, or the other one.
    leg, t = subject.side, -1.6 * subject.phase
    while t < duration_s + 0.5:
        kind = _kind("kick", STYLES["kick"][int(fighter.rng.choice(len(shares), p=shares))])
        t = _kick(fighter, kind, leg, t)
        t += fighter.between(0.03, own.rest) / subject.tempo
        if fighter.rng.random() < own.alternating:
            leg = OTHER[leg]
    return fighter.poses


def _kick(fighter: Fighter, kind: SimpleNamespace, leg: str, t: float) -> float:
    """Plan one kick that begins at a time [s], and return when the kicker stands again."""
    own, habits, rng = fighter.bearing, fighter.habits, fighter.rng
    sign, support, foot = SIDES[leg], OTHER[leg], fighter.feet[leg]
    pace = habits.pace * fighter.between(0.92, 1.08)

    def at(seconds: float) -> float:
        return t + seconds / pace

    # The support foot steps in, and the weight comes over it.
    x, y = fighter.ankle(support)
    step = habits.step * fighter.between(0.3, 1.3) * (1.0 if x < 0.25 else 0.3)
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
    out = chambered + kind.out_s * fighter.between(0.85, 1.2)
    back = out + fighter.between(0.16, 0.30)
    land = back + fighter.between(0.26, 0.40)
    # The leg goes through chamber, impact and recoil; how high a person kicks raises all of them in
    # part.
    raised = habits.height + float(rng.normal(0, 4))
    leg_to = partial(_leg, fighter, kind, leg, raised)
    low = (0.0, -105.0 if spinning else -75.0, 0.93)
    foot.leg.move(at(lift) - 0.1, at(lift), *leg_to(low, 0.0, 0.0))
    foot.leg.move(at(lift), at(chambered), *leg_to(kind.chamber, 0.35))
    foot.leg.move(at(chambered - 0.02), at(out), *leg_to(kind.impact, 1.0))
    foot.leg.move(at(out + 0.01), at(back), *leg_to(kind.recoil, 0.35))
    # From the lift on the leg moves through the air and no longer limits the height of the root.
    foot.air.move(at(lift), at(chambered - 0.04), 1.0)
    foot.free.move(at(lift), at(chambered), 0.5)
    foot.heel.move(at(lift - 0.18), at(lift + 0.04), math.radians(40))

    # Hips and support foot turn with it, the trunk leans away.
    turn = -sign * math.radians(kind.turn) * (1.0 if spinning else habits.turn)
    turn, away = fighter.facing + turn, math.radians(kind.away) * habits.tilt
    away *= 0.6 + 0.4 * math.sin(math.radians(max(60.0 + raised, 0.0)))
    aside = sign * math.radians(kind.aside) * habits.tilt
    fighter.pivot(support, at(lift), at(out), fighter.facing - sign * math.radians(kind.pivot))
    # The weight comes over the ball of the foot that carries, about which it pivots.
    (x, y), (toe_x, toe_y) = fighter.ankle(support), fighter.feet[support].toe.last
    over = 0.6 * x + 0.4 * toe_x - 0.02, 0.6 * y + 0.4 * toe_y
    fighter.root.move(at(begin + 0.42), at(out), *over)
    fighter.pelvis.move(at(lift - 0.06), at(out - 0.02), turn, -0.6 * away, 0.6 * aside)
    shoulders = fighter.facing + 0.8 * (turn - fighter.facing)
    fighter.thorax.move(at(lift - 0.02), at(out + 0.02), shoulders, -away, aside)
    foot.yaw.move(at(lift), at(chambered), fighter.facing + 0.7 * (turn - fighter.facing))
    fighter.depth.move(at(lift), at(out), 0.006 + 0.2 * own.depth)
    _swing(fighter, leg, at(lift), at(out))

    # The leg lands behind or in front, and the stance follows.
    if spinning:
        fighter.facing += sign * 2 * math.pi
    # Where the stance will be: near the middle of the place, within reach of the leg that lands.
    ahead = rng.random() < habits.forward and x < 0.3
    fighter.lead = leg if ahead else support
    middle = fighter.between(-0.04, 0.04) - habits.recoil
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


def _leg(
    fighter: Fighter,
    kind: SimpleNamespace,
    leg: str,
    raised: float,
    key: Sequence[float],
    share: float,
    roll: float = 1.0,
) -> tuple[float, ...]:
    """Where a leg is to go, by azimuth, elevation and reach, with a share of what it is raised."""
    azimuth, elevation, reach = key
    # Beyond straight down, backward, it goes up as the elevation falls.
    higher = share * raised * (1 if elevation > -90 else -1)
    side = SIDES[leg] * azimuth
    angles = np.radians([side, elevation + higher, roll * kind.roll, kind.flexion])
    return fighter.facing + angles[0], angles[1], reach, angles[2], angles[3]


def _swing(fighter: Fighter, leg: str, begin: float, end: float) -> None:
    """Swing the arm of the kicking side down and back, and the other forward and aside."""
    for side, sign in SIDES.items():
        down = (-0.15, 0.35 * sign, -0.78) if side == leg else (0.42, 0.42 * sign, -0.05)
        size = fighter.habits.swing * fighter.between(0.6, 1.15)
        guard = np.array(fighter.guard(side))
        place = guard + min(size, 1.0) * (np.array(down) - guard)
        fighter.wrists[side].move(begin, end + 0.02, *place.tolist())


# -- punches ---------------------------------------------------------------------------------------


def _habits(subject: Subject, *, boxing: bool) -> SimpleNamespace:
    """How a subject punches; ``shares`` are the probabilities of the kinds."""
    style, rng = subject.style, np.random.default_rng([subject.manner, 2])
    if boxing and not style:
        style = STYLES["boxing"][int(rng.choice(len(_BOXERS), p=_BOXERS))]
    own = subject.traits(f"boxing_{style}" if boxing else "punch")
    own.shares = _shares("punch", style, rng, np.array(own.favourites) + 1e-3)
    own.in_turn = style == "steady"
    if own.in_turn:
        own.most, own.stepping, own.weaving, own.bow = int(own.many), 0.0, 0.0, 0.0
        own.turn, own.lean, own.pace = own.slight_turn, own.slight_lean, own.slow
    else:
        own.most = int(own.most) + boxing
        own.stepping = 0.9 if boxing else own.stepping**2
        own.bow = math.radians(own.bow**3 * 25)
    own.reach *= min(subject.amplitude, 1.0)
    own.pace *= subject.tempo
    return own


def punch(duration_s: float, subject: Subject, *, boxing: bool = False) -> PosesAt:
    """Punches of any kind, alone or a few in a row, facing +x.

    Boxers make combinations, step between them, and their trunk weaves.
    """
    own = _habits(subject, boxing=boxing)
    stance = subject.traits("boxing_stance" if boxing else "punch_stance")
    # Traits from 0 to 1 become lengths and angles.
    stance.lead = subject.other
    stance.stagger = 0.06 + 0.10 * stance.stagger + 0.06 * stance.low**2
    stance.depth = 0.015 + 0.05 * stance.low
    stance.lean = 2 + 36 * stance.upright**2
    fighter = Fighter(subject, stance, own)
    rng = fighter.rng
    t = -1.2 * subject.phase
    # A step perhaps, one punch or a row of them with alternating hands, and back into the stance,
    # drawn toward the middle.
    while t < duration_s + 0.5:
        x, _ = fighter.middle()
        middle_x, middle_y = 0.4 * x, 0.0
        if rng.random() < own.stepping:
            ahead = fighter.between(0.3, 1.0) * own.step * (1 if rng.random() < 0.75 else -1)
            middle_x += ahead
            middle_y = 0.4 * own.step * fighter.between(-1, 1)
            t = max(t, _step_in(fighter, t, middle_x, middle_y))
        hand = subject.side if rng.random() < 0.55 else subject.other
        for _ in range(int(rng.integers(1, own.most + 1))):
            style = STYLES["punch"][int(rng.choice(len(own.shares), p=own.shares))]
            kind = _kind("punch", style)
            # The jab belongs to the front hand, the cross to the rear one: where hands take turns,
            # the hand says which of both it is, and else the punch says the hand.
            if kind.hand != "either" and own.in_turn:
                kind = _kind("punch", "jab" if hand == fighter.lead else "cross")
            elif kind.hand != "either":
                hand = fighter.lead if kind.hand == "front" else fighter.rear
            t = _punch(fighter, kind, hand, t)
            hand = OTHER[hand]
        if rng.random() < own.weaving:
            t = _weave(fighter, t)
        length = fighter.between(0.34, 0.6) / max(own.pace, 0.6)
        t = fighter.into_stance(t, t + length, 0.5 * middle_x, 0.5 * middle_y, 0.03)
        t += fighter.between(0.03, own.rest) / subject.tempo
    return fighter.poses


def _step_in(fighter: Fighter, t: float, x: float, y: float) -> float:
    """Step toward (x, y) with one foot, in front or behind; return when to strike."""
    forward = x > fighter.middle()[0]
    side = fighter.lead if forward else fighter.rear
    to = fighter.place(side, x, y)
    # Feet do not come farther apart than a stance allows.
    gap = to[0] - fighter.feet[OTHER[side]].toe.last[0]
    to = float(to[0] + np.clip(gap, -0.34, 0.34) - gap), to[1], to[2]
    end = fighter.step(side, t, t + 0.26 / max(fighter.habits.pace, 0.7), to, 0.03)
    fighter.root.move(end - 0.3, end + 0.2, *fighter.middle())
    return end - 0.06


def _punch(fighter: Fighter, kind: SimpleNamespace, hand: str, t: float) -> float:
    """Plan one punch that begins at a time [s], and return when the next may begin."""
    own, habits, rng = fighter.bearing, fighter.habits, fighter.rng
    sign, other = SIDES[hand], OTHER[hand]
    pace = habits.pace * fighter.between(0.85, 1.15)
    wrist = fighter.wrists[hand]
    # The hand begins when its last move is over: out to the impact, and back.
    t = max(t, wrist.end - 0.02)
    out = t + kind.out_s / pace
    back = out + fighter.between(0.18, 0.30) / pace
    vary = fighter.between(0.85, 1.15)

    # The hips lead by a moment, then shoulders; trunk and weight go with the hand.
    turn = math.radians(kind.turn) * habits.turn * vary
    turn = -sign * (turn + 0.5 * own.bladed * (hand == fighter.lead))
    lean = own.lean + math.radians(kind.lean) * habits.lean + habits.bow * fighter.between(0, 1)
    aside = sign * math.radians(kind.aside) * habits.lean * vary
    fighter.pelvis.move(t, out - 0.02, 0.75 * turn, 0.6 * lean, 0.5 * aside)
    fighter.thorax.move(t + 0.02, out, turn, lean, aside)
    x, y = fighter.middle()
    fighter.root.move(t, out, x + 0.015 * habits.lean * vary, y - 0.15 * sign * own.spread)
    fighter.depth.move(t, out, own.depth + kind.dip * vary)
    foot = fighter.feet[hand]
    if hand == fighter.rear and abs(foot.yaw.last[0]) > 0.2:
        fighter.pivot(hand, t, out, 0.3 * foot.yaw.last[0])
    # Both heels help, most that of the hand.
    for side, most in ((hand, 22.0), (other, 9.0)):
        raised = own.heel * (side != fighter.lead) + math.radians(most * float(rng.random()))
        fighter.feet[side].heel.move(t, out, raised)

    def from_shoulder(place: tuple[float, float, float], share: float) -> list[float]:
        # Targets are meant in the axes of the facing. The wrist is planned in those of the thorax,
        # which has then turned by a share of its way, and within reach of the arm.
        ahead, inward, up = place
        aimed = np.array([ahead, -sign * inward, up + 0.05 * float(rng.normal())])
        body = about(y=share * lean, x=share * aside, z=share * turn)
        moved = np.asarray(body.inv().apply(aimed)).reshape(3)
        return (moved * min(1.0, 0.955 / float(np.linalg.norm(moved)))).tolist()

    # Some punches draw the hand back first.
    begin = t + 0.12 * (out - t)
    if kind.load:
        wrist.move(t, t + 0.52 * (out - t), *from_shoulder(kind.load, 0.3))
        begin = wrist.end
    guard = np.array(fighter.guard(hand))
    impact = np.array(from_shoulder(kind.impact, 1.0))
    wrist.move(begin, out, *(guard + habits.reach * (impact - guard)).tolist())
    fighter.elbows[hand].move(t, out - 0.03, math.radians(kind.elbow))
    wrist.move(out + 0.02, back, *(guard + 0.06 * rng.normal(size=3)).tolist())
    fighter.elbows[hand].move(out + 0.02, back, own.elbow)

    # The other hand covers, or goes to the hip.
    cover = np.array(fighter.guard(other))
    cover += min(habits.helping, 1.0) * (np.array(kind.pulled) - cover)
    helper = fighter.wrists[other]
    if helper.end < out - 0.12:
        helper.move(max(helper.end, t), out + 0.03, *(cover + 0.05 * rng.normal(size=3)).tolist())
    return out + fighter.between(0.02, 0.10) / pace


def _weave(fighter: Fighter, t: float) -> float:
    """Plan a lean aside and forward, low, as if under a punch; return when it is over."""
    own = fighter.bearing
    aside = math.radians(fighter.between(8, 24)) * float(fighter.rng.choice([-1.0, 1.0]))
    end = t + fighter.between(0.28, 0.45) / fighter.subject.tempo
    lean, turned = own.lean + math.radians(fighter.between(4, 22)), fighter.thorax.last[0]
    fighter.pelvis.move(t, end, fighter.pelvis.last[0], 0.6 * lean, 0.5 * aside)
    fighter.thorax.move(t, end, turned, lean, aside)
    fighter.depth.move(t, end, own.depth + fighter.between(0.01, 0.06))
    return end + 0.03
