"""Files of a data set: of each sample a NumPy archive that is whole or absent, and their index.

An archive holds ``points``, ``spatial``, perhaps ``spatial_source``, maps and joints, and ``about``
(label and provenance as JSON). It is not compressed and has fixed dates, so that the same sample
gives the same bytes everywhere. Its last 64 bytes, the archive's comment, are the SHA-256 of all
bytes before them. A file that is read may be damaged or come from a stranger, so its contents are
checked before use. All arrays in the files of runs and data sets are listed in ``arrays.toml``,
with all that files say of them.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import tomllib
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.system.checks import brief
from rtradar.system.files import (
    array_header,
    atomic_file,
    open_regular,
    read_arrays,
    read_json,
    remove_parts,
)


class Array(NamedTuple):
    """Axes, meaning, unit and type of an array; a ``sparse`` one is mostly of one value."""

    dims: tuple[str, ...]
    meaning: str
    unit: str = "m2"
    dtype: str = "<f4"
    sparse: bool = False


_TEXT = resources.files("rtradar.clouds").joinpath("arrays.toml").read_text("utf-8")
TABLES: Mapping[str, Mapping[str, Array]] = {
    table: {name: Array(tuple(told.pop("dims")), **told) for name, told in entries.items()}
    for table, entries in tomllib.loads(_TEXT).items()
}
"""Tables of ``arrays.toml``, each with its arrays by name."""

_KEPT = ("spectrogram", "range_doppler", "range_azimuth")
_AXES = ("time", "range", "velocity", "azimuth", "spectrogram_time", "spectrogram_velocity")

ARRAYS: Mapping[str, Array] = {
    **TABLES["samples"],
    **{name: TABLES["maps"][name] for name in _KEPT},
    **{name: TABLES["axes"][name] for name in _AXES},
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


def attributes(name: str) -> dict[str, str]:
    """Return the attributes of an array of a sample: ``units`` and ``long_name``."""
    return {"units": ARRAYS[name].unit, "long_name": ARRAYS[name].meaning}


# -- files -----------------------------------------------------------------------------------------

FORMAT = 1
"""Format number of sample files and of indexes; files with another number are refused."""


UNKNOWN = "unknown"
"""Subject and licence of a recording about which a specification says nothing."""

_DIGEST = 64  # hexadecimal digits of SHA-256
_MAX_BYTES = 200_000_000
_MAX_MAP_BYTES = 190_000_000  # of maps, which leaves room for clouds and provenance
_ABOUT = Array(("byte",), "label and provenance as JSON", dtype="|u1")
_OF_THREE = ("coordinate", "axis")


INDEX = "collection.json"
"""Name of the file that lists the samples of a data set."""

MADE_FROM = "collection.toml"
"""Name of the file that says what a data set was made from."""

_IDENTITY = re.compile(r"[A-Za-z0-9_-]{1,100}")  # a plain name, which cannot lead to another folder


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
    # Keys in order, and arrays of one type and layout, give the same bytes on every machine.
    content = {"format": FORMAT, "label": sample.label, "provenance": sample.provenance}
    about = json.dumps(content, sort_keys=True, allow_nan=False)
    arrays = {
        "points": np.asarray(sample.points, dtype="<f8").reshape(-1, 3),
        "spatial": np.asarray(spatial, dtype="<f8").reshape(-1, 3),
        "about": np.frombuffer(about.encode(), dtype=np.uint8),
    }
    for name, values in sorted((maps or {}).items()):
        arrays[name] = np.ascontiguousarray(values, dtype=ARRAYS[name].dtype)
    buffer = io.BytesIO()  # the only copy: maps may be large
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, values in arrays.items():
            # An entry that is opened so is always dated 1980.
            with archive.open(zipfile.ZipInfo(f"{name}.npy"), "w") as entry:
                np.lib.format.write_array(entry, values, version=(1, 0), allow_pickle=False)
        # Room for the digest at the very end, which is that of everything before it.
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
    # Compared as JSON has them, in which tuples are lists.
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

    The others are not read: the archive holds a checksum for each entry. InputError if the file is
    damaged or larger than 200 MB.
    """
    try:
        # A file that is too large is not even opened.
        size = path.stat().st_size
        if size <= _MAX_BYTES:
            array = read_arrays(path, _MAX_BYTES, [name], _DIGEST)[name]
            _check(name, array.shape, array.dtype)
            if name == "about":
                return _parse_about(array)
            return array.astype(array.dtype.newbyteorder("="), copy=False)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise damaged(path) from None
    raise InputError(
        f"sample '{path}' has {size / 1e6:.0f} MB; {_MAX_BYTES / 1e6:.0f} MB are allowed: "
        "it is none of rtradar's"
    )


def read_shape(path: Path, name: str) -> tuple[int, ...]:
    """Read the shape of an array of a sample's file, without its values."""
    try:
        shape, dtype = array_header(path, name, _MAX_BYTES, _DIGEST)
        _check(name, shape, dtype)
    except (OSError, ValueError, KeyError):
        raise damaged(path) from None
    return shape


def damaged(path: Path) -> InputError:
    """Return the error that a sample's file is damaged."""
    return InputError(
        f"sample '{path}' is damaged; mend the collection with: rtradar dataset build"
    )


def _check(name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Raise ValueError if an array is none of its name."""
    own = ARRAYS.get(name, _ABOUT)
    sizes = zip(shape, own.dims, strict=True)
    if dtype != own.dtype or any(size != 3 for size, axis in sizes if axis in _OF_THREE):
        raise ValueError


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


def sweep(folder: Path) -> None:
    """Remove the partial files of interrupted writers, which must have ended."""
    remove_parts(folder, rf"({_IDENTITY.pattern}\.npz|{re.escape(INDEX)})")


def write_index(folder: Path, identities: Iterable[str]) -> None:
    """Write the list of samples that belong to the data set; the samples need not exist yet.

    InputError if it cannot be written, or its name belongs to a file that is not an index.
    """
    path = folder / INDEX
    # A file of somebody else is not replaced.
    if os.path.lexists(path):  # or a link that leads nowhere
        try:
            _content(path)
        except (OSError, ValueError):
            raise InputError(
                f"'{path}' is there, and no index of a collection; "
                "move it away, or give another folder (--out)"
            ) from None
    content = json.dumps({"format": FORMAT, "samples": sorted(identities)}, indent=0)
    write_durably(path, content.encode() + b"\n")


def read_index(folder: Path) -> tuple[str, ...]:
    """Read the ids of the samples of a data set, ascending; InputError if there is no index."""
    path, anew = folder / INDEX, "with: rtradar dataset build"
    try:
        content = _content(path)
    except OSError as error:
        raise InputError(
            f"'{folder}' holds no collection ({INDEX}: {error.strerror}); make one {anew}"
        ) from None
    except ValueError:
        raise InputError(
            f"'{path}' is damaged; move it away and mend the collection {anew}"
        ) from None
    if content["format"] != FORMAT:
        raise InputError(
            f"'{path}' is no index of format {FORMAT}; build the collection anew {anew}"
        )
    for identity in content["samples"]:
        if not (isinstance(identity, str) and _IDENTITY.fullmatch(identity)):
            raise InputError(
                f"'{path}' names {brief(identity)}, which is no sample; mend the collection {anew}"
            )
    return tuple(sorted(content["samples"]))


def _content(path: Path) -> dict[str, Any]:
    """Return what an index says, of whatever format; OSError or ValueError if it is none."""
    content = read_json(path)
    samples = content.get("samples") if isinstance(content, dict) else None
    if not isinstance(samples, list) or "format" not in content:
        raise ValueError
    return content
