"""Descriptions of windows: what they do not depend on, and windows that hardly have points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rtradar.recognition.recogniser import OUTLINE, describe, envelopes, occupancy, outline


def window(n_points: int, seed: int = 0) -> NDArray[np.float64]:
    """Points of somebody who swings, in 1.4 s."""
    random = np.random.default_rng(seed)
    time = random.uniform(0, 1.4, n_points)
    velocity = 2 * np.sin(5 * time) + random.normal(0, 0.5, n_points)
    return np.stack([time, 4 + 0.2 * np.cos(5 * time), velocity], axis=1)


def test_a_description_has_three_parts() -> None:
    points = window(500)
    found = describe(points)
    assert len(outline(points)) == OUTLINE
    assert found == pytest.approx([*outline(points), *envelopes(points), *occupancy(points)])


@given(st.floats(-10, 10), st.floats(-3, 3), st.integers(0, 9))
def test_when_and_where_do_not_matter(later_s: float, farther_m: float, seed: int) -> None:
    points = window(300, seed)
    moved = points + np.array([later_s, farther_m, 0.0])
    order = np.random.default_rng(seed).permutation(len(points))
    assert describe(moved[order]) == pytest.approx(describe(points), abs=1e-8)  # rounding


def test_cells_hold_all_points() -> None:
    assert np.sum(occupancy(window(400)) ** 2) == pytest.approx(1)


def test_a_shift_of_the_swing_leaves_the_statistics_of_envelopes() -> None:
    time = np.repeat(np.arange(140) / 100 + 0.005, 10)
    speeds = [np.sin(2 * np.pi * (time / 0.7 - late)) for late in (0.0, 1 / 7)]
    first, second = (np.stack([time, np.full(1400, 4.0), speed], axis=1) for speed in speeds)
    # Means, deviations, extremes and quartiles: the same slices in another order.
    assert envelopes(second)[:66] == pytest.approx(envelopes(first)[:66], abs=1e-9)


@pytest.mark.parametrize("n_points", [1, 2, 24])
def test_few_or_equal_points_are_described(n_points: int) -> None:
    for points in (window(n_points), np.tile([[0.5, 4.0, 1.0]], (n_points, 1))):
        assert np.isfinite(describe(points)).all()
