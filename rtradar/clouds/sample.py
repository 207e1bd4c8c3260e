"""A sample of a collection, and how its file is written: the same sample gives the same bytes, all there or none."""

from __future__ import annotations

import hashlib
import io
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.clouds.sample_file import DIGEST, FORMAT
from rtradar.system.files import atomic_file, open_regular


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
        {"format": FORMAT, "label": sample.label, "provenance": sample.provenance},
        sort_keys=True,
        allow_nan=False,
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
        with open_regular(path) as file:
            whole = file.read()
    except OSError:
        return False
    return (
        len(whole) > DIGEST
        and hashlib.sha256(whole[:-DIGEST]).hexdigest().encode() == whole[-DIGEST:]
    )
