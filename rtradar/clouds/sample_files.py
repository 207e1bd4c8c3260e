"""File of one sample of a data set: a NumPy archive that is whole or absent.

It holds ``points``, ``spatial``, perhaps ``spatial_source``, maps and joints, and ``about`` (label
and provenance as JSON). It is not compressed and has fixed dates, so that the same sample gives the
same bytes everywhere. Its last 64 bytes, the archive's comment, are the SHA-256 of all bytes before
them. A
file that is read may be damaged or come from a stranger, so its contents are checked before use.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.system.files import atomic_file, open_regular

FORMAT = 1
"""Format number of sample files and of indexes; files with another number are refused."""


class Array(NamedTuple):
    """Axes, unit, meaning and type of an array of a sample."""

    dims: tuple[str, ...]
    unit: str
    meaning: str
    dtype: str = "<f8"


_SINCE = "since the start of the capture"
ARRAYS: Mapping[str, Array] = {
    "points": Array(("point", "coordinate"), "s, m, m/s", "time, range and velocity of the points"),
    "spatial": Array(("spatial_point", "axis"), "m", "world x, y and z of the points"),
    "spatial_source": Array(
        ("spatial_point",),
        "1",
        "who returned most of the point: 0 the person of the label, then others and objects, "
        "as source_names lists them; -1 the room or nobody; -2 not known",
        "<i2",
    ),
    "spectrogram": Array(
        ("spectrogram_time", "spectrogram_velocity"),
        "m2",
        "power of one channel summed over range",
        "<f4",
    ),
    "range_doppler": Array(
        ("time", "range", "velocity"), "m2", "power summed over all channels", "<f4"
    ),
    "range_azimuth": Array(
        ("time", "range", "azimuth"), "m2", "power summed over detected cells", "<f4"
    ),
    "joints": Array(("time", "joint", "axis"), "m", "world x, y and z of the joints"),
    "time": Array(("time",), "s", f"centre of the processing window {_SINCE}"),
    "range": Array(("range",), "m", "half the path from Tx to Rx"),
    "velocity": Array(("velocity",), "m/s", "rate of range, positive receding"),
    "azimuth": Array(("azimuth",), "rad", "azimuth in the radar's frame, positive to the left"),
    "spectrogram_time": Array(
        ("spectrogram_time",), "s", f"centre of the spectrogram's window {_SINCE}"
    ),
    "spectrogram_velocity": Array(
        ("spectrogram_velocity",), "m/s", "rate of range, positive receding"
    ),
}
"""Arrays that the file of a sample may hold: clouds, maps, joints, and the axes of those.

``spatial_source`` is there where ``source_names`` of the provenance lists several people or
objects.
"""

KINDS = {
    "clouds": "points",
    "spatial": "spatial",
    "spectrograms": "spectrogram",
    "range_doppler": "range_doppler",
    "range_azimuth": "range_azimuth",
    "joints": "joints",
}
"""What a data set may hold of each sample, and the name of its array."""

UNKNOWN = "unknown"
"""Subject and licence of a recording about which a specification says nothing."""

_DIGEST = 64  # hexadecimal digits of SHA-256
_MAX_BYTES = 200_000_000
_MAX_MAP_BYTES = 190_000_000  # of maps, which leaves room for clouds and provenance
_DTYPES = {name: np.dtype(array.dtype) for name, array in ARRAYS.items()} | {
    "about": np.dtype("u1")
}
_OF_THREE = ("coordinate", "axis")


@dataclass(frozen=True)
class Sample:
    """One RDT cloud with its label and its provenance.

    Parameters
    ----------
    points : (n, 3) float64
        Time [s], range [m] and velocity [m/s] of each point, in random order, so that the first k
        points are a random sample too. The array is empty if nothing was detected.
    label : str
        Activity of the person.
    provenance : mapping
        Plain JSON values: recording, subject, source ("synthetic" or "recorded"), start_s,
        duration_s, radar, scene, fidelity, snr_db, heading_deg, seed, licence, version, and more.
    """

    points: NDArray[np.float64]
    label: str
    provenance: Mapping[str, Any]


def attributes(name: str) -> dict[str, str]:
    """Return the attributes of an array: ``units`` and ``long_name``."""
    return {"units": ARRAYS[name].unit, "long_name": ARRAYS[name].meaning}


def sample_path(folder: Path, identity: str) -> Path:
    """Path of a sample's file."""
    return folder / f"{identity}.npz"


def write_sample(
    folder: Path,
    identity: str,
    sample: Sample,
    spatial: ArrayLike,
    maps: Mapping[str, ArrayLike] | None = None,
) -> int:
    """Write the file of a sample, flush it to disk, and return its size [bytes].

    ``spatial`` (m, 3) is the spatial cloud of the same capture [m], ``maps`` are more of `ARRAYS`.
    Equal samples give equal bytes. InputError if the file cannot be written; the folder is then
    unchanged.
    """
    content = {"format": FORMAT, "label": sample.label, "provenance": sample.provenance}
    about = json.dumps(content, sort_keys=True, allow_nan=False)
    arrays = {
        "points": np.asarray(sample.points, dtype="<f8").reshape(-1, 3),
        "spatial": np.asarray(spatial, dtype="<f8").reshape(-1, 3),
        "about": np.frombuffer(about.encode(), dtype=np.uint8),
    }
    for name, values in sorted((maps or {}).items()):
        arrays[name] = np.ascontiguousarray(values, dtype=_DTYPES[name])
    buffer = io.BytesIO()  # the only copy: maps may be large
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, values in arrays.items():
            # An entry that is opened so is always dated 1980.
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w") as entry:
                np.lib.format.write_array(entry, values, version=(1, 0), allow_pickle=False)
        archive.comment = b"0" * _DIGEST
    whole = buffer.getbuffer()
    whole[-_DIGEST:] = _digest(whole[:-_DIGEST])
    write_durably(sample_path(folder, identity), whole)
    return len(whole)


def check_size(maps: Mapping[str, NDArray[Any]]) -> None:
    """Raise InputError if a sample with these maps would be too large to be read again."""
    if (size := sum(values.nbytes for values in maps.values())) > _MAX_MAP_BYTES:
        raise InputError(
            f"maps and joints have {size / 1e6:.0f} MB; {_MAX_MAP_BYTES / 1e6:.0f} MB are allowed: "
            "keep less (keep), or take shorter intervals (duration_s)"
        )


def is_whole(path: Path, parameters: Mapping[str, Any] | None = None) -> bool:
    """Return whether a sample's file exists and its digest matches its content.

    With ``parameters``, whether its provenance has them, too: a copy of another sample has not.
    """
    try:
        with open_regular(path) as file:
            content = memoryview(file.read())
    except OSError:
        return False
    if len(content) <= _DIGEST or _digest(content[:-_DIGEST]) != content[-_DIGEST:]:
        return False
    if parameters is None:
        return True
    found = read_sample(path, "about")["provenance"]
    wanted = json.loads(json.dumps(parameters))
    return all(name in found and found[name] == value for name, value in wanted.items())


def _digest(content: memoryview) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()


def read_digest(path: Path) -> str:
    """Read the digest at the end of a sample's file; InputError if it cannot be read."""
    try:
        with open_regular(path) as file:
            file.seek(-_DIGEST, os.SEEK_END)
            return file.read().decode("ascii")
    except (OSError, ValueError) as error:
        raise InputError(
            f"sample '{path}' cannot be read ({error}); "
            "mend the collection with: rtradar dataset build"
        ) from None


def read_sample(path: Path, name: str) -> Any:
    """Read one entry of a sample's file: one of `ARRAYS`, or the dict ``about``.

    The others are not read: the archive holds a checksum for each entry, and its comment marks the
    end of the file. InputError if the file is damaged or larger than 200 MB.
    """
    try:
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
            if size <= _MAX_BYTES:
                array = _read_array(file, name)
                if name == "about":
                    return _parse_about(array)
                return array.astype(array.dtype.newbyteorder("="))
    except Exception:  # readers of archives and headers raise any type if the file is damaged
        raise damaged(path) from None
    raise InputError(
        f"sample '{path}' has {size / 1e6:.0f} MB; {_MAX_BYTES / 1e6:.0f} MB are allowed: "
        "it is none of rtradar's"
    )


def read_shape(path: Path, name: str) -> tuple[int, ...]:
    """Read the shape of an array of a sample's file, without its values."""
    try:
        with (
            open_regular(path) as file,
            zipfile.ZipFile(file) as archive,
            archive.open(_entry(archive, name)) as data,
        ):
            return _header(data, name)[0]
    except Exception:  # see read_sample
        raise damaged(path) from None


def damaged(path: Path) -> InputError:
    """Return the error that a sample's file is damaged."""
    return InputError(
        f"sample '{path}' is damaged; mend the collection with: rtradar dataset build"
    )


def _read_array(file: BinaryIO, name: str) -> NDArray[Any]:
    with zipfile.ZipFile(file) as archive:
        data = io.BytesIO(archive.read(_entry(archive, name)))
    shape, dtype = _header(data, name)
    return np.frombuffer(data.getvalue(), dtype, offset=data.tell()).reshape(shape)


def _entry(archive: zipfile.ZipFile, name: str) -> zipfile.ZipInfo:
    """Return the entry of an array; our archives are not compressed: no entry exceeds the file."""
    entry = archive.getinfo(f"{name}.npy")
    if len(archive.comment) != _DIGEST or entry.compress_type != zipfile.ZIP_STORED:
        raise ValueError
    return entry


def _header(data: Any, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Read the shape and the type of an array from its header."""
    if np.lib.format.read_magic(data) != (1, 0):
        raise ValueError
    shape, _, dtype = np.lib.format.read_array_header_1_0(data)
    dims = ARRAYS[name].dims if name in ARRAYS else ("byte",)
    threes = all(size == 3 for size, axis in zip(shape, dims, strict=True) if axis in _OF_THREE)
    if dtype != _DTYPES[name] or not threes:
        raise ValueError
    return shape, dtype


def _parse_about(data: NDArray[np.uint8]) -> dict[str, Any]:
    about: dict[str, Any] = json.loads(data.tobytes())
    known = about["format"] == FORMAT and isinstance(about["label"], str)
    if not known or not isinstance(about["provenance"], dict):
        raise ValueError
    return about


def write_durably(path: Path, content: bytes | memoryview) -> None:
    """Write a file whole or not at all, and flush it to disk."""
    with atomic_file(path) as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
