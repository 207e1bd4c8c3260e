"""What stands around the person: a scene, named or read from a TOML file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

import numpy as np

from rtradar.conventions import MINIMUM_ANTENNA_DISTANCE_M
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scene.furniture import Furniture
from rtradar.scene.materials import Material
from rtradar.scene.walls import Wall
from rtradar.system.checks import Vector, check_number, check_vector, shown


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Surroundings of the person; free space has none.

    Parameters
    ----------
    name : str
        Shown in reports.
    description : str
        One line for people.
    walls : tuple of Wall
        Floor and ceiling among them.
    furniture : tuple of Furniture
        What stands in the room.
    radar_position_m : tuple of float, optional
        Where the radar is in this scene, world [m]; its axes stay parallel to the world's. None: where the radar says.
    person_position_m : tuple of float
        Where the mean place of the person is, x and y [m].
    heading_deg : float
        Turns the person about the vertical there, anticlockwise seen from above [deg].

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
        """A scene by its name under ``scenes/``, or a TOML file.

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
            Where there is no such scene, the file is not TOML, or anything in it has no meaning; the message names the
            file, the table and key, the value, and what is allowed.
        """
        from rtradar.scene.scene_file import read_scene

        folder = scenes_folder()
        path = Path(source)
        if path.suffix != ".toml":
            path = folder / f"{source}.toml"
            try:
                found = path.is_file()
            except ValueError:  # a null character
                found = False
            if not found:
                known = ", ".join(sorted(file.stem for file in folder.glob("*.toml")))
                raise InputError(
                    f"scene {shown(str(source))} is unknown; allowed: {known}, or the path of a TOML file"
                )
        return read_scene(path)

    @property
    def materials(self) -> tuple[Material, ...]:
        """All that walls and furniture are made of, each once."""
        return tuple(
            dict.fromkeys(
                [
                    *(wall.material for wall in self.walls),
                    *(piece.material for piece in self.furniture),
                ]
            )
        )

    def place(self, radar: Radar) -> Radar:
        """The radar where it stands in this scene.

        Parameters
        ----------
        radar : Radar
            Its own position holds where the scene has none.

        Returns
        -------
        Radar

        Raises
        ------
        InputError
            Where a material is not known over the sweep of the radar, or the radar is inside a wall or nearer than 0.3 m to
            furniture.
        """
        placed = (
            radar
            if self.radar_position_m is None
            else replace(radar, position_m=self.radar_position_m)
        )
        start = placed.start_frequency_hz
        sweep = np.array([start, placed.centre_frequency_hz, start + placed.bandwidth_hz])
        antennas = np.concatenate([placed.tx, placed.rx])
        made_of = [
            *((wall.name, wall.material) for wall in self.walls),
            *((piece.name, piece.material) for piece in self.furniture),
        ]
        for name, material in made_of:
            try:
                material.eta(sweep)
            except InputError as error:
                raise InputError(f"scene '{self.name}', {name}: {error}") from None
        for wall in self.walls:
            if wall.holds(antennas).any():
                raise InputError(
                    f"scene '{self.name}': the radar at {placed.position_m} m has antennas inside wall '{wall.name}'; move it"
                )
        for piece in self.furniture:
            triangles = piece.triangles()
            low, high = triangles.vertices.min(axis=0), triangles.vertices.max(axis=0)
            # Only antennas near its box are worth a look at every triangle.
            beside = (
                np.linalg.norm(antennas - np.clip(antennas, low, high), axis=1)
                < MINIMUM_ANTENNA_DISTANCE_M
            )
            nearest = min(
                (triangles.distance_m(antenna) for antenna in antennas[beside]), default=np.inf
            )
            if nearest < MINIMUM_ANTENNA_DISTANCE_M:
                raise InputError(
                    f"scene '{self.name}': '{piece.name}' is {nearest:.2f} m from an antenna of the radar at "
                    f"{placed.position_m} m; {MINIMUM_ANTENNA_DISTANCE_M} m or more are needed"
                )
        return placed


def scenes_folder() -> Path:
    """Folder of the scenes that come with rtradar: inside the installed package, or at the top of a checkout."""
    installed = Path(str(resources.files("rtradar"))) / "scenes"
    return installed if installed.is_dir() else Path(__file__).resolve().parents[2] / "scenes"
