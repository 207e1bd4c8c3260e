"""Synthetic jumping jacks: each flight is a parabola, each contact a quintic between flights."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

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
    Array,
    Pose,
    PosesAt,
    Subject,
    about,
    bump,
    hermite,
    keyed,
    rolled,
    swing_arm,
    xyz,
)

GRAVITY_MPS2 = 9.81
HOP_S, FLIGHT_S = 0.53, 0.22
"""Times from take-off to take-off, and in the air [s]; a jack of two hops lasts 1.1 s in CMU 13
and 14."""

ROLL = 0.29
"""The heels lift and come down in this part of a contact, before take-off and after landing."""

SET, REST_S = 5, 0.7
"""Number of jacks between rests, and the duration of a rest [s]."""


class _Flight(NamedTuple):
    """One hop: when, and whether the feet are apart afterwards."""

    begin: float
    end: float
    apart: bool


def _sets(subject: Subject, until_s: float) -> list[list[_Flight]]:
    """Sets of flights; each set begins and ends standing."""
    hop = HOP_S / subject.tempo
    # A hop of the same height takes as long at any tempo; only where contact would get too short it
    # must be lower.
    flight = min(FLIGHT_S * math.sqrt(subject.amplitude), 0.55 * hop)
    begin = 0.15 + 0.3 * subject.phase
    sets: list[list[_Flight]] = []
    while begin < until_s:
        first = begin + 0.8 * hop
        begins = [first + k * hop for k in range(2 * SET)]
        sets.append([_Flight(at, at + flight, k % 2 == 0) for k, at in enumerate(begins)])
        begin = sets[-1][-1].end + 0.8 * hop + REST_S / subject.tempo
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
    return partial(_jump, subject, _sets(subject, duration_s))


def _jump(subject: Subject, all_sets: list[list[_Flight]], t: Array) -> Pose:
    height, amplitude = subject.height_m, subject.amplitude
    hop_s = HOP_S / subject.tempo
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

    close, wide = 0.9 * HIP_Y * height, (HIP_Y + 0.10 * amplitude) * height
    # The feet move sideways while they are well off the floor.
    apart = between((0.0, 1.0), -0.12 * FLIGHT_S, -0.12 * FLIGHT_S)
    # Heels lift before take-off and come down after landing, so that the legs need not be straight
    # there.
    contact = hop_s - (all_sets[0][0].end - all_sets[0][0].begin) if all_sets else hop_s - FLIGHT_S
    roll_s = ROLL * contact
    lift, roll = np.zeros(len(t)), np.zeros(len(t))
    for hop in hops:
        lift += bump((t - hop.begin) / (hop.end - hop.begin))
        roll += bump((t - hop.begin + roll_s) / (hop.end - hop.begin + 2 * roll_s))
    pitch = math.radians(34) * roll
    ankle = rolled(pitch, height)
    ankle[:, 2] += height * (ANKLE + 0.010 * lift)

    span = hop_s - contact
    heel = rolled(math.radians(34) * bump(np.array([roll_s / (span + 2 * roll_s)])), height)[0]
    leg = 0.97 * (THIGH + SHANK) * height
    low, high = (
        ANKLE * height
        + heel[2]
        + (ROOT - HIP) * height
        + math.sqrt(leg**2 - (track - HIP_Y * height) ** 2 - heel[0] ** 2)
        for track in (wide, close)
    )
    z = _height(t, sets, 0.75 * hop_s, height * (ROOT - 0.008), (high, low))
    lowest, highest = math.radians(12), math.radians(134) * amplitude**0.5
    raised = between((lowest, highest), 0.51 * contact, 0.48 * contact)
    moving = np.sin(np.pi * (raised - lowest) / (highest - lowest)) ** 2
    thorax = about(y=np.radians(3 + 3 * (height * ROOT - z) / (0.1 * height)))
    ankles, feet, arms = {}, {}, {}
    for side, sign in SIDES.items():
        outward = about(z=sign * math.radians(12) * apart)
        across = sign * (close + (wide - close) * apart)
        ankles[side] = outward.apply(ankle) + across[:, None] * LEFT
        feet[side] = outward * about(y=pitch)
        arms[side] = swing_arm(
            thorax,
            side,
            forward=math.radians(4),
            outward=subject.uneven[side] * raised,
            elbow=np.radians(14 + 44 * moving),
            wrist=0.05,
        )
    root, upright = xyz(0.03 * height * roll, 0.0, z), about(y=math.radians(3))
    shrug = math.radians(22) * apart
    return Pose(
        root=root,
        pelvis=upright,
        thorax=thorax,
        head=upright,
        ankles=ankles,
        feet=feet,
        arms=arms,
        shrug=shrug,
    )
