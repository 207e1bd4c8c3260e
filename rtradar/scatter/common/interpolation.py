"""Interpolation over the sweep and over the array, and sets of echoes at the nodes of others.

A line of Tx with the Rx lines that are kept with it is one block of channels. What changes little
over the array is computed at a few places along each line and interpolated in between.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.radar import Radar

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_KEPT_NODES = 32
"""Radars at rest whose nodes are kept; for a radar that moves these are poses used together."""


def sweep_nodes(radar: Radar, count: int) -> Array:
    """Return the Chebyshev nodes of the sweep (node,) [Hz], in ascending order.

    They are the zeros of the Chebyshev polynomial of that degree over it.
    """
    place = -np.cos((np.arange(count) + 0.5) * np.pi / count)
    return np.asarray(radar.centre_frequency_hz + radar.sampled_bandwidth_hz / 2 * place)


def interpolation_weights(nodes: Array, places: Array) -> Array:
    """Compute the values (place, node) at some places of the Lagrange polynomials of nodes.

    The product of these with values at the nodes is the polynomial through the values. Nodes and
    places are in the same unit, and the nodes are all different. SciPy's barycentric form takes the
    nodes in a random order: its last bits would change from one run to the next.
    """
    # Each polynomial is 1 at its own node and 0 at the others.
    others = ~np.eye(len(nodes), dtype=bool)
    columns = [
        np.prod((places[:, None] - nodes[own]) / (node - nodes[own]), axis=1)
        for node, own in zip(nodes, others, strict=True)
    ]
    return np.stack(columns, axis=1)


# -- lines of antennas -----------------------------------------------------------------------------


def _tx_lines(radar: Radar) -> list[tuple[Indices, list[Indices]]]:
    """List each line of Tx with the lines of Rx kept with it, which are indices among these Rx."""
    found = []
    # The Rx of the first Tx of a line are those of all of its Tx.
    for line in radar.tx_lines:
        kept = radar.rx_of_tx[line[0]]
        groups = [np.flatnonzero(np.isin(kept, own)) for own in radar.rx_lines]
        found.append((line, [group for group in groups if len(group)]))
    return found


def _evenly(count: int) -> Array:
    """Places from 0 to 1 along a line; a single one is in the middle."""
    return np.linspace(0, 1, count) if count > 1 else np.array([0.5])


def _straight(count: int, places: int = 2) -> Array:
    """Weights (antenna, place) of places spread evenly along a line in each of its antennas."""
    # Linear interpolation between neighbouring places.
    fraction = np.linspace(0.0, places - 1.0, count)
    return np.maximum(1 - np.abs(fraction[:, None] - np.arange(places)), 0.0)


@dataclass(frozen=True)
class ArrayEnds:
    """Ends of the lines of a radar, for linear interpolation in between.

    A line is a line of Tx with the Rx that are kept with it; ``line_of_tx (tx,)`` is the line of
    each Tx. ``tx (line, tx_end, 3)`` and ``rx (line, rx_end, 3)`` are the ends [m]: two for each
    line of Rx, and as many places along the Tx as are asked for. ``tx_middle`` and ``rx_middle
    (line, 3)`` are mean positions [m]. ``tx_weight (tx, tx_end)`` and ``rx_weight (tx, rx,
    rx_end)`` are the weights of the ends in each Tx and each Rx kept with it.
    """

    line_of_tx: Indices
    tx_weight: Array
    rx_weight: Array
    tx: Array
    rx: Array
    tx_middle: Array
    rx_middle: Array

    @classmethod
    def of(cls, radar: Radar, places: int = 2) -> ArrayEnds:
        """Return the ends of the lines of this radar at rest, for so many places along its Tx."""
        lines = _tx_lines(radar)
        line_of_tx, tx_weight = np.empty(radar.n_tx, np.int64), np.empty((radar.n_tx, places))
        rx_weight = np.zeros((radar.n_tx, radar.n_rx, 2 * len(lines[0][1])))
        found = []
        # Each line with its own ends, and where these stand.
        for number, (line, groups) in enumerate(lines):
            tx, rx = radar.tx[line], radar.rx[radar.rx_of_tx[line[0]]]
            line_of_tx[line], tx_weight[line] = number, _straight(len(line), places)
            # Two ends for each line of Rx, whose weights are 0 in the antennas of other lines.
            for column, group in enumerate(groups):
                own = slice(2 * column, 2 * column + 2)
                rx_weight[line[:, None], group, own] = _straight(len(group))
            rx_ends = np.concatenate([rx[group[[0, -1]]] for group in groups])
            tx_ends = np.linspace(tx[0], tx[-1], places)
            found.append((tx_ends, rx_ends, tx.mean(axis=0), rx.mean(axis=0)))
        ends = (np.array(every) for every in zip(*found, strict=True))
        return cls(line_of_tx, tx_weight, rx_weight, *ends)


@lru_cache(maxsize=_KEPT_NODES)
def shadow_nodes(radar: Radar, along_tx: int = 2, along_rx: int = 1) -> tuple[Array, Array, Array]:
    """Return places along the lines of Tx and of Rx (node, 3) [m], and their weights.

    A single place is the middle of a line; several are spread from end to end, and are at most as
    many as the line has antennas. Then follow the weights of the places in each antenna, (tx, node)
    and (rx, node). The radar is at rest.
    """
    blocks, found = [], []
    for antennas, lines, count in (
        (radar.tx, radar.tx_lines, along_tx),
        (radar.rx, radar.rx_lines, along_rx),
    ):
        # Places along each line, and their weights in its antennas.
        for line in lines:
            own, places = antennas[line], min(count, len(line))
            ends = np.linspace(own[0], own[-1], places) if places > 1 else own.mean(axis=0)[None]
            blocks.append((ends, _straight(len(line), places)))
        # Weights are made line by line: this puts them into the order of the antennas.
        found.append(np.argsort(np.concatenate(lines)))
    # One line's places have no weight in another line, so all weights are one block each.
    weights = np.split(block_diag(*(weight for _, weight in blocks)), [radar.n_tx])
    tx, rx = (own[order] for own, order in zip(weights, found, strict=True))
    return np.concatenate([places for places, _ in blocks]), tx, rx


class ArrayNodes(NamedTuple):
    """Places for interpolation over the array.

    ``antennas (antenna, 3)`` are world positions [m]; ``pairs (pair, 2)`` are Tx and Rx among them;
    ``weights (tx, rx, pair)`` are those of each pair for each Tx and each Rx kept with it.
    """

    antennas: Array
    pairs: Indices
    weights: Array


class _Block(NamedTuple):
    """A line of Tx with one of Rx: indices, ends, and places of the nodes from 0 to 1 along each.

    Indices of Rx are among the Rx kept with these Tx; ``ends (tx or rx, first or last, 3)`` [m].
    """

    tx: Indices
    rx: Indices
    ends: Array
    tx_nodes: Array
    rx_nodes: Array


def _blocks(radar: Radar, along: tuple[int, int]) -> Iterator[_Block]:
    for tx_line, rx_lines in _tx_lines(radar):
        kept = radar.rx[radar.rx_of_tx[tx_line[0]]]
        for rx_line in rx_lines:
            ends = np.stack([radar.tx[tx_line[[0, -1]]], kept[rx_line[[0, -1]]]])
            counts = np.minimum(along, (len(tx_line), len(rx_line)))
            yield _Block(tx_line, rx_line, ends, *(_evenly(int(count)) for count in counts))


@lru_cache(maxsize=_KEPT_NODES)
def array_nodes(radar: Radar, along_tx: int, along_rx: int) -> ArrayNodes:
    """Spread nodes evenly from end to end of each line, for polynomials in between.

    There are ``along_tx`` nodes of Tx times ``along_rx`` of Rx for each two lines. A line with
    fewer antennas than that has a node at each; a single node is in the middle. The radar is at
    rest.
    """
    places, weights = list[Array](), list[Array]()
    # Each line of Tx with each line of Rx is interpolated by itself.
    for block in _blocks(radar, (along_tx, along_rx)):
        tx, rx = (
            ends[0] + nodes[:, None] * (ends[1] - ends[0])
            for ends, nodes in zip(block.ends, (block.tx_nodes, block.rx_nodes), strict=True)
        )
        # Every node of the one with every node of the other.
        places.append(np.stack([np.repeat(tx, len(rx), axis=0), np.tile(rx, (len(tx), 1))], axis=1))
        own = _product_weights(block, _evenly(len(block.tx)), _evenly(len(block.rx)))
        weights.append(np.zeros((radar.n_tx, radar.n_rx, own.shape[1])))
        weights[-1][np.ix_(block.tx, block.rx)] = own.reshape(len(block.tx), len(block.rx), -1)
    # Nodes of several blocks at one place are one antenna.
    antennas, where = np.unique(np.concatenate(places).reshape(-1, 3), axis=0, return_inverse=True)
    return ArrayNodes(antennas, where.reshape(-1, 2), np.concatenate(weights, axis=2))


def spread_nodes(radar: Radar, few: tuple[int, int], many: tuple[int, int]) -> Array:
    """Compute weights (pair of many, pair of few) from a coarse `array_nodes` to a fine one."""
    blocks = zip(_blocks(radar, few), _blocks(radar, many), strict=True)
    weights = (_product_weights(a, b.tx_nodes, b.rx_nodes) for a, b in blocks)
    return np.asarray(block_diag(*weights))


def _product_weights(block: _Block, tx: Array, rx: Array) -> Array:
    """Weights (pair, pair of nodes) of a block at pairs of places along both lines."""
    own = interpolation_weights(block.tx_nodes, tx), interpolation_weights(block.rx_nodes, rx)
    return np.asarray(np.kron(*own), dtype=np.float64)


# -- echoes ----------------------------------------------------------------------------------------


def at_nodes(amplitude: NDArray[Any], frequency: Array, nodes: Array) -> NDArray[Any]:
    """Evaluate amplitudes (node, ...), polynomials through a frequency (node,), at others [Hz]."""
    # A single frequency stands for the whole sweep.
    if len(frequency) == 1:
        return np.broadcast_to(amplitude, (len(nodes), *amplitude.shape[1:]))
    if np.array_equal(frequency, nodes):
        return amplitude
    weights = interpolation_weights(frequency, nodes).astype(amplitude.real.dtype)
    # BLAS is not used, because its threads cost more than these few sums.
    pairs = zip(weights.T, amplitude, strict=True)
    return np.asarray(sum(np.multiply.outer(weight, own) for weight, own in pairs))


def field_of(echoes: Echoes, frequency: Array) -> NDArray[Any]:
    """Sum echoes as fields at some frequencies (node,) [Hz], (node, chirp, rx) [m]."""
    amplitude = at_nodes(echoes.amplitude, echoes.frequency, frequency)
    turns = 2j * np.pi / SPEED_OF_LIGHT_MPS * frequency[:, None, None, None] * echoes.length
    return np.asarray((amplitude * np.exp(turns)).sum(axis=-1))


def take(echoes: Echoes, which: NDArray[np.int64]) -> Echoes:
    """Return some of the echoes, each as often as ``which (echo,)`` names it.

    The arrays of neighbouring echoes are views.
    """
    side_by_side = len(which) > 0 and bool(np.all(np.diff(which) == 1))
    some = slice(int(which[0]), int(which[-1]) + 1) if side_by_side else which
    return dataclasses.replace(
        echoes,
        length=echoes.length[..., some],
        amplitude=echoes.amplitude[..., some],
        part=echoes.part[some],
        bounces=echoes.bounces[some],
        path=echoes.path[some],
    )


def weakest(power: Array, most: float) -> NDArray[np.bool_]:
    """Whether each echo is among the weakest, whose powers (echo,) add up to ``most`` [m^2]."""
    order = np.argsort(power)
    among = np.empty(len(power), dtype=bool)
    among[order] = np.cumsum(power[order], dtype=np.float64) <= most
    return among


def times_factor(echoes: Echoes, frequency: Array, factor: NDArray[Any]) -> Echoes:
    """Multiply amplitudes by a factor (node, chirp, rx, echo), a polynomial through a frequency.

    The nodes of the product are the more numerous of both, because walls and a body change little
    over the sweep.
    """
    nodes = max(echoes.frequency, frequency, key=len)
    own = at_nodes(echoes.amplitude, echoes.frequency, nodes)
    return dataclasses.replace(
        echoes, amplitude=own * at_nodes(factor, frequency, nodes), frequency=nodes
    )


def together(several: Sequence[Echoes]) -> Echoes:
    """Put echoes of the same chirps one after the other, at the most numerous of their nodes.

    The polynomials of the others are evaluated there, which changes nothing. Parts keep their
    numbers.
    """
    first, nodes = several[0], max((own.frequency for own in several), key=len)
    amplitudes = [at_nodes(own.amplitude, own.frequency, nodes) for own in several]
    return Echoes(
        length=np.concatenate([own.length for own in several], axis=2),
        amplitude=np.concatenate(amplitudes, axis=3),
        frequency=nodes,
        tx=first.tx,
        part=np.concatenate([own.part for own in several]),
        bounces=np.concatenate([own.bounces for own in several]),
        path=np.concatenate([own.path for own in several]),
    )
