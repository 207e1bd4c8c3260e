"""Whether a person stands in what is solid: parts inside walls and furniture, looked at block by block."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.errors import InputError
from rtradar.scene import Scene, Wall

REFUSED_SHARE = 0.05
"""A part that sends more than this of the person's echo power must not be inside a wall."""

_PELVIS = ("left hip", "right hip", "lower torso")

_CONTACT_M = 0.02
"""Recordings set hands and feet on the floor to within this: the centre of a part so little behind a front touches the wall."""

_FURNITURE_STEP = 10
"""Of the instants, this many to one at which furniture is looked at: a mesh takes long."""

Array = NDArray[np.float64]


class Inside:
    """Takes instants of a capture one after the other, and keeps which parts were inside what.

    Parameters
    ----------
    scene : Scene
    part_names : tuple of str
    """

    def __init__(self, scene: Scene, part_names: tuple[str, ...]) -> None:
        self._scene, self._names = scene, part_names
        self._solids = [
            (piece.name, mesh) for piece in scene.furniture if (mesh := piece.triangles()).closed
        ]
        things = len(scene.walls) + len(self._solids)
        self._first_s = np.full((things, len(part_names)), np.inf)
        self._power = np.zeros((things, len(part_names)))
        self._instant = 0

    def look(self, times: Array, poses: Poses, power: Array) -> None:
        """Take the next instants.

        Parameters
        ----------
        times : (time,) float64
            [s].
        poses : Poses
            Of the body at these times.
        power : (time, part) float64
            Echo power of its parts [m^2].

        Raises
        ------
        InputError
            Where the pelvis is inside a wall.
        """
        for number, wall in enumerate(self._scene.walls):
            self._keep(number, times, _inside_wall(wall, poses), power)
            pelvis = [part for part, name in enumerate(self._names) if name in _PELVIS]
            found = [part for part in pelvis if np.isfinite(self._first_s[number, part])]
            if found:
                raise self._refused(
                    number, min(found, key=lambda part: float(self._first_s[number, part]))
                )
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
        """What a run tells of it: name, power while inside [m^2] and message of each limit.

        Parameters
        ----------
        part_power : (part,) float64
            Echo power of each part, over all instants [m^2].

        Returns
        -------
        list of tuple
            None where nothing was inside.

        Raises
        ------
        InputError
            Where a part with more than 5 % of the echo power was inside a wall.
        """
        walls = len(self._scene.walls)
        large = part_power > REFUSED_SHARE * part_power.sum()
        for number in range(walls):
            parts = np.flatnonzero(large & np.isfinite(self._first_s[number]))
            if len(parts):
                raise self._refused(number, int(parts[np.argmin(self._first_s[number, parts])]))
        limits = []
        for name, what, chosen in (
            ("inside_wall", "parts inside a wall", range(walls)),
            ("inside_furniture", "parts inside furniture", range(walls, len(self._first_s))),
        ):
            told = [
                self._told(number, int(part))
                for number in chosen
                for part in np.flatnonzero(np.isfinite(self._first_s[number]))
            ]
            if told:
                message = (
                    f"echo power from {what}, taken as if it were not there: {', '.join(told)}"
                )
                limits.append((name, float(self._power[chosen].sum()), message))
        return limits

    def _thing(self, number: int) -> str:
        walls = self._scene.walls
        return walls[number].name if number < len(walls) else self._solids[number - len(walls)][0]

    def _told(self, number: int, part: int) -> str:
        return f"the {self._names[part]} in '{self._thing(number)}' from {self._first_s[number, part]:.2f} s"

    def _refused(self, number: int, part: int) -> InputError:
        return InputError(
            f"scene '{self._scene.name}': at {self._first_s[number, part]:.2f} s the {self._names[part]} of the person is inside "
            f"wall '{self._thing(number)}'; move the person (position_m, heading_deg) or the wall, or choose another interval "
            "(--start, --duration)"
        )


def _inside_wall(wall: Wall, poses: Poses) -> NDArray[np.bool_]:
    """Which parts (time, part) are: the centre is in the slab, or the slab runs through the part, half its size.

    The second is for slabs thinner than a part.
    """
    depth = wall.depth_m(poses.centres)
    # Half the extent of an ellipsoid along the normal.
    along = np.einsum("tpij,i->tpj", poses.frames, wall.normal) * poses.semi_axes
    core = np.linalg.norm(along, axis=-1) / 2
    within = (depth >= _CONTACT_M) & (depth <= wall.thickness_m)
    return np.asarray(within | ((depth - core <= 0) & (depth + core >= wall.thickness_m)))
