"""Training recipes: every hyperparameter of the paper's training and of our baseline."""

from __future__ import annotations

import dataclasses
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from rtradar.errors import InputError
from rtradar.system.fields import Limits, check_fields

Schedule = Literal["step", "one-cycle"]
Scaling = Literal["unit-sphere", "physical"]
Augmentation = Literal["none", "rotation", "physical", "wide"]
Precision = Literal["float32", "bfloat16"]
Network = Literal["pointnet", "pooled", "edges", "spectrogram"]

_WEIGHT = Limits(0.0, 1e3)
_PART = Limits(0.0, 1 - 2**-53, "it must be a number from 0 to 1, which is excluded")
_FILE_KEYS = {"resample": "redraw", "step_epochs": "halve_every"}
_LATER_FIELDS = ("network", "edge_s", "label_smoothing", "balanced")
"""Fields that files of studies have only where they differ from their defaults."""
_FILE_VALUES = {"step": "halving", "rotation": "turned"}
"""Names and values in the files of studies, where they differ from those of `Recipe`."""


@dataclass(frozen=True)
class Recipe:
    """Hyperparameters that, with the clouds and the seed, determine a training.

    Parameters
    ----------
    name : str
        Name of the predefined recipe it was derived from.
    points : int
        Number of points that the network takes from each cloud, at least 1; 0 if it takes a
        spectrogram.
    batch : int
        Number of clouds in a batch, at least 2. The remainder is spread over the other batches, so
        that no cloud is dropped and no batch holds a single cloud.
    epochs : int
        Number of passes over the training clouds, at least 1.
    rate : float
        Learning rate: the initial one of ``step``, the peak of ``one-cycle``.
    schedule : {"step", "one-cycle"}
        Schedule of the learning rate. ``step`` halves the rate every ``step_epochs`` epochs.
        ``one-cycle`` rises linearly over the first tenth of all batches and falls to 0 along a
        cosine.
    step_epochs : int
        Number of epochs between two steps of ``step``.
    stop_below : float
        Rate below which ``step`` ends early, because further epochs have no visible effect; 0
        disables this.
    weight_decay : float
        Decoupled weight decay of AdamW; 0 gives Adam.
    input_transform, feature_transform : bool
        Whether T-Nets transform the points (3 x 3) and their features (64 x 64).
    dropout : float
        Fraction of the last hidden layer that is dropped at random, from 0 to 0.99.
    scaling : {"unit-sphere", "physical"}
        Normalisation of time, range and velocity, see `rtradar.classify.prepare`.
    resample : bool
        Whether the points of a cloud are resampled in every epoch; otherwise they stay the same.
    augmentation : {"none", "rotation", "physical", "wide"}
        Augmentation of training clouds, see `rtradar.classify.prepare`; spectrograms have only the
        first and the last.
    precision : {"float32", "bfloat16"}
        Precision of the search for the maximum over the points during training. Values, gradients
        and predictions are always float32.
    network : {"pointnet", "pooled", "edges", "spectrogram"}
        Network of `rtradar.classify.pointnet`.
    edge_s : float
        Time at both ends of each interval whose points are left out [s]. The surface from which
        points are drawn is closed there.
    label_smoothing : float
        Probability that is spread over all classes in the loss, from 0 to 0.99.
    balanced : bool
        Whether each class has the same weight in the loss, however many clouds show it.

    Raises
    ------
    InputError
        If a value is out of its range.

    Notes
    -----
    The defaults are those of the paper (section 3.3.2): batches of 3, Adam at a rate of 1e-4 that
    is halved every 10 epochs, 200 epochs. After 70 epochs the rate is below 1e-6, at which the
    paper's first trial did not learn in 200 epochs. The paper normalises clouds but does not say
    how.
    """

    name: str
    points: Annotated[int, Limits(0, 10**9)] = 1000
    batch: Annotated[int, Limits(2, 10**9)] = 3
    epochs: Annotated[int, Limits(1, 10**9)] = 200
    rate: Annotated[float, Limits(1e-12, 1e3)] = 1e-4
    schedule: Schedule = "step"
    step_epochs: Annotated[int, Limits(1, 10**9)] = 10
    stop_below: Annotated[float, _WEIGHT] = 1e-6
    weight_decay: Annotated[float, _WEIGHT] = 0.0
    input_transform: bool = True
    feature_transform: bool = True
    dropout: Annotated[float, _PART] = 0.3
    scaling: Scaling = "physical"
    resample: bool = False
    augmentation: Augmentation = "none"
    precision: Precision = "float32"
    network: Network = "pointnet"
    edge_s: Annotated[float, _WEIGHT] = 0.0
    label_smoothing: Annotated[float, _PART] = 0.0
    balanced: bool = False

    def __post_init__(self) -> None:
        words = {old: new for new, old in _FILE_VALUES.items()}
        for key in ("schedule", "augmentation"):
            value = getattr(self, key)
            object.__setattr__(self, key, words.get(str(value), value))
        check_fields(self, "recipe: ")
        if self.takes_points != (self.points > 0):
            wanted = "at least 1" if self.takes_points else "0, for a spectrogram has no points"
            raise InputError(f"recipe: points = {self.points}; it must be {wanted}")
        if not self.takes_points and self.augmentation not in ("none", "wide"):
            raise InputError(
                f"recipe: augmentation = '{self.augmentation}'; it must be none or wide, for a "
                "spectrogram is no cloud"
            )

    @property
    def takes_points(self) -> bool:
        """Whether the network takes clouds, not spectrograms."""
        return self.network != "spectrogram"

    @property
    def epochs_run(self) -> int:
        """Number of epochs that are run: all, or those with a rate of at least ``stop_below``."""
        if self.schedule == "one-cycle":
            return self.epochs
        epochs = range(1, self.epochs)
        return next((e for e in epochs if self._stepped(e) < self.stop_below), self.epochs)

    def rate_at(self, epoch: int, progress: float) -> float:
        """Return the learning rate of a batch.

        Parameters
        ----------
        epoch : int
            Number of the epoch, from 0.
        progress : float
            Fraction of the epoch's batches that are done, from 0 to 1.

        Returns
        -------
        float
        """
        if self.schedule == "step":
            return self._stepped(epoch)
        done = (epoch + progress) / self.epochs
        warm = 0.1
        if done < warm:
            return self.rate * max(done, 1e-3) / warm
        return self.rate * (1 + math.cos(math.pi * (done - warm) / (1 - warm))) / 2

    def _stepped(self, epoch: int) -> float:
        return self.rate * 0.5 ** (epoch // self.step_epochs)

    def changed(self, **fields: Any) -> Recipe:
        """Return a copy with other values; fields given as None keep theirs.

        Parameters
        ----------
        **fields
            New values by the names of the fields.

        Returns
        -------
        Recipe
        """
        given = {name: value for name, value in fields.items() if value is not None}
        return dataclasses.replace(self, **given)

    def as_dict(self) -> dict[str, Any]:
        """Return the fields as plain values, with the names and words of the files of studies."""
        usual = {field.name: field.default for field in dataclasses.fields(self)}
        fields = [
            (key, value)
            for key, value in dataclasses.asdict(self).items()
            if key not in _LATER_FIELDS or value != usual[key]
        ]
        return {_FILE_KEYS.get(key, key): _FILE_VALUES.get(value, value) for key, value in fields}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Recipe:
        """Make the recipe that `as_dict` described.

        Parameters
        ----------
        content : mapping
            Plain values.

        Returns
        -------
        Recipe
        """
        names = {old: new for new, old in _FILE_KEYS.items()}
        return cls(**{names.get(key, key): value for key, value in content.items()})


RECIPES: dict[str, Recipe] = {}
"""Predefined recipes by name, those of ``recipes.toml``."""

for _name, _told in tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8")).items():
    _base = RECIPES.get(_told.pop("base", ""), Recipe(_name))
    RECIPES[_name] = _base.changed(name=_name, **_told)

PAPER = RECIPES["paper"]
"""Settings of the paper. Unlike the paper, no test cloud is dropped for not filling a batch."""

LEAN = RECIPES["lean"]
"""Our baseline: larger batches at a higher rate, resampled points, augmented clouds, no T-Nets.

T-Nets would mix time with velocity.
"""

SMALL, EDGES, SPECTROGRAM = (RECIPES[name] for name in ("small", "edges", "spectrogram"))
"""A small network, one that looks at the neighbours of each point, and one over spectrograms."""
