"""Synthetic jumping jacks, and jumps on the spot.

The root flies along a parabola and is thrown and caught along quintics. The ankles follow it where
the legs are stretched, so that the knees bend on the floor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
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


def _longest_contact(speed: float, height: float) -> float:
    """How long somebody may be on the floor [s] between a landing and a take-off at a speed.

    In the middle of such a curve the root is lower by 5/16 v T + g T^2/32. Who is on the floor for
    longer would go deeper than people do, and stands in between.
    """
    # The positive root of the quadratic equation for the deepest contact.
    slope, curve = 5 / 16 * speed, GRAVITY_MPS2 / 32
    return (math.sqrt(slope**2 + 4 * curve * DEEPEST * height) - slope) / (2 * curve)


def _contacts(
    hops: list[_Flight], longest_s: float
) -> Iterator[tuple[tuple[float, float], _Flight | None, _Flight | None]]:
    """Yield each contact of a set, with the flights before and after it; long ones in two parts."""
    before: _Flight | None = None
    for hop in hops:
        # A short contact goes from landing to take-off in one curve. In a long one the jumper is
        # caught, stands, and takes off; a set begins with a take-off from standing, and ends with a
        # landing.
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


class _Jumper:
    """Plans of somebody who hops: sets of flights, and the knots of each set."""

    def __init__(self, subject: Subject, activity: str, until_s: float) -> None:
        self.subject, self.own = subject, subject.traits(activity)
        self.hop_s, height = self.own.hop_s / subject.tempo, subject.height_m
        self.close = self.own.close * HIP_Y * height
        self.wide = (HIP_Y + self.own.wide * subject.amplitude) * height
        self.heel = rolled(np.radians([self.own.heels]), height)[0]
        """How far a raised heel moves the ankle [m]."""
        # Heights of the root with feet close and wide, for legs that are stretched as much in both.
        self.levels = [self._level(track) for track in (self.close, self.wide)]
        self.standing = height * (ROOT - 0.008)
        self.sets = self._sets(until_s, apart=activity == "jumping_jack")
        self.span = self.sets[0][0].span
        self.contact = min(
            after.begin - hop.end for hops in self.sets for hop, after in pairwise(hops)
        )
        longest_s = min(0.75 * self.hop_s, _longest_contact(GRAVITY_MPS2 * self.span / 2, height))
        self.knots = [self._knots(hops, longest_s) for hops in self.sets]

    def _level(self, track: float) -> float:
        """Height of the root at take-off and landing [m], with a foot so far from the middle."""
        height = self.subject.height_m
        leg = self.own.stretched * (THIGH + SHANK) * height
        below = math.sqrt(leg**2 - (track - HIP_Y * height) ** 2 - self.heel[0] ** 2)
        return float((ANKLE + ROOT - HIP) * height + self.heel[2] + below)

    def _sets(self, until_s: float, *, apart: bool) -> list[list[_Flight]]:
        """Sets of flights; each set begins and ends standing, the first one before 0."""
        own, hop = self.own, self.hop_s
        # A hop of the same height takes as long at any tempo; only where contact would get too
        # short it must be lower.
        longer = 0.2 * own.lopsided**3  # a few people hurry in one of both positions, most do not
        longest = (0.55 - 0.5 * abs(longer)) * hop
        flight = min(own.flight_s * math.sqrt(self.subject.amplitude), longest)
        # Out and back makes two hops of each jack. The phase begins the capture somewhere in the
        # first set.
        number = 2 * round(own.jacks)
        begin = -hop * (1 + self.subject.phase * (number - 2))
        uneven = np.random.default_rng(self.subject.manner)
        sets: list[list[_Flight]] = []
        while begin < until_s:
            unlike, early = np.clip(uneven.standard_normal((2, number)), -2.0, 2.0)
            late = hop * own.uneven * early
            late[1::2] += longer * hop
            begins = begin + 0.8 * hop + hop * np.arange(number) + late
            flights = enumerate(zip(begins.tolist(), unlike.tolist(), strict=True))
            sets.append(
                [_Flight(at, at + flight, apart and k % 2 == 0, much) for k, (at, much) in flights]
            )
            begin = sets[-1][-1].end + 0.8 * hop + own.rest_s / self.subject.tempo
        return sets

    def _knots(self, hops: list[_Flight], longest_s: float) -> tuple[list[_Knot], ...]:
        """Knots of root, ankles and heels over their heights in standing.

        The root is thrown and caught; between knots it flies along a parabola, because the
        accelerations at both ends are the same. Relative to the hips the ankles move slowly while
        the legs are stretched: in flight, at take-off and at landing, where they are higher by what
        the raised heel lifts them. So the knees bend on the floor only, where the heels come down
        for a while, if there is time. The third curve is that part of the second that is over the
        toes.
        """
        roots, ankles = list[_Knot](), list[_Knot]()
        drop, follow = self.heel[2], self.own.follow
        # Each contact: how the root arrives from the flight before, and leaves into the one after,
        # both in free fall.
        for (begin, end), before, after in _contacts(hops, longest_s):
            span, down, up = end - begin, 0.0, 0.0
            least = 2 * drop / (longest_s if before and after else span)
            caught = thrown = _REST
            if before:
                level, _, speed = self._thrown(before, landing=True)
                caught = level - self.standing, -speed, -GRAVITY_MPS2
                down = max(follow * speed, least)
            if after:
                level, speed, _ = self._thrown(after, landing=False)
                thrown = level - self.standing, speed, -GRAVITY_MPS2
                up = max(follow * speed, least)
            # The ankles come down at a speed of their own and go up again, with a rest on the floor
            # if there is time for it.
            roots += [(begin, caught), (end, thrown)]
            stays = not (down and up) or 2 * drop * (1 / down + 1 / up) < span
            if not stays:  # the largest speeds at which the heels do not go below the floor
                down, up = (min(speed, 3.2 * drop / span) for speed in (down, up))
            if before:
                ankles.append((begin, (drop, -down, 0.0)))
            if before and stays:
                ankles.append((begin + 2 * drop / down, _REST))
            if after and stays:
                ankles.append((end - 2 * drop / up, _REST))
            if after:
                ankles.append((end, (drop, up, 0.0)))
        tops: dict[float, tuple[float, float, float]] = {}  # between them the feet stay as they are
        for (begin, (_, up, _)), (end, (_, down, _)) in pairwise(ankles):
            if up > 0:  # a flight
                middle, top = (begin + end) / 2, (self.own.point * drop, 0.0, 0.0)
                tops |= {min(begin + 2 * drop / up, middle): top}
                tops |= {max(end + 2 * drop / down, middle): top}
        return roots, ankles, sorted([*ankles, *tops.items()])

    def _thrown(self, hop: _Flight, *, landing: bool) -> tuple[float, float, float]:
        """Height of the root at one end of a flight [m], and its speeds up and down [m/s]."""
        begin, end = self.levels[int(not hop.apart)], self.levels[int(hop.apart)]
        # Speed at take-off for a flight of this time between both levels; gravity takes the rest.
        up = (end - begin) / hop.span + GRAVITY_MPS2 * hop.span / 2
        return end if landing else begin, up, GRAVITY_MPS2 * hop.span - up

    # -- poses -------------------------------------------------------------------------------------

    def poses(self, t: Array) -> Pose:
        """Poses at times (n,) [s]."""
        own, height, close, span = self.own, self.subject.height_m, self.close, self.span
        # A jumper does not move before the first hop of a set and after the last: further sets do
        # not matter.
        begun = [hops[0].begin - self.hop_s < t[-1] for hops in self.sets]
        ended = [hops[-1].end + self.hop_s <= t[0] for hops in self.sets]
        near = [
            k for k, (here, over) in enumerate(zip(begun, ended, strict=True)) if here and not over
        ]
        # Root, ankles and heels over time, from the knots of the sets at hand.
        hops = [hop for k in near for hop in self.sets[k]]
        rises = [sum((_through(t, self.knots[k][of]) for k in near), 0 * t) for of in range(3)]
        z, ankles_rise, heels = self.standing + rises[0], rises[1], rises[2]
        landed = _between(t, hops, [0.0, *(height * own.scatter * hop.unlike for hop in hops)])
        # The feet move sideways while they are well off the floor.
        apart = _between(t, hops, [0.0, *(float(hop.apart) for hop in hops)], -0.05 * span)
        airborne = sum((bump((t - hop.begin) / hop.span) for hop in hops), 0 * t)
        # The foot stands on its toe as far as the ankle is raised over it.
        roll = heels / self.heel[2]
        pitch = _pitch(heels / height)
        trail, above = own.trail * height * airborne, ANKLE * height + ankles_rise - heels
        ankle = rolled(pitch, height) + xyz(-trail, 0.0, above)
        # Who crouches leans forward; trunk and head waver slowly.
        lean = np.radians(own.lean + own.crouch * (height * ROOT - z) / (0.1 * height))
        lean += math.radians(own.nod) * self._wavering(t, "nod")
        turn = math.radians(own.turn) * self._wavering(t, "turn")
        thorax = about(z=-turn, x=0.4 * turn, y=lean)
        ankles, feet, left = {}, {}, {}
        # Feet go out by the width of the hop, toes and knees turned outward.
        for side, sign in SIDES.items():
            outward = about(z=sign * math.radians(own.toes_out) * apart)
            across = sign * (close + (self.wide - close) * apart)
            before = sign * own.astride * height * apart + landed
            left[side] = about(z=sign * math.radians(own.knees_out)).apply(LEFT)
            ankles[side] = outward.apply(ankle) + xyz(before, across, 0.0)
            feet[side] = outward * about(y=pitch)
        return Pose(
            root=xyz(height * (own.sway * roll + own.rock * apart) + landed, 0.0, z),
            pelvis=about(z=turn, y=0.5 * lean),
            thorax=thorax,
            head=about(y=0.5 * lean),
            ankles=ankles,
            feet=feet,
            arms=self._arms(t, hops, thorax),
            left=left,
            shrug=math.radians(own.shrug) * apart,
        )

    def _wavering(self, t: Array, what: str) -> Array:
        """Slow swings (n,) from -1 to 1 of ``what``: nobody does the same all the time."""
        turns, swings = t / self.hop_s, 0 * t
        for name, rate in ((f"{what} of a jack", 0.5), (f"slow {what}", 0.31)):
            swings += np.sin(2 * np.pi * (rate * turns + self.subject.drawn(name, 0.0, 1.0)))
        return np.asarray(0.5 * swings)

    def _arms(self, t: Array, hops: list[_Flight], thorax: Rotation) -> dict[str, Arm]:
        """Arms that go up aside as the feet go apart, and swing forward."""
        own, contact, span = self.own, self.contact, self.span
        swung = np.zeros(len(t))
        # Arms swing forward about each flight, and back shortly before it.
        for hop in hops:
            swung += own.swing * bump((t - hop.begin + 0.3 * contact) / (span + 0.7 * contact))
            swung -= own.back * bump((t - hop.begin + 0.8 * contact) / (0.7 * contact))
        ends = math.radians(own.lowest), math.radians(own.highest) * self.subject.amplitude**0.5
        vary = math.radians(own.vary)
        reached = [ends[0], *(ends[hop.apart] + vary * hop.unlike for hop in hops)]
        # Two moves of the arms that overlap are one that lasts longer.
        lates = (own.behind * contact + half for half in (-own.late_s / 2, own.late_s / 2))
        early, late = (
            _between(t, hops, reached, 0.48 * contact - own_s, 0.45 * contact + own_s)
            for own_s in lates
        )
        raised = 0.5 * early + 0.5 * late
        beyond = (raised - ends[0]) / (ends[1] - ends[0])
        moving = np.sin(np.pi * beyond) ** 2
        arms = {}
        # The higher an arm is, the more the forearm bends over the head; the elbow bends most
        # half-way.
        for side, sign in SIDES.items():
            upper = thorax * about(
                x=sign * self.subject.uneven[side] * raised, y=-np.radians(own.forward + swung)
            )
            fore = upper * about(
                x=sign * math.radians(own.overhead) * beyond,
                y=-np.radians(own.elbow + own.elbow_swing * moving),
            )
            arms[side] = Arm(upper, fore, fore)
        return arms


def jumping_jack(duration_s: float, subject: Subject, activity: str = "jumping_jack") -> PosesAt:
    """Jumping jacks, facing +x.

    The ``activity`` "jump" has both legs together, on the spot.
    """
    return _Jumper(subject, "hop" if subject.style == "hop" else activity, duration_s).poses


def _between(
    t: Array, hops: list[_Flight], values: list[float], lead: float = 0.0, lag: float | None = None
) -> Array:
    """Move (n,) from the value before the first flight to those after each of them."""
    if not hops:
        return np.full(len(t), values[0])
    lag = lead if lag is None else lag
    times = [time for hop in hops for time in (hop.begin - lead, hop.end + lag)]
    return keyed(t, times, np.repeat(values, 2)[1:-1])


def _pitch(rise: Array) -> Array:
    """Pitch of a foot (n,) [rad] whose ankle rises so far over its toes, in heights: `rolled`."""
    below = ANKLE - TOE_HEIGHT
    return np.arcsin((rise + below) / math.hypot(TOE_X, below)) - math.atan2(below, TOE_X)
