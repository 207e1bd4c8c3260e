"""Bodies that move on the spot: repetitions, and a centre of mass that stays over the feet.

Masses and the centres of segments are those of D. A. Winter, Biomechanics and Motor Control of
Human Movement, table 4.1; trunk and head, which bend here, are split between their ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
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
    Subject,
    about,
    offsets,
    rotations,
    smooth,
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


def standing(
    subject: Subject, pose: Callable[[Array], Pose], forward: Array, ahead: float = AHEAD
) -> Array:
    """Ways of the hips forward (n,) [m] with which the centre of mass is ``ahead`` of the ankles.

    ``pose`` gives the pose of such ways; ``forward`` is the first guess.
    """
    for _ in range(4):
        centre = centre_of_mass(pose(forward), subject.height_m)[:, 0]
        forward = forward - 1.1 * (centre - ahead * subject.height_m)
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


def restless(subject: Subject, t: Array, pose: Pose) -> Pose:
    """The same pose with hips and shoulders that turn a little, and sway to the sides."""
    turn, aside = (
        np.sin(2 * np.pi * (subject.drawn(f"{name} rate", *rates) * t + subject.drawn(name, 0, 1)))
        for name, rates in (("restless", (0.3, 0.7)), ("swaying", (0.2, 0.5)))
    )
    turn = math.radians(subject.drawn("turns", 0.7, 3.5)) * turn
    sway_m = subject.drawn("sways", 0.001, 0.006) * subject.height_m * aside
    return replace(
        pose,
        root=pose.root + xyz(0.0, sway_m, 0.0),
        pelvis=about(z=turn) * pose.pelvis,
        thorax=about(z=-0.6 * turn) * pose.thorax,
    )


Repetitions = Callable[[Array], Array]
"""How far a movement is (n,), from 0 to about 1, at times (n,) [s]."""


def repetitions(
    subject: Subject,
    until_s: float,
    spans_s: Mapping[str, tuple[float, float]],
    *,
    sudden: float = 1.0,
    extent: float = 0.06,
) -> Repetitions:
    """Plan a movement that goes there, stays, comes back and rests, again and again.

    ``spans_s`` are the ranges of the durations "go", "stay", "back" and "rest" at tempo 1, from
    which a subject is drawn; each repetition differs by some percent in time, and by ``extent`` in
    how far it goes. With ``sudden`` above 1 the way there begins slowly and ends fast.
    """
    usual = np.array([subject.drawn(name, *span) for name, span in spans_s.items()]) / subject.tempo
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
