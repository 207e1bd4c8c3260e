"""The state of a training in a file: whole or not there, and read without running anything that somebody put into it."""

from __future__ import annotations

import io
import os
import zipfile
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import torch

from rtradar.errors import InputError
from rtradar.system.files import atomic_file, open_regular

_MOST_BYTES = 1_000_000_000  # of PointNet with its optimiser: 42 MB
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
    content = io.BytesIO()  # torch does not say what is wrong with a disk
    torch.save(state._asdict(), content)
    with atomic_file(path) as file:
        file.write(content.getbuffer())


def load_checkpoint(path: Path) -> Checkpoint:
    """Read it, tensors and plain values only.

    Raises
    ------
    InputError
        Where the file cannot be read, is damaged, is no checkpoint, or holds anything that would have to be run.
    """
    cure = "remove it to train anew, or give another folder"
    try:
        with open_regular(path) as file:
            if os.fstat(file.fileno()).st_size > _MOST_BYTES:
                raise InputError(
                    f"'{path}' is larger than the {_MOST_BYTES / 1e6:.0f} MB that are allowed; {cure}"
                )
            _check_archive(file)
            file.seek(0)
            content = torch.load(file, map_location="cpu", weights_only=True)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"cannot read '{path}': {error.strerror}; {cure}") from None
    except Exception as error:  # torch raises whatever its archive reader and unpickler do
        why = (
            str(error).strip().splitlines()[0][:80] if str(error).strip() else type(error).__name__
        )
        raise InputError(
            f"'{path}' is no checkpoint that can be read safely, or is damaged ({why}); {cure}"
        ) from None
    kinds = dict, dict, int, list
    if (
        not isinstance(content, dict)
        or set(content) != set(_KEYS)
        or not all(map(isinstance, map(content.get, _KEYS), kinds))
    ):
        raise InputError(
            f"'{path}' is no checkpoint of rtradar: it must hold {', '.join(_KEYS)}; {cure}"
        )
    return Checkpoint(**content)


def _check_archive(file: BinaryIO) -> None:
    """Raise where the file is not the kind of archive that `save_checkpoint` writes: nothing in it is larger than it is."""
    with zipfile.ZipFile(file) as archive:
        if any(entry.compress_type != zipfile.ZIP_STORED for entry in archive.infolist()):
            raise ValueError("it is compressed")
