"""Spectrograms for a network: stacking as images, and how they are varied.

An image has 64 steps of the time and 64 of the velocity, whatever the radar, and levels of 0 at 40
dB below its maximum and of 1 at that.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from rtradar.clouds.collection import Collection
from rtradar.errors import InputError

TIMES, VELOCITIES, FASTEST_MPS = 64, 64, 8.0
"""Size of an image, and the velocity at both of its edges."""

_DEEPEST_DB = 40.0

_TEMPO, _SIZE, _ASPECT = 0.25, 0.15, 0.25
_DRIFT_MPS, _SHIFT = 0.3, 0.2
_SLOW_MPS, _FILTERED, _NOISE = 0.4, 0.2, 0.1
"""How images are varied: as clouds are by ``wide``, in `rtradar.classify.prepare`."""


def stack_spectrograms(clouds: Collection, *, edge_s: float = 0.0) -> Tensor:
    """Stack the spectrograms that a data set keeps as images of one size.

    Parameters
    ----------
    clouds : Collection
        Labelled samples, made with ``keep = ["spectrograms"]``.
    edge_s : float
        Time at both ends of each interval that is left out [s].

    Returns
    -------
    (sample, time, velocity) float32
        Level from 0 to 1, of velocities from -8 to 8 m/s.

    Raises
    ------
    InputError
        If there are no samples, or one has no spectrogram.
    """
    if not len(clouds):
        raise InputError("no samples; build the data set anew")
    return torch.from_numpy(np.stack([_image(clouds, k, edge_s) for k in range(len(clouds))]))


def _image(clouds: Collection, index: int, edge_s: float) -> NDArray[np.float32]:
    kept = clouds.maps(index)
    if "spectrogram" not in kept:
        raise InputError(
            'the data set keeps no spectrograms; build it with keep = ["spectrograms"]'
        )
    power = np.maximum(kept["spectrogram"].to_numpy(), np.finfo(np.float64).tiny)
    level = 1 + 10 * np.log10(power / power.max()) / _DEEPEST_DB
    levels = kept["spectrogram"].copy(data=level.clip(0.0, 1.0))
    time = kept["spectrogram_time"]
    begin, end = float(time.min()), float(time.max())
    edge_s = min(edge_s, 0.45 * (end - begin))
    image = levels.interp(
        spectrogram_time=np.linspace(begin + edge_s, end - edge_s, TIMES),
        spectrogram_velocity=np.linspace(-FASTEST_MPS, FASTEST_MPS, VELOCITIES),
        kwargs={"fill_value": 0.0},  # of velocities that the radar does not have
    )
    return np.nan_to_num(image.transpose("spectrogram_time", ...).to_numpy()).astype(np.float32)


def varied_spectrograms(images: Tensor) -> Tensor:
    """Vary images (sample, time, velocity) in the ways in which recordings of people differ.

    Tempo, aspect and size; a drift of the whole person; the part of the interval; slow echoes that
    a filter removes; and noise.
    """
    count = len(images)
    tempo = torch.exp(_TEMPO * _uniform(count))
    size = torch.exp(_SIZE * _uniform(count)) * (1 - _ASPECT * torch.rand(count))
    drift, zero = _DRIFT_MPS / FASTEST_MPS * _uniform(count), torch.zeros(count)
    # Rows say where a place of the new image, (velocity, time) from -1 to 1, lies in the old one.
    to_velocity = torch.stack([1 / (size * tempo), zero, -drift], dim=1)
    to_time = torch.stack([zero, tempo, _SHIFT * _uniform(count)], dim=1)
    places = functional.affine_grid(
        torch.stack([to_velocity, to_time], dim=1),
        [count, 1, *images.shape[1:]],
        align_corners=False,
    )
    varied = functional.grid_sample(
        images[:, None], places, padding_mode="reflection", align_corners=False
    )[:, 0]
    # Reflected in time only: beyond the fastest velocity of an image there is nothing.
    varied = varied.masked_fill(places[..., 0].abs() > 1, 0.0)
    speed = torch.linspace(-FASTEST_MPS, FASTEST_MPS, images.shape[2]).abs()
    filtered = torch.rand(count, 1) < _FILTERED
    slow = filtered & (speed < _SLOW_MPS * torch.rand(count, 1))
    varied = varied.masked_fill(slow[:, None], 0.0)
    noise = _NOISE * torch.rand(count, 1, 1) * torch.randn(varied.shape)
    return (varied + noise).clamp(0.0, 1.0)


def _uniform(count: int) -> Tensor:
    return 2 * torch.rand(count) - 1
