"""Samples of a data set for torch, all of one size, so that a `DataLoader` batches them.

The module needs torch, which the extra ``learn`` installs; `Collection.torch` imports it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils.data import Dataset

from rtradar.clouds.sample_files import read_sample


class SampleDataset(Dataset[tuple[Tensor, int]]):
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

    Attributes
    ----------
    classes : tuple of str
        Names of the classes, ascending; a label is an index into them.
    """

    def __init__(
        self, paths: Sequence[Path], labels: Sequence[str], entry: str, n_points: int | None
    ) -> None:
        self.classes = tuple(sorted(set(labels)))
        self._paths, self._entry, self._n_points = tuple(paths), entry, n_points
        number = {name: index for index, name in enumerate(self.classes)}
        self._labels = [number[label] for label in labels]

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, index: int) -> tuple[Tensor, int]:
        values = read_sample(self._paths[index], self._entry)
        if self._n_points is not None:
            values = of_size(values, self._n_points, in_order=self._entry == "spatial")
        return torch.from_numpy(np.array(values, dtype=np.float32)), self._labels[index]


def of_size(
    points: NDArray[np.float64], n_points: int, *, in_order: bool = False
) -> NDArray[np.float64]:
    """Take or repeat points of a cloud so that it has ``n_points``; an empty one gets zeros.

    Points in random order are taken from the first on, those ``in_order`` evenly from all.
    """
    if not len(points):
        return np.zeros((n_points, 3))
    if in_order:
        return points[np.linspace(0, len(points) - 1, n_points).round().astype(np.int64)]
    return points[np.arange(n_points) % len(points)]
