"""Maxima between the points of a grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def refine(
    sines: NDArray[np.float64], power: NDArray[np.float32], index: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sine and power of maxima between the points of the grid: the parabola through three logarithms of power.

    Parameters
    ----------
    sines : (sine,) float64
        Uniform.
    power : (cell, sine) float32
    index : (cell, peak) int64
        Where on the grid the maxima are; at its ends they are left as they are.

    Returns
    -------
    sine, power : (cell, peak) float64
    """
    last = len(sines) - 1
    tiny = np.finfo(np.float32).tiny
    left, middle, right = (
        np.log(
            np.maximum(
                np.take_along_axis(power, np.clip(index + step, 0, last), axis=1), tiny
            ).astype(np.float64)
        )
        for step in (-1, 0, 1)
    )
    bend = left - 2 * middle + right
    inside = (bend < 0) & (index > 0) & (index < last)
    shift = np.where(
        inside, np.clip(0.5 * (left - right) / np.where(inside, bend, -1.0), -0.5, 0.5), 0.0
    )
    return sines[index] + shift * (sines[1] - sines[0]), np.exp(
        middle - 0.25 * (left - right) * shift
    )
