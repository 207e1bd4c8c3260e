"""What a wall reflects and transmits: a few echoes, each with its delay and a smooth coefficient.

The wave goes to and fro between the faces of a slab. After ``p`` passes, each a factor q, it leaves
by the far face if p is odd and by the near one if p is even. These are the terms of a series whose
sum is the slab's coefficient. The phase of q is a delay, tens of radians over the sweep for a
brick: it goes into the length of an echo, and the rest into its amplitude. A term may hold the rest
of the series too. For a thin slab one term is enough, which holds the whole series and has no
delay.

**Fields** after reflections and passages are vectors: a wave carries its electric field as a
complex 3-vector, for exp(+j omega t), without the phase of its straight path through air. A wall
splits the field into TE and TM by the plane of incidence and multiplies each by the coefficient of
its slab, of finite extent by `wall_edges`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.front_end import Antenna
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import interpolation_weights, sweep_nodes
from rtradar.scatter.common.polarization import (
    POLARIZATIONS,
    Polarization,
    apply_te_tm,
    sent_field,
    unit,
)
from rtradar.scatter.multipath.image_paths import Leg
from rtradar.scatter.multipath.wall_edges import WallEdges
from rtradar.scene import Material, Wall, slab
from rtradar.scene.slab import reflection, slab_passes

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

MOST_TERMS = 12
"""Largest number of terms: each is at most r^2 of the one before, 0.6 at grazing incidence."""
DENSE_NODES = 33
"""Number of frequencies that stand for the whole sweep."""
_COSINES = np.linspace(0.2, 1.0, 9)
_FAINT = 1e-3
"""Coefficients below this need no accuracy, with the power that they have in an echo: -60 dB."""


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
        # The refracted path within the slab, times the index; a transmitted wave saves the air of
        # one passage.
        within = self.passes * thickness_m * np.sqrt(self.index_squared - 1 + cosine**2)
        return np.asarray(within - thickness_m * cosine if self.passes % 2 else within)

    def coefficient(
        self, wall: Wall, cosine: Array, frequency: Array, polarization: Literal["te", "tm"]
    ) -> Field:
        """Compute the factor (...) for the field, without the phase of `extra_m`.

        A transmitted field is relative to the field after the same path through air.
        """
        if self.solid:
            return reflection(wall.material.eta(frequency), cosine, polarization)
        # A whole slab has a closed form; else this many passes, and perhaps all later ones.
        arguments = wall.material.eta(frequency), wall.thickness_m, frequency, cosine, polarization
        if self.whole:
            factor = slab(*arguments)[self.passes % 2]
        else:
            factor = slab_passes(*arguments, self.passes, rest=self.rest)
        # The phase of the extra length is taken out. A transmitted wave is relative to air, whose
        # phase over the thickness is taken out as well.
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
    # Walls of one material and thickness have one series.
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
    # One set of nodes serves all walls.
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
    # Candidates are judged against the exact coefficient at many frequencies and angles.
    dense = sweep_nodes(radar, DENSE_NODES)
    index_squared = _index_squared(wall.material, radar)
    # The stronger polarisation at each angle.
    whole = _products(wall, (WHOLE[passes],), dense, power)
    scale = np.sqrt((np.abs(whole) ** 2).mean(axis=1)).max(axis=(0, 1))
    if not (scale > _FAINT).any():
        # Next to nothing is reflected or transmitted. Transmission has a delay all the same, and
        # counts as not followed.
        return ((WHOLE[0],) if passes == 0 else next(_delayed(1, index_squared))), 1, passes == 0
    scale = np.where(scale > _FAINT, scale, np.inf)

    def off(terms: tuple[Term, ...], exact: Field, count: int) -> float:
        """Error of the polynomial through so many nodes."""
        nodes = sweep_nodes(radar, count)
        weights = interpolation_weights(nodes, dense)
        known = np.einsum("fn,tnpc->tfpc", weights, _products(wall, terms, nodes, power))
        return float((np.abs(known - exact).sum(axis=0).max(axis=(0, 1)) / scale).max())

    # First the whole coefficient as one term, then series of more and more delayed terms: the first
    # that polynomials follow, or the best of all.
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
    # The group index is the slope of the phase over frequency.
    ends = radar.start_frequency_hz + np.array([0.0, radar.bandwidth_hz])
    phase = ends * np.sqrt(material.eta(ends)).real
    return max(float((phase[1] - phase[0]) / (ends[1] - ends[0])), 1.0) ** 2


# -- fields ----------------------------------------------------------------------------------------


Waves = list["Wave"]


def after_slab(
    wall: Wall, field: Field, directions: Array, frequency_hz: ArrayLike, term: Term
) -> Field:
    """Compute the field after reflection, or behind the wall, by one term of its slab.

    The incident field (node, ..., 3), or (..., 3) for all nodes, travels along the unit vectors
    ``directions (..., 3)``. The roughness s of the wall multiplies the reflected field by
    exp(-2 (k s cos)^2) (Ament, Proc. IRE 41 (1953) 142). Returned is the field (node, ..., 3),
    without the phase of its path and of the term's extra length: at the face that reflects, or
    behind the wall relative to the same path through air. A transmitted ray goes straight on: its
    small shift to the side is left out, its phase is not.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    ways, reflects = np.asarray(directions, dtype=np.float64), term.passes % 2 == 0
    # Direction after the face, and the coefficient of each node and angle, TE and TM apart.
    along = ways @ wall.normal
    leaving = ways - 2 * along[..., None] * wall.normal if reflects else ways
    cosine, each = np.minimum(np.abs(along), 1.0), frequency.reshape(-1, *[1] * along.ndim)
    te, tm = (term.coefficient(wall, cosine, each, kind) for kind in POLARIZATIONS)
    if reflects:
        rough = 2 * np.pi / SPEED_OF_LIGHT_MPS * each * wall.roughness_m * cosine
        te, tm = (np.exp(-2 * rough**2) * own for own in (te, tm))
    return apply_te_tm(field, ways, leaving, wall.normal, te, tm)


class Passage(NamedTuple):
    """The passes of a wave through the slab of a wall, at a corner or on a section of its leg."""

    wall: int
    section: int
    passes: int


Passages = tuple[Passage, ...]


class Wave(NamedTuple):
    """One of the terms that a wave has become.

    ``passages`` distinguish the terms; ``extra_m (...)`` is the length that they add [m]; ``field
    (node, ..., 3)`` complex is without the phase of both, and 0 where the wave went another way.
    """

    passages: Passages
    extra_m: Array
    field: Field


class Carried(NamedTuple):
    """A leg by its corners [m], what the extents of its faces leave, its directions and waves."""

    corners: list[Array]
    extent: Field
    ways: list[Array]
    waves: Waves


class WallResponse(NamedTuple):
    """The edges of all surfaces, the series of each, and the frequencies of the nodes [Hz]."""

    edges: WallEdges
    series: Sequence[WallSeries]
    frequency: Array

    @property
    def walls(self) -> Sequence[Wall]:
        """Walls of the room."""
        return self.edges.walls

    def start(self, field: Array | Field) -> Waves:
        """Return a wave at its antenna, of a field (..., 3) that is the same at all nodes."""
        nodes = np.broadcast_to(field, (len(self.frequency), *np.shape(field)))
        return [Wave((), np.zeros(np.shape(field)[:-1]), np.array(nodes, dtype=np.complex128))]

    def carried(
        self,
        leg: Leg,
        places: Array,
        points: Array,
        antenna: Antenna | None,
        polarization: Polarization,
    ) -> Carried:
        """Carry the field of an antenna at places (..., 3) over a leg to points (..., 3) [m]."""
        corners, extent = self.edges.leg(leg, places, points)
        ways = [unit(targets - origins) for origins, targets in pairwise(corners)]
        sent = sent_field(antenna, ways[0], polarization)
        return Carried(
            corners, extent, ways, self.along(leg, corners, ways, sent * extent[..., None])
        )

    def along(
        self, leg: Leg, corners: Sequence[Array], directions: Sequence[Array], field: Field
    ) -> Waves:
        """Follow a wave over a leg, whose faces reflect, from its field at the antenna (..., 3).

        The corners (..., 3) [m] are both ends of the leg and the places of reflection between them,
        the directions (..., 3) the unit vectors of the sections between corners.
        """
        waves = self.start(field)
        # Every section first reflects at the corner where it begins, then passes the walls on its
        # way.
        for section, (origins, targets) in enumerate(pairwise(corners)):
            if section:
                wall = self.edges.surfaces.index(leg[section - 1].wall)
                waves = self.reflected(wall, section, waves, directions[section - 1])
            waves = self.transmitted(section, waves, origins, targets)
        return waves

    def reflected(self, number: int, section: int, waves: Waves, directions: Array) -> Waves:
        """Reflect waves, which travel along ``directions (..., 3)``, before a section of a leg.

        Each becomes one wave for each term of the surface with this number.
        """
        wall = self.edges.surfaces[number]
        cosine = np.minimum(np.abs(directions @ wall.normal), 1.0)
        out = []
        # Each wave becomes as many as the wall has terms.
        for passages, extra, field in waves:
            for term in self.series[number].terms[0]:
                sent = after_slab(wall, field, directions, self.frequency, term)
                # What the face itself reflects comes without a delay.
                passage = (Passage(number, section, term.passes),) if term.passes else ()
                longer = extra + term.extra_m(wall.thickness_m, cosine)
                out.append(Wave((*passages, *passage), longer, sent))
        return out

    def transmitted(self, section: int, waves: Waves, origins: Array, targets: Array) -> Waves:
        """Send waves along a straight section of a leg, through all walls on the way.

        The ends of the section (..., 3) [m] broadcast to the shape of the waves; if one is on a
        face of a wall, the section does not cross that wall. The waves at the targets are without
        spreading and without the phase of the section's length, and 0 behind metal. What goes past
        the edges of a wall, or through its openings, goes on as it is.
        """
        # Only walls that some section crosses need a closer look.
        crossed = self.edges.crossed(origins, targets)
        origins, targets = np.broadcast_arrays(
            np.asarray(origins, dtype=np.float64), np.asarray(targets, dtype=np.float64)
        )
        for number in crossed:
            wall = self.walls[number]
            # The part of the wave that meets the wall is taken off what goes past, and comes back
            # by the terms of the slab.
            across, met = self.edges.passage(number, origins, targets)
            if not across.any():
                continue
            ways = targets[across] - origins[across]
            ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
            cosine = np.minimum(np.abs(ways @ wall.normal), 1.0)
            came, waves = waves, []
            for passages, extra, field in came:
                # Waves that do not cross the wall go on as they are.
                past, comes = field.copy(), field[:, across] * met[:, None]
                past[:, across] -= comes
                for term in self.series[number].terms[1]:
                    # A term without a delay joins what goes past in one wave; each delayed term is
                    # a wave of its own.
                    passed = past if term.whole else np.zeros_like(field)
                    passed[:, across] += after_slab(wall, comes, ways, self.frequency, term)
                    if not term.whole:
                        longer = extra.copy()
                        longer[across] += term.extra_m(wall.thickness_m, cosine)
                        passage = Passage(number, section, term.passes)
                        waves.append(Wave((*passages, passage), longer, passed))
                if past.any():
                    waves.append(Wave(passages, extra, past))
        return waves
