from __future__ import annotations

import itertools
import math
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rtradar.classify.baselines import (
    BASELINES,
    axis_features,
    evaluate_baselines,
    metadata_features,
    rdt_features,
    spatial_features,
)
from rtradar.classify.outcomes import outcome_of, summary
from rtradar.classify.splits import make_splits, values_of
from rtradar.classify.study import Study, classes_of, fingerprint, made
from rtradar.errors import InputError


def study_of(clouds: Any) -> Study:
    """As if a network had answered at random."""
    _, truth = classes_of(clouds)
    splits = make_splits(clouds, "folds", folds=3)[:1]
    values = values_of(clouds, "folds")
    outcomes = [
        outcome_of(clouds, one, values, truth, np.eye(3)[truth[one.test]]) for one in splits
    ]
    plan = {"fingerprint": fingerprint(clouds), "made": made(clouds)}
    return Study(Path("study"), plan | {"split": "folds", "folds": 3, "seed": 0}, outcomes)


@pytest.mark.slow
def test_simple_features_tell_made_up_motions_apart_and_metadata_do_not(
    made_up: Callable[..., Any],
) -> None:
    clouds = made_up(per_class=12)
    found = evaluate_baselines(clouds, study_of(clouds))
    assert list(found) == list(BASELINES)
    mean = {name: summary(outcomes)["mean"] for name, outcomes in found.items()}
    assert mean["nearest centroid, RDT cloud"] > 0.9
    assert mean["random forest, RDT cloud"] == 1
    # Three classes: chance is a third, and 12 answers are off by 0.27 in two standard deviations.
    assert mean["random forest, metadata alone"] < 0.61
    assert mean["random forest, spatial cloud"] < 0.61


def test_one_axis_alone_tells_only_what_it_shows(made_up: Callable[..., Any]) -> None:
    clouds = made_up(per_class=4)
    points = clouds.points(0)
    for axis in range(3):
        features = axis_features(clouds, axis)
        assert features.shape == (len(clouds), 17)
        assert np.all(np.diff(features) >= 0)
        moved = points + np.array([0.3, 5.0, 0.7])
        clouds.points = [points, moved, points[:0], *[points] * len(clouds)].__getitem__
        change = axis_features(clouds, axis)
        assert change[1] - change[0] == pytest.approx([0.3, 0.0, 0.7][axis])
        assert not change[2].any()
        clouds = made_up(per_class=4)


def test_other_clouds_are_refused(made_up: Callable[..., Any]) -> None:
    clouds, others = made_up(), made_up()
    for row in others.rows:  # the same intervals by another model
        row["fidelity"] = "specular"
    for wrong in (others, made_up(per_class=5)):
        with pytest.raises(InputError, match="not those that 'study' learnt from"):
            evaluate_baselines(wrong, study_of(clouds))


def test_empty_clouds_and_single_points_have_features(made_up: Callable[..., Any]) -> None:
    clouds = made_up(per_class=1)
    clouds.points = [np.zeros((0, 3)), np.ones((1, 3)), clouds.points(0)].__getitem__
    clouds.spatial = [np.zeros((0, 3)), np.ones((1, 3)), np.ones((4, 3))].__getitem__
    for features in (rdt_features(clouds), spatial_features(clouds)):
        assert features.shape[0] == 3
        assert np.isfinite(features).all()


def shape_of(points: np.ndarray) -> list[float]:
    """Spread, ends, percentiles and correlations by Python's own statistics."""
    columns = [column.tolist() for column in points.T]
    # 5, 10, ... 95 %
    twentieths = [statistics.quantiles(column, n=20, method="inclusive") for column in columns]
    percentiles = [[cuts[number] for cuts in twentieths] for number in (0, 4, 9, 14, 18)]
    pairs = [statistics.correlation(*two) for two in itertools.combinations(columns, 2)]
    ends = [of(column) for of in (statistics.pstdev, min, max) for column in columns]
    return [*ends, *np.ravel(percentiles), *pairs]


def test_features_by_the_book(made_up: Callable[..., Any]) -> None:
    points = np.random.default_rng(5).normal([7.0, 4.0, 0.3], [0.3, 0.2, 1.5], (120, 3))
    clouds = made_up(per_class=1)
    clouds.points = clouds.spatial = lambda index: points
    centred = points - [points[:, 0].mean(), points[:, 1].mean(), 0.0]
    slow = sum(abs(velocity) < 0.5 for velocity in points[:, 2]) / 120
    first, last = points[:, 0].min(), points[:, 0].max()
    eighths: list[list[float]] = [[] for _ in range(8)]
    for time, _, velocity in points:
        eighths[min(int((time - first) / (last - first) * 8), 7)].append(velocity)
    moments = [of(some) for some in eighths for of in (statistics.fmean, statistics.pstdev)]
    # Sums of 120 numbers in another order.
    np.testing.assert_allclose(
        rdt_features(clouds)[2], [*shape_of(centred), slow, *moments], rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(
        spatial_features(clouds)[2], [*shape_of(centred), math.log(121)], rtol=1e-9, atol=1e-12
    )


def test_a_coordinate_that_is_not_measured_has_no_features(made_up: Callable[..., Any]) -> None:
    points = np.random.default_rng(5).normal(size=(50, 3))
    clouds = made_up(per_class=1)
    clouds.spatial = lambda index: points
    whole = spatial_features(clouds)
    flat = points.copy()
    flat[:, 2] = np.nan
    clouds.spatial = lambda index: flat
    found = spatial_features(clouds)
    assert np.isfinite(found).all()
    # Spread, ends and five percentiles are of x, y and z in turn; then the correlations xy, xz and
    # yz, and the number of points.
    of_z = np.array([*([False, False, True] * 8), False, True, True, False])
    np.testing.assert_array_equal(found[:, of_z], 0)
    np.testing.assert_array_equal(found[:, ~of_z], whole[:, ~of_z])


def test_metadata_are_numbers_as_they_are_and_names_a_column_each(
    made_up: Callable[..., Any],
) -> None:
    clouds = made_up(per_class=1)
    told = [(math.inf, [1.0, 2.0], "rays"), (None, [3.0, 4.0], "auto"), (12.5, [5.0, 6.0], "rays")]
    for row, (snr, place, fidelity) in zip(clouds.rows, told, strict=True):
        row |= {"heading_deg": -9.0, "snr_db": snr, "person_position_m": place}
        row["fidelity"] = fidelity
    # Duration, heading, SNR, both of the place, radar, scene, two fidelities; what is infinite or
    # unknown stands far outside.
    np.testing.assert_array_equal(
        metadata_features(clouds),
        [
            [1.0, -9.0, 1e6, 1.0, 2.0, 1.0, 1.0, 0.0, 1.0],
            [1.0, -9.0, -1e6, 3.0, 4.0, 1.0, 1.0, 1.0, 0.0],
            [1.0, -9.0, 12.5, 5.0, 6.0, 1.0, 1.0, 0.0, 1.0],
        ],
    )
