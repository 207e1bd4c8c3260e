"""What a wall reflects and transmits: a few echoes, each with its delay and a smooth coefficient.

The wave goes to and fro between the faces of a slab. After ``p`` passes, each a factor q, it has
left by the far face if p is odd and by the near one if p is even: the terms of a series whose sum
is the slab's coefficient. The phase of q is a delay, tens of radians over the sweep for a brick: it
goes into the length of an echo, and the rest into its amplitude. A term may hold the rest of the
series too. For a thin slab one term serves, which holds all of the series and has no delay.
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
from rtradar.scatter.common.interpolation import interpolation_weights, sweep_nodes
from rtradar.scene import Material, Wall, slab
from rtradar.scene.slab import Polarization, reflection, slab_passes

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

POLARIZATIONS: tuple[Polarization, ...] = ("te", "tm")
MOST_TERMS = 12
"""Largest number of terms: each is at most r^2 of the one before, 0.6 at grazing incidence."""
DENSE_NODES = 33
"""Number of frequencies that stand for the whole sweep."""
_COSINES = np.linspace(0.2, 1.0, 9)
_FAINT = 1e-3
"""Smaller coefficients, with their power in the echo, need no accuracy: they are 60 dB down."""


@dataclass(frozen=True)
class Term:
    """A part of what a slab does to a wave.

    ``passes`` through the slab are odd for transmission, even for reflection; ``rest`` says whether
    the term holds all later terms too. ``index_squared`` is the squared index of refraction for the
    delay that is taken out; 0 for none. A ``solid`` has no far face.
    """

    passes: int
    rest: bool
    index_squared: float = 0.0
    solid: bool = False

    @property
    def whole(self) -> bool:
        """Whether the term is the coefficient of the whole slab."""
        return self.rest and self.passes < 2 and not self.index_squared

    def extra_m(self, thickness_m: float, cosine: Array) -> Array:
        """Length that the term adds to the way through air or to the face, by incidence [m].

        Equation :eq:`slab-delay` of the theory page.
        """
        if not self.index_squared:
            return np.zeros_like(cosine)
        within = self.passes * thickness_m * np.sqrt(self.index_squared - 1 + cosine**2)
        return np.asarray(within - thickness_m * cosine if self.passes % 2 else within)

    def coefficient(
        self, wall: Wall, cosine: Array, frequency: Array, polarization: Polarization
    ) -> Field:
        """Compute the factor (...) for the field, without the phase of `extra_m`.

        A transmitted field is relative to that after the same way through air.
        """
        if self.solid:
            return reflection(wall.material.eta(frequency), cosine, polarization)
        arguments = wall.material.eta(frequency), wall.thickness_m, frequency, cosine, polarization
        if self.whole:
            factor = slab(*arguments)[self.passes % 2]
        else:
            factor = slab_passes(*arguments, self.passes, rest=self.rest)
        extra = self.extra_m(wall.thickness_m, cosine)
        if self.passes % 2:
            extra = extra + wall.thickness_m * cosine
        if not extra.any():
            return factor
        return np.asarray(factor * np.exp(2j * np.pi * frequency / SPEED_OF_LIGHT_MPS * extra))


WHOLE = (Term(0, rest=True), Term(1, rest=True))
"""Reflection and transmission, each as one term."""


class WallSeries(NamedTuple):
    """Terms of a wall, and whether polynomials follow them: reflection, then transmission."""

    terms: tuple[tuple[Term, ...], tuple[Term, ...]]
    held: tuple[bool, bool]


HALF_SPACE = WallSeries(((Term(0, rest=True, solid=True),), ()), (True, True))
"""The surface of a solid, through which nothing passes."""


class RoomSeries(NamedTuple):
    """Series of all walls of a room, and the frequencies of the nodes (node,) [Hz]."""

    walls: tuple[WallSeries, ...]
    frequency: Array


def room_series(
    walls: Sequence[Wall], radar: Radar, *, most_nodes: int, enough: float, bounces: int
) -> RoomSeries:
    """Find the fewest terms of each wall, and the fewest nodes that follow their coefficients.

    There are at most ``most_nodes`` Chebyshev nodes of the polynomial over the radar's sweep. Its
    error may be ``enough`` of the rms of the coefficient over the sweep, for the stronger of both
    polarisations, and for the product of as many coefficients as there are reflections,
    ``bounces``, on a path; at most 2 count. A wall is always transmitted through both ways.
    """
    powers = min(max(bounces, 1), 2), 2
    known: dict[tuple[Material, float], tuple[WallSeries, int]] = {}
    for wall in walls:
        key = wall.material, wall.thickness_m
        if key not in known:
            (back, first, one), (on, second, other) = (
                _fewest(wall, radar, passes, power, most_nodes, enough)
                for passes, power in enumerate(powers)
            )
            known[key] = WallSeries((back, on), (one, other)), max(first, second)
    chosen = tuple(known[wall.material, wall.thickness_m][0] for wall in walls)
    nodes = max((nodes for _, nodes in known.values()), default=1)
    return RoomSeries(chosen, sweep_nodes(radar, nodes))


def whole_walls(walls: Sequence[Wall]) -> tuple[WallSeries, ...]:
    """Return every coefficient as one term without a delay."""
    return (WallSeries(((WHOLE[0],), (WHOLE[1],)), (True, True)),) * len(walls)


def _fewest(
    wall: Wall, radar: Radar, passes: int, power: int, most_nodes: int, enough: float
) -> tuple[tuple[Term, ...], int, bool]:
    """Terms, how many nodes they need, and whether ``most_nodes`` are enough for them."""
    if wall.material.conducts:
        return (WHOLE[passes],), 1, True
    dense = sweep_nodes(radar, DENSE_NODES)
    index_squared = _index_squared(wall.material, radar)
    # The stronger polarisation at each angle.
    whole = _products(wall, (WHOLE[passes],), dense, power)
    scale = np.sqrt((np.abs(whole) ** 2).mean(axis=1)).max(axis=(0, 1))
    if not (scale > _FAINT).any():
        # Next to nothing is reflected or transmitted: that is delayed, but not known well.
        return ((WHOLE[0],) if passes == 0 else next(_delayed(1, index_squared))), 1, passes == 0
    scale = np.where(scale > _FAINT, scale, np.inf)

    def off(terms: tuple[Term, ...], exact: Field, count: int) -> float:
        """Error of the polynomial through so many nodes."""
        nodes = sweep_nodes(radar, count)
        weights = interpolation_weights(nodes, dense)
        known = np.einsum("fn,tnpc->tfpc", weights, _products(wall, terms, nodes, power))
        return float((np.abs(known - exact).sum(axis=0).max(axis=(0, 1)) / scale).max())

    least = math.inf
    best: tuple[Term, ...] = (WHOLE[passes],)
    for terms in ((WHOLE[passes],), *_delayed(passes, index_squared)):
        exact = _products(wall, terms, dense, power)
        worst = off(terms, exact, most_nodes)
        if worst < enough:
            fewer = (count for count in range(1, most_nodes) if off(terms, exact, count) < enough)
            return terms, next(fewer, most_nodes), True
        if worst < least:
            least, best = worst, terms
    return best, most_nodes, False


def _delayed(passes: int, index_squared: float) -> Iterator[tuple[Term, ...]]:
    """The series of a slab, with one term more each time; the last term holds the rest."""
    for count in range(1 if passes else 2, MOST_TERMS + 1):
        yield tuple(Term(passes + 2 * i, i == count - 1, index_squared) for i in range(count))


def _products(wall: Wall, terms: Sequence[Term], frequency: Array, power: int) -> Field:
    """Coefficients of all terms, or pairs of them, (term or pair, node, polarization, cosine)."""
    each = np.array(
        [
            [term.coefficient(wall, _COSINES, frequency[:, None], kind) for kind in POLARIZATIONS]
            for term in terms
        ]
    ).swapaxes(1, 2)
    return each if power == 1 else (each[:, None] * each[None]).reshape(-1, *each.shape[1:])


def _index_squared(material: Material, radar: Radar) -> float:
    """Square of the group index, by which the sweep as a whole is delayed at normal incidence."""
    ends = radar.start_frequency_hz + np.array([0.0, radar.bandwidth_hz])
    phase = ends * np.sqrt(material.eta(ends)).real
    return max(float((phase[1] - phase[0]) / (ends[1] - ends[0])), 1.0) ** 2
