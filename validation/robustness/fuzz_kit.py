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
"""Arrays that claim more elements than this have no data behind them."""


@dataclass(frozen=True)
class Target:
    """A reader: ``read`` takes a folder of its own and the bytes of a file; ``seeds`` are good."""

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
class HostileArray:
    """An array as a hostile file has it: what it claims to be, and the values that it has."""

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
        """Bytes of a NumPy file with this array."""
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


def hostile_arrays(text: bytes, good: Arrays) -> dict[str, HostileArray]:
    """Good arrays by their names, except those of which a line of the text says otherwise.

    A line is JSON: [name, kind, shape, values], or [name] for one that is left out; a line that is
    no JSON changes nothing. A fuzzer hardly gets past the checksums and addresses of a whole
    archive, but it can change this text at will.
    """
    found = {
        name: HostileArray(array.dtype, array.shape, array.ravel()) for name, array in good.items()
    }
    for line in text.split(b"\n"):
        with suppress(
            ValueError, TypeError, AttributeError, OverflowError, RecursionError, RuntimeWarning
        ):
            name, *claimed = json.loads(line)
            if claimed:
                found |= {name: _hostile_array(*claimed)} if name.isprintable() else {}
            else:
                found.pop(name, None)
    return found


def _hostile_array(kind: str, shape: list[int], values: list[Any]) -> HostileArray:
    try:
        made = np.dtype(kind)
    except SyntaxError:  # NumPy parses words with commas as Python
        raise ValueError from None
    if (
        made.hasobject
        or made.itemsize > 4096
        or len(shape) > 6
        or not all(0 <= length < 2**40 for length in shape)
    ):
        raise ValueError
    there = np.array(values).astype(made).ravel()[:MOST_VALUES]
    return HostileArray(made, tuple(map(int, shape)), there)


def as_text(arrays: Arrays) -> bytes:
    """Text of arrays for `hostile_arrays`."""
    lines = (
        (name, _name(array.dtype), array.shape, array.ravel().tolist())
        for name, array in arrays.items()
    )
    return b"\n".join(json.dumps(one).encode() for one in lines)


def _name(kind: np.dtype) -> str:
    return "<U12" if kind.kind == "U" else kind.str if kind.names is None else "<f4,<f4"


def npz(path: Path, good: Arrays, text: bytes = b"") -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, hostile in hostile_arrays(text, good).items():
            archive.writestr(f"{name}.npy", hostile.npy())
    return path


def hdf5(path: Path, good: Arrays, text: bytes = b"") -> Path:
    with h5py.File(path, "w") as file:
        for name, hostile in hostile_arrays(text, good).items():
            with suppress(
                TypeError, ValueError, KeyError, OSError, RuntimeError
            ):  # its kind or name is unknown to HDF5
                if hostile.kind.kind == "U" and not hostile.shape:
                    file.attrs[name] = str(hostile.array)
                elif hostile.is_claim:
                    file.create_dataset(name, hostile.shape, hostile.kind, chunks=True)
                else:
                    file[name] = hostile.array
    return path
