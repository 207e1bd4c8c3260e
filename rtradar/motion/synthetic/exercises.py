"""Synthetic kicks and punches, repeated with short rests."""

from __future__ import annotations

import math

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
    Subject,
    about,
    keyed,
    reach_arm,
    rolled,
    swing_arm,
    xyz,
)

KICK_PERIOD_S, PUNCH_PERIOD_S = 1.5, 1.05
"""One kick, or one punch, and a short rest."""


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
