"""Window functions, which weight samples before a transform, and the side lobes that they leave."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.settings import RunSettings

WindowName = str | tuple[str, float]
"""Name of a window function, or its name and its parameter."""

NAMES = (
    *("barthann", "bartlett", "blackman", "blackmanharris", "bohman", "boxcar", "cosine"),
    *("flattop", "hamming", "hann", "nuttall", "parzen", "taylor", "triang", "tukey"),
)
"""Window functions that take no parameter, as `scipy.signal.get_window` names them."""

PARAMETERS = {"chebwin": (45.0, 300.0), "kaiser": (0.0, 50.0)}
"""Limits of the parameter: side-lobe attenuation [dB] of ``chebwin``, beta of ``kaiser``."""

_LOBE_SAMPLES = 64
_LOBE_STEPS = 16


@dataclass(frozen=True)
class WindowFunctions:
    """The window functions of the transforms over fast time (range) and over slow time (Doppler).

    All of them are periodic (DFT-even). A spectrum is divided by the sum of its weights, so a tone
    of amplitude 1 in the middle of a bin reads 1 under any of them.

    Parameters
    ----------
    range, doppler : str or (str, float)
        Name of a window function as `scipy.signal.get_window` knows it, such as ``hann`` or
        ``blackman``, or a name and a parameter: ``("chebwin", 80)`` for side lobes at -80 dB,
        ``("kaiser", 8.6)`` for beta.

    Raises
    ------
    InputError
        Where there is no such window function, or its parameter is missing or beyond its limits.
    """

    range: WindowName = RunSettings.range_window
    doppler: WindowName = RunSettings.doppler_window

    def __post_init__(self) -> None:
        for field in ("range", "doppler"):
            object.__setattr__(self, field, _checked(getattr(self, field), f"{field} window"))

    @property
    def main_lobe_bins(self) -> tuple[int, int]:
        """Half widths of the main lobe in Doppler and in range [bins]; 2 of ``hann``."""
        return _main_lobe_bins(self.doppler), _main_lobe_bins(self.range)


@lru_cache(maxsize=64)
def weights(window: WindowName, n: int) -> NDArray[np.float64]:
    """Weights (sample,) of a periodic window function, divided by their sum; read-only."""
    if window == "hann":
        values = hann(n)
    else:
        from scipy.signal import get_window  # here, because scipy.signal is slow to import

        values = np.asarray(get_window(window, n, fftbins=True), dtype=np.float64)
    values = values / values.sum()
    values.flags.writeable = False
    return values


def hann(n: int) -> NDArray[np.float64]:
    """Periodic Hann window (sample,), which needs no SciPy; one sample alone is 1."""
    if n == 1:
        return np.ones(1)
    return 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)


def taylor(n: int, equal_lobes: int, side_lobe_db: float) -> NDArray[np.float64]:
    """Symmetric Taylor window (element,) with so many nearly equal side lobes, without SciPy.

    It is the mean 1 plus cosines, so not of height 1; `scipy.signal` is slow to import.
    """
    # The inner zeros are those of the ideal pattern, dilated so that they join the zeros of a
    # uniform line; the coefficients of the cosines follow from them.
    a = np.arccosh(10 ** (side_lobe_db / 20)) / np.pi
    dilated = equal_lobes**2 / (a**2 + (equal_lobes - 0.5) ** 2)
    orders = np.arange(1, equal_lobes)
    zeros = dilated * (a**2 + (orders - 0.5) ** 2)
    window = np.ones(n)
    for order in orders:
        others = orders[orders != order]
        height = np.prod(1 - order**2 / zeros) / np.prod(1 - order**2 / others**2)
        phase = 2 * np.pi * order * (np.arange(n) - (n - 1) / 2) / n
        window -= (-1.0) ** order * height * np.cos(phase)
    return window


def noise_bandwidth_bins(window: WindowName, n: int) -> float:
    """Compute n sum(w^2) / sum(w)^2, which is 1.5 for ``hann``.

    It is the power of a tone, summed over its spectrum, over that in the bin of its peak.
    """
    return n * float(np.sum(weights(window, n) ** 2))


@lru_cache(maxsize=64)
def _main_lobe_bins(window: WindowName) -> int:
    spectrum = np.abs(np.fft.rfft(weights(window, _LOBE_SAMPLES), _LOBE_STEPS * _LOBE_SAMPLES))
    # Below half of its top, where a flat top has no ripple any more.
    first_null = int(np.argmax((np.diff(spectrum) > 0) & (spectrum[:-1] < 0.5 * spectrum.max())))
    return -(-first_null // _LOBE_STEPS)


def _checked(window: Any, name: str) -> WindowName:
    """The window as a name or a tuple; TOML and JSON give lists."""
    if isinstance(window, str) and window in NAMES:
        return window
    if isinstance(window, list | tuple) and len(window) == 2 and window[0] in PARAMETERS:
        (least, most), value = PARAMETERS[window[0]], window[1]
        if isinstance(value, int | float) and least <= value <= most:
            return (str(window[0]), float(value))
    with_parameter = ", ".join(
        f"({kind}, {least:g} to {most:g})" for kind, (least, most) in PARAMETERS.items()
    )
    raise InputError(f"{name} {window!r} is unknown; allowed: {', '.join(NAMES)}, {with_parameter}")


DEFAULT_WINDOWS = WindowFunctions()
"""The default of everything that transforms: the window functions of `RunSettings`."""


# -- range side lobes that are detected -----------------------------------------------------------

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
        # How far each detection is after the strongest cell of its velocity, around the axis, and
        # what a side lobe would have there.
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
        # The ranges between which all but a hundredth at either end lie; side lobes between them do
        # not matter.
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
    # A tone may lie anywhere within half a bin of its strongest bin: the largest of these cases
    # counts.
    away = _STEPS * np.arange(n)
    offsets = np.arange(-_STEPS // 2, _STEPS // 2 + 1)
    levels = spectrum[(away - offsets[:, None]) % (_STEPS * n)] / spectrum[offsets][:, None]
    falls = levels.max(axis=0)
    # The main lobe ends where the spectrum first rises again.
    end = int(np.argmax(np.diff(spectrum[: _STEPS * n // 2 + 1]) > 0)) // _STEPS + 1
    falls[:end], falls[n - end + 1 :] = 0, 0
    return np.asarray(falls)
