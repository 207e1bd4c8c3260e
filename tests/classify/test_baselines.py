from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rtradar.classify.baselines import BASELINES, judge_baselines
from rtradar.classify.features import metadata_features, rdt_features, spatial_features
from rtradar.classify.outcome import Outcome, outcome_of
from rtradar.classify.scores import summary
from rtradar.classify.splits import make_splits, values_of
from rtradar.classify.study import Study, classes_of, fingerprint
from rtradar.errors import InputError


def study_of(clouds: Any) -> Study:
    """As if a network had answered at random."""
    _, truth = classes_of(clouds)
    splits = make_splits(clouds, "folds", folds=3)
    outcomes: list[Outcome] = [
        outcome_of(clouds, split, values_of(clouds, "folds"), truth, truth[split.test]) for split in splits
    ]
    plan = {"fingerprint": fingerprint(clouds), "split": "folds", "folds": 3, "seed": 0}
    return Study(Path("study"), plan, outcomes)


def test_simple_features_tell_made_up_motions_apart_and_metadata_do_not(made_up: Callable[..., Any]) -> None:
    clouds = made_up(per_class=12)
    found = judge_baselines(clouds, study_of(clouds))
    assert list(found) == list(BASELINES)
    mean = {name: summary(outcomes)["mean"] for name, outcomes in found.items()}
    assert mean["nearest centroid, RDT cloud"] > 0.9
    assert mean["random forest, RDT cloud"] == 1
    # Three classes: chance is a third, and 36 answers are off by 0.16 in two of three standard deviations.
    assert mean["random forest, metadata alone"] < 0.6
    assert mean["random forest, spatial cloud"] < 0.6


def test_other_clouds_are_refused(made_up: Callable[..., Any]) -> None:
    with pytest.raises(InputError, match="not those that 'study' learnt from"):
        judge_baselines(made_up(per_class=4), study_of(made_up(per_class=5)))


def test_empty_clouds_and_single_points_have_features(made_up: Callable[..., Any]) -> None:
    clouds = made_up(per_class=1)
    clouds.points = [np.zeros((0, 3)), np.ones((1, 3)), clouds.points(0)].__getitem__
    clouds.spatial = [np.zeros((0, 3)), np.ones((1, 3)), np.ones((4, 3))].__getitem__
    for features in (rdt_features(clouds), spatial_features(clouds)):
        assert features.shape[0] == 3
        assert np.isfinite(features).all()


def test_metadata_of_every_kind_are_numbers(made_up: Callable[..., Any]) -> None:
    clouds = made_up(per_class=2, views=2)
    for row, snr in zip(clouds.rows, [float("inf"), None] * 6, strict=True):
        row["snr_db"] = snr
    features = metadata_features(clouds)
    assert features.shape[0] == 12
    assert np.isfinite(features).all()
    assert len(np.unique(features, axis=1).T) > 3
