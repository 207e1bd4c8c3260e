"""Outcomes of trainings: predictions for test clouds, their files, and their scores as tables."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.classify.scores import Answers
from rtradar.classify.splits import Split
from rtradar.clouds.collection import Collection
from rtradar.errors import InputError
from rtradar.system.files import atomic_file, read_json

HISTORY = ("rate", "train_loss", "train_accuracy", "test_loss", "test_accuracy", "seconds")
"""Quantities measured in every epoch."""

_MAX_CHARACTERS = 100_000_000
_COLUMNS = dict.fromkeys(("indices", "truth", "predicted"), np.int64) | dict.fromkeys(
    ("tested_on", "recordings"), np.str_
)


@dataclass(frozen=True)
class Outcome:
    """Predictions of a classifier for the test clouds of one split.

    Parameters
    ----------
    name, trained_on : str
        Name and training value of the `Split`.
    indices : (test,) int64
        Indices of the test clouds.
    truth, predicted : (test,) int64
        True and predicted class numbers.
    tested_on : (test,) str
        Value of the column that the scheme ``across`` compares; empty strings for other schemes.
    recordings : (test,) str
        Recording of each cloud. Clouds of one recording are not independent evidence.
    history : list of dict
        One entry for each epoch, with the entries of `HISTORY`; empty for classifiers without
        epochs.
    subjects : (test,) str
        Who each cloud is of, and
    probabilities : (test, class) float64
        the probability that the classifier gave each class; both are empty in older files.
    """

    name: str
    trained_on: str
    indices: NDArray[np.int64]
    truth: NDArray[np.int64]
    predicted: NDArray[np.int64]
    tested_on: NDArray[np.str_]
    recordings: NDArray[np.str_]
    history: list[dict[str, float]] = field(default_factory=list)
    subjects: NDArray[np.str_] = field(default_factory=lambda: np.zeros(0, np.str_))
    probabilities: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def accuracy(self) -> float:
        """Fraction of correct predictions."""
        return float(np.mean(self.truth == self.predicted))

    @property
    def answers(self) -> Answers | None:
        """What `rtradar.classify.scores` judges; None if probabilities were not kept."""
        if not len(self.probabilities):
            return None
        return Answers(self.probabilities, self.truth, self.recordings, self.subjects)

    @property
    def seconds(self) -> float:
        """Duration of the training [s]."""
        return sum(row["seconds"] for row in self.history)

    def as_dict(self) -> dict[str, Any]:
        """Return the fields by name as plain values."""
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in vars(self).items()
        }


def outcome_of(
    clouds: Collection,
    split: Split,
    values: NDArray[np.str_],
    truth: NDArray[np.int64],
    probabilities: NDArray[np.floating],
    history: Sequence[dict[str, float]] = (),
) -> Outcome:
    """Outcome of ``probabilities (test, class)``.

    ``values`` (see `values_of`) and ``truth`` are (cloud,).
    """
    test, chances = split.test, np.asarray(probabilities, dtype=np.float64)
    recordings, subjects = (
        clouds.column(name).astype(str)[test] for name in ("recording", "subject")
    )
    columns = (test, truth[test], chances.argmax(axis=1), values[test], recordings)
    return Outcome(split.name, split.trained_on, *columns, list(history), subjects, chances)


def save_outcome(path: Path, outcome: Outcome) -> None:
    """Write an outcome as JSON."""
    with atomic_file(path) as file:
        file.write((json.dumps(outcome.as_dict()) + "\n").encode())


def load_outcome(path: Path) -> Outcome:
    """Read an outcome; InputError if it cannot be read or is damaged."""
    try:
        content = read_json(path)
        content = {"subjects": [], "probabilities": []} | content
        columns = {name: _column(content[name], dtype) for name, dtype in _COLUMNS.items()}
        columns["subjects"] = _column(content["subjects"], np.str_)
        columns["probabilities"] = _chances(content["probabilities"], len(columns["subjects"]))
        outcome = Outcome(**content | columns)
        if not _is_whole(outcome):
            raise ValueError
        return outcome
    except (OSError, ValueError, KeyError, TypeError, OverflowError):
        raise InputError(
            f"'{path}' is damaged; remove it and train again: "
            "what is done is kept in its checkpoint"
        ) from None


def _column(values: Any, dtype: Any) -> NDArray[Any]:
    """Array of one value for each cloud; TypeError or ValueError for another type or huge names."""
    expected = str if dtype is np.str_ else int
    if not isinstance(values, list) or not all(type(one) is expected for one in values):
        raise TypeError
    # NumPy allocates the length of the longest name for every name.
    if dtype is np.str_ and len(values) * max(map(len, values), default=0) > _MAX_CHARACTERS:
        raise ValueError
    return np.array(values, dtype=dtype)


def _chances(values: Any, count: int) -> NDArray[np.float64]:
    """Array (test, class) of probabilities, or an empty one; ValueError for any other."""
    if not isinstance(values, list) or len(values) != count:
        raise ValueError
    if not values:
        return np.zeros((0, 0))
    found = np.array(values, dtype=np.float64)
    if found.ndim != 2 or not np.all((found >= 0) & (found <= 1 + 1e-6)):
        raise ValueError
    return found


def _is_number(value: Any) -> bool:
    """Return whether a value is a number; NaN and infinity are, as a training may diverge."""
    return isinstance(value, float) or (isinstance(value, int) and abs(value) < 2**53)


def _is_whole(outcome: Outcome) -> bool:
    """Return whether all fields are present and of their types."""
    columns = [getattr(outcome, name) for name in _COLUMNS]
    return (
        isinstance(outcome.name, str)
        and isinstance(outcome.trained_on, str)
        and all(column.shape == (len(outcome.truth),) for column in columns)
        and len(outcome.subjects) in (0, len(outcome.truth))
        and len(outcome.truth) > 0
        and min(outcome.indices.min(), outcome.truth.min(), outcome.predicted.min()) >= 0
        and isinstance(outcome.history, list)
        and all(isinstance(row, dict) and set(row) == set(HISTORY) for row in outcome.history)
        and all(_is_number(value) for row in outcome.history for value in row.values())
    )


TABLE_4 = {
    500: (94.9, 87.2, 92.3, 69.2, 87.2, 84.6, 84.6, 92.3, 87.2, 76.9),
    1000: (87.2, 94.9, 92.3, 92.3, 79.5, 92.3, 94.9, 87.2, 92.3, 87.2),
    2000: (94.9, 89.7, 92.3, 76.9, 94.9, 87.2, 87.2, 94.9, 87.2, 82.1),
    3000: (82.1, 79.5, 87.2, 74.4, 71.8, 71.8, 84.6, 84.6, 87.2, 74.4),
}
"""Test accuracies of the ten folds [%] by points of a cloud, from the paper's Table 4."""

_MAX_COLUMNS = 12


def summary(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Summarise accuracies: mean, standard deviation, extremes, quartiles, sample sizes."""
    fractions = np.array([outcome.accuracy for outcome in outcomes])
    quartiles = np.percentile(fractions, [25, 50, 75])
    return {
        "trainings": len(fractions),
        "mean": float(fractions.mean()),
        "spread": float(fractions.std(ddof=1)) if len(fractions) > 1 else None,
        "least": float(fractions.min()),
        "quartiles": quartiles.tolist(),
        "most": float(fractions.max()),
        "test_clouds": sum(len(outcome.truth) for outcome in outcomes),
        "test_recordings": len(set().union(*(outcome.recordings.tolist() for outcome in outcomes))),
        "seconds": sum(outcome.seconds for outcome in outcomes),
    }


def confusion(outcomes: Sequence[Outcome], n_classes: int) -> NDArray[np.int64]:
    """Count test clouds by true and predicted class, (truth, prediction), over all trainings."""
    counts = np.zeros((n_classes, n_classes), dtype=np.int64)
    for outcome in outcomes:
        np.add.at(counts, (outcome.truth, outcome.predicted), 1)
    return counts


def recordings_of(outcomes: Sequence[Outcome], n_classes: int) -> list[int]:
    """Count the independent recordings behind the test clouds of each class."""
    pairs = {pair for one in outcomes for pair in zip(one.truth, one.recordings, strict=True)}
    return np.bincount([shown for shown, _ in pairs], minlength=n_classes).tolist()


def transfer(
    outcomes: Sequence[Outcome],
) -> tuple[list[str], NDArray[np.float64], NDArray[np.float64]]:
    """Compute the accuracy for each pair of training and test value of the scheme ``across``.

    Returns the values of the column, the mean accuracy (trained_on, tested_on) over the folds, and
    its standard deviation; both are NaN if there is none.
    """
    values = sorted(
        {outcome.trained_on for outcome in outcomes}
        | {str(value) for one in outcomes for value in one.tested_on}
    )
    mean, spread = np.full((2, len(values), len(values)), np.nan)
    for row, trained_on in enumerate(values):
        for column, tested_on in enumerate(values):
            fractions = [
                float(np.mean(one.truth[asked] == one.predicted[asked]))
                for one in outcomes
                if one.trained_on == trained_on and (asked := one.tested_on == tested_on).any()
            ]
            if fractions:
                mean[row, column] = np.mean(fractions)
            if len(fractions) > 1:
                spread[row, column] = np.std(fractions, ddof=1)
    return values, mean, spread


def accuracy_table(rows: Sequence[tuple[str, Sequence[float], str]]) -> str:
    """Format rows of title, accuracies and remark as a table like the paper's Table 4.

    Accuracies are between 0 and 1, one for each training. Of more than `_MAX_COLUMNS` trainings
    only mean and spread are shown.
    """
    width = max(len("accuracy in %"), *(len(title) for title, _, _ in rows))
    columns = max((len(each) for _, each, _ in rows if len(each) <= _MAX_COLUMNS), default=0)
    numbers = "".join(f"{number:>6}" for number in range(1, columns + 1))
    lines = [f"{'accuracy in %':<{width}}  {numbers}    mean  spread"]
    for title, fractions, remark in rows:
        spread = f"{100 * np.std(fractions, ddof=1):8.1f}" if len(fractions) > 1 else f"{'-':>8}"
        each = f"  {len(fractions)} trainings"
        if len(fractions) <= columns:
            each = "".join(f"{100 * fraction:6.1f}" for fraction in fractions)
        row = f"{title:<{width}}  {each:<{6 * columns}}{100 * np.mean(fractions):8.1f}{spread}"
        lines.append(f"{row}  {remark}" if remark else row)
    return "\n".join(lines)


def confusion_table(
    counts: NDArray[np.int64], classes: Sequence[str], recordings: Sequence[int]
) -> str:
    """Format a confusion matrix (true class down, predicted class across) with recordings."""
    width = max(8, *(len(name) for name in classes)) + 2
    head = "".join(f"{name:>{width}}" for name in classes)
    lines = [f"{'shows':<{width}}{head}  right  recordings"]
    for name, row, own, number in zip(classes, counts, np.diag(counts), recordings, strict=True):
        right = f"{own / row.sum():7.1%}" if row.sum() else f"{'-':>7}"
        cells = "".join(f"{count:>{width}}" for count in row)
        lines.append(f"{name:<{width}}{cells}{right}{number:>12}")
    return "\n".join(lines)


def transfer_table(
    values: Sequence[str], mean: NDArray[np.float64], spread: NDArray[np.float64]
) -> str:
    """Format accuracies and spreads [%] by training value (down) and test value (across)."""
    width = max(14, *(len(value) for value in values)) + 2
    lines = [f"{'trained on':<{width}}" + "".join(f"{value:>{width}}" for value in values)]
    for value, fractions, errors in zip(values, mean, spread, strict=True):
        cells = []
        for fraction, error in zip(fractions, errors, strict=True):
            spread_text = "" if np.isnan(error) else f" +- {100 * error:.1f}"
            cells.append("-" if np.isnan(fraction) else f"{100 * fraction:.1f}{spread_text}")
        lines.append(f"{value:<{width}}" + "".join(f"{cell:>{width}}" for cell in cells))
    return "\n".join(lines)
