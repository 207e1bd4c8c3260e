"""What walls, the body's surface and occluders leave of the echoes at keyframes, path by path.

A leg carries the field of its antenna as a vector, over and through walls by the coefficients of
their slabs, to the specular point on the body. Both legs begin at their antennas: by reciprocity a
receiver receives what it would send. Specular points are those for the middles of the lines of
antennas, legs run from the ends of the lines. A slab that delays makes several waves of one, each
with its own delay: an echo has a column for each pair of those of its legs.

Keyframes are computed many at a time, kept, and found again.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.front_end import Antenna
from rtradar.kernels.scatter.nearby_points import Nearby
from rtradar.kernels.scatter.rooms import Blend, received_from_conductors
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayEnds
from rtradar.scatter.common.polarization import (
    Polarization,
    Surfaces,
    bisector,
    over_copolar,
)
from rtradar.scatter.common.poses import KeyframeCache, keyframe_before, keyframe_step
from rtradar.scatter.multipath.image_paths import Leg, SolidFace, WallPath
from rtradar.scatter.multipath.path_echoes import NO_DELAYS, DelayingPassages, EchoColumns
from rtradar.scatter.multipath.slabs import Passages, WallResponse
from rtradar.scatter.multipath.solid_edges import SolidEdges
from rtradar.system.threads import in_threads, thread_map
from rtradar.trace.body_tracer import BodyTracer

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

_FLAT = 0.01
"""A factor that changes by less over the sweep, 0.1 dB, is made equal at all nodes.

`synthesize` is faster for such an echo.
"""

_FAINT = 2e-3
"""Terms weaker than this fraction of the strongest of an echo are left out."""


class PathKeyframes(NamedTuple):
    """What is left of the echoes at keyframes.

    ``factor (keyframe, node, line, 2, rx_end, column)`` complex64 is the co-polar field over that
    of the bare return, for exp(+j omega t); for a direct echo, and any of a ``whole_level``, over
    that of a conductor. ``seen (keyframe, line, 2, rx_end, echo)`` bool. ``start (keyframe, line,
    2, echo, 3)`` are specular points for both ends of the lines of Tx in the axes of the parts [m].
    """

    factor: NDArray[np.complex64]
    seen: NDArray[np.bool_]
    start: NDArray[np.float32]


class Surroundings(NamedTuple):
    """What a path meets: walls, occluders, antennas and the surfaces of the body.

    The ``occluders`` are the body, and furniture and objects, None for no occlusion.
    ``whole_level`` says that bare returns over walls are those of a model before images of the
    antennas: then they hold the co-polar fraction of a conductor, and what the body occludes of the
    last section.
    """

    radar: Radar
    walls: WallResponse
    occluders: tuple[BodyTracer, SolidEdges] | None
    surfaces: Surfaces
    ends: ArrayEnds
    paths: Sequence[WallPath]
    whole_level: bool

    @property
    def polarization(self) -> Polarization:
        """Polarisation of the antennas."""
        return Polarization(self.radar.polarization, self.radar.axes)


def path_keyframes(
    around: Surroundings, columns: EchoColumns, poses: Poses, times: Array
) -> PathKeyframes:
    """Compute what is left of the echoes at some poses, with objects where they are at ``times``.

    Columns that are met for the first time are added. Whether other parts occlude a direct echo,
    and any of a ``whole_level`` on its last sections, is decided by the model, not here.
    """
    points, start, exists = columns.specular_points(around.ends, poses)
    radar, ends = around.radar, around.ends
    ways = [path.out for path in around.paths], [path.back for path in around.paths]
    antennas = (ends.tx, radar.tx_antenna), (ends.rx, radar.rx_antenna)
    legs = thread_map(
        lambda side: _carry(around, ways[side], columns.path, points, *antennas[side]), range(2)
    )
    # Echoes of which the model itself knows how the last sections end.
    known = np.flatnonzero(columns.direct | around.whole_level)
    factors = [
        (chosen, met, _left(around, legs, known, columns.part[chosen], chosen, *fields))
        for chosen, met, fields in _pairs(around.paths, columns.path, legs)
    ]
    if around.occluders is not None:
        out, back = (_past_solids(around.occluders[1], leg, exists, times) for leg in legs)
        for chosen, _, found in factors:
            found *= out[:, :, :, None, chosen] * back[:, :, None, :, chosen]
    strength = np.zeros((*exists.shape[:2], 2, around.ends.rx.shape[1], len(columns.path)))
    for chosen, _, found in factors:
        strength[..., chosen] = np.maximum(strength[..., chosen], np.abs(found).max(axis=0))
    seen = legs[0].valid[:, :, :, None] & legs[1].valid[:, :, None] & (strength > 0)
    seen &= exists[:, :, None, None]
    if around.occluders is not None:
        seen &= _not_occluded(around.occluders[0], legs, seen, poses, columns.part, known)
    factor = _in_columns(columns, factors, strength)
    middle = factor[len(factor) // 2]
    change = np.abs(factor - middle) <= _FLAT * np.abs(middle)
    flat = np.all(change, axis=(0, 2, 3, 4), keepdims=True)
    factor = np.moveaxis(np.where(flat, middle, factor), 0, 1)
    return PathKeyframes(factor.astype(np.complex64), seen, start.astype(np.float32))


def _in_columns(
    columns: EchoColumns,
    factors: Sequence[tuple[NDArray[np.int64], DelayingPassages, Field]],
    strength: Array,
) -> Field:
    """Factors (node, keyframe, line, 2, rx_end, column), without terms that are faint anywhere."""
    parts = []
    for chosen, met, found in factors:
        size = np.abs(found).max(axis=0)
        counts = ((size > _FAINT * strength[..., chosen]) & (size > 0)).any(axis=(0, 1, 2, 3))
        column = np.full(len(chosen), -1)
        column[counts] = [columns.column(echo, met) for echo in chosen[counts].tolist()]
        parts.append((column[column >= 0], found[..., column >= 0]))
    out = np.zeros((len(parts[0][1]), *strength.shape[:-1], len(columns)), dtype=np.complex128)
    for column, found in parts:
        out[..., column] = found
    return out


# -- fields ----------------------------------------------------------------------------------------


class _Carried(NamedTuple):
    """Legs from the ends of the lines to the specular points.

    ``field (node, keyframe, line, end, echo, 3)`` arrives without delay in slabs; ``waves`` are all
    fields of the echoes of a leg, by what they met; ``of_leg (echo,)`` counts the echoes of each
    leg. ``arriving (keyframe, line, end, echo, 3)`` is the direction, ``valid (keyframe, line, end,
    echo)``.
    """

    field: Field
    waves: dict[Leg, dict[Passages, Field]]
    of_leg: NDArray[np.int64]
    arriving: Array
    valid: NDArray[np.bool_]
    sections: list[_Section]


class _Section(NamedTuple):
    """A straight section of the legs of some echoes, from origins to targets (..., 3) [m].

    It may be the ``last`` one, and reflected ``at_solid``, a face of furniture.
    """

    echo: NDArray[np.int64]
    origins: Array
    targets: Array
    last: bool
    at_solid: bool


def _carry(
    around: Surroundings,
    legs: Sequence[Leg],
    path: NDArray[np.int64],
    points: Array,
    antennas: Array,
    antenna: Antenna | None,
) -> _Carried:
    """Carry the fields of antennas over the legs of some paths, each echo by that of its own."""
    shape = (points.shape[0], *antennas.shape[:2], points.shape[2])
    field = np.zeros((len(around.walls.frequency), *shape, 3), dtype=np.complex128)
    arriving, valid = np.empty((*shape, 3)), np.empty(shape, dtype=bool)
    of_leg, sections, all_waves = np.empty(len(path), dtype=np.int64), [], {}
    paths: dict[Leg, list[int]] = {}
    for number in np.unique(path).tolist():
        paths.setdefault(legs[number], []).append(number)
    for leg, numbers in paths.items():
        chosen = np.flatnonzero(np.isin(path, numbers))
        of_leg[chosen] = np.arange(len(chosen))
        ends = antennas[:, :, None], points[:, :, None, chosen]
        own = around.walls.carried(leg, *ends, antenna, around.polarization)
        valid[..., chosen] = own.extent != 0
        for step, (origins, targets) in enumerate(pairwise(own.corners)):
            start, end = np.broadcast_arrays(origins, targets)
            at_solid = any(isinstance(face.wall, SolidFace) for face in leg)
            sections.append(_Section(chosen, start, end, step == len(leg), at_solid))
        all_waves[leg] = {wave.passages: wave.field for wave in own.waves}
        field[..., chosen, :] = all_waves[leg].setdefault((), field[..., chosen, :])
        arriving[..., chosen, :] = own.ways[-1]
    return _Carried(field, all_waves, of_leg, arriving, valid, sections)


def _pairs(
    paths: Sequence[WallPath], path: NDArray[np.int64], legs: Sequence[_Carried]
) -> Iterator[tuple[NDArray[np.int64], DelayingPassages, tuple[Field, Field]]]:
    """Echoes, what they met, and the fields (node, keyframe, line, end, echo, 3) of both legs."""
    out, back = legs
    yield np.arange(len(path)), NO_DELAYS, (out.field, back.field)
    for number in np.unique(path):
        there, here = out.waves[paths[number].out], back.waves[paths[number].back]
        if len(there) == len(here) == 1:
            continue
        chosen = np.flatnonzero(path == number)
        for (met_out, sent), (met_back, received) in product(there.items(), here.items()):
            if (met_out, met_back) != NO_DELAYS:
                fields = sent[..., out.of_leg[chosen], :], received[..., back.of_leg[chosen], :]
                yield chosen, (met_out, met_back), fields


def _left(
    around: Surroundings,
    legs: Sequence[_Carried],
    known: NDArray[np.int64],
    part: NDArray[np.int64],
    chosen: NDArray[np.int64],
    sent: Field,
    received: Field,
) -> Field:
    """Co-polar field over that of the bare return, (node, keyframe, line, 2, rx_end, echo)."""
    back_tx, back_rx = (-leg.arriving[..., chosen, :] for leg in legs)
    to_tx, to_rx = back_tx[:, :, :, None], back_rx[:, :, None]
    if around.surfaces.conduct:
        shape = *sent.shape[:4], received.shape[3], len(chosen)
        factor = np.empty(shape, dtype=np.complex128)
        fields = (np.ascontiguousarray(array) for array in (sent, received, back_tx, back_rx))
        in_threads(received_from_conductors, shape[1], *fields, factor)
    else:
        arrives = sent[:, :, :, :, None], -to_tx, bisector(to_tx, to_rx)
        returned = around.surfaces.reflected(part, *arrives, around.walls.frequency)
        factor = np.asarray(np.sum(received[:, :, :, None] * returned, axis=-1))
    # A conductor at normal incidence counts as +1: that the field is reversed is in the sign.
    np.negative(factor, out=factor)
    own = np.flatnonzero(np.isin(chosen, known))
    if len(own):
        # The bare return of these holds the co-polar fraction of a conductor.
        ways = to_tx[..., own, :], to_rx[..., own, :]
        factor[..., own] = over_copolar(factor[..., own], *ways, around.polarization)
    return factor


# -- occlusion -------------------------------------------------------------------------------------


def _past_solids(
    solids: SolidEdges, leg: _Carried, exists: NDArray[np.bool_], times: Array
) -> Field:
    """What furniture and objects leave of the field on a leg, (keyframe, line, end, echo)."""
    asked = leg.valid & exists[:, :, None]
    left = asked.astype(np.complex128)
    for echo, origins, targets, _, at_solid in leg.sections:
        own = left[..., echo]
        still = own != 0
        moments = np.broadcast_to(times[:, None, None, None], still.shape)[still]
        # What a face of furniture reflects has its edges already.
        given = origins[still], targets[still], moments
        own[still] *= solids.left(*given, bent=not at_solid)
        left[..., echo] = own
    return left


def _not_occluded(
    body: BodyTracer,
    legs: Sequence[_Carried],
    seen: NDArray[np.bool_],
    poses: Poses,
    part: NDArray[np.int64],
    known: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Whether the body leaves both legs free, (keyframe, line, 2, rx_end, echo).

    Of the last sections of the ``known`` echoes the model knows that itself.
    """
    keyframes, kinds = len(seen), len(poses.semi_axes) + 1
    # A group for each part at each keyframe, and one for targets on no part.
    parts = np.tile(np.append(np.arange(kinds - 1), -1), keyframes)
    pose = np.repeat(np.arange(keyframes), kinds)
    both = [np.logical_or.reduce(seen, axis=axis) for axis in (3, 2)]
    for leg, clear in zip(legs, both, strict=True):
        rays = []
        for chosen, origins, targets, last, _ in leg.sections:
            asked = ~np.isin(chosen, known) if last else np.ones(len(chosen), dtype=bool)
            where = np.nonzero(clear[..., chosen] & asked)
            echo = chosen[where[-1]]
            # At the specular point the part itself cannot be in the way, before a wall it can.
            own = part[echo] if last else np.full(len(echo), kinds - 1)
            rays.append((origins[where], targets[where], where[0] * kinds + own, *where[:-1], echo))
        starts, stops, group, keyframe, line, end, echo = (
            np.concatenate(column) for column in zip(*rays, strict=True)
        )
        occluded = ~body.clear(starts, stops, group, parts, pose, poses)
        clear[keyframe[occluded], line[occluded], end[occluded], echo[occluded]] = False
    return np.asarray(both[0][:, :, :, None] & both[1][:, :, None])


# -- many keyframes --------------------------------------------------------------------------------


KEYFRAMES_S = 20e-3
"""Keyframe spacing of echoes over walls [s]. Interpolating leaves an error of -21 dB of the ghosts
(`validation/other_methods/multipath.py`)."""

_KEPT_BYTES = 64e6
"""Memory of the keyframes that stay, so that pruning and the signal trace once: 10 s in a box."""

_KEYFRAMES_AT_ONCE = 32


class RoomKeyframes:
    """Keyframes of the echoes of a ``body``, in their ``columns``, every ``step`` chirps."""

    def __init__(self, around: Surroundings, columns: EchoColumns, body: Body) -> None:
        self._around, self.columns, self._body = around, columns, body
        self.step = keyframe_step(around.radar, KEYFRAMES_S)
        self._cache: KeyframeCache[int, PathKeyframes] = KeyframeCache(0, _KEYFRAMES_AT_ONCE)

    def direct(self) -> RoomKeyframes:
        """Return those of the direct echoes alone, with what is already known of them."""
        other, keep = copy.copy(self), self.columns.direct
        other.columns, other._cache = copy.copy(self.columns), self._cache.copy()
        other.restrict(keep[np.array(self.columns.echo)], keep)
        return other

    def around(
        self, chirps: NDArray[np.int64], tx: NDArray[np.int64]
    ) -> tuple[Blend, PathKeyframes, PathKeyframes]:
        """Return where chirps are, and the keyframes before and after each interval.

        ``tx (chirp,)`` are their transmitters.
        """
        numbers, rest = keyframe_before(self._around.radar, chirps, self.step)
        starts, interval = np.unique(numbers, return_inverse=True)
        fraction = rest / self.step
        # Where every chirp of an interval is its first, the keyframe after it does not matter.
        stops = starts + (np.bincount(interval, weights=fraction) > 0)
        found = self._find(np.union1d(starts, stops).tolist())
        before, after = (
            _stack([found[number] for number in ends.tolist()], len(self.columns))
            for ends in (starts, stops)
        )
        ends = self._around.ends
        blend = Blend(
            interval, fraction, ends.line_of_tx[tx], ends.tx_weight[tx], ends.rx_weight[tx]
        )
        return blend, before, after

    def look_ahead(self, n_chirps: int) -> None:
        """Compute the keyframes of a capture that stay, many at a time."""
        self._find(list(range(min(-(-n_chirps // self.step) + 1, self._cache.stay))))

    def _find(self, numbers: list[int]) -> dict[int, PathKeyframes]:
        """Keyframes with these numbers, from the cache or many at a time."""
        cache = self._cache
        found = {number: cache[number] for number in numbers if number in cache}
        missing, radar = [number for number in numbers if number not in found], self._around.radar
        at_once = 1 if radar.is_moving else _KEYFRAMES_AT_ONCE
        for first in range(0, len(missing), at_once):
            some = missing[first : first + at_once]
            times = radar.gapless.centres_of(np.array(some) * self.step)
            poses = self._body.at(np.minimum(times, self._body.duration_s))
            around, there = self._around, radar.at(float(times[0]))
            if radar.is_moving:
                around = around._replace(radar=there, ends=ArrayEnds.of(there))
            keyframes = path_keyframes(around, self.columns, poses, times)
            for place, number in enumerate(some):
                own = PathKeyframes(*(array[place].copy() for array in keyframes))
                cache.stay = int(_KEPT_BYTES / sum(array.nbytes for array in own))
                cache.keep(number, own)
                found[number] = own
        return found

    def restrict(self, column: NDArray[np.bool_], echo: NDArray[np.bool_]) -> None:
        """Leave out all other columns and all other echoes for good."""
        self.columns.keep(column, echo)
        self._cache.replace(
            lambda own: PathKeyframes(
                _widened(own.factor, len(column))[..., column].copy(),
                own.seen[..., echo].copy(),
                own.start[..., echo, :].copy(),
            )
        )


def nearby_points(blend: Blend, before: PathKeyframes, after: PathKeyframes) -> Nearby:
    """Return the specular points that are expected at chirps between keyframes."""
    wanted = np.any(before.seen | after.seen, axis=(2, 3))
    interval, fraction, line, tx_weight, _ = blend
    return Nearby(before.start, after.start, wanted, interval, line, fraction, tx_weight)


def _stack(keyframes: list[PathKeyframes], columns: int) -> PathKeyframes:
    factor = np.stack([_widened(own.factor, columns) for own in keyframes])
    seen, start = (np.stack(arrays) for arrays in list(zip(*keyframes, strict=True))[1:])
    return PathKeyframes(factor, seen, start)


def _widened(factor: NDArray[np.complex64], columns: int) -> NDArray[np.complex64]:
    """Add empty columns for what was not yet known."""
    missing = columns - factor.shape[-1]
    return factor if not missing else np.pad(factor, [(0, 0)] * (factor.ndim - 1) + [(0, missing)])
