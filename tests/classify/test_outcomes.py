"""What came of a training, in a file that may be damaged, or a stranger's."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rtradar.classify.outcomes import (
    HISTORY,
    TABLE_4,
    Answers,
    Outcome,
    accuracy_table,
    balanced_accuracy,
    confusion,
    confusion_table,
    interval,
    load_outcome,
    recordings_of,
    save_outcome,
    summary,
    transfer,
    transfer_table,
)
from rtradar.errors import InputError


def outcome(
    truth: list[int], predicted: list[int], trained_on: str = "", tested_on: str = ""
) -> Outcome:
    asked = np.array(list(tested_on)) if tested_on else np.full(len(truth), "")
    places = np.arange(len(truth))
    answers = np.array(truth), np.array(predicted)
    return Outcome("fold 1", trained_on, places, *answers, asked, np.array(["a", "b"])[places % 2])


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
    row = transfer_table(values, mean, spread).splitlines()[1]
    assert row.split() == ["a", "75.0", "+-", "35.4", "50.0", "+-", "0.0"]


EPOCH = dict.fromkeys(HISTORY, 0.5)
CLOUDS = 20_000


def example() -> Outcome:
    names = np.array(["a", "b"])
    return Outcome(
        "fold 1", "", np.array([3, 5]), np.array([0, 1]), np.array([0, 0]), names, names, [EPOCH],
        names, np.array([[0.75, 0.25], [1.0, 0.0]]),
    )  # fmt: skip


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    save_outcome(tmp_path / "outcome.json", example())
    assert load_outcome(tmp_path / "outcome.json").as_dict() == example().as_dict()


WRONG: list[dict[str, Any]] = [
    *({"truth": one} for one in ([0.5, 1.0], [None, 1], [True, False], [0, 10**30], [[0], [1]])),
    *({"truth": one} for one in ("01", [])),
    *({"predicted": one} for one in ([0], [0, -1])),
    {"indices": [-1, 1]}, {"recordings": [1, 2]}, {"recordings": {"a": 1, "b": 2}},
    {"subjects": []}, {"subjects": {}, "probabilities": {}}, {"probabilities": []},
    {"probabilities": [[float("nan"), 0.5], [0.5, 0.5]]},
    {"probabilities": [[1.5, 0.5], [0.5, 0.5]]},
    {"name": 3}, {"more": 1}, {"history": {}}, {"history": [[]]}, {"history": [{"rate": 1.0}]},
    {"history": [{**EPOCH, "more": 1.0}]},
    *({"history": [{**EPOCH, "seconds": one}]} for one in ("1", 10**400, None)),
]  # fmt: skip


@pytest.mark.parametrize("changes", WRONG, ids=repr)
def test_what_is_no_outcome_is_damaged(tmp_path: Path, changes: dict[str, Any]) -> None:
    (tmp_path / "outcome.json").write_text(json.dumps(example().as_dict() | changes))
    with pytest.raises(InputError, match="is damaged; remove it"):
        load_outcome(tmp_path / "outcome.json")


@pytest.mark.parametrize(
    "text", ["", "[]", "null", '{"name": "fold 1"', "[" * 10**5, "\xff", '{"truth": [0]}']
)
def test_what_is_no_json_of_ours_is_damaged(tmp_path: Path, text: str) -> None:
    (tmp_path / "outcome.json").write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError, match="is damaged; remove it"):
        load_outcome(tmp_path / "outcome.json")


def test_one_long_name_takes_no_memory_for_all(tmp_path: Path) -> None:
    """NumPy would give each name the room of the longest: 8 GB here, for a file of 0.3 MB."""
    many = {name: [0] * CLOUDS for name in ("indices", "truth", "predicted")}
    changes = many | {
        "recordings": [""] * CLOUDS,
        "tested_on": ["x" * 100_000] + [""] * (CLOUDS - 1),
    }
    (tmp_path / "outcome.json").write_text(json.dumps(example().as_dict() | changes))
    with pytest.raises(InputError, match="is damaged; remove it"):
        load_outcome(tmp_path / "outcome.json")


def answers(chances: list[float], truth: list[int], names: str, people: str) -> Answers:
    """Answers about two classes, from the probability of the first."""
    first = np.array(chances)
    probabilities = np.stack([first, 1 - first], axis=1)
    return Answers(probabilities, np.array(truth), np.array(list(names)), np.array(list(people)))


def test_windows_of_a_recording_are_averaged_for_each_class_that_it_shows() -> None:
    found = answers([0.9, 0.4, 0.1, 0.6], [0, 0, 1, 1], "aaab", "xxxy").by_recording()
    assert found.truth.tolist() == [0, 1, 1]
    assert found.probabilities[:, 0] == pytest.approx([0.65, 0.1, 0.6])
    assert found.subjects.tolist() == ["x", "x", "y"]


def test_classes_count_alike_however_often_they_are_asked_about() -> None:
    assert balanced_accuracy(answers([0.9] * 4, [0, 0, 0, 1], "abcd", "abcd")) == 0.5


def test_intervals_are_those_of_drawing_people() -> None:
    # Each of 16 people is known in all of their four recordings or in none.
    people = "".join(chr(97 + k) * 4 for k in range(16))
    right = np.repeat(np.arange(16) % 4 > 0, 4)
    asked = answers(np.where(right, 0.9, 0.1).tolist(), [0] * 64, people, people)
    low, high = interval(asked)
    # Binomial: 12 of 16 people, 95 % within 1.96 standard deviations, to one person.
    spread = 1.96 * np.sqrt(0.75 * 0.25 / 16)
    assert low == pytest.approx(0.75 - spread, abs=1 / 16)
    assert high == pytest.approx(0.75 + spread, abs=1 / 16)
