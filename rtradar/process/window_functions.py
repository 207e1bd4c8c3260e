"""Windows that samples are weighted by before a Fourier transform."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError


def hann(n: int) -> NDArray[np.float64]:
    """Periodic (DFT-even) Hann window (sample,); one sample alone is 1."""
    if n == 1:
        return np.ones(1)
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)


def weights(window: ArrayLike | None, n: int, name: str) -> NDArray[np.float64]:
    """The window, Hann if none is given, divided by its sum."""
    if window is None:
        return _hann_weights(n)
    given = np.asarray(window)
    if given.shape != (n,) or given.dtype.kind not in "fiu" or not np.isfinite(given).all():
        raise InputError(
            f"{name} has shape {given.shape}, type {given.dtype}; it must be {n} finite real numbers"
        )
    total = float(given.sum())
    if total == 0:
        raise InputError(f"{name} sums to 0; a window needs weight")
    return given.astype(np.float64) / total


@lru_cache(maxsize=16)
def _hann_weights(n: int) -> NDArray[np.float64]:
    weights = hann(n) / hann(n).sum()
    weights.flags.writeable = False
    return weights
