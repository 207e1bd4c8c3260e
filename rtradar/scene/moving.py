"""Rigid objects that move: a mesh that turns, swings, or follows a path.

A motion gives the rotation of the object about its pivot, in the mesh's own axes, and how far the
pivot is from its position, in world axes, at any time since the start of the capture, in float64.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.scene.materials import material
from rtradar.scene.mesh_files import Triangles
from rtradar.scene.objects import Furniture
from rtradar.system.checks import Vector, brief, check_keys
from rtradar.system.fields import Angle, Limits, Point, check_fields, keys_of

Array: TypeAlias = NDArray[np.float64]

_LEAST_AXIS = 1e-9

_MOST_FACES = 200_000
"""Triangles of a mesh that moves, fewer than of one that stands: each has many places at once."""
MOST_WAY_POINTS = 10_000

_Rate = Annotated[float, Limits(-1000, 1000)]
_LISTED = f"it must be a list of 2 to {MOST_WAY_POINTS} way-points"
_Points = Annotated[tuple[Vector, ...] | None, Limits(-1000, 1000, _LISTED, (2, MOST_WAY_POINTS))]


class RigidMotion:
    """What an `Object` asks of its motion; this one rests."""

    def pose(self, times: Array) -> tuple[Array, Array]:
        """Compute rotation about the pivot and shift of it.

        Parameters
        ----------
        times : (time,) float64
            Times since the start of the capture [s].

        Returns
        -------
        rotation : (time, 3, 3) float64
            Rotation in the mesh's own axes.
        shift : (time, 3) float64
            Vector from the position of the object to its pivot, world axes [m].
        """
        return self._rotations(times), self._shifts(times)

    def _rotations(self, times: Array) -> Array:
        return np.tile(np.eye(3), (len(times), 1, 1))

    def _shifts(self, times: Array) -> Array:
        return np.zeros((len(times), 3))


@dataclass(frozen=True, kw_only=True)
class _AboutAxis(RigidMotion, ABC):
    """Rotation about an axis through the pivot, by an angle that depends on the time."""

    axis: Point = (0.0, 0.0, 1.0)
    phase_deg: Angle = 0.0

    def __post_init__(self) -> None:
        where = f"motion {type(self).__name__}: "
        check_fields(self, where)
        if np.linalg.norm(self.axis) < _LEAST_AXIS:
            raise InputError(f"{where}axis = {brief(self.axis)}; it must have a direction")

    @abstractmethod
    def _angle_rad(self, times: Array) -> Array:
        """Angles at some times (time,), of any number of turns."""

    def _rotations(self, times: Array) -> Array:
        from scipy.spatial.transform import Rotation  # slow to import

        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        turns: Any = Rotation.from_rotvec(self._angle_rad(times)[:, None] * axis)
        return np.asarray(turns.as_matrix(), dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class Turning(_AboutAxis):
    """Steady rotation about an axis, as of a fan.

    Parameters
    ----------
    axis : tuple of float
        Direction of the axis in the mesh's own axes, of any length; turns are anticlockwise seen
        from where it points to.
    rate_hz : float
        Turns per second; negative the other way round.
    phase_deg : float
        Angle at the start of the capture [deg].

    Raises
    ------
    InputError
        Where a value has no meaning.

    Examples
    --------
    >>> import numpy as np
    >>> import rtradar as rt
    >>> rotation, _ = rt.Turning(rate_hz=1.0).pose(np.array([0.25]))
    >>> rotation.round(9)[0, 1, 0]
    np.float64(1.0)
    """

    rate_hz: _Rate = 1.0

    def _angle_rad(self, times: Array) -> Array:
        # Whole turns are taken out, so that the angle is precise however long it turns.
        turns = self.rate_hz * times + self.phase_deg / 360
        return np.asarray(2 * np.pi * (turns - np.rint(turns)))


@dataclass(frozen=True, kw_only=True)
class Swinging(_AboutAxis):
    """Swing to and fro about an axis, as of a door: amplitude times sin(2 pi t / period + phase).

    Parameters
    ----------
    axis : tuple of float
        Direction of the axis in the mesh's own axes, of any length; angles are anticlockwise seen
        from where it points to.
    amplitude_deg : float
        Largest angle to either side [deg].
    period_s : float
        Time of one swing to and fro [s].
    phase_deg : float
        Phase at the start of the capture [deg]; 0 in the middle, on the way to positive angles.

    Raises
    ------
    InputError
        Where a value has no meaning.
    """

    amplitude_deg: Annotated[float, Limits(0, 180)] = 45.0
    period_s: Annotated[float, Limits(1e-3, 1e4)] = 4.0

    def _angle_rad(self, times: Array) -> Array:
        phase = 2 * np.pi * times / self.period_s + math.radians(self.phase_deg)
        return np.asarray(math.radians(self.amplitude_deg) * np.sin(phase))


@dataclass(frozen=True, kw_only=True)
class FollowingPath(RigidMotion):
    """Motion without rotation along a path: at one velocity, or over way-points, as of a cart.

    Parameters
    ----------
    velocity_mps : tuple of float, optional
        Velocity from the object's position on, world axes [m/s].
    points_m : sequence of three float each, optional
        Way-points, two or more, relative to the object's position, world axes [m]. Between them the
        path is smooth and does not overshoot (monotone cubics); before the first and after the last
        the object rests.
    times_s : sequence of float, optional
        Time at each way-point since the start of the capture, ascending [s].

    Raises
    ------
    InputError
        Where neither or both ways are given, or a value has no meaning.
    """

    velocity_mps: Point | None = None
    points_m: _Points = None
    times_s: Annotated[tuple[float, ...] | None, Limits(-1e6, 1e6)] = None

    def __post_init__(self) -> None:
        where = "motion FollowingPath: "
        check_fields(self, where)
        # A velocity, or points with times, but not both.
        given = [own is not None for own in (self.velocity_mps, self.points_m, self.times_s)]
        if given not in ([True, False, False], [False, True, True]):
            raise InputError(f"{where}give velocity_mps, or points_m with times_s")
        times = self.times_s or ()
        if len(times) != len(self.points_m or ()) or (np.diff(times) <= 0).any():
            raise InputError(
                f"{where}times_s = {brief(self.times_s)}; they must ascend, one for each of "
                "points_m"
            )

    def _shifts(self, times: Array) -> Array:
        if self.velocity_mps is not None:
            return times[:, None] * np.array(self.velocity_mps)
        from scipy.interpolate import PchipInterpolator  # slow to import

        ends = self.times_s or ()
        course = PchipInterpolator(np.array(ends), np.array(self.points_m))
        return np.asarray(course(np.clip(times, ends[0], ends[-1])), dtype=np.float64)


_KINDS: Mapping[str, tuple[type[RigidMotion], tuple[str, ...]]] = {
    "turning": (Turning, ("rate_hz",)),
    "swinging": (Swinging, ("amplitude_deg", "period_s")),
    "path": (FollowingPath, ()),
}
"""Motions by the ``kind`` that a scene file names, and the keys that each needs there."""


def kind_of(motion: RigidMotion) -> str | None:
    """Return the ``kind`` that a scene file names a motion by; None for one of somebody's own."""
    return next((kind for kind, (own, *_) in _KINDS.items() if type(motion) is own), None)


def motion_of(table: object) -> RigidMotion:
    """Make a motion of the ``motion`` table of a scene file."""
    if not isinstance(table, dict) or table.get("kind") not in tuple(_KINDS):
        raise InputError(
            f"motion = {brief(table)}; it must be a table with kind = {' or '.join(_KINDS)}"
        )
    # Unknown keys are refused in one line, before the constructor would.
    motion, needed = _KINDS[table["kind"]]
    check_keys("motion: ", table, ("kind", *needed), keys_of(motion)[1])
    return motion(**{key: value for key, value in table.items() if key != "kind"})


@dataclass(frozen=True)
class Object(Furniture):
    """A rigid mesh that moves in a scene: a fan, a door, a reflector on a cart.

    A point v of the mesh, scaled and relative to the pivot, is at ``place + rotation @ v``, as
    `pose` gives both at any time.

    Parameters
    ----------
    name : str
        Name that reports show.
    mesh : str, Path, trimesh.Trimesh or tuple of float
        Name of a mesh that comes with rtradar, a file as `Furniture` takes it, a mesh in metres, or
        the sizes of a box [m].
    material : Material or str
        Material of the surface, or its name.
    position_m : tuple of float
        Position of the pivot, world [m].
    yaw_deg : float
        Rotation of the whole, axis of its motion included, about the vertical, anticlockwise seen
        from above [deg].
    scale : float
        Factor by which the mesh is enlarged.
    metres_per_unit : float, optional
        Unit of a file [m]; other meshes are in metres, and take none.
    sheet : bool
        Whether the mesh of a file is a thin sheet.
    pivot_m : tuple of float
        Point of the scaled mesh, in its own axes, about which it turns [m]: for a door a point of
        its hinge.
    motion : Turning, Swinging or FollowingPath, optional
        How it moves; None for not at all.

    Raises
    ------
    InputError
        Where a value has no meaning. The mesh itself is read and checked by `triangles`.

    Examples
    --------
    >>> import rtradar as rt
    >>> fan = rt.Object("fan", "fan", "metal", position_m=(1, 1, 1), motion=rt.Turning(rate_hz=5))
    """

    _: KW_ONLY
    position_m: Point = (0.0, 0.0, 0.0)
    pivot_m: Point = (0.0, 0.0, 0.0)
    motion: Annotated[
        RigidMotion | None, Limits(wanted="allowed: Turning, Swinging, FollowingPath")
    ] = None

    def __post_init__(self) -> None:
        if isinstance(self.material, str):
            object.__setattr__(self, "material", material(self.material))
        super().__post_init__()

    @cached_property
    def shape(self) -> Triangles:
        """Mesh in its own axes, scaled and relative to the pivot [m]."""
        own = self._own_triangles()
        if len(own.faces) > _MOST_FACES:
            raise InputError(
                f"{self._where}: its mesh has {len(own.faces)} triangles; {_MOST_FACES} are "
                "allowed of what moves: take a coarser one"
            )
        return own.moved(own.vertices - np.array(self.pivot_m))

    def pose(self, times: ArrayLike) -> tuple[Array, Array]:
        """Compute the pose of the object.

        Parameters
        ----------
        times : (time,) array_like
            Times since the start of the capture [s].

        Returns
        -------
        rotation : (time, 3, 3) float64
            Rotation from the mesh's own axes to the world's.
        place : (time, 3) float64
            Place of the pivot, world [m].
        """
        # The yaw turns the object with the axis of its motion.
        at = np.atleast_1d(np.asarray(times, dtype=np.float64))
        rotation, shift = (self.motion or RigidMotion()).pose(at)
        return self.axes @ rotation, np.array(self.position_m) + shift

    def triangles(self, time_s: float = 0.0) -> Triangles:
        """Return the mesh where it is at a time since the start of the capture [s].

        Parameters
        ----------
        time_s : float
            Time since the start of the capture [s].

        Returns
        -------
        Triangles
            Mesh in world coordinates [m].

        Raises
        ------
        InputError
            As of `Furniture.triangles`.
        """
        (rotation,), (place,) = self.pose([time_s])
        return self.shape.moved(self.shape.vertices @ rotation.T + place)
