"""Synthetic jumping jacks, and jumps on the spot.

Each flight is a parabola, each contact a quintic between flights.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rtradar.motion.synthetic.figure import (
    ANKLE,
    HIP,
    HIP_Y,
    ROOT,
    SHANK,
    SIDES,
    THIGH,
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

GRAVITY_MPS2 = 9.81

ROLL = 0.38
"""The heels lift and come down in this part of a contact, before take-off and after landing."""


@dataclass(frozen=True, kw_only=True)
class _Manner:
    """How somebody does jacks; lengths are fractions of the height, angles in degrees."""

    hop_s: float
    """Time from take-off to take-off at tempo 1."""
    flight_s: float
    jacks: float
    """Number of jacks, or of pairs of jumps, between rests."""
    rest_s: float
    uneven: float
    """Deviation of the times of single hops, in hops."""
    lopsided: float
    """Cube root of how much longer than usual the feet stay apart, in fifths of a hop."""
    wide: float
    """Feet beyond the hip joints, where they are apart."""
    close: float
    """Feet relative to the hip joints, where they are together."""
    toes_out: float
    astride: float
    """How far one foot lands before the other where they are apart."""
    heels: float
    lift: float
    highest: float
    lowest: float
    late_s: float
    """How much longer the arms move than in one hop; so they rest at no end of their way."""
    behind: float
    """By which part of a contact the arms are behind the feet, or before them."""
    elbow: float
    elbow_swing: float
    overhead: float
    """How far the elbows bend to bring the hands together over the head."""
    forward: float
    lean: float
    crouch: float
    """Further lean where the root is a tenth of the height lower than in standing."""
    turn: float
    shrug: float
    swing: float = 0.0
    """How far both arms swing forward with each hop."""
    back: float = 0.0
    """The same back, before take-off."""


_RANGES = {
    "hop_s": (0.5, 0.64),
    "flight_s": (0.14, 0.23),
    "jacks": (6.0, 20.0),
    "rest_s": (0.1, 0.4),
    "uneven": (0.006, 0.02),
    "lopsided": (-1.0, 1.0),
    "wide": (0.09, 0.23),
    "close": (0.75, 1.3),
    "toes_out": (4.0, 20.0),
    "astride": (-0.07, 0.07),
    "heels": (20.0, 32.0),
    "lift": (0.007, 0.016),
    "highest": (112.0, 150.0),
    "lowest": (8.0, 20.0),
    "late_s": (0.05, 0.16),
    "behind": (-0.4, 0.5),
    "elbow": (6.0, 30.0),
    "elbow_swing": (0.0, 36.0),
    "overhead": (0.0, 60.0),
    "forward": (0.0, 14.0),
    "lean": (1.0, 9.5),
    "crouch": (1.0, 9.0),
    "turn": (2.0, 10.0),
    "shrug": (12.0, 26.0),
}
"""Ranges of jumping jacks."""

_JUMPS = _RANGES | {
    "hop_s": (0.56, 0.95),
    "flight_s": (0.24, 0.46),
    "jacks": (2.0, 5.0),
    "rest_s": (0.1, 1.2),
    "uneven": (0.01, 0.03),
    "lopsided": (0.0, 0.0),
    "close": (0.8, 1.9),
    "toes_out": (0.0, 0.0),
    "astride": (0.0, 0.0),
    "late_s": (0.04, 0.16),
    "behind": (0.0, 0.0),
    "lift": (0.008, 0.02),
    "elbow": (15.0, 60.0),
    "forward": (0.0, 10.0),
    "lean": (0.0, 6.0),
    "crouch": (2.0, 14.0),
    "swing": (5.0, 50.0),
    "back": (0.0, 20.0),
}
"""Ranges of jumps with both legs, where they are not those of jumping jacks."""


class _Flight(NamedTuple):
    """One hop: when, and whether the feet are apart afterwards."""

    begin: float
    end: float
    apart: bool


def _sets(subject: Subject, manner: _Manner, until_s: float, *, apart: bool) -> list[list[_Flight]]:
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
        late = hop * manner.uneven * np.clip(uneven.standard_normal(number), -2.0, 2.0)
        late[1::2] += longer * hop
        begins = begin + 0.8 * hop + hop * np.arange(number) + late
        sets.append(
            [
                _Flight(float(at), float(at) + flight, apart and k % 2 == 0)
                for k, at in enumerate(begins)
            ]
        )
        begin = sets[-1][-1].end + 0.8 * hop + manner.rest_s / subject.tempo
    return sets


def _height(
    t: Array,
    sets: list[list[_Flight]],
    prepare_s: float,
    standing: float,
    levels: tuple[float, ...],
) -> Array:
    """Height of the root (n,): standing, thrown, free, caught; levels are those of landings."""
    z = np.full(len(t), standing)
    for hops in sets:
        state, contact, level = (standing, 0.0, 0.0), hops[0].begin - prepare_s, levels[0]
        for hop in hops:
            span = hop.end - hop.begin
            arrive = levels[int(hop.apart)]
            up = (arrive - level) / span + GRAVITY_MPS2 * span / 2
            push = (t >= contact) & (t < hop.begin)
            z[push] = hermite(t[push], (contact, hop.begin), state, (level, up, -GRAVITY_MPS2))
            fly = (t >= hop.begin) & (t < hop.end)
            since = t[fly] - hop.begin
            z[fly] = level + up * since - GRAVITY_MPS2 * since**2 / 2
            state = arrive, up - GRAVITY_MPS2 * span, -GRAVITY_MPS2
            contact, level = hop.end, arrive
        last = (t >= contact) & (t < contact + prepare_s)
        z[last] = hermite(t[last], (contact, contact + prepare_s), state, (standing, 0.0, 0.0))
    return z


def jumping_jack(duration_s: float, subject: Subject) -> PosesAt:
    """Jumping jacks, facing +x."""
    return _hopping(duration_s, subject, _RANGES, apart=True)


def jump(duration_s: float, subject: Subject) -> PosesAt:
    """Jumps with both legs on the spot, facing +x."""
    return _hopping(duration_s, subject, _JUMPS, apart=False)


def _hopping(
    duration_s: float, subject: Subject, ranges: Mapping[str, tuple[float, float]], *, apart: bool
) -> PosesAt:
    manner = _Manner(**{name: subject.drawn(name, *some) for name, some in ranges.items()})
    return partial(_hops, subject, manner, _sets(subject, manner, duration_s, apart=apart))


def _shortest_contact(all_sets: list[list[_Flight]]) -> float:
    """Return the shortest time on the floor between two hops of a set [s]."""
    return min(after.begin - hop.end for hops in all_sets for hop, after in pairwise(hops))


def _level(height: float, heel: Array, track: float) -> float:
    """Height of the root at take-off and landing [m], with a foot so far aside of the middle [m].

    ``heel`` (3,) is how far the ankle is moved by the raised heel [m].
    """
    leg = 0.97 * (THIGH + SHANK) * height
    below = math.sqrt(leg**2 - (track - HIP_Y * height) ** 2 - heel[0] ** 2)
    return float((ANKLE + ROOT - HIP) * height + heel[2] + below)


def _turning(subject: Subject, manner: _Manner, t: Array) -> Array:
    """Yaw (n,) of the hips [rad]: nobody faces exactly the same way all the time."""
    swings = [
        np.sin(
            2 * np.pi * (rate * subject.tempo * t / manner.hop_s + subject.drawn(name, 0.0, 1.0))
        )
        for rate, name in ((0.5, "turn of a jack"), (0.31, "slow turn"))
    ]
    return np.asarray(0.5 * math.radians(manner.turn) * (swings[0] + swings[1]))


def _hops(subject: Subject, manner: _Manner, all_sets: list[list[_Flight]], t: Array) -> Pose:
    height, amplitude = subject.height_m, subject.amplitude
    hop_s = manner.hop_s / subject.tempo
    # A jumper does not move before the first hop of a set and after the last: further sets do not
    # matter.
    sets = [one for one in all_sets if one[0].begin - hop_s < t[-1] and one[-1].end + hop_s > t[0]]
    hops = [hop for hops in sets for hop in hops]

    def between(values: tuple[float, float], lead: float, lag: float) -> Array:
        """Move from the first value (feet together) to the second (apart) and back in flights."""
        if not hops:
            return np.full(len(t), values[0])
        times = [time for hop in hops for time in (hop.begin - lead, hop.end + lag)]
        reached = np.repeat([values[int(hop.apart)] for hop in hops], 2)
        return keyed(t, times, [values[0], *reached[:-1]])

    span = all_sets[0][0].end - all_sets[0][0].begin
    contact = _shortest_contact(all_sets)
    # The feet move sideways while they are well off the floor.
    apart = between((0.0, 1.0), -0.05 * span, -0.05 * span)
    # Heels lift before take-off and come down after landing, so that the legs need not be straight
    # there.
    roll_s, heels = ROLL * contact, math.radians(manner.heels)
    lift, roll, swung = np.zeros(len(t)), np.zeros(len(t)), np.zeros(len(t))
    for hop in hops:
        swung += manner.swing * bump((t - hop.begin + 0.3 * contact) / (span + 0.7 * contact))
        swung -= manner.back * bump((t - hop.begin + 0.8 * contact) / (0.7 * contact))
        lift += bump((t - hop.begin) / (hop.end - hop.begin))
        roll += bump((t - hop.begin + roll_s) / (hop.end - hop.begin + 2 * roll_s))
    pitch = heels * roll
    ankle = rolled(pitch, height)
    ankle[:, 2] += height * (ANKLE + manner.lift * lift)

    close, wide = manner.close * HIP_Y * height, (HIP_Y + manner.wide * amplitude) * height
    heel = rolled(heels * bump(np.array([roll_s / (span + 2 * roll_s)])), height)[0]
    low, high = (_level(height, heel, track) for track in (wide, close))
    z = _height(t, sets, 0.75 * hop_s, height * (ROOT - 0.008), (high, low))
    lowest, highest = (
        math.radians(manner.lowest),
        math.radians(manner.highest) * amplitude**0.5,
    )
    # Two moves of the arms that overlap are one that lasts longer.
    raised = sum(
        0.5 * between((lowest, highest), 0.48 * contact - late, 0.45 * contact + late)
        for late in (
            manner.behind * contact - manner.late_s / 2,
            manner.behind * contact + manner.late_s / 2,
        )
    )
    moving = np.sin(np.pi * (raised - lowest) / (highest - lowest)) ** 2
    lean = np.radians(manner.lean + manner.crouch * (height * ROOT - z) / (0.1 * height))
    turn = _turning(subject, manner, t)
    thorax = about(z=-turn, x=0.4 * turn, y=lean)
    ankles, feet, arms = {}, {}, {}
    for side, sign in SIDES.items():
        outward = about(z=sign * math.radians(manner.toes_out) * apart)
        across = sign * (close + (wide - close) * apart)
        before = sign * manner.astride * height * apart
        ankles[side] = outward.apply(ankle) + xyz(before, across, 0.0)
        feet[side] = outward * about(y=pitch)
        upper = thorax * about(
            x=sign * subject.uneven[side] * raised,
            y=lean - np.radians(manner.forward + swung),
        )
        fore = upper * about(
            x=sign * math.radians(manner.overhead) * (raised - lowest) / (highest - lowest),
            y=-np.radians(manner.elbow + manner.elbow_swing * moving),
        )
        arms[side] = Arm(upper, fore, fore)
    return Pose(
        root=xyz(0.015 * height * roll, 0.0, z),
        pelvis=about(z=turn, y=0.5 * lean),
        thorax=thorax,
        head=about(y=0.5 * lean),
        ankles=ankles,
        feet=feet,
        arms=arms,
        shrug=math.radians(manner.shrug) * apart,
    )
