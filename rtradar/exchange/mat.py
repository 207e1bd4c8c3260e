"""IF samples as a MATLAB file, version 7.3: HDF5, so of any size, that MATLAB and Octave load.

MATLAB reverses the axes: (chirp, tx, rx, sample) is stored as (sample, rx, tx, chirp).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike

from rtradar.exchange.recording import (
    IfCube,
    IfRecording,
    quantities,
    radar_of,
    radar_text,
    scalars,
)
from rtradar.system.files import LastingFile, atomic_file, open_regular, stored

_HEADER = b"MATLAB 7.3 MAT-file, Platform: rtradar, Created on: Thu Jan  1 00:00:00 1970 HDF5 schema 1.00 ."
"""Text of the file; the same time always, so that the same samples give the same file."""

_HEADER_BYTES = 512
_COMPLEX = np.dtype([("real", "<f4"), ("imag", "<f4")])


def write_mat(path: Path, recording: IfRecording) -> dict[str, Any]:
    """Write ``if_samples (chirp, tx, rx, sample)``, complex single, its axes and a struct ``radar``.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    chirps, *rest = recording.shape
    chunk = (*rest[::-1], recording.step)
    with atomic_file(path) as raw, LastingFile(raw) as written:
        # MATLAB reads no newer layout than that of HDF5 1.8.
        with h5py.File(
            written, "w", userblock_size=_HEADER_BYTES, libver=("earliest", "v108")
        ) as file:
            data = file.create_dataset("if_samples", (*rest[::-1], chirps), _COMPLEX, chunks=chunk)
            data.attrs["MATLAB_class"] = np.bytes_("single")
            for first, block in recording.blocks("writing"):
                turned = np.zeros(
                    chunk, dtype=np.complex64
                )  # whole, as chunks at the end of an axis are in the file
                turned[..., : len(block)] = block.T
                data.id.write_direct_chunk((0, 0, 0, first), turned.tobytes())
                written.check()
            for name, quantity in quantities(recording.radar, chirps).items():
                _put(
                    file,
                    name,
                    quantity.values if quantity.values.ndim > 1 else quantity.values[None],
                )
            struct = file.create_group("radar")
            struct.attrs["MATLAB_class"] = np.bytes_("struct")
            for name, value in scalars(recording.radar).items():
                _put(struct, name, [[value]])
            _put_text(struct, "name", recording.radar.name or "-")
            _put_text(struct, "all", radar_text(recording.radar))
        written.seek(0)
        written.write(_HEADER.ljust(116) + bytes(8) + b"\x00\x02IM")
    return {"variable": "if_samples", "type": "complex single"}


def read_mat(path: Path) -> IfCube:
    """What `write_mat` wrote, bit by bit.

    Raises
    ------
    Exception
        Of many kinds where the file is another; `rtradar.exchange.read_if` makes one line of it.
    """
    with open_regular(path) as raw, h5py.File(raw, "r") as file:
        samples = np.ascontiguousarray(stored(file, "if_samples")[:].view(np.complex64).T)
        text = "".join(map(chr, stored(file, "radar/all")[:].ravel()))
    return IfCube(samples, radar_of(text))


def _put(place: Any, name: str, values: ArrayLike) -> None:
    place.create_dataset(name, data=np.asarray(values, dtype="<f8").T).attrs["MATLAB_class"] = (
        np.bytes_("double")
    )


def _put_text(place: Any, name: str, text: str) -> None:
    units = np.frombuffer(text.encode("utf-16-le"), dtype="<u2")
    data = place.create_dataset(name, data=units[:, None])
    data.attrs["MATLAB_class"] = np.bytes_("char")
    data.attrs["MATLAB_int_decode"] = np.int32(2)
