"""Range-Doppler-time (RDT) volume to point cloud: isosurface, triangle centres, a random sample of them.

The detections of the successive windows stacked are a volume of zeros and ones; its surface at level 0.5 is triangulated by
marching cubes and the cloud is drawn from the centres of the triangles (paper, section 3.2 II). One layer of empty cells
is put round the volume, one hop before and after it in time and one bin in range and velocity, so the surface is closed
where detections reach the edge.

A cube of the marching knows two neighbouring slices alone, so the surface is made slab by slab as the slices come, and the
triangles are those of the whole volume, in the same order. Memory does not grow with the recording.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from skimage.measure import marching_cubes

from rtradar.clouds.sampling import UniformSample
from rtradar.errors import InputError
from rtradar.radar import Radar


@dataclass(frozen=True)
class RdtCloudResult:
    """The cloud of one recording.

    Parameters
    ----------
    points : (n, 3) float64
        Time [s], range [m], velocity [m/s]; in random order, so that any first part is a sample too. Empty where there are
        no triangles.
    n_triangles : int
        Triangles that the points were drawn from.
    n_voxels : int
        Detections in the volume.
    """

    points: NDArray[np.float64]
    n_triangles: int
    n_voxels: int


class RdtCloud:
    """Builds the cloud from the detections of one window after the other.

    Points are drawn without replacement where there are enough triangles, else with. Every triangle gets a random key and
    those with the least keys stay, so each subset is equally likely however many are still to come. The same
    slices and seed give the same cloud.

    Parameters
    ----------
    radar : Radar
        Gives the axes.
    n_points : int
        Points in the cloud.
    seed : int
        Of the sampling.

    Raises
    ------
    InputError
        Where ``n_points`` or ``seed`` is out of its range.
    """

    def __init__(self, radar: Radar, n_points: int = 3000, seed: int = 0) -> None:
        self._radar = radar
        self._sample = UniformSample(n_points, seed)
        self._last: NDArray[np.bool_] | None = None
        self._last_time = 0.0
        self._n_voxels = 0

    def push(self, mask: ArrayLike, time_s: float) -> None:
        """Add the detections of the next window.

        Parameters
        ----------
        mask : (range, velocity) bool
            True where a cell is detected.
        time_s : float
            Centre of the window [s], later than that of the last.

        Raises
        ------
        InputError
            Where the mask is no two-dimensional array of booleans or not of the shape of the last, or time does not advance.
        """
        cells = np.array(
            mask
        )  # a copy: the slab to come needs it after the caller may have reused the array
        if cells.ndim != 2 or cells.dtype != np.bool_ or 0 in cells.shape:
            raise InputError(
                f"RDT cloud: mask has shape {cells.shape}, type {cells.dtype}; it must be (range, velocity) bool"
            )
        if not np.isfinite(time_s):
            raise InputError(f"RDT cloud: time_s = {time_s!r}; it must be finite")
        if self._last is None:
            self._slab(np.zeros_like(cells), cells, time_s - self._radar.frame_hop_s, time_s)
        elif cells.shape != self._last.shape:
            raise InputError(
                f"RDT cloud: mask has shape {cells.shape}; those before it have {self._last.shape}"
            )
        elif time_s <= self._last_time:
            raise InputError(
                f"RDT cloud: time_s = {time_s}; it must be later than that of the last mask, {self._last_time}"
            )
        else:
            self._slab(self._last, cells, self._last_time, time_s)
        self._last, self._last_time = cells, float(time_s)
        self._n_voxels += int(np.count_nonzero(cells))

    def finish(self) -> RdtCloudResult:
        """Close the surface behind the last window and give the cloud."""
        if self._last is not None:
            self._slab(
                self._last,
                np.zeros_like(self._last),
                self._last_time,
                self._last_time + self._radar.frame_hop_s,
            )
            self._last = None
        return RdtCloudResult(self._sample.filled(), self._sample.n_seen, self._n_voxels)

    def _slab(
        self, first: NDArray[np.bool_], second: NDArray[np.bool_], start_s: float, end_s: float
    ) -> None:
        vertices, faces = _surface(
            np.stack([first, second]), np.array([start_s, end_s]), self._radar
        )
        if len(faces):
            self._sample.add(_centres(vertices, faces))


def rdt_isosurface(
    volume: ArrayLike, times: ArrayLike, radar: Radar
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Closed surface of a whole volume of detections.

    Parameters
    ----------
    volume : (time, range, velocity) bool
        Detections of the successive windows.
    times : (time,) float
        Centres of the windows [s], ascending.
    radar : Radar
        Gives the range and velocity axes and the hop.

    Returns
    -------
    vertices : (vertex, 3) float64
        Time [s], range [m], velocity [m/s].
    faces : (triangle, 3) int64
        Indices into ``vertices``. No detections: both are empty.

    Raises
    ------
    InputError
        Where the volume is no three-dimensional array of booleans or the times do not fit it.
    """
    cells, centres = np.asarray(volume), np.asarray(times, dtype=np.float64)
    if cells.ndim != 3 or cells.dtype != np.bool_ or 0 in cells.shape:
        raise InputError(
            f"RDT volume has shape {cells.shape}, type {cells.dtype}; it must be (time, range, velocity) bool"
        )
    if (
        centres.shape != cells.shape[:1]
        or not np.isfinite(centres).all()
        or (np.diff(centres) <= 0).any()
    ):
        raise InputError(
            f"RDT volume of {cells.shape[0]} windows: times must be as many finite, ascending numbers"
        )
    empty = np.zeros_like(cells[:1])
    hop = radar.frame_hop_s
    return _surface(
        np.concatenate([empty, cells, empty]),
        np.concatenate([[centres[0] - hop], centres, [centres[-1] + hop]]),
        radar,
    )


def sample_centres(
    vertices: ArrayLike, faces: ArrayLike, n_points: int = 3000, seed: int = 0
) -> NDArray[np.float64]:
    """A uniform random sample of the centres of triangles; the same as `RdtCloud` draws of the same triangles.

    Parameters
    ----------
    vertices : (vertex, 3) float
        Places of the corners.
    faces : (triangle, 3) int
        Indices into ``vertices``.
    n_points : int
        Points wanted; drawn with replacement where there are fewer triangles.
    seed : int
        Of the sampling.

    Returns
    -------
    (point, 3) float64
        ``n_points`` centres, or none where there are no triangles.

    Raises
    ------
    InputError
        Where ``n_points`` or ``seed`` is out of its range.
    """
    sample = UniformSample(n_points, seed)
    sample.add(
        _centres(
            np.asarray(vertices, dtype=np.float64).reshape(-1, 3),
            np.asarray(faces, dtype=np.int64).reshape(-1, 3),
        )
    )
    return sample.filled()


def _centres(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    return vertices[faces].mean(axis=1)


def _surface(
    cells: NDArray[np.bool_], times: NDArray[np.float64], radar: Radar
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Isosurface of slices at these times, closed in range and velocity but not in time, in physical coordinates."""
    occupied: NDArray[np.bool_] = np.any(cells, axis=0)
    rows, columns = np.flatnonzero(occupied.any(axis=1)), np.flatnonzero(occupied.any(axis=0))
    if rows.size == 0:
        return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    # Only the cubes that touch a detection have triangles: march over their bounding box, one empty cell round it.
    box = cells[:, rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    padded = np.pad(box, ((0, 0), (1, 1), (1, 1))).astype(np.float32)
    indices, faces, _, _ = marching_cubes(padded, 0.5)
    places = indices.astype(np.float64)
    whole = np.floor(places[:, 0]).astype(np.int64)
    steps = np.append(np.diff(times), 0.0)
    time = times[whole] + (places[:, 0] - whole) * steps[whole]
    n_velocity = cells.shape[2]
    velocity_bin = radar.wavelength_m / (2 * n_velocity * radar.cycle_duration_s)
    distance = (places[:, 1] + (rows[0] - 1)) * radar.range_bin_m
    velocity = (places[:, 2] + (columns[0] - 1) - n_velocity // 2) * velocity_bin
    return np.stack([time, distance, velocity], axis=1), faces.astype(np.int64)
