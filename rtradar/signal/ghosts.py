"""IF samples of ghosts, the echoes over walls, computed at anchors and followed between them.

There are many times as many ghosts as direct echoes, and they are weaker. Their lengths and
amplitudes are computed every few milliseconds, and between these anchors they are cubics in time.
Over the sweep an amplitude is a constant and, where it matters, a parabola. What this leaves out is
measured against the exact sum, and the anchors lie so close that it stays below a tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.echoes import Echoes
from rtradar.kernels.nufft import (
    ANCHORS,
    Anchors,
    BetweenAnchors,
    add_anchored_tones,
    fill_anchors,
)
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import weakest
from rtradar.signal.synthesis import (
    synthesize,
    warn_of_motion_in_chirp,
    weights_of_nodes,
)
from rtradar.system.threads import in_threads

APART_S = (12e-3, 8e-3, 5e-3, 3e-3, 2e-3)
"""Distances between anchors [s], the longest first, of which the first that is good enough counts.
A walker's limbs turn round in 100 ms."""

_MARGIN_DB = 1.5
"""What is measured at some instants may be so much larger over the capture [dB]. It is measured in
the middle between anchors, where the error of a cubic has 2.9 dB more power than on average."""

_OF_CHANGES = 0.2
"""Part of the tolerated power for the changes over the sweep that are left out."""

_STREAMS = 8
"""Ranges from which ghosts are added in turn."""

MOST_NODES = 3
"""Frequencies at which amplitudes may be given: those of a parabola."""

_TESTS, _POWER_CHIRPS = 6, 48

AHEAD = 8
"""Anchors that are computed with those that are needed, because a call has its price."""


GhostEchoes = Callable[[NDArray[np.int64]], Echoes]
"""Function that computes the echoes over walls at some chirps; they have lengths also where they
are not seen, and are the same ones at every chirp."""


class GhostIf:
    """The IF samples of ghosts by anchors ``apart`` cycles from each other.

    ``order (ghost,)`` sorts the ghosts so that the last ``changing`` of them change over the sweep.
    ``cycles (anchor,)`` are the cycles of the anchors.
    """

    def __init__(
        self,
        ghosts: GhostEchoes,
        radar: Radar,
        n_cycles: int,
        apart: int,
        order: NDArray[np.int64],
        changing: int,
    ) -> None:
        self._ghosts, self._radar = ghosts, radar
        self._order, self._changing = order, changing
        # Evenly over the capture, with enough anchors for a cubic.
        gaps = max(ANCHORS - 1, math.ceil((n_cycles - 1) / apart))
        self.cycles = np.unique(np.rint(np.linspace(0, n_cycles - 1, gaps + 1)).astype(np.int64))
        # The anchors that are held, from the first on.
        shape = 0, radar.n_tx, radar.n_rx
        self._first, self._held = 0, _empty_anchors(shape, len(order), changing)

    def add(self, samples: NDArray[np.complex64], chirps: NDArray[np.int64]) -> None:
        """Add the samples of some chirps to ``samples (chirp, rx, sample)`` complex64, in place.

        The chirps (chirp,) are numbered from the start of the capture, ascending.
        """
        if len(self._order) == 0:
            return
        radar = self._radar
        self.compute(chirps)
        # The four anchors about each chirp, and their weights in the cubic at its cycle.
        cycle, tx = chirps // radar.n_tx, radar.tx_of_chirp(chirps)
        first = self._first_anchor(cycle)
        weight = _cubic_weights(self.cycles[first[:, None] + np.arange(ANCHORS)], cycle)
        # Under FDM each Tx has a carrier of its own.
        carrier = radar.sampled_start_hz + radar.tx_offset_hz[tx]
        carrier, slope = carrier.astype(np.float64), float(radar.slope_hz_per_s)
        between = BetweenAnchors(
            first - self._first, weight, tx, carrier, slope, float(radar.sample_rate_hz)
        )
        add_anchored_tones(self._held, between, samples)

    def compute(self, chirps: NDArray[np.int64], ahead: int = 0) -> None:
        """Compute the anchors around some chirps, and some ``ahead`` if any are missing."""
        ends = self._first_anchor(chirps[[0, -1]] // self._radar.n_tx)
        begin, end = int(ends[0]), int(ends[1]) + ANCHORS
        held = self._first + len(self._held.length)
        if self._first <= begin and end <= held:
            return
        # Blocks come in order: anchors that are still needed stay, and only those after them are
        # computed.
        kept = slice(begin - self._first if self._first <= begin < held else held, None)
        start = held if kept.start < held else begin
        new = self._found(self.cycles[start : end + ahead])
        self._held = Anchors(
            np.concatenate([self._held.length[kept], new.length]),
            np.concatenate([self._held.level[:, kept], new.level], axis=1),
            np.concatenate([self._held.change[:, :, kept], new.change], axis=2),
        )
        self._first = begin

    def _first_anchor(self, cycle: NDArray[np.int64]) -> NDArray[np.int64]:
        """Number of the first of the anchors around each cycle."""
        first = np.searchsorted(self.cycles, cycle, side="right") - ANCHORS // 2
        return np.clip(first, 0, len(self.cycles) - ANCHORS)

    def _found(self, cycles: NDArray[np.int64]) -> Anchors:
        """Echoes at some cycles."""
        each = np.arange(self._radar.n_tx)
        chirps = (cycles[:, None] * len(each) + each).ravel()
        echoes = self._ghosts(chirps)
        warn_of_motion_in_chirp(echoes, self._radar, self._radar.centres_of(chirps))
        # The rows of each cycle in the order of the Tx.
        order = len(each) * np.arange(len(cycles))[:, None] + np.argsort(echoes.tx[: len(each)])
        weights = _legendre_weights(echoes, self._radar).astype(np.float32)
        found = _empty_anchors(
            (len(cycles), len(each), echoes.length.shape[1]), len(self._order), self._changing
        )
        given = order, echoes.length, echoes.amplitude, self._order, weights, tuple(found)
        in_threads(fill_anchors, order.size, *given)
        return found


def _empty_anchors(shape: tuple[int, int, int], kept: int, changing: int) -> Anchors:
    """Make room for echoes at anchors, of which the last change; shape is (anchor, tx, rx)."""
    return Anchors(
        np.empty((*shape, kept)),
        np.empty((2, *shape, kept), dtype=np.float32),
        np.empty((2, 2, *shape, changing), dtype=np.float32),
    )


def ghosts_within(
    ghosts: GhostEchoes, radar: Radar, n_chirps: int, power_m2: float
) -> tuple[GhostIf | None, dict[str, Any]]:
    """Approximate ghosts so that the mean power of the error of an IF sample stays below a limit.

    Parameters
    ----------
    ghosts : GhostEchoes
        Echoes over the walls of the room.
    radar : Radar
        Radar in the scene.
    n_chirps : int
        Chirps of the capture.
    power_m2 : float
        Largest mean power of the error [m^2].

    Returns
    -------
    GhostIf or None
        None where no distance between anchors is good enough.
    dict
        What was approximated, for JSON: the number of ghosts and of those that change over the
        sweep, the distance between anchors [s], and the error's power [m^2].
    """
    # Some chirps over the whole capture say how strong each ghost is, and how much it changes over
    # the sweep.
    spread = np.unique(np.linspace(0, n_chirps - 1, _POWER_CHIRPS).astype(np.int64))
    some = ghosts(spread)
    said = {"ghosts": len(some.part), "changing": 0}
    exact = said | {"anchors_apart_s": None, "error_m2": 0.0}
    # A cubic over a gap between frames would be far off.
    if len(some.frequency) > MOST_NODES or radar.burst_chirps is not None:
        return None, exact
    tilt, curve = (
        (np.abs(own) ** 2).mean(axis=(0, 1))
        for own in np.tensordot(_legendre_weights(some, radar)[1:], some.amplitude, axes=1)
    )
    # Times the mean squares of the polynomials over the sweep.
    changes = ~weakest(tilt / 3 + curve / 5, power_m2 * _OF_CHANGES)
    # Ghosts that do not change first, those that do last, each group in an order that suits the
    # kernel.
    length = some.length.mean(axis=(0, 1))
    groups = [np.flatnonzero(~changes), np.flatnonzero(changes)]
    order = np.concatenate([_apart(own, length) for own in groups])
    said |= {"changing": len(groups[1])}
    n_cycles = n_chirps // radar.n_tx
    # The longest distance whose error, measured against the exact sum, keeps the tolerance. Anchors
    # closer than two cycles would save nothing.
    for apart_s in APART_S:
        apart = min(round(apart_s / radar.cycle_duration_s), (n_cycles - 1) // (ANCHORS - 1))
        if apart < 2:
            break
        found = GhostIf(ghosts, radar, n_cycles, apart, order, len(groups[1]))
        error = _error(found, ghosts, radar)
        if error * 10 ** (_MARGIN_DB / 10) <= power_m2:
            apart_s = apart * radar.cycle_duration_s
            return found, said | {"anchors_apart_s": apart_s, "error_m2": error}
    return None, exact


def _error(found: GhostIf, ghosts: GhostEchoes, radar: Radar) -> float:
    """Mean power of the error [m^2] in some cycles beside the sum of all ghosts, chirp by chirp."""
    # In the middle between anchors, where a cubic is off by most.
    middles = (found.cycles[:-1] + found.cycles[1:]) // 2
    cycles = middles[np.unique(np.linspace(0, len(middles) - 1, _TESTS).astype(np.int64))]
    each = np.arange(radar.n_tx)
    chirps = (cycles[:, None] * radar.n_tx + each).ravel()
    times = radar.centres_of(chirps)
    # The approximation less the exact sum, cycle by cycle.
    error = -synthesize(ghosts(chirps), radar, times, dtype=np.complex64)
    for first in range(0, len(chirps), radar.n_tx):
        own = slice(first, first + radar.n_tx)
        found.add(error[own], chirps[own])
    return float((np.abs(error) ** 2).mean())


def _legendre_weights(echoes: Echoes, radar: Radar) -> NDArray[np.float64]:
    """Weights (3, node) of amplitudes at the nodes of echoes in Legendre's polynomials."""
    weights = weights_of_nodes(echoes.frequency, radar)
    return np.concatenate([weights, np.zeros((MOST_NODES - len(weights), weights.shape[1]))])


def _apart(echoes: NDArray[np.int64], length: NDArray[np.float64]) -> NDArray[np.int64]:
    """Order echoes so that neighbours have lengths far apart, and so far-away cells of the grid.

    A sum in a cell can then be read again without waiting until it has been written.
    """
    by_length = echoes[np.argsort(length[echoes])]
    step = max(1, -(-len(echoes) // _STREAMS))
    return np.concatenate([by_length[begin::step] for begin in range(step)])


def _cubic_weights(cycles: NDArray[np.int64], cycle: NDArray[np.int64]) -> NDArray[np.float64]:
    """Weights (chirp, 4) of values at ``cycles (chirp, 4)`` in the cubic through them."""
    weights = np.ones(cycles.shape)
    for one, other in permutations(range(ANCHORS), 2):
        weights[:, one] *= (cycle - cycles[:, other]) / (cycles[:, one] - cycles[:, other])
    return weights
