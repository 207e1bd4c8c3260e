"""Conversion of markers on the skin to the 22 nodes of the body, and of these to a rigid skeleton.

The marker set is the one of 41 markers that CMU and HDM05 recordings carry, in Vicon's names: four
on the head (LFHD, RFHD, LBHD, RBHD), C7, T10, CLAV and STRN about the chest, four on the waist
(LFWT, RFWT, LBWT, RBWT), and on each side shoulder, elbow, a wrist bar with two ends (WRA on the
side of the thumb, WRB), knuckle (FIN), knee, ankle, toe. Only the 28 markers that are named here
are asked for.

A joint's centre is the middle of its markers - pairs before and behind, or on both sides of it -
or, where one marker alone marks it, that marker; from there an offset in the axes of its segment
leads inward. Offsets belong to a person whose knee and ankle markers are `SHANK_M` apart, and grow
with that distance. They are medians over the first half of the CMU take 135_02, which exists as AMC
too; ``validation/measurements/c3d_take.py`` judges by its second half. Markers on waist and wrist
bars are centimetres off the bone, and a solver's shoulder lies lower than the marker on it:
without the offsets hips are 18 cm off.

References
----------
Carnegie Mellon University Motion Capture Database, marker placement guide (mocap.cs.cmu.edu). M.
Mueller, T. Roeder, M. Clausen, B. Eberhardt, B. Krueger, A. Weber, Documentation Mocap Database
HDM05, technical report CG-2007-2, Universitaet Bonn, 2007.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError
from rtradar.motion.motion import Motion
from rtradar.motion.quaternions import (
    quaternion_multiply,
    quaternion_rotate,
    sign_continuous,
    smallest_rotation,
)
from rtradar.motion.skeleton import MINIMUM_PART_M, NODE_PARENT, NODES

Array = NDArray[np.float64]


class Centre(NamedTuple):
    """Position of a joint's centre relative to the mean of its markers.

    ``markers.toml`` explains the fields.
    """

    markers: tuple[str, ...]
    segment: str
    offset_m: tuple[float, float, float]


_TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))

SHANK_M: float = _TABLE["shank_m"]
"""Distance of knee and ankle markers of the person whom the offsets belong to."""

NEEDED: tuple[str, ...] = tuple(_TABLE["needed"])
"""The markers that must be there."""

CENTRES = {
    node: Centre(tuple(markers.split()), *place)
    for node, (markers, *place) in _TABLE["centres"].items()
}
"""Centre of each node; those of the limbs serve both sides."""

_STRAIGHT = 0.15
"""Angle [rad] below which the plane of an arm's bend comes more and more from the shoulder.

A straight arm has no such plane of its own."""


def joint_centres(markers: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    """Find the 22 nodes, and the orientations of pelvis and chest.

    ``markers`` are the positions (frame, 3) of all of `NEEDED`, in any axes and unit, as are the
    nodes (frame, node, 3); the rotations of pelvis and thorax (frame, 3, 3) have columns forward,
    left and up.
    """
    frames = _segments(markers)
    shanks = [
        np.linalg.norm(markers[f"{side}KNE"] - markers[f"{side}ANK"], axis=1) for side in "LR"
    ]
    size = float(np.median(shanks)) / SHANK_M
    centres = []
    for node in NODES:
        side = node[0].upper()
        centre = CENTRES[node if node in CENTRES else node[2:]]
        forward, left, up = centre.offset_m
        frame = frames.get(centre.segment, frames.get(f"{side} {centre.segment}"))
        assert frame is not None  # every segment of the table is made
        offset = size * np.array([forward, -left if node.startswith("r_") else left, up])
        own = (marker.replace("@", side) for marker in centre.markers)
        centres.append(_middle(markers, *own) + frame @ offset)
    return np.stack(centres, axis=1), frames["pelvis"], frames["thorax"]


def _segments(markers: Mapping[str, Array]) -> dict[str, Array]:
    """Axes (frame, 3, 3) of the segments: columns forward, left, up."""

    def middle(*names: str) -> Array:
        return _middle(markers, *names)

    thorax = _axes(
        up=middle("C7", "CLAV") - middle("T10", "STRN"),
        forward=middle("CLAV", "STRN") - middle("C7", "T10"),
    )
    frames = {"thorax": thorax}
    for name, end in (("pelvis", "WT"), ("head", "HD")):
        frames[name] = level_axes(
            middle(f"LF{end}", f"LB{end}") - middle(f"RF{end}", f"RB{end}"),
            middle(f"LF{end}", f"RF{end}") - middle(f"LB{end}", f"RB{end}"),
        )
    for side, sign in (("L", 1.0), ("R", -1.0)):
        shoulder, elbow, knee, ankle = (
            markers[side + name] for name in ("SHO", "ELB", "KNE", "ANK")
        )
        wrist = middle(f"{side}WRA", f"{side}WRB")
        frames[f"{side} shank"] = _axes(up=knee - ankle, forward=markers[f"{side}TOE"] - ankle)
        frames[f"{side} upper arm"] = _axes(
            up=shoulder - elbow, forward=_bend(shoulder, elbow, wrist, thorax, sign)
        )
        frames[f"{side} forearm"] = _axes(up=elbow - wrist, forward=markers[f"{side}WRA"] - wrist)
    return frames


def _bend(shoulder: Array, elbow: Array, wrist: Array, thorax: Array, sign: float) -> Array:
    """Direction (frame, 3) in which the forearm leaves the upper arm's line, or would leave it."""
    arm, fore = unit(elbow - shoulder), unit(wrist - elbow)
    bent = fore - np.sum(fore * arm, axis=1, keepdims=True) * arm
    # An arm that hangs down, out and forward bends forward and up; the smallest rotation takes it
    # to where this arm points.
    rest, ahead = unit(np.array([0.5, 0.5 * sign, -0.7])), unit(np.array([0.7, 0.0, 0.5]))
    local = np.einsum("tji,tj->ti", thorax, arm)
    half = rest + local
    # Two reflections, along rest and along rest + local, are that rotation. Opposite to rest there
    # is none, and any will do.
    reflected = ahead - 2 * np.dot(ahead, rest) * rest
    along = np.sum(half * half, axis=1, keepdims=True)
    held = reflected - 2 * half * (half @ reflected)[:, None] / np.maximum(along, 1e-9)
    lacking = np.maximum(_STRAIGHT - np.linalg.norm(bent, axis=1, keepdims=True), 0.0)
    return np.asarray(bent + lacking * np.einsum("tij,tj->ti", thorax, held))


def _middle(markers: Mapping[str, Array], *names: str) -> Array:
    return np.asarray(np.mean([markers[name] for name in names], axis=0))


def unit(vectors: Array) -> Array:
    """Unit vectors along some."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def _axes(*, up: Array, forward: Array) -> Array:
    """Axes with this up, and forward as near to ``forward`` as that allows."""
    z = unit(up)
    y = unit(np.cross(z, forward))
    return np.stack([np.cross(y, z), y, z], axis=2)


def level_axes(left: Array, forward: Array) -> Array:
    """Axes with this left, and forward as near to ``forward`` as that allows."""
    y = unit(left)
    z = unit(np.cross(forward, y))
    return np.stack([np.cross(y, z), y, z], axis=2)


_ON_THE_PELVIS = ("lowerback", "upperback", "hip", "knee", "ankle", "toe")
"""Nodes whose bones rotate with the pelvis where they do not bend, the others with the chest."""


def rigid_motion(name: str, centres: Array, pelvis: Array, thorax: Array, rate_hz: float) -> Motion:
    """Make the motion of a rigid skeleton whose bones point as the joints do.

    A bone is as long as its joints are apart in the median. Joints do not say how a bone is rotated
    about itself: seen from pelvis or chest it takes from frame to frame the smallest rotation to
    its next direction, so that nothing on it spins. Arguments are as `joint_centres` gives them, in
    the world [m].
    """
    parents = [NODES.index(NODE_PARENT[node]) for node in NODES[1:]]
    bones = centres[:, 1:] - centres[:, parents]
    spans = np.linalg.norm(bones, axis=2)
    for bone, frame in np.argwhere(~(spans.T > MINIMUM_PART_M / 2)):
        ends = f"{NODE_PARENT[NODES[1 + bone]]!r} and {NODES[1 + bone]!r}"
        raise InputError(
            f"{name}: {ends} are {spans[frame, bone] * 1e3:.3g} mm apart in frame {frame + 1}; "
            f"every body part needs at least {MINIMUM_PART_M * 1e3 / 2:g} mm, mend the markers "
            "about it"
        )
    held = {
        key: sign_continuous(Rotation.from_matrix(axes).as_quat())
        for key, axes in (("pelvis", pelvis), ("thorax", thorax))
    }
    below = [node.split("_")[-1] in _ON_THE_PELVIS for node in NODES[1:]]
    carriers = np.stack([held["pelvis" if low else "thorax"] for low in below], axis=1)
    directions = quaternion_rotate(carriers * [-1, -1, -1, 1], bones / spans[..., None])
    rotations = quaternion_multiply(carriers, _followed(directions))
    rotations /= np.linalg.norm(rotations, axis=2, keepdims=True)
    lengths = np.median(spans, axis=0)
    return Motion(
        name=name,
        joints=NODES,
        parents=(-1, *parents),
        offsets=np.concatenate([np.zeros((1, 3)), directions[0] * lengths[:, None]]),
        root_positions=centres[:, 0],
        rotations=np.concatenate([held["pelvis"][:, None], rotations], axis=1),
        rate_hz=rate_hz,
    )


def runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Begin and end, which is one past the last, of each run of True in a mask (frame,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask, [0]]))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def _followed(directions: Array) -> Array:
    """Rotations (frame, bone, 4) of directions (frame, bone, 3) from the first to each frame."""
    rotations = np.empty((*directions.shape[:2], 4))
    rotations[0] = [0.0, 0.0, 0.0, 1.0]
    for frame, step in enumerate(smallest_rotation(directions[:-1], directions[1:])):
        rotations[frame + 1] = quaternion_multiply(step, rotations[frame])
    return rotations / np.linalg.norm(rotations, axis=2, keepdims=True)
