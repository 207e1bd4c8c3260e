"""PointNet: what kind of motion a set of points shows, whatever their order.

The network is that of Qi, Su, Mo and Guibas, "PointNet: deep learning on point sets for 3D classification and segmentation"
(CVPR 2017, arXiv:1612.00593), appendix C. Two things are computed in another order, with the same result up to rounding:

- Batch norm needs the mean and variance of ``W x`` over all points. Both follow from the mean and covariance of ``x``, so they
  are known before ``W x`` is, and the norm goes into the weights of the matrix product: no pass over the outputs.
- Of the 1024 wide layers before a maximum over the points only the maxima are ever used. They are searched without gradients,
  which in bfloat16 is a matter of choosing between near ties, and then computed for the chosen points alone, with gradients, in
  float32. Backwards these layers, nine tenths of the network, cost next to nothing.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from rtradar.classify.recipes import Recipe

_GLOBAL_FEATURES = 1024
_MOMENTUM, _EPSILON = 0.1, 1e-5  # of batch norm, torch's own


def _share(batches: Tensor) -> float:
    """Weight of a new batch in running statistics: at first they are the mean of all, and remember no made-up beginning."""
    return max(_MOMENTUM, 1 / (1 + int(batches)))


class _BatchNorm(nn.BatchNorm1d):
    """Batch norm of clouds, with such running statistics."""

    def forward(self, x: Tensor) -> Tensor:
        if self.training and self.num_batches_tracked is not None:
            self.momentum = _share(self.num_batches_tracked)
        return super().forward(x)


class _NormedLinear(nn.Module):
    """A matrix product and the batch norm of its outputs, as weights for one matrix product."""

    running_mean: Tensor
    running_variance: Tensor
    batches: Tensor

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        # No bias: the norm takes the mean out.
        self.linear = nn.Linear(inputs, outputs, bias=False)
        self.gain = nn.Parameter(torch.ones(outputs))
        self.shift = nn.Parameter(torch.zeros(outputs))
        self.register_buffer("running_mean", torch.zeros(outputs))
        self.register_buffer("running_variance", torch.ones(outputs))
        self.register_buffer("batches", torch.tensor(0))

    def folded(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Weight ``(output, input)`` and bias ``(output,)`` that give the normed outputs of ``x (row, input)``."""
        weight = self.linear.weight
        if not self.training:
            scale = self.gain * torch.rsqrt(self.running_variance + _EPSILON)
            return weight * scale[:, None], self.shift - scale * self.running_mean
        n_rows = len(x)
        mean_input = x.mean(dim=0)
        centred = x - mean_input
        # Its gradient is symmetric, so that of one factor, doubled, is that of both: one product backwards in place of two.
        half = centred.detach().T @ centred / n_rows
        covariance = 2 * half - half.detach()
        mean = weight @ mean_input
        variance = ((weight @ covariance) * weight).sum(dim=1).clamp(min=0)
        with torch.no_grad():
            share = _share(self.batches)
            self.running_mean.lerp_(mean, share)
            self.running_variance.lerp_(variance * (n_rows / max(1, n_rows - 1)), share)
            self.batches += 1
        scale = self.gain * torch.rsqrt(variance + _EPSILON)
        return weight * scale[:, None], self.shift - scale * mean


class PointwiseLayer(_NormedLinear):
    """The same matrix product, batch norm and ReLU for every point: ``(cloud, point, input)`` to ``(cloud, point, output)``."""

    def forward(self, x: Tensor) -> Tensor:
        """Features of every point."""
        rows = x.flatten(0, 1)
        return functional.relu(functional.linear(rows, *self.folded(rows))).view(*x.shape[:2], -1)


class PooledLayer(_NormedLinear):
    """A pointwise layer and its maximum over the points: ``(cloud, point, input)`` to ``(cloud, output)``.

    Parameters
    ----------
    inputs, outputs : int
        Features of a point, and of a cloud.
    search : torch.dtype
        Of the search for the point that gives the maximum, while it learns; answers are searched in the type of the points.
    """

    def __init__(self, inputs: int, outputs: int, search: torch.dtype) -> None:
        super().__init__(inputs, outputs)
        self._search = search

    def forward(self, x: Tensor) -> Tensor:
        """Features of every cloud."""
        weight, bias = self.folded(x.flatten(0, 1))
        with torch.no_grad():
            # Ties of a coarse search go to the first point: good enough to learn from, but answers depend on no order.
            search = self._search if self.training else x.dtype
            points, rows = x.to(search), weight.to(search)
            if x.is_cuda:
                chosen = (rows @ points.transpose(1, 2)).max(dim=2).indices
            else:  # cloud by cloud: what one gives stays in the cache until its maxima are found
                chosen = torch.stack([(rows @ cloud.T).max(dim=1).indices for cloud in points])
            n_clouds, n_points, _ = x.shape
            chosen += n_points * torch.arange(n_clouds, device=x.device)[:, None]
        inputs = x.flatten(0, 1).index_select(0, chosen.flatten()).view(*chosen.shape, -1)
        # The ReLU of the maximum is the maximum of the ReLU.
        return functional.relu((inputs * weight).sum(dim=2) + bias)


def _dense(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inputs, outputs, bias=False), _BatchNorm(outputs), nn.ReLU())


class TransformNet(nn.Module):
    """T-Net: a square matrix for each cloud, the identity at first, by which its points or features are turned.

    Parameters
    ----------
    size : int
        Of the matrix.
    search : torch.dtype
        As in `PooledLayer`.
    """

    def __init__(self, size: int, search: torch.dtype) -> None:
        super().__init__()
        self._size = size
        self.points = nn.Sequential(
            PointwiseLayer(size, 64),
            PointwiseLayer(64, 128),
            PooledLayer(128, _GLOBAL_FEATURES, search),
        )
        self.cloud = nn.Sequential(_dense(_GLOBAL_FEATURES, 512), _dense(512, 256))
        self.matrix = nn.Linear(256, size * size)
        nn.init.zeros_(self.matrix.weight)
        with torch.no_grad():
            self.matrix.bias.copy_(torch.eye(size).flatten())

    def forward(self, x: Tensor) -> Tensor:
        """``x (cloud, point, size)`` to ``(cloud, size, size)``."""
        matrix: Tensor = self.matrix(self.cloud(self.points(x)))
        return matrix.view(-1, self._size, self._size)


class PointNet(nn.Module):
    """The network for a number of classes.

    Parameters
    ----------
    n_classes : int
        Kinds of motion.
    recipe : Recipe
        Which T-Nets, the dropout and the precision of the search are taken from it.
    """

    def __init__(self, n_classes: int, recipe: Recipe) -> None:
        super().__init__()
        search = torch.bfloat16 if recipe.precision == "bfloat16" else torch.float32
        self.input_transform = TransformNet(3, search) if recipe.input_transform else None
        self.feature_transform = TransformNet(64, search) if recipe.feature_transform else None
        self.low = nn.Sequential(PointwiseLayer(3, 64), PointwiseLayer(64, 64))
        self.high = nn.Sequential(
            PointwiseLayer(64, 64),
            PointwiseLayer(64, 128),
            PooledLayer(128, _GLOBAL_FEATURES, search),
        )
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
            Scaled as the recipe says.

        Returns
        -------
        log_probabilities : (cloud, class)
        skewness : ()
            Mean over the clouds of ``|I - A A^T|^2`` (Frobenius), A the feature transform: added to the loss, it keeps A near a
            rotation. 0 without one.
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
