"""Maps to an HDF5 file, step by step, with their axes: netCDF-4 to those who read it so."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.system.files import LastingFile

_AXES = {
    "time": ("s", "centre of the processing window since the start of the capture"),
    "slow_time": ("s", "centre of the averaged cycles since the start of the capture"),
    "spectrogram_time": ("s", "centre of the spectrogram's window since the start of the capture"),
    "range": ("m", "half the path from Tx to Rx"),
    "velocity": ("m/s", "rate of range, positive receding"),
    "spectrogram_velocity": ("m/s", "rate of range, positive receding"),
    "azimuth": (
        "rad",
        "atan2(y, x) in the radar's frame, positive to the left; without a z-line asin(y / r), the cone angle",
    ),
    "elevation": ("rad", "asin(z / r) in the radar's frame, positive upward"),
}

_GROWING = ("time", "slow_time", "spectrogram_time")

_MAPS = {
    "range_doppler": (
        ("time", "range", "velocity"),
        np.float32,
        "m2",
        "power summed over all channels",
    ),
    "detections": (("time", "range", "velocity"), np.uint8, "1", "1 where a target is detected"),
    "range_time": (
        ("slow_time", "range"),
        np.float32,
        "m2",
        "power averaged over channels and a few cycles",
    ),
    "spectrogram": (
        ("spectrogram_time", "spectrogram_velocity"),
        np.float32,
        "m2",
        "power of one channel summed over range",
    ),
    "range_azimuth": (
        ("time", "range", "azimuth"),
        np.float32,
        "m2",
        "power summed over detected cells",
    ),
    "range_elevation": (
        ("time", "range", "elevation"),
        np.float32,
        "m2",
        "power summed over detected cells",
    ),
}

_SINGLE = {
    "range_doppler_received": (
        ("range", "velocity"),
        np.float32,
        "m2",
        "range_doppler of one window before clutter was removed",
    ),
    "detections_received": (
        ("range", "velocity"),
        np.uint8,
        "1",
        "1 where a target is detected in range_doppler_received",
    ),
    "range_azimuth_received": (
        ("range", "azimuth"),
        np.float32,
        "m2",
        "range_azimuth of that window before clutter was removed",
    ),
}

_STEPS_A_CHUNK = 64
"""Steps of time that are written to the file together, of maps with few numbers a step."""

_SPARSE = ("detections", "range_azimuth", "range_elevation")
"""Mostly zeros, which cost nothing once packed."""


class MapStore:
    """An HDF5 file of maps that grow along their first axis.

    Parameters
    ----------
    path : path
        Written anew.
    fixed : mapping of str to (n,) float64
        The axes whose values are known, such as ``range`` and ``velocity``. Maps with another axis that does not grow are
        left out: a radar without a z-line has no elevation.
    attributes : mapping
        Of the file.
    clutter_removal : mapping of str to str, optional
        How static clutter has been removed from the maps along each growing axis; an attribute of their datasets. ``none`` if
        left out.
    """

    def __init__(
        self,
        path: Path,
        fixed: Mapping[str, NDArray[np.float64]],
        attributes: Mapping[str, Any],
        clutter_removal: Mapping[str, str] | None = None,
    ) -> None:
        # The newest format indexes growing data in constant memory.
        self._written = LastingFile(path.open("w+b"))
        self._file = h5py.File(self._written, "w", libver="latest")
        for key, value in attributes.items():
            self._file.attrs[key] = value
        for name in (*_GROWING, *fixed):
            growing = name in _GROWING
            axis = self._file.create_dataset(
                name,
                data=np.zeros(0) if growing else fixed[name],
                maxshape=(None,) if growing else fixed[name].shape,
                chunks=(1024,) if growing else None,
            )
            axis.make_scale(name)
            axis.attrs["units"], axis.attrs["long_name"] = _AXES[name]
        for name, (axes, kind, unit, meaning) in _MAPS.items():
            if any(axis_name not in fixed for axis_name in axes[1:]):
                continue
            shape = tuple(len(fixed[axis_name]) for axis_name in axes[1:])
            steps = 1 if len(shape) > 1 else _STEPS_A_CHUNK
            packed = (
                {"compression": "gzip", "compression_opts": 1, "shuffle": True}
                if name in _SPARSE
                else {}
            )
            data = self._file.create_dataset(
                name,
                shape=(0, *shape),
                maxshape=(None, *shape),
                dtype=kind,
                chunks=(steps, *shape),
                # HDF5 would keep up to 8 MB of what is written of each map. Only a chunk that is not yet full is worth it.
                rdcc_nbytes=0 if steps == 1 else steps * math.prod(shape) * np.dtype(kind).itemsize,
                **packed,
            )
            data.attrs["units"], data.attrs["long_name"] = unit, meaning
            data.attrs["clutter_removal"] = (
                "none" if clutter_removal is None else clutter_removal[axes[0]]
            )
            for number, axis_name in enumerate(axes):
                data.dims[number].attach_scale(self._file[axis_name])

    def extend(self, axis: str, values: ArrayLike, **maps: ArrayLike) -> None:
        """Add steps along a growing axis at ``values (n,)`` [s], with ``(n, ...)`` of each map that grows along it."""
        for name, added in ((axis, values), *maps.items()):
            steps = np.asarray(added)
            data = self._file[name]
            data.resize(len(data) + len(steps), axis=0)
            data[len(data) - len(steps) :] = steps
        self._written.check()

    def put(self, time: float, **maps: ArrayLike) -> None:
        """Maps of one moment [s], which do not grow."""
        for name, values in maps.items():
            axes, kind, unit, meaning = _SINGLE[name]
            data = self._file.create_dataset(name, data=np.asarray(values, dtype=kind))
            data.attrs.update(
                {"units": unit, "long_name": meaning, "clutter_removal": "none", "time_s": time}
            )
            for number, axis_name in enumerate(axes):
                data.dims[number].attach_scale(self._file[axis_name])

    def close(self) -> None:
        """Write what is held, and let the file go; may be called again."""
        self._file.close()
        self._written.close()
