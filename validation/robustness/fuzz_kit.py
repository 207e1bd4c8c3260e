"""What the targets of `fuzz_readers.py` are made of."""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

Arrays = Mapping[str, np.ndarray]

MOST_VALUES = 10_000
"""Arrays that claim more are claims alone: nothing lies behind them."""


@dataclass(frozen=True)
class Target:
    """A reader: ``read`` takes a folder that it has to itself and the bytes of a file; ``seeds`` are files that it takes."""

    read: Callable[[Path, bytes], object]
    seeds: Callable[[], list[bytes]]
    words: str = ""
    most_bytes: int = 4096


def written(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, array, allow_pickle=False)
    return buffer.getvalue()


@dataclass(frozen=True)
class Piece:
    """An array as a hostile file has it: what it claims to be, and what there is of it."""

    kind: np.dtype
    shape: tuple[int, ...]
    values: np.ndarray

    @property
    def is_claim(self) -> bool:
        return math.prod(self.shape) > MOST_VALUES

    @property
    def array(self) -> np.ndarray:
        return np.resize(self.values, self.shape)

    def npy(self) -> bytes:
        """A NumPy file of it."""
        if not self.is_claim:
            return npy(self.array)
        buffer = io.BytesIO()
        head = {
            "descr": np.lib.format.dtype_to_descr(self.kind),
            "fortran_order": False,
            "shape": self.shape,
        }
        np.lib.format.write_array_header_1_0(buffer, head)
        return buffer.getvalue() + self.values.tobytes()


def pieces(text: bytes, good: Arrays) -> dict[str, Piece]:
    """Good arrays by their names, but for those of which a line of the text says otherwise.

    A line is JSON: [name, kind, shape, values], or [name] of what is left out; one that is no JSON changes nothing. Behind the
    checksums and addresses of a whole archive a fuzzer reaches little; this it can change at will.
    """
    found = {name: Piece(array.dtype, array.shape, array.ravel()) for name, array in good.items()}
    for line in text.split(b"\n"):
        with suppress(
            ValueError, TypeError, AttributeError, OverflowError, RecursionError, RuntimeWarning
        ):
            name, *told = json.loads(line)
            if told:
                found |= {name: _piece(*told)} if name.isprintable() else {}
            else:
                found.pop(name, None)
    return found


def _piece(kind: str, shape: list[int], values: list[Any]) -> Piece:
    try:
        made = np.dtype(kind)
    except SyntaxError:  # NumPy reads words with commas as Python
        raise ValueError from None
    if (
        made.hasobject
        or made.itemsize > 4096
        or len(shape) > 6
        or not all(0 <= length < 2**40 for length in shape)
    ):
        raise ValueError
    return Piece(made, tuple(map(int, shape)), np.array(values).astype(made).ravel()[:MOST_VALUES])


def as_text(arrays: Arrays) -> bytes:
    """What `pieces` reads."""
    told = (
        (name, _name(array.dtype), array.shape, array.ravel().tolist())
        for name, array in arrays.items()
    )
    return b"\n".join(json.dumps(one).encode() for one in told)


def _name(kind: np.dtype) -> str:
    return "<U12" if kind.kind == "U" else kind.str if kind.names is None else "<f4,<f4"


def npz(path: Path, good: Arrays, text: bytes = b"") -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, piece in pieces(text, good).items():
            archive.writestr(f"{name}.npy", piece.npy())
    return path


def hdf5(path: Path, good: Arrays, text: bytes = b"") -> Path:
    with h5py.File(path, "w") as file:
        for name, piece in pieces(text, good).items():
            with suppress(
                TypeError, ValueError, KeyError, OSError, RuntimeError
            ):  # not of a kind or name that HDF5 knows
                if piece.kind.kind == "U" and not piece.shape:
                    file.attrs[name] = str(piece.array)
                elif piece.is_claim:
                    file.create_dataset(name, piece.shape, piece.kind, chunks=True)
                else:
                    file[name] = piece.array
    return path
