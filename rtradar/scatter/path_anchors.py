"""What walls, the body's surface and shadows leave of the echoes of a pose, path by path.

A leg carries the field of its antenna as a vector, over walls and through walls by the coefficients of their slabs, to the
mirror point on the body. Both legs are told from their antennas: by reciprocity a receiver hears as it would send. Mirror
points are those for the middles of the lines of antennas, legs run from the ends of the lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.scatter.array_ends import ArrayEnds
from rtradar.scatter.body_material import antenna_field, bisector, body_reflection
from rtradar.scatter.mirror import mirror
from rtradar.scatter.polarization import copolar
from rtradar.scatter.room_walls import reflect, through_walls
from rtradar.scatter.wall_paths import Leg, WallPath, corners, images
from rtradar.scene import Scene
from rtradar.trace.body_tracer import BodyTracer
from rtradar.trace.room_tracer import RoomTracer

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

_FLAT = 0.02
"""A factor that changes by less over the sweep, 0.2 dB, is made the same at all nodes: `synthesize` does such an echo faster."""


class PathAnchors(NamedTuple):
    """What is left of the echoes.

    ``factor (anchor, node, line, 2, rx_end, echo)`` complex64: co-polar field over that of the bare return, exp(+j omega t);
    of a direct echo over what `mirror` has for a conductor. ``seen (anchor, line, 2, rx_end, echo)`` bool.
    ``start (anchor, line, 2, echo, 3)``: mirror points of both ends of the lines of Tx in the axes of the parts [m].
    """

    factor: NDArray[np.complex64]
    seen: NDArray[np.bool_]
    start: NDArray[np.float32]


class Surroundings(NamedTuple):
    """Who reflects, hides and lets through: ``tracers`` are the body's and the furniture's, or None where nothing hides."""

    scene: Scene
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
    poses: Poses,
) -> PathAnchors:
    """Look at some poses.

    Parameters
    ----------
    around : Surroundings
    ends : ArrayEnds
    paths : sequence of WallPath
    path, part : (echo,) int64
        Of each echo. Whether other parts hide a direct one is left to `MirrorVisibility`.
    poses : Poses

    Returns
    -------
    PathAnchors
    """
    points, start, exists = _mirror_points(ends, paths, path, part, poses)
    legs = [
        _carry(around, [getattr(paths[p], side) for p in path], places, points)
        for side, places in (("out", ends.tx), ("back", ends.rx))
    ]
    out, back = legs
    normal = bisector(-out.arriving[:, :, :, None], -back.arriving[:, :, None])
    sent = body_reflection(out.field[:, :, :, :, None], out.arriving[:, :, :, None], normal, around.body_eta)
    # `mirror` counts a conductor straight on as +1: the field's turn is in the sign.
    factor = -np.sum(back.field[:, :, :, None] * sent, axis=-1)
    direct = np.flatnonzero([paths[p].order == 0 for p in path])
    if len(direct):
        own = copolar(-out.arriving[:, :, :, None, direct], -back.arriving[:, :, None, :, direct], around.polarization)
        safe = np.abs(own) > 1e-6
        factor[..., direct] = np.where(safe, factor[..., direct] / np.where(safe, own, 1.0), 1.0)
    seen = out.valid[:, :, :, None] & back.valid[:, :, None] & exists[:, :, None, None]
    seen &= (np.abs(factor) > 0).any(axis=0)
    if around.tracers is not None:
        body, room = around.tracers
        asked = np.logical_or.reduce(seen, axis=3), np.logical_or.reduce(seen, axis=2)
        clear = [_no_furniture(room, leg, ask) for leg, ask in zip(legs, asked, strict=True)]
        for anchor in range(len(seen)):
            body.pose(poses.centres[anchor], poses.frames[anchor])
            for leg, still in zip(legs, clear, strict=True):
                _clear_of_body(body, leg, still[anchor], anchor, part, direct)
        seen &= clear[0][:, :, :, None] & clear[1][:, :, None]
    middle = factor[len(factor) // 2]
    flat = np.all(np.abs(factor - middle) <= _FLAT * np.abs(middle), axis=(0, 2, 3, 4), keepdims=True)
    factor = np.where(flat, middle, factor)
    return PathAnchors(np.moveaxis(factor, 0, 1).astype(np.complex64), seen, start.astype(np.float32))


def _mirror_points(
    ends: ArrayEnds, paths: Sequence[WallPath], path: NDArray[np.int64], part: NDArray[np.int64], poses: Poses
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Mirror points, and whether there is one at all.

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
        from_tx, to_rx = images(paths[number].out, tx.reshape(-1, 3)), images(paths[number].back, rx.reshape(-1, 3))
        centres, frames = (np.repeat(array[:, own], len(from_tx), axis=0) for array in (poses.centres, poses.frames))
        antennas = np.tile(from_tx, (anchors, 1)), np.tile(to_rx, (anchors, 1))[:, None]
        found = mirror(*antennas, centres, frames, poses.semi_axes[own], points=True)
        exists[..., chosen] = (np.abs(found[1]) > 0).reshape(*shape[:3], len(own))
        places[..., chosen, :] = found[2].reshape(*shape[:3], len(own), 3)
    away = places[:, :, 1:] - poses.centres[:, None, None, part]
    starts = np.einsum("aeji,alsej->alsei", poses.frames[:, part], away)
    return places[:, :, 0], starts, exists[:, :, 0]


class _Carried(NamedTuple):
    """Legs from the ends of the lines to the mirror points.

    ``field (node, anchor, line, end, echo, 3)`` that arrives, ``arriving (anchor, line, end, echo, 3)`` its direction,
    ``valid (anchor, line, end, echo)``; ``straight``: list of straight pieces (echo index, origins, targets, last).
    """

    field: Field
    arriving: Array
    valid: NDArray[np.bool_]
    pieces: list[tuple[NDArray[np.int64], Array, Array, bool]]


def _carry(around: Surroundings, legs: Sequence[Leg], antennas: Array, points: Array) -> _Carried:
    shape = (points.shape[0], *antennas.shape[:2], points.shape[2])
    field = np.empty((len(around.frequency_hz), *shape, 3), dtype=np.complex128)
    arriving, valid = np.empty((*shape, 3)), np.empty(shape, dtype=bool)
    pieces = []
    for leg in dict.fromkeys(legs):
        chosen = np.array([number for number, own in enumerate(legs) if own == leg])
        along, valid[..., chosen] = corners(leg, antennas[:, :, None], points[:, :, None, chosen])
        way = _unit(along[1] - along[0])
        own = np.broadcast_to(antenna_field(way, around.polarization), (len(field), *way.shape)).astype(np.complex128)
        for step, (origins, targets) in enumerate(pairwise(along)):
            if step > 0:
                own = reflect(leg[step - 1].wall, own, way, around.frequency_hz)
                way = _unit(targets - origins)
            own = through_walls(around.scene, origins, targets, around.frequency_hz, own)
            pieces.append((chosen, origins, targets, step == len(leg)))
        field[..., chosen, :], arriving[..., chosen, :] = own, way
    return _Carried(field, arriving, valid, pieces)


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
    body: BodyTracer, leg: _Carried, clear: NDArray[np.bool_], anchor: int, part: NDArray[np.int64], direct: NDArray[np.int64]
) -> None:
    """Take out of ``clear (line, end, echo)``, of one posed anchor, what the body hides; direct echoes are not looked at."""
    rays = []
    for chosen, origins, targets, last in leg.pieces:
        origins, targets = np.broadcast_arrays(origins, targets)
        line, end, echo = np.nonzero(clear[..., chosen] & ~np.isin(chosen, direct))
        # At the mirror point the part itself cannot be in the way, before a wall it can.
        own = part[chosen[echo]] if last else np.full(len(echo), -1)
        rays.append((origins[anchor, line, end, echo], targets[anchor, line, end, echo], own, line, end, chosen[echo]))
    starts, stops, own, line, end, echo = (np.concatenate(column) for column in zip(*rays, strict=True))
    hidden = ~body.sees(starts, stops, own)
    clear[line[hidden], end[hidden], echo[hidden]] = False
