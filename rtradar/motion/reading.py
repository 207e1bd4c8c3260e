"""What a recording of a person means: its unit, which axis is up, and what no person can do.

Files of motion rarely say it, and say it wrongly. All formats are looked at alike, by the 22 nodes
of the person: a unit by the stature, up by who stands on a floor, frames by their speed. What is
found is kept in ``Motion.findings`` and shown; what contradicts the format is warned of; and where
two readings are as good as each other, an `InputError` names the option that tells.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError, ValidityWarning
from rtradar.motion.motion import Motion
from rtradar.motion.skeleton import NODES, middle, of_node, to_nodes
from rtradar.recordings import UNITS_M, UPWARD, Finding, rate_of, tall
from rtradar.system.row_files import in_blocks

Array = NDArray[np.float64]

STATURE_M, _ADULT_M = (0.7, 2.2), (1.4, 2.05)
"""Limits of the stature of people, small children included, and of adults [m]."""

FASTEST_M_S = 30.0
"""Speed of a joint above which a recording is doubted [m/s]."""

_ANKLE_OF_STATURE = 0.039
"""Height of the ankle over that of the person (Drillis and Contini 1966)."""

_CHAIN_OF_STATURE, _NOMINAL_STATURE_M = 0.64, 1.75
"""Length of the bones from the root to the farthest end over the stature (0.56 to 0.72, more where
that end is a finger's), and a stature [m]."""

_LOOKED_AT = 400
"""The most frames from which unit and up are found."""

_UPRIGHT = 0.8
"""Least cosine between an axis and the direction from the ankles to the head of who is upright."""

_SOMETIMES, _MOSTLY = 0.1, 0.5
"""Fractions of the frames."""

_STEADY, _ON_ZERO = 0.25, 0.1
"""Over the stature: how much the lowest joint may rise and fall on a floor, and how near to zero a
floor is that the file's axes stand upon."""

_FREE, _TRAVELS = 0.02, 0.3
"""Range of the pelvis over the stature, along both level axes or along one, of who does not lie."""

_ARMS_LEVEL = 0.94
"""Least cosine between the arms and the line of the shoulders in a T-pose: 20 degrees."""

_LONGEST_POSE_S, _T_POSE_M_S, _T_POSE_TIMES = 2.0, 10.0, 4.0
"""A T-pose before the motion lasts at most so long [s]; the hands leave it faster than this [m/s],
and so many times as fast as they move in nearly all frames after it."""


def _warn(text: str) -> None:
    warnings.warn(text, ValidityWarning, stacklevel=6)


def stature_of(nodes: Array) -> float:
    """Height of the person: what legs, trunk and head add up to, in medians, NaN left out."""

    def span(first: Array, last: Array) -> float:
        return float(np.nanmedian(np.linalg.norm(first - last, axis=1)))

    legs = [
        span(of_node(nodes, f"{side}_knee"), of_node(nodes, f"{side}_{end}"))
        for side in "lr"
        for end in ("hip", "ankle")
    ]
    trunk = span(middle(nodes, "shoulder"), middle(nodes, "hip"))
    head = span(of_node(nodes, "head"), middle(nodes, "shoulder"))
    return (sum(legs) / 2 + trunk + head) / (1 - _ANKLE_OF_STATURE)


_ALOFT_M, _FALL_FRAMES, _HALF_OR_TWICE = 0.06, 8, ((0.4, 0.65), (1.6, 2.6))
"""Height of the feet of who is in the air [m], least number of frames for a fall, and how many
times too slow or too fast it is where the rate is half or twice as much."""

_LOOKED_AT_S = 20.0
"""Beginning of a recording in which falls and steps are sought [s]."""

_STEPS_HZ, _LEAST_STEPS = 3.2, 4
"""Steps a second of who walks are fewer, and how many are counted at least."""


# -- the unit --------------------------------------------------------------------------------------


def found_unit(where: str, stature: float) -> tuple[float, str]:
    """Find the unit [m] in which a person has this stature, and say how.

    Of the units that make a person, that of an adult counts; children of whom nothing else is known
    are refused where another unit makes an adult of them, too.
    """
    # Adults first: only where no unit makes one, children are considered.
    for low, high in (_ADULT_M, STATURE_M):
        fitting = {name: unit for name, unit in UNITS_M.items() if low <= stature * unit <= high}
        if len(fitting) == 1:
            ((name, unit),) = fitting.items()
            return unit, f"unit: {name}, by the stature"
        if fitting:
            break
    tall = [f"{stature * unit:.3g} m in {name}" for name, unit in UNITS_M.items()]
    raise InputError(
        f"{where}: a person of {stature:.4g} units would be {', '.join(tall)} tall; give the unit "
        f"(unit, --unit: {', '.join(UNITS_M)}, or metres)"
    )


def _settled_unit(
    where: str, stature: float, unit_m: float | None, by: str
) -> tuple[float, Finding]:
    """Find the unit, or check one that is given: a warning says where it makes nobody's stature."""
    how = f"unit: {unit_m:.4g} m, as {by}" if unit_m is not None else ""
    if unit_m is None:
        unit_m, how = found_unit(where, stature)
    stature_m = stature * unit_m
    text = f"{where}: with a unit of {unit_m:g} m the person is {stature_m:.3g} m tall"
    if not 0.1 * STATURE_M[0] <= stature_m <= 10 * STATURE_M[1]:
        raise InputError(f"{text}; give the unit (unit, --unit), or mend the file")
    if not STATURE_M[0] <= stature_m <= STATURE_M[1]:
        _warn(text)
    return unit_m, Finding("unit_m", unit_m, how)


# -- up --------------------------------------------------------------------------------------------


class _Stance(NamedTuple):
    """How a person stands if a direction is up.

    ``upright`` is a fraction of the frames; the lowest joint is ``steady``, on a floor, and that is
    near zero; the pelvis is ``free``, as of nobody who lies, or ``travels``.
    """

    up: str
    upright: float
    steady: bool
    on_zero: bool
    free: bool
    travels: bool


def _stances(nodes: Array) -> dict[str, _Stance]:
    size = stature_of(nodes)
    body = of_node(nodes, "head") - middle(nodes, "ankle")
    with np.errstate(invalid="ignore", divide="ignore"):
        body = body / np.linalg.norm(body, axis=1, keepdims=True)
    found = {}
    for up in UPWARD:
        axis, sign = "xyz".index(up[-1]), -1.0 if up[0] == "-" else 1.0
        # How high the lowest joint is along this axis, over time: on a floor it hardly changes.
        low = np.nanmin(sign * nodes[..., axis], axis=1)
        least, median, most = np.nanquantile(low, (0.1, 0.5, 0.9)) / size
        # How far the pelvis goes along the two other axes, which would be level.
        level = np.delete(nodes[:, 0], axis, axis=1)
        free = np.subtract(*np.nanquantile(level, (0.95, 0.05), axis=0)) / size
        travels = bool(free.max() > _TRAVELS)
        found[up] = _Stance(
            up,
            upright=float(np.nanmean(sign * body[:, axis] > _UPRIGHT)),
            steady=bool(most - least < _STEADY),
            on_zero=bool(abs(median) < _ON_ZERO),
            free=travels or bool((free > _FREE).all()),
            travels=travels,
        )
    return found


def found_up(where: str, nodes: Array, *, given: str = "", usual: str = "") -> tuple[str, str]:
    """Find which axis of a file is up, and say how.

    Parameters
    ----------
    where : str
        The file, for messages.
    nodes : (frame, node, 3) float64
        Nodes of the person, in the axes of the file; NaN where not seen.
    given : str
        Axis that the file or the user says, one of `UPWARD`; believed, with a warning where the
        person lies by it and would stand by another.
    usual : str
        Axis that the format has.

    Returns
    -------
    up, how : str
    """
    seen = nodes[~np.isnan(nodes[..., 0]).all(axis=1)]
    stances = _stances(seen[:: max(1, len(seen) // _LOOKED_AT)])
    upright = max(stances.values(), key=lambda one: one.upright)
    # What is said is believed; a warning needs both that the person lies by it, and that they stand
    # by another axis.
    if given:
        own = stances[given]
        sure = upright.upright > _MOSTLY and upright.steady and (upright.on_zero or upright.free)
        if own.upright < _SOMETIMES and sure and not own.steady:
            _warn(
                f"{where}: with {given} up, as given, the person lies and drifts; with "
                f"{upright.up} up they stand on a floor"
            )
        return given, f"up: {given}, as given"
    if usual:
        return _up_of_format(where, upright, stances[usual])
    # Nobody says it: the axes along which the person stands, narrowed down by a floor and by one
    # near zero, until one is left.
    standing = [one for one in stances.values() if one.upright >= _SOMETIMES]
    for narrower in ("steady", "on_zero"):
        if len(standing) > 1:
            standing = [one for one in standing if getattr(one, narrower)]
    if len(standing) == 1 and (standing[0].on_zero or standing[0].free):
        up = standing[0].up
        return up, f"up: {up}, for along it the person stands on a floor"
    raise InputError(
        f"{where}: up is unknown, for nobody who moves stands on a floor along one axis alone (who "
        f"lies in bed looks like who stands); give up, one of {', '.join(UPWARD)} (--up)"
    )


def _up_of_format(where: str, upright: _Stance, own: _Stance) -> tuple[str, str]:
    """Up where the format has an axis, which files of some programs do not keep to."""
    if own.upright >= _MOSTLY or upright.upright < _MOSTLY:
        return own.up, f"up: {own.up}, as the format has it"
    # The person lies by the format's axis and stands by another. A floor under one of both decides,
    # and if there are two, one at zero.
    good = [one for one in (own, upright) if one.steady]
    if len(good) == 2:
        good = [one for one in good if one.on_zero]
    if len(good) != 1:
        raise InputError(
            f"{where}: the person lies if {own.up} is up, as the format has it, and stands if "
            f"{upright.up} is, with a floor in neither or in both; give up (--up {own.up} or "
            f"--up {upright.up})"
        )
    (best,) = good
    if best is own:
        if own.upright < _SOMETIMES and own.travels and not own.on_zero:
            _warn(
                f"{where}: with {own.up} up, as the format has it, the person never stands, and "
                "moves along above the floor; who walks needs another axis (--up)"
            )
        return own.up, f"up: {own.up}, as the format has it; the person lies on a floor"
    text = f"up: {best.up}, not {own.up} as the format has it, for along it the person stands"
    _warn(f"{where}: {text}")
    return best.up, text


def settled_nodes(
    where: str,
    nodes: Array,
    *,
    unit_m: float | None,
    up: str,
    usual: str,
    unit_by: str = "given",
) -> tuple[Array, float, list[Finding]]:
    """Find the rotation (3, 3) to the world of nodes (frame, node, 3), and their unit [m]."""
    unit_m, unit = _settled_unit(where, stature_of(nodes), unit_m, unit_by)
    upward, how = found_up(where, nodes, given=up, usual=usual)
    return to_world_from(upward), unit_m, [unit, Finding("up", upward, how)]


def to_world_from(up: str) -> Array:
    """Rotation (3, 3) from the axes of a file, one of which is up, to the world's."""
    cyclic = np.roll(np.eye(3), 2 - "xyz".index(up[-1]), axis=0)
    return np.diag([1.0, -1.0, -1.0]) @ cyclic if up[0] == "-" else cyclic


# -- frames ----------------------------------------------------------------------------------------


def leading_t_pose(nodes: Array, rate_hz: float) -> int:
    """Count the frames of a T-pose before the motion, from which the hands jump away [m]."""
    hands = nodes[:, [NODES.index("l_wrist"), NODES.index("r_wrist")]]
    # Some recordings begin with a pose of calibration, which the motion follows at once: from one
    # frame to the next the hands are far away, much faster than they usually move later.
    speed = np.linalg.norm(np.diff(hands, axis=0), axis=2).max(axis=1) * rate_hz
    jumps = np.flatnonzero(speed[: round(_LONGEST_POSE_S * rate_hz)] > _T_POSE_M_S)
    if not len(jumps) or jumps[0] + 2 >= len(speed):
        return 0
    count, after = int(jumps[0]) + 1, speed[jumps[0] + 1 :]
    sudden = speed[jumps[0]] > _T_POSE_TIMES * float(np.quantile(after, 0.99))
    return count if sudden and _in_t_pose(nodes[:count]) else 0


def _in_t_pose(nodes: Array) -> bool:
    shoulders = of_node(nodes, "l_shoulder"), of_node(nodes, "r_shoulder")
    wrists = of_node(nodes, "l_wrist"), of_node(nodes, "r_wrist")
    across = shoulders[0] - shoulders[1]
    arms = np.stack([wrists[0] - shoulders[0], shoulders[1] - wrists[1]])
    sizes = np.linalg.norm(arms, axis=2) * np.linalg.norm(across, axis=1)
    return bool((np.sum(arms * across, axis=2) >= _ARMS_LEVEL * sizes).all())


def warn_of_speed(where: str, names: Sequence[str], positions: Array, rate_hz: float) -> Finding:
    """Say the largest speed of a joint, and warn where no person is so fast."""
    fastest, joint, frame, first = 0.0, 0, 0, 0
    before = positions[:0]
    # In blocks, each with the last frame of the one before, because a speed is between two frames.
    for (block,) in in_blocks(positions):
        rows = np.concatenate([before, block])
        speed = np.linalg.norm(np.diff(rows, axis=0), axis=2) * rate_hz
        if speed.size and speed.max() > fastest:
            at, joint = divmod(int(speed.argmax()), speed.shape[1])
            fastest, frame = float(speed.max()), first - len(before) + at
        before, first = rows[-1:], first + len(block)
    text = f"largest speed: {fastest:.3g} m/s, of {names[joint]} after frame {frame + 1}"
    if fastest > FASTEST_M_S:
        _warn(
            f"{where}: {names[joint]} moves at {fastest:.3g} m/s after frame {frame + 1}, faster "
            "than people do; cut or mend the recording, or check its rate and unit"
        )
    return Finding("largest_speed_mps", round(fastest, 3), text)


def warn_of_rate(where: str, nodes: Array, rate_hz: float) -> None:
    """Warn where free fall, or steps of who walks, say that the rate is half or twice as much.

    ``nodes (frame, node, 3)`` are in the world [m]. Who is in the air falls with 9.8 m/s^2; who
    walks, with a foot on the floor at all times, makes fewer than 3.2 steps a second.
    """
    # In the air are those whose lowest foot point is well above where it usually is.
    feet = nodes[:, [NODES.index(f"{side}_{at}") for side in "lr" for at in ("ankle", "toe")], 2]
    lowest = feet.min(axis=1)
    aloft = lowest > np.quantile(lowest, 0.05) + _ALOFT_M
    edges = np.flatnonzero(np.diff(np.concatenate([[0], aloft, [0]])))
    falls = []
    # A parabola through the height of the pelvis in each flight gives its acceleration.
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end - begin >= _FALL_FRAMES:
            times = np.arange(end - begin) / rate_hz
            falls.append(-2 * np.polyfit(times, nodes[begin:end, 0, 2], 2)[0])
    # Each time the ankles pass each other along the way, a step is made.
    apart = of_node(nodes, "l_ankle") - of_node(nodes, "r_ankle")
    passes = int((np.diff(np.sign(apart @ _mean_way(nodes))) != 0).sum())
    duration_s = len(nodes) / rate_hz
    says = ""
    # With frames at the wrong rate r' the fall has (r'/r)^2 times its acceleration.
    if falls and not aloft[[0, -1]].any():
        ratio = float(np.sqrt(np.median(falls) / 9.81)) if np.median(falls) > 0 else 1.0
        if any(low < ratio < high for low, high in _HALF_OR_TWICE):
            says = f"who jumps falls with {np.median(falls):.1f} m/s^2, {ratio:.1f} times as fast"
    elif not aloft.any() and passes > max(_STEPS_HZ * duration_s, _LEAST_STEPS):
        says = f"{passes / duration_s:.1f} steps a second with a foot on the floor are too many"
    if says:
        _warn(
            f"{where}: the rate of {rate_hz:g} frames a second may be wrong: {says}; give it "
            "(rate_hz, --rate)"
        )


def _mean_way(nodes: Array) -> Array:
    """Unit vector of the way that the person goes; none for who stays."""
    way = (nodes[-1, 0] - nodes[0, 0]) * [1, 1, 0]
    size = float(np.linalg.norm(way))
    return np.asarray(way / size if size > 1.0 else 0 * way)


# -- motions of skeletons --------------------------------------------------------------------------


def longest_chain(motion: Motion) -> float:
    """Length of the bones from the root of a skeleton to its farthest end."""
    lengths = np.linalg.norm(motion.offsets, axis=1)
    ends = np.zeros(len(lengths))
    for joint, parent in enumerate(motion.parents[1:], start=1):
        ends[joint] = ends[parent] + lengths[joint]
    return float(ends.max())


def settled(
    where: str, motion: Motion, *, unit_m: float | None, up: str | None, unit_by: str = "given"
) -> Motion:
    """Give a motion of a skeleton, of a format whose y is up, its unit and its world.

    Parameters
    ----------
    where : str
        The file, for messages.
    motion : Motion
        As read: lengths in units of the file, and axes as if y were up there.
    unit_m, up : float, str, optional
        What the user says; found where not given.
    unit_by : str
        Who says the unit.
    """
    # What is too short for a part of a body is known at a body's size alone.
    count = len(motion.root_positions)
    about = longest_chain(motion) / _CHAIN_OF_STATURE
    if not about > 0:
        raise InputError(f"{where}: no bone has a length; mend the skeleton")
    try:
        some = _of_frames(motion, partial(_every, step=math.ceil(count / _LOOKED_AT)))
        nodes = to_nodes(some.scaled(_NOMINAL_STATURE_M / about)).positions
    except InputError:  # its names are not known: whoever needs its nodes is told which lack
        unit_m = found_unit(where, about)[0] if unit_m is None else unit_m
        made = _turned_up(motion.scaled(unit_m), to_world_from(up or "y"))
        return replace(made, girth=motion.girth)
    # Back to the unit and the axes of the file, in which unit and up are found.
    nodes = about / _NOMINAL_STATURE_M * nodes @ to_world_from("y")
    to_world, unit_m, (unit, upward) = settled_nodes(
        where, nodes, unit_m=unit_m, unit_by=unit_by, up=up or "", usual="y"
    )
    found = [unit, tall(stature_of(nodes) * unit_m), upward, rate_of(motion.rate_hz)]
    made = _turned_up(motion if unit_m == 1 else motion.scaled(unit_m), to_world)
    # A T-pose is looked for in the first seconds only, so that long recordings need not be
    # retargeted whole.
    first = slice(round(2 * _LONGEST_POSE_S * made.rate_hz))
    dropped = leading_t_pose(to_nodes(_of_frames(made, itemgetter(first))).positions, made.rate_hz)
    if dropped:
        text = f"frame 1 is a T-pose: {dropped} frame{'s' * (dropped > 1)} dropped at the beginning"
        _warn(f"{where}: {text}")
        found.append(Finding("t_pose_frames", dropped, text))
        made = _of_frames(made, itemgetter(slice(dropped, None)))
    found.append(warn_of_speed(where, made.joints, made.positions, made.rate_hz))
    begin = slice(round(_LOOKED_AT_S * made.rate_hz) + 2)
    warn_of_rate(where, to_nodes(_of_frames(made, itemgetter(begin))).positions, made.rate_hz)
    return replace(made, girth=motion.girth, findings=tuple(found))


def _turned_up(motion: Motion, to_world: Array) -> Motion:
    """Turn a motion that was read as if y were up, where another axis is."""
    turn = to_world @ to_world_from("y").T
    if (turn == np.eye(3)).all():
        return motion
    return motion.rotated(Rotation.from_matrix(turn).as_quat())


def _of_frames(motion: Motion, take: Callable[[Array], Array]) -> Motion:
    """Keep some frames of a motion, those that a function takes from rows."""
    rows = take(motion.root_positions), take(motion.rotations)
    return replace(motion, root_positions=rows[0], rotations=rows[1])


def _every(array: Array, step: int) -> Array:
    """Copy of every so many rows, of which a file's pages are released as they are passed."""
    found, first = list[Array](), 0
    for (rows,) in in_blocks(array):
        found.append(rows[-first % step :: step].copy())
        first += len(rows)
    return np.concatenate(found)
