"""Training of the weights that `rtradar.recognition` runs, and of what their card says."""

from __future__ import annotations

import time
from collections import Counter
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from rtradar.classify.prepare import stack_clouds
from rtradar.classify.recipes import SMALL, Recipe
from rtradar.classify.scores import Answers, best_temperature
from rtradar.classify.small_networks import PooledNet
from rtradar.classify.splits import make_splits
from rtradar.classify.study import classes_of
from rtradar.classify.training import Examples, predict, train_network
from rtradar.clouds.collection import Collection
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.recognition.recogniser import Recogniser
from rtradar.recognition.windows import EDGE_S, describe

USUAL = 0.995
"""Fraction of the windows that are not called unusual."""


def train_recogniser(
    clouds: Collection,
    radar: Radar,
    *,
    networks: int = 5,
    recipe: Recipe = SMALL,
    seed: int = 0,
) -> Recogniser:
    """Train networks on clouds of actors, each without a part of them, which calibrates it.

    Parameters
    ----------
    clouds : Collection
        Clouds in windows that begin at random.
    radar : Radar
        Radar for which the weights are good.
    networks : int
        Number of networks, whose answers are averaged, at least 2.
    recipe : Recipe
        Hyperparameters; the network must be ``pooled``.
    seed : int
        Seed of the splits and the trainings.

    Returns
    -------
    Recogniser

    Raises
    ------
    InputError
        If a cloud is of a recording, or the recipe is of another network.
    """
    sources = Counter(clouds.column("source").tolist())
    if set(sources) != {"synthetic"} or recipe.network != "pooled":
        raise InputError("weights that are given away learn from synthetic actors, by 'pooled'")
    began = time.process_time()
    names, truth = classes_of(clouds)
    stacked = stack_clouds(clouds, seed=seed, edge_s=recipe.edge_s)
    examples = Examples(stacked, torch.from_numpy(truth), names)
    trained, held_out = [], np.zeros((len(clouds), len(names)))
    splits = make_splits(clouds, "subject", folds=networks, seed=seed)
    for number, split in enumerate(tqdm(splits, unit="network", disable=None)):
        test = examples[split.test]
        network, _ = train_network(examples[split.train], test, recipe, seed=seed + number)
        assert isinstance(network, PooledNet)
        held_out[split.test] = np.exp(predict(network, test, recipe))
        trained.append([(w.numpy(), b.numpy()) for w, b in network.layers()])
    column = clouds.column("subject").astype(str)
    answers = Answers(held_out, truth, clouds.column("recording").astype(str), column)
    snr_db = clouds.column("snr_db").astype(float)
    described = np.array([describe(_middle(clouds, index)) for index in range(len(clouds))])
    card = {
        "classes": list(names),
        "temperature": best_temperature(answers),
        "radar": _limits(radar),
        "snr_db": [float(snr_db.min()), float(snr_db.max())],
        "usual": _usual(described),
        "clouds": dict(Counter(clouds.labels.tolist())),
        "people": len(set(column.tolist())),
        "held_out_accuracy": float(np.mean(held_out.argmax(axis=1) == truth)),
        "training_cpu_s": round(time.process_time() - began, 1),
        "recipe": recipe.as_dict(),
        "seed": seed,
    }
    return Recogniser(trained, card)


def _middle(clouds: Collection, index: int) -> Any:
    points = clouds.points(index)
    return points[(points[:, 0] >= EDGE_S) & (points[:, 0] < points[:, 0].max() - EDGE_S)]


def _usual(described: np.ndarray[Any, Any]) -> dict[str, Any]:
    mean = described.mean(axis=0)
    inverse = np.linalg.inv(np.cov(described.T) + 1e-6 * np.eye(described.shape[1]))
    away = described - mean
    distances = np.sqrt(np.einsum("wi,ij,wj->w", away, inverse, away))
    most = float(np.quantile(distances, USUAL))
    return {"mean": mean.tolist(), "inverse_covariance": inverse.tolist(), "most": most}


def _limits(radar: Radar) -> dict[str, Any]:
    velocity = radar.velocity_mps(radar.cycles_per_frame)
    return {
        "name": radar.name,
        "range_bin_m": radar.range_bin_m,
        "velocity_bin_mps": float(velocity[1] - velocity[0]),
        "max_velocity_mps": radar.max_velocity_mps,
        "frame_duration_s": radar.frame_duration_s,
        "frame_hop_s": radar.frame_hop_s,
    }
