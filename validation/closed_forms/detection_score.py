"""Score a detection mask against the truth, by precision and missing rate (paper, Table 3).

The truth comes from the map without noise: a cell holds a target where its power exceeds the mean
noise power of a cell by a margin. That noise power follows from the noise of the IF samples and
from the window functions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.process.window_functions import DEFAULT_WINDOWS, WindowFunctions, weights
from rtradar.radar import Radar


@dataclass(frozen=True)
class DetectionScore:
    """Cells counted by mask and truth; the scores of several maps add up.

    Parameters
    ----------
    hits : int
        Number of targets that are detected.
    false : int
        Number of detections that are no target.
    missed : int
        Number of targets that are not detected.
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
        """Fraction of the detections that are targets; NaN without detections."""
        return _fraction(self.hits, self.hits + self.false)

    @property
    def missing_rate(self) -> float:
        """Fraction of the targets that are not detected; NaN without targets."""
        return _fraction(self.missed, self.hits + self.missed)


def score(mask: ArrayLike, truth: ArrayLike) -> DetectionScore:
    """Count the cells of a detection mask against the truth.

    Parameters
    ----------
    mask, truth : bool arrays of one shape
        Cells where something is detected, and cells that hold a target.

    Raises
    ------
    InputError
        Where they are not boolean or differ in shape.
    """
    found, real = np.asarray(mask), np.asarray(truth)
    if found.dtype != np.bool_ or real.dtype != np.bool_ or found.shape != real.shape:
        raise InputError(
            f"score: mask has shape {found.shape}, type {found.dtype}, "
            f"truth shape {real.shape}, type {real.dtype}; "
            "both must be boolean and of one shape"
        )
    hits = int((found & real).sum())
    return DetectionScore(hits, int(found.sum()) - hits, int(real.sum()) - hits)


def target_cells(power: ArrayLike, noise_power: float, margin_db: float) -> NDArray[np.bool_]:
    """Find the cells whose power exceeds the noise by more than a margin.

    Parameters
    ----------
    power : float array
        Map without noise from `power_map`, linear.
    noise_power : float
        Mean noise power of a cell of that map, see `cell_noise_power`.
    margin_db : float
        Least ratio of a target's power to the noise power [dB].

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
    noise_power: float,
    radar: Radar,
    looks: int = 1,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
) -> float:
    """Mean noise power of a cell of `power_map`.

    White noise of power P a sample leaves P sum(w^2) in a spectrum whose weights w have the sum 1.
    This factor enters for fast time and for slow time, and the channels are added up.

    Parameters
    ----------
    noise_power : float
        Noise power of one complex IF sample, as in `rtradar.signal.Noise` [m^2].
    radar : Radar
        Gives the lengths of the windows.
    looks : int
        Number of channels that are summed in the map.
    window_functions : WindowFunctions
        Window functions of the map.

    Returns
    -------
    float
        Mean noise power of a cell, in the unit of ``noise_power``.
    """
    fast = weights(window_functions.range, radar.samples_per_chirp)
    slow = weights(window_functions.doppler, radar.cycles_per_frame)
    return float(looks * noise_power * np.sum(fast**2) * np.sum(slow**2))


def _fraction(part: int, whole: int) -> float:
    return part / whole if whole else math.nan
