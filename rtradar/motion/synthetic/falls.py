"""Synthetic falls: somebody stands, topples, lies on the floor, and gets up slowly.

Backward the hips come down behind feet that stay, and the trunk follows; forward the knees come
down first, over the toes, and the arms go ahead.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rtradar.motion.synthetic.balance import AHEAD, repetitions, soles
from rtradar.motion.synthetic.figure import (
    ANKLE,
    HIP,
    ROOT,
    SHANK,
    SIDES,
    THIGH,
    Array,
    Pose,
    PosesAt,
    Subject,
    about,
    rolled,
    swing_arm,
    xyz,
)

FALLS = ("backward", "forward")
"""Styles of falls."""

_FALLING_S = {"backward": (0.95, 1.2), "forward": (1.25, 1.55)}
_SPANS_S = {"stay": (1.5, 4.0), "back": (2.3, 3.6), "rest": (0.5, 1.6)}
"""Durations of the fall, of lying, of getting up and of standing [s], at 1.75 m."""

_SUDDEN = 1.35
"""Whoever falls is slow first, as what topples, and fastest shortly before the floor."""


def _angle(done: Array, first_deg: float, middle_deg: float, last_deg: float) -> Array:
    """Angle (n,) [rad] along the parabola through three values, at 0, 1/2 and 1."""
    before, between, after = (
        (2 * done - 1) * (done - 1),
        4 * done * (1 - done),
        done * (2 * done - 1),
    )
    return np.radians(first_deg * before + middle_deg * between + last_deg * after)


def fall(duration_s: float, subject: Subject) -> PosesAt:
    """Fall to the floor, lie and get up, again and again."""
    style = subject.style or FALLS[int(subject.drawn("style of fall", 0.0, 1.0) > 0.5)]
    # Gravity gives the pace.
    subject = replace(subject, tempo=math.sqrt(1.75 / subject.height_m))
    spans = {"go": _FALLING_S[style], **_SPANS_S}
    done = repetitions(subject, duration_s, spans, sudden=_SUDDEN, extent=0.0)
    late_s = subject.drawn("late", 0.1, 0.22) / subject.tempo

    def poses(t: Array) -> Pose:
        # What is above the hips follows them.
        follows = done(t - late_s)
        return (_backward if style == "backward" else _forward)(subject, done(t), follows)

    return poses


def _backward(subject: Subject, down: Array, follows: Array) -> Pose:
    drawn, height = subject.drawn, subject.height_m
    feet = soles(subject, len(down), drawn("feet", 1.0, 2.2), drawn("toes", 4.0, 16.0))
    behind = drawn("behind", 0.3, 0.38)
    root = height * xyz(
        AHEAD - 0.012 - (behind + AHEAD) * down,
        0.0,
        ROOT - 0.006 + (drawn("lying", 0.075, 0.09) - ROOT + 0.006) * down,
    )
    crouched, twisted = drawn("crouched", 0.0, 18.0), math.radians(drawn("twisted", -10.0, 10.0))
    twist = twisted * 4 * follows * (1 - follows)
    pelvis = about(z=0.4 * twist, y=_angle(follows, 1, 0.6 * crouched - 20, -84))
    thorax = about(z=twist, y=_angle(follows, 2, crouched - 12, -87))
    spread, raised = drawn("spread", 18.0, 60.0), drawn("raised", 15.0, 60.0)
    arms = {
        side: swing_arm(
            thorax,
            side,
            forward=_angle(follows, 4, raised * subject.uneven[side], 3),
            outward=_angle(follows, 9, 0.7 * spread, spread),
            elbow=_angle(follows, 14, 38, drawn("elbow", 4.0, 30.0)),
            wrist=0.0,
        )
        for side in SIDES
    }
    head = about(z=twist, y=_angle(follows, 3, 10, drawn("head", -84.0, -70.0)))
    return replace(feet, root=root, pelvis=pelvis, thorax=thorax, head=head, arms=arms)


def _forward(subject: Subject, down: Array, follows: Array) -> Pose:
    drawn, height = subject.drawn, subject.height_m
    feet = soles(subject, len(down), drawn("feet", 1.0, 2.0), 0.0)
    # The heels lift over the toes, which stay; then shanks and thighs, each by its angle.
    last = drawn("heels", 74.0, 86.0)
    pitch = np.radians(last) * down
    ankle = rolled(pitch, height)
    lying = ANKLE + rolled(np.radians([last]), 1.0)[0, 2]
    shank = _angle(down, 6, 48, math.degrees(math.acos((0.035 - lying) / SHANK)))
    thigh = _angle(down, -6, -drawn("sits back", 8.0, 26.0), 0) + _angle(follows, 0, 40, 80)
    pelvis = about(y=_angle(follows, 1, drawn("hips", 20.0, 40.0), 87))
    thorax = about(y=_angle(follows, 2, drawn("chest", 25.0, 48.0), 86))
    hips = ankle + height * (
        xyz(0.0, 0.0, ANKLE + 0 * down)
        + SHANK * xyz(np.sin(shank), 0.0, np.cos(shank))
        + THIGH * xyz(np.sin(thigh), 0.0, np.cos(thigh))
    )
    root = hips + pelvis.apply([0.0, 0.0, (ROOT - HIP) * height])
    head = about(y=_angle(follows, 3, 14, drawn("head", 68.0, 80.0)))
    spread, reach = drawn("spread", 95.0, 150.0), drawn("reach", 20.0, 60.0)
    arms = {
        side: swing_arm(
            thorax,
            side,
            forward=_angle(follows, 4, reach * subject.uneven[side], -4),
            outward=_angle(follows, 9, 0.55 * spread, spread),
            elbow=_angle(follows, 14, 26, 0),
            wrist=0.0,
        )
        for side in SIDES
    }
    ankles = {side: feet.ankles[side] + ankle for side in SIDES}
    return replace(
        feet,
        root=root,
        pelvis=pelvis,
        thorax=thorax,
        head=head,
        ankles=ankles,
        feet={side: about(y=pitch) for side in SIDES},
        arms=arms,
    )
