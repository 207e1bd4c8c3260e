"""Whether a person is in what is solid: body parts inside walls and furniture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.errors import InputError
from rtradar.scene import Scene, Wall

REFUSED_FRACTION = 0.05
"""A part that sends more than this of the person's echo power must not be inside a wall."""

_PELVIS = ("left hip", "right hip", "lower torso")

_CONTACT_M = 0.02
"""Depth up to which the centre of a part touches a wall [m]: hands and feet in recordings do."""

_FURNITURE_STEP = 10
"""Instants to one at which furniture is tested: a mesh takes long."""

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Inside:
    """Record of which parts were inside walls and furniture over a capture."""

    def __init__(self, scene: Scene, part_names: tuple[str, ...], owner: Indices) -> None:
        self._scene, self._names, self._owner = scene, part_names, owner
        self._solids = [
            (piece.name, mesh) for piece in scene.furniture if (mesh := piece.triangles()).closed
        ]
        things = len(scene.walls) + len(self._solids)
        self._first_s = np.full((things, len(part_names)), np.inf)
        self._power = np.zeros((things, len(part_names)))
        self._instant = 0

    def look(self, times: Array, poses: Poses, power: Array) -> None:
        """Test the next instants.

        Given are the times (time,) [s], the body's poses, and its echo power (time, part) [m^2]. An
        `InputError` is raised if the pelvis is inside a wall.
        """
        pelvis = [part for part, name in enumerate(self._names) if name.endswith(_PELVIS)]
        for number, wall in enumerate(self._scene.walls):
            self._keep(number, times, _inside_wall(wall, poses), power)
            found = [part for part in pelvis if np.isfinite(self._first_s[number, part])]
            if found:
                self._refuse(number, found)
        at = np.arange(-self._instant % _FURNITURE_STEP, len(times), _FURNITURE_STEP)
        self._instant += len(times)
        for number, (_, mesh) in enumerate(self._solids, start=len(self._scene.walls)):
            held = np.zeros(power.shape, dtype=bool)
            held[at] = mesh.holds(poses.centres[at])
            self._keep(number, times, held, power * _FURNITURE_STEP)

    def _keep(self, number: int, times: Array, held: NDArray[np.bool_], power: Array) -> None:
        first = np.where(held, times[:, None], np.inf).min(axis=0, initial=np.inf)
        self._first_s[number] = np.minimum(self._first_s[number], first)
        self._power[number] += (power * held).sum(axis=0)

    def found(self, part_power: Array) -> list[tuple[str, float, str]]:
        """Return the name, power while inside [m^2] and message of each limit.

        ``part_power (part,)`` is the echo power of each part, over all instants [m^2]. An
        `InputError` is raised if a part with more than 5 % of that of its owner was inside a wall.
        """
        walls, inside = len(self._scene.walls), np.isfinite(self._first_s)
        of_owner = np.bincount(self._owner, weights=part_power)[self._owner]
        large = part_power > REFUSED_FRACTION * of_owner
        for number in range(walls):
            if (parts := np.flatnonzero(large & inside[number])).size:
                self._refuse(number, parts.tolist())
        limits = []
        for name, what, chosen in (
            ("inside_wall", "parts inside a wall", slice(walls)),
            ("inside_furniture", "parts inside furniture", slice(walls, None)),
        ):
            names = self._thing_names()[chosen]
            said = [
                f"the {self._names[part]} in '{names[number]}' from "
                f"{self._first_s[chosen][number, part]:.2f} s"
                for number, part in np.argwhere(inside[chosen])
            ]
            if said:
                message = f"echo power from {what}, taken as if it were not there: "
                power = float(self._power[chosen].sum())
                limits.append((name, power, message + ", ".join(said)))
        return limits

    def _thing_names(self) -> list[str]:
        return [*(wall.name for wall in self._scene.walls), *(name for name, _ in self._solids)]

    def _refuse(self, number: int, parts: list[int]) -> None:
        first_s = self._first_s[number]
        part = min(parts, key=lambda part: float(first_s[part]))
        raise InputError(
            f"scene '{self._scene.name}': at {first_s[part]:.2f} s the {self._names[part]} of the "
            f"person is inside wall '{self._thing_names()[number]}'; move the person (position_m, "
            "heading_deg) or the wall, or choose another interval (--start, --duration)"
        )


def _inside_wall(wall: Wall, poses: Poses) -> NDArray[np.bool_]:
    """Which parts (time, part) are inside: the centre is in the slab, or the slab is thinner.

    A thin slab counts where it runs through the part, of half its size.
    """
    depth = wall.depth_m(poses.centres)
    # Half the extent of an ellipsoid along the normal.
    along = np.einsum("tpij,i->tpj", poses.frames, wall.normal) * poses.semi_axes
    core = np.linalg.norm(along, axis=-1) / 2
    within = (depth >= _CONTACT_M) & (depth <= wall.thickness_m)
    return np.asarray(within | ((depth - core <= 0) & (depth + core >= wall.thickness_m)))
