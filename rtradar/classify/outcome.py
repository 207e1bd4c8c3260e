"""What came of one training and its test, as plain values."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.classify.source import Clouds
from rtradar.classify.splits import Split
from rtradar.errors import InputError
from rtradar.system.files import atomic_file, read_json

HISTORY = ("rate", "train_loss", "train_accuracy", "test_loss", "test_accuracy", "seconds")
"""What was measured in every epoch."""

_MOST_CHARACTERS = 100_000_000


@dataclass(frozen=True)
class Outcome:
    """A classifier's answers for the test clouds of one split.

    Parameters
    ----------
    name, trained_on : str
        Those of the `Split`.
    indices : (test,) int64
        Of the clouds.
    truth, predicted : (test,) int64
        Places among the classes.
    tested_on : (test,) str
        Value of the column that the scheme ``across`` compares; empty strings otherwise.
    recordings : (test,) str
        That each cloud comes from; clouds of one recording are no independent evidence.
    history : list of dict
        An epoch each, see `rtradar.classify.training.train_network`; empty for what has no epochs.
    """

    name: str
    trained_on: str
    indices: NDArray[np.int64]
    truth: NDArray[np.int64]
    predicted: NDArray[np.int64]
    tested_on: NDArray[np.str_]
    recordings: NDArray[np.str_]
    history: list[dict[str, float]] = field(default_factory=list)

    @property
    def accuracy(self) -> float:
        """Share of right answers."""
        return float(np.mean(self.truth == self.predicted))

    @property
    def seconds(self) -> float:
        """Time of the training."""
        return sum(row["seconds"] for row in self.history)

    def as_dict(self) -> dict[str, Any]:
        """Plain values by the names of the fields."""
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in fields.items()
        }


def outcome_of(
    clouds: Clouds,
    split: Split,
    values: NDArray[np.str_],
    truth: NDArray[np.int64],
    predicted: NDArray[np.int64],
    history: Sequence[dict[str, float]] = (),
) -> Outcome:
    """Answers ``predicted (test,)`` to a split; ``truth (cloud,)``, ``values (cloud,)`` as of `values_of`."""
    test = split.test
    recordings = clouds.column("recording")[test].astype(str)
    return Outcome(
        split.name,
        split.trained_on,
        test,
        truth[test],
        predicted,
        values[test],
        recordings,
        list(history),
    )


def save_outcome(path: Path, outcome: Outcome) -> None:
    """Write it as JSON, whole or not at all."""
    with atomic_file(path) as file:
        file.write((json.dumps(outcome.as_dict()) + "\n").encode())


def load_outcome(path: Path) -> Outcome:
    """Read it; InputError where that is not possible."""
    try:
        content = read_json(path)
        kinds = {
            "indices": np.int64,
            "truth": np.int64,
            "predicted": np.int64,
            "tested_on": np.str_,
            "recordings": np.str_,
        }
        for name, kind in kinds.items():
            content[name] = _column(content[name], kind)
        outcome = Outcome(**content)
        if not _is_whole(outcome):
            raise ValueError
        return outcome
    except (OSError, ValueError, KeyError, TypeError, OverflowError):
        raise InputError(
            f"'{path}' is damaged; remove it and train again: what is done is kept in its checkpoint"
        ) from None


def _column(values: Any, kind: Any) -> NDArray[Any]:
    """One value a cloud; TypeError or ValueError where they are of another kind, or a name so long that it is none."""
    if not isinstance(values, list) or not all(
        type(one) is (str if kind is np.str_ else int) for one in values
    ):
        raise TypeError
    # NumPy takes as much memory for each name as for the longest.
    if kind is np.str_ and len(values) * max(map(len, values), default=0) > _MOST_CHARACTERS:
        raise ValueError
    return np.array(values, dtype=kind)


def _is_number(value: Any) -> bool:
    """NaN and infinity are: a training may go wrong."""
    return isinstance(value, float) or (isinstance(value, int) and abs(value) < 2**53)


def _is_whole(outcome: Outcome) -> bool:
    """Whether everything is there and of its kind."""
    columns = [
        getattr(outcome, name)
        for name in ("indices", "truth", "predicted", "tested_on", "recordings")
    ]
    return (
        isinstance(outcome.name, str)
        and isinstance(outcome.trained_on, str)
        and all(column.shape == (len(outcome.truth),) for column in columns)
        and len(outcome.truth) > 0
        and min(outcome.indices.min(), outcome.truth.min(), outcome.predicted.min()) >= 0
        and isinstance(outcome.history, list)
        and all(isinstance(row, dict) and set(row) == set(HISTORY) for row in outcome.history)
        and all(_is_number(value) for row in outcome.history for value in row.values())
    )
