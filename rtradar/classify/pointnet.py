"""The networks: PointNet, a classifier of point sets in any order, and smaller ones.

PointNet is that of Qi, Su, Mo and Guibas, "PointNet: deep learning on point sets for 3D
classification and segmentation" (CVPR 2017, arXiv:1612.00593), appendix C. Two steps are computed
in another order, with the same result up to rounding:

- Batch norm needs the mean and variance of ``W x`` over all points. Both follow from the mean and
  covariance of ``x``, so that the norm can be folded into the weights of the matrix product
  without a pass over the outputs.
- Only the maxima over the points of the layers with 1024 outputs are used. The points of the maxima
  are searched without gradients (bfloat16 only decides between near ties there), and the outputs
  are then computed in float32, with gradients, for these points alone. The backward pass of these
  layers, nine tenths of the network, then costs almost nothing.

The sizes of the small networks suit some thousands of clouds. `PooledNet` is PointNet without its
T-Nets and with few layers, which takes the mean over the points beside the maximum. `EdgeNet` looks
at neighbours: the edge convolutions of Y. Wang et al., Dynamic graph CNN for learning on point
clouds, ACM Trans. Graph. 38 (2019) 146, on one graph of neighbours in scaled time, range and
velocity. `SpectrogramNet` takes spectrograms.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod

import torch
from torch import Tensor, nn
from torch.nn import functional

from rtradar.classify.prepare import VELOCITIES
from rtradar.classify.recipes import Recipe

_GLOBAL_FEATURES = 1024
_MOMENTUM, _EPSILON = 0.1, 1e-5  # torch's defaults of batch norm


def _update_weight(batches: Tensor) -> float:
    """Weight of a new batch in running statistics, which begin as the mean of all batches."""
    return max(_MOMENTUM, 1 / (1 + int(batches)))


class _BatchNorm(nn.BatchNorm1d):
    """Batch norm of clouds with running statistics weighted by `_update_weight`."""

    def forward(self, x: Tensor) -> Tensor:
        if self.training and self.num_batches_tracked is not None:
            self.momentum = _update_weight(self.num_batches_tracked)
        return super().forward(x)


class _NormedLinear(nn.Module):
    """Matrix product and batch norm of its outputs, folded into one matrix product."""

    running_mean: Tensor
    running_variance: Tensor
    batches: Tensor

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        # A bias is not needed, because the norm removes the mean.
        self.linear = nn.Linear(inputs, outputs, bias=False)
        self.gain = nn.Parameter(torch.ones(outputs))
        self.shift = nn.Parameter(torch.zeros(outputs))
        self.register_buffer("running_mean", torch.zeros(outputs))
        self.register_buffer("running_variance", torch.ones(outputs))
        self.register_buffer("batches", torch.tensor(0))

    def folded(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Weight ``(output, input)`` and bias ``(output,)`` with the norm of ``x (row, input)``."""
        weight = self.linear.weight
        if not self.training:
            scale = self.gain * torch.rsqrt(self.running_variance + _EPSILON)
            return weight * scale[:, None], self.shift - scale * self.running_mean
        n_rows = len(x)
        mean_input = x.mean(dim=0)
        centred = x - mean_input
        # The gradient of the covariance is symmetric: the doubled gradient of one factor is that of
        # both, which saves one product in the backward pass.
        half = centred.detach().T @ centred / n_rows
        covariance = 2 * half - half.detach()
        mean = weight @ mean_input
        variance = ((weight @ covariance) * weight).sum(dim=1).clamp(min=0)
        with torch.no_grad():
            weight_of_batch = _update_weight(self.batches)
            self.running_mean.lerp_(mean, weight_of_batch)
            self.running_variance.lerp_(variance * (n_rows / max(1, n_rows - 1)), weight_of_batch)
            self.batches += 1
        scale = self.gain * torch.rsqrt(variance + _EPSILON)
        return weight * scale[:, None], self.shift - scale * mean


class PointwiseLayer(_NormedLinear):
    """Matrix product, batch norm and ReLU for every point, ``(cloud, point, input or output)``."""

    def forward(self, x: Tensor) -> Tensor:
        """Compute the features of every point."""
        rows = x.flatten(0, 1)
        return functional.relu(functional.linear(rows, *self.folded(rows))).view(*x.shape[:2], -1)


class PooledLayer(_NormedLinear):
    """Pointwise layer and maximum over points: ``(cloud, point, input)`` to ``(cloud, output)``.

    During training the point of the maximum is searched in the type ``search``; predictions search
    in the type of the points.
    """

    def __init__(self, inputs: int, outputs: int, search: torch.dtype) -> None:
        super().__init__(inputs, outputs)
        self._search = search

    def forward(self, x: Tensor) -> Tensor:
        """Compute the features of every cloud."""
        weight, bias = self.folded(x.flatten(0, 1))
        with torch.no_grad():
            # Ties of a coarse search go to the first point. That is good enough for training, but
            # predictions must not depend on the order.
            search = self._search if self.training else x.dtype
            points, rows = x.to(search), weight.to(search)
            if x.is_cuda:
                chosen = (rows @ points.transpose(1, 2)).max(dim=2).indices
            else:  # cloud by cloud, so that the outputs of one stay in the cache
                chosen = torch.stack([(rows @ cloud.T).max(dim=1).indices for cloud in points])
            n_clouds, n_points, _ = x.shape
            chosen += n_points * torch.arange(n_clouds, device=x.device)[:, None]
        inputs = x.flatten(0, 1).index_select(0, chosen.flatten()).view(*chosen.shape, -1)
        # The ReLU of the maximum equals the maximum of the ReLU.
        return functional.relu((inputs * weight).sum(dim=2) + bias)


def answer_layers(inputs: int, hidden: int, n_classes: int, dropout: float) -> nn.Sequential:
    """Two layers that answer by the features of a cloud or image, with dropout before each."""
    return nn.Sequential(
        nn.Dropout(dropout),
        nn.Linear(inputs, hidden),
        nn.ReLU(),
        nn.Dropout(dropout),
        nn.Linear(hidden, n_classes),
    )


def largest_and_mean(features: Tensor, axis: int) -> Tensor:
    """Largest and mean value over the points or the times, beside each other."""
    return torch.cat([features.amax(dim=axis), features.mean(dim=axis)], dim=1)


def _dense(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inputs, outputs, bias=False), _BatchNorm(outputs), nn.ReLU())


def _point_layers(inputs: int, search: torch.dtype) -> nn.Sequential:
    pointwise = PointwiseLayer(inputs, 64), PointwiseLayer(64, 128)
    return nn.Sequential(*pointwise, PooledLayer(128, _GLOBAL_FEATURES, search))


class TransformNet(nn.Module):
    """T-Net: a square matrix for each cloud, initially the identity, to transform its features."""

    def __init__(self, size: int, search: torch.dtype) -> None:
        super().__init__()
        self._size = size
        self.points = _point_layers(size, search)
        self.cloud = nn.Sequential(_dense(_GLOBAL_FEATURES, 512), _dense(512, 256))
        self.matrix = nn.Linear(256, size * size)
        nn.init.zeros_(self.matrix.weight)
        with torch.no_grad():
            self.matrix.bias.copy_(torch.eye(size).flatten())

    def forward(self, x: Tensor) -> Tensor:
        """Compute the matrices ``(cloud, size, size)`` of ``x (cloud, point, size)``."""
        matrix: Tensor = self.matrix(self.cloud(self.points(x)))
        return matrix.view(-1, self._size, self._size)


class PointNet(nn.Module):
    """PointNet for a number of classes.

    Parameters
    ----------
    n_classes : int
        Number of classes.
    recipe : Recipe
        Recipe that defines the T-Nets, the dropout and the precision of the search.
    """

    def __init__(self, n_classes: int, recipe: Recipe) -> None:
        super().__init__()
        search = torch.bfloat16 if recipe.precision == "bfloat16" else torch.float32
        self.input_transform = TransformNet(3, search) if recipe.input_transform else None
        self.feature_transform = TransformNet(64, search) if recipe.feature_transform else None
        self.low = nn.Sequential(PointwiseLayer(3, 64), PointwiseLayer(64, 64))
        self.high = _point_layers(64, search)
        self.classifier = nn.Sequential(
            _dense(_GLOBAL_FEATURES, 512),
            _dense(512, 256),
            nn.Dropout(recipe.dropout),
            nn.Linear(256, n_classes),
        )

    def forward(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Classify clouds.

        Parameters
        ----------
        points : (cloud, point, 3)
            Scaled clouds.

        Returns
        -------
        log_probabilities : (cloud, class)
            Log-probability of each class.
        skewness : ()
            Mean over the clouds of ``|I - A A^T|^2`` (Frobenius), with A the feature transform, or
            0 without one. Added to the loss, it keeps A near a rotation.
        """
        if self.input_transform is not None:
            points = points @ self.input_transform(points)
        features = self.low(points)
        skewness = features.new_zeros(())
        if self.feature_transform is not None:
            matrix = self.feature_transform(features)
            features = features @ matrix
            identity = torch.eye(matrix.shape[1], device=matrix.device)
            skewness = (identity - matrix @ matrix.transpose(1, 2)).square().sum(dim=(1, 2)).mean()
        return functional.log_softmax(self.classifier(self.high(features)), dim=1), skewness


# -- small networks --------------------------------------------------------------------------------

_POINT_WIDTHS, _CLOUD_WIDTH = (3, 64, 64, 128), 128
_NEIGHBOURS = 12
_IMAGE_WIDTHS = (1, 16, 32, 64)


class _SmallNet(nn.Module, ABC):
    """Classifier of the largest and the mean value of the features of all points."""

    def __init__(self, n_classes: int, recipe: Recipe) -> None:
        super().__init__()
        inputs = 2 * _POINT_WIDTHS[-1]
        self.cloud = answer_layers(inputs, _CLOUD_WIDTH, n_classes, recipe.dropout)

    @abstractmethod
    def features(self, points: Tensor) -> Tensor:
        """Compute features of every point, (cloud, point, feature)."""

    def forward(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Classify clouds as `PointNet` does; there is no transform that could be skewed."""
        pooled = largest_and_mean(self.features(points), 1)
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


class SpectrogramNet(nn.Module):
    """Three convolutions over time and velocity, whose values are pooled over all times.

    So the network does not see when something happens, and sees at which velocities.

    Parameters
    ----------
    n_classes : int
        Number of classes.
    recipe : Recipe
        Recipe, of which the dropout counts.
    """

    def __init__(self, n_classes: int, recipe: Recipe) -> None:
        super().__init__()
        layers = [
            nn.Sequential(
                nn.Conv2d(before, after, 3, padding=1, bias=False),
                nn.BatchNorm2d(after),
                nn.ReLU(),
                nn.MaxPool2d(2),
            )
            for before, after in itertools.pairwise(_IMAGE_WIDTHS)
        ]
        self.image = nn.Sequential(*layers)
        pooled = 2 * _IMAGE_WIDTHS[-1] * VELOCITIES // 2 ** len(layers)
        self.head = answer_layers(pooled, _CLOUD_WIDTH, n_classes, recipe.dropout)

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Classify images as `PointNet` does clouds; there is no transform to be skewed."""
        pooled = largest_and_mean(self.image(images[:, None]), 2).flatten(1)
        return functional.log_softmax(self.head(pooled), dim=1), images.new_zeros(())


def build_network(n_classes: int, recipe: Recipe) -> nn.Module:
    """Build the network of a recipe, which gives log-probabilities and a penalty."""
    kinds = {
        "pointnet": PointNet, "pooled": PooledNet, "edges": EdgeNet, "spectrogram": SpectrogramNet
    }  # fmt: skip
    network: nn.Module = kinds[recipe.network](n_classes, recipe)
    return network
