"""The recogniser: networks over the points of a window, averaged, in plain NumPy.

Each network passes every point through three layers, takes the largest and the mean value of each
of their outputs over all points, and passes these through two more (after PointNet, C. R. Qi et
al., CVPR 2017, without its transformations; the mean is beside the maximum because single false
points do not change it).
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
from rtradar.recognition.windows import describe, normalised
from rtradar.system.files import atomic_file, read_arrays

WEIGHTS = Path(__file__).with_name("weights.npz")
"""Weights that come with the package."""

POINT_LAYERS, CLOUD_LAYERS = 3, 2
"""Numbers of layers over points, and over what is left of them."""

N_POINTS = 128
"""Number of points of a window that the networks take; a window may have fewer."""

_LEAST_POINTS = 24  # with fewer a window says nothing
_MOST_BYTES = 5_000_000

Layers = list[tuple[NDArray[np.float32], NDArray[np.float32]]]
"""Weight (output, input) and bias (output,) of the layers of one network."""


@dataclass(frozen=True)
class Recogniser:
    """Networks with the same classes, and the card that says what they have learnt.

    Parameters
    ----------
    networks : list
        `Layers` of each network, those over points first.
    card : dict
        ``classes``, ``temperature`` by which the logarithms of probabilities are divided, ``radar``
        (`range_bin_m`, `velocity_bin_mps`, `max_velocity_mps`), ``snr_db`` (least, most),
        ``usual`` (``mean``, ``inverse_covariance``, ``most`` distance of `describe`), and texts.
    """

    networks: list[Layers]
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
            card = json.loads(str(arrays["card"]))
            networks = [
                [
                    (
                        arrays[f"weight_{network}_{layer}"].astype(np.float32),
                        arrays[f"bias_{network}_{layer}"].astype(np.float32),
                    )
                    for layer in range(POINT_LAYERS + CLOUD_LAYERS)
                ]
                for network in range(card["networks"])
            ]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"'{path}' holds no weights of rtradar ({error})") from None
        return cls(networks, card)

    def save(self, path: Path) -> None:
        """Write the recogniser, weights in half precision."""
        arrays: dict[str, Any] = {
            f"{kind}_{number}_{layer}": values.astype(np.float16)
            for number, network in enumerate(self.networks)
            for layer, both in enumerate(network)
            for kind, values in zip(("weight", "bias"), both, strict=True)
        }
        card = json.dumps(self.card | {"networks": len(self.networks)}, indent=1)
        with atomic_file(path) as file:
            np.savez_compressed(file, card=np.array(card), **arrays)

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the activities."""
        return tuple(self.card["classes"])

    def probabilities(self, windows: list[NDArray[np.float64]]) -> NDArray[np.float64]:
        """Return the probability of each class for each window of a cloud, (window, class).

        A window of fewer than 24 points gives all classes the same.
        """
        found = np.full((len(windows), len(self.classes)), 1 / len(self.classes))
        for place, window in enumerate(windows):
            if len(window) >= _LEAST_POINTS:
                points = normalised(window, N_POINTS, np.random.default_rng(0))
                logits = np.mean([_forward(layers, points) for layers in self.networks], axis=0)
                scaled = np.exp((logits - logits.max()) / self.card["temperature"])
                found[place] = scaled / scaled.sum()
        return found

    def distance(self, windows: list[NDArray[np.float64]]) -> float:
        """Return how unusual the windows are: 1 for one of 200 of those that were learnt from.

        It is the median Mahalanobis distance of their descriptions, relative to that limit.
        """
        usual = self.card["usual"]
        found = [describe(window) for window in windows if len(window) >= _LEAST_POINTS]
        if not found:
            return np.inf
        away = np.array(found) - usual["mean"]
        squares = np.einsum("wi,ij,wj->w", away, np.array(usual["inverse_covariance"]), away)
        return float(np.median(np.sqrt(squares)) / usual["most"])


def _forward(layers: Layers, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the logarithms of the probabilities of one window (point, 3), (class,)."""
    values = points.astype(np.float32)
    for weight, bias in layers[:POINT_LAYERS]:
        values = np.maximum(values @ weight.T + bias, 0)
    pooled = np.concatenate([values.max(axis=0), values.mean(axis=0)])
    for weight, bias in layers[POINT_LAYERS:-1]:
        pooled = np.maximum(weight @ pooled + bias, 0)
    weight, bias = layers[-1]
    logits = (weight @ pooled + bias).astype(np.float64)
    return np.asarray(logits - np.logaddexp.reduce(logits))
