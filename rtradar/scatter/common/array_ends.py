"""Both ends of each line of antennas: what changes little over the array is found there and drawn straight in between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ArrayEnds:
    """Ends of the lines of a radar; a line is a line of transmitters with the receivers that hear it.

    Parameters
    ----------
    line_of_tx : (tx,) int64
        Line of each transmitter.
    tx, rx : (line, 2, 3), (line, rx_end, 3) float64
        Ends [m]: two of the transmitters, and two for each line of receivers.
    tx_middle, rx_middle : (line, 3) float64
        Mean places [m].
    tx_weight : (tx, 2) float64
        Share of each end in each transmitter.
    rx_weight : (tx, rx, rx_end) float64
        Share of each end in each receiver that hears it.
    """

    line_of_tx: NDArray[np.int64]
    tx: Array
    rx: Array
    tx_middle: Array
    rx_middle: Array
    tx_weight: Array
    rx_weight: Array

    @classmethod
    def of(cls, radar: Radar) -> ArrayEnds:
        """Those of this radar."""
        lines = [
            np.arange(first, last)
            for first, last in ((0, radar.tx_y), (radar.tx_y, radar.n_tx))
            if last > first
        ]
        line_of_tx = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
        tx_weight = np.concatenate([_straight(len(line)) for line in lines])
        tx_ends, rx_ends, rx_weights = [], [], []
        for line in lines:
            heard = radar.rx_of_tx[line[0]]
            groups = [
                np.flatnonzero(chosen)
                for chosen in (heard < radar.rx_y, heard >= radar.rx_y)
                if chosen.any()
            ]
            weight = np.zeros((len(heard), 2 * len(groups)))
            for column, group in enumerate(groups):
                weight[group, 2 * column : 2 * column + 2] = _straight(len(group))
            tx_ends.append(radar.tx[[line[0], line[-1]]])
            rx_ends.append(np.concatenate([radar.rx[heard[group[[0, -1]]]] for group in groups]))
            rx_weights.append(weight)
        return cls(
            line_of_tx,
            np.array(tx_ends),
            np.array(rx_ends),
            np.array([radar.tx[line].mean(axis=0) for line in lines]),
            np.array([radar.rx[radar.rx_of_tx[line[0]]].mean(axis=0) for line in lines]),
            tx_weight,
            np.array(rx_weights)[line_of_tx],
        )


def _straight(count: int) -> Array:
    share = np.linspace(0.0, 1.0, count) if count > 1 else np.zeros(1)
    return np.column_stack([1 - share, share])
