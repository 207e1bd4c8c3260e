"""What walls leave of clutter behind them: its echoes once for each delay in their slabs."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.clutter.returns import (
    FREQUENCY_ERROR,
    FURNITURE_NODES,
    MOST_NODES,
    RoomEchoes,
)
from rtradar.scatter.common.nodes import sweep_nodes
from rtradar.scatter.common.polarization import antenna_field
from rtradar.scatter.multipath.slab_series import room_series
from rtradar.scatter.multipath.wall_interaction import (
    Series,
    Wave,
    crossed,
    setting_out,
    through_walls,
)
from rtradar.scene import Scene, Wall

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

ENOUGH = 0.3 * FREQUENCY_ERROR
"""Of a slab's coefficient, of each echo, and of all that is left out behind walls: errors add up."""
FAINT = 0.1 * FREQUENCY_ERROR
"""Of the strongest term of a mirror: fainter ones are left out."""


def delayed(scene: Scene, radar: Radar, most_nodes: int = MOST_NODES) -> Series:
    """Terms of all walls, for polynomials of as many nodes as that."""
    return _delayed(scene.walls, radar, most_nodes)


@lru_cache(maxsize=8)
def _delayed(walls: tuple[Wall, ...], radar: Radar, most_nodes: int) -> Series:
    return room_series(walls, radar, most_nodes=most_nodes, enough=ENOUGH, bounces=1).walls


class _Pair(NamedTuple):
    """A wave on the way out with one on the way back, and what is left of the field on each: (node, tx or rx, echo)."""

    out: Wave
    back: Wave
    left_out: Field
    left_back: Field


def behind_walls(returns: RoomEchoes, radar: Radar, scene: Scene) -> RoomEchoes:
    """Echoes of points that all antennas share, with what walls let through on both legs.

    Waves that pass a slab as often, out and back together, are one echo: their delays differ by what Tx and Rx are apart.

    Parameters
    ----------
    returns : RoomEchoes
        Without the walls.
    radar : Radar
    scene : Scene

    Returns
    -------
    RoomEchoes
    """
    points = returns.points[0, 0, :, 0]
    behind = np.zeros(len(points), dtype=bool)
    for wall, antennas in product(scene.walls, (radar.tx, radar.rx)):
        behind |= crossed(wall, antennas[:, None], points).any(axis=0)
    if not behind.any():
        return returns
    nodes = sweep_nodes(radar, FURNITURE_NODES)
    returns = replace(returns, amplitude=returns.at_nodes(nodes), frequency=nodes)
    parts, off = _transmitted(returns.take(behind), radar, scene)
    parts = [returns.take(~behind), *parts]
    whole = replace(
        returns,
        length=np.concatenate([part.length for part in parts], axis=-1),
        amplitude=np.concatenate([part.amplitude for part in parts], axis=-1),
        bounces=np.concatenate([part.bounces for part in parts]),
        points=np.concatenate([part.points for part in parts], axis=2),
    ).with_fewest_nodes(radar, ENOUGH)
    return replace(whole, off_m=max(whole.off_m, off))


def _transmitted(returns: RoomEchoes, radar: Radar, scene: Scene) -> tuple[list[RoomEchoes], float]:
    """Echoes of points that some antennas see through a wall, group by group of alike delays, and what they are off by [m]."""
    points, nodes = returns.points[0, 0, :, 0], returns.frequency
    series = delayed(scene, radar, FURNITURE_NODES)

    def legs(antennas: Array) -> list[tuple[Wave, Field]]:
        ways = points - antennas[:, None]
        directions = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
        sent = antenna_field(directions, radar.polarization, x_for_steep=True)
        waves = through_walls(
            scene, series, 0, setting_out(sent, len(nodes)), antennas[:, None], points, nodes
        )
        return [(wave, np.asarray((wave.field * sent).sum(axis=-1).conj())) for wave in waves]

    alike: dict[tuple[tuple[int, int], ...], list[_Pair]] = {}
    for (out, left_out), (back, left_back) in product(legs(radar.tx), legs(radar.rx)):
        passes = Counter[int]()
        for one in (*out.met, *back.met):
            passes[one.wall] += one.passes
        alike.setdefault(tuple(sorted(passes.items())), []).append(
            _Pair(out, back, left_out, left_back)
        )
    # A bound of each echo, for most are not worth what they hold in memory.
    strength = np.abs(returns.amplitude).max(axis=(0, 1, 2))
    sizes = np.array(
        [
            sum(_most(pair.left_out) * _most(pair.left_back) for pair in pairs) * strength
            for pairs in alike.values()
        ]
    )
    parts, off = [], 0.0
    for pairs, size, some in zip(alike.values(), sizes, _worth(sizes), strict=True):
        if some.any():
            parts.append(_together(returns.take(some), pairs, some, radar.rx_of_tx))
            if any(
                not series[one.wall].held[1]
                for pair in pairs
                for one in (*pair.out.met, *pair.back.met)
            ):
                off = max(off, float(size.max()))
    return parts, off


def _most(left: Field) -> Array:
    return np.asarray(np.abs(left).max(axis=(0, 1)))


def _together(
    returns: RoomEchoes, pairs: list[_Pair], some: NDArray[np.bool_], kept: NDArray[np.int64]
) -> RoomEchoes:
    """Some of the echoes by all pairs of waves, at their mean length; what each is longer is in its amplitude."""
    longer = [
        pair.out.extra_m[:, None, some] + pair.back.extra_m[kept][..., some] for pair in pairs
    ]
    left = [pair.left_out[:, :, None, some] * pair.left_back[:, kept][..., some] for pair in pairs]
    weights = [np.abs(one[len(one) // 2]) for one in left]
    total = np.sum(weights, axis=0)
    weighted = np.sum([weight * own for weight, own in zip(weights, longer, strict=True)], axis=0)
    mean = np.where(total > 0, weighted / np.where(total > 0, total, 1.0), 0.0)
    wavenumber = 2 * np.pi * returns.frequency[:, None, None, None] / SPEED_OF_LIGHT_MPS
    factor = sum(
        one * np.exp(1j * wavenumber * (own - mean)) for one, own in zip(left, longer, strict=True)
    )
    return replace(returns, length=returns.length + mean, amplitude=returns.amplitude * factor)


def _worth(sizes: Array) -> NDArray[np.bool_]:
    """All but the weakest, the rms sum of which is a small share of the strongest."""
    order = np.argsort(sizes, axis=None)
    together = np.sqrt(np.cumsum(sizes.ravel()[order] ** 2))
    worth = np.ones(sizes.size, dtype=bool)
    worth[order[together <= ENOUGH * sizes.max(initial=0.0)]] = False
    return worth.reshape(sizes.shape)
