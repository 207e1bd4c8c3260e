"""Reflections from one part of a body to another and on to the radar, by geometric optics.

Each ordered pair of parts has one such path, as `rtradar.kernels.scatter.double_reflections` finds
it. Parts that touch have none here: the crease between two ellipsoids returns like a corner that no
person has. Mitsuba decides at keyframes what hides the three legs.
"""

from __future__ import annotations

from functools import partial
from itertools import combinations, permutations
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body, Ellipsoids
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.kernels.elementary import smoothstep
from rtradar.kernels.scatter.double_reflections import solve_double
from rtradar.kernels.scatter.specular_point import Geometry, Options
from rtradar.radar import Radar
from rtradar.scatter.common.echo_sets import together
from rtradar.scatter.common.keyframes import KeyframeCache, keyframe_before, keyframe_step
from rtradar.scatter.common.poses import BuiltInModel, ChirpPoses, chirp_poses
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.scatter.target import sum_of_echoes, target_geometry
from rtradar.system.threads import thread_map
from rtradar.trace.body_tracer import BodyTracer

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Visible = NDArray[np.bool_]

LEAST_DB = -30.0
"""Power of a pair over that of all single reflections, below which it is left out: of a walker at
12 GHz 14 of 240 stay (`validation/other_methods/double_reflections.py`)."""

_INSTANTS = 50
"""Chirps of a recording at which the power of pairs is looked at."""

_CHIRPS_PER_THREAD = 16
_KEPT, _PASSING = 2048, 2


class Doubles(NamedTuple):
    """Lengths [m], amplitudes [m] (chirp, rx, pair), points (chirp, rx, pair, 2, 3) [m]."""

    length: Array
    amplitude: Array
    points: Array


class TwoBounceModel(BuiltInModel):
    """A model of one path a part, to which reflections from part to part may be added."""

    _double: DoubleReflections | None = None

    def _reflect_twice(
        self, radar: Radar, body: Body, tracer: BodyTracer, *, spreading: bool
    ) -> None:
        """Add reflections from part to part from now on."""
        self._double = DoubleReflections(radar, body, tracer, spreading=spreading)

    def account(self) -> dict[str, Any] | None:
        """List the pairs of parts that reflect one after the other."""
        return None if self._double is None else self._double.account()

    def _with_doubles(self, single: Echoes, chirps: Indices) -> Echoes:
        """Put the reflections from part to part, if any are asked for, after the single ones."""
        return single if self._double is None else self._double.beside(single, chirps)


def check_bounces(fidelity: str, bounces: int) -> None:
    """Raise InputError unless a level of one path a part is asked for one or two reflections."""
    if bounces not in (1, 2):
        raise InputError(
            f"{fidelity}: bounces = {bounces!r}; it must be 1, or 2 for reflections from part to "
            "part; 'rays' takes more"
        )


def solve_doubles(
    at: Geometry | ChirpPoses,
    pairs: Indices,
    *,
    start: Array | None = None,
    polarization: Literal["v", "h"] = "v",
    spreading: bool = True,
) -> Doubles:
    """Find the paths over ``pairs (pair, 2)`` of parts, as if each pair stood alone.

    The search begins at ``start (chirp, pair, 2, 3)``, unit vectors in the axes in which the parts
    are unit spheres, NaN where nothing is known. Equation :eq:`double-reflection` of the theory
    page; the amplitude is 0 where there is no path.
    """
    at = Geometry.of(at)
    shape = (*at.rx.shape[:2], len(pairs))
    length, amplitude, points = np.empty(shape), np.empty(shape), np.empty((*shape, 2, 3))
    first = np.full((len(at.tx), len(pairs), 2, 3), np.nan) if start is None else start.copy()
    options = Options(polarized=True, horizontal=polarization == "h", spreading=spreading)

    def some(begin: int) -> None:
        end = min(begin + _CHIRPS_PER_THREAD, len(at.tx))
        solve_double(begin, end, at, pairs, first, options, length, amplitude, points)

    thread_map(some, range(0, len(at.tx), _CHIRPS_PER_THREAD))
    return Doubles(length, amplitude, points)


def pairs_apart(centres: Array, frames: Array, semi_axes: Array) -> Indices:
    """List ordered pairs (pair, 2) of ellipsoids that do not touch in a pose."""
    apart = [
        pair
        for pair in map(list, combinations(range(len(semi_axes)), 2))
        if not _touch(centres[pair], frames[pair], semi_axes[pair])
    ]
    return np.array([*apart, *(pair[::-1] for pair in apart)], dtype=np.int64).reshape(-1, 2)


def _touch(centres: Array, frames: Array, axes: Array) -> bool:
    """Whether two ellipsoids overlap.

    They do not if for some 0 < s < 1 d^T (A / (1 - s) + B / s)^-1 d exceeds 1, with A and B their
    matrices of squared semi-axes (J. W. Perram, M. S. Wertheim, *J. Comput. Phys.* 58, 1985, 409).
    """
    one, other = (frame * own**2 @ frame.T for frame, own in zip(frames, axes, strict=True))
    apart = centres[1] - centres[0]
    s = np.linspace(0.02, 0.98, 49)[:, None, None]
    solved = np.linalg.solve(one / (1 - s) + other / s, np.broadcast_to(apart, (49, 3))[..., None])
    return bool((solved[..., 0] @ apart).max() <= 1)


def legs_clear(tracer: BodyTracer, tx: Array, rx: Array, points: Array, pairs: Indices) -> Visible:
    """Whether no part hides any of the three legs, (chirp, rx, pair) bool, of the posed body."""
    shape = points.shape[:3]
    sent, received = (points[..., end, :].reshape(-1, 3) for end in (0, 1))
    own, other = (np.broadcast_to(pairs[:, end], shape).ravel() for end in (0, 1))
    middle = (sent + received) / 2
    from_tx, from_rx = (
        np.broadcast_to(antennas, (*shape, 3)).reshape(-1, 3)
        for antennas in (tx[:, None, None], rx[:, :, None])
    )
    lines = [(from_tx, sent, own), (middle, sent, own)]
    lines += [(middle, received, other), (from_rx, received, other)]
    clear = [tracer.sees(*line).reshape(shape) for line in lines]
    return np.asarray(np.all(clear, axis=0))


def double_scattering(
    target: Ellipsoids,
    tx: Array,
    rx: Array,
    frequency: Array,
    polarization: Literal["v", "h"],
    tracer: BodyTracer,
) -> NDArray[np.complex128]:
    """Scattering length (n,) of the reflections over two parts; see `scattering_length`."""
    at = target_geometry(target, tx, rx)
    pairs = pairs_apart(target.centres, target.frames, target.semi_axes)
    if not len(pairs):
        return np.zeros(len(tx), dtype=np.complex128)
    found = solve_doubles(at, pairs, polarization=polarization)
    tracer.pose(target.centres, target.frames)
    clear = legs_clear(tracer, at.tx, at.rx, found.points, pairs)
    return sum_of_echoes(found.length, found.amplitude * clear, at, frequency)


class DoubleReflections:
    """Reflections over two parts of a moving body, for any chirps.

    Chosen once are pairs whose power, over some instants of the recording, exceeds ``least_db`` of
    that of all single reflections; ``pairs (pair, 2)`` and their ``power_db (pair,)``. Lengths and
    amplitudes are those of every chirp and receiver; what hides a leg is asked between the middles
    of the lines of antennas at keyframes 10 ms apart, and fades in between. Parts that touch at any
    of these instants reflect from one to the other only if ``touching``.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        tracer: BodyTracer,
        *,
        spreading: bool = True,
        least_db: float = LEAST_DB,
        touching: bool = False,
    ) -> None:
        self._radar, self._body, self._tracer = radar, body, tracer
        self._spreading, self._step = spreading, keyframe_step(radar)
        self._keyframes: KeyframeCache[int, tuple[Visible, Array]]
        self._keyframes = KeyframeCache(_KEPT, _PASSING)
        self.pairs, self.power_db = self._worth(least_db, touching)

    def _at(self, times: Array) -> Geometry:
        """Poses at some times [s], before the middles of the lines of antennas."""
        tx, rx = (
            np.tile(antennas.mean(axis=0), (len(times), 1))
            for antennas in (self._radar.tx, self._radar.rx)
        )
        centres, frames, semi_axes = self._body.at(times)
        return Geometry(tx, rx[:, None], centres, frames, semi_axes)

    def _worth(self, least_db: float, touching: bool) -> tuple[Indices, Array]:
        times = np.linspace(0.0, self._body.duration_s, _INSTANTS)
        at = self._at(times)
        parts = len(at.semi_axes)
        every = np.array(list(permutations(range(parts), 2)), dtype=np.int64).reshape(-1, 2)
        if not touching:
            apart = np.zeros((len(times), parts, parts), dtype=bool)
            for number, (centres, frames) in enumerate(zip(at.centres, at.frames, strict=True)):
                own = pairs_apart(centres, frames, at.semi_axes)
                apart[number, own[:, 0], own[:, 1]] = True
            always = np.flatnonzero(apart[:, every[:, 0], every[:, 1]].all(axis=0))
            every = every[always]
        if not len(every):
            return every, np.empty(0)
        found = solve_doubles(at, every, polarization=self._radar.polarization)
        clear = [self._clear(at, found.points, every, number) for number in range(len(times))]
        power = (found.amplitude[:, 0] ** 2 * np.stack(clear)).mean(axis=0)
        whole = (solve_specular_points(at)[1] ** 2).sum(axis=2).mean()
        with np.errstate(divide="ignore"):
            decibels = 10 * np.log10(power / whole)
        kept = np.flatnonzero(decibels > least_db)
        return np.ascontiguousarray(every[kept]), decibels[kept]

    def _clear(self, at: Geometry, points: Array, pairs: Indices, pose: int) -> Visible:
        """Which pairs (pair,) have all legs clear in one pose."""
        one = slice(pose, pose + 1)
        self._tracer.pose(at.centres[pose], at.frames[pose])
        clear = legs_clear(self._tracer, at.tx[one], at.rx[one], points[one], pairs)
        return clear.reshape(-1)

    def account(self) -> dict[str, Any]:
        """Name the parts of each pair that is kept, strongest first, with its mean power [dB]."""
        names, order = self._body.part_names, np.argsort(-self.power_db)
        rows = [
            {
                "first": names[self.pairs[pair, 0]],
                "last": names[self.pairs[pair, 1]],
                "over_single_reflections_db": round(float(self.power_db[pair]), 1),
            }
            for pair in order
        ]
        return {"double_reflections": rows}

    def beside(self, single: Echoes, chirps: NDArray[np.int64]) -> Echoes:
        """Put echoes of these chirps after the single reflections, each of the part met last."""
        at = chirp_poses(self._radar, self._body, chirps)
        visible, start = self._known(chirps)
        found = solve_doubles(
            at,
            self.pairs,
            start=start,
            polarization=self._radar.polarization,
            spreading=self._spreading,
        )
        amplitude = (found.amplitude * visible[:, None]).astype(np.complex128)
        double = Echoes(
            length=found.length,
            amplitude=amplitude[None],
            frequency=np.array([self._radar.centre_frequency_hz]),
            tx=at.tx_index,
            part=self.pairs[:, 1],
            bounces=np.full(len(self.pairs), 2),
        )
        return together([single, double])

    def _known(self, chirps: NDArray[np.int64]) -> tuple[Array, Array]:
        """Visibility (chirp, pair), and where the search begins (chirp, pair, 2, 3)."""
        before, rest = keyframe_before(self._radar, chirps, self._step)
        visible = np.empty((len(chirps), len(self.pairs)))
        start = np.empty((len(chirps), len(self.pairs), 2, 3))
        for interval in np.unique(before).tolist():
            inside = np.flatnonzero(before == interval)
            clear, start[inside] = self._keyframe(interval)
            after, _ = self._keyframe(interval + 1)
            ramp = smoothstep(rest[inside] / self._step)[:, None]
            visible[inside] = (1 - ramp) * clear + ramp * after
        return visible, start

    def _keyframe(self, number: int) -> tuple[Visible, Array]:
        return self._keyframes.get(number, partial(self._trace, number))

    def _trace(self, number: int) -> tuple[Visible, Array]:
        time_s = self._radar.gapless.centres_of(np.array([number * self._step]))
        at = self._at(np.minimum(time_s, self._body.duration_s))
        found = solve_doubles(at, self.pairs, polarization=self._radar.polarization)
        clear = self._clear(at, found.points, self.pairs, 0) & (found.amplitude[0, 0] != 0)
        # To the axes in which the parts are unit spheres.
        apart = found.points[0, 0] - at.centres[0, self.pairs]
        local = np.einsum("neji,nej->nei", at.frames[0, self.pairs], apart)
        start = local / at.semi_axes[self.pairs]
        start[found.amplitude[0, 0] == 0] = np.nan
        return clear, start
