"""Maps to an HDF5 file, window by window, with their axes: netCDF-4 to those who read it so."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

_AXES = {
    "time": ("s", "centre of the processing window since the start of the capture"),
    "slow_time": ("s", "centre of the averaged cycles since the start of the capture"),
    "range": ("m", "half the path from Tx to Rx"),
    "velocity": ("m/s", "rate of range, positive receding"),
}

_MAPS = {
    "range_doppler": (("time", "range", "velocity"), np.float32, "m2", "power summed over all channels"),
    "detections": (("time", "range", "velocity"), np.uint8, "1", "1 where OS-CFAR detects"),
    "range_time": (("slow_time", "range"), np.float32, "m2", "power averaged over channels and a few cycles"),
}


class MapStore:
    """An HDF5 file of maps that grow along their first axis.

    Parameters
    ----------
    path : path
        Written anew.
    fixed : mapping of str to (n,) float64
        The axes whose values are known: ``range`` and ``velocity``.
    attributes : mapping
        Of the file.
    """

    def __init__(self, path: Path, fixed: Mapping[str, NDArray[np.float64]], attributes: Mapping[str, Any]) -> None:
        self._file = h5py.File(path, "w")
        for key, value in attributes.items():
            self._file.attrs[key] = value
        for name, (unit, meaning) in _AXES.items():
            values = fixed.get(name)
            axis = self._file.create_dataset(
                name,
                data=np.zeros(0) if values is None else values,
                maxshape=(None,) if values is None else values.shape,
                chunks=(1024,) if values is None else None,
            )
            axis.make_scale(name)
            axis.attrs["units"], axis.attrs["long_name"] = unit, meaning
        for name, (axes, kind, unit, meaning) in _MAPS.items():
            shape = tuple(len(fixed[axis]) for axis in axes[1:])
            packed = {"compression": "gzip", "compression_opts": 1, "shuffle": True} if kind == np.uint8 else {}
            data = self._file.create_dataset(
                name, shape=(0, *shape), maxshape=(None, *shape), dtype=kind, chunks=(1, *shape), **packed
            )
            data.attrs["units"], data.attrs["long_name"] = unit, meaning
            for number, axis_name in enumerate(axes):
                data.dims[number].attach_scale(self._file[axis_name])

    def append(self, axis: str, value: float, **maps: NDArray[Any]) -> None:
        """Add one step along ``axis`` ("time" or "slow_time") at ``value`` [s], with the maps that grow along it."""
        for name, values in ((axis, value), *maps.items()):
            data = self._file[name]
            data.resize(len(data) + 1, axis=0)
            data[-1] = values

    def __enter__(self) -> MapStore:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()
