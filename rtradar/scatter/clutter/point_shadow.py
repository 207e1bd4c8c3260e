"""The moving shadow in points of the clutter that all antennas share: furniture and rough walls."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.scatter.silhouettes import Posed, occluded_fractions, wave_table
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import shadow_nodes, sweep_nodes
from rtradar.system.threads import thread_map

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Indices = NDArray[np.int64]
Bools = NDArray[np.bool_]

FADE, REACH = 0.1, 3.0
"""Damping ``eps`` of the integral, and Fresnel radii beyond which parts are left out: fringes are
then below 0.5 %."""
_LEGS_A_THREAD = 256


class Precision(NamedTuple):
    """How the shadow in shared points is computed.

    ``nodes`` is the number of frequencies; ``along_tx`` and ``along_rx`` are the numbers of places
    along each line of antennas, 0 for the array's middle; ``lines`` is the number of lines of the
    integral, and ``reach`` is as `REACH`.
    """

    nodes: int
    along_tx: int
    along_rx: int
    lines: int
    reach: float


EXACT = Precision(5, 99, 99, 256, 4.0)
"""-25 dB of the change of the samples in a kick, where nothing may be in error
(``validation/other_methods/shadow.py``)."""
FINE = Precision(3, 99, 2, 128, REACH)
"""Errors are measured against this. Each approximation by itself is below -25 dB of the change of
the samples in a walk. In a kick, which changes more, all together are at -15 dB: what two places on
a line of receivers and three frequencies leave out counts as much as fringes beyond `REACH`."""
CLOSE = FINE._replace(lines=40)
"""-12 dB of what changes in 0.1 s of a kick."""
USUAL = Precision(3, 99, 2, 24, 2.0)
"""-20 dB of what strong points lose."""
FAINT = Precision(1, 0, 0, 12, 2.0)
"""From the array's middle alone: -7 dB of what points lose, and half the change in 0.1 s."""


class SharedPoints(NamedTuple):
    """Points ``places (point, 3)`` [m], the ``number`` of each one's echo, and its power [m^2]."""

    places: Array
    number: Indices
    power: Array

    def some(self, which: Indices | Bools) -> SharedPoints:
        """Return some of them."""
        return SharedPoints(self.places[which], self.number[which], self.power[which])

    def shares(self) -> Array:
        """Power of all points that are stronger than each, over that of all."""
        order = np.argsort(-self.power)
        share = np.empty(len(order))
        share[order] = np.cumsum(self.power[order]) - self.power[order]
        return share / max(float(self.power.sum()), 1e-300)

    def near(self, radar: Radar, poses: Sequence[Posed]) -> Bools:
        """Which points have something in the Fresnel zone of their legs in any of some poses."""
        # A ball about all antennas stands for each of them.
        antennas = np.concatenate([radar.tx, radar.rx])
        middle = antennas.mean(axis=0)
        extent = float(np.linalg.norm(antennas - middle, axis=1).max())
        ways = self.places - middle
        squares = np.maximum((ways**2).sum(axis=1), 1e-30)
        found = np.zeros(len(ways), dtype=bool)
        # The place on each line of sight that is nearest to a ball of occluders, and the Fresnel
        # zone there.
        for place, radius in (ball for posed in poses for ball in _balls(posed)):
            away = place - middle
            along = ways @ away
            part = np.clip(along / squares, 0.0, 1.0)
            gap = away @ away - 2 * part * along + part**2 * squares
            zone = np.sqrt(radar.wavelength_m * part * (1 - part) * np.sqrt(squares))
            found |= gap < (radius + extent + REACH * zone) ** 2
        return found


def _balls(posed: Posed) -> list[tuple[Array, float]]:
    """Balls about all ellipsoids and about all triangles: middles [m] and radii [m]."""
    corners = posed.corners.reshape(-1, 3)
    found = []
    for places, longest in ((posed.centres, posed.longest), (corners, np.zeros(len(corners)))):
        if len(places):
            middle = (places.max(axis=0) + places.min(axis=0)) / 2
            radius = (np.linalg.norm(places - middle, axis=1) + longest).max()
            found.append((middle, float(radius)))
    return found


class PointShadow:
    """What some points lose, to a precision.

    It is computed for the Tx whose numbers are ``tx (tx,)``, or for all.
    """

    def __init__(
        self, radar: Radar, points: SharedPoints, precision: Precision, tx: Indices | None = None
    ) -> None:
        self.precision, self._radar, self._points = precision, radar, points
        # From places along the lines of antennas, with weights in each antenna, or from the middle
        # of the array alone.
        if precision.along_tx:
            own = radar, precision.along_tx, precision.along_rx
            places, tx_weights, rx_weights = shadow_nodes(*own)
            tx = np.arange(radar.n_tx) if tx is None else tx
            used = tx_weights[tx].any(axis=0) | rx_weights.any(axis=0)
            self._antennas, self._rx_of_tx = places[used], radar.rx_of_tx[tx]
            self._tx_weights, self._rx_weights = tx_weights[tx][:, used], rx_weights[:, used]
        else:
            self._antennas = np.concatenate([radar.tx, radar.rx]).mean(axis=0)[None]
            self._rx_of_tx = np.zeros((1, 1), dtype=np.int64)
            self._tx_weights = self._rx_weights = np.ones((1, 1))
        self._scales = sweep_nodes(radar, precision.nodes) / radar.centre_frequency_hz

    def at(self, posed: Posed) -> tuple[Indices, Field]:
        """Return which echoes lose something, and the lost fraction (node, tx, rx, echo)."""
        which, fraction = self._find(posed)
        return self._points.number[which], fraction

    def samples(self, fields: Field, posed: Posed) -> Field:
        """Sum what all points lose of ``fields (node, tx, rx, point)``, over the points.

        A loss at one frequency, or for one Tx, stands for all.
        """
        which, fraction = self._find(posed)
        return np.asarray((fields[..., which] * fraction).sum(axis=-1))

    def _find(self, posed: Posed) -> tuple[Indices, Field]:
        # Only points that have something in their Fresnel zones are computed, and of those only the
        # ones that lose something are kept.
        near = np.flatnonzero(self._points.near(self._radar, [posed]))
        lost = self._seen_from(self._antennas, near, posed)
        some = lost.any(axis=(0, 2))
        lost, near = lost[:, some], near[some]
        # BLAS is not used, because its threads cost more than these few numbers.
        # What an echo keeps is the product of what both of its legs keep.
        of_tx, of_rx = (
            1 - np.einsum("an,nef->fae", weights, lost)
            for weights in (self._tx_weights, self._rx_weights)
        )
        return near, 1 - of_tx[:, :, None] * of_rx[:, self._rx_of_tx]

    def _seen_from(self, antennas: Array, which: Indices, posed: Posed) -> Field:
        """Fraction lost on the legs from places to some points (place, point, node)."""
        starts = np.repeat(antennas, len(which), axis=0)
        ends = np.tile(self._points.places[which], (len(antennas), 1))
        length = np.linalg.norm(ends - starts, axis=1)
        geometry, own = (starts, ends, np.zeros(len(length)), length), self.precision
        lost = lost_on_legs(self._radar, geometry, posed, own.reach, own.lines, self._scales)
        return lost.reshape(len(antennas), len(which), len(self._scales))


def lost_on_legs(
    radar: Radar, geometry: tuple[Array, ...], posed: Posed, reach: float, lines: int, scales: Array
) -> Field:
    """Fraction of the field that each leg loses (leg, node); see `occluded_fractions`."""
    out = np.zeros((len(geometry[0]), len(scales)), dtype=np.complex128)

    def fill(begin: int) -> None:
        some = slice(begin, begin + _LEGS_A_THREAD)
        own = tuple(np.ascontiguousarray(array[some]) for array in geometry)
        given = radar.wavelength_m, tuple(posed), reach, lines, scales, _table()
        occluded_fractions(own, *given, out[some])

    thread_map(fill, range(0, len(out), _LEGS_A_THREAD))
    return out


@lru_cache
def _table() -> Field:
    return np.asarray(wave_table(FADE))
