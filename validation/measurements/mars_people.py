"""People of MARS, their points as measured and as predicted, and what is fitted on one of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from cloud_figures import (
    LIMBS,
    Ints,
    Reals,
    correlation,
    counts,
    distances,
    nearest_limb,
    weighted_means,
)
from mars_clouds import Mounting, Points, Take, detected, frames_of, joined
from scipy.optimize import brentq, minimize_scalar

Values = tuple[Reals, Ints]
"""Values of points, and the frame of each."""

GUESS, GUESS_DB = Mounting((0.25, 0.0, -0.36)), 17.0
"""Where fits begin: places that joints and points have in common, and a threshold."""


@dataclass(frozen=True)
class Fit:
    """What is fitted on person 1 for one level."""

    mounting: Mounting
    threshold_db: float
    shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Person:
    """Takes of one person, whose frames are numbered through."""

    takes: Sequence[Take]
    every: int  # so many frames are predicted once

    @cached_property
    def starts(self) -> Ints:
        return np.cumsum([0] + [len(take.numbers) for take in self.takes])

    @property
    def frames(self) -> int:
        return int(self.starts[-1])

    @cached_property
    def move(self) -> Ints:
        return np.repeat([take.move for take in self.takes], np.diff(self.starts))

    @cached_property
    def joints(self) -> Reals:
        return np.concatenate([take.joints for take in self.takes])

    @cached_property
    def measured(self) -> Points:
        return self._numbered([take.measured for take in self.takes])

    def predicted(
        self, level: str, fit: Fit, *, removals: Sequence[bool] = (True,), seed: int = 0
    ) -> list[Prediction]:
        """Points of a level, shifted as fitted, with and without removal of what stands still."""
        points: list[list[Points]] = [[] for _ in removals]
        seen = []
        for take, start in zip(self.takes, self.starts[:-1], strict=True):
            for frame, cube in frames_of(take, fit.mounting, level, every=self.every, seed=seed):
                seen.append(start + frame)
                for own, removal in zip(points, removals, strict=True):
                    found = detected(cube, 0, removal=removal, threshold_db=fit.threshold_db)
                    frames = np.full(len(found.frame), start + frame)
                    own.append(found._replace(frame=frames).shifted(fit.shift_m))
        return [Prediction(joined(own), np.array(seen)) for own in points]

    def _numbered(self, parts: list[Points]) -> Points:
        numbered = zip(parts, self.starts[:-1], strict=True)
        return joined([part._replace(frame=part.frame + start) for part, start in numbered])


class Prediction(NamedTuple):
    """Points of a person, and the frames (frame,) that were predicted."""

    points: Points
    seen: Ints


@dataclass(frozen=True, eq=False)
class Comparison:
    """Predicted points beside measured ones; arrays are (frame, predicted and measured)."""

    person: Person
    ours: Prediction
    theirs: Points

    @classmethod
    def of(cls, person: Person, ours: Prediction, theirs: Points | None = None) -> Comparison:
        points = person.measured if theirs is None else theirs
        return cls(person, ours, points.of(np.isin(points.frame, ours.seen)))

    @property
    def halves(self) -> tuple[Comparison, Comparison]:
        """The frames of the first half of each take, and those of the second."""
        person = self.person
        lengths = np.diff(person.starts)
        middle = np.repeat(person.starts[:-1] + lengths // 2, lengths)
        early = self.ours.seen < middle[self.ours.seen]
        first, second = (self._of(self.ours.seen[own]) for own in (early, ~early))
        return first, second

    def _of(self, seen: Ints) -> Comparison:
        ours, theirs = (points.of(np.isin(points.frame, seen)) for points in self.both)
        return Comparison(self.person, Prediction(ours, seen), theirs)

    @property
    def both(self) -> tuple[Points, Points]:
        return self.ours.points, self.theirs

    @property
    def move(self) -> Ints:
        return self.person.move[self.ours.seen]

    @cached_property
    def mean_doppler(self) -> Reals:
        frames, seen = self.person.frames, self.ours.seen
        return np.stack(
            [weighted_means(one.doppler, one.level, one.frame, frames)[seen] for one in self.both],
            axis=1,
        )

    @cached_property
    def counts(self) -> Reals:
        frames, seen = self.person.frames, self.ours.seen
        pair = [counts(one.frame, frames)[seen] for one in self.both]
        return np.stack(pair, axis=1).astype(np.float64)

    @cached_property
    def away_m(self) -> Reals:
        """Wasserstein distance of the ranges of each frame [m]."""
        one, other = ((points.range_m, points.frame) for points in self.both)
        return distances(one, other, self.person.frames)[self.ours.seen]

    @cached_property
    def aside_m(self) -> Reals:
        """Wasserstein distance of what lies sideways of each frame [m]."""
        one, other = (points.of(points.places[:, 0] != 0) for points in self.both)
        pair = [(points.places[:, 0], points.frame) for points in (one, other)]
        return distances(pair[0], pair[1], self.person.frames)[self.ours.seen]

    def limbs(self, offset_m: tuple[float, float, float]) -> Reals:
        """Share of the points of each move that each limb has, (move, limb, 2)."""
        names, shares = self.person.takes[0].names, []
        for points in self.both:
            joints = self.person.joints[points.frame] - offset_m
            limb = nearest_limb(points.places, joints, names)
            move = self.person.move[points.frame]
            table = np.zeros((move.max() + 1, len(LIMBS)))
            np.add.at(table, (move, limb), 1)
            shares.append(table / table.sum(axis=1, keepdims=True))
        return np.stack(shares, axis=-1)


def fitted_mounting(person: Person, lags_s: Sequence[float] = (-0.05, 0.0, 0.05)) -> Mounting:
    """Lag where counts and mean Doppler of a person follow best, and the offset in place there.

    The lag is the vertex of a parabola through the mean of both correlations. Points say little of
    the height of the radar, for the antennas see less of what is high or low: it stays.
    """
    found = []
    for lag_s in lags_s:
        fit = Fit(dataclasses.replace(GUESS, lag_s=lag_s), GUESS_DB)
        one = Comparison.of(person, person.predicted("specular", fit)[0])
        found.append((correlation(one.counts) + correlation(one.mean_doppler)) / 2)
    curve = np.polyfit(lags_s, found, 2)
    lag_s = float(np.clip(-curve[1] / (2 * curve[0]), lags_s[0], lags_s[-1]))
    x, y, z = GUESS.offset_m
    fit = Fit(dataclasses.replace(GUESS, lag_s=lag_s), GUESS_DB)
    aside, away, _ = shift_m(Comparison.of(person, person.predicted("specular", fit)[0]))
    return Mounting((x - aside, y - away, z), lag_s)


def shift_m(one: Comparison) -> tuple[float, float, float]:
    """Constant that brings predicted points nearest to the measured ones, axis by axis [m].

    The mean Wasserstein distance of the frames is the least. Points without an azimuth do not count
    sideways; away from the radar the distance is that in range.
    """
    found = []
    for axis in range(3):
        pair = [points.of((points.places[:, 0] != 0) | (axis != 0)) for points in one.both]
        ours, theirs = (
            (points.range_m if axis == 1 else points.places[:, axis], points.frame)
            for points in pair
        )

        def apart(shift: float, ours: Values = ours, theirs: Values = theirs) -> float:
            moved = ours[0] + shift, ours[1]
            return float(np.nanmean(distances(moved, theirs, one.person.frames)))

        best = minimize_scalar(apart, bounds=(-0.3, 0.3), method="bounded", options={"xatol": 1e-3})
        found.append(float(best.x))
    return found[0], found[1], found[2]


def fitted(person: Person, level: str, mounting: Mounting) -> Fit:
    """Threshold at which a level gives as many points as measured, and its shift in place."""
    cubes, measured = [], []
    for take in person.takes:
        many = counts(take.measured.frame, len(take.numbers))
        for frame, cube in frames_of(take, mounting, level, every=2 * person.every):
            cubes.append(cube)
            measured.append(many[frame])

    def excess(threshold_db: float) -> float:
        found = [
            len(detected(cube, 0, removal=True, threshold_db=threshold_db).frame) for cube in cubes
        ]
        return float(np.mean(found) - np.mean(measured))

    fit = Fit(mounting, float(brentq(excess, 8.0, 26.0, xtol=0.1)))
    one = Comparison.of(person, person.predicted(level, fit)[0])
    return dataclasses.replace(fit, shift_m=shift_m(one))
