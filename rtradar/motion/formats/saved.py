"""Motions as they are, in a file ``.motion``: an archive of NumPy that loses nothing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from rtradar.errors import InputError
from rtradar.motion.motion import Motion
from rtradar.recordings import Finding
from rtradar.system.checks import brief
from rtradar.system.files import atomic_file, read_arrays

_ARRAYS = ("offsets", "root_positions", "rotations")
_TEXTS = (
    *("name", "joints", "parents", "rate_hz", "first_frame_s", "length_s", "girth", "findings"),
)


def save_motion(path: str | Path, motion: Motion) -> None:
    """Write a motion to a file, of which `rtradar.load_motion` makes the same again.

    Parameters
    ----------
    path : path
        File, whose ending should be ``.motion``.
    motion : Motion
        Motion.
    """
    text = json.dumps({key: getattr(motion, key) for key in _TEXTS})
    arrays = {key: getattr(motion, key) for key in _ARRAYS}
    with atomic_file(path) as file:
        np.savez(file, text=np.array(text), **arrays)


def load_saved(path: Path) -> Motion:
    """Read a file of `save_motion`; an `InputError` tells what is wrong with it."""
    try:
        arrays = read_arrays(path)
        text = json.loads(str(arrays.pop("text")))
        fields: dict[str, Any] = {key: text[key] for key in _TEXTS}
        fields |= {key: arrays[key] for key in _ARRAYS}
        for key in ("joints", "parents"):
            fields[key] = tuple(fields[key])
        fields["findings"] = tuple(Finding(*found) for found in fields["findings"])
        return Motion(**fields)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot read this MOTION file ({error.strerror})") from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{path}: no motion that rtradar saved, or a damaged one ({brief(str(error))[1:-1]})"
        ) from None
