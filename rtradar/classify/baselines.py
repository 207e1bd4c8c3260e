"""Baselines on the same splits: simple classifiers that a network should outperform."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.ensemble import RandomForestClassifier
from sklearn.neighbors import NearestCentroid
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from tqdm import tqdm

from rtradar.classify.features import metadata_features, rdt_features, spatial_features
from rtradar.classify.splits import make_splits, values_of
from rtradar.classify.store import Outcome, outcome_of
from rtradar.classify.study import Study, classes_of, learnt_from
from rtradar.clouds.collection import Collection
from rtradar.errors import InputError
from rtradar.system.seeds import word


def _centroid(seed: int) -> BaseEstimator:
    return make_pipeline(StandardScaler(), NearestCentroid())


def _forest(seed: int) -> BaseEstimator:
    return RandomForestClassifier(n_estimators=300, random_state=word(seed))


BASELINES: dict[
    str, tuple[Callable[[Collection], NDArray[np.float64]], Callable[[int], BaseEstimator]]
] = {
    "nearest centroid, RDT cloud": (rdt_features, _centroid),
    "random forest, RDT cloud": (rdt_features, _forest),
    "nearest centroid, spatial cloud": (spatial_features, _centroid),
    "random forest, spatial cloud": (spatial_features, _forest),
    "random forest, metadata alone": (metadata_features, _forest),
}
"""Features and classifier of each baseline.

The last should be at chance, otherwise the provenance reveals the class.
"""


def judge_baselines(clouds: Collection, study: Study) -> dict[str, list[Outcome]]:
    """Evaluate every baseline on those splits of a study that are trained.

    Parameters
    ----------
    clouds : Collection
        Clouds of the study.
    study : Study
        Study to compare with.

    Returns
    -------
    dict
        An `Outcome` for each split, by the name in `BASELINES`.

    Raises
    ------
    InputError
        If the clouds are not those of the study.
    """
    plan = study.plan
    if not learnt_from(plan, clouds):
        raise InputError(
            f"the clouds are not those that '{study.folder}' learnt from; "
            "name their folder (--data)"
        )
    trained = {outcome.name for outcome in study.outcomes}
    splits = make_splits(clouds, plan["split"], folds=plan["folds"], seed=plan["seed"])
    splits = [split for split in splits if split.name in trained]
    values = values_of(clouds, plan["split"])
    _, truth = classes_of(clouds)
    found: dict[str, list[Outcome]] = {}
    made: dict[Callable[[Collection], NDArray[np.float64]], NDArray[np.float64]] = {}
    with tqdm(BASELINES.items(), unit="baseline", disable=None) as bar:
        for name, (features_of, make) in bar:
            bar.set_description(name)
            if features_of not in made:
                made[features_of] = features_of(clouds)
            features = made[features_of]
            found[name] = []
            for split in splits:
                model = make(plan["seed"])
                with warnings.catch_warnings():
                    # Nearest centroid needs the spread within a class only to shrink.
                    warnings.filterwarnings(
                        "ignore", message=".*within_class_std_dev_", category=UserWarning
                    )
                    predicted = model.fit(features[split.train], truth[split.train]).predict(
                        features[split.test]
                    )
                found[name].append(outcome_of(clouds, split, values, truth, predicted))
    return found
