"""Synthetic subjects: how they differ, how they move smoothly, and how a pose rotates their bones.

Segment lengths are fractions of the standing height after R. Drillis and R. Contini, Body Segment
Parameters, New York University, technical report 1166.03, 1966 (as printed in D. A. Winter,
Biomechanics and Motor Control of Human Movement): ankle 0.039 high, shank 0.246, thigh 0.245,
shoulder 0.818 high and 0.129 to the side, upper arm 0.186, forearm 0.146, hand 0.108, chin 0.870
high, foot 0.152 long. They give no joint centres inside trunk and foot; ours are: hip joints half
way from the middle to the side of the hips (0.191 wide), root 0.04 above them, spine in three equal
parts to 0.83, base of the head at 0.885, ankle a quarter of the foot from the heel, toe node 0.012
above the sole.

Masses and the centres of segments are those of D. A. Winter, Biomechanics and Motor Control of
Human Movement, table 4.1; trunk and head, which bend here, are split between their ends.
"""

from __future__ import annotations

import operator
import tomllib
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, reduce
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.motion.quaternions import quaternion_rotate
from rtradar.motion.skeleton import NODE_PARENT, NODES

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

SIDES: Mapping[str, float] = {"l": 1.0, "r": -1.0}
"""Sign of y on each side."""

OTHER: Mapping[str, str] = {"l": "r", "r": "l"}

LEFT = np.array([0.0, 1.0, 0.0])
UP = np.array([0.0, 0.0, 1.0])

ANKLE, SHANK, THIGH, SHOULDER = 0.039, 0.246, 0.245, 0.818
HIP, ROOT = ANKLE + SHANK + THIGH, ANKLE + SHANK + THIGH + 0.04
NECK_BASE, HEAD_BASE, TOE_HEIGHT = 0.83, 0.885, 0.012
HIP_Y, SHOULDER_Y = 0.191 / 4, 0.129
UPPER_ARM, FOREARM, HAND, FOOT = 0.186, 0.146, 0.108, 0.152
HEEL_X, TOE_X = -FOOT / 4, FOOT * 3 / 4
"""Heel and toe ahead of the ankle."""

MAXIMUM_REACH = 0.9985
"""Largest extension of a leg relative to its length: at 1 the knee would rotate infinitely fast."""


@cache
def _tables() -> dict[str, dict[str, Any]]:
    return tomllib.loads(Path(__file__).with_name("traits.toml").read_text(encoding="utf-8"))


def table_of(name: str) -> dict[str, Any]:
    """One table of ``traits.toml``, with what it takes from the table that it is like."""
    own = dict(_tables()[name])
    return (table_of(own.pop("like")) if "like" in own else {}) | own


STYLES: Mapping[str, tuple[str, ...]] = {
    "walk": ("normal", "antalgic", "stiff_legged", "lurch", "steppage", "trendelenburg"),
    "kick": ("front", "side", "roundhouse", "spin", "ball"),
    "wave": ("one_hand", "two_hands"),
    "fall": ("backward", "forward"),
    "punch": ("jab", "cross", "hook", "uppercut", "lunge"),
    "boxing": ("outfighter", "infighter", "steady"),
    "jump": ("high", "hop"),
    "sit": ("still",),
    "lie": ("floor", "bed"),
}
"""Ways to do an activity, by its name; without a style a subject has a way of its own."""


@dataclass(frozen=True, kw_only=True)
class Subject:
    """A person's size and way of moving, relative to the nominal actor.

    The leg or hand of the ``side``, "l" or "r", acts or steps first. ``phase`` is the fraction of a
    step, or of the first rest, at which the movement begins; ``uneven`` is the strength by side.
    ``style`` is one of the activity's own, or empty. ``manner`` is the seed of all else in which
    people differ; `traits` gives it by name.
    """

    height_m: float
    side: str
    tempo: float
    amplitude: float
    phase: float
    uneven: Mapping[str, float]
    style: str = ""
    manner: int = 0

    def drawn(self, trait: str, low: float, high: float) -> float:
        """Draw a trait of this subject, uniform from ``low`` to ``high``, the same at any call."""
        rng = np.random.default_rng([self.manner, zlib.crc32(trait.encode())])
        return float(rng.uniform(low, high))

    def traits(self, table: str) -> SimpleNamespace:
        """All traits of a table of ``traits.toml``, drawn where they are ranges."""
        own = SimpleNamespace()
        for name, value in table_of(table).items():
            ranged = isinstance(value, list) and len(value) == 2
            setattr(own, name.replace(" ", "_"), self.drawn(name, *value) if ranged else value)
        return own

    @property
    def other(self) -> str:
        """The side that does not act."""
        return OTHER[self.side]


class Arm(NamedTuple):
    """World rotations of one arm's bones; at rest it hangs."""

    upper: Rotation
    fore: Rotation
    hand: Rotation


@dataclass(frozen=True, kw_only=True)
class Pose:
    """Pose of the figure at n times, facing +x.

    ``root (n, 3)`` is its position [m]; pelvis, thorax and head are orientations in world axes, n
    each. For each side ``ankles`` are the positions (n, 3) that the knees must allow [m], ``feet``
    the orientations and ``arms`` the rotations of the bones. The knees bend about ``left``,
    roughly, where each side may have its own; ``shrug`` raises both shoulders [rad].
    """

    root: Array
    pelvis: Rotation
    thorax: Rotation
    head: Rotation
    ankles: Mapping[str, Array]
    feet: Mapping[str, Rotation]
    arms: Mapping[str, Arm]
    left: Array | Mapping[str, Array] = field(default_factory=lambda: LEFT)
    shrug: Array | float = 0.0


PosesAt = Callable[[Array], Pose]
"""A pose at any times (n,) [s], the same whatever others are asked for with it."""


def xyz(x: Array | float, y: Array | float, z: Array | float) -> Array:
    """Vectors (n, 3) from their components."""
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1)


def about(**angles: Array | float) -> Rotation:
    """Product of rotations about axes by angles [rad], the last applied first.

    Angles (n,) give n rotations.
    """
    from scipy.spatial.transform import Rotation  # slow to import

    rotations = (Rotation.from_euler(axis, np.asarray(a)[..., None]) for axis, a in angles.items())
    return reduce(operator.mul, rotations)


def offsets(height_m: float) -> dict[str, Array]:
    """Bone vectors of the standing figure [m], by node."""
    spine = (NECK_BASE - ROOT) / 3
    up = {"root": 0.0, "lowerback": spine, "upperback": spine, "thorax": spine}
    up |= {"neck": HEAD_BASE - NECK_BASE, "head": 1 - HEAD_BASE}
    down = {"knee": THIGH, "ankle": SHANK, "elbow": UPPER_ARM, "wrist": FOREARM, "hand": HAND}
    bones = {node: (0.0, 0.0, length) for node, length in up.items()}
    for side, sign in SIDES.items():
        bones |= {f"{side}_{node}": (0.0, 0.0, -length) for node, length in down.items()}
        bones[f"{side}_hip"] = 0.0, sign * HIP_Y, HIP - ROOT
        bones[f"{side}_toe"] = TOE_X, 0.0, TOE_HEIGHT - ANKLE
        bones[f"{side}_shoulder"] = 0.0, sign * SHOULDER_Y, SHOULDER - NECK_BASE
    return {node: height_m * np.array(bones[node]) for node in NODES}


def bend(
    reach: Array, first: float, second: float, hinge: Array, forward: float
) -> tuple[Rotation, Rotation]:
    """Solve two-link inverse kinematics: rotations of two bones, hanging at rest, to a target.

    ``reach (n, 3)`` goes from the upper joint to the target of the lower end [m], and is shortened
    where it is longer than the bones of lengths ``first`` and ``second`` [m]. ``hinge (n, 3)`` is
    the axis of the middle joint, to the left, and is made perpendicular to ``reach``. With
    ``forward`` = 1 the middle joint goes forward, as a knee does, with -1 backward, as an elbow.
    """
    # Direction and length of the target, not beyond what both bones reach.
    distance = np.linalg.norm(reach, axis=1, keepdims=True)
    along = reach / distance
    distance = np.minimum(distance, MAXIMUM_REACH * (first + second))
    # The plane of both bones is across the hinge, of which the part along the reach counts for
    # nothing.
    axis = hinge - np.sum(hinge * along, axis=1, keepdims=True) * along
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    ahead = forward * np.cross(axis, -along)
    # The law of cosines gives the angle of the first bone to the reach; the second closes the
    # triangle.
    cosine = np.clip((distance**2 + first**2 - second**2) / (2 * distance * first), -1.0, 1.0)
    upper = cosine * along + np.sqrt(1 - cosine**2) * ahead
    lower = (distance * along - first * upper) / second
    return _hanging(upper, axis), _hanging(lower, axis)


def _hanging(direction: Array, hinge: Array) -> Rotation:
    """Rotation of a bone that at rest hangs down with its hinge to the left."""
    from scipy.spatial.transform import Rotation  # slow to import

    return Rotation.from_matrix(np.stack([np.cross(hinge, -direction), hinge, -direction], axis=2))


def swing_arm(
    thorax: Rotation,
    side: str,
    forward: Array | float,
    outward: Array | float,
    elbow: Array,
    wrist: float = 0.1,
) -> Arm:
    """An arm by its angles [rad]: raised forward, outward, and bent at elbow and wrist."""
    upper = thorax * about(x=SIDES[side] * outward, y=-forward)
    fore = upper * about(y=-elbow)
    return Arm(upper, fore, fore * about(y=-wrist))


def reach_arm(
    thorax: Rotation, side: str, reach: Array, height_m: float, elbow_out: Array | float
) -> Arm:
    """An arm with its wrist at ``reach`` (n, 3) from the shoulder, world; elbow out by [rad]."""
    hinge = thorax.apply(xyz(0.0, np.cos(elbow_out), SIDES[side] * np.sin(elbow_out)))
    upper, fore = bend(reach, UPPER_ARM * height_m, FOREARM * height_m, hinge, -1.0)
    return Arm(upper, fore, fore)


def rolled(
    pitch: Array, height_m: float, ahead: float = TOE_X, below: float = ANKLE - TOE_HEIGHT
) -> Array:
    """Displacement of the ankle (n, 3) [m] where a foot along +x rotates by a pitch [rad].

    It rotates about a point ahead of the ankle and below it, by default the toe, which stays.
    """
    sine, rest = np.sin(pitch), 1 - np.cos(pitch)
    return height_m * xyz(ahead * rest + below * sine, 0.0, ahead * sine - below * rest)


def lowering(pose: Pose, height_m: float) -> float:
    """Distance by which the root must come down for both legs to reach their ankles always [m]."""
    bones = offsets(height_m)
    leg = (THIGH + SHANK) * height_m * MAXIMUM_REACH
    worst = 0.0
    # With a leg stretched over this level distance, the hip is so high over the ankle at most.
    for side in SIDES:
        gap = pose.root + pose.pelvis.apply(bones[f"{side}_hip"]) - pose.ankles[side]
        level = np.sqrt(np.maximum(leg**2 - gap[:, 0] ** 2 - gap[:, 1] ** 2, 0.0))
        worst = max(worst, float(np.max(gap[:, 2] - level)))
    return worst


def rotations(pose: Pose, height_m: float) -> Array:
    """Rotations (n, node, 4) of all bones of a pose."""
    from scipy.spatial.transform import Rotation  # slow to import

    bones = offsets(height_m)
    # The bend of the trunk is split evenly over the spine, and the nod over neck and head.
    bent = (pose.pelvis.inv() * pose.thorax).as_rotvec()
    nod = (pose.thorax.inv() * pose.head).as_rotvec()
    found: dict[str, Rotation] = {
        "root": pose.pelvis,
        "lowerback": pose.pelvis * Rotation.from_rotvec(bent / 3),
        "upperback": pose.pelvis * Rotation.from_rotvec(bent * 2 / 3),
        "thorax": pose.thorax,
        "neck": pose.thorax * Rotation.from_rotvec(nod / 2),
        "head": pose.head,
    }
    # Legs follow by inverse kinematics from hips and ankles, arms are given.
    for side, sign in SIDES.items():
        leg = pose.ankles[side] - pose.root - pose.pelvis.apply(bones[f"{side}_hip"])
        hinge = pose.left[side] if isinstance(pose.left, Mapping) else pose.left
        thigh, shank = bend(leg, THIGH * height_m, SHANK * height_m, hinge, 1.0)
        found |= {
            f"{side}_hip": pose.pelvis,
            f"{side}_knee": thigh,
            f"{side}_ankle": shank,
            f"{side}_toe": pose.feet[side],
            f"{side}_shoulder": pose.thorax * about(x=sign * pose.shrug),
            f"{side}_elbow": pose.arms[side].upper,
            f"{side}_wrist": pose.arms[side].fore,
            f"{side}_hand": pose.arms[side].hand,
        }
    shape = len(pose.root), 4
    return np.stack([np.broadcast_to(found[node].as_quat(), shape) for node in NODES], axis=1)


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
    # The trunk is one segment from root to thorax, and the head one from the thorax on.
    starts = {**NODE_PARENT, "thorax": "root", "head": "thorax"}
    centre = sum(
        mass * (at[starts[node]] + part * (at[node] - at[starts[node]]))
        for node, (mass, part) in _MASSES.items()
    )
    return np.asarray(centre) / sum(mass for mass, _ in _MASSES.values())


# -- smooth functions of time (C2) -----------------------------------------------------------------


def smooth(u: Array) -> Array:
    """Minimum-jerk step from 0 (u <= 0) to 1 (u >= 1), at rest at both ends (Flash, Hogan 1985)."""
    u = np.clip(u, 0.0, 1.0)
    return u**3 * (10 - 15 * u + 6 * u**2)


def bump(u: Array) -> Array:
    """Curve from 0 (u <= 0) over 1 (u = 1/2) to 0 (u >= 1), with derivatives of 0 at the ends."""
    u = np.clip(u, 0.0, 1.0)
    return 64 * (u * (1 - u)) ** 3


def keyed(t: Array, times: ArrayLike, values: ArrayLike) -> Array:
    """Minimum-jerk moves (time, ...) between values (key, ...), at rest at each key and outside."""
    at, keys = np.asarray(times, dtype=np.float64), np.asarray(values, dtype=np.float64)
    moves = np.diff(keys, axis=0)
    # The value where each move begins, and the fraction of the move that is under way.
    reached = np.cumsum(np.concatenate([keys[:1], moves[:-1]]), axis=0)
    under_way = np.clip(np.searchsorted(at, t, side="right") - 1, 0, len(moves) - 1)
    fraction = smooth((t - at[under_way]) / np.diff(at)[under_way])
    fraction = fraction.reshape(-1, *(1,) * (keys.ndim - 1))
    return np.asarray(reached[under_way] + moves[under_way] * fraction)


def hermite(
    t: Array, interval: tuple[float, float], begin: Sequence[ArrayLike], end: Sequence[ArrayLike]
) -> Array:
    """Quintic with given positions, velocities and accelerations at both ends of an interval.

    Each of them is a scalar or (3,).
    """
    span = interval[1] - interval[0]
    p0, v0, a0 = (np.asarray(value, dtype=np.float64) for value in begin)
    p1, v1, a1 = (np.asarray(value, dtype=np.float64) for value in end)
    u = ((t - interval[0]) / span).reshape(-1, *(1,) * p0.ndim)
    # What the beginning alone, moving on with constant acceleration, would miss at the end in
    # position, velocity and acceleration; three higher powers make it up.
    p, v = p1 - p0 - (v0 + a0 * span / 2) * span, (v1 - v0 - a0 * span) * span
    a = (a1 - a0) * span**2
    cubic, quartic, quintic = 10 * p - 4 * v + a / 2, -15 * p + 7 * v - a, 6 * p - 3 * v + a / 2
    free = p0 + v0 * span * u + a0 * span**2 / 2 * u**2
    return free + u**3 * (cubic + u * (quartic + u * quintic))


def state(function: Callable[[Array], Array], t: float) -> tuple[Array, Array, Array]:
    """Value, velocity and acceleration of ``function(times)`` at a time, by differences."""
    # Truncation, h^2/12 of the fourth derivative, and rounding, 1e-16/h^2, stay below 1e-5 m/s^2.
    h = 1e-4
    before, here, after = function(np.array([t - h, t, t + h]))
    return here, (after - before) / (2 * h), (after - 2 * here + before) / h**2
