"""What a forest is told of a window of points of a radar on a chip, for `radhar_activities.py`.

Points with Doppler are those of somebody who moves. Of points without, those in range cells that
have one in most frames of the window are the room's; the others near the moving ones are the
person's too, whose trunk is seen now and then. Figures describe both kinds: how they spread, how
Doppler is distributed, and how the means of a frame go on over time. None says how many points
move, for a simulation does not know how much of a person a radar loses.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

LARGEST_BIN = 5
LAGS = (1, 2, 4, 6, 9, 12, 16)
HARMONICS = 16
QUANTILES = (0.1, 0.25, 0.75, 0.9)
ALWAYS = 0.6  # fraction of the frames from which on a range cell is the room's
NEAR_M = 0.8  # of the person, whose points spread so far in range
FEWEST = 3


class Cloud(NamedTuple):
    """Points: x ahead, y sideways, z up [m], Doppler bin, range bin, number of the frame."""

    places: Array
    doppler: Numbers
    cell: Numbers
    frame: Numbers
    frames: int

    def some(self, which: NDArray[np.bool_]) -> Cloud:
        return Cloud(*(of[which] for of in self[:4]), self.frames)

    def window(self, first: int, length: int) -> Cloud:
        own = self.some((self.frame >= first) & (self.frame < first + length))
        return own._replace(frame=own.frame - first, frames=length)

    def thinned(self, kept: float, random: np.random.Generator) -> Cloud:
        """Without a part of the moving points, drawn at random."""
        return self.some((self.doppler == 0) | (random.random(len(self.doppler)) < kept))


def described(window: Cloud) -> Array:
    """Figures (figure,) of a window."""
    moves = window.doppler != 0
    moving, still = window.some(moves), window.some(~moves)
    often = np.bincount(still.cell, minlength=still.cell.max(initial=0) + 2) > (
        ALWAYS * window.frames
    )
    beside = often.copy()  # the room's cells, with their neighbours, in which its echoes flicker
    beside[1:] |= often[:-1]
    beside[:-1] |= often[1:]
    still = still.some(~beside[still.cell])
    of_person = moving if len(moving.frame) >= FEWEST else still
    middle = float(np.median(_distance(of_person))) if len(of_person.frame) else 0.0
    still = still.some(np.abs(_distance(still) - middle) < NEAR_M)
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
                [np.median(_distance(still)) - middle if len(still.frame) else 0.0],
                [_height(still) - _height(moving)],
                [np.median(_distance(moving)) if len(moving.frame) >= FEWEST else 0.0],
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


def _distance(cloud: Cloud) -> Array:
    return np.asarray(np.linalg.norm(cloud.places, axis=1))


def _height(cloud: Cloud) -> float:
    return float(np.median(cloud.places[:, 2])) if len(cloud.frame) >= FEWEST else 0.0


def _of_doppler(moving: Cloud) -> Array:
    """Histogram of Doppler, and its correlations with the places, and of those with each other."""
    bins = np.clip(moving.doppler, -LARGEST_BIN, LARGEST_BIN)
    histogram = np.bincount(bins + LARGEST_BIN, minlength=2 * LARGEST_BIN + 1)
    together = np.zeros(6)
    if len(bins) >= FEWEST:
        with np.errstate(invalid="ignore", divide="ignore"):  # of what is alike in all points
            columns = np.column_stack([moving.places, bins])
            together = np.corrcoef(columns.T)[np.triu_indices(4, 1)]
    return np.concatenate([histogram / max(len(bins), 1), together])


def _spread(cloud: Cloud) -> Array:
    """Quantiles of the places about their median, and deviations."""
    if len(cloud.frame) < FEWEST:
        return np.zeros(3 * (len(QUANTILES) + 1))
    about = cloud.places - np.median(cloud.places, axis=0)
    return np.concatenate([np.quantile(about, QUANTILES, axis=0).ravel(), about.std(axis=0)])


def _course(cloud: Cloud, values: Array | Numbers) -> Array:
    """Mean of values in each frame (frame,) from its mean; between frames with points, lines."""
    many = np.bincount(cloud.frame, minlength=cloud.frames)
    (known,) = np.nonzero(many)
    if len(known) < FEWEST:
        return np.zeros(cloud.frames)
    mean = np.bincount(cloud.frame, values, cloud.frames)[known] / many[known]
    course = np.interp(np.arange(cloud.frames), known, mean)
    return np.asarray(course - course.mean())


def _rhythm(course: Array) -> Array:
    """Correlation of a course (frame,) with itself some frames later, and its spectrum."""
    energy = max(float(np.mean(course**2)), 1e-9)
    later = [np.mean(course[lag:] * course[:-lag]) / energy for lag in LAGS]
    spectrum = np.abs(np.fft.rfft(course * np.hanning(len(course)))) ** 2
    spectrum = spectrum[1 : HARMONICS + 1]
    return np.concatenate([later, spectrum / (spectrum.sum() + 1e-12)])
