"""Samples of a data set for torch, all of one size, so that a `DataLoader` batches them.

The module needs torch, which the extra ``learn`` installs; `Collection.torch` imports it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from rtradar.clouds.sample_files import read_sample


class SampleDataset(Dataset[Any]):
    """Pairs of one array of a sample and the number of its class, read when they are asked for.

    Parameters
    ----------
    paths : sequence of path
        File of each sample.
    labels : sequence of str
        Activity of each sample.
    entry : str
        Name of the array in the files.
    n_points : int, optional
        Number of points of each cloud; None for arrays that are no clouds.
    source : bool
        Whether who returned each point of a spatial cloud is a third entry of each item.

    Attributes
    ----------
    classes : tuple of str
        Names of the classes, ascending; a label is an index into them.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        labels: Sequence[str],
        entry: str,
        n_points: int | None,
        source: bool = False,
    ) -> None:
        self.classes = tuple(sorted(set(labels)))
        self._paths, self._entry, self._n_points = tuple(paths), entry, n_points
        self._source = source
        number = {name: index for index, name in enumerate(self.classes)}
        self._labels = [number[label] for label in labels]

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, index: int) -> tuple[Tensor, int] | tuple[Tensor, int, Tensor]:
        path, in_order = self._paths[index], self._entry == "spatial"
        values = read_sample(path, self._entry)
        if self._n_points is not None:
            values = of_size(values, self._n_points, in_order=in_order)
        item = torch.from_numpy(np.array(values, dtype=np.float32)), self._labels[index]
        if not self._source or self._n_points is None:
            return item
        # The same points are taken of who returned them.
        source = read_sample(path, "spatial_source").astype(np.int64)
        source = of_size(source, self._n_points, in_order=in_order, empty=-2)
        return *item, torch.from_numpy(source)


def of_size(
    points: NDArray[Any], n_points: int, *, in_order: bool = False, empty: int = 0
) -> NDArray[Any]:
    """Take or repeat points of a cloud so that it has ``n_points``, of an empty one ``empty``.

    Points in random order are taken from the first on, those ``in_order`` evenly from all.
    """
    if not len(points):
        return np.full((n_points, *points.shape[1:]), empty, dtype=points.dtype)
    if in_order:
        return points[np.linspace(0, len(points) - 1, n_points).round().astype(np.int64)]
    return points[np.arange(n_points) % len(points)]
