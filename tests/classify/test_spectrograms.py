"""Spectrograms as images, how they are varied, and the network over them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
import xarray as xr

from rtradar.classify.prepare import FASTEST_MPS, stack_spectrograms, varied_spectrograms
from rtradar.classify.recipes import LEAN, SPECTROGRAM
from rtradar.classify.training import Examples, predict, train_network
from rtradar.errors import InputError


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
    for fields, said in (
        ({"points": 100}, "has no points"),
        ({"augmentation": "physical"}, "wide"),
    ):
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
