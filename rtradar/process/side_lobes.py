"""Range side lobes that are detected: where they may be, and where everything else is."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.process.window_functions import WindowName, weights

_TOGETHER = 4.0
"""Power of side lobes of several echoes in a column over that of the strongest alone: 6 dB."""

_CENTRAL_PERCENT = (1, 99)
_STEPS = 16


class SeenRanges(NamedTuple):
    """Ranges between which detections are, ``low_m`` to ``high_m`` [m], but one in a hundred.

    Of the ``detections`` in all, ``side_lobes`` lie outside and may be range side lobes.
    """

    low_m: float
    high_m: float
    side_lobes: int
    detections: int


class RangeSideLobes:
    """Counts detections by range bin, apart from those that may be range side lobes.

    A range spectrum is periodic: the side lobes of an echo go on past the last bin from the first.
    A detection may be one if its power is at most that of the side lobe of the strongest cell at
    its velocity.

    Parameters
    ----------
    window : str or (str, float)
        Window function over the samples of a chirp.
    range_m : (range,) float64
        Middle of each range bin [m].
    """

    def __init__(self, window: WindowName, range_m: NDArray[np.float64]) -> None:
        self._falls, self._range_m = _envelope(window, len(range_m)), range_m
        self._apart = np.zeros(len(range_m), np.int64)
        self._lobes = np.zeros(len(range_m), np.int64)

    def add(self, power: NDArray[np.floating], mask: NDArray[np.bool_]) -> None:
        """Count the detections ``mask`` of a map ``power``, both (range, velocity)."""
        rows, columns = np.nonzero(mask)
        n = len(self._falls)
        apart = (rows - power.argmax(axis=0)[columns]) % n
        most = _TOGETHER * self._falls[apart] * power.max(axis=0)[columns]
        may = power[rows, columns] <= most
        self._lobes += np.bincount(rows[may], minlength=n)
        self._apart += np.bincount(rows[~may], minlength=n)

    def found(self) -> SeenRanges | None:
        """Return where detections are; None where there are none but side lobes."""
        if not self._apart.any():
            return None
        passed = np.cumsum(self._apart) / self._apart.sum()
        first, last = (int(np.searchsorted(passed, part / 100)) for part in _CENTRAL_PERCENT)
        outside = self._lobes[:first].sum() + self._lobes[last + 1 :].sum()
        low, high = float(self._range_m[first]), float(self._range_m[last])
        return SeenRanges(low, high, int(outside), int(self._apart.sum() + self._lobes.sum()))


@lru_cache(maxsize=8)
def _envelope(window: WindowName, n: int) -> NDArray[np.float64]:
    """Most power of a tone so many bins after its strongest bin (bin,), over that of this bin.

    It is 0 in the main lobe.
    """
    spectrum = np.abs(np.fft.fft(weights(window, n), _STEPS * n)) ** 2
    away = _STEPS * np.arange(n)
    offsets = np.arange(-_STEPS // 2, _STEPS // 2 + 1)
    levels = spectrum[(away - offsets[:, None]) % (_STEPS * n)] / spectrum[offsets][:, None]
    falls = levels.max(axis=0)
    # The main lobe ends where the spectrum first rises again.
    end = int(np.argmax(np.diff(spectrum[: _STEPS * n // 2 + 1]) > 0)) // _STEPS + 1
    falls[:end], falls[n - end + 1 :] = 0, 0
    return np.asarray(falls)
