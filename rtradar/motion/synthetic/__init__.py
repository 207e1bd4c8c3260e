"""Synthetic actors: people of any size and manner who walk, kick, jump, sit down, fall and more."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypedDict, Unpack

import numpy as np

from rtradar.errors import InputError
from rtradar.motion.motion import Motion
from rtradar.motion.skeleton import NODE_PARENTS, NODES
from rtradar.motion.synthetic.figure import (
    STYLES,
    PosesAt,
    Subject,
    lowering,
    offsets,
    rotations,
)
from rtradar.motion.synthetic.gait import walk
from rtradar.motion.synthetic.jacks import jumping_jack
from rtradar.motion.synthetic.on_the_spot import bend, fall, lie, sit, squat, stand, wave
from rtradar.motion.synthetic.strikes import kick, punch
from rtradar.recordings import SYNTHETIC, Source
from rtradar.system.checks import brief
from rtradar.system.fields import Limits, check_fields, rules_of
from rtradar.system.registries import check_activity
from rtradar.system.row_files import FileBackedRows, in_blocks
from rtradar.system.seeds import check_seed, stream

__all__ = ["ACTIVITIES", "ACTORS", "STYLES", "Traits", "synthetic_motion"]

ACTORS = 4
"""Version of the actors, raised whenever one of them moves otherwise than before."""


def _jump(duration_s: float, subject: Subject) -> PosesAt:
    """Jumps with both legs on the spot, facing +x."""
    return jumping_jack(duration_s, subject, activity="jump")


def _walk_in_place(duration_s: float, subject: Subject) -> PosesAt:
    """A walk on the spot, facing +x."""
    return walk(duration_s, subject, table="walk_in_place")


def _boxing(duration_s: float, subject: Subject) -> PosesAt:
    """Combinations of punches, with steps between them and a trunk that weaves, facing +x."""
    return punch(duration_s, subject, boxing=True)


ACTIVITIES: Mapping[str, Callable[[float, Subject], PosesAt]] = {
    "walk": walk,
    "kick": kick,
    "punch": punch,
    "jumping_jack": jumping_jack,
    "stand": stand,
    "sit": sit,
    "bend": bend,
    "squat": squat,
    "wave": wave,
    "jump": _jump,
    "fall": fall,
    "walk_in_place": _walk_in_place,
    "boxing": _boxing,
    "lie": lie,
}
"""Activities of the actors, by name."""


class Traits(TypedDict, total=False):
    """Size and manner of an actor; `synthetic_motion` says what each trait means."""

    duration_s: float
    height_m: float
    build: float
    tempo: float
    side: str
    style: str
    amplitude: float
    rate_hz: float
    take: int


@dataclass(frozen=True, kw_only=True)
class _Chosen:
    """Traits of an actor, those that are not given by their defaults."""

    duration_s: Annotated[float, Limits(1e-6, 3600.0)] = 3.0
    height_m: Annotated[float, Limits(0.8, 2.5)] = 1.75
    build: Annotated[float, Limits(0.4, 2.5)] = 1.0
    tempo: Annotated[float, Limits(0.4, 2.0)] = 1.0
    amplitude: Annotated[float, Limits(0.3, 1.25)] = 1.0
    rate_hz: Annotated[float, Limits(30.0, 10_000.0)] = 120.0
    side: Literal["left", "right"] = "left"
    style: Any = ""
    take: Annotated[int, Limits(0, 2**63, "it must be a whole number, zero or more")] = 0


def synthetic_motion(activity: str, seed: int = 0, **traits: Unpack[Traits]) -> Motion:
    """Make a synthetic actor that faces the radar (-x), on the floor z = 0.

    Joints move along minimum-jerk and harmonic curves (C2), feet do not move while they carry and
    never sink below the floor, jumps fall freely. A walk of up to 4.2 m goes straight; a longer one
    turns round within 1.5 m of the middle. Who stands sways by millimetres; who bends or squats
    keeps the centre of mass over the feet (`rtradar.motion.synthetic.on_the_spot`). All but walks
    repeat with short rests.

    Parameters
    ----------
    activity : str
        What the person does, one of `ACTIVITIES`. Traits may follow as text, as in
        ``"walk,tempo=0.9,side=right"``.
    seed : int
        Number of the subject, whose way of moving is drawn from it: phase, tempo, amplitude,
        unevenness of the sides, and the traits of each activity, such as how much the hips turn.
    **traits
        Traits of the actor by name; each may be left out.

        - ``duration_s``: how long the actor moves [s]; 3.
        - ``height_m``: standing height [m], which segment lengths follow (Drillis and Contini, see
          `rtradar.motion.synthetic.figure`); 1.75.
        - ``build``: thickness relative to a normal person of that height; 1.
        - ``tempo``: speed of the movement; 1 is a walk of about 1.1 m/s. A fall takes its own time.
        - ``side``: side of the leg or hand that strikes, of the foot that steps first, or of the
          lame leg, "left" or "right"; left.
        - ``style``: one of the `STYLES` of the activity; by default the subject's own.
        - ``amplitude``: factor of step length, kick height, extension of the arm, width of the
          jumps and sway; 1.
        - ``rate_hz``: number of frames per second of the result [Hz]; 120.
        - ``take``: number of the take; another take of the same subject begins elsewhere in the
          movement, and has its strikes in another order; 0.

    Returns
    -------
    Motion
        Motion of ``duration_s`` at ``rate_hz`` in world axes, not yet placed before a radar.

    Raises
    ------
    InputError
        Where an activity is unknown or a value out of range.
    """
    asked = activity
    activity, chosen = _checked(asked, traits)
    subject, height_m = _subject(activity, seed, chosen), chosen.height_m
    duration_s, rate_hz = chosen.duration_s, chosen.rate_hz
    # Poses are made twice: how far down all must come is not known before the last, and too many
    # would have to be kept.
    poses_at = ACTIVITIES[activity](duration_s, subject)
    times = np.arange(math.ceil(duration_s * rate_hz - 1e-9) + 1) / rate_hz
    down = [0.0, 0.0, max(lowering(poses_at(some), height_m) for (some,) in in_blocks(times))]
    roots, rotated = FileBackedRows(), FileBackedRows()
    for (some,) in in_blocks(times):
        pose = poses_at(some)
        pose = dataclasses.replace(pose, root=pose.root - down)
        roots.append(pose.root)
        rotated.append(rotations(pose, height_m))
    # Rotations and the bones of the figure make the skeleton.
    bones = offsets(height_m)
    motion = Motion(
        name=f"synthetic:{activity}" + (f",style={subject.style}" if subject.style else ""),
        joints=NODES,
        parents=NODE_PARENTS,
        offsets=np.array([bones[node] for node in NODES]),
        root_positions=roots.rows(),
        rotations=rotated.rows(),
        rate_hz=rate_hz,
        length_s=duration_s,
        girth=chosen.build * height_m / 1.75,
    )
    # The figure faces +x, and a Motion the radar at -x.
    own = {name: value for name, value in traits.items() if name != "duration_s"}
    keys = {"motion": f"{SYNTHETIC}{asked}", "seed": seed, "duration_s": duration_s}
    return motion.turned(math.pi).made_from(Source(keys | ({"traits": own} if own else {}), {}))


def _checked(asked: str, traits: Traits) -> tuple[str, _Chosen]:
    """The activity, and all its traits."""
    # Traits follow the activity in its name, as in "walk,tempo=1.1", or are given as keywords,
    # which overrule those in the name.
    check_activity(asked)
    activity, *texts = asked.split(",")
    names = [key for key in rules_of(_Chosen) if key not in ("duration_s", "rate_hz")]
    given: dict[str, Any] = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in names or not value:
            raise InputError(
                f"{asked!r}: {text!r} is no NAME=VALUE; allowed names are {', '.join(names)}"
            )
        given[name] = _parsed(value)
    if others := traits.keys() - rules_of(_Chosen):
        raise TypeError(f"synthetic_motion: {min(others)!r} is no trait; {', '.join(names)} are")
    every: dict[str, Any] = {**given, **traits}
    chosen = _Chosen(**every)
    check_fields(chosen, f"synthetic {activity}: ")
    styles = STYLES.get(activity, ())
    if chosen.style not in ("", *styles):
        allowed = ", ".join(styles) or "none"
        raise InputError(f"style {brief(chosen.style)} of {activity}; allowed are {allowed}")
    return activity, chosen


def _parsed(value: str) -> float | str:
    for kind in (int, float):
        with suppress(ValueError):
            return kind(value)
    return value


def _subject(activity: str, seed: int, chosen: _Chosen) -> Subject:
    """Draw a subject: 3 % of spread (cut at two sigma) on tempo, amplitude and each side."""
    # The same seed is another subject in another activity. A take changes the phase alone.
    own = check_seed("", seed), list(ACTIVITIES).index(activity)
    rng = np.random.default_rng(stream(*own))
    spread = (1 + 0.03 * np.clip(rng.standard_normal(4), -2.0, 2.0)).tolist()
    phase, manner = float(rng.uniform()), int(rng.integers(2**32))
    if chosen.take:
        phase = float(np.random.default_rng(stream(*own, int(chosen.take))).uniform())
    return Subject(
        height_m=chosen.height_m,
        side=chosen.side[0],
        tempo=chosen.tempo * spread[0],
        amplitude=chosen.amplitude * spread[1],
        phase=phase,
        uneven={"l": spread[2], "r": spread[3]},
        style=chosen.style,
        manner=manner,
    )
