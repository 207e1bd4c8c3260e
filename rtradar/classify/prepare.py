"""Clouds on their way into the network: one array of them, points drawn, varied and scaled.

Time, range and velocity have units of their own. ``unit-sphere``, PointNet's normalisation of shapes, centres a cloud and divides
all three by one number: what is a second long and what is 8 m/s wide are compared as numbers, and the size of a cloud is lost.
``physical`` divides each axis by a fixed scale, `PHYSICAL_SCALES`: time and range from the middle of the cloud, for when and
where somebody moves says nothing of what they do, velocity from zero. The paper normalises; how, and in what units, it leaves
open.

Varied clouds are such as another recording would give: ``physical`` shifts and stretches them as `Variation` says. ``turned`` is
what the paper's own program does, a turn by any angle in the plane of time and velocity, and jitter; no motion gives such clouds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from rtradar.classify.recipes import Augmentation, Scaling
from rtradar.classify.source import Clouds
from rtradar.errors import InputError
from rtradar.system.seeds import stream

PHYSICAL_SCALES = (0.5, 0.5, 2.5)
"""Time [s], range [m], velocity [m/s] that become 1: about the spread of a person's motion, so that all axes count alike."""

_TURNED_JITTER, _TURNED_JITTER_LIMIT = 0.02, 0.05  # of PointNet's own program, on unit spheres


@dataclass(frozen=True)
class Variation:
    """How far a training cloud may be from the one that was made; each drawn uniformly, jitter normally.

    Parameters
    ----------
    time_shift_s, range_shift_m : float
        Largest shift either way.
    tempo : float
        Largest relative change of tempo: time is divided by what velocity is multiplied by.
    aspect : float
        Largest relative loss of radial motion, as when somebody faces elsewhere: range and velocity shrink alike.
    jitter : (3,) float
        Standard deviation of every point: about a third of a cell of the maps.
    """

    time_shift_s: float = 0.1
    range_shift_m: float = 0.1
    tempo: float = 0.15
    aspect: float = 0.15
    jitter: tuple[float, float, float] = (0.008, 0.012, 0.035)


VARIATION = Variation()
"""That of the recipe ``lean``."""


def stack_clouds(clouds: Clouds, *, seed: int = 0) -> Tensor:
    """All clouds as one array, each in random order, so that the first points of it are a sample of it.

    Parameters
    ----------
    clouds : Clouds
        As of `rtradar.clouds.collection.Collection`.
    seed : int
        Of the order.

    Returns
    -------
    (cloud, point, 3) float32
        As many points as the largest cloud has; smaller ones are filled up with points of their own, empty ones with zeros.
        Time is counted from the middle of each cloud.

    Raises
    ------
    InputError
        Where there are no clouds, or none has points.
    """
    each = [np.asarray(clouds.points(index), dtype=np.float64) for index in range(len(clouds))]
    n_points = max((len(points) for points in each), default=0)
    if not n_points:
        raise InputError(
            f"no points in {len(each)} clouds; build the data set anew, with a higher SNR"
        )
    stacked = np.zeros((len(each), n_points, 3), dtype=np.float32)
    for index, points in enumerate(each):
        if len(points):
            random = np.random.default_rng(stream(seed, index))
            order = random.permutation(len(points))
            filled = np.concatenate(
                [order, random.integers(len(points), size=n_points - len(points))]
            )
            stacked[index] = (points - [points[:, 0].mean(), 0, 0])[filled]
    return torch.from_numpy(stacked)


def drawn(stacked: Tensor, n_points: int, *, redraw: bool) -> Tensor:
    """``n_points`` of every cloud of ``stacked (cloud, point, 3)``: the first, or others at every call (torch's generator)."""
    if not redraw:
        return stacked[:, :n_points]
    order = torch.rand(stacked.shape[:2]).argsort(dim=1)[:, :n_points]
    return stacked.gather(1, order[..., None].expand(-1, -1, 3))


def scaled(points: Tensor, scaling: Scaling) -> Tensor:
    """Points ``(cloud, point, 3)`` [s, m, m/s] as the network takes them, see above."""
    if scaling == "unit-sphere":
        centred = points - points.mean(dim=1, keepdim=True)
        radius = centred.norm(dim=2).amax(dim=1)
        return centred / radius.clamp(min=1e-9)[:, None, None]
    middle = points.mean(dim=1, keepdim=True) * points.new_tensor([1.0, 1.0, 0.0])
    return (points - middle) / points.new_tensor(PHYSICAL_SCALES)


def for_training(points: Tensor, augmentation: Augmentation, scaling: Scaling) -> Tensor:
    """Varied and scaled clouds; random numbers are those of torch's generator."""
    if augmentation == "turned":
        return _turned(scaled(points, scaling))
    if augmentation == "none":
        return scaled(points, scaling)
    shift = torch.tensor([VARIATION.time_shift_s, VARIATION.range_shift_m, 0.0]) * _uniform(
        len(points), 3
    )
    # Shifts come after scaling has taken the middle out, or they would be taken out with it.
    return scaled(_stretched(points), scaling) + (shift / torch.tensor(PHYSICAL_SCALES))[:, None]


def _uniform(*shape: int) -> Tensor:
    return 2 * torch.rand(shape) - 1


def _stretched(points: Tensor) -> Tensor:
    tempo = 1 + VARIATION.tempo * _uniform(len(points))
    aspect = 1 - VARIATION.aspect * torch.rand(len(points))
    factor = torch.stack([1 / tempo, aspect, tempo * aspect], dim=1)[:, None]
    middle = points.mean(dim=1, keepdim=True) * torch.tensor([1.0, 1.0, 0.0])
    return (
        middle
        + (points - middle) * factor
        + torch.randn(points.shape) * torch.tensor(VARIATION.jitter)
    )


def _turned(points: Tensor) -> Tensor:
    angle = math.pi * _uniform(len(points))
    cosine, sine = angle.cos()[:, None], angle.sin()[:, None]
    time, distance, velocity = points.unbind(dim=2)
    turned = torch.stack(
        [cosine * time + sine * velocity, distance, cosine * velocity - sine * time], dim=2
    )
    return turned + (_TURNED_JITTER * torch.randn(points.shape)).clamp(
        -_TURNED_JITTER_LIMIT, _TURNED_JITTER_LIMIT
    )
