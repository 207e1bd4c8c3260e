"""Echoes over paths, each as often as the slabs on its way ask for, and how much farther each of these goes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import prange
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined
from rtradar.radar import Radar
from rtradar.scatter.common.poses import ChirpPoses
from rtradar.scatter.multipath.image_paths import Leg, WallPath, images
from rtradar.scatter.multipath.slab_series import WallSeries
from rtradar.scatter.multipath.wall_interaction import Passage
from rtradar.scene import Scene

Array = NDArray[np.float64]
Met = tuple[tuple[Passage, ...], tuple[Passage, ...]]
"""Passages through slabs on the way out, and on the way back as told from Rx."""

AT_ONCE: Met = ((), ())
"""Of an echo that no slab delays."""


class PathTerms:
    """Columns of the echoes that leave: first each path and part without delays of slabs, then others as they are met.

    Parameters
    ----------
    radar : Radar
    scene : Scene
    series : sequence of WallSeries
        Slab series of the room's walls.
    paths : sequence of WallPath
    path : (echo,) int64
        Path of each echo.

    Attributes
    ----------
    echo : list of int
        Echo of each column.
    met : list of Met
        What its wave has met.
    """

    def __init__(
        self,
        radar: Radar,
        scene: Scene,
        series: Sequence[WallSeries],
        paths: Sequence[WallPath],
        path: NDArray[np.int64],
    ) -> None:
        self._radar, self._scene, self._series, self._paths = radar, scene, series, paths
        self._path = path
        self.echo = list(range(len(path)))
        self.met = [AT_ONCE] * len(path)
        self._columns: dict[tuple[int, Met], int] = {(echo, AT_ONCE): echo for echo in self.echo}
        legs = list(dict.fromkeys(leg for one in paths for leg in (one.out, one.back)))
        self._legs = {leg: number for number, leg in enumerate(legs)}
        self._tx = np.array([images(leg, radar.tx) for leg in legs])
        self._rx = np.array([images(leg, radar.rx[radar.rx_of_tx]) for leg in legs])
        self._lists: tuple[NDArray[np.int64], NDArray[np.int64], Array] | None = None
        self._settled = False

    def __len__(self) -> int:
        return len(self.echo)

    @property
    def delayed(self) -> bool:
        """Whether slabs delay any of them."""
        return any(met != AT_ONCE for met in self.met)

    def column(self, echo: int, met: Met) -> int:
        """Column of an echo that has met this, a new one at the end where it is the first; -1 where it was left out."""
        found = self._columns.get((echo, met), -1)
        if found < 0 and not self._settled:
            found = self._columns[echo, met] = len(self.echo)
            self.echo.append(echo)
            self.met.append(met)
            self._lists = None
        return found

    def keep(self, column: NDArray[np.bool_], echo: NDArray[np.bool_]) -> None:
        """Leave out all other columns for good, and all other echoes, of which no column may be left."""
        number = np.cumsum(echo) - 1
        chosen = np.flatnonzero(column)
        self.echo, self.met = (
            [int(number[self.echo[i]]) for i in chosen],
            [self.met[i] for i in chosen],
        )
        self._columns = {
            key: place for place, key in enumerate(zip(self.echo, self.met, strict=True))
        }
        self._path = self._path[echo]
        self._lists, self._settled = None, True

    def not_followed(self) -> list[frozenset[str]]:
        """Walls that each column met and that neither terms nor nodes follow over the sweep."""
        return [
            frozenset(
                self._scene.walls[one.wall].name
                for way in met
                for one in way
                if not self._series[one.wall].held[one.passes % 2]
            )
            for met in self.met
        ]

    def lengths(
        self, at: ChirpPoses, places: Array, part: NDArray[np.int64], length: Array
    ) -> Array:
        """Lengths of all columns.

        Parameters
        ----------
        at : ChirpPoses
        places : (chirp, echo, 3) float64
            Where the echoes leave the body, in the axes of their part [m]; on a chord or on the ellipsoid.
        part : (echo,) int64
            Part of each echo.
        length : (chirp, rx, echo) float64
            Without the delays of slabs [m].

        Returns
        -------
        (chirp, rx, column) float64
            [m].
        """
        if self._lists is None:
            self._lists = self._listed()
        column, wall_of, passage = self._lists
        out = np.empty((*length.shape[:2], len(self)))
        echo = np.array(self.echo)
        body = at.centres, at.frames, at.semi_axes, part
        _longer(
            self._tx,
            self._rx,
            at.tx_index,
            places,
            *body,
            length,
            echo,
            column,
            wall_of,
            passage,
            out,
        )
        return out

    def _listed(self) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
        """For each column its two legs and where their passages begin and end; passes, and what they depend on."""
        column, passes, passage = (
            np.zeros((len(self), 2, 3), dtype=np.int64),
            list[int](),
            list[Array](),
        )
        for number, (echo, met) in enumerate(zip(self.echo, self.met, strict=True)):
            path = self._paths[self._path[echo]]
            for side, leg in enumerate((path.out, path.back)):
                column[number, side] = self._legs[leg], len(passes), len(passes) + len(met[side])
                for one in met[side]:
                    wall = self._scene.walls[one.wall]
                    index_squared = self._series[one.wall].terms[one.passes % 2][-1].index_squared
                    passes.append(one.passes)
                    passage.append(
                        np.array(
                            [
                                *_seen_from_the_end(self._scene, leg, one),
                                wall.thickness_m,
                                index_squared,
                            ]
                        )
                    )
        return (
            column,
            np.array(passes, dtype=np.int64),
            np.array(passage, dtype=np.float64).reshape(-1, 5),
        )


def _seen_from_the_end(scene: Scene, leg: Leg, one: Passage) -> Array:
    """Normal of the slab, mirrored as what comes after it: its angle with the last piece is that of incidence."""
    normal = scene.walls[one.wall].normal
    for face in leg[one.piece :]:
        normal = normal - 2 * (normal @ face.wall.normal) * face.wall.normal
    return normal


@inlined()
def _delay(antenna, place, first, last, passes, passage):
    """What the passages on a leg add to it."""
    x, y, z = place[0] - antenna[0], place[1] - antenna[1], place[2] - antenna[2]
    inverse = 1 / math.sqrt(x * x + y * y + z * z)
    total = 0.0
    for one in range(first, last):
        own = passage[one]
        cosine = min(abs(x * own[0] + y * own[1] + z * own[2]) * inverse, 1.0)
        total += own[3] * passes[one] * math.sqrt(own[4] - 1 + cosine * cosine)
        if passes[one] % 2:
            total -= own[3] * cosine
    return total


@inlined()
def _on_surface(local, axes, centre, frame, out):
    """Where the ray from a part's centre through a point in its axes leaves the ellipsoid; ``out`` in the world."""
    x, y, z = local
    size = math.sqrt((x / axes[0]) ** 2 + (y / axes[1]) ** 2 + (z / axes[2]) ** 2)
    # Where an echo has no specular point, any place will do.
    scale = 1 / size if size > 0 else 0.0
    for row in range(3):
        out[row] = centre[row] + scale * (frame[row, 0] * x + frame[row, 1] * y + frame[row, 2] * z)


@compiled(parallel=True)
def _longer(
    tx,
    rx,
    tx_index,
    local,
    centres,
    frames,
    semi_axes,
    part,
    length,
    echo,
    column,
    passes,
    passage,
    out,
):
    """Fill ``out (chirp, rx, column)``; ``column (column, 2, 3)``: leg, first passage and the one after the last, each way."""
    chirps, receivers, columns = out.shape
    for chirp in prange(chirps):
        transmitter = tx_index[chirp]
        places = np.empty((len(part), 3))
        for one in range(len(part)):
            own = part[one]
            _on_surface(
                local[chirp, one],
                semi_axes[own],
                centres[chirp, own],
                frames[chirp, own],
                places[one],
            )
        for number in range(columns):
            place = places[echo[number]]
            leg, first, last = column[number, 0, 0], column[number, 0, 1], column[number, 0, 2]
            more = (
                _delay(tx[leg, transmitter], place, first, last, passes, passage)
                if last > first
                else 0.0
            )
            leg, first, last = column[number, 1, 0], column[number, 1, 1], column[number, 1, 2]
            for receiver in range(receivers):
                whole = length[chirp, receiver, echo[number]] + more
                if last > first:
                    whole += _delay(
                        rx[leg, transmitter, receiver], place, first, last, passes, passage
                    )
                out[chirp, receiver, number] = whole
