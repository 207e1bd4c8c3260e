"""Scores of what was answered: by cloud, by recording and by person, with intervals; calibration.

Clouds of one recording are not independent evidence, nor are recordings of one person. So answers
about windows are averaged over the recording, recordings are counted, each class with the same
weight (balanced accuracy, the mean of the recalls), and intervals come from drawing people.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.system.seeds import stream

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
    gaps = [
        abs(float(np.sum(confidence[place == number] - right[place == number])))
        for number in range(_BINS)
    ]
    return sum(gaps) / len(right)


def with_temperature(probabilities: NDArray[np.float64], temperature: float) -> NDArray[np.float64]:
    """Divide the logarithms of probabilities (answer, class) by a temperature."""
    logits = np.log(np.maximum(probabilities, 1e-12)) / temperature
    scaled = np.exp(logits - logits.max(axis=1, keepdims=True))
    return np.asarray(scaled / scaled.sum(axis=1, keepdims=True))


def best_temperature(answers: Answers) -> float:
    """Return the temperature at which the mean logarithm of the true probabilities is largest."""
    from scipy.optimize import minimize_scalar

    rows = np.arange(len(answers.truth))

    def loss(log_temperature: float) -> float:
        scaled = with_temperature(answers.probabilities, float(np.exp(log_temperature)))
        return -float(np.mean(np.log(np.maximum(scaled[rows, answers.truth], 1e-12))))

    return float(np.exp(minimize_scalar(loss, bounds=(-3.0, 3.0), method="bounded").x))
