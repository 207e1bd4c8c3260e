"""Whether people are inside one another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.errors import InputError

_TRUNK = ("left hip", "right hip", "lower torso", "middle torso", "upper torso", "neck", "head")
"""Parts that must not be inside another person; hands and feet may touch."""

Array = NDArray[np.float64]


class InsidePeople:
    """Record of which parts were inside other people over a capture."""

    def __init__(self, body: Body) -> None:
        self._names, self._owner, self._people = body.part_names, body.owner, body.names
        self._trunk = np.array([name.endswith(_TRUNK) for name in body.part_names])
        self._first_s = np.full((len(body.part_names), len(body.names)), np.inf)
        self._power = 0.0

    def look(self, times: Array, poses: Poses, power: Array) -> None:
        """Test the next instants.

        Given are the times (time,) [s], the poses, and the echo power (time, part) [m^2]. An
        `InputError` is raised if the centre of a part of someone's trunk is inside another's.
        """
        if len(self._people) < 2:
            return
        held = np.zeros((*power.shape, len(self._people)), dtype=bool)
        for person in range(len(self._people)):
            own, other = self._owner == person, np.flatnonzero(self._owner != person)
            away = poses.centres[:, other, None] - poses.centres[:, None, own]
            local = np.einsum("tqji,tpqj->tpqi", poses.frames[:, own], away)
            within = ((local / poses.semi_axes[own]) ** 2).sum(axis=-1) < 1
            held[:, other, person] = within.any(axis=-1)
            bad = within[:, self._trunk[other]][..., self._trunk[own]].any(axis=-1)
            if bad.any():
                time, part = np.argwhere(bad)[0]
                self._refuse(times[time], int(other[self._trunk[other]][part]), person)
        first = np.where(held, times[:, None, None], np.inf).min(axis=0, initial=np.inf)
        self._first_s = np.minimum(self._first_s, first)
        self._power += float((power * held.any(axis=-1)).sum())

    def found(self) -> list[tuple[str, float, str]]:
        """Return the name, power while inside [m^2] and message of the limit, if there is one."""
        said = [
            f"the {self._names[part]} in '{self._people[person]}' from "
            f"{self._first_s[part, person]:.2f} s"
            for part, person in np.argwhere(np.isfinite(self._first_s))
        ]
        if not said:
            return []
        message = "echo power from parts inside another person, in whom they are hidden: "
        return [("inside_person", self._power, message + ", ".join(said))]

    def _refuse(self, time_s: float, part: int, person: int) -> None:
        raise InputError(
            f"at {time_s:.2f} s the {self._names[part]} is inside '{self._people[person]}'; move "
            "one of them (position_m, --at), or choose another interval (--start, --duration)"
        )
