"""How a classifier is trained: the paper's way and our own, every number of them in one place."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, Literal

from rtradar.errors import InputError

Schedule = Literal["halving", "one-cycle"]
Scaling = Literal["unit-sphere", "physical"]
Augmentation = Literal["none", "turned", "physical"]
Precision = Literal["float32", "bfloat16"]

SCHEDULES: tuple[Schedule, ...] = ("halving", "one-cycle")
SCALINGS: tuple[Scaling, ...] = ("unit-sphere", "physical")
AUGMENTATIONS: tuple[Augmentation, ...] = ("none", "turned", "physical")
PRECISIONS: tuple[Precision, ...] = ("float32", "bfloat16")


@dataclass(frozen=True)
class Recipe:
    """All that decides what comes of a training, but for the clouds and the seed.

    Parameters
    ----------
    name : str
        Of the recipe it began as.
    points : int
        Points of each cloud that the network sees, at least 1.
    batch : int
        Clouds a step, at least 2. What is left over joins the other batches: no cloud is dropped, none stands alone.
    epochs : int
        Passes over the training clouds, at least 1.
    rate : float
        Learning rate, the first of ``halving``, the highest of ``one-cycle``.
    schedule : {"halving", "one-cycle"}
        Halved every ``halve_every`` epochs; or up a line over the first tenth of all steps and down a cosine to nothing.
    halve_every : int
        Epochs between two halvings.
    stop_below : float
        ``halving`` ends before the epoch whose rate is less: what follows changes nothing that can be seen. 0: never.
    weight_decay : float
        Of AdamW, decoupled; 0 makes it Adam.
    input_transform, feature_transform : bool
        Whether the network turns points (3 x 3) and their features (64 x 64) by T-Nets.
    dropout : float
        Share of the last hidden layer that is left out at a time.
    scaling : {"unit-sphere", "physical"}
        How time, range and velocity become comparable, see `rtradar.classify.prepare`.
    redraw : bool
        Draw other points of a cloud in every epoch; otherwise the same ones.
    augmentation : {"none", "turned", "physical"}
        How training clouds are varied, see `rtradar.classify.prepare`.
    precision : {"float32", "bfloat16"}
        Of the search for the largest value over the points while it learns; values, gradients and answers are float32 always.

    Raises
    ------
    InputError
        Where a value is out of its range.

    Notes
    -----
    The paper's (section 3.3.2): batches of 3, Adam at 1e-4 halved every 10 epochs, 200 epochs. After 70 epochs the rate is below
    1e-6, at which its own first trial did not learn in 200. It normalises clouds, and does not tell by what.
    """

    name: str
    points: int = 1000
    batch: int = 3
    epochs: int = 200
    rate: float = 1e-4
    schedule: Schedule = "halving"
    halve_every: int = 10
    stop_below: float = 1e-6
    weight_decay: float = 0.0
    input_transform: bool = True
    feature_transform: bool = True
    dropout: float = 0.3
    scaling: Scaling = "physical"
    redraw: bool = False
    augmentation: Augmentation = "none"
    precision: Precision = "float32"

    def __post_init__(self) -> None:
        for field, least in (("points", 1), ("batch", 2), ("epochs", 1), ("halve_every", 1)):
            value = getattr(self, field)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise InputError(
                    f"recipe: {field} = {value!r}; it must be a whole number, at least {least}"
                )
        if not (math.isfinite(self.rate) and self.rate > 0):
            raise InputError(
                f"recipe: rate = {self.rate!r}; it must be a finite number above 0, such as 1e-4"
            )
        for field, value in (("stop_below", self.stop_below), ("weight_decay", self.weight_decay)):
            if not (math.isfinite(value) and value >= 0):
                raise InputError(
                    f"recipe: {field} = {value!r}; it must be a finite number, not negative"
                )
        if not 0 <= self.dropout < 1:
            raise InputError(
                f"recipe: dropout = {self.dropout!r}; it must be at least 0 and below 1"
            )
        for field, allowed in (
            ("schedule", SCHEDULES),
            ("scaling", SCALINGS),
            ("augmentation", AUGMENTATIONS),
            ("precision", PRECISIONS),
        ):
            if getattr(self, field) not in allowed:
                raise InputError(
                    f"recipe: {field} = {getattr(self, field)!r}; it must be one of {', '.join(allowed)}"
                )

    @property
    def epochs_run(self) -> int:
        """Epochs until the end: all of them, or those before the halved rate falls below ``stop_below``."""
        if self.schedule == "one-cycle":
            return self.epochs
        return next(
            (epoch for epoch in range(1, self.epochs) if self._halved(epoch) < self.stop_below),
            self.epochs,
        )

    def rate_at(self, epoch: int, progress: float) -> float:
        """Learning rate at a step: ``progress``, 0 to 1, is the share of the epoch's steps that are done.

        Parameters
        ----------
        epoch : int
            From 0.
        progress : float
            From 0 to 1.

        Returns
        -------
        float
        """
        if self.schedule == "halving":
            return self._halved(epoch)
        done = (epoch + progress) / self.epochs
        warm = 0.1
        return self.rate * (
            max(done, 1e-3) / warm
            if done < warm
            else (1 + math.cos(math.pi * (done - warm) / (1 - warm))) / 2
        )

    def _halved(self, epoch: int) -> float:
        return self.rate * 0.5 ** (epoch // self.halve_every)

    def changed(self, **fields: Any) -> Recipe:
        """The same with other values; those that are None stay as they are.

        Parameters
        ----------
        **fields
            By the names of the fields.

        Returns
        -------
        Recipe
        """
        return dataclasses.replace(
            self, **{name: value for name, value in fields.items() if value is not None}
        )

    def as_dict(self) -> dict[str, Any]:
        """The fields by their names, plain values."""
        return dataclasses.asdict(self)


PAPER = Recipe("paper")
"""The paper's settings, on the whole of every fold (the paper drops a test cloud that does not fill a batch)."""

LEAN = Recipe(
    "lean",
    batch=16,
    epochs=30,
    rate=2e-3,
    schedule="one-cycle",
    weight_decay=1e-2,
    input_transform=False,
    feature_transform=False,
    redraw=True,
    augmentation="physical",
)
"""Our own: larger batches at a higher rate, no T-Nets (which mix time with velocity), other points every time, varied clouds."""

RECIPES = {recipe.name: recipe for recipe in (LEAN, PAPER)}
"""By their names."""
