"""Bodies that stay on the spot: who stands, repetitions, and a centre of mass over the feet.

In quiet standing the body rotates about the ankles, forward and back, an inverted pendulum that the
calf muscles hold as a spring; sideways the hips move over both feet, and the trunk stays upright
(D. A. Winter et al., Stiffness control of balance in quiet standing, J. Neurophysiol. 80 (1998)
1211-1221). The root, about the height of the centre of mass, moves by 4 mm (root mean square)
forward and back and by 2 mm sideways, as of healthy young adults with open eyes (T. E. Prieto et
al., Measures of postural steadiness, IEEE Trans. Biomed. Eng. 43 (1996) 956-966). The power
spectral density is that of noise through a low-pass of second order, 1 / (1 + (f / f0)^2)^2: most
is slow drift, little is above 1 Hz.

Masses and the centres of segments are those of D. A. Winter, Biomechanics and Motor Control of
Human Movement, table 4.1; trunk and head, which bend here, are split between their ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from rtradar.motion.quaternions import quaternion_rotate
from rtradar.motion.skeleton import NODE_PARENT, NODES
from rtradar.motion.synthetic.figure import (
    ANKLE,
    HIP,
    HIP_Y,
    ROOT,
    SIDES,
    Array,
    Pose,
    PosesAt,
    Subject,
    about,
    offsets,
    rotations,
    smooth,
    swing_arm,
    xyz,
)

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

_MASSES = {"thorax": (0.497, 0.5), "head": (0.081, 0.5)} | {
    f"{side}_{node}": mass
    for side in SIDES
    for node, mass in {
        "elbow": (0.028, 0.436),
        "wrist": (0.016, 0.43),
        "hand": (0.006, 0.506),
        "knee": (0.1, 0.433),
        "ankle": (0.0465, 0.433),
        "toe": (0.0145, 0.5),
    }.items()
}
"""Mass of the segment that ends in a node, relative to the body, and place of its centre on it."""

AHEAD = 0.025
"""Centre of mass ahead of the ankles of who stands, relative to the height: 4 cm."""


def joints(pose: Pose, height_m: float) -> dict[str, Array]:
    """Positions (n, 3) of all nodes [m]."""
    turned, bones = rotations(pose, height_m), offsets(height_m)
    found = {"root": pose.root}
    for node, parent in NODE_PARENT.items():
        found[node] = found[parent] + quaternion_rotate(turned[:, NODES.index(node)], bones[node])
    return found


def centre_of_mass(pose: Pose, height_m: float) -> Array:
    """Centre of mass (n, 3) of a pose [m]."""
    at = joints(pose, height_m)
    starts = {**NODE_PARENT, "thorax": "root", "head": "thorax"}
    centre = sum(
        mass * (at[starts[node]] + part * (at[node] - at[starts[node]]))
        for node, (mass, part) in _MASSES.items()
    )
    return np.asarray(centre) / sum(mass for mass, _ in _MASSES.values())


def standing(subject: Subject, pose: Callable[[Array], Pose], forward: Array) -> Array:
    """Ways of the hips forward (n,) [m] with which the centre of mass is `AHEAD` of the ankles.

    ``pose`` gives the pose of such ways; ``forward`` is the first guess.
    """
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
    while begin < until_s + 1.0:
        go, stay, back, rest = usual * (1 + 0.06 * np.clip(rng.standard_normal(4), -2.0, 2.0))
        far = 1 + extent * float(np.clip(rng.standard_normal(), -2.0, 2.0))
        rows.append((begin + rest, go, stay, back, far))
        begin += go + stay + back + rest
    table = np.array(rows)

    def fraction(t: Array) -> Array:
        k = np.clip(np.searchsorted(table[:, 0], t, side="right") - 1, 0, len(table) - 1)
        first, go, stay, back, far = table[k].T
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
