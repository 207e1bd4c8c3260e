"""Small networks and what they learn from: order, training, varied clouds, people left out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from rtradar.classify.pointnet import (
    PointNet,
    PointwiseLayer,
    PooledLayer,
    TransformNet,
    build_network,
)
from rtradar.classify.prepare import for_training
from rtradar.classify.recipes import PAPER, RECIPES, Recipe
from rtradar.classify.splits import make_splits
from rtradar.classify.training import Examples, predict, train_network

COARSE = PAPER.changed(precision="bfloat16")


@pytest.fixture(autouse=True)
def _seeded() -> None:
    torch.manual_seed(0)


def clouds(n_clouds: int = 4, n_points: int = 30, n_features: int = 3) -> torch.Tensor:
    return torch.randn(n_clouds, n_points, n_features)


@pytest.mark.parametrize(
    "recipe", [PAPER, COARSE, PAPER.changed(input_transform=False, feature_transform=False)]
)
def test_the_order_of_points_does_not_matter(recipe: Recipe) -> None:
    network = PointNet(3, recipe)
    for _ in range(3):  # away from the beginning, where T-Nets do nothing
        network(clouds())[0].sum().backward()
    network.eval()
    points = clouds()
    with torch.no_grad():
        turned = network(points[:, torch.randperm(30)])
        torch.testing.assert_close(turned, network(points), rtol=1e-4, atol=1e-5)


def test_a_repeated_point_changes_nothing() -> None:
    network, points = PointNet(3, PAPER).eval(), clouds()
    with torch.no_grad():
        again = network(torch.cat([points, points[:, :7]], dim=1))[0]
        torch.testing.assert_close(again, network(points)[0], rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("size", [3, 64])
def test_transforms_begin_as_the_identity(size: int) -> None:
    found = TransformNet(size, torch.float32)(clouds(n_features=size))
    assert torch.equal(found, torch.eye(size).expand(4, size, size))


def test_answers_are_probabilities_and_the_identity_is_not_skew() -> None:
    log_probabilities, skewness = PointNet(5, PAPER)(clouds())
    assert log_probabilities.shape == (4, 5)
    torch.testing.assert_close(log_probabilities.exp().sum(dim=1), torch.ones(4))
    assert skewness.item() == 0


class Plain(nn.Module):
    """Convolution of length 1, batch norm, ReLU: as PointNet is usually written."""

    def __init__(self, layer: PointwiseLayer | PooledLayer) -> None:
        super().__init__()
        outputs, inputs = layer.linear.weight.shape
        self.convolution = nn.Conv1d(inputs, outputs, 1, bias=False)
        self.norm = nn.BatchNorm1d(outputs, momentum=None)
        self.double()
        with torch.no_grad():
            self.convolution.weight.copy_(layer.linear.weight[..., None])
            self.norm.weight.copy_(layer.gain)
            self.norm.bias.copy_(layer.shift)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.norm(self.convolution(x.transpose(1, 2))).relu().transpose(1, 2)


@pytest.mark.parametrize("pooled", [False, True])
@pytest.mark.parametrize("training", [False, True])
def test_layers_are_those_of_a_plain_pointnet(pooled: bool, training: bool) -> None:
    """Outputs, gradients and running statistics while they are plain means; gains of both signs."""
    layer = (PooledLayer(5, 40, torch.float64) if pooled else PointwiseLayer(5, 40)).double()
    with torch.no_grad():
        layer.gain.normal_()
        layer.shift.normal_()
    plain = Plain(layer)
    x = 3 + torch.randn(4, 20, 5, dtype=torch.float64)
    layer(x), plain(x)  # away from the first running statistics
    layer.train(training), plain.train(training)
    ours, theirs = x.clone().requires_grad_(), x.clone().requires_grad_()
    got, wanted = layer(ours), plain(theirs)
    wanted = wanted.amax(dim=1) if pooled else wanted
    torch.testing.assert_close(got, wanted)
    weights = torch.randn_like(got)
    (got * weights).sum().backward()
    (wanted * weights).sum().backward()
    torch.testing.assert_close(ours.grad, theirs.grad)
    assert plain.convolution.weight.grad is not None
    torch.testing.assert_close(layer.linear.weight.grad, plain.convolution.weight.grad[..., 0])
    torch.testing.assert_close(layer.gain.grad, plain.norm.weight.grad)
    torch.testing.assert_close(layer.running_mean, plain.norm.running_mean)
    torch.testing.assert_close(layer.running_variance, plain.norm.running_var)


def test_a_search_in_bfloat16_is_off_by_its_rounding_alone() -> None:
    coarse, exact = PooledLayer(64, 200, torch.bfloat16), PooledLayer(64, 200, torch.float32)
    exact.load_state_dict(coarse.state_dict())
    x = torch.randn(2, 300, 64).relu()
    with torch.no_grad():
        found, best = coarse(x), exact(x)
    assert (found <= best + 1e-6).all()
    # A product of bfloat16 values is off by 2^-8 of the sum of its terms' sizes; two of them are
    # compared.
    with torch.no_grad():
        weight, _ = exact.folded(x.flatten(0, 1))
        size = (x[:, :, None] * weight.abs()).sum(dim=3).amax(dim=1)
    assert (best - found <= 2 * 2**-8 * size).all()


@pytest.mark.parametrize("name", ["small", "edges"])
def test_the_order_of_points_does_not_matter_and_clouds_are_learnt(name: str) -> None:
    torch.manual_seed(0)
    recipe = RECIPES[name].changed(epochs=12, batch=8, points=48)
    classes = torch.arange(32) % 2
    points = torch.randn(32, 64, 3) * torch.tensor([0.4, 0.2, 1.0])
    points[..., 2] += 2.0 * (classes[:, None] - 0.5) * points[..., 0].sign()
    examples = Examples(points, classes, ("a", "b"))
    network, history = train_network(examples, examples, recipe)
    chances = predict(network, examples, recipe)
    assert np.mean(chances.argmax(axis=1) == classes.numpy()) == 1
    assert len(history) == 12
    turned = Examples(points[:, :48].flip(1), classes, ("a", "b"))
    assert predict(network, turned, recipe) == pytest.approx(chances, abs=1e-4)
    assert build_network(2, recipe).training


def test_varied_clouds_keep_their_size_and_their_middle_in_time_and_range() -> None:
    torch.manual_seed(0)
    points = torch.randn(5, 100, 3) + torch.tensor([0.8, 4.0, 0.0])
    varied = for_training(points, "wide", "physical")
    assert varied.shape == points.shape
    assert torch.isfinite(varied).all()
    assert varied[..., :2].mean(dim=1).abs().max() < 1e-5
    assert not torch.allclose(varied, for_training(points, "wide", "physical"))


def test_each_recorded_person_is_left_out_once_and_actors_are_always_learnt_from(
    made_up: Callable[..., Any],
) -> None:
    clouds = made_up(per_class=6, subjects=6)
    splits = make_splits(clouds, "leave-one-subject-out")
    source, subject = clouds.column("source"), clouds.column("subject")
    assert len(splits) == len(set(subject[source == "recorded"]))
    for split in splits:
        assert set(source[split.test]) == {"recorded"}
        assert len(set(subject[split.test])) == 1
        assert not set(subject[split.test]) & set(subject[split.train])
        assert len(split.train) + len(split.test) == len(clouds)
