"""Points that the board of a radar lists, in windows, and the numbers that describe one.

Points with Doppler are those of somebody who moves. Of points without, those in range cells that
have one in most frames of a window are the room's; the others near the moving ones are the
person's too, whose trunk is seen now and then. The numbers describe both kinds: how they spread,
how Doppler is distributed, and how the means of a frame go on over time. None says how many points
move, for a simulation does not know how much of a person a radar loses.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from rtradar.radar import Radar

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

FEWEST = 3
"""Fewest points of a person; a window with fewer shows nobody."""

NEAR_M = 0.8
"""How far in range a person's points spread [m]."""

STEP_S = 1.0
"""Time from one window of a long recording to the next [s]."""

_LARGEST_BIN = 5
_LAGS = (1, 2, 4, 6, 9, 12, 16)
_HARMONICS = 16
_QUANTILES = (0.1, 0.25, 0.75, 0.9)
_ALWAYS = 0.6  # fraction of the frames from which on a range cell is the room's
_SLACK, _ROUNDED = 0.2, 0.01  # of a step, by which times of frames, and lengths, may be off


@dataclass(frozen=True)
class Grid:
    """Cells of a radar's points, and the windows in which they are looked at.

    Parameters
    ----------
    frame_s : float
        Time from frame to frame [s], of those frames that are looked at.
    range_bin_m, velocity_bin_mps : float
        Size of a cell [m], [m/s].
    max_range_m : float
        End of the range axis [m]; what is beyond is garbled.
    window_s : float
        Length of a window [s].
    """

    frame_s: float
    range_bin_m: float
    velocity_bin_mps: float
    max_range_m: float
    window_s: float

    @property
    def frames(self) -> int:
        """Number of frames of a window."""
        return round(self.window_s / self.frame_s)


class Points(NamedTuple):
    """Points on a grid.

    ``places`` (point, 3) are x ahead, y to the left and z up from the radar [m]; ``doppler``,
    ``cell`` and ``frame`` (point,) are the numbers of the cells of velocity, range and time, and
    ``frames`` is that of all frames.
    """

    places: Array
    doppler: Numbers
    cell: Numbers
    frame: Numbers
    frames: int

    @classmethod
    def on_grid(
        cls,
        table: Array,
        grid: Grid,
        length_s: float | None = None,
        step_s: float | None = None,
    ) -> Points:
        """Put a table (point, 5) of time [s], x, y, z [m] and velocity [m/s] on a grid.

        Of frames that follow each other faster than those of the grid, every n-th is taken, and of
        several points of a cell the first one. The time begins with the first point, or at 0 where
        ``length_s`` is given, the length of the recording [s]. Frames follow each other by
        ``step_s``; by default most of the points say by how much (`step_of`).
        """
        away_m = np.linalg.norm(np.nan_to_num(table[:, 1:4]), axis=1)
        known = np.isfinite(table[:, [0, 4]]).all(axis=1) & (away_m > 0)
        table, away_m = (part[known & (away_m < grid.max_range_m)] for part in (table, away_m))
        times = table[:, 0] - (table[:, 0].min(initial=np.inf) if length_s is None else 0.0)
        step_s = step_of(times, grid) if step_s is None else step_s
        every = max(1, round(grid.frame_s / step_s))
        number = np.floor(times / step_s + _SLACK).astype(np.int64)
        cells = np.rint(away_m / grid.range_bin_m).astype(np.int64)
        doppler = np.rint(table[:, 4] / grid.velocity_bin_mps).astype(np.int64)
        if length_s is None:
            last = int(number.max(initial=0))
        else:
            last = math.ceil(length_s / step_s - _ROUNDED) - 1
        _, first = np.unique(np.stack([number, cells, doppler]), axis=1, return_index=True)
        kept = np.sort(first[number[first] % every == 0])
        places = np.nan_to_num(table[kept, 1:4])
        frames = last // every + 1
        return cls(places, doppler[kept], cells[kept], number[kept] // every, frames)

    def some(self, which: NDArray[np.bool_]) -> Points:
        """Return those of the points."""
        places, doppler, cell, frame = self.places, self.doppler, self.cell, self.frame
        return Points(places[which], doppler[which], cell[which], frame[which], self.frames)

    def window(self, first: int, length: int) -> Points:
        """Return the points of so many frames from the first on."""
        own = self.some((self.frame >= first) & (self.frame < first + length))
        return own._replace(frame=own.frame - first, frames=length)

    def windows(self, grid: Grid) -> Iterator[tuple[float, Points]]:
        """Yield the start [s] and the points of each window; one that is shorter if none is whole.

        Windows begin every `STEP_S`.
        """
        step = max(1, round(STEP_S / grid.frame_s))
        for first in range(0, max(self.frames - grid.frames, 0) + 1, step):
            yield first * grid.frame_s, self.window(first, grid.frames)


def in_axes(table: Array, radar: Radar) -> Array:
    """Turn x, y and z of a table (point, 5) from the world's axes into those of a radar [m]."""
    places = (table[:, 1:4] - radar.position_m) @ radar.axes
    return np.column_stack([table[:, 0], places, table[:, 4]])


def step_of(times: Array, grid: Grid) -> float:
    """Return the time between the frames of points [s]; of one frame it is the grid's own.

    At least a quarter of the frames that have points must follow another one that has some.
    """
    apart = np.diff(np.unique(np.round(times, 6)))
    return float(np.quantile(apart, 0.25)) if len(apart) else grid.frame_s


def of_person(window: Points) -> tuple[Points, Points]:
    """Return the moving points, and the still ones that are not the room's and near to those."""
    moves = window.doppler != 0
    moving, still = window.some(moves), window.some(~moves)
    often = np.bincount(still.cell, minlength=still.cell.max(initial=0) + 2) > (
        _ALWAYS * window.frames
    )
    beside = often.copy()  # the room's cells, with their neighbours, in which its echoes flicker
    beside[1:] |= often[:-1]
    beside[:-1] |= often[1:]
    still = still.some(~beside[still.cell])
    middle = middle_of(moving if len(moving.frame) >= FEWEST else still)
    return moving, still.some(np.abs(_distance(still) - middle) < NEAR_M)


def middle_of(points: Points) -> float:
    """Return the median distance of points from the radar [m]; 0 where there is none."""
    return float(np.median(_distance(points))) if len(points.frame) else 0.0


def without_person(window: Points) -> Points:
    """Return a window as it is when the person has left: still points away from the moving ones."""
    moving, still = of_person(window)
    middle = middle_of(moving if len(moving.frame) >= FEWEST else still)
    left = (window.doppler == 0) & (np.abs(_distance(window) - middle) >= NEAR_M)
    return window.some(left)


def describe_points(window: Points) -> Array | None:
    """Describe a window in numbers (number,); None where it has too few points of a person."""
    moving, still = of_person(window)
    if len(moving.frame) + len(still.frame) < FEWEST:
        return None
    middle = middle_of(moving if len(moving.frame) >= FEWEST else still)
    counts = np.bincount(moving.frame, minlength=window.frames)
    few = np.log1p(len(still.frame))
    return np.nan_to_num(
        np.concatenate(
            [
                [few, np.log1p(len(moving.frame)) - few, (counts == 0).mean()],
                [counts.std() / (counts.mean() + 0.1)],
                _of_doppler(moving),
                _spread(moving),
                _spread(still),
                [middle_of(still) - middle if len(still.frame) else 0.0],
                [_height(still) - _height(moving)],
                [middle_of(moving) if len(moving.frame) >= FEWEST else 0.0],
                _rhythm(counts - counts.mean()),
                _rhythm(np.bincount(moving.frame, moving.doppler, window.frames) / counts.clip(1)),
                *(
                    _rhythm(_course(of, values))
                    for of, values in (
                        (moving, moving.doppler),
                        (still, _distance(still)),
                        (still, still.places[:, 2]),
                    )
                ),
            ]
        )
    )


def _distance(points: Points) -> Array:
    return np.asarray(np.linalg.norm(points.places, axis=1))


def _height(points: Points) -> float:
    return float(np.median(points.places[:, 2])) if len(points.frame) >= FEWEST else 0.0


def _of_doppler(moving: Points) -> Array:
    """Histogram of Doppler, and its correlations with the places, and of those with each other."""
    bins = np.clip(moving.doppler, -_LARGEST_BIN, _LARGEST_BIN)
    histogram = np.bincount(bins + _LARGEST_BIN, minlength=2 * _LARGEST_BIN + 1)
    together = np.zeros(6)
    if len(bins) >= FEWEST:
        with np.errstate(invalid="ignore", divide="ignore"):  # of what is alike in all points
            columns = np.column_stack([moving.places, bins])
            together = np.corrcoef(columns.T)[np.triu_indices(4, 1)]
    return np.concatenate([histogram / max(len(bins), 1), together])


def _spread(points: Points) -> Array:
    """Quantiles of the places about their median, and deviations."""
    if len(points.frame) < FEWEST:
        return np.zeros(3 * (len(_QUANTILES) + 1))
    about = points.places - np.median(points.places, axis=0)
    return np.concatenate([np.quantile(about, _QUANTILES, axis=0).ravel(), about.std(axis=0)])


def _course(points: Points, values: Array | Numbers) -> Array:
    """Mean of values in each frame (frame,) from its mean; between frames with points, lines."""
    many = np.bincount(points.frame, minlength=points.frames)
    (known,) = np.nonzero(many)
    if len(known) < FEWEST:
        return np.zeros(points.frames)
    mean = np.bincount(points.frame, values, points.frames)[known] / many[known]
    course = np.interp(np.arange(points.frames), known, mean)
    return np.asarray(course - course.mean())


def _rhythm(course: Array) -> Array:
    """Correlation of a course (frame,) with itself some frames later, and its spectrum."""
    energy = max(float(np.mean(course**2)), 1e-9)
    later = [np.mean(course[lag:] * course[:-lag]) / energy for lag in _LAGS if lag < len(course)]
    spectrum = np.abs(np.fft.rfft(course * np.hanning(len(course)))) ** 2
    spectrum = spectrum[1 : _HARMONICS + 1]
    return np.concatenate([later, spectrum / (spectrum.sum() + 1e-12)])
