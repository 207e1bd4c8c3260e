"""The trainings of table 4 done anew, which takes some 18 hours on two cores."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rtradar.campaign import build_dataset
from rtradar.classify.outcomes import Outcome, confusion
from rtradar.classify.recipes import LEAN, PAPER, Precision
from rtradar.classify.study import Study, train_study
from rtradar.classify.training import pick_device, pick_precision
from rtradar.clouds.collection import Collection
from rtradar.paper.items import CURVES, SIZES
from rtradar.system.seeds import stream
from rtradar.validate import validation_folder

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
        # The random stream depends only on the sample, so its points are the same whenever they are
        # read.
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
    # Each recipe is trained at every size of a cloud.
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
            found["best"] = _best(studies["1000"])
            found["spatial"] = _of_spatial_clouds(data, out, studies["1000"], precision, device)
    # Two single trainings of the first fold give the curves that the paper shows.
    first = partial(train_study, clouds, only=[1], device=device)
    trial = first(out / "full-first-trial", _FIRST_TRIAL).outcomes[0]
    longer = PAPER.changed(stop_below=0.0, precision=precision)
    long = first(out / "full-all-epochs", longer).outcomes[0]
    return found | {"first_trial": _course(trial), "all_epochs": _course(long)}


def _of_spatial_clouds(
    data: Path, out: Path, rdt: Study, precision: Precision, device: torch.device
) -> dict[str, Any]:
    """Train on spatial clouds as the paper tried it, beside RDT clouds of the same captures."""
    # Each cloud is scaled by one number, because x, y and z are alike.
    recipe = PAPER.changed(scaling="unit-sphere", precision=precision)
    clouds = SpatialClouds(data)
    study = train_study(clouds, out / "full-spatial", recipe, device=device)
    return {
        "points": recipe.points,
        "clouds": len(clouds),
        "spatial": float(np.mean(_percent(study))),
        "rdt": float(np.mean(_percent(rdt))),
        "answers": sum(len(one.truth) for one in study.outcomes),
    }


def _percent(study: Study) -> list[float]:
    return [100 * outcome.accuracy for outcome in study.outcomes]


def _best(study: Study) -> dict[str, Any]:
    """Return the counts (truth, answer) of the best fold, of which the paper shows the matrix."""
    best = max(study.outcomes, key=lambda outcome: outcome.accuracy)
    names = list(study.plan["classes"])
    return {"classes": names, "counts": confusion([best], len(names)).tolist()}


def _course(outcome: Outcome) -> dict[str, list[float]]:
    """Return loss and accuracy of training and test, epoch by epoch."""
    return {key: [round(row[key], 4) for row in outcome.history] for key in CURVES}
