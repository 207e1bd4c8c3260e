"""Mirror reflections Tx -> wall(s) -> Rx by images, with the slab coefficients of each polarisation.

A wall mirrors as an infinite one wherever the point of reflection lies in its rectangle, and not at all elsewhere: of finite
size only the share that furniture hides, edges send nothing. The field on a path of length L is that of free space times
the walls' dyads, so an echo is F = -2 sqrt(pi) (p_rx . E) / L, |F|^2 (4 pi R^2)-like as a radar cross-section is: with
a conductor and E turned round, +2 sqrt(pi) / L.

Waves that go to and fro inside one wall are in its slab coefficient, or echoes of their own where no polynomial over the sweep
follows that (`rtradar.scatter.multipath.slab_series`); those between a wall and a pane right before it are not
(a reflection by the pane's back is, once), nor is the direct coupling from Tx to Rx, which no wall takes part in.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise, product
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar
from rtradar.scatter.clutter.behind_walls import ENOUGH, FAINT, delayed
from rtradar.scatter.clutter.returns import (
    DENSE_NODES,
    FREQUENCY_ERROR,
    RoomEchoes,
    best_followed,
)
from rtradar.scatter.common.nodes import sweep_nodes
from rtradar.scatter.common.polarization import antenna_field
from rtradar.scatter.multipath.slab_series import whole_walls
from rtradar.scatter.multipath.wall_interaction import (
    Series,
    height,
    image,
    inside,
    reflected,
    setting_out,
    through_walls,
)
from rtradar.scene import Scene, Wall
from rtradar.trace.room_tracer import RoomTracer

Array = NDArray[np.float64]
Face = tuple[Wall, bool]  # and whether it is the back

_EDGE_M = 1e-9
"""So near to an edge a point lies on it: rounding is a millionth of that."""


def mirror_returns(
    radar: Radar, scene: Scene, tracer: RoomTracer, order: int
) -> Iterator[RoomEchoes]:
    """Mirror reflections of up to ``order`` walls, one object for each sequence of walls.

    Parameters
    ----------
    radar : Radar
    scene : Scene
    tracer : RoomTracer
        Tracer of the room's furniture, which may occlude legs.
    order : int
        The most walls of a path.

    Yields
    ------
    RoomEchoes
        One echo each: of walls that some channel sees.
    """
    faces: list[Face] = [(wall, back) for wall in scene.walls for back in (False, True)]
    lit = [face for face in faces if (height(face[0], radar.tx, back=face[1]) > 0).any()]
    heard = [face for face in faces if (height(face[0], radar.rx, back=face[1]) > 0).any()]
    for bounces in range(1, order + 1):
        for sequence in product(*_between(faces, lit, heard, bounces)):
            if all(first[0] is not second[0] for first, second in pairwise(sequence)):
                returns = _follow(radar, scene, tracer, sequence)
                if returns is not None:
                    yield returns


def _between(
    faces: list[Face], lit: list[Face], heard: list[Face], bounces: int
) -> list[list[Face]]:
    if bounces == 1:
        return [[face for face in lit if face in heard]]
    return [lit, *[faces] * (bounces - 2), heard]


def specular_points(
    sequence: tuple[Face, ...], tx: Array, rx: Array
) -> tuple[Array, Array, Array, Array]:
    """Path over a sequence of faces by images of images.

    Parameters
    ----------
    sequence : tuple of (Wall, bool)
        Faces in the order met; True for backs.
    tx, rx : (..., 3) float64
        [m]; they broadcast.

    Returns
    -------
    points : (..., hop, 3) float64
        Points of reflection [m]; NaN where there is no path.
    ways : (..., hop + 1, 3) float64
        Unit vectors of the legs.
    length : (...) float64
        From the last image straight to the Rx [m].
    weight : (...) float64
        1 where all points lie in their rectangles, met from the right side, else 0; 0.5 just on an edge. By the edge of a
        right-angled corner the path goes over both walls in either order, each of them half: no two or none of it.
    """
    tx, rx = np.broadcast_arrays(tx, rx)
    images = [tx]
    for wall, back in sequence:
        images.append(image(wall, images[-1], back=back))
    here, points = rx, list[Array]()
    weight = np.ones((2, *rx.shape[:-1]))
    slack = np.array([_EDGE_M, -_EDGE_M]).reshape(2, *(1,) * (rx.ndim - 1))
    for (wall, back), behind in zip(reversed(sequence), reversed(images[1:]), strict=True):
        above, below = height(wall, here, back=back), height(wall, behind, back=back)
        meets = (above > -_EDGE_M) & (below < -_EDGE_M)
        share = np.where(meets, above, np.nan) / np.where(meets, above - below, 1.0)
        here = here + share[..., None] * (behind - here)
        weight *= (
            (above > -slack)
            & meets
            & np.stack([inside(wall, here, margin) for margin in slack.ravel()])
        )
        points.insert(0, here)
    for (wall, back), before in zip(sequence, [tx, *points[:-1]], strict=True):
        weight *= height(wall, before, back=back) > -slack
    ends = [*points, rx]
    ways = np.stack([end - start for start, end in zip(images, ends, strict=True)], axis=-2)
    size = np.linalg.norm(ways, axis=-1, keepdims=True)
    return np.stack(points, axis=-2), ways / size, size[..., -1, 0], weight.mean(axis=0)


def _follow(
    radar: Radar, scene: Scene, tracer: RoomTracer, sequence: tuple[Face, ...]
) -> RoomEchoes | None:
    tx, rx = radar.tx[:, None], radar.rx[radar.rx_of_tx]
    points, ways, length, weight = specular_points(sequence, tx, rx)
    stops = [np.broadcast_to(tx, rx.shape), *np.moveaxis(points, -2, 0), rx]
    which = np.flatnonzero(weight > 0)
    ends = [stop.reshape(-1, 3)[which] for stop in stops]
    free = np.ones(len(which), dtype=bool)
    for start, end in pairwise(ends):
        free &= ~tracer.blocked(start, end)
    which, ends = which[free], [end[free] for end in ends]
    if not len(which):
        return None
    legs = ways.reshape(-1, len(ends) - 1, 3)[which]
    numbers = [scene.walls.index(wall) for wall, _ in sequence]
    sent = antenna_field(legs[:, 0], radar.polarization, x_for_steep=True)
    heard = antenna_field(-legs[:, -1], radar.polarization, x_for_steep=True)

    def in_terms(series: Series) -> RoomEchoes | None:
        frequency = sweep_nodes(radar, DENSE_NODES)
        waves = setting_out(sent, len(frequency))
        for index, number in enumerate(numbers):
            waves = through_walls(
                scene, series, index, waves, ends[index], ends[index + 1], frequency
            )
            waves = reflected(scene, series, number, index + 1, waves, legs[:, index], frequency)
        waves = through_walls(scene, series, len(numbers), waves, ends[-2], ends[-1], frequency)
        spread = -2 * sqrt(pi) * (weight / length).ravel()[which]
        returned = [spread * np.conj((wave.field * heard).sum(axis=-1)) for wave in waves]
        strongest = [float(np.abs(one).max()) for one in returned]
        worth = [number for number, most in enumerate(strongest) if most > FAINT * max(strongest)]
        amplitude = np.zeros((len(frequency), length.size, len(worth)), dtype=np.complex128)
        lengths = np.repeat(length.reshape(-1, 1), len(worth), axis=1)
        for echo, number in enumerate(worth):
            amplitude[:, which, echo] = returned[number]
            lengths[which, echo] += waves[number].extra_m
        if not amplitude.any():
            return None
        return RoomEchoes(
            name=" + ".join(wall.name for wall, _ in sequence),
            kind="mirror",
            length=lengths.reshape(*length.shape, -1),
            amplitude=amplitude.reshape(len(frequency), *length.shape, -1),
            frequency=frequency,
            bounces=np.full(len(worth), len(sequence)),
            points=np.repeat(points[:, :, None], len(worth), axis=2),
        ).with_fewest_nodes(radar, FREQUENCY_ERROR if len(worth) == 1 else ENOUGH)

    return best_followed(
        (lambda: in_terms(whole_walls(scene.walls)), lambda: in_terms(delayed(scene, radar)))
    )
