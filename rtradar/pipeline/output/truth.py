"""What is true of each person and each part at the times of a run's frames."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.motion.skeleton import NODES
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.output.echo_table import EchoTable

TRUTH = {
    "person_position": (("time", "person", "coordinate"), "m", "root of each person, world"),
    "person_speed": (("time", "person"), "m/s", "speed of the root of each person"),
    "joints": (("time", "person", "joint", "coordinate"), "m", "joints of each person, world"),
}
"""Arrays that `truth_of` gives, with their axes, units and meanings."""

OF_PARTS = {
    "range_m": (np.float64, "m", "half the length of the direct echo, seen or not"),
    "range_rate_mps": (np.float64, "m/s", "rate of that range, positive receding"),
    "power_m2": (np.float64, "m2", "power of the direct echo, mean over the receivers"),
    "visible": (np.uint8, "1", "1 where any of the direct echo is seen"),
}
"""Arrays (time, part) of the group ``truth``: their types, units and meanings."""

_STEP_S = 0.01


class Parts(NamedTuple):
    """The parts of all people and then the objects: ``names`` and the number of the ``person``.

    The person of an object is -1.
    """

    names: tuple[str, ...]
    person: NDArray[np.int64]


def parts_of(capture: Capture) -> Parts:
    """Return the parts of everyone and everything that moves in a capture."""
    body, objects = capture.body, capture.scene.objects
    names = *body.part_names, *(one.name for one in objects)
    return Parts(names, np.append(body.owner, np.full(len(objects), -1)))


def truth_of_parts(table: EchoTable, start_cycle: int, time_s: float) -> dict[str, NDArray[Any]]:
    """Return the arrays (part,) of `OF_PARTS` at the middle of a frame, which is at ``time_s``."""
    look, n_parts = table.middle(start_cycle), len(parts_of(table.capture).names)
    direct = np.flatnonzero((look.bounces == 1) & (look.path == 0))
    part, power = look.part[direct], look.power_m2[direct]
    total = np.bincount(part, power, n_parts)
    weight = np.where(total[part] > 0, power, 1.0)
    sums = np.bincount(part, weight, n_parts)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        added = np.bincount(part, weight * values[direct], n_parts)
        return np.divide(added, sums, out=np.full(n_parts, np.nan), where=sums > 0)

    rate = mean(look.rate_mps)
    range_m = mean(look.range_m) + (time_s - look.time_s) * rate
    found = {"range_m": range_m, "range_rate_mps": rate, "power_m2": total, "visible": total > 0}
    return {name: own.astype(OF_PARTS[name][0]) for name, own in found.items()}


def truth_axes(body: Body) -> dict[str, tuple[str, ...]]:
    """Return the names along the axes of `TRUTH` that are no numbers."""
    return {"person": body.names, "joint": NODES, "coordinate": ("x", "y", "z")}


def truth_of(body: Body, times: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return the arrays of `TRUTH` at times (time,) [s].

    The speed is that over 10 ms, and 0 of a person who rests in the last pose.
    """
    joints = np.empty((len(times), len(body.names), len(NODES), 3))
    speeds = np.empty(joints.shape[:2])
    for number, person in enumerate(body.people):
        end = person.duration_s
        joints[:, number] = person.motion.at(np.minimum(times, end))[0]
        ends = np.clip([times - _STEP_S / 2, times + _STEP_S / 2], 0.0, end)
        before, after = (person.motion.at(instants)[0][:, 0] for instants in ends)
        apart_s, away = ends[1] - ends[0], np.linalg.norm(after - before, axis=1)
        speeds[:, number] = np.divide(away, apart_s, out=np.zeros_like(away), where=apart_s > 0)
    return {"person_position": joints[:, :, 0], "person_speed": speeds, "joints": joints}
