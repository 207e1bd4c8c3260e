"""Outcomes of trainings: predictions for test clouds, their files, their scores and tables of them.

Clouds of one recording are not independent evidence, nor are recordings of one person. So answers
about windows are averaged over the recording, recordings are counted, each class with the same
weight (balanced accuracy, the mean of the recalls), and intervals come from drawing people.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.cards import text_table
from rtradar.classify.splits import Split
from rtradar.clouds.collection import Collection
from rtradar.errors import InputError
from rtradar.system.files import atomic_file, read_json
from rtradar.system.seeds import stream

HISTORY = ("rate", "train_loss", "train_accuracy", "test_loss", "test_accuracy", "seconds")
"""Quantities measured in every epoch."""

_MAX_CHARACTERS = 100_000_000
_KINDS = {
    "indices": "i", "truth": "i", "predicted": "i", "tested_on": "U", "recordings": "U",
    "subjects": "U", "probabilities": "f",
}  # fmt: skip
"""Kind of each array, in NumPy's letters."""

_LATER = ("subjects", "probabilities")
"""Arrays that are empty in older files, both or none."""


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
        """What `rtradar.classify.outcomes` judges; None if probabilities were not kept."""
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
        outcome = Outcome(**read_json(path))
        count = len(outcome.truth)
        arrays: dict[str, Any] = {
            name: _array(name, getattr(outcome, name), count) for name in _KINDS
        }
        rows = [[row[name] for name in HISTORY] for row in outcome.history]
        whole = (
            isinstance(outcome.name, str)
            and isinstance(outcome.trained_on, str)
            and len(arrays["subjects"]) == len(arrays["probabilities"])
            and isinstance(outcome.history, list)
            and all(len(row) == len(HISTORY) for row in outcome.history)
            and np.array(rows).dtype.kind in "if"  # NaN and infinity too: a training may diverge
        )
        if not whole:
            raise ValueError
        return replace(outcome, **arrays)
    except (OSError, ValueError, KeyError, TypeError, OverflowError):
        raise InputError(
            f"'{path}' is damaged; remove it and train again: "
            "what is done is kept in its checkpoint"
        ) from None


def _array(name: str, values: Any, count: int) -> NDArray[Any]:
    """Array of a value, or a row of probabilities, for each cloud; ValueError if it is none."""
    kind = _KINDS[name]
    if not isinstance(values, list | np.ndarray):
        raise ValueError
    if name in _LATER and not len(values):
        return np.zeros(0, np.str_) if kind == "U" else np.zeros((0, 0))
    if kind == "U":
        # NumPy would make texts of numbers, and allocate the length of the longest for every one.
        lengths = [len(value) for value in values if isinstance(value, str)]
        if len(lengths) < len(values) or len(values) * max(lengths, default=0) > _MAX_CHARACTERS:
            raise ValueError
    array = np.array(values, dtype=np.float64 if kind == "f" else None)
    fits = array.dtype.kind == kind and array.ndim == (2 if kind == "f" else 1)
    if not fits or len(array) != count or (kind != "U" and array.min() < 0):
        raise ValueError
    if kind == "f" and not array.max() <= 1 + 1e-6:  # nor is NaN
        raise ValueError
    return array


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
    pairs = [n_classes * one.truth + one.predicted for one in outcomes]
    counts = np.bincount(np.concatenate(pairs), minlength=n_classes**2)
    return counts.reshape(n_classes, n_classes)


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
    import pandas as pd  # slow to import

    rows = [
        (one.trained_on, str(value), np.mean((one.truth == one.predicted)[one.tested_on == value]))
        for one in outcomes
        for value in np.unique(one.tested_on)
    ]
    table = pd.DataFrame(rows, columns=["trained", "tested", "right"])
    values = sorted({*table["trained"], *table["tested"]})
    found = table.groupby(["trained", "tested"])["right"].agg(["mean", "std"])
    square = found.reindex(pd.MultiIndex.from_product([values, values])).to_numpy()
    mean, spread = square.T.reshape(2, len(values), len(values))
    return values, mean, spread


def accuracy_table(rows: Sequence[tuple[str, Sequence[float], str]]) -> str:
    """Format rows of title, accuracies and remark as a table like the paper's Table 4.

    Accuracies are between 0 and 1, one for each training. Of more than `_MAX_COLUMNS` trainings
    only mean and spread are shown.
    """
    columns = max((len(each) for _, each, _ in rows if len(each) <= _MAX_COLUMNS), default=0)
    table = [["accuracy in %", *map(str, range(1, columns + 1)), "mean", "spread", ""]]
    for title, fractions, remark in rows:
        percent = [f"{100 * fraction:.1f}" for fraction in fractions]
        if len(percent) > columns:
            percent, remark = [], f"{len(percent)} trainings {remark}"
        spread = f"{100 * np.std(fractions, ddof=1):.1f}" if len(fractions) > 1 else "-"
        empty = [""] * (columns - len(percent))
        table.append([title, *percent, *empty, f"{100 * np.mean(fractions):.1f}", spread, remark])
    widest = max(len(row[-1]) for row in table)
    # Remarks begin where they stand, unlike figures.
    return text_table([[*row[:-1], row[-1].rstrip().ljust(widest)] for row in table])


def confusion_table(
    counts: NDArray[np.int64], classes: Sequence[str], recordings: Sequence[int]
) -> str:
    """Format a confusion matrix (true class down, predicted class across) with recordings."""
    table = [["shows", *classes, "right", "recordings"]]
    for name, row, own, number in zip(classes, counts, np.diag(counts), recordings, strict=True):
        right = f"{own / row.sum():.1%}" if row.sum() else "-"
        table.append([name, *map(str, row), right, str(number)])
    return text_table(table)


def transfer_table(
    values: Sequence[str], mean: NDArray[np.float64], spread: NDArray[np.float64]
) -> str:
    """Format accuracies and spreads [%] by training value (down) and test value (across)."""

    def cell(fraction: float, error: float) -> str:
        text = "-" if np.isnan(fraction) else f"{100 * fraction:.1f}"
        return text if np.isnan(error) else f"{text} +- {100 * error:.1f}"

    rows = zip(values, mean, spread, strict=True)
    return text_table(
        [["trained on", *values], *([name, *map(cell, *each)] for name, *each in rows)]
    )


_BINS = 10  # of the calibration error
_DRAWS = 2000  # of people


class Answers(NamedTuple):
    """Probabilities ``(answer, class)``, true classes ``(answer,)``, who and which recording."""

    probabilities: NDArray[np.float64]
    truth: NDArray[np.int64]
    recordings: NDArray[np.str_]
    subjects: NDArray[np.str_]

    def by_recording(self) -> Answers:
        """Average the answers about each class of each recording."""
        keys = np.char.add(np.char.add(self.recordings, "\0"), self.truth.astype(str))
        _, first, place = np.unique(keys, return_index=True, return_inverse=True)
        mean = np.zeros((len(first), self.probabilities.shape[1]))
        np.add.at(mean, place, self.probabilities)
        mean /= np.bincount(place)[:, None]
        return Answers(mean, self.truth[first], self.recordings[first], self.subjects[first])


def balanced_accuracy(answers: Answers) -> float:
    """Mean over the classes that are asked about of the fraction that is right."""
    right = answers.probabilities.argmax(axis=1) == answers.truth
    return float(np.mean([right[answers.truth == one].mean() for one in np.unique(answers.truth)]))


def interval(answers: Answers, level: float = 0.95, seed: int = 0) -> tuple[float, float]:
    """Return the interval of the balanced accuracy when other people are asked about.

    Subjects are drawn with replacement (bootstrap), those of each set of activities among
    themselves, so that no class is lost.
    """
    right = answers.probabilities.argmax(axis=1) == answers.truth
    classes, place = np.unique(answers.truth, return_inverse=True)
    subjects, who = np.unique(answers.subjects, return_inverse=True)
    asked, known = np.zeros((2, len(subjects), len(classes)))
    np.add.at(asked, (who, place), 1)
    np.add.at(known, (who, place), right)
    _, kind = np.unique(asked > 0, axis=0, return_inverse=True)
    random = np.random.default_rng(stream(seed))
    found = []
    for _ in range(_DRAWS):
        drawn = np.concatenate(
            [
                random.choice(np.flatnonzero(kind == one), np.count_nonzero(kind == one))
                for one in np.unique(kind)
            ]
        )
        found.append(np.mean(known[drawn].sum(axis=0) / asked[drawn].sum(axis=0)))
    low, high = np.quantile(found, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)


def calibration_error(answers: Answers) -> float:
    """Expected calibration error: how far confidence is from accuracy, over ten bins of it."""
    confidence = answers.probabilities.max(axis=1)
    right = answers.probabilities.argmax(axis=1) == answers.truth
    place = np.minimum((confidence * _BINS).astype(int), _BINS - 1)
    gaps = np.bincount(place, confidence - right, minlength=_BINS)
    return float(np.abs(gaps).sum() / len(right))
