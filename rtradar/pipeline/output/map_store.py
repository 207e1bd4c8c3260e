"""HDF5 file of maps that grow step by step, with their axes: netCDF-4 to those who read it so."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body import Body
from rtradar.clouds.sample_files import TABLES, Array
from rtradar.errors import InputError
from rtradar.pipeline.output.truth import Parts, truth_axes, truth_of
from rtradar.system.hdf5 import LastingFile, netcdf_array

if TYPE_CHECKING:
    import xarray as xr

_TRUTH = "truth"
_GROWING = ("time", "slow_time", "spectrogram_time")
_MOST_WAITING = 2_000_000  # bytes of maps that are not yet written
_STEPS_A_CHUNK = (1024, 64)  # time steps written together, of axes and of rows; 1 of maps


class MapStore:
    """HDF5 file of maps that grow along their first axis; an existing file is replaced.

    The file is a path, or an object such as `io.BytesIO`, which is left open.
    ``fixed`` are the axes (n,) of known values, such as ``range``. Maps with another axis that does
    not grow are left out: a radar without a z-line has no elevation. ``clutter_removal`` says, by
    growing axis, how static clutter was removed from the maps along it; ``none`` if left out. It
    becomes an attribute of their datasets, ``attributes`` those of the file. The maps ``left_out``
    are not made. ``unit`` is that of the samples, whose square is that of powers. For the ``parts``
    there is a group ``truth``.
    """

    def __init__(
        self,
        file: Path | BinaryIO,
        fixed: Mapping[str, NDArray[np.float64]],
        attributes: Mapping[str, Any],
        clutter_removal: Mapping[str, str] | None = None,
        left_out: Collection[str] = (),
        unit: str = "m",
        parts: Parts | None = None,
    ) -> None:
        # The newest format indexes growing data in constant memory.
        self._owned, self._unit = isinstance(file, Path), unit
        self._raw = LastingFile(file.open("w+b") if isinstance(file, Path) else file)
        self._file = h5py.File(self._raw, "w", libver="latest")
        self._waiting: dict[str, list[NDArray[Any]]] = {}
        self._waiting_bytes = 0
        self._file.attrs.update(attributes)
        for name in _GROWING:
            self._growing(name, TABLES["axes"][name])
        for name, values in fixed.items():
            self._make(name, TABLES["axes"][name], data=values)
        said = {"gaps": attributes["gaps"]} if "gaps" in attributes else {}
        for name, kind in TABLES["maps"].items():
            if name in left_out or any(axis not in fixed for axis in kind.dims[1:]):
                continue
            removal = (clutter_removal or {}).get(kind.dims[0], "none")
            shape = tuple(len(fixed[axis]) for axis in kind.dims[1:])
            self._growing(name, kind, shape, clutter_removal=removal, **said)
        if parts is not None:
            # A group with axes of its own.
            self._growing(f"{_TRUTH}/time", TABLES["axes"]["time"])
            self._make(f"{_TRUTH}/part", TABLES["names"]["part"], data=list(parts.names))
            for name, kind in TABLES["parts"].items():
                self._growing(f"{_TRUTH}/{name}", kind, (len(parts.names),))
            self._make(f"{_TRUTH}/person", TABLES["owners"]["person"], data=parts.person)

    def _growing(self, name: str, kind: Array, shape: tuple[int, ...] = (), **said: object) -> None:
        """Make an array of no steps of this shape yet."""
        steps = _STEPS_A_CHUNK[len(shape)] if len(shape) < 2 else 1
        chunk = steps, *(size or 1 for size in shape)  # HDF5 has no chunks of nothing
        options: dict[str, Any] = {"maxshape": (None, *(size or None for size in shape))}
        # HDF5 would cache up to 8 MB of each map; only an unfinished chunk needs it.
        chunk_bytes = math.prod(chunk) * np.dtype(kind.dtype).itemsize
        options |= {"chunks": chunk, "rdcc_nbytes": 0 if steps == 1 else chunk_bytes}
        if kind.sparse:
            options |= {"compression": "gzip", "compression_opts": 1, "shuffle": True}
        self._make(name, kind, said, shape=(0, *shape), **options)

    def _make(self, name: str, kind: Array, said: Any = (), **options: Any) -> None:
        """Make an array with its unit, its meaning and what is ``said``, and its axes."""
        dtype = h5py.string_dtype() if kind.dtype == "text" else kind.dtype
        unit = f"{self._unit}2" if kind.unit == "m2" else kind.unit
        data = netcdf_array(self._file, name, kind.dims, unit, kind.meaning, dtype=dtype, **options)
        data.attrs.update(said)

    def extend(self, axis: str, values: ArrayLike, **maps: ArrayLike) -> None:
        """Append the steps ``values (n,)`` [s] to a growing axis, and (n, ...) to maps along it.

        They wait until there are some megabytes, for HDF5 takes as long for one step as for many.
        """
        for name, added in ((axis, values), *maps.items()):
            steps: NDArray[Any] = np.array(added, dtype=self._file[name].dtype)
            self._waiting.setdefault(name, []).append(steps)
            self._waiting_bytes += steps.nbytes
        if self._waiting_bytes >= _MOST_WAITING:
            self._write()

    def extend_truth(self, time_s: float, of_parts: Mapping[str, NDArray[Any]]) -> None:
        """Append the arrays (part,) of `truth_of_parts` at a time to the group ``truth``."""
        added = {f"{_TRUTH}/{name}": values[None] for name, values in of_parts.items()}
        self.extend(f"{_TRUTH}/time", [time_s], **added)

    def _write(self) -> None:
        for name, added in self._waiting.items():
            steps, data = np.concatenate(added), self._file[name]
            data.resize(len(data) + len(steps), axis=0)
            data[len(data) - len(steps) :] = steps
        self._waiting, self._waiting_bytes = {}, 0
        self._raw.check()

    def put(self, time_s: float, **maps: ArrayLike) -> None:
        """Write maps of a single time [s], which do not grow."""
        for name, values in maps.items():
            said = {"clutter_removal": "none", "time_s": time_s}
            self._make(name, TABLES["received"][name], said, data=values)

    def put_truth(self, body: Body) -> None:
        """Write what is true of each person of a body at the times of the frames."""
        self._write()
        for name, names in truth_axes(body).items():
            self._make(name, TABLES["names"][name], data=list(names))
        for name, values in truth_of(body, self._file["time"][:]).items():
            self._make(name, TABLES["people"][name], data=values)

    def close(self) -> None:
        """Write what is buffered and close the file; may be called again."""
        try:
            if self._file:
                self._write()
        finally:
            self._file.close()
            if self._owned:
                self._raw.close()
                self._raw.check()


def read_maps(file: Path | BinaryIO) -> h5py.File:
    """Open what a `MapStore` has written, without HDF5's cache, which would hold 8 MB of each map.

    Whoever reads maps through reads each chunk once.
    """
    return h5py.File(file, "r", rdcc_nbytes=0)


def open_maps(file: Path | BinaryIO) -> xr.Dataset:
    """Open what a `MapStore` has written; values are read when they are needed.

    An `InputError` is raised if the file is not there any more, or is damaged.
    """
    return _opened(file)


def read_truth(file: Path | BinaryIO) -> xr.Dataset:
    """Read what is true of each part, the group ``truth``; errors as of `open_maps`."""
    with _opened(file, _TRUTH) as truth:
        return truth.load().assign(visible=truth["visible"].astype(bool))


def _opened(file: Path | BinaryIO, group: str | None = None) -> xr.Dataset:
    import xarray as xr  # slow to import

    try:
        # Values as they are stored: times are numbers of seconds, and 0 is no missing power.
        return xr.open_dataset(file, engine="h5netcdf", decode_cf=False, group=group)
    except (OSError, ValueError, KeyError) as error:
        raise InputError(
            f"'{file}' cannot be read as the maps of a run ({error}); make it anew with rt.run"
        ) from None
