"""A collection: a folder of clouds with labels, a file a sample, each whole or not there, read when it is asked for.

A sample's file is named by its id. It is a NumPy archive of ``points``, ``spatial`` and ``about`` (label and provenance, as
JSON), not compressed and with fixed dates, so that the same sample is the same bytes everywhere; the last 64 bytes, which are
the archive's comment, are the SHA-256 of all before. ``collection.json`` names the samples that belong.
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
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.checks import shown
from rtradar.clouds.sample_file import DIGEST, FORMAT, read_sample
from rtradar.errors import InputError
from rtradar.files import atomic_file, read_json

INDEX = "collection.json"
"""Name of the file that says which samples belong to the collection."""

_IDENTITY = re.compile(r"[A-Za-z0-9_-]{1,100}")  # a name, and no way to another folder


@dataclass(frozen=True)
class Sample:
    """One RDT cloud with its label and where it comes from.

    Parameters
    ----------
    points : (n, 3) float64
        Time [s], range [m], velocity [m/s]; in random order, so that any first part is a sample too. Empty where
        nothing was detected.
    label : str
        The activity.
    provenance : mapping
        Plain JSON values: recording, subject, source ("synthetic" or "recorded"), start_s, duration_s, radar, scene,
        fidelity, snr_db, heading_deg, seed, licence, version, and more.
    """

    points: NDArray[np.float64]
    label: str
    provenance: Mapping[str, Any]


class Collection:
    """Clouds of a folder, or of several; each is read when it is asked for. They stand folder by folder, by their ids.

    Parameters
    ----------
    *folders : path
        As `rtradar dataset build` leaves them; at least one.

    Raises
    ------
    InputError
        Where there is none, samples are missing or damaged, or one is in two folders.
    """

    def __init__(self, *folders: str | Path) -> None:
        if not folders:
            raise InputError("no folder of clouds; give at least one that rtradar dataset build made")
        found = {Path(folder): read_index(Path(folder)) for folder in folders}
        self._name = ", ".join(f"'{folder}'" for folder in found)
        self._paths = [sample_path(folder, identity) for folder, ids in found.items() for identity in ids]
        self._ids = tuple(path.stem for path in self._paths)
        for folder, ids in found.items():
            if missing := [identity for identity in ids if not sample_path(folder, identity).is_file()]:
                raise InputError(
                    f"collection '{folder}': {len(missing)} of {len(ids)} samples are missing; "
                    "finish it with: rtradar dataset build"
                )
        if len(once := set(self._ids)) < len(self._ids):
            raise InputError(f"{len(self._ids) - len(once)} samples are in more than one of {self._name}; leave one out")
        self._about = [read_sample(path, "about") for path in self._paths]

    def __len__(self) -> int:
        return len(self._ids)

    def __getitem__(self, index: int) -> Sample:
        about = self._about[index]
        return Sample(self.points(index), about["label"], about["provenance"])

    @property
    def ids(self) -> tuple[str, ...]:
        """What each sample is called."""
        return self._ids

    @property
    def labels(self) -> NDArray[np.str_]:
        """Activity of each sample, (sample,)."""
        return np.array([about["label"] for about in self._about], dtype=np.str_)

    def column(self, name: str) -> NDArray[Any]:
        """One entry of the provenance of each sample, (sample,); None where a sample has it not. No cloud is read.

        Parameters
        ----------
        name : str
            Such as ``subject`` or ``snr_db``.

        Returns
        -------
        (sample,) ndarray

        Raises
        ------
        InputError
            Where no sample has such an entry.
        """
        if not any(name in about["provenance"] for about in self._about):
            known = sorted({key for about in self._about for key in about["provenance"]})
            raise InputError(f"collection {self._name}: no sample has '{name}'; there are: {', '.join(known)}")
        values = [about["provenance"].get(name) for about in self._about]
        if all(isinstance(value, int | float | str) for value in values):
            return np.array(values)
        column = np.empty(len(values), dtype=object)  # else lists of one length would become an axis
        column[:] = values
        return column

    def points(self, index: int) -> NDArray[np.float64]:
        """The RDT cloud of a sample (n, 3): time [s], range [m], velocity [m/s].

        Parameters
        ----------
        index : int
            Of the sample.

        Returns
        -------
        (n, 3) float64

        Raises
        ------
        InputError
            Where its file is damaged.
        """
        return np.asarray(read_sample(self._paths[index], "points"))

    def spatial(self, index: int) -> NDArray[np.float64]:
        """The spatial cloud of the same capture (m, 3): x, y, z [m], in the order of time; m may be 0.

        Parameters
        ----------
        index : int
            Of the sample.

        Returns
        -------
        (m, 3) float64

        Raises
        ------
        InputError
            Where its file is damaged.
        """
        return np.asarray(read_sample(self._paths[index], "spatial"))


def sample_path(folder: Path, identity: str) -> Path:
    """File of a sample."""
    return folder / f"{identity}.npz"


def write_sample(folder: Path, identity: str, sample: Sample, spatial: ArrayLike) -> int:
    """Write a sample's file: whole, on the disk, then under its name; the same sample gives the same bytes.

    Parameters
    ----------
    folder : path
        Must exist.
    identity : str
        Name of the sample.
    sample : Sample
    spatial : (m, 3) float
        The spatial cloud of the same capture [m].

    Returns
    -------
    int
        Bytes of the file.

    Raises
    ------
    InputError
        Where it cannot be written; the folder is then as it was.
    """
    about = json.dumps(
        {"format": FORMAT, "label": sample.label, "provenance": sample.provenance}, sort_keys=True, allow_nan=False
    )
    arrays = {
        "points": np.asarray(sample.points, dtype="<f8").reshape(-1, 3),
        "spatial": np.asarray(spatial, dtype="<f8").reshape(-1, 3),
        "about": np.frombuffer(about.encode(), dtype=np.uint8),
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, values in arrays.items():
            entry = io.BytesIO()
            np.lib.format.write_array(entry, values, version=(1, 0), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), entry.getvalue())  # dated 1980, always
        archive.comment = b"0" * DIGEST
    body = buffer.getvalue()[:-DIGEST]
    whole = body + hashlib.sha256(body).hexdigest().encode()
    with atomic_file(sample_path(folder, identity)) as file:
        file.write(whole)
        file.flush()
        os.fsync(file.fileno())
    return len(whole)


def is_whole(path: Path) -> bool:
    """Whether a sample's file is there and every byte of it is as it was written."""
    try:
        whole = path.read_bytes()
    except OSError:
        return False
    return len(whole) > DIGEST and hashlib.sha256(whole[:-DIGEST]).hexdigest().encode() == whole[-DIGEST:]


def sweep(folder: Path) -> int:
    """Remove what killed writers left of samples; their number. None may be writing."""
    leftovers = [*folder.glob(".*.npz.*.part"), *folder.glob(f".{INDEX}.*.part")]
    for path in leftovers:
        path.unlink(missing_ok=True)
    return len(leftovers)


def write_index(folder: Path, identities: Iterable[str]) -> None:
    """Say which samples belong to the collection, whether they are there already or not.

    Raises
    ------
    InputError
        Where it cannot be written.
    """
    content = json.dumps({"format": FORMAT, "samples": sorted(identities)}, indent=0)
    with atomic_file(folder / INDEX) as file:
        file.write(content.encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())


def read_index(folder: Path) -> tuple[str, ...]:
    """Ids of the samples that belong to the collection, ascending.

    Raises
    ------
    InputError
        Where the folder holds no collection, or one of another format.
    """
    path = folder / INDEX
    try:
        content = read_json(path)
    except OSError as error:
        why = error.strerror
        raise InputError(f"'{folder}' holds no collection ({INDEX}: {why}); make one with: rtradar dataset build") from None
    except ValueError:
        raise InputError(f"'{path}' is damaged; mend the collection with: rtradar dataset build") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT or not isinstance(content.get("samples"), list):
        raise InputError(f"'{path}' is no index of format {FORMAT}; build the collection anew with: rtradar dataset build")
    identities = content["samples"]
    for identity in identities:
        if not (isinstance(identity, str) and _IDENTITY.fullmatch(identity)):
            raise InputError(
                f"'{path}' names {shown(identity)}, which is no sample; mend the collection with: rtradar dataset build"
            )
    return tuple(sorted(identities))
