"""Lengths and amplitudes of echoes over paths at every chirp, and the delays in slabs.

Walls count as perfect mirrors here: an echo is that of a conducting body alone before the images of
the antennas. What slabs do to the field is found at keyframes (`keyframes`); where it is a delay,
it belongs to the length of an echo, which then has one column for each combination of delays.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.scatter.nearby_points import Ellipsoids, Images, nearby_echoes
from rtradar.kernels.scatter.rooms import LegAntennas, PartPoints, SlabDelays, delayed_lengths
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayEnds
from rtradar.scatter.common.poses import ChirpPoses
from rtradar.scatter.multipath.image_paths import Leg, WallPath, images
from rtradar.scatter.multipath.slabs import Passage, Passages, WallResponse
from rtradar.system.threads import in_threads

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
ConductorEcho = Callable[[Geometry], tuple[Array, Array]]
"""Lengths and amplitudes (chirp, rx, part) of conductors before given antennas [m]."""

DelayingPassages = tuple[Passages, Passages]
"""Delaying passages through slabs on the way out, and on the way back seen from Rx."""

NO_DELAYS: DelayingPassages = ((), ())
"""No delays."""


class LegImages:
    """Images of antennas over the legs of paths.

    ``of_path (path, 2)`` are the legs out and back of each path, ``antennas`` the images over each
    of the Tx (place, 3) and of the Rx kept with each (place, rx, 3), world [m].
    """

    def __init__(self, paths: Sequence[WallPath], tx: Array, rx: Array, middle: Array) -> None:
        # Paths share legs: the images over each leg are computed once.
        legs = list(dict.fromkeys(leg for path in paths for leg in (path.out, path.back)))
        self.of_path = np.array([[legs.index(path.out), legs.index(path.back)] for path in paths])
        self.antennas = LegAntennas(
            np.array([images(leg, tx) for leg in legs]),
            np.array([images(leg, rx) for leg in legs]),
        )
        # The kernel takes receivers side by side.
        self._in_lanes = np.ascontiguousarray(np.swapaxes(self.antennas.rx, 2, 3))
        self._middle = np.array([images(leg, middle) for leg in legs])

    @classmethod
    def of(cls, radar: Radar, paths: Sequence[WallPath]) -> LegImages:
        """Return the images of the Tx of a radar that rests, and of its Rx."""
        ends = ArrayEnds.of(radar)
        middle = ends.rx_middle[ends.line_of_tx]
        return cls(paths, radar.tx, radar.rx[radar.rx_of_tx], middle)

    def echoes(
        self,
        path: Indices,
        part: Indices,
        poses: ChirpPoses,
        near: Array,
        formula: ConductorEcho | None,
    ) -> tuple[Array, Array]:
        """Compute lengths and amplitudes (chirp, rx, echo) of conductors over perfect mirrors [m].

        Each echo has its ``path (echo,)`` and its body part. ``near (chirp, echo, 3)`` are expected
        specular points, in the axes of the parts [m]; echoes that have 0 there return nothing. The
        echo model's ``formula``, if it has one, needs no specular points and computes all echoes.
        Amplitudes are without regard to polarisation.
        """
        shape = (*poses.rx.shape[:2], len(path))
        length, amplitude = np.empty(shape), np.empty(shape)
        (tx, rx), bodies = self.antennas, Ellipsoids(*poses[3:6])
        # Specular points are followed from where the keyframes expect them.
        if formula is None:
            legs = np.ascontiguousarray(self.of_path[path].T)
            antennas = Images(tx, self._in_lanes, self._middle, legs[0], legs[1], part)
            given = antennas, poses.tx_index, bodies, near, length, amplitude
            in_threads(nearby_echoes, len(length), *given)
            return length, amplitude
        # A formula takes all parts over a path at once, before the images of the antennas.
        for number in np.unique(path):
            own, (out, back) = path == number, self.of_path[number]
            parts = part[own]
            ellipsoids = bodies.centres[:, parts], bodies.frames[:, parts], bodies.semi_axes[parts]
            at = Geometry(tx[out, poses.tx_index], rx[back, poses.tx_index], *ellipsoids)
            length[..., own], amplitude[..., own] = formula(at)
        return length, amplitude


class EchoColumns:
    """The list of echoes of a room.

    First come all parts over each path without delays of slabs, then delayed ones as they are met.
    ``path`` and ``part (echo,)`` int64 are those of each echo, which is ``direct (echo,)`` if it
    comes without a reflection at a wall; ``echo`` lists the echo of each column, ``met`` what its
    wave has met.
    """

    def __init__(
        self, paths: Sequence[WallPath], n_parts: int, walls: WallResponse, legs: LegImages
    ) -> None:
        self._paths, self._walls, self._legs = paths, walls, legs
        self.path: Indices = np.repeat(np.arange(len(paths)), n_parts)
        self.part: Indices = np.tile(np.arange(n_parts), len(paths))
        self.echo = list(range(len(self.path)))
        self.met = [NO_DELAYS] * len(self.path)
        self._columns = {(echo, NO_DELAYS): echo for echo in self.echo}
        self._delays: SlabDelays | None = None
        self._settled = False
        self.direct = np.array([not paths[path].order for path in self.path.tolist()], dtype=bool)

    def __len__(self) -> int:
        return len(self.echo)

    @property
    def delayed(self) -> bool:
        """Whether slabs delay any of them."""
        return any(met != NO_DELAYS for met in self.met)

    def column(self, echo: int, met: DelayingPassages) -> int:
        """Return the column of an echo, a new one if it is the first; -1 if it was left out."""
        found = self._columns.get((echo, met), -1)
        if found < 0 and not self._settled:
            found = self._columns[echo, met] = len(self.echo)
            self.echo.append(echo)
            self.met.append(met)
            self._delays = None
        return found

    def keep(self, column: NDArray[np.bool_], echo: NDArray[np.bool_]) -> None:
        """Leave out all other columns for good, and all other echoes, which have no columns."""
        # Echoes and columns that stay are numbered anew.
        number = np.cumsum(echo) - 1
        chosen = np.flatnonzero(column)
        self.echo = [int(number[self.echo[i]]) for i in chosen]
        self.met = [self.met[i] for i in chosen]
        self._columns = {key: i for i, key in enumerate(zip(self.echo, self.met, strict=True))}
        self.path, self.part, self.direct = self.path[echo], self.part[echo], self.direct[echo]
        self._delays, self._settled = None, True

    def not_followed(self) -> list[frozenset[str]]:
        """Names of the walls, for each column, that neither terms nor nodes follow."""
        walls, series = self._walls.walls, self._walls.series
        return [
            frozenset(
                walls[one.wall].name
                for passages in met
                for one in passages
                if not series[one.wall].held[one.passes % 2]
            )
            for met in self.met
        ]

    def lengths(self, legs: LegImages, at: ChirpPoses, points: Array, length: Array) -> Array:
        """Compute the lengths (chirp, rx, column) of all columns [m].

        They are ``length (chirp, rx, echo)`` and the delays of slabs. ``legs`` are the images of
        the antennas of ``at``. The points towards which echoes leave the body (chirp, echo, 3) are
        in the axes of their part [m].
        """
        # The table of delays is made again whenever columns were added or left out.
        if self._delays is None:
            self._delays = self._list_delays()
        out = np.empty((*length.shape[:2], len(self)))
        where = PartPoints(points, self.part)
        bodies = Ellipsoids(at.centres, at.frames, at.semi_axes)
        given = legs.antennas, at.tx_index, where, bodies, self._delays, length, out
        in_threads(delayed_lengths, len(out), *given)
        return out

    def _list_delays(self) -> SlabDelays:
        legs = np.zeros((len(self), 2, 3), dtype=np.int64)
        passes, slabs = list[int](), list[Array]()
        # For each column the passages on both of its legs, one after the other.
        for number, (echo, met) in enumerate(zip(self.echo, self.met, strict=True)):
            path = self._paths[self.path[echo]]
            for side, leg in enumerate((path.out, path.back)):
                first = len(passes)
                for one in met[side]:
                    wall = self._walls.walls[one.wall]
                    terms = self._walls.series[one.wall].terms[one.passes % 2]
                    passes.append(one.passes)
                    normal = _seen_from_the_end(wall.normal, leg, one)
                    slabs.append(np.array([*normal, wall.thickness_m, terms[-1].index_squared]))
                own = self._legs.of_path[self.path[echo], side]
                legs[number, side] = own, first, len(passes)
        echoes, table = np.array(self.echo), np.array(slabs, dtype=np.float64).reshape(-1, 5)
        return SlabDelays(echoes, legs, np.array(passes, dtype=np.int64), table)


def _seen_from_the_end(normal: Array, leg: Leg, one: Passage) -> Array:
    """Normal of a slab, mirrored by the faces after it: its angle with the last section counts."""
    for face in leg[one.section :]:
        normal = normal - 2 * (normal @ face.wall.normal) * face.wall.normal
    return normal
