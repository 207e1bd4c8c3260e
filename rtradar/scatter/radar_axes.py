"""The world as a radar sees it that is turned or moves: in its own axes, about its own position.

Lengths of paths and what bodies return do not depend on the axes, and antennas and polarisation are
those of the radar. Models therefore compute in axes in which the radar is upright.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.radar import Radar
from rtradar.scene import Furniture, Object, Scene, Wall

Array = NDArray[np.float64]

_Pose = Callable[[ArrayLike], tuple[Array, Array]]
"""Axes (time, 3, 3) and positions (time, 3) [m] of a radar at some times [s]."""


class BodyInRadarAxes(Body):
    """A body whose places are those that a radar sees, about its ``centre`` (3,) [m]."""

    def __init__(self, body: Body, pose: _Pose, centre: Array) -> None:
        kept = ("motion", "semi_axes", "breathing", "material", "mesh")
        found = ("names", "owner", "materials", "part_names", "duration_s")
        given = {name: getattr(body, name, None) for name in (*kept, *found)}
        for name, value in {**given, "_seen": body, "_pose": pose, "_centre": centre}.items():
            object.__setattr__(self, name, value)

    _seen: Body
    _pose: _Pose
    _centre: Array

    @property
    def in_world(self) -> Body:
        """The body in the axes of the world."""
        return self._seen

    @property
    def people(self) -> tuple[Body, ...]:
        """The people, each as the radar sees them."""
        if len(self._seen.people) == 1:
            return (self,)
        return tuple(BodyInRadarAxes(one, self._pose, self._centre) for one in self._seen.people)

    def at(self, times: ArrayLike) -> Poses:
        """Poses in the axes of the radar; see `Body.at`."""
        centres, frames, semi_axes = self._seen.at(times)
        axes, places = self._pose(np.asarray(times, np.float64))
        seen = np.einsum("tji,tpj->tpi", axes, centres - places[:, None]) + self._centre
        return Poses(seen, np.einsum("tji,tpjk->tpik", axes, frames), semi_axes)

    def skin(self, times: ArrayLike, divisions: int = 0) -> Array:
        """Vertices of the mesh in the axes of the radar; see `Body.skin`."""
        axes, places = self._pose(np.asarray(times, np.float64))
        vertices = self._seen.skin(times, divisions) - places[:, None]
        return np.asarray(np.einsum("tji,tvj->tvi", axes, vertices) + self._centre)


@dataclass(frozen=True)
class _FurnitureInRadarAxes(Furniture):
    """Furniture whose own axes have any directions in those of a radar."""

    turned: tuple[tuple[float, ...], ...] = ()

    @property
    def axes(self) -> Array:
        """Rotation (3, 3) from the mesh's own axes to those of the radar."""
        return np.array(self.turned)


class _ObjectInRadarAxes(Object):
    """An object that moves, as a radar sees it about a ``centre`` (3,) [m]."""

    _seen: Object
    _pose: _Pose
    _centre: Array

    @classmethod
    def of(cls, moving: Object, pose: _Pose, centre: Array) -> Object:
        """Return the object as it is seen from these poses; its mesh is read once."""
        made = cls.__new__(cls)
        known = {"shape": moving.shape, "_seen": moving, "_pose": pose, "_centre": centre}
        vars(made).update(vars(moving) | known)
        return made

    def pose(self, times: ArrayLike) -> tuple[Array, Array]:
        """Compute the pose in the axes of the radar; see `Object.pose`."""
        rotation, place = self._seen.pose(times)
        axes, origin = self._pose(np.atleast_1d(np.asarray(times, np.float64)))
        seen = np.einsum("tji,tj->ti", axes, place - origin) + self._centre
        return np.einsum("tji,tjk->tik", axes, rotation), seen


@dataclass(frozen=True, kw_only=True, repr=False)
class MovingScene(Scene):
    """A scene as a radar that moves sees it at the start of the capture.

    ``radar`` is the one that moves, and ``world`` the scene in the axes of the world.
    """

    radar: Radar
    world: Scene

    @classmethod
    def of(cls, radar: Radar, world: Scene, time_s: float = 0.0) -> MovingScene:
        """Return what the radar sees at some time [s]."""
        (axes,), (origin,) = radar.poses_at([time_s])
        seen = _seen_by(radar, world, axes, origin)
        given = {field.name: getattr(seen, field.name) for field in dataclasses.fields(seen)}
        return cls(**given, radar=radar, world=world)

    def antennas(self, times: ArrayLike) -> tuple[Array, Array]:
        """Give the places of all Tx (time, tx, 3) and Rx (time, rx, 3) at some times, world [m]."""
        axes, origins = self.radar.poses_at(times)
        tx, rx = (
            np.einsum("tij,aj->tai", axes, own) + origins[:, None]
            for own in (self.radar.tx_m, self.radar.rx_m)
        )
        return tx, rx


def in_world(scene: Scene, body: Body) -> tuple[Scene, Body]:
    """Give scene and body in the axes of the world, where the radar moves; else themselves."""
    if isinstance(scene, MovingScene) and isinstance(body, BodyInRadarAxes):
        return scene.world, body.in_world
    return scene, body


def in_radar_axes(radar: Radar, body: Body, scene: Scene) -> tuple[Radar, Body, Scene]:
    """Give a radar that is upright, and a body and a scene as the given radar sees them.

    All three are themselves where the radar is upright. Walls and furniture before a radar that
    moves are a `MovingScene`.
    """
    if not (radar.is_turned or radar.is_moving):
        return radar, body, scene
    still: dict[str, Any] = dict.fromkeys(("path_times_s", "path_m", "path_angles_deg"))
    upright = dataclasses.replace(radar, yaw_deg=0.0, pitch_deg=0.0, roll_deg=0.0, **still)
    centre = np.array(radar.position_m)
    seen = BodyInRadarAxes(body, radar.poses_at, centre)
    if radar.is_moving and (scene.walls or scene.furniture):
        return upright, seen, MovingScene.of(radar, scene)
    return upright, seen, _seen_by(radar, scene, radar.axes, centre)


def _seen_by(radar: Radar, scene: Scene, axes: Array, origin: Array) -> Scene:
    """A scene in the axes (3, 3) of a radar that is at an origin, which is its position then."""
    centre = np.array(radar.position_m)
    walls = tuple(wall_seen(wall, axes, origin, centre) for wall in scene.walls)
    furniture = tuple(
        _FurnitureInRadarAxes(
            **{field.name: getattr(piece, field.name) for field in dataclasses.fields(piece)}
            | {
                "position_m": tuple(((piece.position_m - origin) @ axes + centre).tolist()),
                "turned": tuple(map(tuple, (axes.T @ piece.axes).tolist())),
            }
        )
        for piece in scene.furniture
    )
    objects = tuple(
        _ObjectInRadarAxes.of(moving, radar.poses_at, centre) for moving in scene.objects
    )
    return dataclasses.replace(scene, walls=walls, furniture=furniture, objects=objects)


def wall_seen(wall: Wall, axes: Array, origin: Array, centre: Array) -> Wall:
    """Return a wall in axes (3, 3) about an origin (3,), which lies at ``centre`` (3,) in them [m].

    It is of the same kind as the given one.
    """
    corner = ((np.array(wall.corner_m) - origin) @ axes + centre).tolist()
    edges = (np.array([wall.edge_u_m, wall.edge_v_m]) @ axes).tolist()
    return dataclasses.replace(
        wall, corner_m=tuple(corner), edge_u_m=tuple(edges[0]), edge_v_m=tuple(edges[1])
    )
