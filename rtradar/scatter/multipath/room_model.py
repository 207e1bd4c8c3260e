"""A room around an echo model: echoes over walls, floor and ceiling, and through walls.

A leg over a wall is straight from the antenna's image, so lengths and amplitudes of every path are
those of the same geometric optics with images for antennas, in float64 at every chirp. What walls,
polarisation, the surface of the body and occluders do to the field changes slowly: it is computed
at keyframes 20 ms apart for the ends of the lines of antennas. In between factors change linearly,
and what appears or vanishes fades smoothly.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.kernels.scatter.nearby_points import Nearby
from rtradar.kernels.scatter.rooms import Blend, PathFactors, path_amplitudes
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayEnds
from rtradar.scatter.common.keyframes import KeyframeCache, keyframe_step
from rtradar.scatter.common.polarization import Surface
from rtradar.scatter.common.poses import ChirpPoses, EchoModel, chirp_poses
from rtradar.scatter.multipath.image_paths import corners, wall_paths
from rtradar.scatter.multipath.keyframes import PathKeyframes, Surroundings, path_keyframes
from rtradar.scatter.multipath.path_echoes import EchoColumns, LegImages
from rtradar.scatter.multipath.path_summary import MARGIN_DB, PathSummary, summarize
from rtradar.scatter.multipath.slab_series import room_series
from rtradar.scatter.multipath.wall_edges import WallEdges
from rtradar.scatter.multipath.wall_interaction import WallResponse
from rtradar.scene import Scene
from rtradar.system.checks import check_order
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer
from rtradar.trace.room_tracer import RoomTracer

Array = NDArray[np.float64]

KEYFRAMES_S = 20e-3
"""Keyframe spacing of echoes over walls [s]. Interpolating leaves an error of -21 dB of the ghosts
(`validation/other_methods/multipath.py`)."""

FIELD_ERROR = 0.02
"""Largest error of the field of an echo over or through a wall, over the sweep, without a limit."""

_ENOUGH, _MOST_NODES = 0.015, 3
"""Part of it that polynomials through so many nodes may take; one pass of `synthesize` takes 3."""

_KEPT_BYTES = 64e6
"""Memory of the keyframes that stay, so that pruning and the signal trace once: 10 s in a box."""

_KEYFRAMES_AT_ONCE = 32
_CHIRPS_AT_ONCE = 64


class RoomReady(EchoModel, Protocol):
    """What `RoomModel` asks of the model that it wraps, one whose ``supports_rooms`` is True.

    ``spreading`` says whether amplitudes hold 1 / (R1 R2); ``surface`` is that of the body;
    ``tracer`` is that of the body, which occludes legs, or None if nothing occludes anything. The
    model also has the method of `HasFormula` or that of `HasSpecularPoints`.
    """

    spreading: bool
    surface: Surface
    tracer: BodyTracer | None


@runtime_checkable
class HasFormula(RoomReady, Protocol):
    """A model with one formula for all echoes: direct ones, and with images those over walls."""

    def conductor_echo(self, at: Geometry) -> tuple[Array, Array]:
        """Compute the echoes of conductors before given antennas.

        Returned are lengths and amplitudes (chirp, rx, part) [m].
        """
        ...


class HasSpecularPoints(RoomReady, Protocol):
    """A model of the specular points of ellipsoids, which the room follows over walls itself."""

    def specular_echo(
        self, chirps: NDArray[np.int64], at: ChirpPoses, start: Array | None = None
    ) -> tuple[Array, Array]:
        """Compute direct echoes at some chirps as if the body were a conductor.

        Points ``start (chirp, part, 3)`` near the specular points, in the axes of the parts [m],
        save steps. Returned are lengths and co-polar amplitudes, with occlusion (chirp, rx, part)
        [m].
        """
        ...


class RoomModel:
    """An echo model in a room, around that of the ``person`` alone.

    Radar and body are those of the model, at their positions in the scene. ``order`` is the largest
    number of reflections at walls on both legs together, 0 to 3; 0 leaves the direct echoes,
    through walls and behind furniture. ``paths`` are all paths, the direct one first;
    ``not_followed``, known after `prune`, are the walls whose frequency response is not known to
    `FIELD_ERROR`, with the fraction of the echo power that meets each.
    """

    def __init__(
        self,
        model: HasFormula | HasSpecularPoints,
        scene: Scene,
        radar: Radar,
        body: Body,
        *,
        order: int = 1,
    ) -> None:
        if not model.spreading and not scene.is_empty:
            raise InputError(
                f"scene '{scene.name}': spreading may be off in free space only; leave "
                "--no-spreading out"
            )
        check_order(order)
        self.person, self._radar, self._body = model, radar, body
        self.variant = model.variant
        series = room_series(
            scene.walls, radar, most_nodes=_MOST_NODES, enough=_ENOUGH, bounces=order
        )
        walls = WallResponse(WallEdges.of(scene.walls, radar), series.walls, series.frequency)
        self.paths = wall_paths(scene.walls, np.asarray(radar.position_m), order)
        self._empty = scene.is_empty
        self._legs = LegImages(radar, self.paths)
        self._columns = EchoColumns(self.paths, len(body.part_names), walls, self._legs)
        tracers = None
        if model.tracer is not None:
            backend = use(select(model.variant or "auto"))
            tracers = model.tracer, RoomTracer(backend, scene)
        self._around = Surroundings(
            walls,
            tracers,
            model.surface.material.eta(series.frequency),
            ArrayEnds.of(radar),
            self.paths,
            radar.polarization,
        )
        self._step = keyframe_step(radar, KEYFRAMES_S)
        self._keyframes: KeyframeCache[int, PathKeyframes] = KeyframeCache(0, _KEYFRAMES_AT_ONCE)
        self.not_followed: dict[str, float] = {}

    @property
    def path_names(self) -> tuple[str, ...]:
        """Path of each echo that `echoes` gave last; before `prune`, more may come."""
        columns = self._columns
        return tuple(self.paths[columns.path[echo]].name for echo in columns.echo)

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Compute the echoes at some chirps.

        The direct echo of each part comes first, then those over walls, then what slabs delay.
        """
        if self._empty:
            return self.person.echoes(chirps)
        chirps, columns = np.asarray(chirps, dtype=np.int64), self._columns
        at = chirp_poses(self._radar, self._body, chirps)
        blend, before, after = self._around_chirps(chirps, at.tx_index)
        interval, fraction, line, tx_weight, _ = blend
        wanted = np.any(before.seen | after.seen, axis=(2, 3))
        near = Nearby(before.start, after.start, wanted, interval, line, fraction, tx_weight)
        # Lengths and bare amplitudes: direct echoes by the model, the others by images.
        n_direct, n_echoes = at.centres.shape[1], len(columns.part)
        person, formula = self.person, None
        if isinstance(person, HasFormula):
            formula = person.conductor_echo
            found = [formula(Geometry.of(at))]
        else:
            start = near.take(slice(n_direct)).places()
            found = [person.specular_echo(chirps, at, start)]
        if n_echoes > n_direct:
            ghosts = slice(n_direct, n_echoes)
            own = columns.path[ghosts], columns.part[ghosts]
            found.append(self._legs.echoes(*own, at, near.take(ghosts), formula))
        length, bare = (np.concatenate(arrays, axis=2) for arrays in zip(*found, strict=True))
        factors = [PathFactors(end.factor, end.seen) for end in (before, after)]
        if columns.delayed:
            echo = np.array(columns.echo)
            length = columns.lengths(at, near.places(), length)
            bare = bare[..., echo]
            factors = [own._replace(seen=own.seen[..., echo]) for own in factors]
        # Times what walls, the body's surface and occluders leave.
        frequency = self._around.walls.frequency
        amplitude = np.empty((len(frequency), *bare.shape), dtype=np.complex64)
        path_amplitudes(bare, *factors, blend, amplitude)
        echo = np.array(columns.echo, dtype=np.int64)
        bounces = 1 + np.array([self.paths[path].order for path in columns.path], dtype=np.int64)
        return Echoes(
            length=length,
            amplitude=amplitude,
            frequency=frequency,
            tx=at.tx_index,
            part=columns.part[echo],
            bounces=bounces[echo],
        )

    def course(self, name: str, point: Array) -> Array:
        """Return the corners (corner, 3) of a path over a point (3,) and back [m].

        The path, given by its name, begins and ends at the middle of the array.
        """
        path = next(path for path in self.paths if path.name == name)
        middle = np.asarray(self._radar.position_m, dtype=np.float64)
        out, back = (corners(leg, middle, point)[0] for leg in (path.out, path.back))
        return np.array([*out, *reversed(back[:-1])])

    def _around_chirps(
        self, chirps: NDArray[np.int64], tx: NDArray[np.int64]
    ) -> tuple[Blend, PathKeyframes, PathKeyframes]:
        """Where the chirps are, and the keyframes before and after each interval."""
        numbers, rest = np.divmod(chirps, self._step)
        starts, interval = np.unique(numbers, return_inverse=True)
        fraction = rest / self._step
        # Where every chirp of an interval is its first, the keyframe after it does not matter.
        stops = starts + (np.bincount(interval, weights=fraction) > 0)
        found = self._find(np.union1d(starts, stops).tolist())
        before, after = (
            _stack([found[number] for number in ends.tolist()], len(self._columns))
            for ends in (starts, stops)
        )
        ends = self._around.ends
        blend = Blend(
            interval, fraction, ends.line_of_tx[tx], ends.tx_weight[tx], ends.rx_weight[tx]
        )
        return blend, before, after

    def _find(self, numbers: list[int]) -> dict[int, PathKeyframes]:
        """Keyframes with these numbers, from the cache or many at a time."""
        cache = self._keyframes
        found = {number: cache[number] for number in numbers if number in cache}
        missing = [number for number in numbers if number not in cache]
        for first in range(0, len(missing), _KEYFRAMES_AT_ONCE):
            some = missing[first : first + _KEYFRAMES_AT_ONCE]
            chirps = np.array(some) * self._step
            at, times = chirp_poses(self._radar, self._body, chirps), self._radar.centres_of(chirps)
            keyframes = path_keyframes(self._around, self._columns, Poses(*at[3:]), times)
            for place, number in enumerate(some):
                own = PathKeyframes(*(array[place].copy() for array in keyframes))
                cache.stay = int(_KEPT_BYTES / sum(array.nbytes for array in own))
                cache.keep(number, own)
                found[number] = own
        return found

    # -- what is worth its cost --------------------------------------------------------------------

    def prune(self, n_chirps: int, noise_power_m2: float) -> tuple[PathSummary, ...]:
        """Leave out echoes over walls that stay below the noise, and summarize each path.

        One chirp every 20 ms of the capture is evaluated. Left out is an echo whose mean power,
        after the gain of the samples, cycles and channels of a frame, is more than `MARGIN_DB`
        below the noise of one IF sample [m^2]; without noise, what is never visible. Window
        functions, which lose 1.8 dB each (Hann), are not counted: what is left out is weaker than
        that. Direct echoes always stay.
        """
        radar, columns = self._radar, self._columns
        evaluated = np.arange(0, n_chirps, self._step)
        power = np.zeros(len(columns))
        for first in range(0, len(evaluated), _CHIRPS_AT_ONCE):
            echoes = self.echoes(evaluated[first : first + _CHIRPS_AT_ONCE])
            found = (np.abs(echoes.amplitude) ** 2).mean(axis=(0, 2)).sum(axis=0)
            found[: len(power)] += power
            power = found
        power /= len(evaluated)
        walls = columns.not_followed()
        self.not_followed = {
            name: float(power[[name in own for own in walls]].sum() / power.sum())
            for name in sorted(set().union(*walls))
            if power.sum() > 0
        }
        noise = noise_power_m2 / (
            radar.samples_per_chirp * radar.cycles_per_frame * radar.n_channels
        )
        worth = (power > 0) & (power >= noise * 10 ** (-MARGIN_DB / 10))
        echo, direct = np.array(columns.echo), columns.direct
        echo_power = np.zeros(len(direct))
        np.add.at(echo_power, echo, power)
        keep = direct.copy()
        keep[echo[worth]] = True
        names = np.array(self._body.part_names, dtype=object)[columns.part]
        summaries = tuple(
            summarize(path, columns.path == number, keep, echo_power, names, noise)
            for number, path in enumerate(self.paths)
        )
        # Direct echoes have the first columns.
        worth |= direct[echo] & (np.arange(len(echo)) < len(direct))
        columns.keep(worth, keep)
        self._keyframes.replace(
            lambda own: PathKeyframes(
                _widened(own.factor, len(worth))[..., worth].copy(),
                own.seen[..., keep].copy(),
                own.start[..., keep, :].copy(),
            )
        )
        return summaries


def _stack(keyframes: list[PathKeyframes], columns: int) -> PathKeyframes:
    factor = np.stack([_widened(own.factor, columns) for own in keyframes])
    seen, start = (np.stack(arrays) for arrays in list(zip(*keyframes, strict=True))[1:])
    return PathKeyframes(factor, seen, start)


def _widened(factor: NDArray[np.complex64], columns: int) -> NDArray[np.complex64]:
    """Add empty columns for what was not yet known."""
    missing = columns - factor.shape[-1]
    return factor if not missing else np.pad(factor, [(0, 0)] * (factor.ndim - 1) + [(0, missing)])
