"""Scores: recordings are averaged, classes count alike, and intervals are over people."""

from __future__ import annotations

import numpy as np
import pytest

from rtradar.classify.outcomes import (
    Answers,
    balanced_accuracy,
    interval,
)


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
