"""What is inside of what is solid: body parts in walls, furniture and objects, and objects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.errors import InputError
from rtradar.scatter.validity import Limit
from rtradar.scene import Furniture, Object, Scene, Wall
from rtradar.scene.mesh_files import Triangles

REFUSED_FRACTION = 0.05
"""A part that sends more than this of the person's echo power must not be inside a wall."""

_PELVIS = ("left hip", "right hip", "lower torso")

_CONTACT_M = 0.02
"""Depth up to which the centre of a part touches a wall [m]: hands and feet in recordings do."""

_MESH_STEP = 10
"""Instants to one at which furniture and objects are tested: a mesh takes long."""

_INSTANTS = 10
"""Instants of a capture at which objects are looked for in one another."""

_PLACES = 50
"""Places of an object that are looked for, at most."""

_SHRUNK = 0.99
"""Size of an object whose places are looked for: what touches is not inside."""

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Inside:
    """Record of which parts were inside walls, furniture and objects over a capture."""

    def __init__(self, scene: Scene, part_names: tuple[str, ...], owner: Indices) -> None:
        self._scene, self._names, self._owner = scene, part_names, owner
        pieces = (*scene.furniture, *scene.objects)
        self._solids = [one for piece in pieces if (one := _Solid(piece)).mesh.closed]
        self._still = sum(one.moving is None for one in self._solids)
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
        at = np.arange(-self._instant % _MESH_STEP, len(times), _MESH_STEP)
        self._instant += len(times)
        for number, solid in enumerate(self._solids, start=len(self._scene.walls)):
            held = np.zeros(power.shape, dtype=bool)
            held[at] = solid.holds(times[at], poses.centres[at])
            self._keep(number, times, held, power * _MESH_STEP)

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
        still = walls + self._still
        of_owner = np.bincount(self._owner, weights=part_power)[self._owner]
        large = part_power > REFUSED_FRACTION * of_owner
        for number in range(walls):
            if (parts := np.flatnonzero(large & inside[number])).size:
                self._refuse(number, parts.tolist())
        limits = []
        for name, what, chosen in (
            ("inside_wall", "parts inside a wall", slice(walls)),
            ("inside_furniture", "parts inside furniture", slice(walls, still)),
            ("inside_object", "parts inside objects that move", slice(still, None)),
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
        return [wall.name for wall in self._scene.walls] + [one.name for one in self._solids]

    def _refuse(self, number: int, parts: list[int]) -> None:
        first_s = self._first_s[number]
        part = min(parts, key=lambda part: float(first_s[part]))
        raise InputError(
            f"scene '{self._scene.name}': at {first_s[part]:.2f} s the {self._names[part]} of the "
            f"person is inside wall '{self._thing_names()[number]}'; move the person (position_m, "
            "heading_deg) or the wall, or choose another interval (--start, --duration)"
        )


class _Solid:
    """Furniture or an object by its mesh, and its ``moving`` pose if it has one."""

    def __init__(self, piece: Furniture) -> None:
        self.name = piece.name
        self.moving = piece if isinstance(piece, Object) else None
        self.mesh: Triangles = self.moving.shape if self.moving else piece.triangles()

    def holds(self, times: Array, points: Array) -> NDArray[np.bool_]:
        """Tell which of the points (time, point, 3) [m] are inside at their times (time,) [s]."""
        if self.moving is not None:
            rotation, place = self.moving.pose(times)
            points = np.einsum("tji,tpj->tpi", rotation, points - place[:, None])
        return self.mesh.holds(points)

    def places(self, times: Array) -> Array:
        """Return places (time, place, 3) of the body of an object [m]."""
        assert self.moving is not None
        found = np.concatenate([self.mesh.vertices, self.mesh.corners.mean(axis=1)])
        found = found[:: -(-len(found) // _PLACES)]
        middle = (found.min(axis=0) + found.max(axis=0)) / 2
        rotation, place = self.moving.pose(times)
        shrunk = middle + _SHRUNK * (found - middle)
        return np.einsum("tij,pj->tpi", rotation, shrunk) + place[:, None]


def objects_inside(scene: Scene, duration_s: float) -> list[Limit]:
    """Return a limit if objects are inside one another or furniture during a capture."""
    times = np.linspace(0.0, duration_s, _INSTANTS)
    solids = [_Solid(piece) for piece in (*scene.furniture, *scene.objects)]
    said, share = [], np.zeros(_INSTANTS, dtype=bool)
    for one in solids:
        if one.moving is None:
            continue
        places = one.places(times)
        for other in solids:
            if other is not one and other.mesh.closed:
                held = other.holds(times, places).any(axis=1)
                share |= held
                if held.any():
                    said.append(f"'{one.name}' in '{other.name}' from {times[held][0]:.2f} s")
    if not said:
        return []
    message = "instants at which objects are inside one another, each taken as if it were alone: "
    return [Limit("objects_overlap", float(share.mean()), message + ", ".join(said))]


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
