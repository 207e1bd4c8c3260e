"""The figures by which measured clouds are compared: exact on clouds that are known."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pytest


@pytest.fixture(scope="module")
def figures(script: Callable[[str], ModuleType]) -> ModuleType:
    return script("measurements/cloud_figures.py")


def test_distances_are_frame_by_frame_and_of_both_clouds(figures: ModuleType) -> None:
    ours = np.array([1.0, 2.0, 5.0, 9.0]), np.array([2, 2, 0, 1])
    theirs = np.array([1.5, 2.5, 5.25]), np.array([2, 2, 0])
    np.testing.assert_allclose(
        figures.distances(ours, theirs, 4), [0.25, np.nan, 0.5, np.nan], atol=1e-12
    )


def test_total_variation_is_the_fraction_that_must_move(figures: ModuleType) -> None:
    first, second = np.array([0, 0, 1, 1]), np.array([0, 1, 1, -2])
    assert figures.variation(first, second) == pytest.approx(0.25)
    assert figures.variation(first, first) == 0
    assert figures.variation(first, first + 5) == 1


def test_means_are_weighted_and_missing_without_points(figures: ModuleType) -> None:
    values, weight = np.array([1, -1, 3]), np.array([3.0, 1.0, 2.0])
    found = figures.weighted_means(values, weight, np.array([0, 0, 2]), 3)
    np.testing.assert_array_equal(found, [0.5, np.nan, 3.0])


def test_the_limb_is_that_of_the_nearest_bone(figures: ModuleType) -> None:
    names = sorted({j for bones in figures.LIMBS.values() for bone in bones for j in bone.split()})
    random = np.random.default_rng(0)
    joints = np.broadcast_to(random.uniform(-1, 1, (len(names), 3)), (5, len(names), 3))
    places = []
    for bones in figures.LIMBS.values():
        begin, end = (joints[0, names.index(joint)] for joint in bones[1].split())
        places.append(0.7 * begin + 0.3 * end)
    found = figures.nearest_limb(np.array(places), joints, tuple(names))
    np.testing.assert_array_equal(found, np.arange(5))


def test_an_interval_is_over_whole_moves(figures: ModuleType) -> None:
    """Of moves that are each constant, frames beyond the first add nothing."""
    few, many = np.arange(6.0), np.arange(6.0).repeat(50)
    move = np.arange(6)
    assert figures.interval(few, move, np.mean) == figures.interval(many, move.repeat(50), np.mean)
    low, high = figures.interval(few, move, np.mean)
    assert 0 <= low < 2.5 < high <= 5


def test_slope_and_correlation_leave_out_what_is_missing(figures: ModuleType) -> None:
    pairs = np.array([[2.0, 1.0], [4.0, 2.0], [np.nan, 3.0], [8.0, 4.0]])
    assert figures.slope(pairs) == pytest.approx(2.0)
    assert figures.correlation(pairs) == pytest.approx(1.0)
