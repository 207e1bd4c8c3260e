"""Baselines on the same splits: simple classifiers of a few statistics in place of the points.

A network should outperform them.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.ensemble import RandomForestClassifier
from sklearn.neighbors import NearestCentroid
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from tqdm import tqdm

from rtradar.classify.outcomes import Outcome, outcome_of
from rtradar.classify.splits import make_splits, values_of
from rtradar.classify.study import Study, classes_of, learnt_from
from rtradar.clouds.collection import Collection
from rtradar.errors import InputError
from rtradar.recognition.recogniser import correlations, course, statistics
from rtradar.system.seeds import word

METADATA = (
    "duration_s", "heading_deg", "snr_db", "height_m", "build", "tempo", "amplitude", "side",
    "person_position_m", "radar_position_m", "radar", "scene", "fidelity",
)  # fmt: skip
"""Provenance that states how a cloud was made, not what it shows; what is lacking is left out."""


def rdt_features(clouds: Collection) -> NDArray[np.float64]:
    """Compute simple features of RDT clouds, (cloud, feature).

    For time and range from the middle of the cloud and for velocity, these are the standard
    deviation, the minimum, the maximum and the 5th, 25th, 50th, 75th and 95th percentile. Then
    follow the three correlations, the fraction of points slower than 0.5 m/s, and the mean and
    spread of velocity in each eighth of the time. The features of an empty cloud are those of one
    point at zero.
    """
    return np.stack([_rdt(clouds.points(index)) for index in range(len(clouds))])


def spatial_features(clouds: Collection) -> NDArray[np.float64]:
    """Compute simple features of spatial clouds, (cloud, feature).

    For x and y from the middle of the cloud and for z, these are the statistics of `rdt_features`.
    Then follow the three correlations and the logarithm of the number of points plus 1. The
    features of a coordinate that the radar does not measure are 0.
    """
    return np.stack([_spatial(clouds.spatial(index)) for index in range(len(clouds))])


def axis_features(clouds: Collection, axis: int) -> NDArray[np.float64]:
    """Compute 17 quantiles of time, range or velocity (axis 0 to 2) alone, (cloud, quantile).

    Time is that since the start of the interval, range is counted from its median. An empty cloud
    has zeros.
    """
    found = np.zeros((len(clouds), 17))
    for index in range(len(clouds)):
        values = clouds.points(index)[:, axis]
        if len(values):
            found[index] = np.quantile(values, np.linspace(0, 1, 17))
            found[index] -= np.median(values) if axis == 1 else 0.0
    return found


def metadata_features(clouds: Collection) -> NDArray[np.float64]:
    """Return the `METADATA` that all clouds have, (cloud, feature); names are one-hot encoded."""
    columns = [feature for name in METADATA for feature in _metadata(clouds, name)]
    return np.stack(columns, axis=1) if columns else np.zeros((len(clouds), 1))


def _metadata(clouds: Collection, name: str) -> list[NDArray[np.float64]]:
    try:
        column = clouds.column(name).tolist()
    except InputError:  # no sample has this entry
        return []
    try:
        numbers = np.array([np.nan if value is None else value for value in column], np.float64)
    except (TypeError, ValueError):  # names, or lists of several lengths
        names = np.array([str(value) for value in column])
        return [(names == value).astype(np.float64) for value in np.unique(names)]
    # A position has several columns. Infinity (an SNR without noise) and unknown values become
    # finite numbers of their own.
    numbers = np.nan_to_num(numbers.reshape(len(column), -1), nan=-1e6, posinf=1e6, neginf=-1e6)
    return list(numbers.T)


def _rdt(points: NDArray[np.float64]) -> NDArray[np.float64]:
    if not len(points):
        points = np.zeros((1, 3))
    middle = np.array([points[:, 0].mean(), points[:, 1].mean(), 0.0])
    centred = points - middle
    slow = np.mean(np.abs(centred[:, 2]) < 0.5)
    return np.concatenate([_shape(centred), [slow], course(centred).ravel()])


def _spatial(points: NDArray[np.float64]) -> NDArray[np.float64]:
    places = np.nan_to_num(points) if len(points) else np.zeros((1, 3))
    middle = np.array([places[:, 0].mean(), places[:, 1].mean(), 0.0])
    return np.append(_shape(places - middle), np.log(len(points) + 1))


def _shape(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.concatenate([statistics(points).ravel(), correlations(points)])


def _centroid(seed: int) -> BaseEstimator:
    return make_pipeline(StandardScaler(), NearestCentroid())


def _forest(seed: int) -> BaseEstimator:
    return RandomForestClassifier(n_estimators=300, random_state=word(seed))


_Features = Callable[[Collection], NDArray[np.float64]]
BASELINES: dict[str, tuple[_Features, Callable[[int], BaseEstimator]]] = {
    "nearest centroid, RDT cloud": (rdt_features, _centroid),
    "random forest, RDT cloud": (rdt_features, _forest),
    "nearest centroid, spatial cloud": (spatial_features, _centroid),
    "random forest, spatial cloud": (spatial_features, _forest),
    "random forest, time alone": (partial(axis_features, axis=0), _forest),
    "random forest, range alone": (partial(axis_features, axis=1), _forest),
    "random forest, velocity alone": (partial(axis_features, axis=2), _forest),
    "random forest, metadata alone": (metadata_features, _forest),
}
"""Features and classifier of each baseline.

Were that of the metadata not at chance, the provenance would reveal the class. Were that of time
much better on synthetic motion than on recordings that are cut alike, the scripts of the actors
would reveal it."""


def evaluate_baselines(clouds: Collection, study: Study) -> dict[str, list[Outcome]]:
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
    computed: dict[_Features, NDArray[np.float64]] = {}
    with tqdm(BASELINES.items(), unit="baseline", disable=None) as bar:
        for name, (features_of, make) in bar:
            bar.set_description(name)
            if features_of not in computed:
                computed[features_of] = features_of(clouds)
            features = computed[features_of]
            found[name] = []
            for split in splits:
                with warnings.catch_warnings():
                    # Nearest centroid needs the spread within a class only to shrink.
                    spread = ".*within_class_std_dev_"
                    warnings.filterwarnings("ignore", message=spread, category=UserWarning)
                    model = make(plan["seed"]).fit(features[split.train], truth[split.train])
                    chances = model.predict_proba(features[split.test])
                found[name].append(outcome_of(clouds, split, values, truth, chances))
    return found
