"""The synthetic actor's skeleton, and how a pose turns its bones.

Segment lengths are fractions of the standing height after R. Drillis and R. Contini, Body Segment
Parameters, New York University, technical report 1166.03, 1966 (as printed in D. A. Winter,
Biomechanics and Motor Control of Human Movement): ankle 0.039 high, shank 0.246, thigh 0.245,
shoulder 0.818 high and 0.129 to the side, upper arm 0.186, forearm 0.146, hand 0.108, chin 0.870
high, foot 0.152 long. They give no joint centres inside trunk and foot; ours are: hip joints half
way from the middle to the side of the hips (0.191 wide), root 0.04 above them, spine in three equal
parts to 0.83, base of the head at 0.885, ankle a quarter of the foot from the heel, toe node 0.012
above the sole.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.motion.skeleton_names import NODES

Array = NDArray[np.float64]

SIDES: Mapping[str, float] = {"l": 1.0, "r": -1.0}
"""Sign of y on each side."""

ANKLE, SHANK, THIGH, SHOULDER = 0.039, 0.246, 0.245, 0.818
HIP, ROOT = ANKLE + SHANK + THIGH, ANKLE + SHANK + THIGH + 0.04
NECK_BASE, HEAD_BASE, TOE_HEIGHT = 0.83, 0.885, 0.012
HIP_Y, SHOULDER_Y = 0.191 / 4, 0.129
UPPER_ARM, FOREARM, HAND, FOOT = 0.186, 0.146, 0.108, 0.152
HEEL_X, TOE_X = -FOOT / 4, FOOT * 3 / 4
"""Heel and toe ahead of the ankle."""

MAXIMUM_REACH = 0.9985
"""Largest extension of a leg relative to its length: at 1 the knee would turn infinitely fast."""


@dataclass(frozen=True)
class Arm:
    """World rotations of one arm's bones; at rest it hangs."""

    upper: Rotation
    fore: Rotation
    hand: Rotation


@dataclass(frozen=True, kw_only=True)
class Pose:
    """Pose of the figure at n times, facing +x.

    Parameters
    ----------
    root : (n, 3) float64
        Position of the root [m].
    pelvis, thorax, head : Rotation
        Orientations in world axes, n each.
    ankles : mapping of side to (n, 3) float64
        Target positions of the ankles [m]; the knees follow.
    feet : mapping of side to Rotation
        Orientations of the feet in world axes.
    left : (n, 3) float64
        Axis about which the knees bend, roughly; to the left.
    arms : mapping of side to Arm
        Rotations of the bones of the arms.
    shrug : (n,) float64
        Angle by which both shoulders are raised [rad].
    """

    root: Array
    pelvis: Rotation
    thorax: Rotation
    head: Rotation
    ankles: Mapping[str, Array]
    feet: Mapping[str, Rotation]
    left: Array
    arms: Mapping[str, Arm]
    shrug: Array


PosesAt = Callable[[Array], Pose]
"""A pose at any times (n,) [s], the same whatever others are asked for with it."""


def turn(axis: str, angle: Array | float) -> Rotation:
    """Rotation about one axis [rad]; angles (n,) give n rotations."""
    return Rotation.from_euler(axis, np.asarray(angle)[..., None])


def offsets(height_m: float) -> dict[str, Array]:
    """Bone vectors of the standing figure [m], by node."""
    spine = (NECK_BASE - ROOT) / 3
    bones: dict[str, tuple[float, float, float]] = {
        "root": (0.0, 0.0, 0.0),
        "lowerback": (0.0, 0.0, spine),
        "upperback": (0.0, 0.0, spine),
        "thorax": (0.0, 0.0, spine),
        "neck": (0.0, 0.0, HEAD_BASE - NECK_BASE),
        "head": (0.0, 0.0, 1 - HEAD_BASE),
    }
    for side, sign in SIDES.items():
        bones |= {
            f"{side}_hip": (0.0, sign * HIP_Y, HIP - ROOT),
            f"{side}_knee": (0.0, 0.0, -THIGH),
            f"{side}_ankle": (0.0, 0.0, -SHANK),
            f"{side}_toe": (TOE_X, 0.0, TOE_HEIGHT - ANKLE),
            f"{side}_shoulder": (0.0, sign * SHOULDER_Y, SHOULDER - NECK_BASE),
            f"{side}_elbow": (0.0, 0.0, -UPPER_ARM),
            f"{side}_wrist": (0.0, 0.0, -FOREARM),
            f"{side}_hand": (0.0, 0.0, -HAND),
        }
    return {node: height_m * np.array(bones[node]) for node in NODES}


def bend(
    reach: Array, first: float, second: float, hinge: Array, forward: float
) -> tuple[Rotation, Rotation]:
    """Solve two-link inverse kinematics: rotations of two bones that reach a point.

    At rest both bones hang down.

    Parameters
    ----------
    reach : (n, 3) float64
        Vector from the upper joint to the target of the lower end; shortened where it is too long
        [m].
    first, second : float
        Lengths of the two bones [m].
    hinge : (n, 3) float64
        Axis of the middle joint, to the left; made perpendicular to ``reach``.
    forward : float
        +1: the middle joint goes forward (knee); -1: backward (elbow).
    """
    distance = np.linalg.norm(reach, axis=1, keepdims=True)
    along = reach / distance
    distance = np.minimum(distance, MAXIMUM_REACH * (first + second))
    axis = hinge - np.sum(hinge * along, axis=1, keepdims=True) * along
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    ahead = forward * np.cross(axis, -along)
    cosine = np.clip((distance**2 + first**2 - second**2) / (2 * distance * first), -1.0, 1.0)
    upper = cosine * along + np.sqrt(1 - cosine**2) * ahead
    lower = (distance * along - first * upper) / second
    return _hanging(upper, axis), _hanging(lower, axis)


def _hanging(direction: Array, hinge: Array) -> Rotation:
    """Rotation of a bone that at rest hangs down with its hinge to the left."""
    return Rotation.from_matrix(np.stack([np.cross(hinge, -direction), hinge, -direction], axis=2))


def swing_arm(
    thorax: Rotation, side: str, *, forward: Array, outward: Array, elbow: Array, wrist: float = 0.1
) -> Arm:
    """An arm by its angles [rad]: raised forward, outward, and bent at elbow and wrist."""
    upper = thorax * turn("x", SIDES[side] * outward) * turn("y", -forward)
    fore = upper * turn("y", -elbow)
    return Arm(upper, fore, fore * turn("y", -wrist))


def reach_arm(thorax: Rotation, side: str, reach: Array, height_m: float, elbow_out: float) -> Arm:
    """An arm with its wrist at ``reach`` (n, 3) from the shoulder, world; elbow out by [rad]."""
    hinge = thorax.apply([0.0, np.cos(elbow_out), SIDES[side] * np.sin(elbow_out)])
    upper, fore = bend(reach, UPPER_ARM * height_m, FOREARM * height_m, hinge, -1.0)
    return Arm(upper, fore, fore)


def roll_about_toe(pitch: Array, height_m: float) -> Array:
    """Displacement of the ankle (n, 3) [m] where a foot along +x lifts its heel by a pitch [rad].

    The toe stays where it is.
    """
    return height_m * np.stack(
        [
            TOE_X * (1 - np.cos(pitch)) + (ANKLE - TOE_HEIGHT) * np.sin(pitch),
            np.zeros_like(pitch),
            TOE_X * np.sin(pitch) - (ANKLE - TOE_HEIGHT) * (1 - np.cos(pitch)),
        ],
        axis=1,
    )


def lowering(pose: Pose, height_m: float) -> float:
    """Distance by which the root must come down for both legs to reach their ankles always [m]."""
    bones = offsets(height_m)
    leg = (THIGH + SHANK) * height_m * MAXIMUM_REACH
    worst = 0.0
    for side in SIDES:
        gap = pose.root + pose.pelvis.apply(bones[f"{side}_hip"]) - pose.ankles[side]
        level = np.sqrt(np.maximum(leg**2 - gap[:, 0] ** 2 - gap[:, 1] ** 2, 0.0))
        worst = max(worst, float(np.max(gap[:, 2] - level)))
    return worst


def rotations(pose: Pose, height_m: float) -> Array:
    """Rotations (n, node, 4) of all bones of a pose."""
    bones = offsets(height_m)
    bent = pose.pelvis.inv() * pose.thorax
    turned: dict[str, Rotation] = {"root": pose.pelvis, "thorax": pose.thorax, "head": pose.head}
    for node, fraction in (("lowerback", 1 / 3), ("upperback", 2 / 3)):
        turned[node] = pose.pelvis * Rotation.from_rotvec(fraction * bent.as_rotvec())
    turned["neck"] = pose.thorax * Rotation.from_rotvec(
        0.5 * (pose.thorax.inv() * pose.head).as_rotvec()
    )
    for side, sign in SIDES.items():
        hip = pose.root + pose.pelvis.apply(bones[f"{side}_hip"])
        thigh, shank = bend(
            pose.ankles[side] - hip, THIGH * height_m, SHANK * height_m, pose.left, 1.0
        )
        arm = pose.arms[side]
        turned |= {
            f"{side}_hip": pose.pelvis,
            f"{side}_knee": thigh,
            f"{side}_ankle": shank,
            f"{side}_toe": pose.feet[side],
            f"{side}_shoulder": pose.thorax * turn("x", sign * pose.shrug),
            f"{side}_elbow": arm.upper,
            f"{side}_wrist": arm.fore,
            f"{side}_hand": arm.hand,
        }
    return np.stack([turned[node].as_quat() for node in NODES], axis=1)
