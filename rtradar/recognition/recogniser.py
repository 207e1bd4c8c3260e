"""The recogniser: a forest over the numbers that describe a window of an RDT cloud, in plain NumPy.

Each tree asks one number after the other whether it is above a threshold, down to a leaf, which has
a probability of each activity; those of all trees are averaged (extremely randomised trees, P.
Geurts et al., Mach. Learn. 63 (2006) 3-42).

None of the numbers says when points lie in the window. They have three parts. The outline has the
statistics of range and velocity and the course of velocity. The envelopes follow the fastest and
the farthest points from slice to slice of the time, and say how they spread, swing, recur and go
together: a kick is a slow rise and a burst, legs that walk recede only while they carry, and both
hands of a jumping jack go to and fro at once. The occupancy is how many points have which range and
velocity at once: a fist is fast where it is nearer to the radar than the trunk, the hands of a
jumping jack where they are about as far.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.recognition.points import Grid, Points, describe_points
from rtradar.system.files import atomic_file, read_arrays

Array = NDArray[np.float64]

OUTLINE = 36
"""Count of the first numbers of a description, which are the outline."""

_PERCENTILES = (5, 25, 50, 75, 95)
_TIME_BINS = 8

_SLICES, _LEAST, _LAGS = 14, 4, (1, 2, 3, 4, 5, 6)
"""Slices of the time, the fewest points of one that counts, and by how many slices envelopes are
compared with themselves."""

_SPEEDS, _DISTANCES = (2, 10, 50, 90, 98), (5, 50, 95)
"""Percentiles of velocity and of range that envelopes follow."""

_FASTEST = 10
"""The places of one point in so many are averaged: those that approach, and recede, the fastest."""

_RANGE_EDGES_M = (-np.inf, -0.5, -0.3, -0.15, 0.0, 0.15, 0.3, 0.5, np.inf)
_VELOCITY_EDGES_MPS = (
    -np.inf, -4.0, -2.5, -1.5, -0.8, -0.3, 0.3, 0.8, 1.5, 2.5, 4.0, np.inf
)  # fmt: skip
"""Edges of the cells of `occupancy`: of range from its median, and of velocity. They are closer
where most points are."""


WINDOW_S, HOP_S = 1.4, 0.35
"""Length of a window of a cloud, and the largest step to the next [s].

The clouds of a data set are of captures of 1.6 s. What lies within 0.1 s of their ends is left out,
because the surface of which clouds are made is closed there."""

EDGE_S = 0.1
"""Time at each end of a capture that no window reaches [s], twice that of a frame."""


def cut_windows(points: Array, length_s: float) -> list[Array]:
    """Cut an RDT cloud (point, 3) of a capture of this length [s] into windows.

    A shorter capture is one window. Windows may be empty.
    """
    times = points[:, 0]
    return [points[(times >= start) & (times < start + WINDOW_S)] for start in starts_of(length_s)]


def starts_of(length_s: float) -> Array:
    """Return when each window of a capture of this length begins (window,) [s]."""
    first, last = EDGE_S, max(length_s - EDGE_S, EDGE_S)
    rest = max(last - first - WINDOW_S, 0.0)
    count = 1 + math.ceil(rest / HOP_S - 1e-6)
    return first + (rest * np.arange(count) / (count - 1) if count > 1 else np.zeros(1))


def describe(points: Array) -> Array:
    """Describe a window (point, 3), of time [s], range [m] and velocity [m/s], in 223 numbers.

    They are those of `outline`, `envelopes` and `occupancy`.
    """
    return np.concatenate([outline(points), envelopes(points), occupancy(points)])


def outline(points: Array) -> Array:
    """Describe a window (point, 3) in 36 numbers.

    The statistics of range from its mean, and of velocity (`statistics`), the three correlations,
    the fraction of points slower than 0.5 m/s, and the course of velocity (`course`).
    """
    centred = points - [points[:, 0].mean(), points[:, 1].mean(), 0.0]
    together, slow = correlations(centred), np.mean(np.abs(points[:, 2]) < 0.5)
    return np.concatenate(
        [statistics(centred[:, 1:]).ravel(), together, [slow], course(centred).ravel()]
    )


def statistics(points: Array) -> Array:
    """Standard deviation, extremes and five percentiles of each column, (8, column)."""
    extremes = points.min(axis=0), points.max(axis=0)
    return np.stack([points.std(axis=0), *extremes, *np.percentile(points, _PERCENTILES, axis=0)])


def correlations(points: Array) -> Array:
    """Correlations of the three pairs of columns; 0 where one does not vary."""
    return np.array([_correlation(points[:, a], points[:, b]) for a, b in ((0, 1), (0, 2), (1, 2))])


def course(points: Array) -> Array:
    """Mean and spread of velocity in each eighth of the time, (8, 2); 0 where no point lies."""
    parts = [part[:, 2] for part in _slices(points, _TIME_BINS)]
    return np.array([(part.mean(), part.std()) if len(part) else (0.0, 0.0) for part in parts])


def envelopes(points: Array) -> Array:
    """Summarise percentiles of velocity and range over 14 slices of the time, in 99 numbers.

    Of each of eleven courses (`_courses`) these are the mean, the standard deviation, the extremes
    and both quartiles; of four of them, the correlations with themselves 1 to 6 slices later; and
    nine correlations between them. None depends on when, within the window, something happens.
    """
    courses = np.array([_courses(part) for part in _slices(points, _SLICES)])
    summaries = [
        courses.mean(axis=0), courses.std(axis=0), courses.min(axis=0), courses.max(axis=0),
        *np.percentile(courses, (25, 75), axis=0),
    ]  # fmt: skip
    approaching, _, middle, _, receding, near, centre, far, behind, ahead, _ = courses.T
    recurring = [
        _recurrence(course) for course in (approaching, receding, middle, receding - approaching)
    ]
    pairs = (
        (approaching, receding), (middle, receding), (middle, approaching), (middle, centre),
        (near, far), (approaching, near), (receding, far), (approaching, behind),
        (receding, ahead),
    )  # fmt: skip
    together = [_correlation(one, other) for one, other in pairs]
    return np.concatenate([*summaries, *recurring, together])


def occupancy(points: Array) -> Array:
    """Square root of the fraction of points in each cell of range and velocity, (88,).

    Range is counted from its median. The square root lets sparse cells, of hands and feet, count
    beside those of the trunk.
    """
    place = points[:, 1] - np.median(points[:, 1])
    rows = np.searchsorted(_RANGE_EDGES_M[1:-1], place, side="right")
    columns = np.searchsorted(_VELOCITY_EDGES_MPS[1:-1], points[:, 2], side="right")
    across = len(_VELOCITY_EDGES_MPS) - 1
    cells = across * (len(_RANGE_EDGES_M) - 1)
    counts = np.bincount(rows * across + columns, minlength=cells)
    return np.sqrt(counts / len(points))


def _slices(points: Array, count: int) -> list[Array]:
    """Cut points into equal parts of the time between the first and the last."""
    time = points[:, 0]
    edges = np.linspace(time.min(), time.max(), count + 1)
    place = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, count - 1)
    centred = points - [0.0, np.median(points[:, 1]), 0.0]
    return [centred[place == number] for number in range(count)]


def _courses(part: Array) -> Array:
    """Return what is followed of one slice (point, 3), (11,); zeros where too few points lie.

    These are percentiles of velocity, percentiles of range, the mean ranges of the points that
    approach and recede the fastest, and the correlation of range and velocity.
    """
    if len(part) < _LEAST:
        return np.zeros(len(_SPEEDS) + len(_DISTANCES) + 3)
    place, velocity = part[:, 1], part[:, 2]
    order, few = np.argsort(velocity, kind="stable"), max(1, len(part) // _FASTEST)
    fastest = place[order[:few]].mean(), place[order[-few:]].mean()
    return np.array(
        [
            *np.percentile(velocity, _SPEEDS),
            *np.percentile(place, _DISTANCES),
            *fastest,
            _correlation(place, velocity),
        ]
    )


def _recurrence(course: Array) -> list[float]:
    """Correlations of a course with itself some slices later, relative to its variance."""
    centred = course - course.mean()
    power = np.sum(centred**2)
    if power < 1e-12:
        return [0.0] * len(_LAGS)
    return [float(np.sum(centred[:-lag] * centred[lag:]) / power) for lag in _LAGS]


def _correlation(one: Array, other: Array) -> float:
    """Correlation of two columns; 0 where one does not vary."""
    spread = one.std() * other.std()
    if spread < 1e-12:
        return 0.0
    return float(np.mean((one - one.mean()) * (other - other.mean())) / spread)


WEIGHTS = Path(__file__).with_name("weights.npz")
"""Weights that come with the package."""

UNKNOWN, NOBODY = "unknown", "nobody"
"""Classes of what is none of the activities, and of a window that shows no person."""

LEAST_POINTS = 24
"""Number of points of a window below which it says nothing."""

_MOST_BYTES = 200_000_000  # unpacked; a build of a hundred takes has 10 MB
_TYPES = {
    "roots": "i4", "feature": "i2", "threshold": "f4", "below": "i4", "above": "i4",
    "chances": "f2",
}  # fmt: skip
"""Arrays of a forest: the first node of each tree, and of each node the number that is compared (-1
in leaves), the threshold, the nodes for what is not above it and for what is, and the probabilities
``(node, class)``."""


@dataclass(frozen=True)
class Recogniser:
    """A forest, and the card that says what it has learnt.

    Parameters
    ----------
    forest : dict
        Arrays ``roots (tree,)``; ``feature``, ``threshold``, ``below`` and ``above (node,)``, of
        which the first is -1 in a leaf; ``chances (node, class)``.
    card : dict
        ``classes``, the activities, `UNKNOWN` and perhaps `NOBODY`; ``temperature`` by which the
        logarithms of probabilities are divided; ``radar`` (``range_bin_m``, ``velocity_bin_mps``,
        ``max_velocity_mps``, frames); ``usual`` (``mean``, ``inverse_covariance``, ``most``
        distance of the first numbers); ``grid``, the fields of a `Grid`, where it knows the points
        of a board instead of RDT clouds; and texts.
    """

    forest: dict[str, NDArray[Any]]
    card: dict[str, Any]

    @classmethod
    @cache
    def shipped(cls) -> Recogniser:
        """Read the recogniser that comes with the package."""
        return cls.load(WEIGHTS)

    @classmethod
    def load(cls, path: Path) -> Recogniser:
        """Read a recogniser; an InputError is raised if the file is missing or damaged."""
        try:
            arrays = read_arrays(path, _MOST_BYTES)
            card = json.loads(str(arrays.pop("card")))
            usual = {name: arrays.pop(name) for name in ("mean", "inverse_covariance")}
            card["usual"] |= usual
            forest = {name: arrays[name] for name in _TYPES}
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"'{path}' holds no weights of rtradar ({error})") from None
        return cls(forest, card)

    def save(self, path: Path) -> None:
        """Write the recogniser, probabilities in half precision."""
        arrays: dict[str, Any] = {
            name: self.forest[name].astype(kind) for name, kind in _TYPES.items()
        }
        usual = dict(self.card["usual"])
        for name in ("mean", "inverse_covariance"):
            arrays[name] = np.asarray(usual.pop(name), dtype=np.float64)
        card = json.dumps(self.card | {"usual": usual}, indent=1)
        with atomic_file(path) as file:
            np.savez_compressed(file, card=np.array(card), **arrays)

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the activities, and `UNKNOWN` and `NOBODY`."""
        return tuple(self.card["classes"])

    @property
    def grid(self) -> Grid | None:
        """Cells and windows of the points of a board; None where RDT clouds are recognised."""
        return Grid(**self.card["grid"]) if "grid" in self.card else None

    def probabilities(self, windows: Sequence[Array | Points]) -> NDArray[np.float64]:
        """Return the probability of each class for each window of a cloud, (window, class).

        A window of too few points shows nobody; where that is no class, all have the same.
        """
        nobody = [name == NOBODY for name in self.classes]
        nothing = np.array(nobody, dtype=np.float64) if any(nobody) else 1 / len(nobody)
        found = np.zeros((len(windows), len(nobody)))
        for place, window in enumerate(windows):
            numbers = self.describe(window)
            if numbers is None:
                found[place] = nothing
                continue
            chances = np.maximum(self.of_description(numbers), 1e-3)
            found[place] = with_temperature(chances[None], self.card["temperature"])[0]
        return found

    def describe(self, window: Array | Points) -> Array | None:
        """Describe a window of what is recognised; None where it has too few points."""
        if isinstance(window, Points):
            return describe_points(window)
        return describe(window) if len(window) >= LEAST_POINTS else None

    def of_description(self, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean probability (class,) of all trees for what `describe` gives."""
        feature, threshold = self.forest["feature"], self.forest["threshold"]
        nodes, values = self.forest["roots"], numbers.astype(np.float32)
        while (inner := feature[nodes] >= 0).any():
            low = values[feature[nodes]] <= threshold[nodes]
            following = np.where(low, self.forest["below"][nodes], self.forest["above"][nodes])
            nodes = np.where(inner, following, nodes)
        return np.asarray(self.forest["chances"][nodes].astype(np.float64).mean(axis=0))

    def distance(self, windows: Sequence[Array | Points]) -> float:
        """Return how unusual the windows are: 1 for one of 200 of those that were learnt from.

        It is the median Mahalanobis distance of their first numbers (of an RDT cloud the outline),
        relative to that limit; NaN where no window has enough points.
        """
        usual = self.card["usual"]
        found = [numbers for own in windows if (numbers := self.describe(own)) is not None]
        if not found:
            return math.nan
        first = np.array(found)[:, : len(usual["mean"])]
        away = distances(first, usual["mean"], usual["inverse_covariance"])
        return float(np.median(away) / usual["most"])


def distances(numbers: Array, mean: Array, inverse: Array) -> Array:
    """Return the Mahalanobis distance of each window (window,)."""
    away = numbers - mean
    return np.asarray(np.sqrt(np.einsum("wi,ij,wj->w", away, inverse, away)))


def with_temperature(probabilities: Array, temperature: float) -> Array:
    """Divide the logarithms of probabilities (answer, class) by a temperature."""
    logits = np.log(np.maximum(probabilities, 1e-12)) / temperature
    scaled = np.exp(logits - logits.max(axis=1, keepdims=True))
    return np.asarray(scaled / scaled.sum(axis=1, keepdims=True))
