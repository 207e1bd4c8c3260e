"""Synthetic jumping jacks, and jumps on the spot.

The root flies along a parabola and is thrown and caught along quintics. The ankles follow it where
the legs are stretched, so that the knees bend on the floor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from types import SimpleNamespace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rtradar.motion.synthetic.figure import (
    ANKLE,
    HIP,
    HIP_Y,
    LEFT,
    ROOT,
    SHANK,
    SIDES,
    THIGH,
    TOE_HEIGHT,
    TOE_X,
    Arm,
    Array,
    Pose,
    PosesAt,
    Subject,
    about,
    bump,
    hermite,
    keyed,
    rolled,
    xyz,
)

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

GRAVITY_MPS2 = 9.81

DEEPEST = 0.2
"""How far the root comes down between hops at most, where they are far apart, in heights."""


class _Flight(NamedTuple):
    """One hop: when, and whether the feet are apart afterwards."""

    begin: float
    end: float
    apart: bool
    unlike: float
    """How it differs from other hops, with a deviation of 1, 2 at most."""

    @property
    def span(self) -> float:
        """How long it lasts [s]."""
        return self.end - self.begin


def _sets(
    subject: Subject, manner: SimpleNamespace, until_s: float, *, apart: bool
) -> list[list[_Flight]]:
    """Sets of flights; each set begins and ends standing, the first one before 0."""
    hop = manner.hop_s / subject.tempo
    # A hop of the same height takes as long at any tempo; only where contact would get too short it
    # must be lower.
    longer = 0.2 * manner.lopsided**3  # a few people hurry in one of both positions, most do not
    flight = min(manner.flight_s * math.sqrt(subject.amplitude), (0.55 - 0.5 * abs(longer)) * hop)
    number = 2 * round(manner.jacks)
    begin = -hop * (1 + subject.phase * (number - 2))
    uneven = np.random.default_rng(subject.manner)
    sets: list[list[_Flight]] = []
    while begin < until_s:
        unlike, early = np.clip(uneven.standard_normal((2, number)), -2.0, 2.0)
        late = hop * manner.uneven * early
        late[1::2] += longer * hop
        begins = begin + 0.8 * hop + hop * np.arange(number) + late
        sets.append(
            [
                _Flight(float(at), float(at) + flight, apart and k % 2 == 0, float(unlike[k]))
                for k, at in enumerate(begins)
            ]
        )
        begin = sets[-1][-1].end + 0.8 * hop + manner.rest_s / subject.tempo
    return sets


def _longest_contact(speed: float, height: float) -> float:
    """How long somebody may be on the floor [s] between a landing and a take-off at a speed.

    In the middle of such a curve the root is lower by 5/16 v T + g T^2/32. Who is on the floor for
    longer would go deeper than people do, and stands in between.
    """
    slope, curve = 5 / 16 * speed, GRAVITY_MPS2 / 32
    return (math.sqrt(slope**2 + 4 * curve * DEEPEST * height) - slope) / (2 * curve)


def _contacts(
    hops: list[_Flight], longest_s: float
) -> Iterator[tuple[tuple[float, float], _Flight | None, _Flight | None]]:
    """Yield each contact of a set, with the flights before and after it; long ones in two parts."""
    before: _Flight | None = None
    for hop in hops:
        if before and hop.begin - before.end <= longest_s:
            yield (before.end, hop.begin), before, hop
        else:
            part = longest_s
            if before:
                part = min(part, (hop.begin - before.end) / 2)
                yield (before.end, before.end + part), before, None
            yield (hop.begin - part, hop.begin), None, hop
        before = hop
    yield (hops[-1].end, hops[-1].end + longest_s), hops[-1], None


class _Throw(NamedTuple):
    """Heights of the root at take-off and landing [m], and its speeds, up and down [m/s]."""

    take_off: float
    landing: float
    up: float
    down: float


def _thrown(hop: _Flight, levels: tuple[float, ...]) -> _Throw:
    """Return how a flight begins and ends; levels are those of the feet together, and apart."""
    begin, end = levels[int(not hop.apart)], levels[int(hop.apart)]
    up = (end - begin) / hop.span + GRAVITY_MPS2 * hop.span / 2
    return _Throw(begin, end, up, GRAVITY_MPS2 * hop.span - up)


_Knot = tuple[float, tuple[float, float, float]]
"""A time, and height, speed and acceleration then."""

_REST = 0.0, 0.0, 0.0


def _through(t: Array, knots: list[_Knot]) -> Array:
    """Curve (n,) through these knots, 0 before the first and after the last."""
    found = np.zeros(len(t))
    for (begin, one), (end, other) in pairwise(knots):
        some = (t >= begin) & (t < end)
        found[some] = hermite(t[some], (begin, end), one, other)
    return found


def _height(
    t: Array,
    sets: list[list[_Flight]],
    longest_s: float,
    levels: tuple[float, ...],
    standing: float,
) -> Array:
    """Height of the root (n,): standing, thrown, free, caught.

    A curve between knots is a parabola in flight, for the accelerations at both ends are the same.
    """
    z = np.full(len(t), standing)
    for hops in sets:
        knots: list[_Knot] = []
        for (begin, end), before, after in _contacts(hops, longest_s):
            caught = thrown = _REST
            if before:
                last = _thrown(before, levels)
                caught = last.landing - standing, -last.down, -GRAVITY_MPS2
            if after:
                following = _thrown(after, levels)
                thrown = following.take_off - standing, following.up, -GRAVITY_MPS2
            knots += [(begin, caught), (end, thrown)]
        z += _through(t, knots)
    return z


def _rise(
    t: Array,
    sets: list[list[_Flight]],
    longest_s: float,
    levels: tuple[float, ...],
    manner: SimpleNamespace,
    drop: float,
) -> tuple[Array, Array]:
    """How much higher the ankles are than in standing, and of that, over the toes (n,) each [m].

    Relative to the hips they move slowly while the legs are stretched: in flight, at take-off and
    at landing, where they are higher by ``drop``. So the knees bend on the floor only, where the
    heels come down for a while, if there is time.
    """
    ankles, heels = np.zeros(len(t)), np.zeros(len(t))
    for hops in sets:
        knots: list[_Knot] = []
        for (begin, end), before, after in _contacts(hops, longest_s):
            span, down, up = end - begin, 0.0, 0.0
            least = 2 * drop / (longest_s if before and after else span)
            if before:
                down = max(manner.follow * _thrown(before, levels).down, least)
            if after:
                up = max(manner.follow * _thrown(after, levels).up, least)
            stays = not (down and up) or 2 * drop * (1 / down + 1 / up) < span
            if not stays:  # the largest speeds at which the heels do not go below the floor
                down, up = (min(speed, 3.2 * drop / span) for speed in (down, up))
            if before:
                knots.append((begin, (drop, -down, 0.0)))
            if before and stays:
                knots.append((begin + 2 * drop / down, _REST))
            if after and stays:
                knots.append((end - 2 * drop / up, _REST))
            if after:
                knots.append((end, (drop, up, 0.0)))
        ankles += _through(t, knots)
        tops: dict[float, tuple[float, float, float]] = {}  # between them the feet stay as they are
        for (begin, (_, up, _)), (end, (_, down, _)) in pairwise(knots):
            if up > 0:  # a flight
                middle, top = (begin + end) / 2, (manner.point * drop, 0.0, 0.0)
                tops |= {min(begin + 2 * drop / up, middle): top}
                tops |= {max(end + 2 * drop / down, middle): top}
        heels += _through(t, sorted([*knots, *tops.items()]))
    return ankles, heels


def jumping_jack(duration_s: float, subject: Subject) -> PosesAt:
    """Jumping jacks, facing +x."""
    return _hopping(duration_s, subject, "jumping_jack")


def jump(duration_s: float, subject: Subject) -> PosesAt:
    """Jumps with both legs on the spot, facing +x."""
    return _hopping(duration_s, subject, "jump")


def _hopping(duration_s: float, subject: Subject, activity: str) -> PosesAt:
    manner, apart = subject.traits(activity), activity == "jumping_jack"
    return partial(_hops, subject, manner, _sets(subject, manner, duration_s, apart=apart))


def _shortest_contact(all_sets: list[list[_Flight]]) -> float:
    """Return the shortest time on the floor between two hops of a set [s]."""
    return min(after.begin - hop.end for hops in all_sets for hop, after in pairwise(hops))


def _level(height: float, stretched: float, heel: Array, track: float) -> float:
    """Height of the root at take-off and landing [m], with a foot so far aside of the middle [m].

    ``heel`` (3,) is how far the ankle is moved by the raised heel [m].
    """
    leg = stretched * (THIGH + SHANK) * height
    below = math.sqrt(leg**2 - (track - HIP_Y * height) ** 2 - heel[0] ** 2)
    return float((ANKLE + ROOT - HIP) * height + heel[2] + below)


def _pitch(rise: Array) -> Array:
    """Pitch of a foot (n,) [rad] whose ankle rises so far over its toes, in heights: `rolled`."""
    below = ANKLE - TOE_HEIGHT
    return np.arcsin((rise + below) / math.hypot(TOE_X, below)) - math.atan2(below, TOE_X)


def _wavering(subject: Subject, manner: SimpleNamespace, t: Array, what: str) -> Array:
    """Slow swings (n,) from -1 to 1 of ``what``: nobody does the same all the time."""
    rates = {f"{what} of a jack": 0.5, f"slow {what}": 0.31}
    swings = [
        np.sin(
            2 * np.pi * (rate * subject.tempo * t / manner.hop_s + subject.drawn(name, 0.0, 1.0))
        )
        for name, rate in rates.items()
    ]
    return np.asarray(0.5 * (swings[0] + swings[1]))


def _arms(
    subject: Subject,
    manner: SimpleNamespace,
    thorax: Rotation,
    raised: Array,
    ends: tuple[float, float],
    swung: Array,
) -> dict[str, Arm]:
    """Arms raised aside by an angle [rad], between those at both ends, and swung forward [deg]."""
    arms, beyond, way = {}, raised - ends[0], ends[1] - ends[0]
    moving = np.sin(np.pi * beyond / way) ** 2
    for side, sign in SIDES.items():
        upper = thorax * about(
            x=sign * subject.uneven[side] * raised,
            y=-np.radians(manner.forward + swung),
        )
        fore = upper * about(
            x=sign * math.radians(manner.overhead) * beyond / way,
            y=-np.radians(manner.elbow + manner.elbow_swing * moving),
        )
        arms[side] = Arm(upper, fore, fore)
    return arms


def _hops(
    subject: Subject, manner: SimpleNamespace, all_sets: list[list[_Flight]], t: Array
) -> Pose:
    height, amplitude = subject.height_m, subject.amplitude
    hop_s = manner.hop_s / subject.tempo
    # A jumper does not move before the first hop of a set and after the last: further sets do not
    # matter.
    sets = [one for one in all_sets if one[0].begin - hop_s < t[-1] and one[-1].end + hop_s > t[0]]
    hops = [hop for hops in sets for hop in hops]

    def between(values: list[float], lead: float, lag: float) -> Array:
        """Move from the value before the first flight to those after each of them."""
        if not hops:
            return np.full(len(t), values[0])
        times = [time for hop in hops for time in (hop.begin - lead, hop.end + lag)]
        return keyed(t, times, np.repeat(values, 2)[1:-1])

    landed = between([0.0, *(height * manner.scatter * hop.unlike for hop in hops)], 0.0, 0.0)
    span = all_sets[0][0].span
    contact = _shortest_contact(all_sets)
    # The feet move sideways while they are well off the floor.
    apart = between([0.0, *(float(hop.apart) for hop in hops)], -0.05 * span, -0.05 * span)
    swung, airborne = np.zeros(len(t)), np.zeros(len(t))
    for hop in hops:
        swung += manner.swing * bump((t - hop.begin + 0.3 * contact) / (span + 0.7 * contact))
        swung -= manner.back * bump((t - hop.begin + 0.8 * contact) / (0.7 * contact))
        airborne += bump((t - hop.begin) / hop.span)

    close, wide = manner.close * HIP_Y * height, (HIP_Y + manner.wide * amplitude) * height
    raised_heel = rolled(np.radians([manner.heels]), height)[0]
    low, high = (_level(height, manner.stretched, raised_heel, track) for track in (wide, close))
    longest_s = min(0.75 * hop_s, _longest_contact(GRAVITY_MPS2 * span / 2, height))
    curves = t, sets, longest_s, (high, low)
    z = _height(*curves, height * (ROOT - 0.008))
    rise, heels = _rise(*curves, manner, raised_heel[2])
    roll = heels / raised_heel[2]
    pitch = _pitch(heels / height)
    ankle = rolled(pitch, height) + xyz(
        -manner.trail * height * airborne, 0.0, ANKLE * height + rise - heels
    )
    lowest, highest = math.radians(manner.lowest), math.radians(manner.highest) * amplitude**0.5
    vary = math.radians(manner.vary)
    reached = [lowest, *((lowest, highest)[hop.apart] + vary * hop.unlike for hop in hops)]
    # Two moves of the arms that overlap are one that lasts longer.
    lates = (manner.behind * contact + half for half in (-manner.late_s / 2, manner.late_s / 2))
    early, late = (between(reached, 0.48 * contact - own, 0.45 * contact + own) for own in lates)
    raised = 0.5 * early + 0.5 * late
    lean = np.radians(manner.lean + manner.crouch * (height * ROOT - z) / (0.1 * height))
    lean += math.radians(manner.nod) * _wavering(subject, manner, t, "nod")
    turn = math.radians(manner.turn) * _wavering(subject, manner, t, "turn")
    thorax = about(z=-turn, x=0.4 * turn, y=lean)
    ankles, feet, left = {}, {}, {}
    for side, sign in SIDES.items():
        outward = about(z=sign * math.radians(manner.toes_out) * apart)
        across = sign * (close + (wide - close) * apart)
        before = sign * manner.astride * height * apart + landed
        left[side] = about(z=sign * math.radians(manner.knees_out)).apply(LEFT)
        ankles[side] = outward.apply(ankle) + xyz(before, across, 0.0)
        feet[side] = outward * about(y=pitch)
    return Pose(
        root=xyz(height * (manner.sway * roll + manner.rock * apart) + landed, 0.0, z),
        pelvis=about(z=turn, y=0.5 * lean),
        thorax=thorax,
        head=about(y=0.5 * lean),
        ankles=ankles,
        feet=feet,
        arms=_arms(subject, manner, thorax, raised, (lowest, highest), swung),
        left=left,
        shrug=math.radians(manner.shrug) * apart,
    )
