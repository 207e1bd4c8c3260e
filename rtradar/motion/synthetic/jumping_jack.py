"""Synthetic jumping jacks: each flight is a parabola, each contact a quintic between flights."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np

from rtradar.motion.synthetic.curves import bump, hermite, keyed
from rtradar.motion.synthetic.figure import (
    ANKLE,
    HIP,
    HIP_Y,
    ROOT,
    SHANK,
    SIDES,
    THIGH,
    Array,
    Pose,
    PosesAt,
    roll_about_toe,
    swing_arm,
    turn,
)
from rtradar.motion.synthetic.traits import Traits

GRAVITY_MPS2 = 9.81
HOP_S = 0.53
"""Time from take-off to take-off [s]; a jack of two hops lasts 1.1 s in CMU 13 and 14."""

FLIGHT_S = 0.22
ROLL = 0.29
"""The heels lift and come down in this part of a contact, before take-off and after landing."""

SET = 5
"""Jacks between rests."""

REST_S = 0.7


@dataclass(frozen=True)
class _Flight:
    """One hop: when, and whether the feet are apart afterwards."""

    begin: float
    end: float
    apart: float


def _sets(traits: Traits, until_s: float) -> list[list[_Flight]]:
    """Sets of flights; each set begins and ends standing."""
    hop = HOP_S / traits.tempo
    # A hop of the same height takes as long at any tempo; only where contact would get too short it
    # must be lower.
    flight = min(FLIGHT_S * math.sqrt(traits.amplitude), 0.55 * hop)
    begin = 0.15 + 0.3 * traits.phase
    sets: list[list[_Flight]] = []
    while begin < until_s:
        first = begin + 0.8 * hop
        sets.append(
            [
                _Flight(first + k * hop, first + k * hop + flight, float(k % 2 == 0))
                for k in range(2 * SET)
            ]
        )
        begin = sets[-1][-1].end + 0.8 * hop + REST_S / traits.tempo
    return sets


def _height(
    t: Array,
    sets: list[list[_Flight]],
    prepare_s: float,
    standing: float,
    levels: tuple[float, float],
) -> Array:
    """Height of the root (n,): standing, thrown, free, caught."""
    z = np.full(len(t), standing)
    for hops in sets:
        state = (standing, 0.0, 0.0)
        contact = hops[0].begin - prepare_s
        level = levels[0]
        for hop in hops:
            span = hop.end - hop.begin
            arrive = levels[int(hop.apart)]
            up = (arrive - level) / span + GRAVITY_MPS2 * span / 2
            push = (t >= contact) & (t < hop.begin)
            z[push] = hermite(t[push], (contact, hop.begin), state, (level, up, -GRAVITY_MPS2))
            fly = (t >= hop.begin) & (t < hop.end)
            since = t[fly] - hop.begin
            z[fly] = level + up * since - GRAVITY_MPS2 * since**2 / 2
            state, contact, level = (
                (arrive, up - GRAVITY_MPS2 * span, -GRAVITY_MPS2),
                hop.end,
                arrive,
            )
        last = (t >= contact) & (t < contact + prepare_s)
        z[last] = hermite(t[last], (contact, contact + prepare_s), state, (standing, 0.0, 0.0))
    return z


def jumping_jack(duration_s: float, traits: Traits) -> PosesAt:
    """Jumping jacks, facing +x."""
    return partial(_jump, traits, _sets(traits, duration_s))


def _jump(traits: Traits, all_sets: list[list[_Flight]], t: Array) -> Pose:
    height, amplitude = traits.height_m, traits.amplitude
    hop_s = HOP_S / traits.tempo
    # Who jumps has stood still before the first hop of a set, and does after the last: further sets
    # do not matter.
    sets = [
        hops for hops in all_sets if hops[0].begin - hop_s < t[-1] and hops[-1].end + hop_s > t[0]
    ]
    hops = [hop for hops in sets for hop in hops]

    def between(values: tuple[float, float], lead: float, lag: float) -> Array:
        """Move from the first value (feet together) to the second (apart) and back in flights."""
        if not hops:
            return np.full(len(t), values[0])
        times = [time for hop in hops for time in (hop.begin - lead, hop.end + lag)]
        return keyed(
            t, times, [values[0], *(values[int(hop.apart)] for hop in hops for _ in (0, 1))][:-1]
        )

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
    rolled = roll_about_toe(pitch, height)
    rolled[:, 2] += height * (ANKLE + 0.010 * lift)

    span = hop_s - contact
    heel = roll_about_toe(
        math.radians(34) * bump(np.array([roll_s / (span + 2 * roll_s)])), height
    )[0]
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
    root = np.stack([0.03 * height * roll, np.zeros(len(t)), z], axis=1)
    lean = math.radians(3) + math.radians(3) * (height * ROOT - z) / (0.1 * height)
    pelvis = turn("y", np.full(len(t), math.radians(3)))
    thorax = turn("y", lean)
    ankles, feet, arms = {}, {}, {}
    for side, sign in SIDES.items():
        outward = turn("z", sign * math.radians(12) * apart)
        across = sign * (close + (wide - close) * apart)
        ankles[side] = outward.apply(rolled) + across[:, None] * np.array([0.0, 1.0, 0.0])
        feet[side] = outward * turn("y", pitch)
        arms[side] = swing_arm(
            thorax,
            side,
            forward=np.full(len(t), math.radians(4)),
            outward=traits.uneven[side] * raised,
            elbow=np.radians(14 + 44 * moving),
            wrist=0.05,
        )
    return Pose(
        root=root,
        pelvis=pelvis,
        thorax=thorax,
        head=turn("y", np.full(len(t), math.radians(3))),
        ankles=ankles,
        feet=feet,
        left=np.tile([0.0, 1.0, 0.0], (len(t), 1)),
        arms=arms,
        shrug=math.radians(22) * apart,
    )
