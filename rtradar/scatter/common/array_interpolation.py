"""A few pairs of places along the lines of an array, and how what was computed there serves every pair of antennas."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from rtradar.radar import Radar
from rtradar.scatter.common.nodes import interpolation_weights


class ArrayNodes(NamedTuple):
    """Places for interpolation over the array.

    ``antennas (antenna, 3)`` world [m]; ``pairs (pair, 2)`` Tx and Rx among them; ``weights (tx, rx, pair)`` of what was
    found at each pair for each transmitter and each receiver kept with it.
    """

    antennas: NDArray[np.float64]
    pairs: NDArray[np.int64]
    weights: NDArray[np.float64]


class _Block(NamedTuple):
    """One line of Tx with one line of Rx: antennas by number, their places and those of the nodes from 0 to 1 along each."""

    tx: NDArray[np.int64]
    rx: NDArray[np.int64]  # among those kept with these Tx
    ends: NDArray[np.float64]  # (tx or rx, first or last, 3)
    tx_nodes: NDArray[np.float64]
    rx_nodes: NDArray[np.float64]


def _blocks(radar: Radar, along: tuple[int, int]) -> Iterator[_Block]:
    for tx_line in (np.arange(radar.tx_y), np.arange(radar.tx_y, radar.n_tx)):
        if not len(tx_line):
            continue
        kept = radar.rx_of_tx[tx_line[0]]
        for rx_line in (np.flatnonzero(kept < radar.rx_y), np.flatnonzero(kept >= radar.rx_y)):
            if len(rx_line):
                tx, rx = radar.tx[tx_line], radar.rx[kept[rx_line]]
                nodes = (
                    _evenly(min(count, len(line)))
                    for count, line in zip(along, (tx, rx), strict=True)
                )
                yield _Block(tx_line, rx_line, np.stack([tx[[0, -1]], rx[[0, -1]]]), *nodes)


def array_nodes(radar: Radar, along_tx: int, along_rx: int) -> ArrayNodes:
    """Nodes spread evenly from end to end of each line: ``along_tx`` of Tx times ``along_rx`` of Rx for each two lines.

    A line with fewer antennas than that has a node at each; one node stands in the middle. Between nodes runs the
    polynomial through them.
    """
    places: list[NDArray[np.float64]] = []
    blocks = list(_blocks(radar, (along_tx, along_rx)))
    weights = np.zeros(
        (radar.n_tx, radar.n_rx, sum(len(block.tx_nodes) * len(block.rx_nodes) for block in blocks))
    )
    done = 0
    for block in blocks:
        tx, rx = (
            ends[0] + nodes[:, None] * (ends[1] - ends[0])
            for ends, nodes in zip(block.ends, (block.tx_nodes, block.rx_nodes), strict=True)
        )
        places.append(np.stack([np.repeat(tx, len(rx), axis=0), np.tile(rx, (len(tx), 1))], axis=1))
        own = np.kron(
            interpolation_weights(block.tx_nodes, _evenly(len(block.tx))),
            interpolation_weights(block.rx_nodes, _evenly(len(block.rx))),
        )
        count = own.shape[1]
        weights[np.ix_(block.tx, block.rx, np.arange(done, done + count))] = own.reshape(
            len(block.tx), len(block.rx), count
        )
        done += count
    pairs = np.concatenate(places)
    antennas, where = np.unique(pairs.reshape(-1, 3), axis=0, return_inverse=True)
    return ArrayNodes(antennas, where.reshape(-1, 2), weights)


def spread_nodes(radar: Radar, few: tuple[int, int], many: tuple[int, int]) -> NDArray[np.float64]:
    """Weights (pair of many, pair of few) of what was found at the nodes of a coarse `array_nodes` for those of a fine one."""
    blocks = zip(_blocks(radar, few), _blocks(radar, many), strict=True)
    return np.asarray(
        block_diag(
            *(
                np.kron(
                    interpolation_weights(a.tx_nodes, b.tx_nodes),
                    interpolation_weights(a.rx_nodes, b.rx_nodes),
                )
                for a, b in blocks
            )
        )
    )


def _evenly(count: int) -> NDArray[np.float64]:
    return np.linspace(0, 1, count) if count > 1 else np.array([0.5])
