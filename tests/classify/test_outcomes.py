from __future__ import annotations

import numpy as np
import pytest

from rtradar.classify.outcomes import (
    TABLE_4,
    Outcome,
    accuracy_table,
    confusion,
    confusion_table,
    recordings_of,
    summary,
    transfer,
    transfer_table,
)


def outcome(
    truth: list[int], predicted: list[int], trained_on: str = "", tested_on: str = ""
) -> Outcome:
    asked = np.array(list(tested_on)) if tested_on else np.full(len(truth), "")
    return Outcome(
        "fold 1",
        trained_on,
        np.arange(len(truth)),
        np.array(truth),
        np.array(predicted),
        asked,
        np.array(["a", "b"])[np.arange(len(truth)) % 2],
    )


def test_the_papers_table_has_the_papers_means() -> None:
    means = {points: np.mean(folds) for points, folds in TABLE_4.items()}
    assert means == pytest.approx({500: 85.6, 1000: 90.0, 2000: 88.7, 3000: 79.8}, abs=0.051)


def test_right_answers_are_counted() -> None:
    outcomes = [outcome([0, 0, 1, 1], [0, 1, 1, 1]), outcome([0, 1], [0, 1])]
    said = summary(outcomes)
    assert (said["mean"], said["least"], said["most"]) == (0.875, 0.75, 1.0)
    assert said["spread"] == pytest.approx(0.25 / np.sqrt(2))
    assert (said["test_clouds"], said["test_recordings"]) == (6, 2)
    counts = confusion(outcomes, 3)
    assert counts.tolist() == [[2, 1, 0], [0, 3, 0], [0, 0, 0]]
    table = confusion_table(counts, ("kick", "walk", "punch"), recordings_of(outcomes, 3))
    assert table.splitlines()[1].split() == ["kick", "2", "1", "0", "66.7%", "2"]
    assert table.splitlines()[3].split() == ["punch", "0", "0", "0", "-", "0"]


def test_one_training_has_no_spread() -> None:
    assert summary([outcome([0], [0])])["spread"] is None
    assert accuracy_table([("a", [0.5], ""), ("b", [1.0, 0.5], "half")]).splitlines()[1:] == [
        "a               50.0        50.0       -",
        "b              100.0  50.0  75.0    35.4  half",
    ]


def test_every_value_is_asked_by_every_other() -> None:
    outcomes = [
        outcome([0, 0, 1, 1], [0, 0, 1, 0], "a", "aabb"),
        outcome([0, 0, 1, 1], [1, 0, 1, 0], "a", "aabb"),
        outcome([0, 0, 1, 1], [1, 1, 1, 1], "b", "aabb"),
    ]
    values, mean, spread = transfer(outcomes)
    assert values == ["a", "b"]
    assert mean.tolist() == [[0.75, 0.5], [0.0, 1.0]]
    assert spread[0].tolist() == pytest.approx([0.25 * np.sqrt(2), 0.0])
    assert np.isnan(spread[1]).all()
    assert transfer_table(values, mean, spread).splitlines()[1].split() == [
        "a",
        "75.0",
        "+-",
        "35.4",
        "50.0",
        "+-",
        "0.0",
    ]
