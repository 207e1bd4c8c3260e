"""Files of IF samples in single precision: MATLAB version 7.3, netCDF-4, NumPy and Zarr.

MATLAB 7.3 and netCDF-4 are HDF5, of any size. Readers raise errors of many types if a file is none
of theirs; `rtradar.exchange.open_samples` makes one line of them.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.exchange.recording import (
    IF_AXES,
    IF_UNIT,
    ROW_AXES,
    IfRecording,
    SampleFile,
    check_store,
    in_short,
    new_store,
    radar_of,
)
from rtradar.signal.real_samples import complex_of_real
from rtradar.system.files import atomic_file, open_regular
from rtradar.system.hdf5 import LastingFile, netcdf_array, stored
from rtradar.system.output_folder import new_folder

_MAT_HEADER = (
    b"MATLAB 7.3 MAT-file, Platform: rtradar, "
    b"Created on: Thu Jan  1 00:00:00 1970 HDF5 schema 1.00 ."
)
"""First text of a MATLAB file. Its date is fixed, so that equal samples give equal files."""
_MAT_HEADER_BYTES = 512
_HDF5 = b"\x89HDF\r\n\x1a\n"  # where HDF5 begins
_COMPLEX = np.dtype([("real", "<f4"), ("imag", "<f4")])
_OLD_LAYOUT = ("earliest", "v108")  # MATLAB reads no newer layout than that of HDF5 1.8
_PARTS = {"if_real": "real (I)", "if_imag": "imaginary (Q)"}  # netCDF has no complex numbers


def write_mat(path: Path, recording: IfRecording) -> dict[str, Any]:
    """Write ``if_samples``, complex single, the arrays of its axes and a struct ``radar``.

    MATLAB reverses the axes: (chirp, tx, rx, sample) is stored as (sample, rx, tx, chirp).
    """
    chirps, *rest = recording.cube_shape
    # A MATLAB 7.3 file is HDF5 behind a block of text of its own.
    chunk = (*rest[::-1], recording.step)
    with atomic_file(path) as raw, LastingFile(raw) as written:
        with h5py.File(written, "w", userblock_size=_MAT_HEADER_BYTES, libver=_OLD_LAYOUT) as file:
            data = file.create_dataset("if_samples", (*rest[::-1], chirps), _COMPLEX, chunks=chunk)
            data.attrs["MATLAB_class"] = np.bytes_("single")
            for first, block in recording.blocks("writing"):
                whole = np.zeros(chunk, dtype=np.complex64)  # the last chunk is stored whole too
                whole[..., : len(block)] = block.T
                # Directly, because HDF5 would keep some of what it writes in memory.
                data.id.write_direct_chunk((0, 0, 0, first), whole.tobytes())
                written.check()
            # Times and places, and the radar as a struct: numbers for MATLAB, and as text
            # everything, for `open_mat`.
            for name, quantity in recording.quantities().items():
                _put(file, name, np.atleast_2d(quantity.values))
            struct = file.create_group("radar")
            struct.attrs["MATLAB_class"] = np.bytes_("struct")
            for name, value in recording.waveform().items():
                _put(struct, name, [[value]])
            _put_text(struct, "name", recording.radar.name or "-")
            _put_text(struct, "all", recording.radar_text)
        # The header can be written when HDF5 has closed the file: text, an offset of zeros, the
        # version, and how bytes are ordered.
        written.seek(0)
        written.write(_MAT_HEADER.ljust(116) + bytes(8) + b"\x00\x02IM")
    return {"variable": "if_samples", "type": "complex single"}


def open_mat(path: Path) -> SampleFile:
    """Open what `write_mat` wrote, or MATLAB's variable ``if_samples``, complex or real.

    Files of MATLAB 7 and older, which are no HDF5, are read all at once.
    """
    with open_regular(path) as raw:
        start = raw.read(_MAT_HEADER_BYTES + len(_HDF5))
        if _HDF5 not in (start[: len(_HDF5)], start[_MAT_HEADER_BYTES:]):
            raw.seek(0)
            return _open_old_mat(path, raw)
    with open_regular(path) as raw, h5py.File(raw, "r") as file:
        data = stored(file, "if_samples", compressed=True)
        # MATLAB's axes are reversed; its text is numbers of characters.
        shape, kind = data.shape[::-1], data.dtype
        text = "".join(map(chr, stored(file, "radar/all")[:].ravel())) if "radar" in file else ""

    def read(first: int, last: int) -> NDArray[np.complex64]:
        with open_regular(path) as raw, h5py.File(raw, "r") as file:
            parts = stored(file, "if_samples", compressed=True)[..., first:last].T
            return parts if parts.dtype.names is None else parts["real"] + 1j * parts["imag"]

    return _rows(path, shape, read, text, kind)


def _open_old_mat(path: Path, file: BinaryIO) -> SampleFile:
    from scipy.io import loadmat  # slow to import

    try:
        values = loadmat(file, variable_names=["if_samples"])["if_samples"]
    except KeyError:
        raise KeyError("there is no variable if_samples") from None
    except Exception as error:  # it fails in many ways on damaged files
        raise ValueError(in_short(error)) from None
    return _rows(path, values.shape, lambda first, last: values[first:last], "", values.dtype)


def _rows(
    path: Path,
    shape: tuple[int, ...],
    read: Callable[[int, int], NDArray[Any]],
    text: str,
    kind: Any = np.complex64,
) -> SampleFile:
    """Give rows (chirp, rx, sample) of arrays (chirp, tx, rx, sample), or (chirp, rx, sample).

    ``read`` takes the first and the last number along the first axis, ``text`` is that of a radar.
    Real samples, of a ``kind`` of numbers, become half as many complex ones.
    """
    own, real = shape[1] if len(shape) == 4 else None, np.dtype(kind).kind in "iuf"
    tx = own or 1
    # Two real samples make one complex one.
    if len(shape) not in (3, 4) or min(shape) < 1 or (real and shape[-1] % 2):
        whole = ", an even number of real samples" if real else ""
        raise ValueError(
            f"the samples have shape {shape}, not (chirp, rx, sample) or (chirp, tx, rx, "
            f"sample){whole}"
        )

    def rows(first: int, last: int) -> NDArray[np.complex64]:
        # Whole cycles that hold the rows are read, and cut to these.
        begin = first // tx
        block = read(begin, -(-last // tx)).reshape(-1, *shape[-2:])
        block = block[first - begin * tx : last - begin * tx]
        return complex_of_real(block) if real else block.astype(np.complex64)

    size = (shape[0] * tx, shape[-2], shape[-1] // 2 if real else shape[-1])
    radar = radar_of(text) if text else None
    return SampleFile(path, radar, size, rows, "m" if text else "count", own)


def _put(place: Any, name: str, values: ArrayLike) -> None:
    data = place.create_dataset(name, data=np.asarray(values, dtype="<f8").T)
    data.attrs["MATLAB_class"] = np.bytes_("double")


def _put_text(place: Any, name: str, text: str) -> None:
    units = np.frombuffer(text.encode("utf-16-le"), dtype="<u2")
    data = place.create_dataset(name, data=units[:, None])
    data.attrs["MATLAB_class"] = np.bytes_("char")
    data.attrs["MATLAB_int_decode"] = np.int32(2)


def write_netcdf(path: Path, recording: IfRecording) -> dict[str, Any]:
    """Write ``if_real`` and ``if_imag`` (chirp, tx, rx, sample), float32, with coordinates."""
    shape = recording.cube_shape
    layout: dict[str, Any] = {"libver": _OLD_LAYOUT, "track_order": True}
    with (
        atomic_file(path) as raw,
        LastingFile(raw) as written,
        h5py.File(written, "w", **layout) as file,
    ):
        # A variable for each axis, then the samples in two parts, then their times and places.
        for name, length in (*zip(IF_AXES, shape, strict=True), ("xyz", 3)):
            meaning = "0, 1, 2 are x, y, z" if name == "xyz" else f"number of the {name}"
            netcdf_array(file, name, (name,), "1", meaning, data=np.arange(length))
        chunk = (recording.step, *shape[1:])
        kept: dict[str, Any] = {"shape": shape, "dtype": "<f4", "chunks": chunk}
        parts = [
            netcdf_array(file, name, IF_AXES, IF_UNIT, f"{kind} part of the IF samples", **kept)
            for name, kind in _PARTS.items()
        ]
        for name, quantity in recording.quantities().items():
            axes, data, unit, meaning = quantity
            netcdf_array(file, name, axes, unit, meaning, data=data)
        for part in parts:
            part.attrs["coordinates"] = "chirp_time sample_time"
        file.attrs.update(recording.waveform())
        file.attrs["title"], file.attrs["radar"] = recording.name, recording.radar_text
        # Chunk by chunk, which are written directly, past the cache of HDF5.
        for first, block in recording.blocks("writing"):
            for part, values in zip(parts, (block.real, block.imag), strict=True):
                whole = np.zeros(chunk, dtype=np.float32)  # the last chunk is stored whole too
                whole[: len(block)] = values
                part.id.write_direct_chunk((first, 0, 0, 0), whole.tobytes())
            written.check()
    return {"variables": list(_PARTS), "type": "float32"}


def open_netcdf(path: Path) -> SampleFile:
    """Open what `write_netcdf` wrote."""
    with open_regular(path) as raw, h5py.File(raw, "r") as file:
        shape, other = (stored(file, name, compressed=True).shape for name in _PARTS)
        text = str(file.attrs.get("radar", ""))
    if shape != other:
        raise ValueError(f"if_real is {shape}, and if_imag {other}")

    def read(first: int, last: int) -> NDArray[np.complex64]:
        with open_regular(path) as raw, h5py.File(raw, "r") as file:
            real, imaginary = (stored(file, name, compressed=True)[first:last] for name in _PARTS)
        samples = np.empty(real.shape, dtype=np.complex64)
        samples.real, samples.imag = real, imaginary
        return samples

    return _rows(path, shape, read, text)


def write_npy(path: Path, recording: IfRecording) -> dict[str, Any]:
    """Write (chirp, rx, sample), the chirps of all Tx in turn, complex64; without the radar."""
    shape = recording.shape
    header = {"descr": "<c8", "fortran_order": False, "shape": shape}
    with atomic_file(path) as file:
        np.lib.format.write_array_header_1_0(file, header)
        for _, block in recording.blocks("writing"):
            file.write(block.astype("<c8", copy=False).tobytes())
    return {"axes": list(ROW_AXES), "shape": list(shape), "type": "complex64"}


def open_npy(path: Path) -> SampleFile:
    """Open an array (chirp, rx, sample) or (chirp, tx, rx, sample) of numbers."""
    try:
        found = np.lib.format.open_memmap(path, mode="r")
    except Exception as error:  # it parses the header as Python, which fails in many ways
        raise ValueError(in_short(error)) from None
    if found.dtype.kind not in "ciuf":
        raise ValueError(f"it holds {found.dtype}, not numbers")
    # Rows are read one after another, so they must lie so.
    if not found.flags.c_contiguous:
        raise ValueError("it is in the order of Fortran; save numpy.ascontiguousarray of it")
    if found.offset + found.nbytes != path.stat().st_size:
        raise ValueError("it is longer than its header tells")

    def read(first: int, last: int) -> NDArray[Any]:
        # Mapped anew, so that what was read takes no memory.
        return np.array(np.lib.format.open_memmap(path, mode="r")[first:last])

    return _rows(path, found.shape, read, "", found.dtype)


def write_zarr(path: Path, recording: IfRecording) -> dict[str, Any]:
    """Write a Zarr array (chirp, rx, sample) complex64, with the radar as an attribute."""
    shape = recording.shape
    if os.path.lexists(path):
        raise InputError(f"'{path}' is there; remove it, or give another name (--out)")
    with new_folder(path) as folder:
        together = min(recording.together, shape[0])
        array = new_store(folder, shape, together, {"radar": recording.radar_text})
        for first, block in recording.blocks("writing"):
            rows = block.reshape(-1, *shape[1:])
            begin = first * block.shape[1]
            array[begin : begin + len(rows)] = rows
    return {"axes": list(ROW_AXES), "shape": list(shape), "type": "complex64"}


def open_zarr(path: Path) -> SampleFile:
    """Open what `write_zarr` wrote, or another array of numbers of that shape."""
    array = check_store(path)

    def read(first: int, last: int) -> NDArray[Any]:
        return np.asarray(array[first:last])

    return _rows(path, array.shape, read, str(array.attrs.get("radar", "")), array.dtype)
