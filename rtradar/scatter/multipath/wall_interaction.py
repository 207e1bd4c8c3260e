"""What walls do to a wave: its field, as a vector, after reflections and passages.

A wave carries its electric field as a complex 3-vector, for exp(+j omega t), without the phase of
its straight path through air. A wall splits the field into TE and TM by the plane of incidence and
multiplies each by the coefficient of its slab, of finite extent by `wall_edges`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.front_end import Antenna
from rtradar.kernels.scatter.mirrors import SlabPass, slab_fields
from rtradar.scatter.common.polarization import Polarization, sent_field, unit
from rtradar.scatter.multipath.image_paths import Leg
from rtradar.scatter.multipath.slab_series import Term, WallSeries
from rtradar.scatter.multipath.wall_edges import WallEdges
from rtradar.scene import Wall

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Waves = list["Wave"]


def after_slab(
    wall: Wall, field: Field, directions: Array, frequency_hz: ArrayLike, term: Term
) -> Field:
    """Compute the field after reflection, or behind the wall, by one term of its slab.

    The incident field (node, ..., 3), or (..., 3) for all nodes, travels along the unit vectors
    ``directions (..., 3)``. The roughness s of the wall takes exp(-2 (k s cos)^2) off what is
    reflected (Ament, Proc. IRE 41 (1953) 142). Returned is the field (node, ..., 3), without the
    phase of its path and of the term's extra length: at the face that reflects, or behind the wall
    over that of the same way through air. A transmitted ray goes straight on: its small shift to
    the side is left out, its phase is not.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    slab = SlabPass(
        wall.normal,
        wall.material.eta(frequency),
        2 * np.pi * frequency / SPEED_OF_LIGHT_MPS,
        float(wall.thickness_m),
        float(wall.roughness_m),
        float(term.index_squared),
        term.passes,
        term.rest and not term.solid,
    )
    ways = np.ascontiguousarray(directions, dtype=np.float64)
    comes = np.broadcast_to(field, (len(frequency), *ways.shape)).astype(np.complex128, order="C")
    out = np.empty(comes.shape, dtype=np.complex128)
    each = len(frequency), -1, 3
    slab_fields(comes.reshape(each), ways.reshape(-1, 3), slab, out.reshape(each))
    return out


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
    """A leg by its corners [m], what the extents of its faces leave, directions, and the waves."""

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
    def walls(self) -> tuple[Wall, ...]:
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
        crossed = self.edges.crossed(origins, targets)
        origins, targets = np.broadcast_arrays(
            np.asarray(origins, dtype=np.float64), np.asarray(targets, dtype=np.float64)
        )
        for number in crossed:
            wall = self.walls[number]
            across, met = self.edges.passage(number, origins, targets)
            if not across.any():
                continue
            ways = targets[across] - origins[across]
            ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
            cosine = np.minimum(np.abs(ways @ wall.normal), 1.0)
            came, waves = waves, []
            for passages, extra, field in came:
                # Those that do not cross go on as they are.
                past, comes = field.copy(), field[:, across] * met[:, None]
                past[:, across] -= comes
                for term in self.series[number].terms[1]:
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
