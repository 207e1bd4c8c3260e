"""Recordings of joint positions, such as cameras with depth and body models give.

What is measured joint by joint is made the motion of a rigid skeleton: the 22 nodes are taken from
the joints (`rtradar.motion.skeleton`), gaps are bridged, joints of cameras pass a low-pass, all is
sampled evenly, heads and feet are completed, the floor is found, and the bones are given their
median lengths (`markers.rigid_motion`).

The low-pass is a smoothing spline, the least of ``sum (y - f)^2 + lam int f''^2``. For samples
``dt`` apart its response is ``1 / (1 + (f / f_c)^4)`` with ``lam = (2 pi f_c)^-4 / dt``, that of a
Butterworth filter of second order run forward and backward, but it takes gaps and uneven times.

References
----------
H. J. Woltring, A Fortran package for generalized, cross-validatory spline smoothing and
differentiation, Advances in Engineering Software 8, 1986. R. Drillis, R. Contini, Body segment
parameters, New York University, 1966.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, make_smoothing_spline

from rtradar.errors import InputError
from rtradar.motion.formats.joint_files import (
    LEAST_FRAMES,
    JointRecording,
    read_csv,
    read_npz,
)
from rtradar.motion.formats.skeletons import level_axes, rigid_motion, runs, unit
from rtradar.motion.motion import Motion
from rtradar.motion.reading import (
    settled_nodes,
    stature_of,
    warn_of_speed,
)
from rtradar.motion.skeleton import (
    HEAD_OF_THIGH,
    MINIMUM_PART_M,
    NODE_PARENTS,
    NODES,
    Convention,
    middle,
    node_positions,
    of_node,
    recognise,
)
from rtradar.recordings import Finding, rate_of, tall

Array = NDArray[np.float64]

LONGEST_GAP_S = 0.25
"""Longest gap that is bridged [s]: a quarter of a step of a walk."""

RATE_HZ = 120.0
"""Least rate of the motion that is made [Hz]. `Motion` interpolates its root by PCHIP, which
flattens the crests of what is sampled more rarely."""

_LEAST_KEPT = 1 / 3
"""Least fraction of the frames that the longest stretch without a longer gap must have."""

_EVEN = 0.01
"""Largest deviation of steps of time from their median, relative to it, that is rounding."""

_TIMES_TOO_LONG, _TIMES_TOO_SHORT = 1.6, 0.5
"""Lengths of a bone over its median beyond which the joint at its end was lost by the camera."""

_FOOT_OF_SHANK = 0.43
"""Ratio of the lengths from ankle to toe tip and from knee to ankle (HDM05, CMU)."""

_NOMINAL_STATURE_M = 1.75
"""Stature of a person of girth 1."""

_TOE_HEIGHT_M, _ON_THE_FLOOR = 0.02, 0.1
"""Height of the toe tips of who stands, of a person of nominal stature [m], and the quantile of the
height of the lowest node, over all frames, that is a person's who stands."""


def load_npz(path: Path, *, unit_m: float | None, up: str | None, rate_hz: float | None) -> Motion:
    """Read joint positions from an archive of NumPy."""
    return motion_of(read_npz(path, rate_hz), unit_m, up)


def load_csv(path: Path, *, unit_m: float | None, up: str | None, rate_hz: float | None) -> Motion:
    """Read joint positions from a table with a header."""
    return motion_of(read_csv(path, rate_hz), unit_m, up)


def motion_of(
    recording: JointRecording, unit_m: float | None = None, up: str | None = None
) -> Motion:
    """Make the motion of a rigid skeleton of joints that were measured one by one."""
    where = str(recording.path)
    # The 22 nodes of the body by the names of the joints.
    convention = recognise(where, recording.names)
    nodes = node_positions(convention, recording.names, recording.positions, NODES)
    for unseen in np.flatnonzero(np.isnan(nodes[..., 0]).all(axis=0)):
        raise InputError(
            f"{where}: the joint of node {NODES[unseen]!r} is never seen; add it, or take another "
            "recording"
        )
    # Unit and axes, as far as they are said; what is not said follows from the person.
    up, usual = up or recording.up, recording.usual or convention.up
    to_world, unit_m, found = settled_nodes(where, nodes, unit_m=unit_m, up=up, usual=usual)
    rate_hz = 1 / float(np.median(np.diff(recording.times)))
    found = [*recording.findings, *found, rate_of(round(rate_hz, 3))]
    nodes = unit_m * nodes @ to_world.T
    # Gaps: joints that a camera lost for a moment, the longest stretch without a long gap, and in
    # it even times through the short ones.
    if convention.low_pass_hz:
        _drop_lost(nodes, recording.times)
    nodes, times = _longest_stretch(where, nodes, recording.times)
    nodes, rate_hz = _resampled(nodes, times, convention)
    # Heads and feet are completed after the axes are known, because feet go on as the pelvis looks.
    pelvis, thorax = (_axes(where, nodes, sides) for sides in ("hip", "shoulder"))
    _complete(nodes, pelvis, convention)
    _keep_directions(where, nodes)
    # A person who stands is put on the floor z = 0, whatever the origin of the file is.
    size = stature_of(nodes) / _NOMINAL_STATURE_M
    lowest = np.quantile(nodes[..., 2].min(axis=1), _ON_THE_FLOOR)
    nodes[..., 2] += _TOE_HEIGHT_M * size - lowest
    motion = rigid_motion(recording.path.stem, nodes, pelvis, thorax, rate_hz)
    found.append(tall(size * _NOMINAL_STATURE_M))
    if recording.joined:
        text = f"times: {recording.joined} frames hardly after another one left out"
        found.append(Finding("joined_frames", recording.joined, text))
    found.append(warn_of_speed(where, NODES, motion.positions, rate_hz))
    return dataclasses.replace(motion, girth=size, findings=tuple(found))


def _length(nodes: Array, first: str, last: str) -> float:
    bone = of_node(nodes, first) - of_node(nodes, last)
    return float(np.median(np.linalg.norm(bone, axis=1)))


def _drop_lost(nodes: Array, times: Array) -> None:
    """Take nodes for unseen, in place, where a camera lost a joint for a short time.

    It did where a bone is too long or too short, and between two turns of a bone by more than a
    right angle from one frame to the next. What hangs on such a joint was lost with it. Hands and
    feet may be foreshortened; `_complete` mends them.
    """
    # A bone of a rigid body has one length; far from its median the joint at its end is wrong.
    bones, last = nodes - nodes[:, NODE_PARENTS], len(times) - 1
    spans = np.linalg.norm(bones, axis=2)
    usual = np.nanmedian(spans, axis=0)
    ends = np.array([node.endswith(("hand", "toe")) for node in NODES])
    lost = (spans > _TIMES_TOO_LONG * usual) | ((spans < _TIMES_TOO_SHORT * usual) & ~ends)
    turned = np.sum(bones[1:] * bones[:-1], axis=2) < 0
    # Between two reversals of a bone within a short time the joint was somewhere else.
    for node in range(1, len(NODES)):
        turns = [0, *(1 + np.flatnonzero(turned[:, node])).tolist(), len(times)]
        for begin, end in itertools.pairwise(turns):
            around = times[min(end, last)] - times[max(begin - 1, 0)]
            lost[begin:end, node] |= len(turns) > 2 and around <= LONGEST_GAP_S
        if NODES[NODE_PARENTS[node]][2:] in ("knee", "ankle", "elbow", "wrist"):
            lost[:, node] |= lost[:, NODE_PARENTS[node]]
        # Longer stretches are kept as they are: they could not be bridged.
        for begin, end in runs(lost[:, node]):
            if times[min(end, last)] - times[max(begin - 1, 0)] <= LONGEST_GAP_S:
                nodes[begin:end, node] = np.nan


def _longest_stretch(where: str, nodes: Array, times: Array) -> tuple[Array, Array]:
    """Cut to the longest stretch in which no gap of any node is longer than `LONGEST_GAP_S`."""
    unseen = np.isnan(nodes[..., 0])
    out, last = np.zeros(len(times), dtype=bool), len(times) - 1
    # Frames in a long gap of any node, or in one at an end, are out.
    for node in range(len(NODES)):
        for begin, end in runs(unseen[:, node]):
            at_an_end = begin == 0 or end > last
            if at_an_end or times[end] - times[begin - 1] > LONGEST_GAP_S:
                out[begin:end] = True
    # A jump in time is a gap of all nodes at once.
    breaks = 1 + np.flatnonzero(np.diff(times) > LONGEST_GAP_S)
    best = slice(0, 0)
    # Of each stretch the part from its first to its last frame in which every node is seen.
    for begin, end in runs(~out):
        inside = breaks[(breaks > begin) & (breaks < end)] - begin
        for stretch in np.split(np.arange(begin, end), inside):
            whole = stretch[~unseen[stretch].any(axis=1)]
            if len(whole) and whole[-1] + 1 - whole[0] > best.stop - best.start:
                best = slice(int(whole[0]), int(whole[-1]) + 1)
    kept = best.stop - best.start
    if kept < max(LEAST_FRAMES, _LEAST_KEPT * len(times)):
        worst = NODES[int(np.argmax(unseen.sum(axis=0)))]
        raise InputError(
            f"{where}: too much is not seen: {kept} of {len(times)} frames are the longest stretch "
            f"without a gap of more than {LONGEST_GAP_S} s (node {worst!r} is unseen most); fill "
            "the gaps, or cut the recording"
        )
    return nodes[best], times[best] - times[best.start]


def _resampled(nodes: Array, times: Array, convention: Convention) -> tuple[Array, float]:
    """Nodes (frame, node, 3) at even times, without gaps, and their rate."""
    steps = np.diff(times)
    step = float(np.median(steps))
    rate_hz = RATE_HZ
    if np.abs(steps - step).max() < _EVEN * step:  # each frame that was measured is one again
        rate_hz = round(math.ceil(RATE_HZ * step - 1e-6) / step, 6)
    at = np.arange(int(times[-1] * rate_hz + 1e-6) + 1) / rate_hz
    made = np.empty((len(at), *nodes.shape[1:]))
    # A spline through the frames in which a node was seen bridges its gaps.
    seen = ~np.isnan(nodes[..., 0])
    for own in np.unique(seen, axis=1).T:  # nodes that are seen in the same frames go together
        alike = np.flatnonzero((seen == own[:, None]).all(axis=0))
        places = nodes[own][:, alike]
        if convention.low_pass_hz:
            lam = (2 * np.pi * convention.low_pass_hz) ** -4 / step
            made[:, alike] = make_smoothing_spline(times[own], places, lam=lam)(at)
        else:
            made[:, alike] = CubicSpline(times[own], places)(at)
    return made, rate_hz


def _complete(nodes: Array, pelvis: Array, convention: Convention) -> None:
    """Complete heads, feet and hands, in place.

    A foot that ends before its toe tips goes on as the pelvis looks, at right angles to the shank;
    the joint that cameras find is at the instep. A hand or a head that is foreshortened, whose
    direction is uncertain then, points more and more as the forearm or the trunk does.
    """
    # The head, which by convention ends at its top or somewhere inside.
    thigh = _length(nodes, "l_knee", "l_hip")
    head = of_node(nodes, "head") - of_node(nodes, "neck")
    upward = unit(middle(nodes, "shoulder") - middle(nodes, "hip"))
    head = _lengthened(head, upward, 0.5 * _length(nodes, "head", "neck"))
    if not convention.head_is_top:
        head = HEAD_OF_THIGH * thigh * unit(head)
    nodes[:, NODES.index("head")] = of_node(nodes, "neck") + head
    for side in ("l", "r"):
        knee, ankle, toe = (of_node(nodes, f"{side}_{at}") for at in ("knee", "ankle", "toe"))
        # The foot: its part along the shank stays, and its part across it is made long enough.
        shank = unit(knee - ankle)
        length = _FOOT_OF_SHANK * _length(nodes, f"{side}_knee", f"{side}_ankle")
        along = np.sum((toe - ankle) * shank, axis=1, keepdims=True) * shank
        reach = np.sqrt(np.maximum(length**2 - np.sum(along**2, axis=1, keepdims=True), 0))
        ahead = _lengthened(toe - ankle - along, np.cross(pelvis[..., 1], shank), reach)
        nodes[:, NODES.index(f"{side}_toe")] = ankle + along + ahead
        # A hand keeps at least half of its median length, along the forearm if need be.
        elbow, wrist, end = (of_node(nodes, f"{side}_{at}") for at in ("elbow", "wrist", "hand"))
        half = 0.5 * _length(nodes, f"{side}_hand", f"{side}_wrist")
        hand = _lengthened(end - wrist, unit(wrist - elbow), half)
        nodes[:, NODES.index(f"{side}_hand")] = wrist + hand


def _axes(where: str, nodes: Array, sides: str) -> Array:
    """Axes (frame, 3, 3) with the left of hips or shoulders; where it is upward, those before."""
    left = of_node(nodes, f"l_{sides}") - of_node(nodes, f"r_{sides}")
    upward = middle(nodes, "shoulder") - middle(nodes, "hip")
    # Where the line of hips or shoulders is along the trunk, it says nothing of forward.
    forward = np.cross(left, upward)
    kept = _last(np.linalg.norm(forward, axis=1) > MINIMUM_PART_M**2)
    if kept is None:
        raise InputError(f"{where}: {sides}s are in one place or in line with the trunk; mend them")
    return level_axes(left[kept], forward[kept])


def _keep_directions(where: str, nodes: Array) -> None:
    """Give bones that vanish for a moment, in place, the direction that they had before."""
    for node in range(1, len(NODES)):
        start = nodes[:, NODE_PARENTS[node]]
        bone = nodes[:, node] - start
        kept = _last(np.linalg.norm(bone, axis=1) > MINIMUM_PART_M)
        if kept is None:
            raise InputError(
                f"{where}: {NODES[NODE_PARENTS[node]]!r} and {NODES[node]!r} are in one place; "
                f"every body part needs at least {MINIMUM_PART_M * 1e3:.0f} mm, mend the joints"
            )
        nodes[:, node] = start + bone[kept]


def _last(good: NDArray[np.bool_]) -> NDArray[np.int64] | None:
    """Index of the last good frame at each, or the first one; None where most are not."""
    if good.mean() < 0.5:
        return None
    # The running maximum of the indices of good frames; frames before the first good one take that.
    return np.maximum.accumulate(np.where(good, np.arange(len(good)), int(np.argmax(good))))


def _lengthened(bone: Array, along: Array, wanted: Array | float) -> Array:
    """Add to bones (frame, 3) what they lack in length, along other directions."""
    lacking = wanted - np.linalg.norm(bone, axis=1, keepdims=True)
    return np.asarray(bone + np.maximum(lacking, 0) * along)
