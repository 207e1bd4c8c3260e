"""Arithmetic on given seconds."""

from __future__ import annotations

import pytest

from rtradar.bench.runs import ELSEWHERE, Spread, by_stage, paired_ratio, to_cloud_s, with_elsewhere


def test_best_and_median() -> None:
    assert Spread.of([3.0, 1.0, 2.5]) == Spread(best=1.0, median=2.5)
    assert Spread.of([3.0, 1.0]) == Spread(best=1.0, median=2.0)


def test_what_leads_to_the_cloud_is_all_but_other_products_and_files() -> None:
    stages = {
        "scatter": 1.0,
        "cloud": 0.5,
        "angle": 2.0,
        "spectrogram": 0.25,
        "write": 0.125,
        "pictures": 4.0,
        "report": 8.0,
    }
    # 16.375 s in stages, and 0.125 s elsewhere.
    assert to_cloud_s(stages, wall_s=16.0) == 1.625
    assert with_elsewhere(stages, wall_s=16.0)[ELSEWHERE] == 0.125


def test_stages_that_overlap_leave_nothing_elsewhere() -> None:
    assert with_elsewhere({"a": 2.0, "b": 2.0}, wall_s=3.0) == {"a": 2.0, "b": 2.0, ELSEWHERE: 0.0}


def test_a_stage_that_a_run_lacks_took_it_no_time() -> None:
    found = by_stage([{"a": 1.0}, {"a": 3.0, "b": 1.0}, {"a": 2.0, "b": 5.0}])
    assert found == {"a": Spread(1.0, 2.0), "b": Spread(0.0, 1.0)}
    assert list(found) == ["a", "b"]


def test_ratios_are_of_neighbours() -> None:
    # The third pair was measured in a slow minute, which is no matter.
    assert paired_ratio([2.0, 4.0, 40.0], of=[1.0, 1.0, 20.0]) == 2.0
    with pytest.raises(ValueError, match="shorter"):
        paired_ratio([1.0, 2.0], of=[1.0])
