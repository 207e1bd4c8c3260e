"""RDT point clouds: random triangle centres of the isosurface of a range-Doppler-time volume.

The detections of successive frames form a volume of zeros and ones. Its isosurface at level 0.5 is
triangulated by marching cubes, and the cloud is a random sample of the centres of the triangles
(paper, section 3.2 II). The volume is padded with one layer of empty cells, one hop before and
after it in time and one bin in range and velocity, so that the surface is closed where detections
reach the edge.

Marching cubes needs two neighbouring slices at a time, so the surface is made slab by slab as the
slices arrive. The triangles are those of the whole volume, in the same order, and the memory does
not grow with the length of the recording.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skimage.measure import marching_cubes

from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.system.checks import is_whole
from rtradar.system.seeds import check_seed, stream

_WITH_REPLACEMENT = 1  # selects a random stream apart from that of the keys


class UniformSample:
    """Reservoir sample: a uniform random subset of ``n_rows`` rows of a stream too long to keep.

    Each row gets a random key, and the rows with the smallest keys are kept, so that every subset
    is equally likely. All memory is allocated at the start. The same stream and seed give the same
    sample, however the stream is divided into calls of `add`; ``n_seen`` is the number of its rows.
    InputError if ``n_rows`` or ``seed`` is out of its range.
    """

    def __init__(self, n_rows: int, seed: int, columns: int = 3) -> None:
        if not is_whole(n_rows) or n_rows < 1:
            raise InputError(f"cloud: n_points = {n_rows!r}; it must be a whole number, at least 1")
        self._n_rows = int(n_rows)
        self._seed = check_seed("cloud: ", seed)
        self._random = np.random.default_rng(stream(self._seed))
        self._keys = np.full(self._n_rows, np.inf)  # infinite where no row is kept yet
        self._rows = np.full((self._n_rows, columns), np.nan)
        self.n_seen = 0

    def add(self, rows: NDArray[np.float64]) -> None:
        """Add the next rows (row, column) of the stream."""
        keys = np.concatenate([self._keys, self._random.random(len(rows))])
        # The smallest keys of those that are held and of the new ones together stay.
        least = np.argpartition(keys, self._n_rows - 1)[: self._n_rows]
        is_new = least >= self._n_rows
        # New rows take the places of those that go.
        free = np.ones(self._n_rows, dtype=bool)
        free[least[~is_new]] = False
        self._keys[free] = keys[least[is_new]]
        self._rows[free] = rows[least[is_new] - self._n_rows]
        self.n_seen += len(rows)

    def rows(self) -> NDArray[np.float64]:
        """Return the rows kept, at most ``n_rows``, in random order: any first k are a sample."""
        return np.asarray(self._rows[np.argsort(self._keys)[: self.n_seen]])

    def filled(self) -> NDArray[np.float64]:
        """Return exactly ``n_rows`` rows, drawn with replacement if too few were added."""
        rows = self.rows()
        if not 0 < len(rows) < self._n_rows:
            return rows
        random = np.random.default_rng(stream(self._seed, _WITH_REPLACEMENT))
        return rows[random.integers(len(rows), size=self._n_rows)]


@dataclass(frozen=True)
class RdtCloudResult:
    """RDT cloud of one recording.

    Parameters
    ----------
    points : (n, 3) float64
        Time [s], range [m] and velocity [m/s] of each point, in random order, so that the first k
        points are a random sample too. The array is empty if there are no triangles.
    n_triangles : int
        Number of triangles from which the points were drawn.
    n_voxels : int
        Number of detections in the volume.
    """

    points: NDArray[np.float64]
    n_triangles: int
    n_voxels: int


class RdtCloud:
    """Builder of an RDT cloud from the detections of one frame after another.

    Points are drawn without replacement if there are enough triangles, otherwise with it
    (`UniformSample`). The same slices and seed give the same cloud.

    Parameters
    ----------
    radar : Radar
        Radar that defines the range and velocity axes and the hop.
    n_points : int
        Number of points in the cloud.
    seed : int
        Seed of the random sample.

    Raises
    ------
    InputError
        If ``n_points`` or ``seed`` is out of its range.
    """

    def __init__(self, radar: Radar, n_points: int = 3000, seed: int = 0) -> None:
        self._radar = radar
        self._sample = UniformSample(n_points, seed)
        self._last: NDArray[np.bool_] | None = None
        self._last_time = -np.inf
        self._n_voxels = 0

    def push(self, mask: ArrayLike, time_s: float) -> None:
        """Add the detections of the next frame.

        Parameters
        ----------
        mask : (range, velocity) bool
            True where a cell is detected.
        time_s : float
            Centre of the frame [s], later than that of the last.

        Raises
        ------
        InputError
            If the mask is not a two-dimensional Boolean array of the shape of the last one, or if
            time does not advance.
        """
        # A copy, as the caller may reuse the array before the next slab.
        cells: NDArray[np.bool_] = np.array(mask)
        before = cells if self._last is None else self._last
        if (
            cells.ndim != 2
            or cells.dtype != np.bool_
            or 0 in cells.shape
            or cells.shape != before.shape
        ):
            others = "" if self._last is None else f", {before.shape} as those before it"
            raise InputError(
                f"RDT cloud: mask has shape {cells.shape}, type {cells.dtype}; "
                f"it must be (range, velocity) bool{others}"
            )
        if not (self._last_time < time_s < np.inf):
            later = "" if self._last is None else f", and later than {self._last_time} of the last"
            raise InputError(f"RDT cloud: time_s = {time_s}; it must be finite{later}")
        # The first slab lies between an empty slice, one hop before, and the first frame.
        if self._last is None:
            self._slab(np.zeros_like(cells), cells, time_s - self._radar.frame_hop_s, time_s)
        else:
            self._slab(self._last, cells, self._last_time, time_s)
        self._last, self._last_time = cells, float(time_s)
        self._n_voxels += int(np.count_nonzero(cells))

    def finish(self) -> RdtCloudResult:
        """Close the surface after the last frame and return the cloud."""
        if self._last is not None:
            end_s = self._last_time + self._radar.frame_hop_s
            self._slab(self._last, np.zeros_like(self._last), self._last_time, end_s)
            self._last = None
        return RdtCloudResult(self._sample.filled(), self._sample.n_seen, self._n_voxels)

    def _slab(
        self, first: NDArray[np.bool_], second: NDArray[np.bool_], start_s: float, end_s: float
    ) -> None:
        times = np.array([start_s, end_s])
        vertices, faces = _surface(np.stack([first, second]), times, self._radar)
        if len(faces):
            self._sample.add(vertices[faces].mean(axis=1))


def _surface(
    cells: NDArray[np.bool_], times: NDArray[np.float64], radar: Radar
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Isosurface of slices, closed in range and velocity but not in time, in physical units."""
    occupied: NDArray[np.bool_] = np.any(cells, axis=0)
    rows, columns = np.flatnonzero(occupied.any(axis=1)), np.flatnonzero(occupied.any(axis=0))
    if rows.size == 0:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    # Only cubes that touch a detection have triangles: march over the padded box of detections.
    box = cells[:, rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    padded = np.pad(box, ((0, 0), (1, 1), (1, 1))).astype(np.float32)
    # A surface at 0.5 between cells of 0 and 1 lies half-way between their centres.
    indices, faces, _, _ = marching_cubes(padded, 0.5)
    places = indices.astype(np.float64)
    # From indices to physical units: time between both slices, and range and velocity, less the
    # layer of padding.
    whole = np.floor(places[:, 0]).astype(np.int64)
    steps = np.append(np.diff(times), 0.0)
    time = times[whole] + (places[:, 0] - whole) * steps[whole]
    n_velocity = cells.shape[2]
    velocity_bin = radar.wavelength_m / (2 * n_velocity * radar.cycle_duration_s)
    distance = (places[:, 1] + (rows[0] - 1)) * radar.range_bin_m
    velocity = (places[:, 2] + (columns[0] - 1) - n_velocity // 2) * velocity_bin
    return np.stack([time, distance, velocity], axis=1), faces.astype(np.int64)
