"""The surroundings of the person: a scene, made by name or read from a TOML file."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
from numpy.typing import NDArray

from rtradar.cards import html_card, text_card
from rtradar.conventions import MINIMUM_ANTENNA_DISTANCE_M, PERSON_LIMITS
from rtradar.errors import InputError, ValidityWarning, prefixed
from rtradar.radar import Radar
from rtradar.radar.array import UsualPlace
from rtradar.scene import plan
from rtradar.scene.materials import Material
from rtradar.scene.moving import Object
from rtradar.scene.objects import ROOM_SIDES, Furniture, Wall
from rtradar.scene.tables import ANGLES, RandomRoom, drawn, fields_of, rooted
from rtradar.system.checks import Table, Vector, brief, printable
from rtradar.system.fields import Angle, Limits, MaybeEmpty, Point, check_fields
from rtradar.system.registries import RANDOM_SCENE, scene_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rtradar.body import Person


def _tuple_of(kind: str) -> Limits:
    return Limits(wanted=f"it must be a tuple of {kind}")


@dataclass(frozen=True, kw_only=True, repr=False)
class Scene:
    """Surroundings of the person; free space has none.

    Parameters
    ----------
    name : str
        Name that reports show.
    description : str
        Description in one line, for people.
    walls : tuple of Wall
        Walls of the scene; the floor and the ceiling are among them.
    furniture : tuple of Furniture
        Meshes in the room.
    objects : tuple of Object
        Rigid meshes that move.
    people : tuple of Person
        People who are in the scene already, beside those whom a run is given.
    radar_position_m : tuple of float, optional
        Position in this scene of a radar that has not been given one of its own, world [m].
    radar_yaw_deg, radar_pitch_deg, radar_roll_deg : float, optional
        How a radar is turned in this scene whose own angle is 0, as the fields of `rtradar.Radar`
        [deg].
    person_position_m : tuple of float
        Mean position of the person, x and y [m].
    heading_deg : float
        Rotation of the person about the vertical there, anticlockwise seen from above [deg].
    source : mapping, optional
        Table of the file that it was read from, with absolute paths; None of a scene that was made
        or changed in Python.

    Raises
    ------
    InputError
        Where a value has no meaning, or two walls or two pieces of furniture have one name.

    Examples
    --------
    >>> import rtradar as rt
    >>> scene = rt.Scene.load("living-room")
    >>> [wall.name for wall in scene.walls[:2]]
    ['near', 'far']
    """

    name: MaybeEmpty = "free-space"
    description: MaybeEmpty = "nothing but the person"
    walls: Annotated[tuple[Wall, ...], _tuple_of("Wall")] = ()
    furniture: Annotated[tuple[Furniture, ...], _tuple_of("Furniture")] = ()
    objects: Annotated[tuple[Object, ...], _tuple_of("Object")] = ()
    people: Annotated[tuple[Person, ...], _tuple_of("Person")] = ()
    radar_position_m: Point | None = None
    radar_yaw_deg: Angle | None = None
    radar_pitch_deg: Angle | None = None
    radar_roll_deg: Angle | None = None
    person_position_m: Annotated[tuple[float, float], Limits(*PERSON_LIMITS["position_m"])] = (
        0.0,
        0.0,
    )
    heading_deg: Annotated[float, Limits(*PERSON_LIMITS["heading_deg"])] = 0.0
    source: Table | None = field(default=None, init=False, compare=False)

    def __post_init__(self) -> None:
        where = f"scene {brief(self.name)}: "
        check_fields(self, where)
        if any(isinstance(piece, Object) for piece in self.furniture):
            raise InputError(
                f"{where}furniture must be a tuple of Furniture; what moves is of objects"
            )
        # Whatever is said of a piece names it.
        for key in ("walls", "furniture", "objects"):
            names = [piece.name for piece in getattr(self, key)]
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise InputError(
                    f"{where}{key} has two of the name '{twice[0]}'; give each its own"
                )
        if self.people:
            # `check_fields` does not know the class, which takes long to import.
            from rtradar.body import Person

            if not all(isinstance(one, Person) for one in self.people):
                raise InputError(f"{where}people must be a tuple of Person")

    def __repr__(self) -> str:
        return text_card("Scene", self.name, plan.brief_rows(self))

    def _repr_html_(self) -> str:
        picture = None
        if self._parts:
            with suppress(InputError):  # the file of a mesh may be gone
                picture = plan.picture_of_plan(self)
        return html_card("Scene", self.name, plan.tables(self), picture=picture)

    @classmethod
    def load(cls, source: str | Path) -> Scene:
        """Load a scene by its name under ``scenes/``, or from a TOML file.

        Parameters
        ----------
        source : str or path
            ``free-space``, ``living-room``, ..., ``random:`` and a seed, or the path of a ``.toml``
            file.

        Returns
        -------
        Scene

        Raises
        ------
        InputError
            Where there is no such scene, the file is not TOML, or anything in it has no meaning;
            the message names the file, the table and key, the value, and what is allowed.

        Examples
        --------
        >>> import rtradar as rt
        >>> rt.Scene.load("bedroom")
        Scene bedroom
          description  6.4 by 4.4 by 2.5 m, plasterboard, a bed, a wardrobe, a desk
          room         6.4 × 4.4 × 2.5 m
          radar        at (-4, 1, 1) m
          person       at (0, 0) m
          walls        6: near, far, right, left, floor, ceiling
          furniture    6: bed, wardrobe, desk, desk chair, radiator, door
          materials    plasterboard, wood, chipboard, metal
        """
        path, table = scene_table(source)
        with prefixed(f"scene file '{path}': "):
            return cls.of_table({"name": printable(path.stem), **rooted(table, path.parent)})

    @classmethod
    def of_table(cls, table: Table) -> Scene:
        """Make the scene of a table as a TOML file has it, whose paths are absolute.

        Parameters
        ----------
        table : mapping
            Keys of a scene file.

        Returns
        -------
        Scene

        Raises
        ------
        InputError
            Where anything in it has no meaning.
        """
        table = drawn(table)
        scene = cls(**fields_of(table))
        for piece in (*scene.furniture, *scene.objects):
            piece.triangles()  # refuses a mesh that cannot be used
        object.__setattr__(scene, "source", table)
        return scene

    @classmethod
    def random(
        cls,
        seed: int,
        *,
        furniture: Sequence[int] = RandomRoom.furniture,
        length_m: Sequence[float] = RandomRoom.length_m,
        width_m: Sequence[float] = RandomRoom.width_m,
        height_m: Sequence[float] = RandomRoom.height_m,
    ) -> Scene:
        """Draw a room: its size, the materials of its sides, its furniture, where the radar stands.

        Furniture stands along the walls, away from the radar and from where people walk about the
        origin. The materials are known from 1 to 100 GHz.

        Parameters
        ----------
        seed : int
            Seed. The same gives the same room in the same version of rtradar; the run file of a run
            has the room itself.
        furniture : (int, int)
            Least and largest number of pieces.
        length_m, width_m, height_m : (float, float)
            Least and largest size along x, y and z [m].

        Returns
        -------
        Scene

        Raises
        ------
        InputError
            Where the seed or a range has no meaning.

        Examples
        --------
        >>> import rtradar as rt
        >>> room = rt.Scene.random(7, furniture=(3, 3))
        >>> room.name, len(room.furniture)
        ('random:7', 3)
        """
        asked = {"seed": seed, "furniture": furniture}
        asked |= {"length_m": length_m, "width_m": width_m, "height_m": height_m}
        return cls.of_table({"name": f"{RANDOM_SCENE}{seed}", "random": asked})

    def plot(self, radar: Radar | Axes | None = None, ax: Axes | None = None) -> Axes:
        """Draw the plan: walls with their materials, furniture, reflectors, radar and person.

        Parameters
        ----------
        radar : Radar, optional
            Radar that is drawn where the scene has no place for one; by default the paper's. Axes
            may come in its place.
        ax : Axes, optional
            Axes of Matplotlib to draw on; by default those of a new figure.

        Returns
        -------
        Axes
            Axes in metres, x to the right and y upward.

        Examples
        --------
        >>> import rtradar as rt
        >>> axes = rt.Scene.load("living-room").plot()
        >>> axes.get_xlabel()
        'x [m]'
        """
        return plan.plot_scene(self, radar, ax)

    @property
    def materials(self) -> tuple[Material, ...]:
        """Materials of walls, furniture and objects, each once."""
        return tuple(dict.fromkeys(part.material for part in self._parts))

    @property
    def _parts(self) -> tuple[Wall | Furniture, ...]:
        return *self.walls, *self.furniture, *self.objects

    @property
    def is_empty(self) -> bool:
        """Whether nothing is around the person: no wall, no furniture, and no object."""
        return not self._parts

    def place(self, radar: Radar) -> Radar:
        """Move a radar to its position in this scene, and turn it as it is there.

        Parameters
        ----------
        radar : Radar
            Radar, which keeps the position that its file or its caller has given.

        Returns
        -------
        Radar

        Raises
        ------
        InputError
            Where a material is not known over the sweep of the radar, or the radar is inside a wall
            or nearer than 0.3 m to furniture.
        """
        # The radar at its place. A place of its own may be outside of the room by mistake.
        place, placed = self.radar_place(radar), self.turn(radar)
        if place is not radar.position_m:
            placed = replace(placed, position_m=place)
        elif self.is_outside(place):
            warnings.warn(
                f"scene '{self.name}': the radar at {place} m, its own position, is "
                "outside of the room; give one inside (--radar-position, [radar] position_m)",
                ValidityWarning,
                stacklevel=2,
            )
        # Materials must be known over the whole sweep.
        start = placed.start_frequency_hz
        sweep = np.array([start, placed.centre_frequency_hz, start + placed.bandwidth_hz])
        antennas = np.concatenate([placed.tx, placed.rx])
        for part in self._parts:
            with prefixed(f"scene '{self.name}', {part.name}: "):
                part.material.eta(sweep)
        # No antenna may be inside of a wall, or so near to a mesh that the echo models have no
        # meaning.
        for wall in self.walls:
            if wall.holds(antennas).any():
                raise InputError(
                    f"scene '{self.name}': the radar at {placed.position_m} m has antennas inside "
                    f"wall '{wall.name}'; move it"
                )
        for piece in (*self.furniture, *self.objects):
            triangles = piece.triangles()
            low, high = triangles.vertices.min(axis=0), triangles.vertices.max(axis=0)
            # Only antennas near the box of the mesh are compared with every triangle.
            to_box_m = np.linalg.norm(antennas - np.clip(antennas, low, high), axis=1)
            near = antennas[to_box_m < MINIMUM_ANTENNA_DISTANCE_M]
            nearest_m = min((triangles.distance_m(antenna) for antenna in near), default=np.inf)
            if nearest_m < MINIMUM_ANTENNA_DISTANCE_M:
                raise InputError(
                    f"scene '{self.name}': '{piece.name}' is {nearest_m:.2f} m from an antenna of "
                    f"the radar at {placed.position_m} m; {MINIMUM_ANTENNA_DISTANCE_M} m or more "
                    "are needed"
                )
        return placed

    def radar_place(self, radar: Radar) -> Vector:
        """Where a radar stands: as its file or its caller says, else as the scene does.

        Parameters
        ----------
        radar : Radar
            Radar that is asked about, not yet placed.

        Returns
        -------
        (3,) tuple of float
            World [m].
        """
        own, said = radar.position_m, self.radar_position_m
        return own if said is None or not isinstance(own, UsualPlace) else said

    def turn(self, radar: Radar) -> Radar:
        """Turn a radar as it is turned in this scene.

        Parameters
        ----------
        radar : Radar
            Radar, which keeps its own angles where they are not 0.

        Returns
        -------
        Radar
        """
        kept = [key for key in ANGLES if getattr(radar, key) == 0]
        given = {key: getattr(self, f"radar_{key}") for key in kept}
        given = {key: value for key, value in given.items() if value is not None}
        return replace(radar, **given) if given else radar

    def is_outside(self, place: Sequence[float]) -> bool:
        """Whether a place is outside of the room; where there is none, nothing is.

        Parameters
        ----------
        place : (3,) sequence of float
            World [m].

        Returns
        -------
        bool
        """
        if (box := self.room_box()) is None:
            return False
        return bool((np.asarray(place) < box[0]).any() or (np.asarray(place) > box[1]).any())

    def room_box(self) -> NDArray[np.float64] | None:
        """Return the least and largest coordinates inside of the room.

        Returns
        -------
        (2, 3) float64, optional
            World [m]; None where there is no room.
        """
        sides = [wall.corners for wall in self.walls if wall.name in ROOM_SIDES]
        if len(sides) < len(ROOM_SIDES):
            return None
        return np.stack([np.min(sides, axis=(0, 1)), np.max(sides, axis=(0, 1))])
