"""What walls, the body's surface and shadows leave of the echoes of a pose, path by path.

A leg carries the field of its antenna as a vector, over walls and through walls by the coefficients of their slabs, to the
specular point on the body. Both legs are told from their antennas: by reciprocity a receiver hears as it would send. Mirror
points are those for the middles of the lines of antennas, legs run from the ends of the lines. A slab that delays sends on
several waves, each with its own delay: an echo has a column for each pair of those of its legs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.scatter.common.array_ends import ArrayEnds
from rtradar.scatter.common.body_material import body_reflection
from rtradar.scatter.common.polarization import antenna_field, bisector, copolar
from rtradar.scatter.multipath.image_paths import Leg, WallPath, corners, images
from rtradar.scatter.multipath.slab_delays import AT_ONCE, Met, PathTerms
from rtradar.scatter.multipath.slab_series import WallSeries
from rtradar.scatter.multipath.wall_interaction import (
    Passage,
    reflected,
    setting_out,
    through_walls,
)
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.scene import Scene
from rtradar.trace.body_tracer import BodyTracer
from rtradar.trace.room_tracer import RoomTracer

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

_FLAT = 0.01
"""A factor that changes by less over the sweep, 0.1 dB, is made the same at all nodes: `synthesize` does such an echo faster."""

_FAINT = 2e-3
"""Of the strongest term of an echo: a weaker one is left out."""


class PathAnchors(NamedTuple):
    """What is left of the echoes.

    ``factor (anchor, node, line, 2, rx_end, column)`` complex64: co-polar field over that of the bare return, exp(+j omega t);
    of a direct echo over what `mirror` has for a conductor. ``seen (anchor, line, 2, rx_end, echo)`` bool.
    ``start (anchor, line, 2, echo, 3)``: specular points of both ends of the lines of Tx in the axes of the parts [m].
    """

    factor: NDArray[np.complex64]
    seen: NDArray[np.bool_]
    start: NDArray[np.float32]


class Surroundings(NamedTuple):
    """Who reflects, hides and lets through: ``tracers`` are the body's and the furniture's, or None where nothing hides.

    ``series`` are the terms of the walls.
    """

    scene: Scene
    series: Sequence[WallSeries]
    tracers: tuple[BodyTracer, RoomTracer] | None
    body_eta: Field
    frequency_hz: Array
    polarization: Literal["v", "h"]


def path_anchors(
    around: Surroundings,
    ends: ArrayEnds,
    paths: Sequence[WallPath],
    path: NDArray[np.int64],
    part: NDArray[np.int64],
    terms: PathTerms,
    poses: Poses,
) -> PathAnchors:
    """Look at some poses.

    Parameters
    ----------
    around : Surroundings
    ends : ArrayEnds
    paths : sequence of WallPath
    path, part : (echo,) int64
        Path and part of each echo. `SpecularVisibility` decides whether other parts occlude a direct
        one.
    terms : PathTerms
        Gets the columns that are met for the first time.
    poses : Poses

    Returns
    -------
    PathAnchors
    """
    points, start, exists = _specular_points(ends, paths, path, part, poses)
    legs = [
        _carry(around, [getattr(paths[p], side) for p in path], places, points)
        for side, places in (("out", ends.tx), ("back", ends.rx))
    ]
    direct = np.array([paths[p].order == 0 for p in path], dtype=bool)
    factors = [
        (chosen, met, _left(around, legs, direct, chosen, *fields))
        for chosen, met, fields in _pairs(paths, path, legs)
    ]
    strength = np.zeros((*exists.shape[:2], 2, ends.rx.shape[1], len(path)))
    for chosen, _, found in factors:
        strength[..., chosen] = np.maximum(strength[..., chosen], np.abs(found).max(axis=0))
    seen = (
        legs[0].valid[:, :, :, None]
        & legs[1].valid[:, :, None]
        & exists[:, :, None, None]
        & (strength > 0)
    )
    columns = []
    for chosen, met, found in factors:
        worth = _worth(found, strength[..., chosen])
        columns.append(
            np.array(
                [
                    terms.column(int(echo), met) if kept else -1
                    for echo, kept in zip(chosen, worth, strict=True)
                ]
            )
        )
    factor = np.zeros(
        (len(around.frequency_hz), *strength.shape[:-1], len(terms)), dtype=np.complex128
    )
    for (_, _, found), column in zip(factors, columns, strict=True):
        factor[..., column[column >= 0]] = found[..., column >= 0]
    if around.tracers is not None:
        body, room = around.tracers
        asked = np.logical_or.reduce(seen, axis=3), np.logical_or.reduce(seen, axis=2)
        clear = [_no_furniture(room, leg, ask) for leg, ask in zip(legs, asked, strict=True)]
        for anchor in range(len(seen)):
            body.pose(poses.centres[anchor], poses.frames[anchor])
            for leg, still in zip(legs, clear, strict=True):
                _clear_of_body(body, leg, still[anchor], anchor, part, np.flatnonzero(direct))
        seen &= clear[0][:, :, :, None] & clear[1][:, :, None]
    middle = factor[len(factor) // 2]
    flat = np.all(
        np.abs(factor - middle) <= _FLAT * np.abs(middle), axis=(0, 2, 3, 4), keepdims=True
    )
    factor = np.where(flat, middle, factor)
    return PathAnchors(
        np.moveaxis(factor, 0, 1).astype(np.complex64), seen, start.astype(np.float32)
    )


def _pairs(
    paths: Sequence[WallPath], path: NDArray[np.int64], legs: Sequence[_Carried]
) -> Iterator[tuple[NDArray[np.int64], Met, tuple[Field, Field]]]:
    """Echoes, what they met on both legs, and the fields (node, anchor, line, end, echo, 3) of the legs, pair by pair."""
    out, back = legs
    yield np.arange(len(path)), AT_ONCE, (out.field, back.field)
    for number in np.unique(path):
        there, here = paths[number].out, paths[number].back
        if len(out.waves[there]) == len(back.waves[here]) == 1:
            continue
        chosen = np.flatnonzero(path == number)
        for (met_out, sent), (met_back, heard) in product(
            out.waves[there].items(), back.waves[here].items()
        ):
            if (met_out, met_back) != AT_ONCE:
                fields = sent[..., out.of_leg[chosen], :], heard[..., back.of_leg[chosen], :]
                yield chosen, (met_out, met_back), fields


def _left(
    around: Surroundings,
    legs: Sequence[_Carried],
    direct: NDArray[np.bool_],
    chosen: NDArray[np.int64],
    sent: Field,
    heard: Field,
) -> Field:
    """Co-polar field over that of the bare return, of some echoes, (node, anchor, line, 2, rx_end, echo)."""
    out, back = (leg.arriving[..., chosen, :] for leg in legs)
    out, back = out[:, :, :, None], back[:, :, None]
    returned = body_reflection(sent[:, :, :, :, None], out, bisector(-out, -back), around.body_eta)
    # `mirror` counts a conductor straight on as +1: the field's turn is in the sign.
    factor = np.asarray(-np.sum(heard[:, :, :, None] * returned, axis=-1))
    own = np.flatnonzero(direct[chosen])
    if len(own):
        share = copolar(-out[..., own, :], -back[..., own, :], around.polarization)
        safe = np.abs(share) > 1e-6
        factor[..., own] = np.where(safe, factor[..., own] / np.where(safe, share, 1.0), 1.0)
    return factor


def _worth(factor: Field, strength: Array) -> NDArray[np.bool_]:
    """Which echoes have a term at any place that is not faint beside the strongest there, (echo,)."""
    size = np.abs(factor).max(axis=0)
    return np.asarray(((size > _FAINT * strength) & (size > 0)).any(axis=(0, 1, 2, 3)))


def _specular_points(
    ends: ArrayEnds,
    paths: Sequence[WallPath],
    path: NDArray[np.int64],
    part: NDArray[np.int64],
    poses: Poses,
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Specular points, and whether there is one at all.

    Returns
    -------
    points : (anchor, line, echo, 3)
        For the middles of the lines, world [m].
    starts : (anchor, line, 2, echo, 3)
        For the ends of the lines of Tx, in the axes of the parts [m].
    exists : (anchor, line, echo) bool
    """
    anchors = len(poses.centres)
    # The middle of each line of Tx and its ends, all with the middle of the receivers that hear it.
    tx = np.concatenate([ends.tx_middle[:, None], ends.tx], axis=1)
    rx = np.repeat(ends.rx_middle[:, None], tx.shape[1], axis=1)
    shape = (anchors, *tx.shape[:2], len(path))
    places, exists = np.empty((*shape, 3)), np.empty(shape, dtype=bool)
    for number in np.unique(path):
        chosen = np.flatnonzero(path == number)
        own = part[chosen]
        from_tx, to_rx = (
            images(paths[number].out, tx.reshape(-1, 3)),
            images(paths[number].back, rx.reshape(-1, 3)),
        )
        centres, frames = (
            np.repeat(array[:, own], len(from_tx), axis=0)
            for array in (poses.centres, poses.frames)
        )
        antennas = np.tile(from_tx, (anchors, 1)), np.tile(to_rx, (anchors, 1))[:, None]
        found = solve_specular_points(
            Geometry(*antennas, centres, frames, poses.semi_axes[own]), points=True
        )
        exists[..., chosen] = (np.abs(found[1]) > 0).reshape(*shape[:3], len(own))
        places[..., chosen, :] = found[2].reshape(*shape[:3], len(own), 3)
    away = places[:, :, 1:] - poses.centres[:, None, None, part]
    starts = np.einsum("aeji,alsej->alsei", poses.frames[:, part], away)
    return places[:, :, 0], starts, exists[:, :, 0]


class _Carried(NamedTuple):
    """Legs from the ends of the lines to the specular points.

    ``field (node, anchor, line, end, echo, 3)`` that arrives without delay in slabs, ``waves`` all fields of the echoes of a leg,
    by what they met; ``of_leg (echo,)`` counts the echoes of each leg. ``arriving (anchor, line, end, echo, 3)`` direction,
    ``valid (anchor, line, end, echo)``; ``pieces``: list of straight pieces (echo index, origins, targets, last).
    """

    field: Field
    waves: dict[Leg, dict[tuple[Passage, ...], Field]]
    of_leg: NDArray[np.int64]
    arriving: Array
    valid: NDArray[np.bool_]
    pieces: list[tuple[NDArray[np.int64], Array, Array, bool]]


def _carry(around: Surroundings, legs: Sequence[Leg], antennas: Array, points: Array) -> _Carried:
    shape = (points.shape[0], *antennas.shape[:2], points.shape[2])
    field = np.zeros((len(around.frequency_hz), *shape, 3), dtype=np.complex128)
    arriving, valid, of_leg = (
        np.empty((*shape, 3)),
        np.empty(shape, dtype=bool),
        np.empty(len(legs), dtype=np.int64),
    )
    pieces, all_waves = [], {}
    scene, frequency = around.scene, around.frequency_hz
    for leg in dict.fromkeys(legs):
        chosen = np.array([number for number, own in enumerate(legs) if own == leg])
        of_leg[chosen] = np.arange(len(chosen))
        along, valid[..., chosen] = corners(leg, antennas[:, :, None], points[:, :, None, chosen])
        way = _unit(along[1] - along[0])
        waves = setting_out(antenna_field(way, around.polarization), len(frequency))
        for step, (origins, targets) in enumerate(pairwise(along)):
            if step > 0:
                number = scene.walls.index(leg[step - 1].wall)
                waves = reflected(scene, around.series, number, step, waves, way, frequency)
                way = _unit(targets - origins)
            waves = through_walls(scene, around.series, step, waves, origins, targets, frequency)
            pieces.append((chosen, origins, targets, step == len(leg)))
        all_waves[leg] = {wave.met: wave.field for wave in waves}
        field[..., chosen, :] = all_waves[leg].setdefault((), field[..., chosen, :])
        arriving[..., chosen, :] = way
    return _Carried(field, all_waves, of_leg, arriving, valid, pieces)


def _unit(ways: Array) -> Array:
    size = np.linalg.norm(ways, axis=-1, keepdims=True)
    return np.asarray(ways / np.where(size > 0, size, 1.0))


def _no_furniture(room: RoomTracer, leg: _Carried, asked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of the legs ``asked (anchor, line, end, echo)`` for have no furniture in their way."""
    clear = asked.copy()
    for chosen, origins, targets, _ in leg.pieces:
        still = clear[..., chosen]
        origins, targets = np.broadcast_arrays(origins, targets)
        still[still] = ~room.blocked(origins[still], targets[still])
        clear[..., chosen] = still
    return clear


def _clear_of_body(
    body: BodyTracer,
    leg: _Carried,
    clear: NDArray[np.bool_],
    anchor: int,
    part: NDArray[np.int64],
    direct: NDArray[np.int64],
) -> None:
    """Take out of ``clear (line, end, echo)``, of one posed anchor, what the body hides; direct echoes are not looked at."""
    rays = []
    for chosen, origins, targets, last in leg.pieces:
        origins, targets = np.broadcast_arrays(origins, targets)
        line, end, echo = np.nonzero(clear[..., chosen] & ~np.isin(chosen, direct))
        # At the specular point the part itself cannot be in the way, before a wall it can.
        own = part[chosen[echo]] if last else np.full(len(echo), -1)
        rays.append(
            (
                origins[anchor, line, end, echo],
                targets[anchor, line, end, echo],
                own,
                line,
                end,
                chosen[echo],
            )
        )
    starts, stops, own, line, end, echo = (
        np.concatenate(column) for column in zip(*rays, strict=True)
    )
    hidden = ~body.sees(starts, stops, own)
    clear[line[hidden], end[hidden], echo[hidden]] = False
