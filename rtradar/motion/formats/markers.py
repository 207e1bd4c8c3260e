"""Conversion of markers on the skin to the 22 nodes of the body.

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
bars stand centimetres off the bone, and a solver's shoulder lies lower than the marker on it:
without the offsets hips are 18 cm off.

References
----------
Carnegie Mellon University Motion Capture Database, marker placement guide (mocap.cs.cmu.edu). M.
Mueller, T. Roeder, M. Clausen, B. Eberhardt, B. Krueger, A. Weber, Documentation Mocap Database
HDM05, technical report CG-2007-2, Universitaet Bonn, 2007.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.motion.skeleton_names import NODES

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Centre:
    """Position of a joint's centre relative to its markers.

    Parameters
    ----------
    markers : tuple of str
        Their mean is where the offset begins; ``@`` stands for the side, L or R.
    segment : str
        Name of the segment in whose axes the offset is given.
    offset_m : tuple of float
        Offset forward, to the left (on the right side: to the right), and up [m].
    """

    markers: tuple[str, ...]
    segment: str
    offset_m: tuple[float, float, float]


SHANK_M = 0.436
"""Distance of knee and ankle markers of the person whom the offsets belong to."""

_WAIST = ("LFWT", "RBWT", "RFWT", "LBWT")
_HEAD = ("LFHD", "RBHD", "RFHD", "LBHD")
_NECK = ("C7", "CLAV")

CENTRES: Mapping[str, Centre] = {
    "root": Centre(_WAIST, "pelvis", (0.0, 0.0, -0.049)),
    "lowerback": Centre(_WAIST, "pelvis", (0.017, 0.0, 0.068)),
    "upperback": Centre(("T10", "STRN"), "thorax", (-0.005, 0.0, -0.037)),
    "thorax": Centre(_NECK, "thorax", (0.011, 0.0, -0.187)),
    "neck": Centre(_NECK, "thorax", (0.013, 0.0, -0.080)),
    "head": Centre(_HEAD, "head", (-0.035, 0.0, -0.044)),
    "hip": Centre(_WAIST, "pelvis", (0.050, 0.102, -0.140)),
    "knee": Centre(("@KNE",), "shank", (0.019, -0.060, -0.007)),
    "ankle": Centre(("@ANK",), "shank", (0.010, -0.047, 0.001)),
    "toe": Centre(("@TOE",), "shank", (0.0, 0.0, 0.0)),
    "shoulder": Centre(_NECK, "thorax", (0.014, 0.182, -0.102)),
    "elbow": Centre(("@ELB",), "upper arm", (0.033, -0.066, -0.029)),
    "wrist": Centre(("@WRA", "@WRB"), "forearm", (-0.016, -0.062, 0.004)),
    "hand": Centre(("@FIN",), "forearm", (-0.028, -0.039, -0.016)),
}
"""Centre of each node; those of the limbs serve both sides."""

_SIDED = ("SHO", "ELB", "WRA", "WRB", "FIN", "KNE", "ANK", "TOE")

NEEDED: tuple[str, ...] = (
    *_HEAD,
    *_NECK,
    "T10",
    "STRN",
    *_WAIST,
    *(side + name for side in "LR" for name in _SIDED),
)
"""The markers that must be there."""

_STRAIGHT = 0.15
"""Angle [rad] below which the plane of an arm's bend comes more and more from the shoulder.

A straight arm has no such plane of its own."""


def joint_centres(markers: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    """Find the 22 nodes, and the orientations of pelvis and chest.

    Parameters
    ----------
    markers : mapping of str to (frame, 3) float64
        Positions of all markers of `NEEDED`, world [m].

    Returns
    -------
    centres : (frame, node, 3) float64
        Positions of the nodes, world [m].
    pelvis, thorax : (frame, 3, 3) float64
        Rotations; the columns point forward, left and up.
    """
    frames = _segments(markers)
    shanks = [
        np.linalg.norm(markers[f"{side}KNE"] - markers[f"{side}ANK"], axis=1) for side in "LR"
    ]
    size = float(np.median(shanks)) / SHANK_M
    centres = []
    for node in NODES:
        side, name = node[0].upper(), node[2:]
        centre = CENTRES[node] if node in CENTRES else CENTRES[name]
        forward, left, up = centre.offset_m
        frame = frames.get(centre.segment, frames.get(f"{side} {centre.segment}"))
        assert frame is not None  # every segment of the table is made
        offset = size * np.array([forward, -left if node.startswith("r_") else left, up])
        centres.append(
            _middle(markers, *(marker.replace("@", side) for marker in centre.markers))
            + frame @ offset
        )
    return np.stack(centres, axis=1), frames["pelvis"], frames["thorax"]


def _segments(markers: Mapping[str, Array]) -> dict[str, Array]:
    """Axes (frame, 3, 3) of the segments: columns forward, left, up."""

    def middle(*names: str) -> Array:
        return _middle(markers, *names)

    thorax = _axes(
        up=middle("C7", "CLAV") - middle("T10", "STRN"),
        forward=middle("CLAV", "STRN") - middle("C7", "T10"),
    )
    frames = {
        "thorax": thorax,
        "pelvis": _level(
            middle("LFWT", "LBWT") - middle("RFWT", "RBWT"),
            middle("LFWT", "RFWT") - middle("LBWT", "RBWT"),
        ),
        "head": _level(
            middle("LFHD", "LBHD") - middle("RFHD", "RBHD"),
            middle("LFHD", "RFHD") - middle("LBHD", "RBHD"),
        ),
    }
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
    arm, fore = _unit(elbow - shoulder), _unit(wrist - elbow)
    bent = fore - np.sum(fore * arm, axis=1, keepdims=True) * arm
    # An arm that hangs down, out and forward bends forward and up; the shortest turn takes it to
    # where this arm points.
    rest, ahead = _unit(np.array([0.5, 0.5 * sign, -0.7])), _unit(np.array([0.7, 0.0, 0.5]))
    local = np.einsum("tji,tj->ti", thorax, arm)
    turn = rest + local
    # Two mirrorings, along rest and along rest + local, are that turn. Opposite to rest there is
    # none, and any will do.
    mirrored = ahead - 2 * np.dot(ahead, rest) * rest
    along = np.sum(turn * turn, axis=1, keepdims=True)
    held = mirrored - 2 * turn * (turn @ mirrored)[:, None] / np.maximum(along, 1e-9)
    lacking = np.maximum(_STRAIGHT - np.linalg.norm(bent, axis=1, keepdims=True), 0.0)
    return np.asarray(bent + lacking * np.einsum("tij,tj->ti", thorax, held))


def _middle(markers: Mapping[str, Array], *names: str) -> Array:
    return np.asarray(np.mean([markers[name] for name in names], axis=0))


def _unit(vectors: Array) -> Array:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def _axes(*, up: Array, forward: Array) -> Array:
    """Axes with this up, and forward as near to ``forward`` as that allows."""
    z = _unit(up)
    y = _unit(np.cross(z, forward))
    return np.stack([np.cross(y, z), y, z], axis=2)


def _level(left: Array, forward: Array) -> Array:
    """Axes with this left, and forward as near to ``forward`` as that allows."""
    y = _unit(left)
    z = _unit(np.cross(forward, y))
    return np.stack([np.cross(y, z), y, z], axis=2)
