"""Small classifiers of point sets, whose sizes suit some thousands of clouds.

`PooledNet` is PointNet without its T-Nets and with few layers, which takes the mean over the points
beside the maximum. `EdgeNet` looks at neighbours: the edge convolutions of Y. Wang et al., Dynamic
graph CNN for learning on point clouds, ACM Trans. Graph. 38 (2019) 146, on one graph of neighbours
in scaled time, range and velocity.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod

import torch
from torch import Tensor, nn
from torch.nn import functional

from rtradar.classify.pointnet import PointNet, PointwiseLayer
from rtradar.classify.recipes import Recipe
from rtradar.classify.spectrograms import SpectrogramNet

_POINT_WIDTHS, _CLOUD_WIDTH = (3, 64, 64, 128), 128
_NEIGHBOURS = 12


class _SmallNet(nn.Module, ABC):
    """Classifier of the largest and the mean value of the features of all points."""

    def __init__(self, n_classes: int, recipe: Recipe) -> None:
        super().__init__()
        self.cloud = nn.Sequential(
            nn.Dropout(recipe.dropout),
            nn.Linear(2 * _POINT_WIDTHS[-1], _CLOUD_WIDTH),
            nn.ReLU(),
            nn.Dropout(recipe.dropout),
            nn.Linear(_CLOUD_WIDTH, n_classes),
        )

    @abstractmethod
    def features(self, points: Tensor) -> Tensor:
        """Compute features of every point, (cloud, point, feature)."""

    def forward(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Classify clouds as `PointNet` does; there is no transform that could be skewed."""
        each = self.features(points)
        pooled = torch.cat([each.amax(dim=1), each.mean(dim=1)], dim=1)
        return functional.log_softmax(self.cloud(pooled), dim=1), points.new_zeros(())


class PooledNet(_SmallNet):
    """Three layers over every point, and two over their largest and mean values.

    Parameters
    ----------
    n_classes : int
        Number of classes.
    recipe : Recipe
        Recipe, of which the dropout counts.
    """

    def __init__(self, n_classes: int, recipe: Recipe) -> None:
        super().__init__(n_classes, recipe)
        widths = itertools.pairwise(_POINT_WIDTHS)
        self.points = nn.Sequential(*(PointwiseLayer(*pair) for pair in widths))

    def features(self, points: Tensor) -> Tensor:
        """Compute features of every point, (cloud, point, feature)."""
        found: Tensor = self.points(points)
        return found


class EdgeNet(_SmallNet):
    """Two edge convolutions over the nearest neighbours of every point, and a layer over both.

    Parameters
    ----------
    n_classes, recipe
        See `PooledNet`.
    """

    def __init__(self, n_classes: int, recipe: Recipe) -> None:
        super().__init__(n_classes, recipe)
        width = _POINT_WIDTHS[1] // 2
        self.first = PointwiseLayer(2 * 3, width)
        self.second = PointwiseLayer(2 * width, width)
        self.both = PointwiseLayer(2 * width, _POINT_WIDTHS[-1])

    def features(self, points: Tensor) -> Tensor:
        """Compute features of every point, (cloud, point, feature)."""
        near = torch.cdist(points, points).topk(_NEIGHBOURS, dim=2, largest=False).indices
        first = _over_edges(self.first, points, near)
        second = _over_edges(self.second, first, near)
        found: Tensor = self.both(torch.cat([first, second], dim=2))
        return found


def _over_edges(layer: PointwiseLayer, values: Tensor, near: Tensor) -> Tensor:
    """Largest output over the edges to the neighbours ``near (cloud, point, neighbour)``."""
    n_clouds, n_points, n_near = near.shape
    index = near.reshape(n_clouds, -1, 1).expand(-1, -1, values.shape[2])
    others = values.gather(1, index).view(n_clouds, n_points, n_near, -1)
    own = values[:, :, None].expand_as(others)
    edges = torch.cat([own, others - own], dim=3).flatten(1, 2)
    found: Tensor = layer(edges).view(n_clouds, n_points, n_near, -1).amax(dim=2)
    return found


def build_network(n_classes: int, recipe: Recipe) -> nn.Module:
    """Build the network of a recipe, which gives log-probabilities and a penalty."""
    kinds = {
        "pointnet": PointNet, "pooled": PooledNet, "edges": EdgeNet, "spectrogram": SpectrogramNet
    }  # fmt: skip
    network: nn.Module = kinds[recipe.network](n_classes, recipe)
    return network
