"""Synthetic actors: a person of any size walks, kicks, punches or does jumping jacks."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping

import numpy as np

from rtradar.errors import InputError
from rtradar.motion.motion import Motion
from rtradar.motion.skeleton_names import NODE_PARENT, NODES
from rtradar.motion.synthetic.figure import PosesAt, lowering, offsets, rotations
from rtradar.motion.synthetic.gait import walk
from rtradar.motion.synthetic.jumping_jack import jumping_jack
from rtradar.motion.synthetic.strikes import kick, punch
from rtradar.motion.synthetic.traits import Traits, draw_traits
from rtradar.system.row_files import FileBackedRows, in_blocks
from rtradar.system.seeds import check_seed, stream

ACTIVITIES: Mapping[str, Callable[[float, Traits], PosesAt]] = {
    "walk": walk,
    "kick": kick,
    "punch": punch,
    "jumping_jack": jumping_jack,
}
"""Activities of the actors, by name."""

_RANGES = {
    "duration_s": (0.0, 3600.0),
    "height_m": (0.8, 2.5),
    "build": (0.4, 2.5),
    "tempo": (0.4, 2.0),
    "amplitude": (0.3, 1.25),
    "rate_hz": (30.0, 10_000.0),
}


def synthetic_motion(
    activity: str,
    seed: int = 0,
    *,
    duration_s: float = 3.0,
    height_m: float = 1.75,
    build: float = 1.0,
    tempo: float = 1.0,
    side: str = "left",
    amplitude: float = 1.0,
    rate_hz: float = 120.0,
    take: int = 0,
) -> Motion:
    """Make a synthetic actor that faces the radar (-x), on the floor z = 0.

    Joints move along minimum-jerk and harmonic curves (C2), feet stand still while they carry and
    never sink below the floor, jumps fall freely. A walk of up to 4.2 m goes straight; a longer one
    turns round within 1.5 m of the middle. The others repeat with short rests.

    Parameters
    ----------
    activity : {"walk", "kick", "punch", "jumping_jack"}
        Activity of the person.
    seed : int
        Number of the subject, which has its own phase, and a few percent of tempo, amplitude and
        unevenness of the sides.
    duration_s : float
        Duration [s].
    height_m : float
        Standing height [m]; segment lengths by Drillis and Contini (see
        `rtradar.motion.synthetic.figure`).
    build : float
        Thickness relative to a normal person of that height.
    tempo : float
        Speed of the movement; 1 is a walk of about 1.2 m/s.
    side : {"left", "right"}
        Side of the leg or hand that strikes, or of the foot that steps first.
    amplitude : float
        Factor of step length, kick height, reach and width of the jumps.
    rate_hz : float
        Number of frames per second of the result [Hz].
    take : int
        Number of the take; another take of the same subject begins elsewhere in the movement.

    Returns
    -------
    Motion
        Motion of ``duration_s`` at ``rate_hz`` in world axes, not yet placed before a radar.

    Raises
    ------
    InputError
        Where an activity is unknown or a value out of range.
    """
    if activity not in ACTIVITIES:
        raise InputError(f"unknown activity {activity!r}; allowed are {', '.join(ACTIVITIES)}")
    if side not in ("left", "right"):
        raise InputError(f"side {side!r}; allowed are left and right")
    own = check_seed("", seed), list(ACTIVITIES).index(activity)
    if isinstance(take, bool) or not isinstance(take, (int, np.integer)) or take < 0:
        raise InputError(f"take {take!r}; it must be a whole number, zero or more")
    given = {
        "duration_s": duration_s,
        "height_m": height_m,
        "build": build,
        "tempo": tempo,
        "amplitude": amplitude,
        "rate_hz": rate_hz,
    }
    for name, value in given.items():
        low, high = _RANGES[name]
        if not (math.isfinite(value) and low <= value <= high) or value == 0:
            raise InputError(
                f"synthetic {activity}: {name} = {value}; allowed is {low:g} to {high:g}"
            )
    traits = draw_traits(
        np.random.default_rng(stream(*own)),
        height_m=height_m,
        side=side[0],
        tempo=tempo,
        amplitude=amplitude,
    )
    if take:
        traits = dataclasses.replace(
            traits, phase=float(np.random.default_rng(stream(*own, int(take))).uniform())
        )
    # Asked for twice: how far down all must come is not known before the last, and too many would
    # have to be kept.
    poses_at = ACTIVITIES[activity](duration_s, traits)
    times = np.arange(math.ceil(duration_s * rate_hz - 1e-9) + 1) / rate_hz
    down = [0.0, 0.0, max(lowering(poses_at(some), height_m) for (some,) in in_blocks(times))]
    roots, turned = FileBackedRows(), FileBackedRows()
    for (some,) in in_blocks(times):
        pose = poses_at(some)
        pose = dataclasses.replace(pose, root=pose.root - down)
        roots.append(pose.root)
        turned.append(rotations(pose, height_m))
    bones = offsets(height_m)
    motion = Motion(
        name=f"synthetic:{activity}",
        joints=NODES,
        parents=(-1, *(NODES.index(NODE_PARENT[node]) for node in NODES[1:])),
        offsets=np.array([bones[node] for node in NODES]),
        root_positions=roots.rows(),
        rotations=turned.rows(),
        rate_hz=rate_hz,
        length_s=duration_s,
        girth=build * height_m / 1.75,
    )
    return motion.turned(math.pi)
