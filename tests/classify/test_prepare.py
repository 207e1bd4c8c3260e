from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

from rtradar.classify.prepare import for_training, sampled, scaled, stack_clouds
from rtradar.errors import InputError

SCALES = torch.tensor([0.5, 0.5, 2.5])
"""What becomes 1 in the network: s, m, m/s. Networks that were trained hold by it."""


@pytest.fixture
def points() -> torch.Tensor:
    torch.manual_seed(0)
    return torch.randn(5, 400, 3) * torch.tensor([0.3, 0.2, 1.5]) + torch.tensor([0.0, 4.0, 1.0])


def test_a_unit_sphere_is_centred_and_just_filled(points: torch.Tensor) -> None:
    unit = scaled(points, "unit-sphere")
    torch.testing.assert_close(unit.mean(dim=1), torch.zeros(5, 3), rtol=0, atol=1e-5)
    torch.testing.assert_close(unit.norm(dim=2).amax(dim=1), torch.ones(5))


def test_physical_scaling_by_hand() -> None:
    cloud = torch.tensor([[[2.0, 4.0, 5.0], [3.0, 5.0, 0.0]]])
    assert scaled(cloud, "physical").tolist() == [[[-1.0, -1.0, 2.0], [1.0, 1.0, 0.0]]]


def test_clouds_of_any_number_of_points_become_one_array(made_up: Callable[..., Any]) -> None:
    clouds = made_up(per_class=1, n_points=20)
    sizes = [20, 5, 0]
    whole = [clouds.points(index)[:size] for index, size in enumerate(sizes)]
    clouds.points = whole.__getitem__
    stacked = stack_clouds(clouds).numpy()
    assert stacked.shape == (3, 20, 3)
    assert stacked.dtype == np.float32
    for cloud, own in zip(stacked[:2], whole, strict=False):
        from_the_middle = own - [own[:, 0].mean(), 0.0, 0.0]
        assert {tuple(row) for row in cloud.tolist()} == {
            tuple(row) for row in from_the_middle.astype(np.float32).tolist()
        }
    assert not stacked[2].any()
    assert np.array_equal(stacked, stack_clouds(clouds).numpy())


def test_clouds_without_points_are_refused(made_up: Callable[..., Any]) -> None:
    with pytest.raises(InputError, match="no points in 3 clouds"):
        stack_clouds(made_up(per_class=1, n_points=0))


def test_clouds_without_a_coordinate_are_refused(made_up: Callable[..., Any]) -> None:
    clouds = made_up(per_class=1, n_points=4)
    flat = clouds.points(1) * [1.0, 1.0, np.nan]  # as a radar without elevation leaves them
    clouds.points = [clouds.points(0), flat, clouds.points(2)].__getitem__
    with pytest.raises(InputError, match="1 of 3 clouds have coordinates that are NaN"):
        stack_clouds(clouds)


def test_points_are_drawn_once_or_anew(points: torch.Tensor) -> None:
    assert torch.equal(sampled(points, 50, resample=False), points[:, :50])
    first, second = sampled(points, 50, resample=True), sampled(points, 50, resample=True)
    assert not torch.equal(first, second)
    for cloud, own in zip(first, points, strict=True):
        rows = {tuple(row) for row in cloud.tolist()}
        assert len(rows) == 50  # without replacement
        assert rows <= {tuple(row) for row in own.tolist()}


def test_physical_variations_are_those_of_another_recording(points: torch.Tensor) -> None:
    plain = (scaled(points[:1], "physical") * SCALES).expand(400, -1, -1)
    varied = for_training(points[:1].expand(400, -1, -1), "physical", "physical") * SCALES
    shift = varied.mean(dim=1)[:, :2]
    assert shift.abs().amax(dim=0).tolist() == pytest.approx(
        [0.1, 0.1], abs=2e-3
    )  # the largest of 400 draws
    assert shift.mean(dim=0).tolist() == pytest.approx(
        [0, 0], abs=0.015
    )  # five standard deviations
    varied[..., :2] -= shift[:, None]
    factor = (varied * plain).sum(dim=1) / (plain**2).sum(dim=1)
    time, distance, velocity = factor.unbind(dim=1)
    # Jitter leaves the factors 0.001, 0.003 and 0.001 uncertain; the largest of 400 draws are half
    # a percent short of the limits.
    assert (1 / time).amin().item() == pytest.approx(0.85, abs=0.01)
    assert (1 / time).amax().item() == pytest.approx(1.15, abs=0.01)
    assert distance.amin().item() == pytest.approx(0.85, abs=0.02)
    assert distance.amax().item() == pytest.approx(1, abs=0.02)
    # A velocity is a range over a time.
    torch.testing.assert_close(velocity, distance / time, rtol=0, atol=0.02)
    jitter = (varied - factor[:, None] * plain).std(dim=(0, 1))
    torch.testing.assert_close(
        jitter, torch.tensor([0.008, 0.012, 0.035]), rtol=0.02, atol=0
    )  # 160 000 draws


def test_turned_clouds_are_turned_in_the_plane_of_time_and_velocity_and_jittered(
    points: torch.Tensor,
) -> None:
    plain = scaled(points[:1], "unit-sphere").expand(400, -1, -1)
    turned = for_training(points[:1].expand(400, -1, -1), "rotation", "unit-sphere")
    before, after = (torch.complex(cloud[..., 0], cloud[..., 2]) for cloud in (plain, turned))
    turn = (after * before.conj()).sum(dim=1) / (before.abs() ** 2).sum(dim=1)
    torch.testing.assert_close(
        turn.abs(), torch.ones(400), rtol=0, atol=0.02
    )  # jitter; a turn, no stretch
    quadrants = torch.bincount((turn.angle() / (math.pi / 2) + 2).long().clamp(0, 3), minlength=4)
    assert (quadrants - 100).abs().amax() < 45  # five standard deviations of a fair draw
    rest = torch.stack([(after - turn[:, None] * before).real, turned[..., 1] - plain[..., 1]])
    assert rest[1].abs().amax().item() == pytest.approx(0.05, abs=1e-6)
    # 0.02, of which 1.2 % are held at 0.05.
    torch.testing.assert_close(
        rest.std(dim=(1, 2)), torch.tensor([0.0199, 0.0199]), rtol=0.02, atol=0
    )


def test_without_augmentation_clouds_are_scaled_alone(points: torch.Tensor) -> None:
    assert torch.equal(for_training(points, "none", "physical"), scaled(points, "physical"))
