"""Synthetic actors who sit down and stand up, bend, squat and wave, again and again on the spot."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rtradar.motion.synthetic.balance import (
    over_feet,
    repetitions,
    restless,
    soles,
    standing,
)
from rtradar.motion.synthetic.figure import (
    ANKLE,
    HIP,
    MAXIMUM_REACH,
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
    smooth,
    swing_arm,
)
from rtradar.motion.synthetic.stance import stand

LEGS = (THIGH + SHANK) * MAXIMUM_REACH
"""Length of the legs, all but straight, relative to the height."""

WAVES = ("one_hand", "two_hands")
"""Styles of waving."""

_Bent = Callable[[Array, Array], Pose]
"""A pose by how far the movement is (n,) and by the way of the root forward (n,) [m]."""


def _upright(subject: Subject) -> float:
    """How straight the legs of somebody who stands are, relative to `LEGS`."""
    return subject.drawn("straight legs", 0.985, 0.996)


def _arms(pose: Pose, subject: Subject, forward: Array, elbow: Array) -> dict[str, Arm]:
    outward = math.radians(subject.drawn("arms out", 5.0, 16.0))
    return {
        side: swing_arm(
            pose.thorax, side, forward=forward * subject.uneven[side], outward=outward, elbow=elbow
        )
        for side in SIDES
    }


def bend(duration_s: float, subject: Subject) -> PosesAt:
    """Bend down, with hanging arms, and up again."""
    drawn = subject.drawn
    done = repetitions(
        subject,
        duration_s,
        {"go": (0.8, 1.3), "stay": (0.0, 0.25), "back": (0.8, 1.3), "rest": (0.0, 0.4)},
    )
    deep = math.radians(drawn("bend", 64.0, 110.0)) * min(subject.amplitude, 1.0)
    hips, knees = drawn("hips", 0.5, 0.72), drawn("knees", 0.93, 0.99)
    reach, elbows = drawn("reach", -0.1, 0.25), drawn("elbows", 6.0, 25.0)
    # Many raise their arms each time before they go down.
    raised = math.radians(max(drawn("raised", -50.0, 165.0), 0.0))

    def pose(bent: Array, forward: Array) -> Pose:
        straight = _upright(subject)
        legs = LEGS * (straight + (min(knees, straight) - straight) * bent)
        feet = soles(subject, len(bent), drawn("feet", 0.9, 1.7), drawn("toes", 3.0, 14.0))
        pelvis = about(y=hips * deep * bent)
        some = replace(
            feet,
            root=over_feet(feet, subject.height_m, pelvis, forward, legs),
            pelvis=pelvis,
            thorax=about(y=deep * bent + math.radians(2)),
            head=about(y=0.8 * deep * bent),
        )
        hanging = math.radians(4) + raised * (1 - bent) + (1 + reach) * deep * bent
        return replace(some, arms=_arms(some, subject, hanging, np.radians(elbows + 0 * bent)))

    return _balanced(subject, pose, done)


def squat(duration_s: float, subject: Subject) -> PosesAt:
    """Squat and rise; the arms go forward."""
    drawn = subject.drawn
    done = repetitions(
        subject,
        duration_s,
        {"go": (0.6, 1.3), "stay": (0.0, 0.4), "back": (0.6, 1.2), "rest": (0.05, 0.5)},
    )
    low = 1 - (1 - drawn("depth", 0.45, 0.68)) * min(subject.amplitude, 1.05)
    lean, arms = math.radians(drawn("lean", 18.0, 48.0)), math.radians(drawn("arms", 15.0, 95.0))

    def pose(bent: Array, forward: Array) -> Pose:
        straight, pelvis = _upright(subject), about(y=0.8 * lean * bent)
        legs = LEGS * (straight - (straight - low) * bent)
        feet = soles(subject, len(bent), drawn("feet", 1.5, 3.4), drawn("toes", 8.0, 30.0))
        some = replace(
            feet,
            root=over_feet(feet, subject.height_m, pelvis, forward, legs),
            pelvis=pelvis,
            thorax=about(y=lean * bent + math.radians(2)),
            head=about(y=0.2 * lean * bent),
        )
        raised = math.radians(4) + (arms + lean) * bent
        return replace(some, arms=_arms(some, subject, raised, np.radians(14 + 0 * bent)))

    return _balanced(subject, pose, done)


def sit(duration_s: float, subject: Subject) -> PosesAt:
    """Sit down on a seat, stay, and stand up again."""
    drawn, height = subject.drawn, subject.height_m
    done = repetitions(
        subject,
        duration_s,
        {"go": (1.0, 1.7), "stay": (0.2, 1.7), "back": (1.0, 1.6), "rest": (0.1, 0.9)},
        extent=0.0,
    )
    down, behind = drawn("seat", 0.2, 0.27), drawn("seat behind", 0.19, 0.23)
    lean, rests = math.radians(drawn("lean", 30.0, 52.0)), math.radians(drawn("rests", -6.0, 12.0))
    thighs, elbows = drawn("thighs", 18.0, 42.0), drawn("elbows", 25.0, 70.0)

    def pose(bent: Array, forward: Array) -> Pose:
        feet = soles(subject, len(bent), drawn("feet", 0.9, 2.0), drawn("toes", 3.0, 16.0))
        way = 4 * bent * (1 - bent)
        pelvis = about(y=0.7 * lean * way + rests * bent)
        legs = LEGS * _upright(subject)
        root = over_feet(feet, height, pelvis, forward, legs + 0 * bent)
        root[:, 2] += bent * ((ANKLE + legs + ROOT - HIP - down) * height - root[:, 2])
        some = replace(
            feet,
            root=root,
            pelvis=pelvis,
            thorax=about(y=lean * way + rests * bent + math.radians(2)),
            head=about(y=0.3 * lean * way),
        )
        forearms = np.radians(12 + (elbows - 12) * bent)
        hands = math.radians(3) + math.radians(thighs) * bent + 0.3 * lean * way
        return replace(some, arms=_arms(some, subject, hands, forearms))

    def poses(t: Array) -> Pose:
        bent = done(t)
        seated = np.full(len(t), -behind * height)
        # The feet carry until the seat does.
        carried = smooth((bent - 0.55) / 0.45)
        stood = standing(subject, lambda way: pose(np.minimum(bent, 1.0), way), 0.4 * bent * seated)
        return restless(subject, t, pose(bent, stood + carried * (seated - stood)))

    return poses


def _balanced(subject: Subject, pose: _Bent, done: Callable[[Array], Array]) -> PosesAt:
    def poses(t: Array) -> Pose:
        bent = done(t)
        way = standing(subject, lambda way: pose(bent, way), np.zeros(len(t)))
        return restless(subject, t, pose(bent, way))

    return poses


def wave(duration_s: float, subject: Subject) -> PosesAt:
    """Stand and wave one hand, or both."""
    drawn = subject.drawn
    both = subject.style == "two_hands" or (not subject.style and drawn("both", 0.0, 1.0) > 0.6)
    done = repetitions(
        subject,
        duration_s,
        {"go": (0.7, 1.2), "stay": (6.0, 14.0), "back": (0.7, 1.2), "rest": (0.0, 0.4)},
    )
    rate = 2 * math.pi * drawn("rate", 0.8, 1.45) * subject.tempo
    outward, forward = drawn("outward", 60.0, 125.0), drawn("forward", -5.0, 35.0)
    elbow, swing = drawn("elbow", 45.0, 85.0), drawn("swing", 10.0, 27.0) * subject.amplitude
    shoulder, begun = drawn("shoulder", 1.0, 8.0), drawn("begun", 0.0, 2 * math.pi)
    mirrored = drawn("mirrored", 0.0, 1.0) > 0.5

    def poses(t: Array) -> Pose:
        body = stand(subject, t)
        up = done(t)
        arms = dict(body.arms)
        for side, sign in SIDES.items():
            if not both and side != subject.side:
                continue
            turn = 0.0 if mirrored or side == subject.side else math.pi
            # The rate drifts, and the hand follows the forearm.
            beat = rate * t + begun + turn + 0.3 * np.sin(0.37 * rate * t + begun)
            upper = body.thorax * about(
                x=sign * np.radians(8 + up * (outward - 8 + shoulder * np.sin(beat))),
                y=-np.radians(4 + (forward - 4) * up),
            )
            fore = upper * about(x=sign * np.radians(up * (elbow + swing * np.sin(beat - 0.3))))
            hand = fore * about(x=sign * np.radians(up * 0.5 * swing * np.sin(beat - 0.9)))
            arms[side] = Arm(upper, fore, hand)
        return restless(subject, t, replace(body, arms=arms))

    return poses
