from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

from rtradar.classify.prepare import PHYSICAL_SCALES, drawn, for_training, scaled, stack_clouds
from rtradar.errors import InputError


@pytest.fixture
def points() -> torch.Tensor:
    torch.manual_seed(0)
    return torch.randn(5, 400, 3) * torch.tensor([0.3, 0.2, 1.5]) + torch.tensor([0.0, 4.0, 1.0])


def test_a_unit_sphere_is_centred_and_just_filled(points: torch.Tensor) -> None:
    unit = scaled(points, "unit-sphere")
    torch.testing.assert_close(unit.mean(dim=1), torch.zeros(5, 3), rtol=0, atol=1e-5)
    torch.testing.assert_close(unit.norm(dim=2).amax(dim=1), torch.ones(5))


def test_physical_scaling_keeps_sizes_and_the_zero_of_velocity(points: torch.Tensor) -> None:
    back = scaled(points, "physical") * torch.tensor(PHYSICAL_SCALES)
    torch.testing.assert_close(back[..., 2], points[..., 2])
    torch.testing.assert_close(back[..., 1] - back[:, :1, 1], points[..., 1] - points[:, :1, 1], rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(back[..., :2].mean(dim=1), torch.zeros(5, 2), rtol=0, atol=1e-5)


def test_clouds_of_any_number_of_points_become_one_array(made_up: Callable[..., Any]) -> None:
    clouds = made_up(per_class=1, n_points=20)
    sizes = [20, 5, 0]
    whole = [clouds.points(index)[:size] for index, size in enumerate(sizes)]
    clouds.points = whole.__getitem__
    stacked = stack_clouds(clouds).numpy()
    assert stacked.shape == (3, 20, 3)
    assert stacked.dtype == np.float32
    for cloud, own in zip(stacked[:2], whole, strict=False):
        assert {row[1] for row in cloud.tolist()} == {row[1] for row in own.astype(np.float32).tolist()}
    assert not stacked[2].any()
    assert np.array_equal(stacked, stack_clouds(clouds).numpy())


def test_clouds_without_points_are_refused(made_up: Callable[..., Any]) -> None:
    with pytest.raises(InputError, match="no points in 3 clouds"):
        stack_clouds(made_up(per_class=1, n_points=0))


def test_points_are_drawn_once_or_anew(points: torch.Tensor) -> None:
    assert torch.equal(drawn(points, 50, redraw=False), points[:, :50])
    first, second = drawn(points, 50, redraw=True), drawn(points, 50, redraw=True)
    assert not torch.equal(first, second)
    for cloud, own in zip(first, points, strict=True):
        rows = {tuple(row) for row in cloud.tolist()}
        assert len(rows) == 50  # without replacement
        assert rows <= {tuple(row) for row in own.tolist()}


def test_physical_variations_are_small_and_turned_ones_keep_range(points: torch.Tensor) -> None:
    plain = scaled(points, "physical")
    varied = for_training(points, "physical", "physical")
    change = (varied - plain) * torch.tensor(PHYSICAL_SCALES)
    assert change.abs().amax() > 0
    # Tempo and aspect are at most 15 % each, shifts 0.1, jitter four standard deviations.
    reach = (points - points.mean(dim=1, keepdim=True) * torch.tensor([1.0, 1.0, 0.0])).abs()
    allowed = 0.35 * reach + torch.tensor([0.1, 0.1, 0.0]) + 5 * torch.tensor([0.008, 0.012, 0.035])
    assert (change.abs() <= allowed).all()
    turned = for_training(points, "turned", "unit-sphere") - scaled(points, "unit-sphere")
    assert turned[..., 1].abs().amax() <= 0.0501
    assert turned[..., 0].abs().amax() > 0.2
    assert torch.equal(for_training(points, "none", "physical"), plain)
