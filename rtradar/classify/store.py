"""Files of a folder of trainings: its plan, and the checkpoint and the outcome of each training.

Every file is written beside its place and then renamed, so that it is either complete or absent.
Checkpoints are read without running any code that they may contain.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from rtradar.classify.recipes import Recipe
from rtradar.classify.splits import Split
from rtradar.clouds.collection import Collection
from rtradar.errors import InputError
from rtradar.system.files import atomic_file, open_regular, read_json

PLAN = "plan.json"
"""Name of the file that states what is trained in a folder."""

HISTORY = ("rate", "train_loss", "train_accuracy", "test_loss", "test_accuracy", "seconds")
"""Quantities measured in every epoch."""

_PLAN_KEYS = (
    "data",
    "clouds",
    "fingerprint",
    "classes",
    "recipe",
    "split",
    "folds",
    "seed",
    "trainings",
)
_MAX_NAMES = 10_000  # of classes and of trainings
_MAX_CHARACTERS = 100_000_000
_MAX_BYTES = 1_000_000_000  # PointNet with its optimiser takes 42 MB
_COLUMNS = {
    "indices": np.int64,
    "truth": np.int64,
    "predicted": np.int64,
    "tested_on": np.str_,
    "recordings": np.str_,
}


def check_plan(out: Path, plan: dict[str, Any]) -> None:
    """Raise InputError if the folder holds another plan; only ``data`` may differ."""
    path = out / PLAN
    try:
        if not os.path.lexists(path):
            if found := sorted(out.glob("training-*")):
                raise InputError(
                    f"'{out}' holds '{found[0].name}', but no {PLAN} of rtradar; "
                    "give another folder (--out)"
                )
            return
    except OSError as error:  # such as a name that is too long
        raise _unwritable(out, error) from None
    try:
        there = read_json(path)
        free = {"data"} | ({"made"} - there.keys())
        other = next(
            (name for name, value in plan.items() if name not in free and there.get(name) != value),
            None,
        )
    except (OSError, ValueError, AttributeError):
        raise InputError(f"'{path}' is damaged; give another folder (--out)") from None
    if other is not None:
        was, now = _difference(there.get(other), plan[other])
        raise InputError(
            f"'{out}' holds other trainings ({other}: {was}, not {now}); "
            "give another folder (--out)"
        )


def write_plan(out: Path, plan: dict[str, Any]) -> None:
    """Write the plan into the folder, which is made if it does not exist."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(out, error) from None
    with atomic_file(out / PLAN) as file:
        file.write((json.dumps(plan, indent=1) + "\n").encode())


def read_plan(folder: Path) -> dict[str, Any]:
    """Read the plan of a folder; InputError if it is missing or damaged."""
    try:
        plan = read_json(folder / PLAN)
        Recipe(**plan["recipe"])
        for name in ("data", "classes", "trainings"):
            if (
                (name != "data" and not plan[name])
                or len(plan[name]) > _MAX_NAMES
                or not all(isinstance(one, str) for one in plan[name])
            ):
                raise ValueError
        return {name: plan[name] for name in _PLAN_KEYS} | {"made": plan.get("made")}
    except OSError as error:
        raise InputError(
            f"'{folder}' holds no trainings ({PLAN}: {error.strerror}); "
            "make them with: rtradar train"
        ) from None
    except (ValueError, KeyError, TypeError):
        raise InputError(f"'{folder / PLAN}' is damaged; train into another folder") from None


def _unwritable(out: Path, error: OSError) -> InputError:
    return InputError(
        f"cannot write to '{out}': {error.strerror}; give a folder that can be written (--out)"
    )


def _difference(was: Any, now: Any) -> tuple[Any, Any]:
    """Both values, or the first entry in which two dictionaries differ."""
    if isinstance(was, dict) and isinstance(now, dict):
        name = next(name for name in {**was, **now} if was.get(name) != now.get(name))
        return f"{name} {was.get(name)}", f"{now.get(name)}"
    return was, now


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
        One entry for each epoch, see `rtradar.classify.training.train_network`; empty for
        classifiers without epochs.
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
        """Fraction of correct predictions."""
        return float(np.mean(self.truth == self.predicted))

    @property
    def seconds(self) -> float:
        """Duration of the training [s]."""
        return sum(row["seconds"] for row in self.history)

    def as_dict(self) -> dict[str, Any]:
        """Return the fields by name as plain values."""
        fields = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return {
            name: value.tolist() if isinstance(value, np.ndarray) else value
            for name, value in fields.items()
        }


def outcome_of(
    clouds: Collection,
    split: Split,
    values: NDArray[np.str_],
    truth: NDArray[np.int64],
    predicted: NDArray[np.int64],
    history: Sequence[dict[str, float]] = (),
) -> Outcome:
    """Outcome of ``predicted (test,)``; ``values`` (see `values_of`) and ``truth`` are (cloud,)."""
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
    """Write an outcome as JSON."""
    with atomic_file(path) as file:
        file.write((json.dumps(outcome.as_dict()) + "\n").encode())


def load_outcome(path: Path) -> Outcome:
    """Read an outcome; InputError if it cannot be read or is damaged."""
    try:
        content = read_json(path)
        for name, dtype in _COLUMNS.items():
            content[name] = _column(content[name], dtype)
        outcome = Outcome(**content)
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
        and len(outcome.truth) > 0
        and min(outcome.indices.min(), outcome.truth.min(), outcome.predicted.min()) >= 0
        and isinstance(outcome.history, list)
        and all(isinstance(row, dict) and set(row) == set(HISTORY) for row in outcome.history)
        and all(_is_number(value) for row in outcome.history for value in row.values())
    )


class Checkpoint(NamedTuple):
    """State from which a training continues as if it had never been interrupted.

    The learning rate and the random numbers follow from the number of epochs: every epoch seeds its
    own random numbers (`rtradar.classify.training`).

    Parameters
    ----------
    network : dict
        Weights and running statistics.
    optimiser : dict
        State of the optimiser; empty when the training is finished.
    epochs : int
        Number of finished epochs.
    history : list of dict
        Quantities measured in each epoch, see `HISTORY`.
    """

    network: dict[str, Any]
    optimiser: dict[str, Any]
    epochs: int
    history: list[dict[str, float]]


def save_checkpoint(path: Path, state: Checkpoint) -> None:
    """Write a checkpoint, which replaces an existing one; InputError if it cannot be written."""
    content = io.BytesIO()  # torch would not report what is wrong with a disk
    torch.save(state._asdict(), content)
    with atomic_file(path) as file:
        file.write(content.getbuffer())


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint; only tensors and plain values are accepted.

    Raises
    ------
    InputError
        If the file cannot be read, is damaged, is not a checkpoint, or contains code to be run.
    """
    hint = "remove it to train anew, or give another folder"
    try:
        with open_regular(path) as file:
            if os.fstat(file.fileno()).st_size > _MAX_BYTES:
                raise InputError(
                    f"'{path}' is larger than the {_MAX_BYTES / 1e6:.0f} MB that are allowed; "
                    f"{hint}"
                )
            _check_archive(file)
            file.seek(0)
            content = torch.load(file, map_location="cpu", weights_only=True)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"cannot read '{path}': {error.strerror}; {hint}") from None
    except Exception as error:  # torch lets any error of its archive reader and unpickler through
        text = str(error).strip()
        why = text.splitlines()[0][:80] if text else type(error).__name__
        raise InputError(
            f"'{path}' is no checkpoint that can be read safely, or is damaged ({why}); {hint}"
        ) from None
    keys, types = Checkpoint._fields, (dict, dict, int, list)
    if (
        not isinstance(content, dict)
        or set(content) != set(keys)
        or not all(map(isinstance, map(content.get, keys), types))
    ):
        raise InputError(
            f"'{path}' is no checkpoint of rtradar: it must hold {', '.join(keys)}; {hint}"
        )
    return Checkpoint(**content)


def _check_archive(file: BinaryIO) -> None:
    """Raise ValueError if the archive is compressed, as its content could then exceed any limit."""
    with zipfile.ZipFile(file) as archive:
        if any(entry.compress_type != zipfile.ZIP_STORED for entry in archive.infolist()):
            raise ValueError("it is compressed")
