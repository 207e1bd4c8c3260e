"""IF samples as netCDF-4, with their axes, for xarray and whatever else reads that."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from rtradar.exchange.recording import (
    IF_AXES,
    IF_UNIT,
    IfCube,
    IfRecording,
    quantities,
    radar_of,
    radar_text,
    scalars,
)
from rtradar.system.files import LastingFile, atomic_file, open_regular, stored

_PARTS = ("if_real", "if_imag")
"""netCDF knows no complex numbers."""


def write_netcdf(path: Path, recording: IfRecording) -> dict[str, Any]:
    """Write ``if_real`` and ``if_imag`` (chirp, tx, rx, sample), float32, with coordinates.

    Raises
    ------
    InputError
        Where the file cannot be written.
    """
    shape = recording.shape
    chunk = (recording.step, *shape[1:])
    layout: dict[str, Any] = {"libver": ("earliest", "v108"), "track_order": True}
    with (
        atomic_file(path) as raw,
        LastingFile(raw) as written,
        h5py.File(written, "w", **layout) as file,
    ):
        for name, length in (*zip(IF_AXES, shape, strict=True), ("xyz", 3)):
            axis = file.create_dataset(name, data=np.arange(length))
            axis.make_scale(name)
            axis.attrs["units"], axis.attrs["long_name"] = (
                "1",
                "0, 1, 2 are x, y, z" if name == "xyz" else f"number of the {name}",
            )
        parts = []
        for name, meaning in zip(_PARTS, ("real (I)", "imaginary (Q)"), strict=True):
            part = file.create_dataset(name, shape, "<f4", chunks=chunk)
            parts.append(
                _described(file, part, IF_AXES, IF_UNIT, f"{meaning} part of the IF samples")
            )
        for name, quantity in quantities(recording.radar, shape[0]).items():
            data = file.create_dataset(name, data=quantity.values)
            _described(file, data, quantity.axes, quantity.unit, quantity.meaning)
        for part in parts:
            part.attrs["coordinates"] = "chirp_time sample_time"
        for key, value in scalars(recording.radar).items():
            file.attrs[key] = value
        file.attrs["title"], file.attrs["radar"] = recording.name, radar_text(recording.radar)
        for first, block in recording.blocks("writing"):
            for part, values in zip(parts, (block.real, block.imag), strict=True):
                whole = np.zeros(
                    chunk, dtype=np.float32
                )  # as chunks at the end of an axis are in the file
                whole[: len(block)] = values
                part.id.write_direct_chunk((first, 0, 0, 0), whole.tobytes())
            written.check()
    return {"variables": list(_PARTS), "type": "float32"}


def read_netcdf(path: Path) -> IfCube:
    """What `write_netcdf` wrote, bit by bit.

    Raises
    ------
    Exception
        Of many kinds where the file is another; `rtradar.exchange.read_if` makes one line of it.
    """
    with open_regular(path) as raw, h5py.File(raw, "r") as file:
        samples = np.empty(stored(file, _PARTS[0]).shape, dtype=np.complex64)
        samples.real, samples.imag = (stored(file, name)[:] for name in _PARTS)
        return IfCube(samples, radar_of(str(file.attrs["radar"])))


def _described(file: Any, data: Any, axes: tuple[str, ...], unit: str, meaning: str) -> Any:
    data.attrs["units"], data.attrs["long_name"] = unit, meaning
    for number, axis in enumerate(axes):
        data.dims[number].attach_scale(file[axis])
    return data
