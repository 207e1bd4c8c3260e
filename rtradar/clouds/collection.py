"""Collection: the labelled clouds of one or several data sets, each read when it is asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds.dataset_store import Sample, read_index, read_sample, sample_path
from rtradar.errors import InputError


class Collection:
    """Labelled clouds of one or several folders, ordered by folder and then by id.

    A cloud is read from its file when it is asked for (`rtradar.clouds.dataset_store`).

    Parameters
    ----------
    *folders : path
        At least one folder made by ``rtradar dataset build``.

    Raises
    ------
    InputError
        If no folder is given, samples are missing or damaged, or a sample is in two folders.
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
                f"{len(self._ids) - len(once)} samples are in more than one of {self._name}; "
                "leave one out"
            )
        self._about = [read_sample(path, "about") for path in self._paths]

    def __len__(self) -> int:
        return len(self._ids)

    def __getitem__(self, index: int) -> Sample:
        about = self._about[index]
        return Sample(self.points(index), about["label"], about["provenance"])

    @property
    def ids(self) -> tuple[str, ...]:
        """Id of each sample."""
        return self._ids

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

        Raises
        ------
        InputError
            If its file is damaged.
        """
        return np.asarray(read_sample(self._paths[index], "points"))

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
        return np.asarray(read_sample(self._paths[index], "spatial"))
