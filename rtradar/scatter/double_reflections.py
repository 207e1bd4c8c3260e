"""Reflections from one part of a body to another and on to the radar, by geometric optics.

Each ordered pair of parts has one such path, as `rtradar.kernels.scatter.double_reflections` finds
it. Parts that touch have none here: the crease between two ellipsoids returns like a corner that no
person has. Mitsuba decides at keyframes what hides the three legs.
"""

from __future__ import annotations

from functools import partial
from itertools import combinations
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body, Ellipsoids
from rtradar.echoes import Echoes
from rtradar.kernels.elementary import smoothstep
from rtradar.kernels.scatter.double_reflections import solve_double
from rtradar.kernels.scatter.specular_point import Geometry, Options
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import together
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.common.poses import (
    BuiltInModel,
    ChirpPoses,
    KeyframeCache,
    check_option,
    chirp_poses,
    keyframe_before,
    keyframe_step,
    keyframe_time,
)
from rtradar.scatter.specular_points import sees, solve_specular_points
from rtradar.scatter.target import sum_of_echoes, target_geometry
from rtradar.system.threads import in_threads
from rtradar.trace.tracers import BodyTracer

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Visible = NDArray[np.bool_]

LEAST_DB = -30.0
"""Power of a pair over that of the single reflections of its person, below which it is left out."""

_FADE_DB = 3.0
"""Range above that power in which a pair fades in, so that none begins with a jump."""

_KEPT, _PASSING = 2048, 2


class Doubles(NamedTuple):
    """Lengths [m], amplitudes [m] (chirp, rx, pair), points (chirp, rx, pair, 2, 3) [m]."""

    length: Array
    amplitude: Array
    points: Array


class TwoBounceModel(BuiltInModel):
    """A model with one path for each part, to which reflections between parts may be added.

    They are its ``doubles``.
    """

    doubles: DoubleReflections | None = None

    def account(self) -> dict[str, Any] | None:
        """List the pairs of parts that reflect one after the other."""
        return None if self.doubles is None else self.doubles.account()

    def _with_doubles(self, single: Echoes, chirps: Indices) -> Echoes:
        """Put the reflections from part to part, if any are asked for, after the single ones."""
        return single if self.doubles is None else self.doubles.beside(single, chirps)


def check_bounces(fidelity: str, bounces: int) -> None:
    """Raise InputError unless a level with one path a part is asked for one or two reflections."""
    allowed = "1, or 2 for reflections from part to part; 'rays' takes more"
    check_option(fidelity, "bounces", bounces, bounces in (1, 2), allowed)


def solve_doubles(
    at: Geometry | ChirpPoses,
    pairs: Indices,
    *,
    polarization: Polarization,
    start: Array | None = None,
    spreading: bool = True,
) -> Doubles:
    """Find the paths over ``pairs (pair, 2)`` of parts, as if each pair stood alone.

    The search begins at ``start (chirp, pair, 2, 3)``, unit vectors in the axes in which the parts
    are unit spheres, NaN where nothing is known. The amplitude is that of equation
    :eq:`double-reflection` of the theory page, 0 where there is no path.
    """
    at = Geometry.of(at)
    shape = (*at.rx.shape[:2], len(pairs))
    length, amplitude, points = np.empty(shape), np.empty(shape), np.empty((*shape, 2, 3))
    # The solver replaces the places where it begins, so it gets a copy.
    first = np.full((len(at.tx), len(pairs), 2, 3), np.nan) if start is None else start.copy()
    options = Options(horizontal=polarization.kind == "h", spreading=spreading)
    # The antennas' up is one for all chirps, or each chirp has its own.
    above = np.empty(at.tx.shape)
    above[:] = polarization.up
    given = at, above, pairs, first, options, length, amplitude, points
    in_threads(solve_double, len(at.tx), *given)
    return Doubles(length, amplitude, points)


def pairs_apart(centres: Array, frames: Array, semi_axes: Array) -> Indices:
    """List ordered pairs (pair, 2) of ellipsoids that do not touch in a pose."""
    pairs = np.array(list(combinations(range(len(semi_axes)), 2)), dtype=np.int64).reshape(-1, 2)
    # Pairs whose bounding balls are apart need no further test.
    gaps = np.linalg.norm(centres[pairs[:, 1]] - centres[pairs[:, 0]], axis=1)
    near = np.flatnonzero(gaps <= semi_axes.max(axis=1)[pairs].sum(axis=1))
    touching = np.zeros(len(pairs), dtype=bool)
    touching[near] = _touch(centres[pairs[near]], frames[pairs[near]], semi_axes[pairs[near]])
    apart = pairs[~touching]
    # A wave may meet either part of a pair first.
    return np.concatenate([apart, apart[:, ::-1]])


def _touch(centres: Array, frames: Array, axes: Array) -> NDArray[np.bool_]:
    """Whether pairs of ellipsoids (pair, 2, ...) overlap.

    They do not if d^T (A / (1 - s) + B / s)^-1 d exceeds 1 for some 0 < s < 1. Here d is the vector
    between their centres, and A and B are their matrices of squared semi-axes (J. W. Perram, M. S.
    Wertheim, *J. Comput. Phys.* 58, 1985, 409).
    """
    # The matrices of squared semi-axes in the world, and the values of s that stand for all.
    forms = (frames * axes[:, :, None] ** 2) @ np.swapaxes(frames, -1, -2)
    apart = centres[:, 1] - centres[:, 0]
    s = np.linspace(0.02, 0.98, 49)[:, None, None]
    mixed = forms[:, None, 0] / (1 - s) + forms[:, None, 1] / s  # (pair, s, 3, 3)
    solved = np.linalg.solve(mixed, np.broadcast_to(apart[:, None, :, None], (*mixed.shape[:3], 1)))
    return np.asarray((solved[..., 0] @ apart[..., None])[..., 0].max(axis=1) <= 1)


def legs_clear(tracer: BodyTracer, tx: Array, rx: Array, points: Array, pairs: Indices) -> Visible:
    """Whether no part hides any of the three legs, (chirp, rx, pair) bool, of the posed body."""
    # The tracer leaves out the part that a line ends on. So the leg from part to part is asked in
    # two halves, from its middle to either end.
    sent, received, (own, other) = points[..., 0, :], points[..., 1, :], pairs.T
    middle = (sent + received) / 2
    lines = [(tx[:, None, None], sent, own), (middle, sent, own)]
    lines += [(middle, received, other), (rx[:, :, None], received, other)]
    return np.asarray(np.all([sees(tracer, *line) for line in lines], axis=0))


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
    found = solve_doubles(at, pairs, polarization=Polarization(polarization))
    tracer.pose(target.centres, target.frames)
    clear = legs_clear(tracer, at.tx, at.rx, found.points, pairs)
    return sum_of_echoes(found.length, found.amplitude * clear, at, frequency)


class _Keyframe(NamedTuple):
    """Pairs (pair, 2) that return something, how much counts (pair,), and unit vectors to begin at.

    ``start (pair, 2, 3)`` are in the axes in which the parts are unit spheres.
    """

    pairs: Indices
    weight: Array
    start: Array


class DoubleReflections:
    """Reflections over two parts of a moving body, for any chirps.

    At keyframes 10 ms apart ``pairs`` are chosen: those that do not touch, whose legs are free
    between the middles of the antennas, and whose power exceeds ``least_db`` of that of the single
    reflections of the person they belong to, or of the weaker of both people. A pair fades in above
    that level, and between keyframes. Nothing depends on how long the recording is, nor on who else
    is there. Lengths and amplitudes are computed at every chirp and receiver.
    """

    least_db = LEAST_DB
    pairs = staticmethod(pairs_apart)

    def __init__(
        self,
        radar: Radar,
        body: Body,
        tracer: BodyTracer,
        *,
        spreading: bool = True,
    ) -> None:
        self._radar, self._body, self._tracer = radar, body, tracer
        self._spreading, self._step = spreading, keyframe_step(radar)
        self._keyframes: KeyframeCache[int, _Keyframe] = KeyframeCache(_KEPT, _PASSING)
        parts = len(body.part_names)
        self._power, self._beside = np.zeros((parts, parts)), np.zeros((parts, parts))

    def account(self) -> dict[str, Any]:
        """Name the parts of each pair, strongest first, with its power where it is kept [dB]."""
        # Only pairs that were kept at some keyframe have any power.
        names, pairs = self._body.part_names, np.argwhere(self._power)
        own = tuple(pairs.T)
        decibels = 10 * np.log10(self._power[own] / self._beside[own])
        rows = [
            {
                "first": names[pairs[place, 0]],
                "last": names[pairs[place, 1]],
                "over_single_reflections_db": round(float(decibels[place]), 1),
            }
            for place in np.argsort(-decibels)
        ]
        return {"double_reflections": rows}

    def beside(self, single: Echoes, chirps: NDArray[np.int64]) -> Echoes:
        """Put echoes of these chirps after the single reflections, each of the part met last."""
        pairs, weight, start = self._known(chirps)
        if not len(pairs):
            return single
        at = chirp_poses(self._radar, self._body, chirps)
        found = solve_doubles(
            at,
            pairs,
            start=start,
            polarization=Polarization(self._radar.polarization, at.axes),
            spreading=self._spreading,
        )
        # Between keyframes a pair fades; its path is solved at every chirp all the same.
        amplitude = (found.amplitude * weight[:, None]).astype(np.complex128)
        double = Echoes(
            length=found.length,
            amplitude=amplitude[None],
            frequency=np.array([self._radar.centre_frequency_hz]),
            tx=at.tx_index,
            part=pairs[:, 1],
            bounces=np.full(len(pairs), 2),
        )
        return together([single, double])

    def _known(self, chirps: NDArray[np.int64]) -> tuple[Indices, Array, Array]:
        """Pairs (pair, 2), weights (chirp, pair), and where to begin (chirp, pair, 2, 3)."""
        # The keyframes on both sides of each chirp.
        before, rest = keyframe_before(self._radar, chirps, self._step)
        numbers = np.unique([before, before + 1]).tolist()
        keyframes = [
            self._keyframes.get(number, partial(self._trace, number)) for number in numbers
        ]
        # The pairs of all these keyframes, each once, and where those of each keyframe are among
        # them.
        every = np.concatenate([keyframe.pairs for keyframe in keyframes])
        pairs, place = np.unique(every, axis=0, return_inverse=True)
        stops = np.cumsum([len(keyframe.pairs) for keyframe in keyframes])
        places = np.split(place.ravel(), stops[:-1])
        weight = np.zeros((len(chirps), len(pairs)))
        start = np.full((len(chirps), len(pairs), 2, 3), np.nan)
        # Weights go smoothly from one keyframe to the next. The search begins at the points of
        # either keyframe that knows the pair.
        ramp = smoothstep(rest / self._step)
        for number, keyframe, own in zip(numbers, keyframes, places, strict=True):
            for inside, share in ((before == number, 1 - ramp), (before + 1 == number, ramp)):
                some = np.flatnonzero(inside)
                weight[np.ix_(some, own)] += share[some, None] * keyframe.weight
                begun = start[np.ix_(some, own)]
                start[np.ix_(some, own)] = np.where(np.isnan(begun), keyframe.start, begun)
        return np.ascontiguousarray(pairs), weight, start

    def _trace(self, number: int) -> _Keyframe:
        # The pose, before the middles of all Tx and of all Rx.
        time_s = keyframe_time(self._radar, self._body, number * self._step)
        radar, (centres, frames, semi_axes) = self._radar.at(time_s), self._body.at([time_s])
        tx, rx = (antennas.mean(axis=0)[None] for antennas in (radar.tx, radar.rx))
        at = Geometry(tx, rx[:, None], centres, frames, semi_axes)
        pairs = self.pairs(centres[0], frames[0], semi_axes)
        sent = Polarization(radar.polarization, radar.axes)
        found = solve_doubles(at, pairs, polarization=sent)
        # The power of each pair over that of the single reflections of the person, or of the weaker
        # of both people that it belongs to.
        power = found.amplitude[0, 0] ** 2
        single = solve_specular_points(at, polarization=sent)[1][0, 0] ** 2
        owner = self._body.owner
        of_person = np.bincount(owner, weights=single, minlength=len(self._body.names))
        beside = of_person[owner[pairs]].min(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            above_db = 10 * np.log10(power / beside) - self.least_db
        worth = np.flatnonzero(above_db > 0)
        pairs, points = pairs[worth], found.points[:, :, worth]
        # Legs are traced only for the pairs that are worth it.
        self._tracer.pose(centres[0], frames[0])
        clear = legs_clear(self._tracer, tx, rx[:, None], points, pairs)[0, 0]
        weight = clear * smoothstep(np.minimum(above_db[worth] / _FADE_DB, 1.0))
        # Sums over keyframes, for the account.
        for sums, values in ((self._power, power), (self._beside, beside)):
            sums[tuple(pairs[clear].T)] += values[worth][clear]
        # To the axes in which the parts are unit spheres.
        away = points[0, 0] - centres[0, pairs]
        local = np.einsum("neji,nej->nei", frames[0, pairs], away)
        return _Keyframe(pairs[clear], weight[clear], (local / semi_axes[pairs])[clear])
