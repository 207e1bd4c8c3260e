"""A collection: a folder of clouds with labels, a file a sample, each whole or not there, read when it is asked for.

A sample's file is named by its id. It is a NumPy archive of ``points``, ``spatial`` and ``about`` (label and provenance, as
JSON), not compressed and with fixed dates, so that the same sample is the same bytes everywhere; the last 64 bytes, which are
the archive's comment, are the SHA-256 of all before. ``collection.json`` names the samples that belong.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds.collection_index import read_index
from rtradar.clouds.sample import Sample, sample_path
from rtradar.clouds.sample_file import read_sample
from rtradar.errors import InputError


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
            raise InputError(
                "no folder of clouds; give at least one that rtradar dataset build made"
            )
        found = {Path(folder): read_index(Path(folder)) for folder in folders}
        self._name = ", ".join(f"'{folder}'" for folder in found)
        self._paths = [
            sample_path(folder, identity) for folder, ids in found.items() for identity in ids
        ]
        self._ids = tuple(path.stem for path in self._paths)
        for folder, ids in found.items():
            if missing := [
                identity for identity in ids if not sample_path(folder, identity).is_file()
            ]:
                raise InputError(
                    f"collection '{folder}': {len(missing)} of {len(ids)} samples are missing; "
                    "finish it with: rtradar dataset build"
                )
        if len(once := set(self._ids)) < len(self._ids):
            raise InputError(
                f"{len(self._ids) - len(once)} samples are in more than one of {self._name}; leave one out"
            )
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
            raise InputError(
                f"collection {self._name}: no sample has '{name}'; there are: {', '.join(known)}"
            )
        values = [about["provenance"].get(name) for about in self._about]
        if all(isinstance(value, int | float | str) for value in values):
            return np.array(values)
        column = np.empty(
            len(values), dtype=object
        )  # else lists of one length would become an axis
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

        NaN throughout in a coordinate that the radar has not measured, as of `SpatialCloud`.

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
