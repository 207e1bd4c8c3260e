"""The surroundings of the person: a scene, made by name or read from a TOML file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rtradar.conventions import MINIMUM_ANTENNA_DISTANCE_M
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scene.furniture import Furniture
from rtradar.scene.materials import Material
from rtradar.scene.scene_file import scene_fields, scene_path
from rtradar.scene.walls import Wall
from rtradar.system.checks import Vector, check_number, check_vector, shown
from rtradar.system.toml_tables import read_toml


@dataclass(frozen=True, kw_only=True)
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
    radar_position_m : tuple of float, optional
        Position of the radar in this scene, world [m]; its axes stay parallel to the world's. With
        None the radar keeps its own position.
    person_position_m : tuple of float
        Mean position of the person, x and y [m].
    heading_deg : float
        Rotation of the person about the vertical there, anticlockwise seen from above [deg].

    Raises
    ------
    InputError
        Where a value has no meaning, or two walls or two pieces of furniture have one name.
    """

    name: str = "free-space"
    description: str = "nothing but the person"
    walls: tuple[Wall, ...] = ()
    furniture: tuple[Furniture, ...] = ()
    radar_position_m: Vector | None = None
    person_position_m: tuple[float, float] = (0.0, 0.0)
    heading_deg: float = 0.0

    def __post_init__(self) -> None:
        for key in ("name", "description"):
            if not isinstance(getattr(self, key), str):
                raise InputError(f"scene: {key} = {shown(getattr(self, key))}; it must be a string")
        where = f"scene '{self.name}'"
        for key, kind in (("walls", Wall), ("furniture", Furniture)):
            pieces = tuple(getattr(self, key))
            if not all(isinstance(piece, kind) for piece in pieces):
                raise InputError(f"{where}: {key} must be a tuple of {kind.__name__}")
            names = [piece.name for piece in pieces]
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise InputError(
                    f"{where}: {key} has two of the name '{twice[0]}'; give each its own"
                )
            object.__setattr__(self, key, pieces)
        if self.radar_position_m is not None:
            position = check_vector(where, "radar position_m", self.radar_position_m, 3)
            object.__setattr__(self, "radar_position_m", position)
        place = check_vector(where, "person position_m", self.person_position_m, 2, 100.0)
        object.__setattr__(self, "person_position_m", place)
        heading = check_number(where, "person heading_deg", self.heading_deg, -360.0, 360.0)
        object.__setattr__(self, "heading_deg", heading)

    @classmethod
    def load(cls, source: str | Path) -> Scene:
        """Load a scene by its name under ``scenes/``, or from a TOML file.

        Parameters
        ----------
        source : str or path
            ``free-space``, ``living-room``, ..., or the path of a ``.toml`` file.

        Returns
        -------
        Scene

        Raises
        ------
        InputError
            Where there is no such scene, the file is not TOML, or anything in it has no meaning;
            the message names the file, the table and key, the value, and what is allowed.
        """
        path = scene_path(source)
        table = read_toml(path, "scene", "give a TOML file or the name of a scene")
        try:
            scene = cls(**scene_fields(table, path))
            for piece in scene.furniture:
                piece.triangles()  # refuses a mesh that cannot be used
        except InputError as error:
            raise InputError(f"scene file '{path}': {error}") from None
        return scene

    @property
    def materials(self) -> tuple[Material, ...]:
        """Materials of the walls and the furniture, each once."""
        return tuple(dict.fromkeys(part.material for part in self._parts))

    @property
    def _parts(self) -> tuple[Wall | Furniture, ...]:
        return *self.walls, *self.furniture

    def place(self, radar: Radar) -> Radar:
        """Move a radar to its position in this scene.

        Parameters
        ----------
        radar : Radar
            Radar that keeps its own position where the scene has none.

        Returns
        -------
        Radar

        Raises
        ------
        InputError
            Where a material is not known over the sweep of the radar, or the radar is inside a wall
            or nearer than 0.3 m to furniture.
        """
        placed = radar
        if self.radar_position_m is not None:
            placed = replace(radar, position_m=self.radar_position_m)
        start = placed.start_frequency_hz
        sweep = np.array([start, placed.centre_frequency_hz, start + placed.bandwidth_hz])
        antennas = np.concatenate([placed.tx, placed.rx])
        for part in self._parts:
            try:
                part.material.eta(sweep)
            except InputError as error:
                raise InputError(f"scene '{self.name}', {part.name}: {error}") from None
        for wall in self.walls:
            if wall.holds(antennas).any():
                raise InputError(
                    f"scene '{self.name}': the radar at {placed.position_m} m has antennas inside "
                    f"wall '{wall.name}'; move it"
                )
        for piece in self.furniture:
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
