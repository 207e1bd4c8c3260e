"""Synthetic actors on the spot: who stands, sits, bends, squats, waves, falls and lies, in balance.

In quiet standing the body rotates about the ankles, forward and back, an inverted pendulum that the
calf muscles hold as a spring; sideways the hips move over both feet, and the trunk stays upright
(D. A. Winter et al., Stiffness control of balance in quiet standing, J. Neurophysiol. 80 (1998)
1211-1221). The root, about the height of the centre of mass, moves by 4 mm (root mean square)
forward and back and by 2 mm sideways, as of healthy young adults with open eyes (T. E. Prieto et
al., Measures of postural steadiness, IEEE Trans. Biomed. Eng. 43 (1996) 956-966). The power
spectral density is that of noise through a low-pass of second order, 1 / (1 + (f / f0)^2)^2: most
is slow drift, little is above 1 Hz.

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

from rtradar.motion.synthetic.figure import (
    ANKLE,
    HIP,
    HIP_Y,
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
    centre_of_mass,
    rolled,
    smooth,
    swing_arm,
    xyz,
)

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

BED_M = 0.5
"""Height of a bed [m]."""

AHEAD = 0.025
"""Centre of mass ahead of the ankles of who stands, relative to the height: 4 cm."""


def standing(subject: Subject, pose: Callable[[Array], Pose], forward: Array) -> Array:
    """Ways of the hips forward (n,) [m] with which the centre of mass is `AHEAD` of the ankles.

    ``pose`` gives the pose of such ways; ``forward`` is the first guess.
    """
    # The feet stay, so that the centre of mass moves by a little less than the hips do: with a
    # factor just above 1 a few steps suffice.
    for _ in range(4):
        centre = centre_of_mass(pose(forward), subject.height_m)[:, 0]
        forward = forward - 1.1 * (centre - AHEAD * subject.height_m)
    return forward


def soles(subject: Subject, n: int, apart: float, toes_out_deg: float) -> Pose:
    """A pose (n) whose feet stand flat; all else is to be replaced.

    ``apart`` is the distance of the feet relative to that of the hip joints.
    """
    still, height = np.zeros(n), subject.height_m
    upright = about(z=still)
    return Pose(
        root=xyz(still, 0.0, 0.0),
        pelvis=upright,
        thorax=upright,
        head=upright,
        ankles={
            side: xyz(still, sign * apart * HIP_Y * height, ANKLE * height)
            for side, sign in SIDES.items()
        },
        feet={
            side: about(z=still + sign * math.radians(toes_out_deg)) for side, sign in SIDES.items()
        },
        arms={},
    )


def over_feet(feet: Pose, height_m: float, pelvis: Rotation, forward: Array, legs: Array) -> Array:
    """Root (n, 3) with hips at a way forward, and at ``legs`` of the height from the ankles."""
    ankle = feet.ankles["l"]
    aside = ankle[:, 1] - HIP_Y * height_m
    away = forward - ankle[:, 0]
    # The hip is at the given distance from the ankle; what that leaves after both level parts is
    # its height.
    up = np.sqrt(np.maximum((legs * height_m) ** 2 - aside**2 - away**2, (0.02 * height_m) ** 2))
    hips = xyz(forward, 0.0, ankle[:, 2] + up)
    return np.asarray(hips + pelvis.apply([0.0, 0.0, (ROOT - HIP) * height_m]))


def restless(subject: Subject, own: SimpleNamespace, t: Array, pose: Pose) -> Pose:
    """The same pose with hips and shoulders that turn a little, and sway to the sides."""
    turn = np.sin(2 * np.pi * (own.restless_rate * t + own.restless))
    aside = np.sin(2 * np.pi * (own.swaying_rate * t + own.swaying))
    turn = math.radians(own.turns) * turn
    return replace(
        pose,
        root=pose.root + xyz(0.0, own.sways * subject.height_m * aside, 0.0),
        pelvis=about(z=turn) * pose.pelvis,
        thorax=about(z=-0.6 * turn) * pose.thorax,
    )


def repetitions(
    subject: Subject,
    own: SimpleNamespace,
    until_s: float,
    *,
    sudden: float = 1.0,
    extent: float = 0.06,
) -> Callable[[Array], Array]:
    """Plan a movement that goes there, stays, comes back and rests, again and again.

    How far it is at times (n,) [s] is given, from 0 to about 1. The subject's usual durations are
    the traits "go", "stay", "back" and "rest" at tempo 1; each repetition differs by some percent
    in time, and by ``extent`` in how far it goes. With ``sudden`` above 1 the way there begins
    slowly and ends fast.
    """
    usual = np.array([own.go, own.stay, own.back, own.rest]) / subject.tempo
    rng = np.random.default_rng(subject.manner)
    begin = -subject.phase * float(usual.sum())
    rows = []
    # The plan of all repetitions, each a little different, from before 0 on.
    while begin < until_s + 1.0:
        go, stay, back, rest = usual * (1 + 0.06 * np.clip(rng.standard_normal(4), -2.0, 2.0))
        far = 1 + extent * float(np.clip(rng.standard_normal(), -2.0, 2.0))
        rows.append((begin + rest, go, stay, back, far))
        begin += go + stay + back + rest
    table = np.array(rows)

    def fraction(t: Array) -> Array:
        k = np.clip(np.searchsorted(table[:, 0], t, side="right") - 1, 0, len(table) - 1)
        first, go, stay, back, far = table[k].T
        # There by a minimum-jerk move, and back by another.
        since = t - first
        there = smooth(np.clip(since / go, 0.0, 1.0) ** sudden)
        return np.asarray(far * (there - smooth((since - go - stay) / back)))

    return fraction


# -- who stands ----------------------------------------------------------------------------------

FORWARD_M, SIDEWAYS_M = 0.004, 0.002
"""Root mean squares of the sway of the root, forward and back and sideways [m]."""

CORNER_HZ = 0.25
"""Frequency f0 of the spectrum, above which it falls with the fourth power."""

LEAN = math.radians(2.5)
"""Mean lean: the centre of mass is 4 cm ahead of the ankles."""

_TONES_HZ = np.geomspace(0.02, 2.0, 48)
"""Frequencies of the sway, in a geometric progression, so that it does not repeat."""

_PHASES = 2 * np.pi * np.outer([math.sqrt(2), math.sqrt(3)], np.arange(1, 49) ** 2)
"""Phases of the tones in both directions, without order (Weyl)."""

_LONGEST_S = 5000.0
"""Subjects and takes begin anywhere in this part of the same sway."""


def sway(t: Array, phases: Array) -> Array:
    """Sway (n,) of root mean square 1 in the long run, at times (n,) of tempo 1 [s]."""
    # Tones of the spectrum's power in their share of the band, in sum a variance of 1.
    power = np.gradient(_TONES_HZ) / (1 + (_TONES_HZ / CORNER_HZ) ** 2) ** 2
    amplitudes = np.sqrt(2 * power / power.sum())
    turned = 2 * np.pi * np.multiply.outer(t, _TONES_HZ) + phases
    return np.asarray(np.cos(turned) @ amplitudes)


def stand(_: float, subject: Subject) -> PosesAt:
    """Stand quietly, facing +x."""
    return partial(quiet, subject)


def quiet(subject: Subject, t: Array) -> Pose:
    """Pose of somebody who stands quietly."""
    height = subject.height_m
    begun = subject.tempo * t + _LONGEST_S * subject.phase
    forward, sideways = (
        subject.amplitude * size * sway(begun, phases)
        for size, phases in zip((FORWARD_M, SIDEWAYS_M), _PHASES, strict=True)
    )
    # A leg is all but straight: it reaches from the ankle to a hip that moves on a circle about it.
    pendulum = (ROOT - ANKLE - 0.001) * height
    lean, aside = LEAN + forward / pendulum, sideways / pendulum
    upright = pendulum * np.cos(aside)
    root = xyz(
        upright * np.sin(lean), pendulum * np.sin(aside), ANKLE * height + upright * np.cos(lean)
    )
    body = about(y=lean)
    out, ahead, bent = math.radians(8), LEAN + math.radians(4), np.full(len(t), math.radians(12))
    uneven = subject.uneven.items()
    arms = {side: swing_arm(body, side, ahead, out, bent * own) for side, own in uneven}
    head = about(y=np.full(len(t), math.radians(2)))
    feet = soles(subject, len(t), 1.1, 8.0)
    return replace(feet, root=root, pelvis=body, thorax=body, head=head, arms=arms)


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
        # The trunk tilts, the knees give a little, and the arms hang or reach.
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
    """Sit down on a seat, stay, and stand up again; the style ``still`` stays on it."""
    own, height = subject.traits("sit"), subject.height_m
    done = repetitions(subject, own, duration_s, extent=0.0)
    lean, rests = math.radians(own.lean), math.radians(own.rests)
    legs = LEGS * own.straight_legs

    def pose(bent: Array, forward: Array) -> Pose:
        # The trunk leans forward most half-way.
        way = 4 * bent * (1 - bent)
        tilt = lean * way
        hands = math.radians(3) + math.radians(own.thighs) * bent + 0.3 * tilt
        tilts = 0.7 * tilt + rests * bent, tilt + rests * bent + math.radians(2), 0.3 * tilt
        arms = hands, np.radians(12 + (own.elbows - 12) * bent)
        found = _crouched(subject, own, forward, legs + 0 * bent, tilts, arms)
        # The seat, not the feet, gives the height in the end.
        level = (ANKLE + legs + ROOT - HIP - own.seat) * height
        found.root[:, 2] += bent * (level - found.root[:, 2])
        return found

    def poses(t: Array) -> Pose:
        if subject.style == "still":
            return pose(np.ones(len(t)), np.full(len(t), -own.seat_behind * height))
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
        # The upper arm is raised, and the forearm swings, on that side or on both.
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


def lie(_: float, subject: Subject) -> PosesAt:
    """Lie on the back and keep still, feet ahead; on a bed, `BED_M` high, or on the floor."""
    own, height = subject.traits("lie"), subject.height_m
    level = BED_M if subject.style == "bed" else 0.0

    def poses(t: Array) -> Pose:
        still, whole = np.zeros(len(t)), np.ones(len(t))
        flat = soles(subject, len(t), own.feet, 0.0)
        trunk, head = (about(y=still - math.radians(angle)) for angle in (90.0, own.head))
        # The legs are all but stretched, and the toes point upward.
        ankles = {
            side: place + xyz((ROOT - HIP + LEGS) * height, 0.0, level + own.heels * height)
            for side, place in flat.ankles.items()
        }
        feet = {side: about(y=still - math.radians(own.toes_up)) for side in SIDES}
        arms = _arms(subject, trunk, whole, (0, 0), (own.spread,) * 2, (own.elbow,) * 2)
        return replace(
            flat,
            root=xyz(still, 0.0, level + own.lying * height),
            pelvis=trunk,
            thorax=trunk,
            head=head,
            ankles={side: place - xyz(0.0, 0.0, ANKLE * height) for side, place in ankles.items()},
            feet=feet,
            arms=arms,
        )

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
    # Hips go back and down along a line, while the feet stay and the trunk follows.
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
    # From the toes up: ankles, knees and hips by the angles of shank and thigh.
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
