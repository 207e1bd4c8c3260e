"""The trainings of table 4 done anew, which takes about a day on two cores and minutes on a GPU."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.campaign import build_dataset
from rtradar.classify.outcomes import Outcome, confusion
from rtradar.classify.recipes import LEAN, PAPER
from rtradar.classify.study import Study, train_study
from rtradar.classify.training import pick_device, pick_precision
from rtradar.clouds.collection import Collection
from rtradar.paper.learning import SIZES
from rtradar.report.pages.evaluation import draw_confusion, draw_learning
from rtradar.system.seeds import stream
from rtradar.validate.claims import validation_folder

_FIRST_TRIAL = PAPER.changed(rate=1e-6, stop_below=0.0)


class SpatialClouds(Collection):
    """The spatial clouds of a data set, in the place of its RDT clouds.

    Points are drawn with replacement where a cloud has fewer than are asked for.

    Parameters
    ----------
    *folders : path
        Folders made by ``rtradar dataset build``.
    """

    def points(self, index: int) -> NDArray[np.float64]:
        """Draw x, y and z [m] of points of the spatial cloud, (point, 3), for one sample."""
        points = self.spatial(index)
        random = np.random.default_rng(stream(0, index))
        count = int(SIZES[-1])
        few = len(points) < count
        return points[random.choice(len(points), count, replace=few)] if len(points) else points


def train_anew(out: Path) -> dict[str, Any]:
    """Build the 400 clouds and train the paper's network on them; started again it goes on.

    Parameters
    ----------
    out : path
        Folder of the pictures, with ``full-*`` folders for clouds and trainings.

    Returns
    -------
    dict
        Entries of the stored result.
    """
    data = out / "full-clouds"
    build_dataset(validation_folder() / "paper_400.toml", data)
    clouds = Collection(data)
    found: dict[str, Any] = {"ours": {}, "lean": {}}
    device = pick_device("auto")
    precision = pick_precision(device)
    studies: dict[str, Study] = {}
    for name, recipe in (("ours", PAPER), ("lean", LEAN)):
        for size in SIZES:
            own = recipe.changed(points=int(size), precision=precision)
            studies[size] = study = train_study(
                clouds, out / f"full-{name}-{size}", own, device=device
            )
            each = _percent(study)
            spread = float(np.std(each, ddof=1))
            row = {"mean": float(np.mean(each)), "spread": spread, "folds": len(each), "each": each}
            found[name][size] = row if name == "ours" else row["mean"]
        if name == "ours":
            _draw_best(out, studies["1000"])
    first = partial(train_study, clouds, only=[1], device=device)
    trial = first(out / "full-first-trial", _FIRST_TRIAL)
    draw_learning(out / "figure-14.png", [trial.outcomes[0].history], "Learning rate 1e-6")
    found["first_trial"] = {"epochs": _FIRST_TRIAL.epochs_run, "test": _percent(trial)[0]}
    longer = PAPER.changed(stop_below=0.0, precision=precision)
    long = first(out / "full-all-epochs", longer).outcomes[0]
    draw_learning(out / "figure-15.png", [long.history], "Learning rate 1e-4")
    found["all_epochs"] = _course(long)
    return found


def _percent(study: Study) -> list[float]:
    return [100 * outcome.accuracy for outcome in study.outcomes]


def _draw_best(out: Path, study: Study) -> None:
    """Draw the confusion matrix of the best fold, as the paper does."""
    best = max(study.outcomes, key=lambda outcome: outcome.accuracy)
    names = study.plan["classes"]
    draw_confusion(out / "figure-16.png", confusion([best], len(names)), names, "Best of ten folds")


def _course(outcome: Outcome) -> dict[str, float]:
    """Return loss and accuracies after 200 epochs, and the test accuracy of epochs 61 to 70."""
    rows = outcome.history
    early = np.mean([row["test_accuracy"] for row in rows[60:70]])
    last = rows[-1]
    return {
        "loss": last["train_loss"],
        "train": 100 * last["train_accuracy"],
        "test_early": 100 * float(early),
        "test_last": 100 * last["test_accuracy"],
    }
