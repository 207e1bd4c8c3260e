"""Files of IF samples: MATLAB version 7.3, netCDF-4, and the 16-bit integers of radar boards.

MATLAB 7.3 and netCDF-4 are HDF5, of any size. Readers raise errors of many types if a file is none
of theirs; `rtradar.exchange.read_if` makes one line of them.
"""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike

from rtradar.errors import InputError
from rtradar.exchange.recording import IF_AXES, IF_UNIT, IfCube, IfRecording, radar_of
from rtradar.system.files import LastingFile, atomic_file, open_regular, read_json, stored

_LARGEST = 32767
_WHAT = "IF samples of rtradar: sample = scale * (I + 1j Q)"
_MAT_HEADER = (
    b"MATLAB 7.3 MAT-file, Platform: rtradar, "
    b"Created on: Thu Jan  1 00:00:00 1970 HDF5 schema 1.00 ."
)
"""First text of a MATLAB file. Its date is fixed, so that equal samples give equal files."""
_MAT_HEADER_BYTES = 512
_COMPLEX = np.dtype([("real", "<f4"), ("imag", "<f4")])
_OLD_LAYOUT = ("earliest", "v108")  # MATLAB reads no newer layout than that of HDF5 1.8
_PARTS = {"if_real": "real (I)", "if_imag": "imaginary (Q)"}  # netCDF has no complex numbers


def write_mat(path: Path, recording: IfRecording) -> dict[str, Any]:
    """Write ``if_samples``, complex single, the arrays of its axes and a struct ``radar``.

    MATLAB reverses the axes: (chirp, tx, rx, sample) is stored as (sample, rx, tx, chirp).
    """
    chirps, *rest = recording.shape
    chunk = (*rest[::-1], recording.step)
    with atomic_file(path) as raw, LastingFile(raw) as written:
        with h5py.File(written, "w", userblock_size=_MAT_HEADER_BYTES, libver=_OLD_LAYOUT) as file:
            data = file.create_dataset("if_samples", (*rest[::-1], chirps), _COMPLEX, chunks=chunk)
            data.attrs["MATLAB_class"] = np.bytes_("single")
            for first, block in recording.blocks("writing"):
                whole = np.zeros(chunk, dtype=np.complex64)  # the last chunk is stored whole too
                whole[..., : len(block)] = block.T
                data.id.write_direct_chunk((0, 0, 0, first), whole.tobytes())
                written.check()
            for name, quantity in recording.quantities().items():
                _put(file, name, np.atleast_2d(quantity.values))
            struct = file.create_group("radar")
            struct.attrs["MATLAB_class"] = np.bytes_("struct")
            for name, value in recording.waveform().items():
                _put(struct, name, [[value]])
            _put_text(struct, "name", recording.radar.name or "-")
            _put_text(struct, "all", recording.radar_text)
        written.seek(0)
        written.write(_MAT_HEADER.ljust(116) + bytes(8) + b"\x00\x02IM")
    return {"variable": "if_samples", "type": "complex single"}


def read_mat(path: Path) -> IfCube:
    """Read what `write_mat` wrote, without any loss."""
    with open_regular(path) as raw, h5py.File(raw, "r") as file:
        samples = np.ascontiguousarray(stored(file, "if_samples")[:].view(np.complex64).T)
        text = "".join(map(chr, stored(file, "radar/all")[:].ravel()))
    return IfCube(samples, radar_of(text))


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
    shape = recording.shape
    chunk = (recording.step, *shape[1:])
    layout: dict[str, Any] = {"libver": _OLD_LAYOUT, "track_order": True}
    with (
        atomic_file(path) as raw,
        LastingFile(raw) as written,
        h5py.File(written, "w", **layout) as file,
    ):
        for name, length in (*zip(IF_AXES, shape, strict=True), ("xyz", 3)):
            axis = file.create_dataset(name, data=np.arange(length))
            axis.make_scale(name)
            meaning = "0, 1, 2 are x, y, z" if name == "xyz" else f"number of the {name}"
            axis.attrs["units"], axis.attrs["long_name"] = "1", meaning
        parts = [file.create_dataset(name, shape, "<f4", chunks=chunk) for name in _PARTS]
        for part, kind in zip(parts, _PARTS.values(), strict=True):
            _describe(file, part, IF_AXES, IF_UNIT, f"{kind} part of the IF samples")
        for name, quantity in recording.quantities().items():
            data = file.create_dataset(name, data=quantity.values)
            _describe(file, data, quantity.axes, quantity.unit, quantity.meaning)
        for part in parts:
            part.attrs["coordinates"] = "chirp_time sample_time"
        file.attrs.update(recording.waveform())
        file.attrs["title"], file.attrs["radar"] = recording.name, recording.radar_text
        for first, block in recording.blocks("writing"):
            for part, values in zip(parts, (block.real, block.imag), strict=True):
                whole = np.zeros(chunk, dtype=np.float32)  # the last chunk is stored whole too
                whole[: len(block)] = values
                part.id.write_direct_chunk((first, 0, 0, 0), whole.tobytes())
            written.check()
    return {"variables": list(_PARTS), "type": "float32"}


def _describe(file: Any, data: Any, axes: tuple[str, ...], unit: str, meaning: str) -> None:
    data.attrs["units"], data.attrs["long_name"] = unit, meaning
    for number, axis in enumerate(axes):
        data.dims[number].attach_scale(file[axis])


def read_netcdf(path: Path) -> IfCube:
    """Read what `write_netcdf` wrote, without any loss."""
    with open_regular(path) as raw, h5py.File(raw, "r") as file:
        samples = np.empty(stored(file, "if_real").shape, dtype=np.complex64)
        samples.real, samples.imag = (stored(file, name)[:] for name in _PARTS)
        return IfCube(samples, radar_of(str(file.attrs["radar"])))


def write_int16(path: Path, recording: IfRecording) -> dict[str, Any]:
    """Write (chirp, tx, rx, sample, IQ) as little-endian int16 with a JSON file beside it.

    The largest real or imaginary part becomes 32767, and rounding errors are at most half of
    ``scale``. InputError if a file cannot be written, a foreign file has the name of the JSON file,
    or a sample is not finite.
    """
    beside = path.with_suffix(".json")
    for file in (path, beside):
        if file.is_dir():
            raise InputError(f"cannot write '{file}': a directory; give another file (--out)")
    if os.path.lexists(beside) and not _is_ours(beside):
        raise InputError(
            f"'{beside}' is there, and something else; it would be replaced: "
            "give another file (--out)"
        )
    peak = 0.0
    for _, block in recording.blocks("finding the peak"):
        largest = float(np.abs(block.view(np.float32)).max())
        if not np.isfinite(largest):
            raise InputError(
                f"{recording.name}: a sample is not finite, and has no place in 16 bits; "
                "run it again"
            )
        peak = max(peak, largest)
    scale = peak / _LARGEST if peak else 1.0
    about = {
        "what": _WHAT,
        "data": path.name,
        "type": "int16, little-endian",
        "axes": [*IF_AXES, "iq"],
        "shape": [*recording.shape, 2],
        "scale": scale,
        "unit": IF_UNIT,
        "quantisation": scale / 2,
        **recording.waveform(),
        "tx_position_m": recording.radar.tx.tolist(),
        "rx_position_m": recording.quantities()["rx_position"].values.tolist(),
        "radar": json.loads(recording.radar_text),
    }
    with atomic_file(beside) as text, atomic_file(path) as raw:
        text.write((json.dumps(about, indent=1) + "\n").encode("utf-8"))
        for _, block in recording.blocks("writing"):
            # In float64: the quotient of two float32 could round to the wrong side of a half.
            parts = np.rint(block.view(np.float32).astype(np.float64) / scale)
            raw.write(parts.astype("<i2").tobytes())
        # The text of an older cube must not lie beside this one, wherever the next steps end.
        beside.unlink(missing_ok=True)
    return {"beside": str(beside), "scale": scale, "quantisation": scale / 2, "type": "int16"}


def read_int16(path: Path) -> IfCube:
    """Read what `write_int16` wrote, to half of ``scale`` and the rounding of float32."""
    about = read_json(path.with_suffix(".json"))
    shape = tuple(map(int, about["shape"]))
    with open_regular(path) as file:
        whole = np.fromfile(file, dtype="<i2")
    if len(shape) != 5 or min(shape) < 0 or shape[4] != 2 or whole.size != math.prod(shape):
        raise ValueError(f"{whole.size} numbers where the JSON file tells of {shape}")
    scale = float(about["scale"])
    if not 0 < scale * (_LARGEST + 1) <= np.finfo(np.float32).max:
        raise ValueError(f"scale is {scale:g}")
    parts = (whole.astype(np.float64) * scale).astype(np.float32)
    return IfCube(parts.view(np.complex64).reshape(shape[:4]), radar_of(json.dumps(about["radar"])))


def _is_ours(path: Path) -> bool:
    try:
        return bool(read_json(path)["what"] == _WHAT)
    except (OSError, ValueError, KeyError, TypeError):
        return False
