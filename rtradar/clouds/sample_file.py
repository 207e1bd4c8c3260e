"""Reading a sample's file, which may be damaged, or a stranger's: what it promises is checked before it is believed."""

from __future__ import annotations

import io
import json
import os
import zipfile
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.system.files import open_regular

FORMAT = 1
"""Of a sample's file and of the index; a reader refuses others."""

DIGEST = 64
"""Hexadecimal digits of SHA-256, which are the comment of the archive."""

_MOST_BYTES = 200_000_000
_KINDS = {"points": np.dtype("<f8"), "spatial": np.dtype("<f8"), "about": np.dtype("u1")}


def read_sample(path: Path, name: str) -> Any:
    """One piece of a sample.

    Not all of the file is read: the archive has a checksum of each piece, and its comment is the end of the file.

    Parameters
    ----------
    path : path
    name : {"points", "spatial", "about"}

    Returns
    -------
    (n, 3) float64, or a dict with ``label`` and ``provenance`` for ``about``

    Raises
    ------
    InputError
        Where the file is damaged, or larger than 200 MB.
    """
    try:
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
            if size <= _MOST_BYTES:
                array = _array(file, name)
                return _about(array) if name == "about" else array.reshape(-1, 3).astype(np.float64)
    except (
        Exception
    ):  # what readers of archives and of headers raise at damaged ones is of any type
        raise InputError(
            f"sample '{path}' is damaged; mend the collection with: rtradar dataset build"
        ) from None
    raise InputError(
        f"sample '{path}' has {size / 1e6:.0f} MB; {_MOST_BYTES / 1e6:.0f} MB are allowed: it is none of rtradar's"
    )


def _array(file: BinaryIO, name: str) -> NDArray[Any]:
    with zipfile.ZipFile(file) as archive:
        entry = archive.getinfo(f"{name}.npy")
        # Ours are not compressed: nothing in them is larger than the file.
        if len(archive.comment) != DIGEST or entry.compress_type != zipfile.ZIP_STORED:
            raise ValueError
        data = io.BytesIO(archive.read(entry))
    if np.lib.format.read_magic(data) != (1, 0):
        raise ValueError
    shape, _, kind = np.lib.format.read_array_header_1_0(data)
    if kind != _KINDS[name] or (name != "about" and shape[1:] != (3,)):
        raise ValueError
    return np.frombuffer(data.getvalue(), kind, offset=data.tell()).reshape(shape)


def _about(data: NDArray[np.uint8]) -> dict[str, Any]:
    about: dict[str, Any] = json.loads(data.tobytes())
    if (
        about["format"] != FORMAT
        or not isinstance(about["label"], str)
        or not isinstance(about["provenance"], dict)
    ):
        raise ValueError
    return about
