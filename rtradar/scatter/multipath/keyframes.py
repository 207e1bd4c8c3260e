"""What walls, the body's surface and occluders leave of the echoes at keyframes, path by path.

A leg carries the field of its antenna as a vector, over and through walls by the coefficients of
their slabs, to the specular point on the body. Both legs begin at their antennas: by reciprocity a
receiver receives what it would send. The specular point is that for the middles of the lines of
antennas. Legs run from the ends of the lines, in free space from every Tx. A slab that delays makes
several waves of one, each with its own delay: an echo has a column for each pair of such waves on
its two legs.

Keyframes are computed many at a time, kept, and found again.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.kernels.scatter.rooms import Blend, PathFactors, received_from_conductors
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayEnds
from rtradar.scatter.common.polarization import (
    Polarization,
    Surfaces,
    bisector,
    over_copolar,
)
from rtradar.scatter.common.poses import KeyframeCache, keyframe_before, keyframe_step
from rtradar.scatter.multipath.image_paths import SolidFace, WallPath, images
from rtradar.scatter.multipath.path_echoes import DelayingPassages, EchoColumns
from rtradar.scatter.multipath.slabs import WallResponse
from rtradar.scatter.multipath.solid_edges import SolidEdges
from rtradar.scatter.specular_points import solve_specular_points
from rtradar.system.threads import thread_map
from rtradar.trace.tracers import BodyTracer

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

    ``factor (keyframe, node, line, tx_end, rx_end, column)`` complex64 is the co-polar field over
    that of the bare return, for exp(+j omega t); for a direct echo, and any of a ``whole_level``,
    over that of a conductor. ``seen (keyframe, line, tx_end, rx_end, echo)`` bool. ``start
    (keyframe, line, tx_end, echo, 3)`` are specular points for the ends of the lines of Tx, in the
    axes of the parts [m].
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
    and any echo of a ``whole_level`` on its last sections, is decided by the model, not here.
    """
    # Each path carries the fields of its legs by itself.
    numbers = np.unique(columns.path).tolist()
    paths = thread_map(
        lambda place: _over(around, columns, numbers[place], poses), range(len(numbers))
    )
    # Where legs exist, and where the search for specular points begins at the chirps.
    shape = len(times), *around.ends.tx.shape[:2], around.ends.rx.shape[1], len(columns.path)
    keyframes, lines, tx_ends, rx_ends, echoes = shape
    free = np.zeros((keyframes, lines, tx_ends + rx_ends, echoes), dtype=bool)
    start = np.empty((keyframes, lines, tx_ends, echoes, 3), dtype=np.float32)
    for own in paths:
        free[..., own.echo], start[..., own.echo, :] = own.free, own.start
    # What solids leave of the straight sections multiplies the fields of the legs.
    sections = [section for own in paths for section in own.sections]
    left = free.astype(np.complex128)
    if around.occluders is not None:
        _past_solids(around.occluders[1], sections, free, times, left)
    of_pairs = _both(left, tx_ends)
    # The strongest term of each echo says which echoes are seen at all, and which terms are faint.
    strength = np.zeros(shape)
    for own in paths:
        for found in own.fields.values():
            found *= of_pairs[..., own.echo]
            size = np.abs(found).max(axis=0)
            strength[..., own.echo] = np.maximum(strength[..., own.echo], size)
    seen = strength > 0
    # The body is asked only about legs of echoes that are seen.
    if around.occluders is not None:
        asked = np.concatenate([seen.any(axis=3), seen.any(axis=2)], axis=2)
        clear = _past_body(around.occluders[0], sections, asked, poses, columns.part)
        seen &= _both(clear, tx_ends)
    # Factors that hardly change over the sweep are made equal at all nodes.
    factor = _in_columns(columns, paths, strength, len(around.walls.frequency))
    middle = factor[len(factor) // 2]
    change = np.abs(factor - middle) <= _FLAT * np.abs(middle)
    flat = np.all(change, axis=(0, 2, 3, 4), keepdims=True)
    factor = np.moveaxis(np.where(flat, middle, factor), 0, 1)
    return PathKeyframes(factor.astype(np.complex64), seen, start)


def _both(of_legs: NDArray[Any], tx_ends: int) -> NDArray[Any]:
    """Multiply both legs, given from all ends: (keyframe, line, tx_end, rx_end, echo)."""
    return np.asarray(of_legs[:, :, :tx_ends, None] * of_legs[:, :, None, tx_ends:])


def _in_columns(columns: EchoColumns, paths: Sequence[_Over], strength: Array, nodes: int) -> Field:
    """Factors (node, keyframe, line, tx_end, rx_end, column), without terms faint everywhere."""
    # A term has a column of its own if it is not faint at some keyframe.
    parts = []
    for own in paths:
        for met, found in own.fields.items():
            size = np.abs(found).max(axis=0)
            counts = (size > _FAINT * strength[..., own.echo]) & (size > 0)
            chosen = np.flatnonzero(counts.any(axis=(0, 1, 2, 3)))
            column = np.array([columns.column(echo, met) for echo in own.echo[chosen]], dtype=int)
            known = np.flatnonzero(column >= 0)
            parts.append((column[known], found[..., chosen[known]]))
    out = np.zeros((nodes, *strength.shape[:-1], len(columns)), dtype=np.complex128)
    for column, found in parts:
        out[..., column] = found
    return out


# -- one path --------------------------------------------------------------------------------------


class _Section(NamedTuple):
    """A straight section of the legs of some echoes, from origins to targets (..., 3) [m].

    It belongs to the legs from the ends of a line from ``first`` on, where the ends of Tx come
    before those of Rx. It may be the ``last`` section, for which the model may know what the body
    hides (``known``), and its leg may be reflected ``at_solid``, a face of furniture.
    """

    echo: NDArray[np.int64]
    first: int
    origins: Array
    targets: Array
    last: bool
    known: bool
    at_solid: bool


class _Over(NamedTuple):
    """The echoes ``echo (n,)`` of one path.

    ``fields (node, keyframe, line, tx_end, rx_end, n)`` are the co-polar fields over the bare
    return, by the passages that delay them; ``free (keyframe, line, end, n)`` says where the legs
    from all ends of a line exist; ``start`` is that of `PathKeyframes`.
    """

    echo: NDArray[np.int64]
    fields: dict[DelayingPassages, Field]
    free: NDArray[np.bool_]
    start: Array
    sections: list[_Section]


def _over(around: Surroundings, columns: EchoColumns, number: int, poses: Poses) -> _Over:
    """Carry the fields of all antennas over both legs of a path, and put them together."""
    path, echo = around.paths[number], np.flatnonzero(columns.path == number)
    part, (ends, radar) = columns.part[echo], (around.ends, around.radar)
    # Both legs end at the specular point for the middle of the lines, and begin at their ends.
    points, near, exists = specular_points(path, part, ends, poses)
    known = around.whole_level or not path.order
    legs, sections = [], []
    for leg, antennas, antenna, first in (
        (path.out, ends.tx, radar.tx_antenna, 0),
        (path.back, ends.rx, radar.rx_antenna, ends.tx.shape[1]),
    ):
        given = antennas[:, :, None], points[:, :, None], antenna, around.polarization
        legs.append(around.walls.carried(leg, *given))
        at_solid = any(isinstance(face.wall, SolidFace) for face in leg)
        for step, between in enumerate(pairwise(legs[-1].corners)):
            last = step == len(leg)
            start, stop = np.broadcast_arrays(*between)
            sections.append(_Section(echo, first, start, stop, last, last and known, at_solid))
    # Every wave that arrives, with every wave that the receiver would send.
    out, back = legs
    fields = {
        (sent.passages, received.passages): _left(
            around, part, known, (-out.ways[-1], -back.ways[-1]), sent.field, received.field
        )
        for sent, received in product(out.waves, back.waves)
    }
    free = np.concatenate([leg.extent != 0 for leg in legs], axis=2) & exists[:, :, None]
    return _Over(echo, fields, free, near, sections)


def specular_points(
    path: WallPath, part: NDArray[np.int64], ends: ArrayEnds, poses: Poses
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Find the specular points of parts (echo,) over a path, and whether there is one at all.

    Returned are points for the middles of the lines (keyframe, line, echo, 3), world [m]; for the
    ends of the lines of Tx (keyframe, line, tx_end, echo, 3), in the axes of the parts [m]; and
    (keyframe, line, echo) bool.
    """
    # The middle of each line of Tx and its ends, all with the middle of the receivers kept.
    tx = np.concatenate([ends.tx_middle[:, None], ends.tx], axis=1)
    count, pairs = len(poses.centres), tx.shape[:2]
    rx = np.repeat(images(path.back, ends.rx_middle), pairs[1], axis=0)
    # Keyframes and lines become poses, with one transmitter and one receiver each.
    antennas = np.tile(images(path.out, tx).reshape(-1, 3), (count, 1)), np.tile(rx, (count, 1))
    centres, frames = poses.centres[:, part], poses.frames[:, part]
    posed = [np.repeat(own, len(rx), axis=0) for own in (centres, frames)]
    at = Geometry(antennas[0], antennas[1][:, None], posed[0], posed[1], poses.semi_axes[part])
    _, amplitude, found = solve_specular_points(at, points=True)
    points = found.reshape(count, *pairs, len(part), 3)
    exists = (amplitude != 0).reshape(points.shape[:-1])
    away = points[:, :, 1:] - centres[:, None, None]
    return points[:, :, 0], np.einsum("keji,klsej->klsei", frames, away), exists[:, :, 0]


def _left(
    around: Surroundings,
    part: NDArray[np.int64],
    known: bool,
    ways: tuple[Array, Array],
    sent: Field,
    received: Field,
) -> Field:
    """Co-polar field over that of the bare return, (node, keyframe, line, tx_end, rx_end, echo).

    The unit ``ways (keyframe, line, end, echo, 3)`` go from the body back over both legs. If
    ``known``, the bare return holds the co-polar fraction of a conductor already.
    """
    # All ends of Tx with all ends of Rx.
    to_tx, to_rx = ways[0][:, :, :, None], ways[1][:, :, None]
    if around.surfaces.conduct:
        shape = *sent.shape[:4], received.shape[3], len(part)
        factor = np.empty(shape, dtype=np.complex128)
        fields = (np.ascontiguousarray(array) for array in (sent, received, *ways))
        received_from_conductors(0, shape[1], *fields, factor)
    else:
        arrives = sent[:, :, :, :, None], -to_tx, bisector(to_tx, to_rx)
        returned = around.surfaces.reflected(part, *arrives, around.walls.frequency)
        factor = np.asarray(np.sum(received[:, :, :, None] * returned, axis=-1))
    # A conductor at normal incidence counts as +1: that the field is reversed is in the sign.
    np.negative(factor, out=factor)
    return over_copolar(factor, to_tx, to_rx, around.polarization) if known else factor


# -- occlusion -------------------------------------------------------------------------------------


def _rays(
    sections: Sequence[_Section], asked: NDArray[np.bool_]
) -> tuple[Array, Array, NDArray[np.bool_], tuple[NDArray[np.int64], ...]]:
    """List the sections of the legs that are asked about (keyframe, line, end, echo).

    Returned are both ends (ray, 3) [m], whether they are the last of their leg, and which leg.
    """
    found = []
    for section in sections:
        which = slice(section.first, section.first + section.origins.shape[2])
        at = np.nonzero(asked[:, :, which, section.echo])
        leg = *at[:2], at[2] + section.first, section.echo[at[3]]
        ends = section.origins[at], section.targets[at]
        found.append((*ends, np.full(len(at[0]), section.last), *leg))
    starts, stops, last, *legs = (np.concatenate(column) for column in zip(*found, strict=True))
    return starts, stops, last, tuple(legs)


def _past_solids(
    solids: SolidEdges,
    sections: Sequence[_Section],
    free: NDArray[np.bool_],
    times: Array,
    left: Field,
) -> None:
    """Multiply what is left of legs (keyframe, line, end, echo) by what solids leave.

    Only legs that are ``free`` of walls are asked about.
    """
    for at_solid in (False, True):
        own = [section for section in sections if section.at_solid == at_solid]
        if own:
            starts, stops, _, legs = _rays(own, free)
            # A wave that a face of furniture reflects has the edges of that face already.
            passed = solids.left(starts, stops, times[legs[0]], bent=not at_solid)
            np.multiply.at(left, legs, passed)


def _past_body(
    body: BodyTracer,
    sections: Sequence[_Section],
    asked: NDArray[np.bool_],
    poses: Poses,
    part: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Whether the body leaves the legs free that are ``asked`` (keyframe, line, end, echo).

    What it occludes of ``known`` sections the model knows itself.
    """
    own = [section for section in sections if not section.known]
    if not own:
        return asked
    starts, stops, last, legs = _rays(own, asked)
    # A part cannot occlude its own specular point, but it can occlude a leg before a wall.
    target = np.where(last, part[legs[3]], -1)
    occluded = ~body.clear(starts, stops, np.arange(len(starts)), target, legs[0], poses)
    clear = asked.copy()
    clear[tuple(index[occluded] for index in legs)] = False
    return clear


# -- many keyframes --------------------------------------------------------------------------------


KEYFRAMES_S = 20e-3
"""Keyframe spacing of echoes over walls [s]. Interpolating leaves an error of -21 dB of the ghosts
(`validation/other_methods/multipath.py`)."""

_KEPT_BYTES = 64e6
"""Memory of the keyframes that stay, so that pruning and the signal trace once: 10 s in a box."""

_KEYFRAMES_AT_ONCE = 32

_KEYFRAMES_RAD = math.radians(3.0)
"""Most that a radar turns from one keyframe to the next [rad], for the sake of its patterns."""


def _turning(radar: Radar, duration_s: float) -> float:
    """Largest rate at which a radar turns [rad/s]."""
    if not radar.is_moving:
        return 0.0
    # The largest rotation from one keyframe to the next.
    axes = radar.poses_at(np.arange(0.0, duration_s + KEYFRAMES_S, KEYFRAMES_S))[0]
    turns = Rotation.from_matrix(np.swapaxes(axes[:-1], 1, 2) @ axes[1:])
    return float(turns.magnitude().max(initial=0.0)) / KEYFRAMES_S


class RoomKeyframes:
    """Keyframes of the echoes of a ``body``, in their ``columns``, every ``step`` chirps."""

    def __init__(self, around: Surroundings, columns: EchoColumns, body: Body) -> None:
        self._around, self.columns, self._body = around, columns, body
        turning = _turning(around.radar, body.duration_s)
        apart_s = min(KEYFRAMES_S, _KEYFRAMES_RAD / max(turning, 1e-9))
        self.step = keyframe_step(around.radar, apart_s)
        self._cache: KeyframeCache[int, PathKeyframes] = KeyframeCache(0, _KEYFRAMES_AT_ONCE)

    def direct(self) -> RoomKeyframes:
        """Return the keyframes of the direct echoes alone, with what is already known of them."""
        other, keep = copy.copy(self), self.columns.direct
        other.columns = copy.copy(self.columns)
        other.restrict(keep[np.array(self.columns.echo)], keep)
        return other

    def around(
        self, chirps: NDArray[np.int64], tx: NDArray[np.int64]
    ) -> tuple[Blend, list[PathFactors], Array, NDArray[np.bool_]]:
        """Return where chirps are between keyframes, and what is known of their echoes.

        ``tx (chirp,)`` are their transmitters. Returned are the `Blend`; what is left at both ends
        of each interval; where specular points are expected, in the axes of the parts (chirp, echo,
        3) [m]; and which echoes may be seen (chirp, echo).
        """
        # The keyframes at both ends of the interval of each chirp.
        numbers, rest = keyframe_before(self._around.radar, chirps, self.step)
        starts, interval = np.unique(numbers, return_inverse=True)
        fraction = rest / self.step
        # Where every chirp of an interval is its first, the keyframe after it does not matter.
        stops = starts + (np.bincount(interval, weights=fraction) > 0)
        known, ends = self._find(np.union1d(starts, stops).tolist()), self._around.ends
        # Each chirp interpolates between the ends of the line of its own Tx.
        line, weight = ends.line_of_tx[tx], ends.tx_weight[tx]
        factors, points = list[PathFactors](), list[Array]()
        wanted = np.zeros((len(chirps), len(self.columns.path)), dtype=bool)
        for of_end in (starts, stops):
            own = [known[number] for number in of_end.tolist()]
            factor = np.stack([_widened(one.factor, len(self.columns)) for one in own])
            seen, start = (np.stack(arrays) for arrays in list(zip(*own, strict=True))[1:])
            # Whole arrays, or Numba would compile the same for another layout.
            factors.append(PathFactors(factor, np.take(seen, self.columns.echo, axis=-1)))
            wanted |= np.asarray(seen.any(axis=(2, 3)))[interval, line]
            points.append(np.einsum("cs,csei->cei", weight, start[interval, line]))
        blend = Blend(interval, fraction, line, weight, ends.rx_weight[tx])
        first, last = points
        return blend, factors, first + fraction[:, None, None] * (last - first), wanted

    def look_ahead(self, n_chirps: int) -> None:
        """Compute the keyframes of a capture that stay, many at a time."""
        self._find(list(range(min(-(-n_chirps // self.step) + 1, self._cache.stay))))

    def _find(self, numbers: list[int]) -> dict[int, PathKeyframes]:
        """Keyframes with these numbers, from the cache or many at a time."""
        cache = self._cache
        found = {number: cache[number] for number in numbers if number in cache}
        # Keyframes that are not in the cache are computed many at a time; those of a radar that
        # moves one by one, since each has antennas of its own.
        missing, radar = [number for number in numbers if number not in found], self._around.radar
        at_once = 1 if radar.is_moving else _KEYFRAMES_AT_ONCE
        for first in range(0, len(missing), at_once):
            some = missing[first : first + at_once]
            times = radar.gapless.centres_of(np.array(some) * self.step)
            poses = self._body.at(np.minimum(times, self._body.duration_s))
            around, there = self._around, radar.at(float(times[0]))
            if radar.is_moving:
                ends = ArrayEnds.of(there, around.ends.tx.shape[1])
                around = around._replace(radar=there, ends=ends)
            keyframes = path_keyframes(around, self.columns, poses, times)
            for place, number in enumerate(some):
                own = PathKeyframes(*(array[place].copy() for array in keyframes))
                # How many keyframes stay follows from how large one is.
                cache.stay = int(_KEPT_BYTES / sum(array.nbytes for array in own))
                cache.keep(number, own)
                found[number] = own
        return found

    def restrict(self, column: NDArray[np.bool_], echo: NDArray[np.bool_]) -> None:
        """Leave out all other columns and all other echoes for good."""
        self.columns.keep(column, echo)
        self._cache = self._cache.mapped(
            lambda own: PathKeyframes(
                _widened(own.factor, len(column))[..., column].copy(),
                own.seen[..., echo].copy(),
                own.start[..., echo, :].copy(),
            )
        )


def _widened(factor: NDArray[np.complex64], columns: int) -> NDArray[np.complex64]:
    """Add empty columns for those that were not yet known at this keyframe."""
    missing = columns - factor.shape[-1]
    return factor if not missing else np.pad(factor, [(0, 0)] * (factor.ndim - 1) + [(0, missing)])
