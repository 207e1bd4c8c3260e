"""Small networks and what they learn from: order, training, varied clouds, people left out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

from rtradar.classify.pointnet import build_network
from rtradar.classify.prepare import for_training
from rtradar.classify.recipes import RECIPES
from rtradar.classify.splits import make_splits
from rtradar.classify.training import Examples, predict, train_network


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
