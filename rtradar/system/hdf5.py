"""HDF5 files: written to disks that may fill up, laid out as netCDF-4, and read from anybody."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, BinaryIO

_MOST_COMPRESSION = 1000  # by which the deflate of HDF5 makes zeros smaller

_AFTERWARDS: Mapping[str, Callable[..., Any]] = {
    "write": lambda data: memoryview(data).nbytes,
    "read": lambda size=-1: bytes(max(size, 0)),
    "readinto": lambda buffer: memoryview(buffer).nbytes,
    "seek": lambda offset, whence=0: offset,
    "tell": lambda: 0,
    "truncate": lambda size=None: size or 0,
    "flush": lambda: None,
    "close": lambda: None,
}
"""What the methods of a `LastingFile` return after a failure, when they do nothing more."""


class LastingFile:
    """A binary file for HDF5 to write, whose failures wait until `check` is called.

    HDF5 cannot close a file that it cannot write: it would print a traceback for each open object,
    and crash as the process ends. So after the first failure further data are dropped, and `check`
    raises the error. It has the methods of files that HDF5 uses.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._error: OSError | None = None

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name not in _AFTERWARDS:
            raise AttributeError(name)

        def lasting(*arguments: Any) -> Any:
            if self._error is None:
                try:
                    return getattr(self._file, name)(*arguments)
                except OSError as error:
                    self._error = error
            return _AFTERWARDS[name](*arguments)

        return lasting

    def check(self) -> None:
        """Raise the first error, an OSError."""
        if self._error is not None:
            raise self._error

    def __enter__(self) -> LastingFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
        self.check()


def netcdf_array(
    file: Any, name: str, dims: tuple[str, ...], unit: str, meaning: str, **options: Any
) -> Any:
    """Make an array of a netCDF-4 file, whose axes are there already; or an axis of that name.

    ``name`` may begin with a group, in which its axes are then. ``options`` are those of HDF5.
    """
    data, own = file.create_dataset(name, **options), name.rpartition("/")[2]
    data.attrs.update({"units": unit, "long_name": meaning})
    if dims == (own,):
        data.make_scale(own)
    else:
        for number, axis in enumerate(dims):
            data.dims[number].attach_scale(data.parent[axis])
    return data


def stored(file: Any, name: str, *, compressed: bool = False) -> Any:
    """Return a dataset of an open HDF5 file that may be anybody's.

    Raises KeyError if there is none, and ValueError if it is no dataset, lies in another file, or
    claims more than its file holds: a thousand times as much, at most, if it may be compressed.
    """
    import h5py

    # Each group on the way is looked at, so that no link leads out of the file.
    data = file
    for step in name.split("/"):
        # Asked before it is followed: a link to another file would have that opened.
        link = data.get(step, getlink=True) if isinstance(data, h5py.Group) else None
        if link is None:
            raise KeyError(f"there is no {name}")
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"{name} is not in this file")
        data = data[step]
    if not isinstance(data, h5py.Dataset) or data.external or data.is_virtual:
        raise ValueError(f"{name} is not in this file")
    # A dataset that claims more than the file can hold would take memory for nothing.
    most = file.id.get_filesize() * (_MOST_COMPRESSION if compressed else 1)
    if data.shape is None or math.prod(data.shape) * max(data.dtype.itemsize, 1) > most:
        raise ValueError(f"{name} claims more than there is")
    return data
