"""Punches and boxing: jabs, crosses, hooks, uppercuts and lunge punches, alone and in combinations.

The hips lead, the shoulders follow, the hand arrives last and comes back; the foot behind pivots,
steps are short and bring the other foot after. What differs between people is drawn for each
subject (`Habits`), what differs between punches of one person for each punch.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rtradar.motion.synthetic.fighter import Bearing, Fighter
from rtradar.motion.synthetic.figure import SIDES, PosesAt, Subject, about


@dataclass(frozen=True, kw_only=True)
class Kind:
    """How a kind of punch goes, angles in degrees.

    ``load`` and ``impact`` are places of the wrist from the shoulder, forward, inward and up, in
    arm lengths and in axes that face the opponent; without ``load`` the hand starts from the guard.
    The elbow is raised by ``elbow``; the shoulder of the hand comes forward by ``turn``, the hips
    by three quarters of that. The trunk leans forward by ``lean`` and to the other side by
    ``aside``, and the root sinks by ``dip``. The lead hand strikes, or that behind, or either.
    """

    impact: tuple[float, float, float]
    turn: float
    lead: bool | None
    load: tuple[float, float, float] | None = None
    elbow: float = 22.0
    lean: float = 6.0
    aside: float = 0.0
    dip: float = 0.0
    out_s: float = 0.19


KINDS: Mapping[str, Kind] = {
    "jab": Kind(impact=(0.95, 0.12, 0.0), turn=52, lead=True, out_s=0.17),
    "cross": Kind(impact=(0.95, 0.16, -0.02), turn=38, lead=False, lean=12),
    "hook": Kind(
        load=(0.32, -0.40, -0.10), impact=(0.52, 0.34, 0.06), turn=44, lead=None, elbow=72,
        aside=7, out_s=0.30,
    ),
    "uppercut": Kind(
        load=(0.18, 0.04, -0.52), impact=(0.58, 0.16, 0.20), turn=34, lead=None, elbow=12,
        lean=3, aside=9, dip=0.025, out_s=0.34,
    ),
    "lunge": Kind(
        load=(-0.10, 0.02, -0.56), impact=(0.94, 0.20, -0.08), turn=34, lead=None, elbow=14,
        lean=4, dip=0.02, out_s=0.40,
    ),
}  # fmt: skip
"""All kinds of punches; a lunge punch starts at the hip, to which the other hand goes."""

STYLES = tuple(KINDS)
BOXING_STYLES = ("outfighter", "infighter", "steady")
"""From a distance, close by, or steadily with both hands in turn and without a step."""

_BOXERS = (0.25, 0.25, 0.5)
"""Probabilities of the styles; the people of Berkeley MHAD, asked to box, do so steadily."""

_FAVOURITES = {
    "": (0.7, 0.8, 0.6, 0.4, 0.5),
    "outfighter": (4, 3, 0.6, 0.3, 0),
    "infighter": (0.8, 1.2, 4, 3, 0),
    "steady": (3, 3, 0.4, 0.3, 0),
}
"""Concentrations from which the shares of the kinds are drawn, by style."""


@dataclass(frozen=True, kw_only=True)
class Habits:
    """How a subject punches, apart from its stance.

    ``shares`` are probabilities of the kinds. A combination has up to ``most`` punches; before it
    the fighter steps with probability ``stepping``, by up to ``step`` of the height, and after it
    leans aside with probability ``weaving``. ``turn`` and ``lean`` are factors of those of the
    kind, ``bow`` [rad] is added to the lean, ``reach`` is how far the arm is stretched, and
    ``helping`` how far the other hand moves. ``pace`` is the speed of punches and ``rest_s`` the
    longest time between combinations [s].
    """

    shares: tuple[float, ...]
    most: int
    stepping: float
    step: float
    weaving: float
    turn: float
    lean: float
    bow: float
    reach: float
    helping: float
    pace: float
    rest_s: float
    in_turn: bool
    """Whether left and right always punch in turn."""

    @classmethod
    def of(cls, subject: Subject, *, boxing: bool) -> Habits:
        """Draw the habits of a subject."""
        drawn, style = subject.drawn, subject.style
        if style in KINDS:
            shares = np.array([float(kind == style) for kind in KINDS])
        else:
            rng = np.random.default_rng([subject.manner, 2])
            if boxing and not style:
                style = BOXING_STYLES[int(rng.choice(len(BOXING_STYLES), p=_BOXERS))]
            shares = rng.dirichlet(np.array(_FAVOURITES[style]) + 1e-3)
        habits = cls(
            shares=tuple(shares.tolist()),
            most=int(drawn("most", 1.0, 3.99)) + boxing,
            stepping=0.9 if boxing else drawn("stepping", 0.0, 1.0) ** 2,
            step=drawn("step", 0.04, 0.15),
            weaving=drawn("weaving", 0.2, 0.7) if boxing else drawn("weaving", -0.3, 0.35),
            turn=drawn("turn", 0.8, 1.15),
            lean=drawn("lean", 0.2, 1.0),
            bow=math.radians(drawn("bow", 0.0, 1.0) ** 3 * 25),
            reach=drawn("reach", 0.90, 1.0) * min(subject.amplitude, 1.0),
            helping=drawn("helping", 0.3, 1.2),
            pace=drawn("pace", 0.36, 0.88) * subject.tempo,
            rest_s=drawn("rest", 0.1, 0.75),
            in_turn=False,
        )
        if style != "steady":
            return habits
        return replace(
            habits,
            most=int(drawn("many", 9.0, 41.0)),
            stepping=0.0,
            weaving=0.0,
            turn=drawn("slight turn", 0.2, 0.9),
            lean=drawn("slight lean", 0.0, 0.5),
            bow=0.0,
            pace=drawn("slow", 0.34, 0.62) * subject.tempo,
            in_turn=True,
        )


def _bearing(subject: Subject, *, boxing: bool) -> Bearing:
    drawn = subject.drawn
    low = drawn("low", 0.0, 1.0)
    return Bearing(
        lead=subject.other,
        stagger=0.06 + 0.10 * drawn("stagger", 0.0, 1.0) + 0.06 * low**2,
        spread=drawn("spread", 0.12, 0.18),
        bladed=math.radians(drawn("bladed", 4.0, 32.0)),
        depth=0.015 + 0.05 * low,
        lean=math.radians(2 + 36 * drawn("upright", 0.0, 1.0) ** 2),
        heel=math.radians(max(drawn("heel", -8.0, 20.0), 0.0)),
        guard=(drawn("ahead", 0.32, 0.55), drawn("inward", 0.02, 0.16), drawn("up", -0.35, 0.16)),
        elbow=math.radians(drawn("elbow", 10.0, 30.0)),
        bounce=drawn("bounce", 0.003, 0.010) if boxing else drawn("bounce", -0.004, 0.008),
        pulse_hz=drawn("pulse", 1.3, 2.8),
        sway=drawn("sway", 0.001, 0.006),
        restless=drawn("restless", 0.012, 0.05),
    )


def punch(duration_s: float, subject: Subject) -> PosesAt:
    """Punches of any kind, alone or a few in a row, facing +x."""
    return _combinations(duration_s, subject, boxing=False)


def boxing(duration_s: float, subject: Subject) -> PosesAt:
    """Shadow boxing: combinations, steps between them, and a trunk that weaves, facing +x."""
    return _combinations(duration_s, subject, boxing=True)


def _combinations(duration_s: float, subject: Subject, *, boxing: bool) -> PosesAt:
    habits = Habits.of(subject, boxing=boxing)
    fighter = Fighter(subject, _bearing(subject, boxing=boxing))
    rng = np.random.default_rng([subject.manner, int(2**32 * subject.phase)])
    t = -1.2 * subject.phase
    while t < duration_s + 0.5:
        x, _ = fighter.middle()
        middle_x, middle_y = 0.4 * x, 0.0
        if rng.random() < habits.stepping:
            ahead = float(rng.uniform(0.3, 1.0)) * habits.step * (1 if rng.random() < 0.75 else -1)
            middle_x += ahead
            middle_y = 0.4 * habits.step * float(rng.uniform(-1, 1))
            t = max(t, _step_in(fighter, habits, t, middle_x, middle_y))
        hand = subject.side if rng.random() < 0.55 else subject.other
        for _ in range(int(rng.integers(1, habits.most + 1))):
            kind = KINDS[STYLES[int(rng.choice(len(KINDS), p=habits.shares))]]
            if kind.lead is not None and habits.in_turn:
                kind = KINDS["jab" if hand == fighter.lead else "cross"]
            elif kind.lead is not None:
                hand = fighter.lead if kind.lead else fighter.rear
            t = _plan(fighter, habits, kind, hand, t, rng)
            hand = "r" if hand == "l" else "l"
        if rng.random() < habits.weaving:
            t = _weave(fighter, t, rng)
        length = float(rng.uniform(0.34, 0.6)) / max(habits.pace, 0.6)
        t = fighter.into_stance(t, t + length, 0.5 * middle_x, 0.5 * middle_y, 0.03)
        t += float(rng.uniform(0.03, habits.rest_s)) / subject.tempo
    return fighter.poses


def _step_in(fighter: Fighter, habits: Habits, t: float, x: float, y: float) -> float:
    """Step toward (x, y) with one foot, in front or behind; return when to strike."""
    forward = x > fighter.middle()[0]
    side = fighter.lead if forward else fighter.rear
    to = fighter.place(side, x, y)
    gap = to[0] - fighter.feet["r" if side == "l" else "l"].toe.last[0]
    to = float(to[0] + np.clip(gap, -0.34, 0.34) - gap), to[1], to[2]
    end = fighter.step(side, t, t + 0.26 / max(habits.pace, 0.7), to, 0.03)
    fighter.root.move(end - 0.3, end + 0.2, *fighter.middle())
    return end - 0.06


def _plan(
    fighter: Fighter, habits: Habits, kind: Kind, hand: str, t: float, rng: np.random.Generator
) -> float:
    """Plan one punch that begins at a time [s], and return when the next may begin."""
    own, sign, other = fighter.bearing, SIDES[hand], "r" if hand == "l" else "l"
    pace = habits.pace * float(rng.uniform(0.85, 1.15))
    wrist = fighter.wrists[hand]
    t = max(t, wrist.end - 0.02)
    out = t + kind.out_s / pace
    back = out + float(rng.uniform(0.18, 0.30)) / pace
    vary = float(rng.uniform(0.85, 1.15))

    turn = math.radians(kind.turn) * habits.turn * vary
    turn = -sign * (turn + 0.5 * own.bladed * (hand == fighter.lead))
    lean = own.lean + math.radians(kind.lean) * habits.lean + habits.bow * float(rng.uniform(0, 1))
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
        ahead, inward, up = place
        aimed = np.array([ahead, -sign * inward, up + 0.05 * float(rng.normal())])
        body = about(y=share * lean, x=share * aside, z=share * turn)
        moved = np.asarray(body.inv().apply(aimed)).reshape(3)
        return (moved * min(1.0, 0.955 / float(np.linalg.norm(moved)))).tolist()

    begin = t + 0.12 * (out - t)
    if kind.load is not None:
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
    pulled = np.array([-0.10, 0.0, -0.56] if kind is KINDS["lunge"] else [0.34, 0.0, 0.14])
    cover += min(habits.helping, 1.0) * (pulled - cover)
    helper = fighter.wrists[other]
    if helper.end < out - 0.12:
        helper.move(max(helper.end, t), out + 0.03, *(cover + 0.05 * rng.normal(size=3)).tolist())
    return out + float(rng.uniform(0.02, 0.10)) / pace


def _weave(fighter: Fighter, t: float, rng: np.random.Generator) -> float:
    """Plan a lean aside and forward, low, as if under a punch; return when it is over."""
    own, aside = (
        fighter.bearing,
        math.radians(float(rng.uniform(8, 24))) * float(rng.choice([-1.0, 1.0])),
    )
    end = t + float(rng.uniform(0.28, 0.45)) / fighter.subject.tempo
    lean, turned = own.lean + math.radians(float(rng.uniform(4, 22))), fighter.thorax.last[0]
    fighter.pelvis.move(t, end, fighter.pelvis.last[0], 0.6 * lean, 0.5 * aside)
    fighter.thorax.move(t, end, turned, lean, aside)
    fighter.depth.move(t, end, own.depth + float(rng.uniform(0.01, 0.06)))
    return end + 0.03
