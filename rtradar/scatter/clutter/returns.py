"""What one object of a room sends back: echoes of every Tx and every Rx kept with it, and where their paths go."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.common.nodes import interpolation_weights, sweep_nodes

Array = NDArray[np.float64]
Kind = Literal["mirror", "furniture", "reflector", "rough"]

MOST_NODES = 13
"""Of a polynomial over the sweep: with more, what `synthesize` makes of it in powers of time loses digits."""
FURNITURE_NODES = 5
DENSE_NODES = 33
"""Frequencies at which slabs are taken before as few as serve are kept."""
_NODES = (1, 3, 5, 7, 9, 11, MOST_NODES)
FREQUENCY_ERROR = 1e-3
"""Of the strongest echo of an object, by which its amplitude may be off between frequency nodes."""


@dataclass(frozen=True)
class RoomEchoes:
    """Echoes of one object for one TDM cycle.

    Parameters
    ----------
    name : str
        Name of the wall, of the walls in the order of their reflections, or of the piece of
        furniture.
    kind : {"mirror", "furniture", "reflector", "rough"}
        Reflection by walls; facets of furniture; sheets of metal with several bounces; diffuse return of a rough wall.
    length : (tx, rx, echo) float64
        Tx..Rx [m], rx as kept with that Tx.
    amplitude : (node, tx, rx, echo) complex128
        Scattering lengths, defined as in `Echoes` [m].
    frequency : (node,) float64
        [Hz].
    bounces : (echo,) int64
    points : (tx or 1, rx or 1, echo, hop, 3) float64
        Where the path goes between Tx and Rx, world [m]; 1 where all antennas share the points.
    off_m : float
        What the polynomial through the nodes is known to be off by, at most, where that is more than was asked for [m].
    """

    name: str
    kind: Kind
    length: Array
    amplitude: NDArray[np.complex128]
    frequency: Array
    bounces: NDArray[np.int64]
    points: Array
    off_m: float = 0.0

    @property
    def n_echoes(self) -> int:
        """How many."""
        return len(self.bounces)

    def power_m2(self) -> float:
        """Sum of |amplitude|^2 at the sweep's middle node, mean over the channels [m^2]."""
        middle = self.amplitude[len(self.frequency) // 2]
        return float((np.abs(middle) ** 2).sum(axis=-1).mean())

    def strongest_cell_m2(self, radar: Radar) -> float:
        """Largest power of any channel in any range bin, its echoes added with their phases [m^2]."""
        middle = len(self.frequency) // 2
        wavenumber = 2 * np.pi * self.frequency[middle] / SPEED_OF_LIGHT_MPS
        field = (self.amplitude[middle] * np.exp(1j * wavenumber * self.length)).reshape(
            -1, self.n_echoes
        )
        bins = np.minimum(self.length / (2 * radar.range_bin_m), radar.samples_per_chirp).astype(
            np.int64
        )
        strongest = 0.0
        # Once more with bins half a bin further: no pair of neighbours is always parted.
        shifted = np.minimum(
            self.length / (2 * radar.range_bin_m) + 0.5, radar.samples_per_chirp
        ).astype(np.int64)
        for cells in (bins.reshape(field.shape), shifted.reshape(field.shape)):
            channel = np.arange(len(field))[:, None] * (radar.samples_per_chirp + 1)
            # Beyond the last bin the low-pass lets nothing through.
            heard = cells < radar.samples_per_chirp
            sums = [
                np.bincount((channel + cells)[heard], weights=part[heard], minlength=1)
                for part in (field.real, field.imag)
            ]
            strongest = max(strongest, float((sums[0] ** 2 + sums[1] ** 2).max()))
        return strongest

    def take(self, which: NDArray[np.bool_]) -> RoomEchoes:
        """Some of the echoes."""
        return replace(
            self,
            length=self.length[..., which],
            amplitude=self.amplitude[..., which],
            bounces=self.bounces[which],
            points=self.points[:, :, which],
        )

    def heard(self, radar: Radar) -> RoomEchoes:
        """Those that any antenna hears: not all hidden, and not all beyond the reach of the sampling."""
        near = (self.length < 2 * radar.max_range_m) & (self.amplitude != 0).any(axis=0)
        return self.take(near.any(axis=(0, 1)))

    def at_nodes(self, frequency: Array) -> NDArray[np.complex128]:
        """Amplitudes (node, tx, rx, echo) of the polynomial at other frequencies (node,) [Hz]."""
        weights = interpolation_weights(self.frequency, frequency)
        return np.asarray(np.tensordot(weights, self.amplitude, axes=1))

    def with_fewest_nodes(self, radar: Radar, error: float = FREQUENCY_ERROR) -> RoomEchoes:
        """With the fewest frequency nodes that keep the amplitudes within this of the strongest; see ``off_m``."""
        largest = np.abs(self.amplitude).max(initial=0.0)
        for count in _NODES:
            nodes = sweep_nodes(radar, count)
            fewer = self.at_nodes(nodes)
            again = np.tensordot(interpolation_weights(nodes, self.frequency), fewer, axes=1)
            off = float(np.abs(again - self.amplitude).max(initial=0.0))
            if off <= error * largest:
                return replace(self, amplitude=fewer, frequency=nodes, off_m=0.0)
        return replace(self, amplitude=fewer, frequency=nodes, off_m=off)


def best_followed(ways: Iterable[Callable[[], RoomEchoes | None]]) -> RoomEchoes | None:
    """Of several ways to write the same echoes, the first that as many nodes as there may be follow; else the nearest to it."""
    best = None
    for way in ways:
        found = way()
        if found is None or not found.off_m:
            return found
        best = found if best is None or found.off_m < best.off_m else best
    return best
