"""Scores of outcomes: accuracies, confusion and transfer matrices, as numbers and as tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.classify.store import Outcome

TABLE_4 = {
    500: (94.9, 87.2, 92.3, 69.2, 87.2, 84.6, 84.6, 92.3, 87.2, 76.9),
    1000: (87.2, 94.9, 92.3, 92.3, 79.5, 92.3, 94.9, 87.2, 92.3, 87.2),
    2000: (94.9, 89.7, 92.3, 76.9, 94.9, 87.2, 87.2, 94.9, 87.2, 82.1),
    3000: (82.1, 79.5, 87.2, 74.4, 71.8, 71.8, 84.6, 84.6, 87.2, 74.4),
}
"""Test accuracies of the ten folds [%] by points of a cloud, from the paper's Table 4."""

_MAX_COLUMNS = 12


def accuracies(outcomes: Sequence[Outcome]) -> NDArray[np.float64]:
    """Return the accuracy of each outcome, (training,)."""
    return np.array([outcome.accuracy for outcome in outcomes])


def summary(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """Summarise accuracies: mean, standard deviation, extremes, quartiles, sample sizes."""
    shares = accuracies(outcomes)
    quartiles = np.percentile(shares, [25, 50, 75])
    return {
        "trainings": len(shares),
        "mean": float(shares.mean()),
        "spread": float(shares.std(ddof=1)) if len(shares) > 1 else None,
        "least": float(shares.min()),
        "quartiles": quartiles.tolist(),
        "most": float(shares.max()),
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
    found: list[set[str]] = [set() for _ in range(n_classes)]
    for outcome in outcomes:
        for shown, recording in zip(
            outcome.truth.tolist(), outcome.recordings.tolist(), strict=True
        ):
            found[shown].add(recording)
    return [len(names) for names in found]


def transfer(
    outcomes: Sequence[Outcome],
) -> tuple[list[str], NDArray[np.float64], NDArray[np.float64]]:
    """Compute the accuracy for each pair of training value and test value of a column.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Outcomes of the scheme ``across``.

    Returns
    -------
    values : list of str
        Values of the column.
    mean, spread : (trained_on, tested_on) float64
        Mean accuracy over the folds and its standard deviation, NaN if there is none.
    """
    values = sorted(
        {outcome.trained_on for outcome in outcomes}
        | {str(value) for one in outcomes for value in one.tested_on}
    )
    mean, spread = np.full((2, len(values), len(values)), np.nan)
    for row, trained_on in enumerate(values):
        for column, tested_on in enumerate(values):
            shares = [
                float(np.mean(one.truth[asked] == one.predicted[asked]))
                for one in outcomes
                if one.trained_on == trained_on and (asked := one.tested_on == tested_on).any()
            ]
            if shares:
                mean[row, column] = np.mean(shares)
            if len(shares) > 1:
                spread[row, column] = np.std(shares, ddof=1)
    return values, mean, spread


def accuracy_table(rows: Sequence[tuple[str, Sequence[float], str]]) -> str:
    """Format accuracies as a table like the paper's Table 4.

    Parameters
    ----------
    rows : sequence of (title, accuracies, remark)
        Accuracies between 0 and 1, one for each training. For more than `_MAX_COLUMNS` trainings
        only mean and spread are shown.
    """
    width = max(len("accuracy in %"), *(len(title) for title, _, _ in rows))
    columns = max((len(shares) for _, shares, _ in rows if len(shares) <= _MAX_COLUMNS), default=0)
    head = (
        f"{'accuracy in %':<{width}}  "
        + "".join(f"{number:>6}" for number in range(1, columns + 1))
        + "    mean  spread"
    )
    lines = [head]
    for title, shares, remark in rows:
        spread = f"{100 * np.std(shares, ddof=1):8.1f}" if len(shares) > 1 else f"{'-':>8}"
        each = (
            "".join(f"{100 * share:6.1f}" for share in shares)
            if len(shares) <= columns
            else f"  {len(shares)} trainings"
        )
        mean = f"{100 * np.mean(shares):8.1f}"
        end = "  " + remark if remark else ""
        lines.append(f"{title:<{width}}  {each:<{6 * columns}}{mean}{spread}{end}")
    return "\n".join(lines)


def confusion_table(
    counts: NDArray[np.int64], classes: Sequence[str], recordings: Sequence[int]
) -> str:
    """Format a confusion matrix (true class down, predicted class across) with recordings."""
    width = max(8, *(len(name) for name in classes)) + 2
    lines = [
        f"{'shows':<{width}}"
        + "".join(f"{name:>{width}}" for name in classes)
        + "  right  recordings"
    ]
    for name, row, own, number in zip(classes, counts, np.diag(counts), recordings, strict=True):
        right = f"{own / row.sum():7.1%}" if row.sum() else f"{'-':>7}"
        lines.append(
            f"{name:<{width}}"
            + "".join(f"{count:>{width}}" for count in row)
            + right
            + f"{number:>12}"
        )
    return "\n".join(lines)


def transfer_table(
    values: Sequence[str], mean: NDArray[np.float64], spread: NDArray[np.float64]
) -> str:
    """Format accuracies and spreads [%] by training value (down) and test value (across)."""
    width = max(14, *(len(value) for value in values)) + 2
    lines = [f"{'trained on':<{width}}" + "".join(f"{value:>{width}}" for value in values)]
    for value, shares, errors in zip(values, mean, spread, strict=True):
        cells = [
            "-"
            if np.isnan(share)
            else f"{100 * share:.1f}" + ("" if np.isnan(error) else f" +- {100 * error:.1f}")
            for share, error in zip(shares, errors, strict=True)
        ]
        lines.append(f"{value:<{width}}" + "".join(f"{cell:>{width}}" for cell in cells))
    return "\n".join(lines)
