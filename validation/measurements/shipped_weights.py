"""Train the weights that come with the package: actors, their clouds, a forest, in one command.

    python validation/measurements/shipped_weights.py OUT [--install]

Builds what OUT lacks of the data sets `validation/actors.toml` and `validation/other_actors.toml`,
trains, and writes OUT/weights.npz, which follows from the code and the seed alone. With --install
it becomes the weights of the package. The time of both steps is printed.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from sklearn.ensemble import ExtraTreesClassifier

from rtradar.classify.outcomes import Answers, balanced_accuracy
from rtradar.classify.splits import make_splits
from rtradar.clouds.collection import Collection
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.recognition import Recogniser
from rtradar.recognition.recogniser import OTHER, OUTLINE, WEIGHTS, cut_windows, describe
from rtradar.system.seeds import word

DATA_SETS = Path(__file__).resolve().parents[1]
NAMES = ("actors", "other_actors")


ANSWERS = {
    "walk": "walk",
    "kick": "kick",
    "punch": "punch",
    "boxing": "punch",
    "jumping_jack": "jumping_jack",
}
"""What is answered about the activities of actors; about all others it is `OTHER`."""

_TREES, _LEAST_IN_LEAF, _FOLDS = 300, 2, 5
_USUAL = 0.995  # fraction of the windows that are not called unusual
_RIDGE = 1e-2  # of the variance of each number, so that nearly dependent ones do no harm


def train_recogniser(clouds: Collection, radar: Radar, *, seed: int = 0) -> Recogniser:
    """Train a forest on clouds of actors; folds over people calibrate it.

    Actors who do something else than `ANSWERS` names are learnt as one more class, `OTHER`.

    Parameters
    ----------
    clouds : Collection
        Clouds in windows that begin at random, each as long as a capture.
    radar : Radar
        Radar for which the weights are good.
    seed : int
        Seed of the folds and the forest.

    Returns
    -------
    Recogniser

    Raises
    ------
    InputError
        If a cloud is of a recording.
    """
    if set(clouds.column("source").tolist()) != {"synthetic"}:
        raise InputError("weights that are given away learn from synthetic actors alone")
    lengths = clouds.column("duration_s").astype(float)
    described = np.array(
        [
            describe(cut_windows(clouds.points(index), length)[0])
            for index, length in enumerate(lengths)
        ]
    )
    labels = np.array([ANSWERS.get(label, OTHER) for label in clouds.labels.tolist()])
    names, truth = np.unique(labels, return_inverse=True)
    held_out = np.zeros((len(clouds), len(names)))
    for split in make_splits(clouds, "subject", folds=_FOLDS, seed=seed):
        part = _extra_trees(seed).fit(described[split.train], truth[split.train])
        held_out[split.test] = part.predict_proba(described[split.test])
    recordings, subjects = (clouds.column(name).astype(str) for name in ("recording", "subject"))
    answers = Answers(held_out, truth, recordings, subjects)
    snr_db = clouds.column("snr_db").astype(float)
    card = {
        "classes": names.tolist(),
        "temperature": best_temperature(answers),
        "radar": _limits(radar),
        "snr_db": [float(snr_db.min()), float(snr_db.max())],
        "usual": _usual(described[:, :OUTLINE]),
        "clouds": dict(Counter(clouds.labels.tolist())),
        "people": len(set(subjects.tolist())),
        "held_out_accuracy": balanced_accuracy(answers),
        "seed": seed,
    }
    return Recogniser(arrays_of(_extra_trees(seed).fit(described, truth)), card)


def _extra_trees(seed: int) -> ExtraTreesClassifier:
    return ExtraTreesClassifier(
        _TREES,
        class_weight="balanced",
        min_samples_leaf=_LEAST_IN_LEAF,
        random_state=word(seed),
    )


def arrays_of(forest: ExtraTreesClassifier) -> dict[str, NDArray[Any]]:
    """Return the arrays of a `Recogniser` for a forest of scikit-learn."""
    trees = [estimator.tree_ for estimator in forest.estimators_]
    sizes = [tree.node_count for tree in trees]
    roots = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    chances = np.concatenate([tree.value[:, 0] for tree in trees])
    below, above = (
        np.concatenate(
            [
                np.maximum(getattr(tree, side), 0) + root
                for tree, root in zip(trees, roots, strict=True)
            ]
        )
        for side in ("children_left", "children_right")
    )
    return {
        "roots": roots,
        "feature": np.concatenate([np.maximum(tree.feature, -1) for tree in trees]),
        "threshold": np.concatenate([tree.threshold for tree in trees]),
        "below": below,
        "above": above,
        "chances": chances / chances.sum(axis=1, keepdims=True),
    }


def _usual(described: NDArray[np.float64]) -> dict[str, Any]:
    mean, covariance = described.mean(axis=0), np.cov(described.T)
    inverse = np.linalg.inv(covariance + np.diag(_RIDGE * np.diag(covariance) + 1e-9))
    away = described - mean
    distances = np.sqrt(np.einsum("wi,ij,wj->w", away, inverse, away))
    most = float(np.quantile(distances, _USUAL))
    return {"mean": mean, "inverse_covariance": inverse, "most": most}


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


def with_temperature(probabilities: NDArray[np.float64], temperature: float) -> NDArray[np.float64]:
    """Divide the logarithms of probabilities (answer, class) by a temperature."""
    logits = np.log(np.maximum(probabilities, 1e-12)) / temperature
    scaled = np.exp(logits - logits.max(axis=1, keepdims=True))
    return np.asarray(scaled / scaled.sum(axis=1, keepdims=True))


def best_temperature(answers: Answers) -> float:
    """Return the temperature at which the mean logarithm of the true probabilities is largest."""
    rows = np.arange(len(answers.truth))

    def loss(log_temperature: float) -> float:
        scaled = with_temperature(answers.probabilities, float(np.exp(log_temperature)))
        return -float(np.mean(np.log(np.maximum(scaled[rows, answers.truth], 1e-12))))

    return float(np.exp(minimize_scalar(loss, bounds=(-3.0, 3.0), method="bounded").x))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT", help="folder of clouds and weights")
    parser.add_argument("--install", action="store_true", help="replace the package's weights")
    options = parser.parse_args()
    began, folders = time.perf_counter(), [options.out / name for name in NAMES]
    for folder in folders:
        words = ["dataset", "build", str(DATA_SETS / f"{folder.name}.toml"), "--out", str(folder)]
        subprocess.run([sys.executable, "-m", "rtradar", *words], check=True)
    built = time.perf_counter()
    radar = Radar.load(DATA_SETS / "few_channels.toml")
    recogniser = train_recogniser(Collection(*folders), radar)
    path = options.out / "weights.npz"
    recogniser.save(path)
    print(
        f"clouds {built - began:.0f} s, training {time.perf_counter() - built:.0f} s; "
        f"{recogniser.card['held_out_accuracy']:.1%} of actors that were left out are known; "
        f"{path} has {path.stat().st_size / 1e6:.2f} MB"
    )
    if options.install:
        shutil.copy(path, WEIGHTS)
    return 0


if __name__ == "__main__":
    sys.exit(main())
