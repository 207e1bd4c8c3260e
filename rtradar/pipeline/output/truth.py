"""What is true of each person at the times of a run's frames: place, speed and joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.motion.skeleton import NODES

TRUTH = {
    "person_position": (("time", "person", "coordinate"), "m", "root of each person, world"),
    "person_speed": (("time", "person"), "m/s", "speed of the root of each person"),
    "joints": (("time", "person", "joint", "coordinate"), "m", "joints of each person, world"),
}
"""Arrays that `truth_of` gives, with their axes, units and meanings."""

_STEP_S = 0.01


def truth_axes(body: Body) -> dict[str, tuple[str, ...]]:
    """Return the names along the axes of `TRUTH` that are no numbers."""
    return {"person": body.names, "joint": NODES, "coordinate": ("x", "y", "z")}


def truth_of(body: Body, times: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return the arrays of `TRUTH` at times (time,) [s].

    The speed is that over 10 ms, and 0 of a person who rests in the last pose.
    """
    joints, speeds = [], []
    for person in body.people:
        end = person.duration_s
        joints.append(person.motion.at(np.minimum(times, end))[0])
        ends = np.clip([times - _STEP_S / 2, times + _STEP_S / 2], 0.0, end)
        before, after = (person.motion.at(instants)[0][:, 0] for instants in ends)
        apart_s, away = ends[1] - ends[0], np.linalg.norm(after - before, axis=1)
        speeds.append(np.divide(away, apart_s, out=np.zeros_like(away), where=apart_s > 0))
    together = np.stack(joints, axis=1)
    return {
        "person_position": together[:, :, 0],
        "person_speed": np.stack(speeds, axis=1),
        "joints": together,
    }
