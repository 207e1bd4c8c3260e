"""What a wall reflects and lets through as a few echoes, each of a delay of its own and of a coefficient that changes slowly.

The wave goes to and fro between the faces of a slab. After ``p`` passes of it, each a factor q, it has left by the far face
where p is odd and by the near one where p is even: terms of the series whose sum is the slab's coefficient. The phase of q is
a delay, tens of radians over the sweep for a brick: it belongs to the length of an echo, and what is left to the amplitude.
A term may hold the rest of the series as well. Of a thin slab, one term that holds all of it and takes no delay serves.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.common.nodes import interpolation_weights, sweep_nodes
from rtradar.scene import Material, Wall, slab
from rtradar.scene.slab import Polarization, slab_passes

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

MOST_TERMS = 12
"""More are not looked for: each is at most r^2 of the one before, 0.6 at grazing incidence."""
_DENSE_NODES = 33
_COSINES = np.linspace(0.2, 1.0, 9)
_POLARIZATIONS: tuple[Polarization, ...] = ("te", "tm")
_FAINT = 1e-3
"""A coefficient, with its power in the echo, that is smaller needs no accuracy of its own: 60 dB are lost there."""


@dataclass(frozen=True)
class Term:
    """A part of what a slab does to a wave.

    Parameters
    ----------
    passes : int
        Through the slab: odd ones are transmitted, even ones reflected.
    rest : bool
        Whether all later terms are in it.
    index_squared : float
        Squared index of refraction for the delay that is taken out; 0 where none is.
    """

    passes: int
    rest: bool
    index_squared: float = 0.0

    @property
    def whole(self) -> bool:
        """Whether it is the slab's coefficient as it stands."""
        return self.rest and self.passes < 2 and not self.index_squared

    def extra_m(self, thickness_m: float, cosine: Array) -> Array:
        """Length of path that it adds to the straight way through air or to the face [m], at cosines of incidence.

        Equation :eq:`slab-delay` of the theory page.
        """
        if not self.index_squared:
            return np.zeros_like(cosine)
        inside = self.passes * thickness_m * np.sqrt(self.index_squared - 1 + cosine**2)
        return np.asarray(inside - thickness_m * cosine if self.passes % 2 else inside)

    def coefficient(
        self, wall: Wall, cosine: Array, frequency: Array, polarization: Polarization
    ) -> Field:
        """Its factor (...) for the field, without the phase of `extra_m`; of transmission, in place of as much air."""
        eta = wall.material.eta(frequency)
        if self.whole:
            factor = slab(eta, wall.thickness_m, frequency, cosine, polarization)[self.passes % 2]
        else:
            factor = slab_passes(
                eta, wall.thickness_m, frequency, cosine, polarization, self.passes, rest=self.rest
            )
        extra = self.extra_m(wall.thickness_m, cosine)
        if self.passes % 2:
            extra = extra + wall.thickness_m * cosine
        return (
            np.asarray(factor * np.exp(2j * np.pi * frequency / SPEED_OF_LIGHT_MPS * extra))
            if extra.any()
            else factor
        )


WHOLE = (Term(0, rest=True), Term(1, rest=True))
"""Reflection and transmission, each as one term."""


class WallSeries(NamedTuple):
    """Terms of one wall, and whether polynomials through the nodes follow them: reflection first, then transmission."""

    terms: tuple[tuple[Term, ...], tuple[Term, ...]]
    held: tuple[bool, bool]


class RoomSeries(NamedTuple):
    """Of all walls of a room, and the frequencies of the nodes (node,) [Hz]."""

    walls: tuple[WallSeries, ...]
    frequency: Array


def room_series(
    walls: Sequence[Wall], radar: Radar, *, most_nodes: int, enough: float, bounces: int
) -> RoomSeries:
    """The fewest terms of each wall, and then the fewest Chebyshev nodes, by which all coefficients are known.

    Parameters
    ----------
    walls : sequence of Wall
    radar : Radar
    most_nodes : int
        Largest number of nodes of the polynomial over the sweep.
    enough : float
        What the polynomial may be off by, of the rms of the coefficient over the sweep: of the stronger of both polarisations.
    bounces : int
        Reflections by walls on a path, of whose product this is asked, and at most 2. A wall is always passed on both ways.

    Returns
    -------
    RoomSeries
    """
    chosen: list[WallSeries] = []
    nodes = 1
    known: dict[tuple[Material, float], tuple[WallSeries, int]] = {}
    for wall in walls:
        key = wall.material, wall.thickness_m
        if key not in known:
            powers = min(max(bounces, 1), 2), 2
            (back, first, one), (on, second, other) = (
                _fewest(wall, radar, passes, power, most_nodes, enough)
                for passes, power in enumerate(powers)
            )
            known[key] = WallSeries((back, on), (one, other)), max(first, second)
        chosen.append(known[key][0])
        nodes = max(nodes, known[key][1])
    return RoomSeries(tuple(chosen), sweep_nodes(radar, nodes))


def whole_walls(walls: Sequence[Wall]) -> tuple[WallSeries, ...]:
    """Every coefficient as one term without a delay of its own."""
    return tuple(WallSeries(((WHOLE[0],), (WHOLE[1],)), (True, True)) for _ in walls)


def _fewest(
    wall: Wall, radar: Radar, passes: int, power: int, most_nodes: int, enough: float
) -> tuple[tuple[Term, ...], int, bool]:
    """Terms, how many nodes they need, and whether they hold with ``most_nodes``."""
    if wall.material.conducts:
        return (WHOLE[passes],), 1, True
    dense = sweep_nodes(radar, _DENSE_NODES)
    index_squared = _index_squared(wall.material, radar)
    # Of both polarisations the stronger one, at each angle.
    whole = _products(wall, (WHOLE[passes],), dense, power)
    scale = np.sqrt((np.abs(whole) ** 2).mean(axis=1)).max(axis=(0, 1))
    if not (scale > _FAINT).any():
        # Next to nothing comes back or through: what does is delayed, but not known well.
        return ((WHOLE[0],) if passes == 0 else next(_moved(1, index_squared))), 1, passes == 0
    scale = np.where(scale > _FAINT, scale, np.inf)
    least = math.inf
    best: tuple[Term, ...] = (WHOLE[passes],)
    for terms in _forms(passes, index_squared):
        exact = _products(wall, terms, dense, power)

        def off(count: int, terms: tuple[Term, ...] = terms, exact: Field = exact) -> float:
            nodes = sweep_nodes(radar, count)
            known = np.einsum(
                "fn,tnpc->tfpc",
                interpolation_weights(nodes, dense),
                _products(wall, terms, nodes, power),
            )
            return float((np.abs(known - exact).sum(axis=0).max(axis=(0, 1)) / scale).max())

        worst = off(most_nodes)
        if worst < enough:
            return (
                terms,
                next((count for count in range(1, most_nodes) if off(count) < enough), most_nodes),
                True,
            )
        if worst < least:
            least, best = worst, terms
    return best, most_nodes, False


def _forms(passes: int, index_squared: float) -> Iterator[tuple[Term, ...]]:
    """The whole slab, and its series with one term more each time; the last term holds what follows."""
    yield (WHOLE[passes],)
    yield from _moved(passes, index_squared)


def _moved(passes: int, index_squared: float) -> Iterator[tuple[Term, ...]]:
    for count in range(1 if passes else 2, MOST_TERMS + 1):
        yield tuple(
            Term(passes + 2 * i, rest=i == count - 1, index_squared=index_squared)
            for i in range(count)
        )


def _products(wall: Wall, terms: Sequence[Term], frequency: Array, power: int) -> Field:
    """Coefficients of all terms, or of all pairs of them, (term or pair, node, polarization, cosine)."""
    each = np.array(
        [
            [term.coefficient(wall, _COSINES, frequency[:, None], kind) for kind in _POLARIZATIONS]
            for term in terms
        ]
    ).swapaxes(1, 2)
    return each if power == 1 else (each[:, None] * each[None]).reshape(-1, *each.shape[1:])


def _index_squared(material: Material, radar: Radar) -> float:
    """Square of the index by which the sweep as a whole is delayed, straight on: that of the group."""
    ends = radar.start_frequency_hz + np.array([0.0, radar.bandwidth_hz])
    phase = ends * np.sqrt(material.eta(ends)).real
    return max(float((phase[1] - phase[0]) / (ends[1] - ends[0])), 1.0) ** 2
