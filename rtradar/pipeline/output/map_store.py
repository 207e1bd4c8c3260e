"""HDF5 file of maps that grow step by step, with their axes: netCDF-4 to those who read it so."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body import Body
from rtradar.errors import InputError
from rtradar.pipeline.output.truth import OF_PARTS, TRUTH, Parts, truth_axes, truth_of
from rtradar.system.files import LastingFile

if TYPE_CHECKING:
    import xarray as xr

_SINCE = "since the start of the capture"
_AXES = {
    "time": ("s", f"centre of the processing window {_SINCE}"),
    "slow_time": ("s", f"centre of the averaged cycles {_SINCE}"),
    "spectrogram_time": ("s", f"centre of the spectrogram's window {_SINCE}"),
    "range": ("m", "half the path from Tx to Rx"),
    "velocity": ("m/s", "rate of range, positive receding"),
    "spectrogram_velocity": ("m/s", "rate of range, positive receding"),
    "azimuth": (
        "rad",
        "atan2(y, x) in the radar's frame, positive to the left; "
        "without a z-line asin(y / r), the cone angle",
    ),
    "elevation": ("rad", "asin(z / r) in the radar's frame, positive upward"),
}
_TRUTH = "truth"
_GROWING = ("time", "slow_time", "spectrogram_time")


class _Map(NamedTuple):
    axes: tuple[str, ...]
    meaning: str
    dtype: type = np.float32
    unit: str = "m2"
    sparse: bool = False  # mostly of one value, which costs nothing once compressed


_CELLS = "power summed over detected cells"
_FRAME = ("time", "range", "velocity")
_SLOW = ("spectrogram_time", "spectrogram_velocity")
_COLUMNS_MEAN = "power averaged over channels and a few cycles"
_MAPS = {
    "range_doppler": _Map(_FRAME, "power summed over all channels"),
    "detections": _Map(_FRAME, "1 where a target is detected", np.uint8, "1", sparse=True),
    "source": _Map(
        _FRAME,
        "index of the person, or after them the object, that returned most of a detected cell; "
        "-1: the room, or nobody",
        np.int16,
        "1",
        sparse=True,
    ),
    "range_time": _Map(("slow_time", "range"), _COLUMNS_MEAN),
    "spectrogram": _Map(_SLOW, "power of one channel summed over range"),
    "range_azimuth": _Map(("time", "range", "azimuth"), _CELLS, sparse=True),
    "range_elevation": _Map(("time", "range", "elevation"), _CELLS, sparse=True),
}
_BEFORE = "{} window before clutter was removed"
_MARKED = "1 where a target is detected in range_doppler_received"
_SINGLE = {
    "range_doppler_received": _Map(_FRAME[1:], _BEFORE.format("range_doppler of one")),
    "detections_received": _Map(_FRAME[1:], _MARKED, np.uint8, "1"),
    "range_azimuth_received": _Map(("range", "azimuth"), _BEFORE.format("range_azimuth of that")),
}
_MOST_WAITING = 2_000_000  # bytes of maps that are not yet written
_STEPS_A_CHUNK = 64  # time steps written together, for maps with few numbers a step


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
            self._scale(name, data=np.zeros(0), maxshape=(None,), chunks=(1024,))
        for name, values in fixed.items():
            self._scale(name, data=values)
        for name, kind in _MAPS.items():
            if name in left_out or any(axis not in fixed for axis in kind.axes[1:]):
                continue
            shape = tuple(len(fixed[axis]) for axis in kind.axes[1:])
            steps = 1 if len(shape) > 1 else _STEPS_A_CHUNK
            chunk_bytes = steps * math.prod(shape) * np.dtype(kind.dtype).itemsize
            options: dict[str, Any] = {"maxshape": (None, *shape), "chunks": (steps, *shape)}
            # HDF5 would cache up to 8 MB of each map; only an unfinished chunk needs it.
            options["rdcc_nbytes"] = 0 if steps == 1 else chunk_bytes
            if kind.sparse:
                options |= {"compression": "gzip", "compression_opts": 1, "shuffle": True}
            data = self._file.create_dataset(name, (0, *shape), kind.dtype, **options)
            removal = (clutter_removal or {}).get(kind.axes[0], "none")
            said = {"gaps": attributes["gaps"]} if "gaps" in attributes else {}
            self._describe(data, kind, clutter_removal=removal, **said)
        if parts is not None:
            self._make_truth(parts)

    def _make_truth(self, parts: Parts) -> None:
        """Make the group of what is true of each part, with axes of its own."""
        self._scale(f"{_TRUTH}/time", data=np.zeros(0), maxshape=(None,), chunks=(1024,))
        self._names(f"{_TRUTH}/part", parts.names)
        axes, n_parts = (f"{_TRUTH}/time", f"{_TRUTH}/part"), len(parts.names)
        for name, (dtype, unit, meaning) in OF_PARTS.items():
            # HDF5 has no chunks of nothing.
            sizes = (None, n_parts or None), (_STEPS_A_CHUNK, n_parts or 1)
            options: dict[str, Any] = dict(zip(("maxshape", "chunks"), sizes, strict=True))
            data = self._file.create_dataset(f"{_TRUTH}/{name}", (0, n_parts), dtype, **options)
            self._describe(data, _Map(axes, meaning, dtype, unit))
        data = self._file.create_dataset(f"{_TRUTH}/person", data=parts.person)
        self._describe(data, _Map(axes[1:], "number of the person; -1: an object", np.int64, "1"))

    def _scale(self, name: str, **options: Any) -> None:
        axis, own = self._file.create_dataset(name, **options), name.rpartition("/")[2]
        axis.make_scale(own)
        axis.attrs["units"], axis.attrs["long_name"] = _AXES[own]

    def _names(self, name: str, names: Sequence[str]) -> None:
        """Make an axis of names."""
        own = name.rpartition("/")[2]
        axis = self._file.create_dataset(name, data=list(names), dtype=h5py.string_dtype())
        axis.make_scale(own)
        axis.attrs.update({"units": "1", "long_name": f"name of the {own}"})

    def _describe(self, data: Any, kind: _Map, **attributes: Any) -> None:
        unit = f"{self._unit}2" if kind.unit == "m2" else kind.unit
        data.attrs.update({"units": unit, "long_name": kind.meaning, **attributes})
        for number, axis in enumerate(kind.axes):
            data.dims[number].attach_scale(self._file[axis])

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
        """Append the arrays (part,) of `OF_PARTS` at a time to the group ``truth``."""
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
            kind = _SINGLE[name]
            data = self._file.create_dataset(name, data=np.asarray(values, dtype=kind.dtype))
            self._describe(data, kind, clutter_removal="none", time_s=time_s)

    def put_truth(self, body: Body) -> None:
        """Write what is true of each person of a body at the times of the frames."""
        self._write()
        for name, names in truth_axes(body).items():
            self._names(name, names)
        for name, values in truth_of(body, self._file["time"][:]).items():
            axes, unit, meaning = TRUTH[name]
            data = self._file.create_dataset(name, data=values)
            self._describe(data, _Map(axes, meaning, np.float64, unit))

    def close(self) -> None:
        """Write what is buffered and close the file; may be called again."""
        try:
            if self._file:
                self._write()
        finally:
            self._file.close()
            if self._owned:
                self._raw.close()


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
