"""Recordings of joint positions (.npz), such as cameras with depth and body models give."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, make_smoothing_spline

from rtradar.errors import InputError
from rtradar.motion.formats.joint_sets import JointSet, node_positions, recognise
from rtradar.motion.formats.markers import level_axes, rigid_motion
from rtradar.motion.motion import Motion
from rtradar.motion.skeleton import HEAD_OF_THIGH, NODE_PARENTS, NODES
from rtradar.system.files import read_arrays

Array = NDArray[np.float64]

LONGEST_GAP_S = 0.25
"""Longest gap of a joint that is bridged [s]."""

CUTOFF_HZ = 8.0
"""Frequency of which the low-pass for joints that jitter leaves half [Hz]."""

LEAST_RATE_HZ = 120.0

_NOMINAL_STATURE_M = 1.75
_SEGMENTS_OF_STATURE = {"knee": 0.245, "ankle": 0.246, "elbow": 0.186, "wrist": 0.146}
_TRUNK_OF_STATURE = 0.288
_FOOT_OF_SHANK = 0.43
_TOE_HEIGHT_M = 0.02


@dataclass(frozen=True)
class JointRecording:
    """Positions (frame, joint, 3) of named joints [m], NaN where unseen, at ``times`` (frame,)."""

    path: Path
    names: tuple[str, ...]
    positions: Array
    times: Array
    up: str


def load_npz(path: Path) -> Motion:
    """Read joint positions from an archive of NumPy; an `InputError` tells what is wrong with it.

    It holds ``positions (frame, joint, 3)`` [m], ``joints``, ``up``, and ``rate_hz`` or ``time_s``.
    """
    try:
        arrays = read_arrays(path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot read this NPZ file ({error.strerror}); check the path"
        ) from None
    except ValueError as error:
        raise InputError(
            f"{path}: not an archive of NumPy, or a damaged one ({error}); write positions, "
            "joints, up, and rate_hz or time_s with numpy.savez"
        ) from None
    for needed in ("positions", "joints", "up", "rate_hz or time_s"):
        if not any(name in arrays for name in needed.split(" or ")):
            raise InputError(
                f"{path}: {needed} is missing; joint positions need positions, "
                "joints, up, and rate_hz or time_s"
            )
    positions = arrays["positions"].astype(np.float64)
    times = (
        arrays["time_s"].astype(np.float64)
        if "time_s" in arrays
        else np.arange(len(positions)) / float(arrays["rate_hz"])
    )
    names = tuple(map(str, arrays["joints"]))
    return motion_of(JointRecording(path, names, positions, times, str(arrays["up"])))


def motion_of(recording: JointRecording) -> Motion:
    """Make a rigid skeleton of joints that were measured one by one."""
    joint_set = recognise(str(recording.path), recording.names)
    positions = recording.positions.copy()
    positions[~positions.any(axis=2)] = np.nan
    if recording.up == "y":
        positions = positions[..., [2, 0, 1]]
    nodes = node_positions(joint_set, recording.names, positions)
    nodes[_impossible(nodes)] = np.nan
    nodes, times = _longest_stretch(nodes, recording.times)
    nodes, rate_hz = _resampled(nodes, times, joint_set)
    pelvis = level_axes(_across(nodes, "hip"), np.cross(_across(nodes, "hip"), _spine(nodes)))
    thorax = level_axes(
        _across(nodes, "shoulder"), np.cross(_across(nodes, "shoulder"), _spine(nodes))
    )
    _complete(nodes, pelvis, joint_set)
    lengths = np.median(np.linalg.norm(nodes - nodes[:, NODE_PARENTS], axis=2), axis=0)
    stature = _stature(nodes, lengths)
    floor = np.quantile(nodes[..., 2].min(axis=1), 0.1)
    nodes[..., 2] += _TOE_HEIGHT_M * stature / _NOMINAL_STATURE_M - floor
    motion = rigid_motion(recording.path.stem, nodes, pelvis, thorax, rate_hz)
    return dataclasses.replace(motion, girth=stature / _NOMINAL_STATURE_M)


def _impossible(nodes: Array) -> NDArray[np.bool_]:
    """Nodes (frame, node) whose bone is more than twice, or less than a third, of its length.

    Hands and feet may be foreshortened; `_complete` mends them.
    """
    spans = np.linalg.norm(nodes - nodes[:, NODE_PARENTS], axis=2)
    usual = np.nanmedian(spans, axis=0)
    ends = np.array([node.endswith(("hand", "toe")) for node in NODES])
    wrong = (spans > 2 * usual) | ((spans < usual / 3) & ~ends)
    wrong[:, 0] = False
    return np.asarray(wrong)


def _longest_stretch(nodes: Array, times: Array) -> tuple[Array, Array]:
    """Cut to the longest stretch in which no node is unseen for more than `LONGEST_GAP_S`."""
    seen = ~np.isnan(nodes[..., 0])
    ends = [0]
    for k in range(nodes.shape[1]):
        own = np.flatnonzero(seen[:, k])
        for first, last in itertools.pairwise(own.tolist()):
            if times[last] - times[first] > LONGEST_GAP_S:
                ends += [first + 1, last]
    whole = np.flatnonzero(seen.all(axis=1))
    edges = sorted({*ends, len(times)})
    best = slice(0, 0)
    for first, last in itertools.pairwise(edges):
        own = whole[(whole >= first) & (whole < last)]
        if len(own) and own[-1] + 1 - own[0] > best.stop - best.start:
            best = slice(int(own[0]), int(own[-1]) + 1)
    return nodes[best], times[best] - times[best.start]


def _resampled(nodes: Array, times: Array, joint_set: JointSet) -> tuple[Array, float]:
    step = float(np.median(np.diff(times)))
    rate = round(float(np.ceil(LEAST_RATE_HZ * step - 1e-6) / step), 6)
    at = np.arange(int(times[-1] * rate + 1e-6) + 1) / rate
    made = np.empty((len(at), *nodes.shape[1:]))
    for k in range(nodes.shape[1]):
        own = ~np.isnan(nodes[:, k, 0])
        if joint_set.jitters:
            lam = (2 * np.pi * CUTOFF_HZ) ** -4 / step
            for axis in range(3):
                made[:, k, axis] = make_smoothing_spline(times[own], nodes[own, k, axis], lam=lam)(
                    at
                )
        else:
            made[:, k] = CubicSpline(times[own], nodes[own, k])(at)
    return made, rate


def _node(nodes: Array, name: str) -> Array:
    return nodes[:, NODES.index(name)]


def _across(nodes: Array, name: str) -> Array:
    return _node(nodes, f"l_{name}") - _node(nodes, f"r_{name}")


def _spine(nodes: Array) -> Array:
    hips, shoulders = (
        _node(nodes, f"l_{name}") + _node(nodes, f"r_{name}") for name in ("hip", "shoulder")
    )
    return np.asarray((shoulders - hips) / 2)


def _complete(nodes: Array, pelvis: Array, joint_set: JointSet) -> None:
    """Lengthen heads and feet to where the nodes are, in place."""
    thigh = np.median(np.linalg.norm(_node(nodes, "l_knee") - _node(nodes, "l_hip"), axis=1))
    if not joint_set.head_is_top:
        along = _direction(_node(nodes, "head") - _node(nodes, "neck"))[0]
        nodes[:, NODES.index("head")] = _node(nodes, "neck") + HEAD_OF_THIGH * thigh * along
    for side in ("l", "r"):
        knee, ankle, toe = (_node(nodes, f"{side}_{name}") for name in ("knee", "ankle", "toe"))
        shank, length = _direction(knee - ankle)
        foot = toe - ankle
        down = np.sum(foot * shank, axis=1, keepdims=True)
        wanted = np.sqrt(np.maximum((_FOOT_OF_SHANK * length) ** 2 - down**2, 0))
        ahead = _lengthened(foot - down * shank, np.cross(pelvis[..., 1], shank), wanted)
        nodes[:, NODES.index(f"{side}_toe")] = ankle + down * shank + ahead
        elbow, wrist, hand = (_node(nodes, f"{side}_{name}") for name in ("elbow", "wrist", "hand"))
        half = np.median(np.linalg.norm(hand - wrist, axis=1)) / 2
        hand = _lengthened(hand - wrist, _direction(wrist - elbow)[0], half)
        nodes[:, NODES.index(f"{side}_hand")] = wrist + hand


def _direction(bone: Array) -> tuple[Array, float]:
    """Unit vectors (frame, 3) along a bone, and its median length."""
    lengths = np.linalg.norm(bone, axis=1, keepdims=True)
    return bone / np.maximum(lengths, 1e-12), float(np.median(lengths))


def _lengthened(bone: Array, along: Array, wanted: Array | float) -> Array:
    """Add to bones (frame, 3) what they lack in length, along other directions."""
    lacking = wanted - np.linalg.norm(bone, axis=1, keepdims=True)
    return np.asarray(bone + np.maximum(lacking, 0) * along)


def _stature(nodes: Array, lengths: Array) -> float:
    own = [lengths[NODES.index(f"{side}_{name}")] for side in "lr" for name in _SEGMENTS_OF_STATURE]
    trunk = float(np.median(np.linalg.norm(_spine(nodes), axis=1)))
    whole = 2 * (sum(_SEGMENTS_OF_STATURE.values()) + _TRUNK_OF_STATURE)
    return float(sum(own) + 2 * trunk) / whole
