"""How well a detection mask fits the truth: which cells hold a target, and precision and missing rate (paper, Table 3).

The truth comes from the map without noise: a cell holds a target where its power stands far enough above the noise power
that the same cell has on average, which is known from the noise of the samples and the windows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.process.window_functions import HANN, WindowFunctions, weights
from rtradar.radar import Radar


@dataclass(frozen=True)
class DetectionScore:
    """Cells counted by mask and truth; the scores of several maps add up.

    Parameters
    ----------
    hits : int
        Detected, and a target.
    false : int
        Detected, and none.
    missed : int
        A target, and not detected.
    """

    hits: int = 0
    false: int = 0
    missed: int = 0

    def __add__(self, other: DetectionScore) -> DetectionScore:
        return DetectionScore(
            self.hits + other.hits, self.false + other.false, self.missed + other.missed
        )

    @property
    def precision(self) -> float:
        """Share of the detections that are targets; NaN without detections."""
        return _share(self.hits, self.hits + self.false)

    @property
    def missing_rate(self) -> float:
        """Share of the targets that are not detected; NaN without targets."""
        return _share(self.missed, self.hits + self.missed)


def score(mask: ArrayLike, truth: ArrayLike) -> DetectionScore:
    """Count the cells of a detection mask against the truth.

    Parameters
    ----------
    mask, truth : bool arrays of one shape
        Where something was detected, and where a target is.

    Raises
    ------
    InputError
        Where they are not boolean or differ in shape.
    """
    found, real = np.asarray(mask), np.asarray(truth)
    if found.dtype != np.bool_ or real.dtype != np.bool_ or found.shape != real.shape:
        raise InputError(
            f"score: mask has shape {found.shape}, type {found.dtype}, truth shape {real.shape}, type {real.dtype}; "
            "both must be boolean and of one shape"
        )
    hits = int((found & real).sum())
    return DetectionScore(hits, int(found.sum()) - hits, int(real.sum()) - hits)


def target_cells(power: ArrayLike, noise_power: float, margin_db: float) -> NDArray[np.bool_]:
    """Cells whose power stands more than a margin above the noise.

    Parameters
    ----------
    power : float array
        Of the map without noise, linear, as of `power_map`.
    noise_power : float
        Mean noise power of a cell of that map, see `cell_noise_power`.
    margin_db : float

    Returns
    -------
    bool array of the shape of ``power``

    Raises
    ------
    InputError
        Where the noise power is not positive, or it or the margin not finite.
    """
    if not 0 < noise_power < math.inf:
        raise InputError(
            f"target_cells: noise_power = {noise_power!r}; it must be positive and finite"
        )
    if not math.isfinite(margin_db):
        raise InputError(
            f"target_cells: margin_db = {margin_db!r}; it must be a finite number of decibels"
        )
    return np.asarray(np.asarray(power) > noise_power * 10 ** (margin_db / 10))


def cell_noise_power(
    noise_power: float, radar: Radar, looks: int = 1, window_functions: WindowFunctions = HANN
) -> float:
    """Mean noise power of a cell of `power_map`.

    White noise of power P a sample leaves P sum(w^2) / sum(w)^2 in a spectrum divided by the sum of its window; so once for
    fast time and once for slow time, and added up over channels.

    Parameters
    ----------
    noise_power : float
        Of one complex IF sample, as of `rtradar.signal.Noise` [m^2].
    radar : Radar
        Gives the lengths of the windows.
    looks : int
        Channels summed in the map.
    window_functions : WindowFunctions
        Window functions of the map.

    Returns
    -------
    float
        In the unit of ``noise_power``.
    """
    fast = weights(window_functions.range, radar.samples_per_chirp)
    slow = weights(window_functions.doppler, radar.cycles_per_frame)
    return float(looks * noise_power * np.sum(fast**2) * np.sum(slow**2))


def _share(part: int, whole: int) -> float:
    return part / whole if whole else math.nan
