"""Preparation of samples for the network: stacking, sampling of points, augmentation and scaling.

Time, range and velocity have different units. ``unit-sphere``, PointNet's normalisation of shapes,
centres a cloud and divides all three axes by one number, so that seconds and m/s are compared as
numbers and the size of a cloud is lost. ``physical`` divides each axis by a fixed scale,
`PHYSICAL_SCALES`. Time and range are counted from the middle of the cloud, as the place and time of
a motion say nothing of its kind, and velocity from zero. The paper normalises clouds, but states
neither how nor in what units.

Augmented clouds resemble those of other recordings: ``physical`` shifts them, changes their tempo
and aspect, and adds normally distributed jitter. ``rotation`` is the augmentation of the paper's
own program, a rotation by a random angle in the plane of time and velocity, and jitter; no motion
gives such clouds.

A spectrogram becomes an image of 64 steps of the time and 64 of the velocity, whatever the radar,
with levels of 0 at 40 dB below its maximum and of 1 at that.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from rtradar.classify.recipes import Augmentation, Recipe, Scaling
from rtradar.clouds.collection import Collection
from rtradar.errors import InputError
from rtradar.system.seeds import stream

PHYSICAL_SCALES = (0.5, 0.5, 2.5)
"""Time [s], range [m] and velocity [m/s] that are scaled to 1, about the spread of a motion."""

_ROTATION_JITTER, _ROTATION_JITTER_LIMIT = 0.02, 0.05  # those of PointNet on unit spheres

_WIDE_TEMPO, _WIDE_SIZE, _WIDE_ASPECT = 0.25, 0.15, 0.25
_WIDE_DRIFT_MPS = 0.3
_WIDE_CUT = 0.2  # largest part of the time that is left out
_WIDE_FILTERED, _WIDE_SLOW_MPS = 0.2, 0.4  # how often slow points are missing, and how slow
_WIDE_FALSE = 0.04
"""How clouds are varied by ``wide``: natural logarithms of factors, or largest values."""

_TIME_SHIFT_S, _RANGE_SHIFT_M = 0.1, 0.1  # the largest in either direction
_TEMPO = 0.15  # largest relative change of tempo: velocity is multiplied and time divided by it
_ASPECT = 0.15  # largest relative loss of radial motion, as of a person who faces elsewhere
_JITTER = (0.008, 0.012, 0.035)  # standard deviation [s, m, m/s], about a third of a map's cell


def stacked_for(clouds: Collection, recipe: Recipe, *, seed: int = 0) -> Tensor:
    """Stack what the network of a recipe takes: clouds in random order, or spectrograms."""
    if recipe.takes_points:
        return stack_clouds(clouds, seed=seed, edge_s=recipe.edge_s)
    return stack_spectrograms(clouds, edge_s=recipe.edge_s)


def for_network(stacked: Tensor, recipe: Recipe, *, training: bool) -> Tensor:
    """Prepare clouds or spectrograms for the network, in training sampled and varied at random."""
    if not recipe.takes_points:
        varied = training and recipe.augmentation == "wide"
        return varied_spectrograms(stacked) if varied else stacked
    points = sampled(stacked, recipe.points, resample=training and recipe.resample)
    if training:
        return for_training(points, recipe.augmentation, recipe.scaling)
    return scaled(points, recipe.scaling)


def stack_clouds(clouds: Collection, *, seed: int = 0, edge_s: float = 0.0) -> Tensor:
    """Stack all clouds into one array, each in random order, so that its first points are a sample.

    Parameters
    ----------
    clouds : Collection
        Labelled clouds.
    seed : int
        Seed of the random order.
    edge_s : float
        Time at both ends of each interval whose points are left out [s].

    Returns
    -------
    (cloud, point, 3) float32
        Clouds with as many points as the largest one has. Smaller clouds are filled up with points
        of their own, empty ones with zeros. Time is counted from the middle of each cloud.

    Raises
    ------
    InputError
        If there are no clouds, or none has points, or one has coordinates that are NaN, as those
        are that its radar cannot measure.
    """
    each = [np.asarray(clouds.points(index), dtype=np.float64) for index in range(len(clouds))]
    if edge_s:
        ends = clouds.column("duration_s").astype(np.float64) - edge_s
        each = [
            some[(some[:, 0] >= edge_s) & (some[:, 0] < end)]
            for some, end in zip(each, ends, strict=True)
        ]
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
            again = random.integers(len(points), size=n_points - len(points))
            centred = points - [points[:, 0].mean(), 0, 0]
            stacked[index] = centred[np.concatenate([order, again])]
    unknown = np.flatnonzero(np.isnan(stacked).any(axis=(1, 2)))
    if len(unknown):
        raise InputError(
            f"{len(unknown)} of {len(each)} clouds have coordinates that are NaN, which "
            "their radar does not measure; a network needs all three"
        )
    return torch.from_numpy(stacked)


def sampled(stacked: Tensor, n_points: int, *, resample: bool) -> Tensor:
    """Take ``n_points`` of every cloud: the first ones, or others at every call."""
    if not resample:
        return stacked[:, :n_points]
    order = torch.rand(stacked.shape[:2]).argsort(dim=1)[:, :n_points]
    return stacked.gather(1, order[..., None].expand(-1, -1, 3))


def scaled(points: Tensor, scaling: Scaling) -> Tensor:
    """Scale points ``(cloud, point, 3)`` [s, m, m/s] for the network (see this module)."""
    if scaling == "unit-sphere":
        centred = points - points.mean(dim=1, keepdim=True)
        radius = centred.norm(dim=2).amax(dim=1)
        return centred / radius.clamp(min=1e-9)[:, None, None]
    middle = points.mean(dim=1, keepdim=True) * points.new_tensor([1.0, 1.0, 0.0])
    return (points - middle) / points.new_tensor(PHYSICAL_SCALES)


def for_training(points: Tensor, augmentation: Augmentation, scaling: Scaling) -> Tensor:
    """Augment and scale clouds with torch's random generator."""
    if augmentation == "rotation":
        return _rotated(scaled(points, scaling))
    if augmentation == "none":
        return scaled(points, scaling)
    if augmentation == "wide":
        return scaled(_varied(points), scaling)
    largest = torch.tensor([_TIME_SHIFT_S, _RANGE_SHIFT_M, 0.0])
    shift = largest * _uniform(len(points), 3)
    # Shifts are added after scaling, because scaling removes the middle of the cloud.
    return scaled(_stretched(points), scaling) + (shift / torch.tensor(PHYSICAL_SCALES))[:, None]


def _uniform(*shape: int) -> Tensor:
    return 2 * torch.rand(shape) - 1


def _stretched(points: Tensor) -> Tensor:
    tempo = 1 + _TEMPO * _uniform(len(points))
    aspect = 1 - _ASPECT * torch.rand(len(points))
    factor = torch.stack([1 / tempo, aspect, tempo * aspect], dim=1)[:, None]
    middle = points.mean(dim=1, keepdim=True) * torch.tensor([1.0, 1.0, 0.0])
    jitter = torch.randn(points.shape) * torch.tensor(_JITTER)
    return middle + (points - middle) * factor + jitter


def _varied(points: Tensor) -> Tensor:
    """Vary clouds (cloud, point, 3) in the ways in which recordings of people differ.

    Tempo, aspect and size; a drift of the whole person, which shifts velocity and tilts range; the
    part of the interval; slow points that a filter removes; false points; and jitter.
    """
    n_clouds, n_points, _ = points.shape
    time, distance, _ = (points - points.mean(dim=1, keepdim=True)).unbind(dim=2)
    tempo = torch.exp(_WIDE_TEMPO * _uniform(n_clouds, 1))
    size = torch.exp(_WIDE_SIZE * _uniform(n_clouds, 1))
    size = size * (1 - _WIDE_ASPECT * torch.rand(n_clouds, 1))
    drift = _WIDE_DRIFT_MPS * _uniform(n_clouds, 1)
    time, velocity = time / tempo, points[..., 2] * size * tempo + drift
    varied = torch.stack([time, distance * size + drift * time, velocity], dim=2)
    varied += torch.randn(points.shape) * torch.tensor(_JITTER) * 2 * torch.rand(n_clouds, 1, 1)
    # What is left out is replaced by other points of the cloud.
    begin = time.amin(dim=1, keepdim=True)
    length = (time.amax(dim=1, keepdim=True) - begin).clamp(min=1e-3)
    kept = 1 - _WIDE_CUT * torch.rand(n_clouds, 1)
    place = (time - begin) / length - (1 - kept) * torch.rand(n_clouds, 1)
    slow = _WIDE_SLOW_MPS * torch.rand(n_clouds, 1) * (torch.rand(n_clouds, 1) < _WIDE_FILTERED)
    good = (place >= 0) & (place <= kept) & (velocity.abs() >= slow)
    good |= ~good.any(dim=1, keepdim=True)
    others = torch.multinomial(good.float(), n_points, replacement=True)
    chosen = torch.where(good, torch.arange(n_points), others)
    varied = varied.gather(1, chosen[..., None].expand(-1, -1, 3))
    low, high = varied.amin(dim=1, keepdim=True), varied.amax(dim=1, keepdim=True)
    anywhere = low + (high - low) * torch.rand(points.shape)
    false = torch.rand(n_clouds, n_points) < _WIDE_FALSE * torch.rand(n_clouds, 1)
    return torch.where(false[..., None], anywhere, varied)


def _rotated(points: Tensor) -> Tensor:
    angle = math.pi * _uniform(len(points))
    cosine, sine = angle.cos()[:, None], angle.sin()[:, None]
    time, distance, velocity = points.unbind(dim=2)
    time, velocity = cosine * time + sine * velocity, cosine * velocity - sine * time
    jitter = _ROTATION_JITTER * torch.randn(points.shape)
    limited = jitter.clamp(-_ROTATION_JITTER_LIMIT, _ROTATION_JITTER_LIMIT)
    return torch.stack([time, distance, velocity], dim=2) + limited


TIMES, VELOCITIES, FASTEST_MPS = 64, 64, 8.0
"""Size of an image, and the velocity at both of its edges."""

_DEEPEST_DB = 40.0

_SHIFT, _NOISE = 0.2, 0.1
"""How images are varied, beside what ``wide`` does to clouds."""


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
    tempo = torch.exp(_WIDE_TEMPO * _uniform(count))
    size = torch.exp(_WIDE_SIZE * _uniform(count)) * (1 - _WIDE_ASPECT * torch.rand(count))
    drift, zero = _WIDE_DRIFT_MPS / FASTEST_MPS * _uniform(count), torch.zeros(count)
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
    filtered = torch.rand(count, 1) < _WIDE_FILTERED
    slow = filtered & (speed < _WIDE_SLOW_MPS * torch.rand(count, 1))
    varied = varied.masked_fill(slow[:, None], 0.0)
    noise = _NOISE * torch.rand(count, 1, 1) * torch.randn(varied.shape)
    return (varied + noise).clamp(0.0, 1.0)
