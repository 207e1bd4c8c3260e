"""Synthetic actors who sit down and stand up, bend, squat, wave and fall, again and again.

Of falls, backward the hips come down behind feet that stay, and the trunk follows; forward the
knees come down first, over the toes, and the arms go ahead. Who fell lies, and gets up slowly.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from rtradar.motion.synthetic.balance import (
    AHEAD,
    over_feet,
    quiet,
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
    STYLES,
    THIGH,
    Arm,
    Array,
    Pose,
    PosesAt,
    Subject,
    about,
    rolled,
    smooth,
    swing_arm,
    xyz,
)

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

LEGS = (THIGH + SHANK) * MAXIMUM_REACH
"""Length of the legs, all but straight, relative to the height."""

_SUDDEN = 1.35
"""Whoever falls is slow first, as what topples, and fastest shortly before the floor."""


def _crouched(
    subject: Subject,
    own: SimpleNamespace,
    forward: Array,
    legs: Array,
    tilts: tuple[Array, Array, Array],
    arms: tuple[Array, Array],
) -> Pose:
    """A pose with hips at a way forward (n,) [m], over feet that stand.

    ``legs`` are their lengths over the height, ``tilts`` those of pelvis, thorax and head, and
    ``arms`` the angles of arms forward and of elbows [rad].
    """
    feet = soles(subject, len(forward), own.feet, own.toes)
    pelvis, thorax, head = (about(y=tilt) for tilt in tilts)
    outward = math.radians(own.arms_out)
    swung = {
        side: swing_arm(thorax, side, arms[0] * uneven, outward, arms[1])
        for side, uneven in subject.uneven.items()
    }
    root = over_feet(feet, subject.height_m, pelvis, forward, legs)
    return replace(feet, root=root, pelvis=pelvis, thorax=thorax, head=head, arms=swung)


def bend(duration_s: float, subject: Subject) -> PosesAt:
    """Bend down, with hanging arms, and up again."""
    own = subject.traits("bend")
    deep = math.radians(own.bend) * min(subject.amplitude, 1.0)
    raised = math.radians(max(own.raised, 0.0))
    straight = own.straight_legs

    def pose(bent: Array, forward: Array) -> Pose:
        tilt = deep * bent
        legs = LEGS * (straight + (min(own.knees, straight) - straight) * bent)
        tilts = own.hips * tilt, tilt + math.radians(2), 0.8 * tilt
        swung = math.radians(4) + raised * (1 - bent) + (1 + own.reach) * tilt
        elbows = np.radians(own.elbows + 0 * bent)
        return _crouched(subject, own, forward, legs, tilts, (swung, elbows))

    return _balanced(duration_s, subject, own, pose)


def squat(duration_s: float, subject: Subject) -> PosesAt:
    """Squat and rise; the arms go forward."""
    own = subject.traits("squat")
    low = 1 - (1 - own.depth) * min(subject.amplitude, 1.05)
    lean, arms = math.radians(own.lean), math.radians(own.arms)

    def pose(bent: Array, forward: Array) -> Pose:
        tilt = lean * bent
        legs = LEGS * (own.straight_legs - (own.straight_legs - low) * bent)
        tilts = 0.8 * tilt, tilt + math.radians(2), 0.2 * tilt
        angles = math.radians(4) + (arms + lean) * bent, np.radians(14 + 0 * bent)
        return _crouched(subject, own, forward, legs, tilts, angles)

    return _balanced(duration_s, subject, own, pose)


def _balanced(
    duration_s: float, subject: Subject, own: SimpleNamespace, pose: Callable[[Array, Array], Pose]
) -> PosesAt:
    """Repeat a pose by how far it is and by the way of the root forward, in balance."""
    done = repetitions(subject, own, duration_s)

    def poses(t: Array) -> Pose:
        bent = done(t)
        way = standing(subject, partial(pose, bent), np.zeros(len(t)))
        return restless(subject, own, t, pose(bent, way))

    return poses


def sit(duration_s: float, subject: Subject) -> PosesAt:
    """Sit down on a seat, stay, and stand up again."""
    own, height = subject.traits("sit"), subject.height_m
    done = repetitions(subject, own, duration_s, extent=0.0)
    lean, rests = math.radians(own.lean), math.radians(own.rests)
    legs = LEGS * own.straight_legs

    def pose(bent: Array, forward: Array) -> Pose:
        way = 4 * bent * (1 - bent)
        tilt = lean * way
        hands = math.radians(3) + math.radians(own.thighs) * bent + 0.3 * tilt
        tilts = 0.7 * tilt + rests * bent, tilt + rests * bent + math.radians(2), 0.3 * tilt
        arms = hands, np.radians(12 + (own.elbows - 12) * bent)
        found = _crouched(subject, own, forward, legs + 0 * bent, tilts, arms)
        level = (ANKLE + legs + ROOT - HIP - own.seat) * height
        found.root[:, 2] += bent * (level - found.root[:, 2])
        return found

    def poses(t: Array) -> Pose:
        bent = done(t)
        seated = np.full(len(t), -own.seat_behind * height)
        # The feet carry until the seat does.
        carried = smooth((bent - 0.55) / 0.45)
        stood = standing(subject, partial(pose, np.minimum(bent, 1.0)), 0.4 * bent * seated)
        return restless(subject, own, t, pose(bent, stood + carried * (seated - stood)))

    return poses


def wave(duration_s: float, subject: Subject) -> PosesAt:
    """Stand and wave one hand, or both."""
    own = subject.traits("wave")
    both = subject.style == "two_hands" or (not subject.style and own.both > 0.6)
    done = repetitions(subject, own, duration_s)
    rate, swing = 2 * math.pi * own.rate * subject.tempo, own.swing * subject.amplitude

    def poses(t: Array) -> Pose:
        body = quiet(subject, t)
        up = done(t)
        arms = dict(body.arms)
        for side, sign in SIDES.items():
            if not both and side != subject.side:
                continue
            turn = 0.0 if own.mirrored > 0.5 or side == subject.side else math.pi
            # The rate drifts, and the hand follows the forearm.
            beat = rate * t + own.begun + turn + 0.3 * np.sin(0.37 * rate * t + own.begun)
            upper = body.thorax * about(
                x=sign * np.radians(8 + up * (own.outward - 8 + own.shoulder * np.sin(beat))),
                y=-np.radians(4 + (own.forward - 4) * up),
            )
            fore = upper * about(x=sign * np.radians(up * (own.elbow + swing * np.sin(beat - 0.3))))
            hand = fore * about(x=sign * np.radians(up * 0.5 * swing * np.sin(beat - 0.9)))
            arms[side] = Arm(upper, fore, hand)
        return restless(subject, own, t, replace(body, arms=arms))

    return poses


# -- falls -----------------------------------------------------------------------------------------


def _angle(done: Array, first_deg: float, middle_deg: float, last_deg: float) -> Array:
    """Angle (n,) [rad] along the parabola through three values, at 0, 1/2 and 1."""
    before, between = (2 * done - 1) * (done - 1), 4 * done * (1 - done)
    after = done * (2 * done - 1)
    return np.radians(first_deg * before + middle_deg * between + last_deg * after)


def fall(duration_s: float, subject: Subject) -> PosesAt:
    """Fall to the floor, lie and get up, again and again."""
    style = subject.style or STYLES["fall"][int(subject.drawn("style of fall", 0.0, 1.0) > 0.5)]
    own = subject.traits(f"fall_{style}")
    # Gravity gives the pace.
    subject = replace(subject, tempo=math.sqrt(1.75 / subject.height_m))
    done = repetitions(subject, own, duration_s, sudden=_SUDDEN, extent=0.0)
    falling = _backward if style == "backward" else _forward

    def poses(t: Array) -> Pose:
        # What is above the hips follows them.
        return falling(subject, own, done(t), done(t - own.late / subject.tempo))

    return poses


def _arms(
    subject: Subject,
    thorax: Rotation,
    follows: Array,
    forward: tuple[float, float],
    outward: tuple[float, float],
    elbow: tuple[float, float],
) -> dict[str, Arm]:
    """Arms that hang at first, with angles in the middle of a fall and on the floor [deg]."""
    aside, bent = _angle(follows, 9, *outward), _angle(follows, 14, *elbow)
    ahead = {
        side: _angle(follows, 4, forward[0] * uneven, forward[1])
        for side, uneven in subject.uneven.items()
    }
    return {side: swing_arm(thorax, side, ahead[side], aside, bent, 0.0) for side in SIDES}


def _backward(subject: Subject, own: SimpleNamespace, down: Array, follows: Array) -> Pose:
    height = subject.height_m
    feet = soles(subject, len(down), own.feet, own.toes)
    root = height * xyz(
        AHEAD - 0.012 - (own.behind + AHEAD) * down,
        0.0,
        ROOT - 0.006 + (own.lying - ROOT + 0.006) * down,
    )
    twist = math.radians(own.twisted) * 4 * follows * (1 - follows)
    pelvis = about(z=0.4 * twist, y=_angle(follows, 1, 0.6 * own.crouched - 20, -84))
    thorax = about(z=twist, y=_angle(follows, 2, own.crouched - 12, -87))
    outward = 0.7 * own.spread, own.spread
    arms = _arms(subject, thorax, follows, (own.raised, 3), outward, (38, own.elbow))
    head = about(z=twist, y=_angle(follows, 3, 10, own.head))
    return replace(feet, root=root, pelvis=pelvis, thorax=thorax, head=head, arms=arms)


def _forward(subject: Subject, own: SimpleNamespace, down: Array, follows: Array) -> Pose:
    height = subject.height_m
    feet = soles(subject, len(down), own.feet, 0.0)
    # The heels lift over the toes, which stay; then shanks and thighs, each by its angle.
    pitch = np.radians(own.heels) * down
    ankle = rolled(pitch, height)
    lying = ANKLE + rolled(np.radians([own.heels]), 1.0)[0, 2]
    shank = _angle(down, 6, 48, math.degrees(math.acos((0.035 - lying) / SHANK)))
    thigh = _angle(down, -6, -own.sits_back, 0) + _angle(follows, 0, 40, 80)
    pelvis = about(y=_angle(follows, 1, own.hips, 87))
    thorax = about(y=_angle(follows, 2, own.chest, 86))
    hips = ankle + height * (
        xyz(0.0, 0.0, ANKLE + 0 * down)
        + SHANK * xyz(np.sin(shank), 0.0, np.cos(shank))
        + THIGH * xyz(np.sin(thigh), 0.0, np.cos(thigh))
    )
    root = hips + pelvis.apply([0.0, 0.0, (ROOT - HIP) * height])
    head = about(y=_angle(follows, 3, 14, own.head))
    arms = _arms(
        subject, thorax, follows, (own.reach, -4), (0.55 * own.spread, own.spread), (26, 0)
    )
    ankles = {side: feet.ankles[side] + ankle for side in SIDES}
    feet = replace(feet, ankles=ankles, feet={side: about(y=pitch) for side in SIDES})
    return replace(feet, root=root, pelvis=pelvis, thorax=thorax, head=head, arms=arms)
