"""What one object of a room returns: echoes of every Tx and every Rx kept with it.

Walls between the antennas and an object let through what their slabs do: its echoes then come once
for each delay in them.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import at_nodes, interpolation_weights, sweep_nodes
from rtradar.scatter.common.polarization import Polarization, antenna_field
from rtradar.scatter.multipath.slabs import WallResponse, WallSeries, Wave, room_series
from rtradar.scatter.multipath.wall_edges import WallEdges
from rtradar.scatter.validity import sampled
from rtradar.scene import Scene, Wall

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Bools = NDArray[np.bool_]
Kind = Literal["mirror", "furniture", "reflector", "rough"]

MOST_NODES = 13
"""Largest number of nodes over the sweep: with more, `synthesize` loses digits."""
FURNITURE_NODES, _PANE_NODES = 5, 9
_NODES = (1, 3, 5, 7, 9, 11, MOST_NODES)
FREQUENCY_ERROR = 1e-3
"""Error that amplitudes may have between nodes, over the strongest echo of an object."""
ENOUGH = 0.3 * FREQUENCY_ERROR
"""The same for a slab's coefficient, for each echo, and for all that is left out behind walls."""


@dataclass(frozen=True)
class RoomEchoes:
    """Echoes of one object for one TDM cycle.

    ``kind`` is ``mirror`` for specular reflection by walls, ``furniture`` for facets, ``reflector``
    for sheets of metal with several bounces, ``rough`` for the diffuse return of a wall; ``name``
    is that of the object, or of the walls in the order of reflection. ``length (tx, rx, echo)`` [m]
    is for the rx that are kept with that Tx; ``amplitude (node, tx, rx, echo)`` are scattering
    lengths, defined as in `Echoes` [m], at ``frequency (node,)`` [Hz]. ``points (tx or 1, rx or 1,
    echo, hop, 3)`` are the corners of the path, world [m]; 1 where all antennas share them.
    ``off_m`` is the largest known error of the polynomial through the nodes, if it is above what
    was asked for [m]. For walls ``image``, a matrix (3, 3) and a shift (3,) [m], gives the image of
    a Tx: the product with the matrix plus the shift.
    """

    name: str
    kind: Kind
    length: Array
    amplitude: Field
    frequency: Array
    bounces: NDArray[np.int64]
    points: Array
    off_m: float = 0.0
    image: tuple[Array, Array] | None = None

    @property
    def n_echoes(self) -> int:
        """Number of echoes."""
        return len(self.bounces)

    def power_m2(self) -> float:
        """Return the sum of |amplitude|^2 at the middle node, averaged over the channels [m^2]."""
        middle = self.amplitude[len(self.frequency) // 2]
        return float((np.abs(middle) ** 2).sum(axis=-1).mean())

    def strongest_cell_m2(self, radar: Radar) -> float:
        """Return the largest power of a channel in a range bin, with phases of echoes [m^2]."""
        # Echoes of each channel in the cells of its range axis, summed as fields.
        middle, bins = len(self.frequency) // 2, radar.samples_per_chirp
        wavenumber = 2 * np.pi * self.frequency[middle] / SPEED_OF_LIGHT_MPS
        field = self.amplitude[middle] * np.exp(1j * wavenumber * self.length)
        field = field.reshape(-1, self.n_echoes)
        channel = np.arange(len(field))[:, None] * (bins + 1)
        strongest = 0.0
        # Once more with all bins shifted by half a bin, so that no neighbours stay separated.
        for shift in (0.0, 0.5):
            cells = np.minimum(self.length / (2 * radar.range_bin_m) + shift, bins)
            cells = cells.astype(np.int64).reshape(field.shape)
            # Beyond the last bin the low-pass lets nothing through.
            kept = cells < bins
            real, imaginary = (
                np.bincount((channel + cells)[kept], weights=part[kept], minlength=1)
                for part in (field.real, field.imag)
            )
            strongest = max(strongest, float((real**2 + imaginary**2).max()))
        return strongest

    def take(self, which: Bools) -> RoomEchoes:
        """Return some of the echoes."""
        return replace(
            self,
            length=np.compress(which, self.length, axis=-1),
            amplitude=np.compress(which, self.amplitude, axis=-1),
            bounces=self.bounces[which],
            points=np.compress(which, self.points, axis=2),
        )

    def received(self, radar: Radar) -> RoomEchoes:
        """Return the echoes that any antenna receives: visible, and within the sampled range."""
        near = sampled(self.length, radar) & (self.amplitude != 0).any(axis=0)
        return self.take(near.any(axis=(0, 1)))

    def at_nodes(self, frequency: Array) -> Field:
        """Interpolate amplitudes (node, tx, rx, echo) at other frequencies (node,) [Hz]."""
        return np.asarray(at_nodes(self.amplitude, self.frequency, frequency))

    def strongest_m(self) -> float:
        """Return the largest |amplitude| [m]."""
        return float(np.abs(self.amplitude).max(initial=0.0))

    def with_fewest_nodes(
        self, radar: Radar, error: float = FREQUENCY_ERROR, strongest_m: float | None = None
    ) -> RoomEchoes:
        """Return the echoes at the fewest nodes that keep amplitudes to this; see ``off_m``.

        The error is relative to ``strongest_m`` [m], or to the strongest of these echoes.
        """
        most = error * (self.strongest_m() if strongest_m is None else strongest_m)
        # Interpolating to fewer nodes and back shows the error, at the frequencies that are known.
        for count in _NODES:
            nodes = sweep_nodes(radar, count)
            there = interpolation_weights(self.frequency, nodes)
            change = interpolation_weights(nodes, self.frequency) @ there - np.eye(there.shape[1])
            # Tx by Tx, which takes less memory.
            off = max(
                float(np.abs(np.tensordot(change, own, axes=1)).max(initial=0.0))
                for own in np.moveaxis(self.amplitude, 1, 0)
            )
            if off <= most:
                return replace(self, amplitude=self.at_nodes(nodes), frequency=nodes, off_m=0.0)
        return replace(self, amplitude=self.at_nodes(nodes), frequency=nodes, off_m=off)


# -- behind walls ----------------------------------------------------------------------------------


@lru_cache(maxsize=8)
def delayed(
    walls: tuple[Wall, ...], radar: Radar, most_nodes: int = MOST_NODES
) -> tuple[WallSeries, ...]:
    """Return the terms of all walls, for polynomials of at most so many nodes."""
    return room_series(walls, radar, most_nodes=most_nodes, enough=ENOUGH, bounces=1).walls


class _Leg(NamedTuple):
    """A wave on the way to points, and what is left of its field (node, tx or rx, echo)."""

    wave: Wave
    left: Field


def behind_walls(returns: RoomEchoes, radar: Radar, scene: Scene) -> RoomEchoes:
    """Apply what walls on the way transmit, on both legs, to echoes of points.

    All antennas share the points. Waves that pass a slab equally often, out and back together, are
    one echo: their delays differ by the distance of Tx and Rx.
    """
    points = returns.points[0, 0, :, 0]
    # Points that some antenna sees through a wall, and these walls.
    behind, crossed = np.zeros(len(points), dtype=bool), set[int]()
    edges = WallEdges.of(scene.walls, radar)
    for number, antennas in product(range(len(scene.walls)), (radar.tx, radar.rx)):
        across = edges.passage(number, antennas[:, None], points)[0].any(axis=0)
        behind |= across
        if across.any():
            crossed.add(number)
    if not behind.any():
        return returns
    # Only those points need more nodes, and what their walls transmit.
    count, series = _series_behind(scene.walls, crossed, radar)
    nodes, hidden = sweep_nodes(radar, count), returns.take(behind)
    hidden = replace(hidden, amplitude=hidden.at_nodes(nodes), frequency=nodes)
    # Echoes that are not behind walls go on as they are.
    parts, off = _transmitted(hidden, radar, scene, series)
    parts = [returns.take(~behind), *parts]
    strongest_m = max(part.strongest_m() for part in parts)
    parts = [part.with_fewest_nodes(radar, ENOUGH, strongest_m) for part in parts]
    nodes = max((part.frequency for part in parts), key=len)
    return replace(
        returns,
        length=np.concatenate([part.length for part in parts], axis=-1),
        amplitude=np.concatenate([part.at_nodes(nodes) for part in parts], axis=-1),
        frequency=nodes,
        bounces=np.concatenate([part.bounces for part in parts]),
        points=np.concatenate([part.points for part in parts], axis=2),
        off_m=max(off, *(part.off_m for part in parts)),
    )


def _series_behind(
    walls: tuple[Wall, ...], crossed: set[int], radar: Radar
) -> tuple[int, tuple[WallSeries, ...]]:
    """Return the number of nodes and the terms of all walls, one for crossed walls if possible.

    A pane of glass then makes one echo of each point in place of a dozen, at a few nodes more.
    """
    for count in (FURNITURE_NODES, _PANE_NODES):
        series = delayed(walls, radar, count)
        if all(term.whole for number in crossed for term in series[number].terms[1]):
            return count, series
    return FURNITURE_NODES, delayed(walls, radar, FURNITURE_NODES)


def _transmitted(
    returns: RoomEchoes, radar: Radar, scene: Scene, series: tuple[WallSeries, ...]
) -> tuple[list[RoomEchoes], float]:
    """Echoes behind walls, in groups of equal delays, and their error [m]."""
    points = returns.points[0, 0, :, 0]
    walls = WallResponse(WallEdges.of(scene.walls, radar), series, returns.frequency)
    polarization = Polarization(radar.polarization, radar.axes)

    def legs(antennas: Array) -> list[_Leg]:
        # The co-polar field that arrives, as one wave for each way through the slabs.
        ways = points - antennas[:, None]
        directions = ways / np.linalg.norm(ways, axis=-1, keepdims=True)
        sent = antenna_field(directions, polarization, x_for_steep=True)
        waves = walls.transmitted(0, walls.start(sent), antennas[:, None], points)
        return [_Leg(wave, (wave.field * sent).sum(axis=-1).conj()) for wave in waves]

    # Pairs of waves that pass each wall equally often are one echo.
    groups: dict[tuple[tuple[int, int], ...], list[tuple[_Leg, _Leg]]] = {}
    for out, back in product(legs(radar.tx), legs(radar.rx)):
        passes = Counter[int]()
        for one in (*out.wave.passages, *back.wave.passages):
            passes[one.wall] += one.passes
        groups.setdefault(tuple(sorted(passes.items())), []).append((out, back))
    # A bound on each echo tells which are worth it: most would only take memory.
    strength = np.abs(returns.amplitude).max(axis=(0, 1, 2))
    bounds = [
        sum(np.prod([np.abs(leg.left).max(axis=(0, 1)) for leg in pair], axis=0) for pair in pairs)
        * strength
        for pairs in groups.values()
    ]
    sizes, parts, off = np.array(bounds), list[RoomEchoes](), 0.0
    # Each group has its own points: those for which it is worth an echo.
    for pairs, size, some in zip(groups.values(), sizes, _worth(sizes), strict=True):
        if some.any():
            parts.append(_together(returns.take(some), pairs, some, radar.rx_of_tx))
            passed = (one for pair in pairs for leg in pair for one in leg.wave.passages)
            if not all(series[one.wall].held[1] for one in passed):
                off = max(off, float(size.max()))
    return parts, off


def _together(
    returns: RoomEchoes, pairs: list[tuple[_Leg, _Leg]], some: Bools, kept: NDArray[np.int64]
) -> RoomEchoes:
    """Sum some of the echoes over all pairs of waves, at their mean length.

    What each wave is longer than the mean is in the amplitude.
    """

    def longer(out: _Leg, back: _Leg) -> Array:
        return out.wave.extra_m[:, None, some] + back.wave.extra_m[kept][..., some]

    def left(out: _Leg, back: _Leg, node: int) -> Field:
        return out.left[node][:, None, some] * back.left[node][kept][..., some]

    # Pair by pair and node by node, which takes less memory.
    middle, total, weighted = len(returns.frequency) // 2, np.zeros(1), np.zeros(1)
    # The mean length of a group, weighted by the fields of its waves.
    for pair in pairs:
        size = np.abs(left(*pair, middle))
        total, weighted = total + size, weighted + size * longer(*pair)
    mean = np.where(total > 0, weighted / np.where(total > 0, total, 1.0), 0.0)
    amplitude = np.zeros_like(returns.amplitude)
    # Each wave is turned by what its length differs from the mean.
    for node, wavenumber in enumerate(2 * np.pi * returns.frequency / SPEED_OF_LIGHT_MPS):
        for pair in pairs:
            turn = np.exp(1j * wavenumber * (longer(*pair) - mean))
            amplitude[node] += turn * left(*pair, node)
    amplitude *= returns.amplitude
    return replace(returns, length=returns.length + mean, amplitude=amplitude)


def _worth(sizes: Array) -> Bools:
    """Select all but the weakest, whose rms sum is a small fraction of the strongest."""
    order = np.argsort(sizes, axis=None)
    together = np.sqrt(np.cumsum(sizes.ravel()[order] ** 2))
    worth = np.ones(sizes.size, dtype=bool)
    worth[order[together <= ENOUGH * sizes.max(initial=0.0)]] = False
    return worth.reshape(sizes.shape)
