"""Groups of facets that are one echo each: by where they lie, or after several bounces by how long their paths are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar
from rtradar.scatter.ray_tubes.footprints import Footprints

Array = NDArray[np.float64]
_WIDTH_BINS = 4.0
"""Of a group of facets across the line of sight: seen from the ends of the array it stays within its half bin."""


class FacetGroups:
    """Groups of facets: half a range bin deep as the array's centre sees them, `_WIDTH_BINS` wide across the way to the piece.

    Parameters
    ----------
    middles : (facet, 3) float64
        [m].
    radar : Radar

    Attributes
    ----------
    centres : (group, 3) float64
        Mean of the middles in each [m].
    """

    def __init__(self, middles: Array, radar: Radar) -> None:
        self._origin, self._bin = np.array(radar.position_m), radar.range_bin_m
        way = (middles - self._origin).mean(axis=0)
        self._sides = np.linalg.svd(way[None])[2][1:]
        cells = self._cells(middles)
        self._least, self._count = cells.min(axis=0), np.ptp(cells, axis=0) + 1
        self._keys, own, counts = np.unique(
            self._key(cells), return_inverse=True, return_counts=True
        )
        sums = np.stack([np.bincount(own, weights=middles[:, axis]) for axis in range(3)], axis=-1)
        self.centres = sums / counts[:, None]

    def of(self, points: Array) -> NDArray[np.int64]:
        """Group of each of the middles, (point,)."""
        return np.searchsorted(self._keys, self._key(self._cells(points)))

    def _cells(self, points: Array) -> NDArray[np.int64]:
        # Axis by axis, so that a point is rounded alike in any company.
        x, y, z = (points[:, axis] - self._origin[axis] for axis in range(3))
        across = [
            (x * side[0] + y * side[1] + z * side[2]) / (_WIDTH_BINS * self._bin)
            for side in self._sides
        ]
        return np.floor(
            np.stack([np.sqrt(x * x + y * y + z * z) / (self._bin / 2), *across], axis=-1)
        ).astype(np.int64)

    def _key(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        deep, left, up = np.moveaxis(cells - self._least, -1, 0)
        return np.asarray((deep * self._count[1] + left) * self._count[2] + up)


class PathGroups:
    """Echoes of one number of bounces, by the length of their paths: half a range bin each.

    Parameters
    ----------
    places : (facet, 4, 3) float64
        Positions of the corners of the object's facets [m].
    radar : Radar
    order : int
        Bounces.

    Attributes
    ----------
    count : int
    """

    def __init__(self, places: Array, radar: Radar, order: int) -> None:
        low, high = places.min(axis=(0, 1)), places.max(axis=(0, 1))
        self._middle, self._step, self.order = (low + high) / 2, radar.range_bin_m, order
        self._origin = np.array(radar.position_m)
        # From face to face and back, no path is longer or shorter than that over the middle by more.
        self._half = int(np.ceil((order + 1) * np.linalg.norm(high - low) / self._step))
        self.count = 2 * self._half + 1
        self._weight, self._sum = np.zeros(self.count), np.zeros((self.count, 3))

    def of(self, footprints: Footprints, tx: Array) -> NDArray[np.int64]:
        """Which echo each footprint belongs to; also remembers where they are."""
        places = footprints.places[:, 3]
        path = footprints.path[:, 3] + np.linalg.norm(places - self._origin, axis=1)
        middle = np.linalg.norm(tx - self._middle) + np.linalg.norm(self._origin - self._middle)
        group = np.clip(
            np.rint((path - middle) / self._step).astype(np.int64) + self._half, 0, self.count - 1
        )
        power = _power(footprints)
        self._weight += np.bincount(group, weights=power, minlength=self.count)
        for axis in range(3):
            self._sum[:, axis] += np.bincount(
                group, weights=power * places[:, axis], minlength=self.count
            )
        return group

    def lengths(
        self, footprints: Footprints, group: NDArray[np.int64], tx: Array, rx: Array
    ) -> Array:
        """Mean path of each echo, (rx, echo) [m]."""
        power = _power(footprints)
        total = np.bincount(group, weights=power, minlength=self.count)
        over_middle = np.linalg.norm(tx - self._middle) + np.linalg.norm(rx - self._middle, axis=1)
        lengths = np.repeat(over_middle[:, None], self.count, axis=1)
        for receiver, antenna in enumerate(rx):
            path = footprints.path[:, 3] + np.linalg.norm(antenna - footprints.places[:, 3], axis=1)
            mean = np.bincount(group, weights=power * path, minlength=self.count) / np.where(
                total > 0, total, 1.0
            )
            lengths[receiver] = np.where(total > 0, mean, lengths[receiver])
        return lengths

    def centres(self) -> Array:
        """Mean place of the last bounce of each echo, (echo, 3) [m]."""
        known = self._weight[:, None] > 0
        return np.where(
            known, self._sum / np.where(known, self._weight[:, None], 1.0), self._middle
        )


def _power(footprints: Footprints) -> Array:
    return np.asarray((footprints.field**2).sum(axis=1) * footprints.width())
