"""The state of a training in a file: whole or not there, and read without running anything that somebody put into it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import torch

from rtradar.clouds import atomic_file
from rtradar.errors import InputError

_KEYS = ("network", "optimiser", "epochs", "history")


class Checkpoint(NamedTuple):
    """What a training needs to go on as if it had never stopped.

    The rate follows from the number of epochs, and so do the random numbers: every epoch begins its own (`training.py`).

    Parameters
    ----------
    network : dict
        Weights and running statistics.
    optimiser : dict
        Its state; empty when the training is done.
    epochs : int
        Done so far.
    history : list of dict
        What was measured after each.
    """

    network: dict[str, Any]
    optimiser: dict[str, Any]
    epochs: int
    history: list[dict[str, float]]


def save_checkpoint(path: Path, state: Checkpoint) -> None:
    """Write it; one that is there is replaced in one step. InputError where it cannot be written."""
    with atomic_file(path) as file:
        torch.save(state._asdict(), file)


def load_checkpoint(path: Path) -> Checkpoint:
    """Read it, tensors and plain values only.

    Raises
    ------
    InputError
        Where the file cannot be read, is damaged, is no checkpoint, or holds anything that would have to be run.
    """
    cure = "remove it to train anew, or give another folder"
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise InputError(f"cannot read '{path}': {error.strerror}; {cure}") from None
    except Exception as error:  # torch raises whatever its archive reader and unpickler do
        why = str(error).strip().splitlines()[0][:80] if str(error).strip() else type(error).__name__
        raise InputError(f"'{path}' is no checkpoint that can be read safely, or is damaged ({why}); {cure}") from None
    if not isinstance(content, dict) or set(content) != set(_KEYS):
        raise InputError(f"'{path}' is no checkpoint of rtradar: it must hold {', '.join(_KEYS)}; {cure}")
    return Checkpoint(**content)
