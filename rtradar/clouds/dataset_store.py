"""Data sets of labelled clouds: one archive for each sample, and an index of the samples.

A sample's file is a NumPy archive of ``points``, ``spatial`` and ``about`` (label and provenance as
JSON). It is not compressed and has fixed dates, so that the same sample gives the same bytes
everywhere. Its last 64 bytes, the archive's comment, are the SHA-256 of all bytes before them.
Every file is written beside its place and then renamed, so that it is either complete or absent. A
file that is read may be damaged or come from a stranger, so its contents are checked before use.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.cards import html_card, text_card
from rtradar.clouds import display
from rtradar.errors import InputError
from rtradar.system.checks import brief
from rtradar.system.files import atomic_file, open_regular, read_json, remove_parts

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from rtradar.clouds.torch_dataset import SampleDataset

FORMAT = 1
"""Format number of sample files and of the index; files with another number are refused."""

INDEX = "collection.json"
"""Name of the file that lists the samples of a data set."""


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
"""Arrays that the file of a sample may hold: clouds, maps, joints, and the axes of those."""

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
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, values in arrays.items():
            entry = io.BytesIO()
            np.lib.format.write_array(entry, values, version=(1, 0), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), entry.getvalue())  # always dated 1980
        archive.comment = b"0" * _DIGEST
    body = buffer.getvalue()[:-_DIGEST]
    whole = body + hashlib.sha256(body).hexdigest().encode()
    _write_durably(sample_path(folder, identity), whole)
    return len(whole)


def check_size(maps: Mapping[str, NDArray[Any]]) -> None:
    """Raise InputError if a sample with these maps would be too large to be read again."""
    if (size := sum(values.nbytes for values in maps.values())) > _MAX_MAP_BYTES:
        raise InputError(
            f"maps and joints have {size / 1e6:.0f} MB; {_MAX_MAP_BYTES / 1e6:.0f} MB are allowed: "
            "keep less (keep), or take shorter intervals (duration_s)"
        )


def is_whole(path: Path) -> bool:
    """Return whether a sample's file exists and its digest matches its content."""
    try:
        with open_regular(path) as file:
            content = file.read()
    except OSError:
        return False
    digest = hashlib.sha256(content[:-_DIGEST]).hexdigest().encode()
    return len(content) > _DIGEST and digest == content[-_DIGEST:]


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
        raise _damaged(path) from None
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
        raise _damaged(path) from None


def _damaged(path: Path) -> InputError:
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


def sweep(folder: Path) -> int:
    """Remove the partial files of interrupted writers, which must have ended; return how many."""
    return remove_parts(folder, rf"({_IDENTITY.pattern}\.npz|{re.escape(INDEX)})")


def write_index(folder: Path, identities: Iterable[str]) -> None:
    """Write the list of samples that belong to the data set; the samples need not exist yet.

    InputError if it cannot be written, or its name belongs to a file that is not an index.
    """
    path = folder / INDEX
    if os.path.lexists(path) and not _is_index(path):
        raise InputError(
            f"'{path}' is there, and no index of a collection; "
            "move it away, or give another folder (--out)"
        )
    content = json.dumps({"format": FORMAT, "samples": sorted(identities)}, indent=0)
    _write_durably(path, content.encode() + b"\n")


def read_index(folder: Path) -> tuple[str, ...]:
    """Read the ids of the samples of a data set, ascending; InputError if there is no index."""
    path = folder / INDEX
    try:
        content = read_json(path)
    except OSError as error:
        raise InputError(
            f"'{folder}' holds no collection ({INDEX}: {error.strerror}); "
            "make one with: rtradar dataset build"
        ) from None
    except ValueError:
        raise InputError(
            f"'{path}' is damaged; move it away and mend the collection with: rtradar dataset build"
        ) from None
    if not _has_index_keys(content) or content["format"] != FORMAT:
        raise InputError(
            f"'{path}' is no index of format {FORMAT}; "
            "build the collection anew with: rtradar dataset build"
        )
    identities = content["samples"]
    for identity in identities:
        if not (isinstance(identity, str) and _IDENTITY.fullmatch(identity)):
            raise InputError(
                f"'{path}' names {brief(identity)}, which is no sample; "
                "mend the collection with: rtradar dataset build"
            )
    return tuple(sorted(identities))


def _is_index(path: Path) -> bool:
    """Return whether a file looks like an index, whatever its format number."""
    try:
        return _has_index_keys(read_json(path))
    except (OSError, ValueError):
        return False


def _has_index_keys(content: Any) -> bool:
    found = content if isinstance(content, dict) else {}
    return "format" in found and isinstance(found.get("samples"), list)


def _write_durably(path: Path, content: bytes) -> None:
    with atomic_file(path) as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())


class Collection:
    """Labelled clouds of one or several folders, ordered by folder and then by id.

    Labels and provenance are read at once, a cloud from its file when it is asked for.

    Parameters
    ----------
    *folders : path
        At least one folder made by ``rtradar dataset build``.

    Attributes
    ----------
    folders : tuple of path
        Folders of the samples.
    ids : tuple of str
        Id of each sample.

    Raises
    ------
    InputError
        If no folder is given, samples are missing or damaged, or a sample is in two folders; also
        where a cloud of a damaged file is read.
    """

    def __init__(self, *folders: str | Path) -> None:
        if not folders:
            raise InputError("no folder of clouds; give at least one of rtradar dataset build")
        self.folders = tuple(Path(folder) for folder in folders)
        found = {folder: read_index(folder) for folder in self.folders}
        self._name = ", ".join(f"'{folder}'" for folder in found)
        self._paths = [
            sample_path(folder, identity) for folder, ids in found.items() for identity in ids
        ]
        self.ids = tuple(path.stem for path in self._paths)
        for folder, ids in found.items():
            missing = sum(not sample_path(folder, identity).is_file() for identity in ids)
            if missing:
                raise InputError(
                    f"collection '{folder}': {missing} of {len(ids)} samples are missing; "
                    "finish it with: rtradar dataset build"
                )
        if repeated := len(self.ids) - len(set(self.ids)):
            raise InputError(
                f"{repeated} samples are in more than one of {self._name}; leave one out"
            )
        self._about = [read_sample(path, "about") for path in self._paths]

    def __repr__(self) -> str:
        lines = {label.lower(): value for label, value in self._rows.items()}
        return text_card("Collection", self._name, lines)

    def _repr_html_(self) -> str:
        return html_card("Collection", self._name, {"": self._rows})

    @property
    def _rows(self) -> dict[str, str]:
        return display.rows(self.labels.tolist(), [about["provenance"] for about in self._about])

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, index: int) -> Sample:
        about = self._about[index]
        return Sample(self.points(index), about["label"], about["provenance"])

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the activities, ascending."""
        return tuple(sorted({about["label"] for about in self._about}))

    @property
    def labels(self) -> NDArray[np.str_]:
        """Activity of each sample, (sample,)."""
        return np.array([about["label"] for about in self._about], dtype=np.str_)

    def column(self, name: str) -> NDArray[Any]:
        """Return one entry of the provenance of each sample, without reading the clouds.

        Parameters
        ----------
        name : str
            Name of the entry, such as ``subject`` or ``snr_db``.

        Returns
        -------
        (sample,) ndarray
            Values of the entry, None for a sample that lacks it.

        Raises
        ------
        InputError
            If no sample has such an entry.
        """
        if not any(name in about["provenance"] for about in self._about):
            known = sorted({key for about in self._about for key in about["provenance"]})
            raise InputError(
                f"collection {self._name}: no sample has '{name}'; there are: {', '.join(known)}"
            )
        values = [about["provenance"].get(name) for about in self._about]
        if all(isinstance(value, int | float | str) for value in values):
            return np.array(values)
        # Assigned to an object array, because lists of equal length would become a second axis.
        column = np.empty(len(values), dtype=object)
        column[:] = values
        return column

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of arrays that every sample holds: clouds, and what the data set keeps."""
        kept = [set(self._kept(index)) for index in range(len(self))]
        shared = set.intersection(*kept) if kept else set()
        return ("clouds", "spatial", *(kind for kind in KINDS if kind in shared))

    def _kept(self, index: int) -> list[str]:
        """Return the kinds of arrays that a sample holds beside its clouds."""
        kept = self._about[index]["provenance"].get("keep")
        return [kind for kind in KINDS if kind in kept] if isinstance(kept, list) else []

    def maps(self, index: int) -> xr.Dataset:
        """Read the maps and joints that the data set keeps of a sample.

        Parameters
        ----------
        index : int
            Number of the sample, from 0.

        Returns
        -------
        Dataset
            Those of ``spectrogram``, ``range_doppler``, ``range_azimuth`` and ``joints`` that are
            kept, with their axes; units are attributes.

        Raises
        ------
        InputError
            If its file is damaged.
        """
        import xarray as xr

        kept = [KINDS[kind] for kind in self._kept(index)]
        axes = {axis for name in kept for axis in ARRAYS[name].dims if axis in ARRAYS}
        found = {
            name: (ARRAYS[name].dims, self.array(index, name), attributes(name))
            for name in (*kept, *sorted(axes))
        }
        names = {"joint": self.provenance(index).get("joint_names", []), "axis": list("xyz")}
        try:
            return xr.Dataset(found, names if "joints" in kept else {}).set_coords(axes)
        except (ValueError, TypeError):  # arrays of a stranger's file that do not fit each other
            raise _damaged(self._paths[index]) from None

    def to_pandas(self) -> pd.DataFrame:
        """Return what is known of every sample, without reading the clouds.

        Returns
        -------
        DataFrame
            One row for each sample, under its id: ``activity``, its class number ``label``, all
            entries of the provenance, such as subject, recording, licence, radar, scene, fidelity,
            heading_deg, snr_db and seed, the ``folder`` of the sample and the ``digest`` of its
            file (SHA-256). What a sample lacks is NaN or None.

        Raises
        ------
        InputError
            If the file of a sample is not there any more.
        """
        import pandas as pd

        number = {name: index for index, name in enumerate(self.classes)}
        rows = []
        for about, path in zip(self._about, self._paths, strict=True):
            own = {"activity": about["label"], "label": number[about["label"]]}
            # What is first stays first, and what is last is said.
            row = own | about["provenance"] | own
            rows.append(row | {"folder": str(path.parent), "digest": read_digest(path)})
        return pd.DataFrame(rows, index=pd.Index(self.ids, name="id"))

    def torch(self, kind: str = "clouds", *, points: int = 1000) -> SampleDataset:
        """Return the samples as a `torch.utils.data.Dataset`, for a `DataLoader`.

        All items have one size, so that they can be batched as they are. They follow from the
        samples alone: the same item is the same in every epoch, worker and session.

        Parameters
        ----------
        kind : str
            Array of each sample: ``clouds`` gives (point, 3) time [s], range [m] and velocity
            [m/s], ``spatial`` (point, 3) world coordinates [m]. If the data set keeps them,
            ``spectrograms`` gives (time, velocity), ``range_doppler`` (time, range, velocity) and
            ``range_azimuth`` (time, range, azimuth) power [m^2], and ``joints`` (time, joint, 3)
            world coordinates [m].
        points : int
            Number of points of each cloud. Of larger clouds as many are taken, a random sample of
            an RDT cloud; points of smaller ones are repeated, and an empty one becomes zeros.

        Returns
        -------
        torch.utils.data.Dataset
            Pairs of a float32 tensor and the class number, an index into its ``classes``.

        Raises
        ------
        InputError
            If torch is missing, the kind is unknown or not kept, its arrays have several sizes, or
            the number of points is not positive.
        """
        if kind not in KINDS:
            raise InputError(f"kind = {brief(kind)} is unknown; allowed: {', '.join(KINDS)}")
        if isinstance(points, bool) or not isinstance(points, int) or points < 1:
            raise InputError(f"points = {brief(points)}; it must be a whole number from 1 on")
        try:
            from rtradar.clouds.torch_dataset import SampleDataset
        except ImportError:
            raise InputError(
                "Collection.torch needs torch; install the extra 'learn' of rtradar, "
                "in a checkout: pip install -e '.[learn]'"
            ) from None
        if kind not in self.kinds:
            raise InputError(
                f"not every sample of collection {self._name} holds {kind}, only "
                f'{", ".join(self.kinds)}; build it anew with keep = ["{kind}"]'
            )
        clouds = kind in ("clouds", "spatial")
        shapes = set() if clouds else set(self.shapes(KINDS[kind]))
        if len(shapes) > 1:
            raise InputError(
                f"{kind} of collection {self._name} have {len(shapes)} sizes, such as "
                f"{' and '.join(map(str, sorted(shapes)[:2]))}, which cannot be batched; "
                "build data sets of one duration_s and one radar"
            )
        return SampleDataset(
            self._paths, self.labels.tolist(), KINDS[kind], points if clouds else None
        )

    def provenance(self, index: int) -> Mapping[str, Any]:
        """Return the provenance of a sample, without reading its cloud.

        Parameters
        ----------
        index : int
            Number of the sample, from 0.

        Returns
        -------
        mapping
        """
        provenance: Mapping[str, Any] = self._about[index]["provenance"]
        return provenance

    def array(self, index: int, name: str) -> NDArray[Any]:
        """Read an array of a sample by its name in the file.

        Parameters
        ----------
        index : int
            Number of the sample, from 0.
        name : str
            Name of the array, such as ``points`` or ``spectrogram``.

        Returns
        -------
        ndarray

        Raises
        ------
        InputError
            If its file is damaged, or lacks the array.
        """
        return np.asarray(read_sample(self._paths[index], name))

    def shapes(self, name: str) -> list[tuple[int, ...]]:
        """Return the shape of an array of every sample, without reading the values.

        Parameters
        ----------
        name : str
            Name of the array, such as ``points`` or ``spectrogram``.

        Returns
        -------
        list of tuple of int

        Raises
        ------
        InputError
            If a file is damaged, or lacks the array.
        """
        return [read_shape(path, name) for path in self._paths]

    def points(self, index: int) -> NDArray[np.float64]:
        """Read the RDT cloud of a sample.

        Parameters
        ----------
        index : int
            Number of the sample, from 0.

        Returns
        -------
        (n, 3) float64
            Time [s], range [m] and velocity [m/s] of each point.
        """
        return self.array(index, "points")

    def spatial(self, index: int) -> NDArray[np.float64]:
        """Read the spatial cloud of the same capture.

        Parameters
        ----------
        index : int
            Number of the sample, from 0.

        Returns
        -------
        (m, 3) float64
            World coordinates x, y and z [m] in the order of time; m may be 0. A coordinate that the
            radar does not measure is NaN in every point (`SpatialCloud`).

        Raises
        ------
        InputError
            If its file is damaged.
        """
        return self.array(index, "spatial")
