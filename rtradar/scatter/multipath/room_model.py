"""A room around an echo model: echoes over walls, floor and ceiling, and through walls.

A leg over a wall is straight from the antenna's image, so lengths and amplitudes of every path
follow from the same geometric optics with images for antennas, in float64 at every chirp. What
walls, polarisation, the surface of the body and occluders do to the field changes slowly: it is
computed at keyframes 20 ms apart for the ends of the lines of antennas. In between, factors change
linearly, and what appears or vanishes fades smoothly.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.kernels.scatter.rooms import path_amplitudes
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayEnds, take, times_factor, together, weakest
from rtradar.scatter.common.polarization import CONDUCTOR, Surfaces, is_shaped
from rtradar.scatter.common.poses import (
    ChirpPoses,
    EchoModel,
    account_of,
    chirp_poses,
    chirps_by_steps,
)
from rtradar.scatter.multipath.image_paths import (
    Face,
    FaceSummary,
    ImageRadar,
    corners,
    reflecting_faces,
    wall_paths,
)
from rtradar.scatter.multipath.keyframes import RoomKeyframes, Surroundings
from rtradar.scatter.multipath.path_echoes import EchoColumns, LegImages
from rtradar.scatter.multipath.path_summary import MARGIN_DB, PathSummary, summarize
from rtradar.scatter.multipath.slabs import HALF_SPACE, WallResponse, room_series
from rtradar.scatter.multipath.solid_edges import SolidEdges
from rtradar.scatter.multipath.wall_edges import WallEdges
from rtradar.scene import Scene
from rtradar.system.checks import check_order
from rtradar.system.threads import in_threads
from rtradar.trace.backend import select, use
from rtradar.trace.occluders import Occluders
from rtradar.trace.tracers import BodyTracer

Array = NDArray[np.float64]

FIELD_ERROR = 0.02
"""Largest error of the field of an echo over or through a wall, over the sweep, without a limit."""

_ENOUGH, _MOST_NODES = 0.015, 3
"""Part of that error that polynomials over the sweep may take, and their largest number of nodes:
one pass of `synthesize` takes 3."""

_CHIRPS_AT_ONCE = 64

_PLACES = 9
"""Places on the path of a radar that moves, from which walls and faces are looked for."""

_LOOK_EVERY, _LEAST_LOOKS = 5, 25
"""One keyframe in this many is looked at to tell which echoes are above the noise; and the least
number of keyframes that are."""


class RoomModel:
    """A fidelity level in a room; its model of the ``person`` alone is that of free space.

    Free space is a room without walls, with the direct path alone.

    ``before(radar)`` builds the model of that level, for conductors before that radar. Radar and
    body are at their positions in the scene; ``materials (part,)`` are those of the parts, by
    default perfect conductors. ``order`` is the largest number of reflections at walls on both
    legs together, 0 to 3; 0 leaves the direct echoes, through walls and behind furniture.
    ``variant`` asks for the backend that traces what occludes; None is for no occlusion.

    From a model that says ``fast_over_walls`` the room takes one formula for the echoes over all
    paths, ``conductor_echo``; or it takes the direct echoes, one a part, and follows specular
    points over walls itself. For any other level each path has a model before the images of the
    antennas over its legs. ``paths`` are all paths, the direct one first, and ``path_names`` their
    names; ``faces`` says of each face of furniture whether paths lead over it; ``not_followed``,
    known after `prune`, are the walls whose frequency response is not known to `FIELD_ERROR`, with
    the fraction of the echo power that meets each. ``left_out`` is the number of the weakest echoes
    that a tolerance leaves out, and ``left_out_m2`` their mean power [m^2].
    """

    def __init__(
        self,
        before: Callable[[Radar], EchoModel],
        scene: Scene,
        radar: Radar,
        body: Body,
        materials: Sequence[str] = (),
        *,
        order: int = 1,
        variant: str | None = None,
    ) -> None:
        check_order(order)
        self._before, self._radar, self._body = before, radar, body
        # The level itself, a conductor before the radar's own antennas.
        self._conductor = conductor = before(radar)
        self._fast = bool(getattr(conductor, "fast_over_walls", False))
        self._models: dict[int, EchoModel] = {0: conductor}
        # What the walls do to a wave over the sweep.
        series = room_series(
            scene.walls, radar, most_nodes=_MOST_NODES, enough=_ENOUGH, bounces=order
        )
        # What occludes: furniture and objects, and the body itself.
        room, occluders = None, None
        self.person: EchoModel = self
        if not scene.is_empty:
            self.person = in_free_space(lambda _: conductor, radar, body, materials)
        self.variant: str | None = getattr(conductor, "variant", None)
        self.traces = bool(getattr(conductor, "traces", False))
        if variant is not None and not scene.is_empty:
            backend = select(variant)
            self.variant, mi = backend.kind, use(backend)
            room = Occluders(mi, scene)
            occluders = BodyTracer(mi, body.semi_axes), SolidEdges(room, scene, radar)
        # Which faces of furniture are worth paths, from any place of a radar that moves.
        faces: tuple[Face, ...] = ()
        self.faces: tuple[FaceSummary, ...] = ()
        places = _places(radar)
        if order and radar.is_moving and (scene.walls or scene.furniture) and not self._fast:
            raise InputError(
                f"scene '{scene.name}': radar '{radar.name}' moves; echoes over walls are then "
                "those of analytic or specular: take one of these as fidelity, or order = 0"
            )
        if order:
            found = [reflecting_faces(scene, radar, own, body, room) for own in places]
            faces = tuple(dict.fromkeys(face for some, _ in found for face in some))
            self.faces = _summaries([summaries for _, summaries in found])
        # All paths from all these places, each once, those with fewer reflections first.
        paths = [wall_paths(scene.walls, place, order, faces) for place in places]
        self.paths = tuple(
            sorted(dict.fromkeys(chain.from_iterable(paths)), key=lambda path: path.order)
        )
        self.path_names = tuple(path.name for path in self.paths)
        # Everything that a path may meet, for the keyframes.
        every = *series.walls, *(HALF_SPACE,) * len(faces)
        walls = WallResponse(WallEdges.of(scene.walls, radar, faces), every, series.frequency)
        self._legs = LegImages.of(radar, self.paths)
        columns = EchoColumns(self.paths, len(body.part_names), walls, self._legs)
        # With one path alone it costs little to look from every Tx.
        ends = ArrayEnds.of(radar, max(map(len, radar.tx_lines)) if scene.is_empty else 2)
        self._around = Surroundings(
            radar,
            walls,
            occluders,
            Surfaces(materials or (CONDUCTOR,) * len(body.part_names), radar),
            ends,
            self.paths,
            # A formula alone knows neither polarisation nor occlusion.
            whole_level=not self._fast and getattr(conductor, "traces", True),
        )
        self._keyframes = RoomKeyframes(self._around, columns, body)
        self.not_followed: dict[str, float] = {}
        self.left_out, self.left_out_m2 = 0, 0.0

    def _images(self, at: ChirpPoses) -> tuple[ChirpPoses, LegImages]:
        """Poses with numbers of images of the antennas, and these: each chirp may have its own."""
        if not self._radar.is_moving:
            return at, self._legs
        own = at._replace(tx_index=np.arange(len(at.tx)))
        return own, LegImages(self.paths, at.tx, at.rx, at.rx.mean(axis=1))

    @property
    def _columns(self) -> EchoColumns:
        return self._keyframes.columns

    def account(self) -> dict[str, Any] | None:
        """Report what the model of the direct echoes did."""
        return account_of(self._conductor)

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Compute the echoes at some chirps.

        For a fast model the direct echo of each part comes first, then the echoes over walls, then
        those that slabs delay; for any other model the echoes come path by path.
        """
        chirps = np.asarray(chirps, dtype=np.int64)
        return self.optical_echoes(chirps) if self._fast else self._by_paths(chirps)

    def optical_echoes(self, chirps: NDArray[np.int64], *, ghosts: bool = False) -> Echoes:
        """Compute the echoes as `echoes` of a fast model, by geometric optics for any other.

        With ``ghosts`` direct echoes do not count, and ghosts have the lengths over their specular
        points also where they are not seen.
        """
        chirps, columns = np.asarray(chirps, dtype=np.int64), self._columns
        at = chirp_poses(self._radar, self._body, chirps)
        blend, factors, points, wanted = self._keyframes.around(chirps, at.tx_index)
        formula = getattr(self._conductor, "conductor_echo", None) if self._fast else None
        n_direct, by_model = at.centres.shape[1], self._fast and formula is None
        wanted |= ghosts
        # The direct echoes of a level that is no formula come from its own model.
        wanted[:, :n_direct] &= not (ghosts or by_model)
        # Lengths and bare amplitudes, as if walls were perfect mirrors.
        there, legs = self._images(at)
        near = points * wanted[..., None]
        length, bare = legs.echoes(columns.path, columns.part, there, near, formula)
        if by_model and not ghosts:
            own = self._conductor.echoes(chirps)
            length[..., :n_direct], bare[..., :n_direct] = own.length, own.amplitude[0].real
        echo = np.array(columns.echo, dtype=np.int64)
        if columns.delayed:
            length = columns.lengths(legs, there, points, length)
            # Contiguous, or Numba would compile the same for another layout.
            bare = np.ascontiguousarray(bare[..., echo])
        # Multiply by what walls, the body's surface and occluders leave.
        frequency = self._around.walls.frequency
        if all(bool((own.factor == own.factor[:, :1]).all()) for own in factors):
            # Nothing changes over the sweep, as with the direct echoes of a conductor.
            factors = [
                own._replace(factor=np.ascontiguousarray(own.factor[:, :1])) for own in factors
            ]
            frequency = frequency[[len(frequency) // 2]]
        amplitude = np.empty((len(frequency), *bare.shape), dtype=np.complex64)
        in_threads(path_amplitudes, len(bare), bare, *factors, blend, amplitude)
        bounces = 1 + np.array([self.paths[path].order for path in columns.path], dtype=np.int64)
        return Echoes(
            length=length,
            amplitude=amplitude,
            frequency=frequency,
            tx=at.tx_index,
            part=columns.part[echo],
            bounces=bounces[echo],
            path=columns.path[echo],
        )

    @property
    def has_ghost_tones(self) -> bool:
        """Whether `ghosts` can be asked for, and there are any: not before a radar that moves."""
        return self._fast and not (self._radar.is_moving or self._columns.direct.all())

    def ghosts(self, chirps: NDArray[np.int64]) -> Echoes:
        """Compute the echoes over walls of a fast model; they have lengths where they are not seen.

        After `prune` they are the same ones at every chirp.
        """
        echoes = self.optical_echoes(np.asarray(chirps, dtype=np.int64), ghosts=True)
        return take(echoes, np.flatnonzero(echoes.bounces > 1))

    def without_ghosts(self) -> RoomModel:
        """Return the model of the direct echoes alone, with what is already known of them."""
        direct = copy.copy(self)
        direct._keyframes = self._keyframes.direct()
        return direct

    def _by_paths(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes of the models of all paths, times what walls, materials and occluders leave."""
        columns = self._columns
        at = chirp_poses(self._radar, self._body, chirps)
        blend, factors, points, _ = self._keyframes.around(chirps, at.tx_index)
        # The first keyframes find which echoes slabs delay, so that columns are counted after them.
        echo = np.array(columns.echo)
        extra = np.zeros((*at.rx.shape[:2], len(columns)))
        if columns.delayed:
            there, legs = self._images(at)
            extra = columns.lengths(legs, there, points, extra)
        around, nodes = self._around, self._around.walls.frequency
        left = np.empty((len(nodes), *extra.shape), dtype=np.complex64)
        in_threads(path_amplitudes, len(extra), np.ones(extra.shape), *factors, blend, left)
        found = []
        # Each path's own model, times what is left of it.
        for path in np.unique(columns.path[echo]).tolist():
            own = self._model(path).echoes(chirps)
            # Each of its echoes in each column of its part.
            column = np.flatnonzero(columns.path[echo] == path)
            # An echo of the model appears once for each column of its part.
            which, place = np.nonzero(own.part[:, None] == columns.part[echo[column]])
            column = column[place]
            factor = left[..., column]
            if not around.surfaces.conduct:
                # Each further bounce, wherever it is, counts as one at normal incidence.
                straight = around.surfaces.straight[own.part[which]]
                factor = factor * straight ** (own.bounces[which] - 1)
            found.append(
                replace(
                    times_factor(take(own, which), nodes, factor),
                    length=own.length[..., which] + extra[..., column],
                    bounces=own.bounces[which] + self.paths[path].order,
                    path=np.full(len(which), path),
                )
            )
        return together(found)

    def _model(self, path: int) -> EchoModel:
        if path not in self._models:
            self._models[path] = self._before(ImageRadar.over(self._radar, self.paths[path]))
        return self._models[path]

    def course(self, name: str, point: Array, radar: Radar) -> Array:
        """Return the corners (corner, 3) of a path over a point (3,) and back, world [m].

        The path, given by its name, begins and ends at the middle of the array of a radar at rest.
        """
        path = next(path for path in self.paths if path.name == name)
        middle = np.asarray(radar.position_m, dtype=np.float64)
        out, back = (corners(leg, middle, point)[0] for leg in (path.out, path.back))
        return np.array([*out, *reversed(back[:-1])])

    # -- what is worth its cost --------------------------------------------------------------------

    def prune(
        self, n_chirps: int, noise_power_m2: float, tolerated_m2: float = 0.0
    ) -> tuple[PathSummary, ...]:
        """Leave out echoes over walls that are too weak to matter, and summarize each path.

        One chirp every 100 ms of the capture is evaluated, by geometric optics; without noise, or
        if these were too few, one every 20 ms. An echo is left out if its mean power, after the
        gain of the samples, cycles and channels of a frame, is more than `MARGIN_DB` below the
        noise of one IF sample [m^2]; without noise, if it is never visible. Window functions, which
        lose 1.8 dB each (Hann), are not counted: what is left out is weaker than that. Then the
        weakest of the others go, whose mean powers add up to at most ``tolerated_m2`` [m^2]. Direct
        echoes always stay.
        """
        radar, columns = self._radar, self._columns
        evaluated = chirps_by_steps(radar, n_chirps, self._keyframes.step)
        if noise_power_m2 > 0:
            evaluated = evaluated[:: max(1, min(_LOOK_EVERY, len(evaluated) // _LEAST_LOOKS))]
        # The mean power of each column; new columns may be found on the way.
        power = np.zeros(len(columns))
        for first in range(0, len(evaluated), _CHIRPS_AT_ONCE):
            echoes = self.optical_echoes(evaluated[first : first + _CHIRPS_AT_ONCE])
            found = (np.abs(echoes.amplitude) ** 2).mean(axis=(0, 2)).sum(axis=0)
            found[: len(power)] += power
            power = found
        power /= len(evaluated)
        # Which fraction of the power meets walls whose response is not followed well enough.
        walls = columns.not_followed()
        self.not_followed = {
            name: float(power[[name in own for own in walls]].sum() / power.sum())
            for name in sorted(set().union(*walls))
            if power.sum() > 0
        }
        # The noise after the gain of a frame, against which each echo is judged.
        noise = noise_power_m2 / (
            radar.samples_per_chirp * radar.cycles_per_frame * radar.n_channels
        )
        worth = (power > 0) & (power >= noise * 10 ** (-MARGIN_DB / 10))
        # Of the ghosts that are strong enough, the weakest still go, up to the tolerance.
        echo, direct = np.array(columns.echo), columns.direct
        echo_power = np.zeros(len(direct))
        np.add.at(echo_power, echo, power)
        ghosts = np.flatnonzero(worth & ~direct[echo])
        lost = ghosts[weakest(power[ghosts], tolerated_m2)]
        self.left_out, self.left_out_m2 = len(lost), float(power[lost].sum())
        worth[lost] = False
        # An echo stays if any of its columns does.
        keep, faint = direct.copy(), np.zeros_like(direct)
        keep[echo[worth]], faint[echo[lost]] = True, True
        names = np.array(self._body.part_names, dtype=object)[columns.part]
        summaries = tuple(
            summarize(path, columns.path == number, keep, echo_power, names, noise, weakest=faint)
            for number, path in enumerate(self.paths)
        )
        # Direct echoes have the first columns.
        worth |= direct[echo] & (np.arange(len(echo)) < len(direct))
        self._keyframes.restrict(worth, keep)
        self._keyframes.look_ahead(n_chirps)
        return summaries


def in_free_space(
    before: Callable[[Radar], EchoModel], radar: Radar, body: Body, materials: Sequence[str] = ()
) -> EchoModel:
    """Return the model of a level without a room, for the parameters of `RoomModel`.

    Conductors before isotropic antennas are the level's own; patterns and materials are those of a
    room without walls.
    """
    shaped = is_shaped(radar.tx_antenna) or is_shaped(radar.rx_antenna)
    if not shaped and set(materials) <= {CONDUCTOR}:
        return before(radar)
    return RoomModel(before, Scene(), radar, body, materials)


def _places(radar: Radar) -> Array:
    """Where the middle of the array is looked for walls and faces from (place, 3), world [m]."""
    if radar.path_times_s is None:
        return np.array([radar.position_m])
    return radar.poses_at(np.linspace(radar.path_times_s[0], radar.path_times_s[-1], _PLACES))[1]


def _summaries(found: Sequence[tuple[FaceSummary, ...]]) -> tuple[FaceSummary, ...]:
    """Summarize each face: as at the first place from which it was taken, or at the first place."""
    return tuple(min(own, key=lambda one: bool(one.reason)) for own in zip(*found, strict=True))
