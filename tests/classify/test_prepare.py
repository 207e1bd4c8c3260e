"""Spectrograms as images, how they are varied, and the network over them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
import xarray as xr

from rtradar.classify.prepare import (
    FASTEST_MPS,
    for_training,
    sampled,
    scaled,
    stack_clouds,
    stack_spectrograms,
    varied_spectrograms,
)
from rtradar.classify.recipes import LEAN, SPECTROGRAM
from rtradar.classify.training import Examples, predict, train_network
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
        wanted = from_the_middle.astype(np.float32)
        assert set(map(tuple, cloud.tolist())) == set(map(tuple, wanted.tolist()))
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
    # The largest of 400 draws, and five standard deviations.
    assert shift.abs().amax(dim=0).tolist() == pytest.approx([0.1, 0.1], abs=2e-3)
    assert shift.mean(dim=0).tolist() == pytest.approx([0, 0], abs=0.015)
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
    wanted = torch.tensor([0.008, 0.012, 0.035])  # 160 000 draws
    torch.testing.assert_close(jitter, wanted, rtol=0.02, atol=0)


def test_turned_clouds_are_turned_in_the_plane_of_time_and_velocity_and_jittered(
    points: torch.Tensor,
) -> None:
    plain = scaled(points[:1], "unit-sphere").expand(400, -1, -1)
    turned = for_training(points[:1].expand(400, -1, -1), "rotation", "unit-sphere")
    before, after = (torch.complex(cloud[..., 0], cloud[..., 2]) for cloud in (plain, turned))
    turn = (after * before.conj()).sum(dim=1) / (before.abs() ** 2).sum(dim=1)
    # Jitter; a turn, no stretch.
    torch.testing.assert_close(turn.abs(), torch.ones(400), rtol=0, atol=0.02)
    quadrants = torch.bincount((turn.angle() / (math.pi / 2) + 2).long().clamp(0, 3), minlength=4)
    assert (quadrants - 100).abs().amax() < 45  # five standard deviations of a fair draw
    rest = torch.stack([(after - turn[:, None] * before).real, turned[..., 1] - plain[..., 1]])
    assert rest[1].abs().amax().item() == pytest.approx(0.05, abs=1e-6)
    # 0.02, of which 1.2 % are held at 0.05.
    wanted = torch.tensor([0.0199, 0.0199])
    torch.testing.assert_close(rest.std(dim=(1, 2)), wanted, rtol=0.02, atol=0)


def test_without_augmentation_clouds_are_scaled_alone(points: torch.Tensor) -> None:
    assert torch.equal(for_training(points, "none", "physical"), scaled(points, "physical"))


class OneTone:
    """A collection of one sample, of somebody who moves at a constant velocity for 2 s."""

    def __init__(self, velocity_mps: float, fastest_mps: float) -> None:
        axis = np.linspace(-fastest_mps, fastest_mps, 201)
        column = 1e-3 * np.exp(-(((axis - velocity_mps) / 0.3) ** 2)) + 1e-9
        axes = {"spectrogram_time": np.linspace(0.05, 1.95, 96), "spectrogram_velocity": axis}
        self._kept = xr.Dataset({"spectrogram": (tuple(axes), np.tile(column, (96, 1)))}, axes)

    def __len__(self) -> int:
        return 1

    def maps(self, index: int) -> xr.Dataset:
        return self._kept


@pytest.mark.parametrize("fastest_mps", [5.0, 20.0])
@pytest.mark.parametrize("velocity_mps", [-3.0, 0.5])
def test_an_image_has_its_maximum_at_the_velocity_of_any_radar(
    velocity_mps: float, fastest_mps: float
) -> None:
    image = stack_spectrograms(OneTone(velocity_mps, fastest_mps), edge_s=0.1)[0]  # type: ignore[arg-type]
    assert image.shape == (64, 64)
    assert image.dtype == torch.float32
    axis = torch.linspace(-FASTEST_MPS, FASTEST_MPS, 64)
    assert (axis[image.argmax(dim=1)] - velocity_mps).abs().max() < FASTEST_MPS / 63
    assert image.max() == pytest.approx(1, abs=0.03)  # between two cells of the axis
    assert image.min() == 0


def test_a_data_set_without_spectrograms_is_refused(collection: Any) -> None:
    from rtradar.clouds.collection import Collection

    with pytest.raises(InputError, match="keeps no spectrograms; build it with keep"):
        stack_spectrograms(Collection(collection))


def test_a_recipe_of_spectrograms_has_no_points_and_no_variation_of_clouds() -> None:
    cases = ({"points": 100}, "has no points"), ({"augmentation": "physical"}, "wide")
    for fields, said in cases:
        with pytest.raises(InputError, match=said):
            SPECTROGRAM.changed(**fields)
    with pytest.raises(InputError, match="at least 1"):
        LEAN.changed(points=0)


def test_varied_images_are_others_of_the_same_size() -> None:
    torch.manual_seed(0)
    images = torch.rand(6, 64, 64)
    varied = varied_spectrograms(images)
    assert varied.shape == images.shape
    assert varied.min() >= 0
    assert varied.max() <= 1
    assert not torch.allclose(varied, varied_spectrograms(images))


def test_a_drift_and_a_tempo_move_a_line_of_an_image() -> None:
    torch.manual_seed(0)
    axis = torch.linspace(-FASTEST_MPS, FASTEST_MPS, 64)
    images = torch.exp(-(((axis - 3.0) / 0.4) ** 2)).expand(200, 64, 64)
    found = axis[varied_spectrograms(images).mean(dim=1).argmax(dim=1)]
    # At 3 m/s: 25 % of tempo, 15 % of size, up to 25 % less by aspect, 0.3 m/s of drift.
    cell = 2 * FASTEST_MPS / 63
    assert found.max() < 3.0 * np.exp(0.4) + 0.3 + cell
    assert found.min() > 3.0 * np.exp(-0.4) * 0.75 - 0.3 - cell
    assert found.std() > 0.3


@pytest.mark.slow
def test_when_something_happens_does_not_matter_and_images_are_learnt() -> None:
    torch.manual_seed(0)
    classes = torch.arange(32) % 2
    images = 0.1 * torch.rand(32, 64, 64)
    for image, one in zip(images, classes.tolist(), strict=True):
        image[:, 40 if one else 20] = 1.0  # approaching or receding
    examples = Examples(images, classes, ("a", "b"))
    recipe = SPECTROGRAM.changed(epochs=12, batch=8)
    network, _ = train_network(examples, examples, recipe)
    chances = predict(network, examples, recipe)
    assert np.mean(chances.argmax(axis=1) == classes.numpy()) == 1
    later = Examples(images.roll(8, dims=1), classes, ("a", "b"))  # 8 steps: one after pooling
    assert np.abs(predict(network, later, recipe) - chances).max() < 0.3
