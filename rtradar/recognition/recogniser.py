"""The recogniser: a forest over the numbers that describe a window, in plain NumPy.

Each tree asks one number after the other whether it is above a threshold, down to a leaf, which has
a probability of each activity; those of all trees are averaged (extremely randomised trees, P.
Geurts et al., Mach. Learn. 63 (2006) 3-42).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.recognition.description import describe, outline
from rtradar.system.files import atomic_file, read_arrays

WEIGHTS = Path(__file__).with_name("weights.npz")
"""Weights that come with the package."""

OTHER = "other"
"""Class of what is none of the activities."""

LEAST_POINTS = 24
"""Number of points of a window below which it says nothing."""

_MOST_BYTES = 5_000_000
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
        ``classes``, the activities and `OTHER`, ``temperature`` by which the logarithms of
        probabilities are divided, ``radar`` (`range_bin_m`, `velocity_bin_mps`,
        `max_velocity_mps`), ``snr_db`` (least, most), ``usual`` (``mean``, ``inverse_covariance``,
        ``most`` distance of outlines), and texts.
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
        """Names of the activities, and `OTHER`."""
        return tuple(self.card["classes"])

    def probabilities(self, windows: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the probability of each class for each window of a cloud, (window, class).

        A window of fewer than `LEAST_POINTS` points gives all classes the same.
        """
        found = np.full((len(windows), len(self.classes)), 1 / len(self.classes))
        for place, window in enumerate(windows):
            if len(window) >= LEAST_POINTS:
                chances = self.of_description(describe(window))
                logits = np.log(np.maximum(chances, 1e-3)) / self.card["temperature"]
                scaled = np.exp(logits - logits.max())
                found[place] = scaled / scaled.sum()
        return found

    def of_description(self, numbers: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean probability (class,) of all trees for what `describe` gives."""
        feature, threshold = self.forest["feature"], self.forest["threshold"]
        nodes, values = self.forest["roots"], numbers.astype(np.float32)
        while (inner := feature[nodes] >= 0).any():
            low = values[feature[nodes]] <= threshold[nodes]
            following = np.where(low, self.forest["below"][nodes], self.forest["above"][nodes])
            nodes = np.where(inner, following, nodes)
        return np.asarray(self.forest["chances"][nodes].astype(np.float64).mean(axis=0))

    def distance(self, windows: list[NDArray[np.float64]]) -> float:
        """Return how unusual the windows are: 1 for one of 200 of those that were learnt from.

        It is the median Mahalanobis distance of their outlines, relative to that limit.
        """
        usual = self.card["usual"]
        found = [outline(window) for window in windows if len(window) >= LEAST_POINTS]
        if not found:
            return np.inf
        away = np.array(found) - usual["mean"]
        squares = np.einsum("wi,ij,wj->w", away, usual["inverse_covariance"], away)
        return float(np.median(np.sqrt(squares)) / usual["most"])
