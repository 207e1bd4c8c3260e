"""`Person`: who moves where; `Bodies`: several people as one moving set of ellipsoids."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import ArrayLike

from rtradar.body.body import Body, Poses
from rtradar.body.human import HumanMesh
from rtradar.conventions import PERSON_LIMITS
from rtradar.errors import InputError
from rtradar.motion import Motion, place
from rtradar.motion.placement import keep_place
from rtradar.settings import Breathing, RunSettings
from rtradar.system.checks import brief, check_number
from rtradar.system.fields import Limits, check_fields

if TYPE_CHECKING:
    import trimesh

BODY_KINDS = ("ellipsoids", "mesh")
"""Bodies that a person may have."""

PLACEMENTS = ("standard", "recorded")
"""Where a person may be put: in the middle of their interval and towards -x, or as recorded."""


@dataclass(frozen=True, eq=False)
class Person:
    """A person in a scene: what they do, where, and with which body.

    Parameters
    ----------
    motion : Motion
        Recording or synthetic motion, not yet placed.
    position_m : tuple of float
        Mean position of the person over the interval, world x and y [m].
    heading_deg : float
        Rotation about the vertical, anticlockwise seen from above [degree]. At 0 a walk goes along
        -x, and everything else faces -x (`rtradar.motion.place`).
    placement : {"standard", "recorded"}
        Whether ``position_m`` and ``heading_deg`` say where the person is, or move and turn the
        recording about the origin of its own coordinates, so that people who were recorded together
        keep their places.
    start_s : float
        Start of the person's interval in their recording [s]. All people of a capture begin theirs
        at the same time; one whose recording ends early rests in its last pose.
    body : {"ellipsoids", "mesh"}
        Body of the person: 21 ellipsoids, or a mesh of human shape.
    material : str, optional
        Material of the surface, as the option ``body_material`` of a run, which holds for those who
        have none of their own.
    breathing : Breathing, optional
        Breath of the person, as the option ``breathing`` of a run, which holds for those who have
        none of their own.

    Raises
    ------
    InputError
        Where the motion is none, or another value has no meaning.

    Examples
    --------
    >>> import rtradar as rt
    >>> walk = rt.synthetic_motion("walk", duration_s=0.5)
    >>> rt.Person(walk, position_m=(0.5, -1), heading_deg=90).position_m
    (0.5, -1.0)
    """

    motion: Motion
    position_m: Annotated[tuple[float, float], Limits(*PERSON_LIMITS["position_m"])] = (0.0, 0.0)
    heading_deg: Annotated[float, Limits(*PERSON_LIMITS["heading_deg"])] = 0.0
    start_s: float = 0.0
    body: Annotated[str, Limits(allowed=BODY_KINDS)] = "ellipsoids"
    material: str | None = None
    breathing: Breathing | None = None
    placement: Annotated[str, Limits(allowed=PLACEMENTS)] = "standard"

    def __post_init__(self) -> None:
        given: object = self.motion
        if not isinstance(given, Motion):
            kind = type(given).__name__
            raise InputError(f"Person: motion is a {kind}; give what rt.load_motion returns")
        where = f"person '{self.motion.name}'"
        check_number(where, "start_s", self.start_s, 0.0, self.motion.duration_s)
        check_fields(self, f"{where}: ")

    def trimesh(self, time_s: float = 0.0, divisions: int = 0) -> trimesh.Trimesh:
        """Pose a mesh of human shape where the person is, whichever ``body`` they have.

        Parameters
        ----------
        time_s : float
            Time since ``start_s`` of their recording [s].
        divisions : int
            Number of times that each triangle is divided in four, 0 to 4.

        Returns
        -------
        trimesh.Trimesh
            Closed, world [m]; `rtradar.scattering_length` takes it.

        Raises
        ------
        InputError
            Where the package `anny` is missing, or the time is outside the recording.

        Examples
        --------
        >>> import rtradar as rt
        >>> person = rt.Person(rt.synthetic_motion("walk"), position_m=(0, 1))
        >>> person.trimesh(0.5).is_watertight  # doctest: +SKIP
        True
        """
        return HumanMesh(self.placed()).trimesh(time_s, divisions)

    def placed(
        self, start_s: float = 0.0, duration_s: float | None = None, heading_deg: float = 0.0
    ) -> Motion:
        """Put the person where they are.

        Parameters
        ----------
        start_s : float
            Start of the interval since ``start_s`` of their recording [s].
        duration_s : float, optional
            Its length [s]; to the end of the recording if left out.
        heading_deg : float
            Additional rotation [degree].

        Returns
        -------
        Motion

        Raises
        ------
        InputError
            Where the interval is not inside the recording.
        """
        # Cut out and turned first, then moved to their position.
        put = place if self.placement == "standard" else keep_place
        turn = heading_deg + self.heading_deg
        placed = put(self.motion, start_s + self.start_s, duration_s, turn)
        return placed.shifted([*self.position_m, 0.0])


class Bodies(Body):
    """Several people as one moving set of ellipsoids with one clock.

    The parts of one person come after those of another, and are named ``NAME: part``. Past the end
    of their motion a person rests in the last pose. Nobody has no parts.

    Parameters
    ----------
    people : sequence of Body
        The people, each with a motion that begins at 0; it may be empty.
    duration_s : float, optional
        Time for which the set is asked [s]; that of the shortest motion if left out.

    Raises
    ------
    InputError
        Where one is no `Body`, or there is nobody and no duration.
    """

    def __init__(self, people: Sequence[Body], duration_s: float | None = None) -> None:
        given: object = people
        listed = isinstance(given, Sequence) and all(isinstance(one, Body) for one in given)
        if not listed or (not people and duration_s is None):
            raise InputError(
                f"Bodies: people = {brief(given)}; it must be a list of one Body or more, such as "
                "Body.from_motion gives, or of nobody, for a given duration_s"
            )
        # The fields of a Body, without its constructor: these people have no common motion.
        names = distinct_names([person.motion.name for person in people])
        sizes = [len(person.part_names) for person in people]
        shortest = min((person.duration_s for person in people), default=0.0)
        vars(self).update(
            semi_axes=np.concatenate([np.empty((0, 3)), *(one.semi_axes for one in people)]),
            _people=tuple(people),
            names=names,
            part_names=tuple(
                f"{name}: {part}"
                for name, one in zip(names, people, strict=True)
                for part in one.part_names
            ),
            owner=np.repeat(np.arange(len(sizes)), np.array(sizes, np.int64)),
            materials=tuple(name for person in people for name in person.materials),
            duration_s=shortest if duration_s is None else duration_s,
        )

    _people: tuple[Body, ...]

    @property
    def people(self) -> tuple[Body, ...]:
        """The people, in the order in which they were given."""
        return self._people

    def at(self, times: ArrayLike) -> Poses:
        """Pose the ellipsoids of all people at any times from 0 to `duration_s`.

        Parameters
        ----------
        times : (time,) array_like
            Times since the start of the capture [s].

        Returns
        -------
        Poses

        Raises
        ------
        InputError
            Where a time is negative.
        """
        instants = np.asarray(times, dtype=np.float64)
        shape = len(instants), len(self.semi_axes), 3
        centres, frames = np.empty(shape), np.empty((*shape, 3))
        # Who has come to the end of their motion rests, and goes on breathing.
        for number, person in enumerate(self.people):
            own = self.owner == number
            moving = np.minimum(instants, person.duration_s)
            centres[:, own], frames[:, own], _ = person._posed(moving, instants)
        return Poses(centres, frames, self.semi_axes)


class OnePart(Body):
    """One part of a body, moving as it does with the rest, alone in the world.

    Parameters
    ----------
    body : Body
        Body of ellipsoids.
    part : int
        Number of the part.
    """

    def __init__(self, body: Body, part: int) -> None:
        own = slice(part, part + 1)
        vars(self).update(
            semi_axes=body.semi_axes[own],
            names=(body.names[body.owner[part]],),
            owner=np.zeros(1, np.int64),
            materials=body.materials[own],
            part_names=body.part_names[own],
            duration_s=body.duration_s,
            _whole=body,
            _own=own,
        )

    _whole: Body
    _own: slice

    def at(self, times: ArrayLike) -> Poses:
        """Poses of the part; see `Body.at`."""
        centres, frames, semi_axes = self._whole.at(times)
        return Poses(centres[:, self._own], frames[:, self._own], semi_axes[self._own])


def distinct_names(names: Sequence[str]) -> tuple[str, ...]:
    """Number the names that come more than once, from 1 on.

    Parameters
    ----------
    names : sequence of str
        Names, some of them alike.

    Returns
    -------
    tuple of str
        As many names, each once: ``walk 1``, ``walk 2``, ``kick``.
    """
    counts, seen, found = Counter(names), Counter[str](), []
    for name in names:
        seen[name] += 1
        found.append(f"{name} {seen[name]}" if counts[name] > 1 else name)
    # A numbered name may be that of another.
    return distinct_names(found) if len(set(found)) < len(found) else tuple(found)


def body_of_people(people: Sequence[Person], settings: RunSettings) -> Body:
    """Place people as they say, and make one moving set of ellipsoids of them.

    The interval of each starts at ``settings.start_s`` after their own, and ends with the shortest
    recording or after ``settings.duration_s``, which the longest must reach.

    Parameters
    ----------
    people : sequence of Person
        Everyone in the scene.
    settings : RunSettings
        Interval, additional heading, breath and material of those who have none of their own.

    Returns
    -------
    Body
        Of one person their `Body`, of several `Bodies`.

    Raises
    ------
    InputError
        Where an interval is not inside a recording, or a body is not known.
    """
    # What is left of each recording after its start.
    left = [person.motion.duration_s - person.start_s - settings.start_s for person in people]
    duration_s = settings.duration_s
    if not people and duration_s is None:
        raise InputError(
            "nobody is in the scene; give a motion, or say how long it is simulated (--duration)"
        )
    # Whose recording ends before the start is refused by name.
    if duration_s is None and len(people) > 1 and min(left) > 0:
        duration_s = min(left)
    bodies = []
    for person, rest in zip(people, left, strict=True):
        # Who ends early rests, unless nobody lasts that long.
        rests = duration_s is not None and 0 <= rest < duration_s <= max(left)
        interval = settings.start_s, None if rests else duration_s
        placed = person.placed(*interval, settings.heading_deg)
        material = settings.body_material if person.material is None else person.material
        breathing = settings.breathing if person.breathing is None else person.breathing
        body = Body.from_motion(placed, breathing, material)
        bodies.append(replace(body, mesh=HumanMesh(placed)) if person.body == "mesh" else body)
    return bodies[0] if len(bodies) == 1 else Bodies(bodies, duration_s)
