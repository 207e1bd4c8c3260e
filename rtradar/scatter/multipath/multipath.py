"""The person in a room: echoes over walls, floor and ceiling, and through walls, on top of the models `specular` and `analytic`.

A leg over a wall is straight from the antenna's image, so lengths and returns of every path are those of the same geometric
optics with images for antennas, in float64 at every chirp. What walls, polarisation, the surface of the body and shadows do to
the field changes slowly: it is found at anchors 20 ms apart for the ends of the lines of antennas (`path_anchors`). In between
coefficients go straight, and what appears or vanishes fades as in `occlusion`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.kernels.scatter.nearby_points import Nearby
from rtradar.radar import Radar
from rtradar.scatter.common.array_ends import ArrayEnds
from rtradar.scatter.common.body_material import Surface, body_material
from rtradar.scatter.common.poses import ChirpPoses, anchor_step, chirp_poses, one_echo_a_part
from rtradar.scatter.echo_models import MODELS, models_that
from rtradar.scatter.models.analytic import far_field_echo
from rtradar.scatter.multipath.image_paths import WallPath, corners, wall_paths
from rtradar.scatter.multipath.interpolation import weigh
from rtradar.scatter.multipath.keyframes import PathAnchors, Surroundings, path_anchors
from rtradar.scatter.multipath.path_summary import MARGIN_DB, PathAccount, account
from rtradar.scatter.multipath.slab_delays import PathTerms
from rtradar.scatter.multipath.slab_series import room_series
from rtradar.scatter.multipath.wall_echoes import WallEchoes
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.scatter.specular_point.visibility import SpecularVisibility
from rtradar.scene import Scene

ANCHORS_S = 20e-3
"""Between instants at which what is left of echoes over walls is found: ghosts are within -21 dB (`validation/other_methods/multipath.py`)."""

FIELD_ERROR = 0.02
"""Of the field of an echo through or over a wall, at most, over the sweep; beyond it a limit tells."""

_ENOUGH, _MOST_NODES = 0.015, 3
"""Of that, what polynomials through so many nodes of the sweep may take; one pass of `synthesize` takes no more of them."""

_KEPT_BYTES = 64e6
"""Of anchors that are remembered, so that pruning and the signal trace once: 10 s of a room of six walls."""

_ANCHORS_AT_ONCE = 32
_CHIRPS_AT_ONCE = 64


class Multipath:
    """`specular` or `analytic` in a room.

    Parameters
    ----------
    radar : Radar
        Where it stands in the scene, see `Scene.place`.
    body : Body
    scene : Scene
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend, which says what furniture and body hide; `analytic` hides nothing and needs none.
    spreading : bool
        Whether amplitudes hold 1 / (R1 R2).
    order : int
        Most reflections at walls on both legs together; 0 leaves the direct echoes, through walls and behind furniture.
    fidelity : {"specular", "analytic"}
        Model of the body.
    material : {"perfect-conductor", "skin"}
        Material of the body's surface.

    Attributes
    ----------
    paths : tuple of WallPath
    not_followed : dict of str to float
        Walls whose frequency response is not known to `FIELD_ERROR`, and the share of the echo power that meets each; by `prune`.

    Raises
    ------
    InputError
        Where spreading is off though there are walls or furniture, the order is no whole number from 0 to 3, or a material is not
        known over the sweep.
    BackendError
        Where it traces and no backend of that kind works here.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        scene: Scene,
        *,
        variant: str = "auto",
        spreading: bool = True,
        order: int = 1,
        fidelity: str = "specular",
        material: str = "perfect-conductor",
    ) -> None:
        if not spreading and (scene.walls or scene.furniture):
            raise InputError(
                f"scene '{scene.name}': spreading may be off in free space only; leave --no-spreading out"
            )
        if isinstance(order, bool) or order not in range(4):
            raise InputError(
                f"order = {order!r} of reflections at walls; it must be a whole number from 0 to 3"
            )
        if fidelity not in (allowed := models_that("supports_rooms")):
            raise InputError(
                f"fidelity '{fidelity}' knows no walls; allowed in a room: {', '.join(allowed)}"
            )
        traces: bool = MODELS[fidelity].traces  # type: ignore[attr-defined]
        self._radar, self._body, self._spreading = radar, body, spreading
        self.variant: str | None = None
        self._visibility: SpecularVisibility | None = None
        tracers = None
        if traces:
            from rtradar.trace.backends.backend import select, use
            from rtradar.trace.body_tracer import BodyTracer
            from rtradar.trace.room_tracer import RoomTracer

            backend = select(variant)
            self.variant = backend.kind
            mi = use(backend)
            tracer = BodyTracer(mi, body.semi_axes)
            self._visibility = SpecularVisibility(radar, body, tracer)
            tracers = (tracer, RoomTracer(mi, scene))
        series = room_series(
            scene.walls, radar, most_nodes=_MOST_NODES, enough=_ENOUGH, bounces=order
        )
        self._frequency = series.frequency
        self._surface = Surface(material, radar)
        eta = body_material(material, self._frequency).eta(self._frequency)
        self._around = Surroundings(
            scene, series.walls, tracers, eta, self._frequency, radar.polarization
        )
        self._plain = not scene.walls and not scene.furniture and material == "perfect-conductor"
        self._ends = ArrayEnds.of(radar)
        self._step = anchor_step(radar, ANCHORS_S)
        self.paths: tuple[WallPath, ...] = wall_paths(
            scene.walls, np.asarray(radar.position_m), order
        )
        self._over_walls = WallEchoes(radar, self.paths, far_field=not traces)
        parts = len(body.part_names)
        self._path, self._part = (
            array.ravel() for array in np.divmod(np.arange(len(self.paths) * parts), parts)
        )
        self._terms = PathTerms(radar, scene, series.walls, self.paths, self._path)
        self.not_followed: dict[str, float] = {}
        self._kept: dict[int, PathAnchors] = {}

    @property
    def person(self) -> PersonAlone:
        """The person without the room, by the same tracer and the same shadows."""
        return PersonAlone(self)

    @property
    def path_names(self) -> tuple[str, ...]:
        """Path of each echo that `echoes` gave last; more may come while a capture is gone through, until `prune`."""
        return tuple(self.paths[self._path[echo]].name for echo in self._terms.echo)

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps: the direct one of each part first, then those over walls, then those that slabs delay."""
        chirps = np.asarray(chirps, dtype=np.int64)
        at = chirp_poses(self._radar, self._body, chirps)
        if self._plain:
            length, amplitude = self._direct(chirps, at)
            return self._as_echoes(at.tx_index, length, amplitude.astype(np.complex128)[None])
        interval, share, before, after = self._around_chirps(chirps)
        line, tx_weight = self._ends.line_of_tx[at.tx_index], self._ends.tx_weight[at.tx_index]
        wanted = np.any(before.seen | after.seen, axis=(2, 3))
        near = Nearby(before.start, after.start, wanted, interval, line, share, tx_weight)
        n_direct, n_echoes = at.centres.shape[1], len(self._part)
        length, amplitude = self._direct(chirps, at, near.take(slice(n_direct)).places())
        shape = (len(self._frequency), *length.shape[:2])
        lengths, bare = (
            np.empty((*length.shape[:2], n_echoes)),
            np.empty((*length.shape[:2], n_echoes)),
        )
        lengths[..., :n_direct], bare[..., :n_direct] = length, amplitude
        if n_echoes > n_direct:
            ghosts = slice(n_direct, n_echoes)
            lengths[..., ghosts], bare[..., ghosts] = self._over_walls.at(
                self._path[ghosts], self._part[ghosts], at, near.take(ghosts)
            )
        seen_before, seen_after = before.seen, after.seen
        if self._terms.delayed:
            echo = np.array(self._terms.echo)
            lengths = self._terms.lengths(at, near.places(), self._part, lengths)
            bare, seen_before, seen_after = (
                array[..., echo] for array in (bare, seen_before, seen_after)
            )
        out = np.empty((*shape, len(self._terms)), dtype=np.complex64)
        weights = tx_weight, self._ends.rx_weight[at.tx_index]
        weigh(
            bare,
            before.factor,
            after.factor,
            seen_before,
            seen_after,
            share,
            interval,
            line,
            *weights,
            out,
        )
        return self._as_echoes(at.tx_index, lengths, out)

    def course(self, name: str, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Corners (corner, 3) of a path, by its name, from the middle of the array over a point (3,) and back [m]."""
        path = next(path for path in self.paths if path.name == name)
        middle = np.asarray(self._radar.position_m, dtype=np.float64)
        out, back = (corners(leg, middle, point)[0] for leg in (path.out, path.back))
        return np.array([*out, *reversed(back[:-1])])

    def _as_echoes(
        self, tx: NDArray[np.int64], length: NDArray[np.float64], amplitude: NDArray[np.complex128]
    ) -> Echoes:
        echo = np.array(self._terms.echo, dtype=np.int64)
        bounces = 1 + np.array([self.paths[path].order for path in self._path], dtype=np.int64)
        return Echoes(
            length=length,
            amplitude=amplitude,
            frequency=self._frequency,
            tx=tx,
            part=self._part[echo],
            bounces=bounces[echo],
        )

    def _direct(
        self, chirps: NDArray[np.int64], at: ChirpPoses, near: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Direct echoes of a conductor; a start ``near (chirp, part, 3)`` the specular point saves steps."""
        if self._visibility is None:
            return far_field_echo(at, spreading=self._spreading)
        weight, met = self._visibility.at(chirps)
        start = met if near is None else near
        length, amplitude, _ = solve_specular_points(
            at, start=start, polarization=self._radar.polarization, spreading=self._spreading
        )
        return length, amplitude * weight

    # -- anchors -------------------------------------------------------------------------------------------------

    def _around_chirps(
        self, chirps: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64], PathAnchors, PathAnchors]:
        """Interval of each chirp, share of it that is over, and the anchors before and after each interval."""
        intervals, interval = np.unique(chirps // self._step, return_inverse=True)
        share = chirps % self._step / self._step
        ends = np.concatenate(
            [
                intervals,
                intervals[[bool(share[interval == i].any()) for i in range(len(intervals))]] + 1,
            ]
        )
        self._find(np.unique(ends))
        before = _stack([self._kept[int(number)] for number in intervals], len(self._terms))
        # Where every chirp of an interval is its first, what comes after it does not matter.
        after = _stack(
            [self._kept.get(int(number) + 1, self._kept[int(number)]) for number in intervals],
            len(self._terms),
        )
        return interval, share, before, after

    def _find(self, numbers: NDArray[np.int64]) -> None:
        missing = [int(number) for number in numbers if int(number) not in self._kept]
        for first in range(0, len(missing), _ANCHORS_AT_ONCE):
            some = missing[first : first + _ANCHORS_AT_ONCE]
            at = chirp_poses(self._radar, self._body, np.array(some) * self._step)
            found = path_anchors(
                self._around,
                self._ends,
                self.paths,
                self._path,
                self._part,
                self._terms,
                Poses(*at[3:]),
            )
            for place, number in enumerate(some):
                self._kept[number] = PathAnchors(*(array[place].copy() for array in found))
        needed = set(numbers.tolist())
        # The first that came stay, for a recording is gone through twice, from its start.
        size = max(
            (sum(array.nbytes for array in anchor) for anchor in self._kept.values()), default=1
        )
        for number in [number for number in self._kept if number not in needed][
            int(_KEPT_BYTES / size) :
        ]:
            del self._kept[number]

    # -- what is worth its cost ------------------------------------------------------------------------------------

    def prune(self, n_chirps: int, noise_power_m2: float) -> tuple[PathAccount, ...]:
        """Leave out echoes over walls that stay below the noise.

        Parameters
        ----------
        n_chirps : int
            Number of chirps of the capture; one every 20 ms is evaluated.
        noise_power_m2 : float
            Per IF sample; 0 leaves out only what is never seen. Left out is an echo whose mean power over the capture, after
            the gain of adding up the samples, cycles and channels of a frame, is more than `MARGIN_DB` below the noise. Windows,
            which lose 1.8 dB each as Hann's, are not counted: what is left out is weaker than that.

        Returns
        -------
        tuple of PathAccount
            One for each path; direct echoes always stay.
        """
        radar = self._radar
        looked_at = np.arange(0, n_chirps, self._step)
        column_power = np.zeros(len(self._terms))
        for first in range(0, len(looked_at), _CHIRPS_AT_ONCE):
            echoes = self.echoes(looked_at[first : first + _CHIRPS_AT_ONCE])
            found = (np.abs(echoes.amplitude) ** 2).mean(axis=(0, 2)).sum(axis=0)
            found[: len(column_power)] += column_power
            column_power = found
        column_power /= len(looked_at)
        walls = self._terms.not_followed()
        self.not_followed = {
            name: float(column_power[[name in own for own in walls]].sum() / column_power.sum())
            for name in sorted(set().union(*walls))
            if column_power.sum() > 0
        }
        gain = radar.samples_per_chirp * radar.cycles_per_frame * radar.n_channels
        worth = (column_power > 0) & (
            column_power * gain >= noise_power_m2 * 10 ** (-MARGIN_DB / 10)
        )
        echo = np.array(self._terms.echo)
        power, keep = np.zeros(len(self._part)), np.zeros(len(self._part), dtype=bool)
        np.add.at(power, echo, column_power)
        np.logical_or.at(keep, echo, worth)
        direct = np.array([self.paths[number].order == 0 for number in self._path])
        keep |= direct
        names = np.array(self._body.part_names, dtype=object)[self._part]
        accounts = tuple(
            account(path, self._path == number, keep, power, names, noise_power_m2 / gain)
            for number, path in enumerate(self.paths)
        )
        self._leave_out(keep, worth | (direct[echo] & (np.arange(len(echo)) < len(direct))))
        return accounts

    def _leave_out(self, keep: NDArray[np.bool_], columns: NDArray[np.bool_]) -> None:
        self._path, self._part = self._path[keep], self._part[keep]
        self._terms.keep(columns, keep)
        for number, anchor in self._kept.items():
            (factor, seen, start), count = anchor, len(columns)
            kept = _widened(factor, count)[..., columns].copy()
            self._kept[number] = PathAnchors(
                kept, seen[..., keep].copy(), start[..., keep, :].copy()
            )


class PersonAlone:
    """The person of a `Multipath` in free space: the model `specular` or `analytic`, at no further tracing."""

    def __init__(self, room: Multipath) -> None:
        self._room = room
        self.variant = room.variant

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        room = self._room
        at = chirp_poses(room._radar, room._body, chirps)
        length, amplitude = room._direct(chirps, at)
        return one_echo_a_part(
            at.tx_index, length, room._surface.echo(at, amplitude), room._radar.centre_frequency_hz
        )


def _stack(anchors: list[PathAnchors], columns: int) -> PathAnchors:
    factor, seen, start = zip(*anchors, strict=True)
    return PathAnchors(
        np.stack([_widened(own, columns) for own in factor]), np.stack(seen), np.stack(start)
    )


def _widened(factor: NDArray[np.complex64], columns: int) -> NDArray[np.complex64]:
    """With nothing in the columns that were not yet known."""
    missing = columns - factor.shape[-1]
    return factor if not missing else np.pad(factor, [(0, 0)] * (factor.ndim - 1) + [(0, missing)])
