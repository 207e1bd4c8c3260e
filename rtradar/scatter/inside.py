"""What is inside of what: body parts in walls, furniture, objects and other people, and objects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.errors import InputError
from rtradar.scatter.validity import Limit
from rtradar.scene import Furniture, Object, Scene, Wall
from rtradar.scene.mesh_files import Triangles

REFUSED_FRACTION = 0.05
"""A part that sends more than this of the person's echo power must not be inside a wall."""

_PELVIS = ("left hip", "right hip", "lower torso")
"""Parts that must not be inside a wall."""

_TRUNK = (*_PELVIS, "middle torso", "upper torso", "neck", "head")
"""Parts that must not be inside another person; hands and feet may touch."""

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
Bools = NDArray[np.bool_]


class Inside:
    """Record of which parts were inside what else over a capture.

    Things are the walls of the scene, closed furniture, closed objects, and people, in this order.
    """

    def __init__(self, scene: Scene, body: Body) -> None:
        self._scene, self._names, self._owner = scene, body.part_names, body.owner
        self._trunk, self._pelvis = (
            np.array([name.endswith(ends) for name in body.part_names], dtype=bool)
            for ends in (_TRUNK, _PELVIS)
        )
        pieces = (*scene.furniture, *scene.objects)
        self._solids = [one for piece in pieces if (one := _Solid(piece)).mesh.closed]
        # Who is alone is inside nobody else.
        people = body.names if len(body.names) > 1 else ()
        every = [wall.name for wall in scene.walls], [one.name for one in self._solids], people
        self._things = [name for names in every for name in names]
        self._people = range(len(self._things) - len(people), len(self._things))
        self._first_s = np.full((len(self._things), len(self._names)), np.inf)
        self._power = np.zeros(self._first_s.shape)
        self._instant = 0

    def look(self, times: Array, poses: Poses, power: Array) -> None:
        """Test the next instants.

        Given are the times (time,) [s], the body's poses, and its echo power (time, part) [m^2]. An
        `InputError` is raised if the pelvis is inside a wall, or someone's trunk in another's.
        """
        walls = len(self._scene.walls)
        for number, wall in enumerate(self._scene.walls):
            self._keep(number, times, _inside_wall(wall, poses), power)
            self._refuse(number, self._pelvis)
        at = np.arange(-self._instant % _MESH_STEP, len(times), _MESH_STEP)
        self._instant += len(times)
        for number, solid in enumerate(self._solids, start=walls):
            held = np.zeros(power.shape, dtype=bool)
            held[at] = solid.holds(times[at], poses.centres[at])
            self._keep(number, times, held, power * _MESH_STEP)
        counted = np.zeros(power.shape, dtype=bool)
        for person, number in enumerate(self._people):
            held = self._inside_person(person, times, poses)
            # Who is inside of two others is inside once.
            self._keep(number, times, held, power * ~counted)
            counted |= held

    def _keep(self, number: int, times: Array, held: Bools, power: Array) -> None:
        first = np.where(held, times[:, None], np.inf).min(axis=0, initial=np.inf)
        self._first_s[number] = np.minimum(self._first_s[number], first)
        self._power[number] += (power * held).sum(axis=0)

    def _inside_person(self, person: int, times: Array, poses: Poses) -> Bools:
        """Which parts (time, part) of others have their centres inside a person."""
        own, other = self._owner == person, np.flatnonzero(self._owner != person)
        away = poses.centres[:, other, None] - poses.centres[:, None, own]
        local = np.einsum("tqji,tpqj->tpqi", poses.frames[:, own], away)
        within = ((local / poses.semi_axes[own]) ** 2).sum(axis=-1) < 1
        bad = (within & self._trunk[own]).any(axis=-1) & self._trunk[other]
        if bad.any():
            time, part = np.argwhere(bad)[0]
            raise InputError(
                f"at {times[time]:.2f} s the {self._names[other[part]]} is inside "
                f"'{self._things[self._people[person]]}'; move one of them (position_m, --at), or "
                "choose another interval (--start, --duration)"
            )
        held = np.zeros(poses.centres.shape[:2], dtype=bool)
        held[:, other] = within.any(axis=-1)
        return held

    def found(self, part_power: Array) -> list[tuple[str, float, str]]:
        """Return the name, power while inside [m^2] and message of each limit.

        ``part_power (part,)`` is the echo power of each part, over all instants [m^2]. An
        `InputError` is raised if a part with more than 5 % of that of its owner was inside a wall.
        """
        of_owner = np.bincount(self._owner, weights=part_power)[self._owner]
        walls = len(self._scene.walls)
        for number in range(walls):
            self._refuse(number, part_power > REFUSED_FRACTION * of_owner)
        objects = walls + sum(one.moving is None for one in self._solids)
        people = len(self._things) - len(self._people)
        untouched = "taken as if it were not there"
        limits = []
        for name, what, first, last in (
            ("inside_wall", f"a wall, {untouched}", 0, walls),
            ("inside_furniture", f"furniture, {untouched}", walls, objects),
            ("inside_object", f"objects that move, {untouched}", objects, people),
            ("inside_person", "another person, in whom they are hidden", people, None),
        ):
            first_s, names = self._first_s[first:last], self._things[first:last]
            said = [
                f"the {self._names[part]} in '{names[number]}' from {first_s[number, part]:.2f} s"
                for number, part in np.argwhere(np.isfinite(first_s))
            ]
            if said:
                power = float(self._power[first:last].sum())
                message = f"echo power from parts inside {what}: {', '.join(said)}"
                limits.append((name, power, message))
        return limits

    def _refuse(self, number: int, parts: Bools) -> None:
        """Raise InputError if any of some parts (part,) was inside a wall."""
        first_s = self._first_s[number]
        found = np.flatnonzero(parts & np.isfinite(first_s))
        if len(found):
            part = int(found[first_s[found].argmin()])
            raise InputError(
                f"scene '{self._scene.name}': at {first_s[part]:.2f} s the {self._names[part]} of "
                f"the person is inside wall '{self._things[number]}'; move the person (position_m, "
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
