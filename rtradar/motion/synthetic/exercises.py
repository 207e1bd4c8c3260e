"""Synthetic kicks, punches and jumping jacks, repeated with short rests.

Each flight of a jumping jack is a parabola, each contact a quintic between flights.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from rtradar.motion.synthetic.figure import (
    ANKLE,
    FOREARM,
    HIP,
    HIP_Y,
    LEFT,
    ROOT,
    SHANK,
    SIDES,
    THIGH,
    UP,
    UPPER_ARM,
    Array,
    Pose,
    PosesAt,
    Subject,
    about,
    bump,
    hermite,
    keyed,
    reach_arm,
    rolled,
    swing_arm,
    xyz,
)

KICK_PERIOD_S, PUNCH_PERIOD_S = 1.5, 1.05
"""One kick, or one punch, and a short rest."""

GRAVITY_MPS2 = 9.81
HOP_S, FLIGHT_S = 0.53, 0.22
"""Times from take-off to take-off, and in the air [s]; a jack of two hops lasts 1.1 s in CMU 13
and 14."""

ROLL = 0.29
"""The heels lift and come down in this part of a contact, before take-off and after landing."""

SET, REST_S = 5, 0.7
"""Number of jacks between rests, and the duration of a rest [s]."""


def repeated(t: Array, subject: Subject, period_s: float, first_s: float) -> Array:
    """Time since the current repetition began (n,), at nominal tempo [s]; negative before it."""
    own = (t - first_s * (0.5 + subject.phase)) * subject.tempo
    return np.where(own < 0, own, np.mod(own, period_s))


def _degrees(clock: Array, times: list[float], values: list[float]) -> Array:
    return np.radians(keyed(clock, times, values))


def kick(subject: Subject, t: Array) -> Pose:
    """Front kicks of one leg, facing +x.

    The leg is led by joint angles in the air and by its footprint on the floor.
    """
    height, kicker, other = subject.height_m, subject.side, subject.other
    clock = repeated(t, subject, KICK_PERIOD_S, 0.25)
    # A low kick needs nearly as high a knee, or the foot would scrape the floor.
    rise = 0.45 + 0.55 * subject.amplitude * subject.uneven[kicker]
    thigh = _degrees(
        clock, [0.12, 0.50, 0.75, 1.00, 1.30], [0.0, 94 * rise, 112 * rise, 76 * rise, 0.0]
    )
    knee = _degrees(clock, [0.06, 0.36, 0.42, 0.76, 1.06, 1.30], [8.0, 96.0, 96.0, 16.0, 88.0, 8.0])
    air = keyed(clock, [0.14, 0.36, 1.04, 1.30], [0.0, 1.0, 1.0, 0.0])
    strike = keyed(clock, [0.30, 0.75, 0.80, 1.26], [0.0, 1.0, 1.0, 0.0])
    shift = keyed(clock, [0.0, 0.28, 1.08, 1.45], [0.0, 1.0, 1.0, 0.0])

    track = 1.15 * HIP_Y * height
    idle = np.sin(2 * np.pi * (0.28 * t + subject.phase))
    root = xyz(
        height * (-0.012 * strike + 0.002 * idle),
        SIDES[other] * 0.75 * track * shift,
        height * (ROOT - 0.016 - 0.004 * shift),
    )
    pelvis = about(z=SIDES[other] * np.radians(14 * strike), y=-np.radians(13 * strike))
    thorax = about(z=-SIDES[other] * np.radians(10 * strike), y=np.radians(4 - 18 * strike))

    ground = {
        kicker: np.array([-0.06 * height, SIDES[kicker] * track, ANKLE * height]),
        other: np.array([0.02 * height, SIDES[other] * track, ANKLE * height]),
    }
    hip = root + pelvis.apply(height * np.array([0.0, SIDES[kicker] * HIP_Y, HIP - ROOT]))
    shank = thigh - knee  # from straight down, forward

    bones = ((THIGH, thigh), (SHANK, shank))
    flying = hip + height * sum(
        length * xyz(np.sin(angle), 0.0, -np.cos(angle)) for length, angle in bones
    )
    point = _degrees(clock, [0.12, 0.40, 0.75, 1.02, 1.28], [0.0, 20.0, 40.0, 15.0, 0.0])
    pitch = air * (point - shank)
    # While it is partly on the floor the foot rolls about its toe, so that the toe does not sink.
    low = ground[kicker] + rolled(np.maximum(pitch, 0.0), height)
    # Up before forward, and forward before down.
    clear = 0.16 * height * (air * (1 - air))[:, None] * UP
    ankles = {
        kicker: low + air[:, None] * (flying - low) + clear,
        other: np.tile(ground[other], (len(t), 1)),
    }
    feet = {kicker: about(y=pitch), other: about(y=0.0)}
    arms = {}
    for side in SIDES:
        back = (25.0 if side == kicker else -15.0) * strike
        arms[side] = swing_arm(
            thorax,
            side,
            forward=np.radians(38 - back + 2 * idle),
            outward=np.radians(14 + 8 * strike),
            elbow=np.radians(105 - 25 * strike * (side == kicker)),
        )
    head = about(y=math.radians(3) * (1 - strike))
    return Pose(
        root=root, pelvis=pelvis, thorax=thorax, head=head, ankles=ankles, feet=feet, arms=arms
    )


def punch(subject: Subject, t: Array) -> Pose:
    """Straight punches of the rear hand, facing +x."""
    height, hand, other = subject.height_m, subject.side, subject.other
    clock = repeated(t, subject, PUNCH_PERIOD_S, 0.25)
    # The hips lead, the hand follows and arrives last; then it comes back more slowly.
    hips = keyed(clock, [0.06, 0.30, 0.38, 0.80], [0.0, 1.0, 1.0, 0.0])
    chest = keyed(clock, [0.10, 0.33, 0.38, 0.80], [0.0, 1.0, 1.0, 0.0])
    reach = keyed(clock, [0.17, 0.345, 0.39, 0.74], [0.0, 1.0, 1.0, 0.0])
    strength = subject.amplitude * subject.uneven[hand]

    back = SIDES[hand]  # yaw that takes the striking shoulder back
    idle = np.sin(2 * np.pi * (0.9 * subject.tempo * t + subject.phase))
    root = xyz(
        height * 0.03 * strength * hips,
        0.002 * height * idle,
        height * (ROOT - 0.035 - 0.008 * hips + 0.003 * idle),
    )
    pelvis = about(z=back * np.radians(22 - 30 * strength * hips), y=math.radians(4))
    thorax = about(z=back * np.radians(28 - 52 * strength * chest), y=np.radians(6 + 5 * chest))

    track = 1.3 * HIP_Y * height
    feet_x = {other: 0.11 * height, hand: -0.11 * height}
    yaw = {other: back * math.radians(8), hand: back * math.radians(40)}
    ankles = {
        side: np.tile([feet_x[side], SIDES[side] * track, ANKLE * height], (len(t), 1))
        for side in SIDES
    }
    feet = {side: about(z=yaw[side]) for side in SIDES}

    length = (UPPER_ARM + FOREARM) * height
    arms = {}
    for side, sign in SIDES.items():
        guard = thorax.apply(length * np.array([0.42, -sign * 0.12, 0.10]))
        if side == hand:
            ahead = length * np.array([0.97, -sign * 0.12, 0.02])
            wrist = guard + min(strength, 1.0) * reach[:, None] * (ahead - guard)
        else:
            wrist = guard - 0.06 * length * chest[:, None] * np.array([1.0, 0.0, 0.0])
        arms[side] = reach_arm(thorax, side, wrist, height, math.radians(25))
    head, left = about(z=back * np.radians(4 - 6 * chest), y=math.radians(5)), pelvis.apply(LEFT)
    shrug = np.radians(2 + 5 * chest)
    return Pose(
        root=root,
        pelvis=pelvis,
        thorax=thorax,
        head=head,
        ankles=ankles,
        feet=feet,
        arms=arms,
        left=left,
        shrug=shrug,
    )


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
