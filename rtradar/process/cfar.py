"""CFAR detectors on a range-Doppler power map: order statistic and cell averaging.

The training cells of a cell are the square ring of half-width ``guard + train`` without the square
of half-width ``guard`` around it. At the edges of the map only those that exist count, with the
rank and the multiplier of their number.

Multipliers follow the laws :eq:`os-cfar-looks` and :eq:`ca-cfar`, which hold where training cells
are independent of each other. In windowed maps neighbouring cells are correlated, and the rate is
higher than the one that is asked for; validation/closed_forms/cfar.py measures by how much.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import correlate1d
from scipy.optimize import brentq
from scipy.special import betainccinv, betaincinv, gammainc, gammaincc, gammaln

from rtradar.errors import InputError


def os_cfar(
    power: ArrayLike,
    guard: int = 2,
    train: int = 4,
    quantile: float = 0.75,
    pfa: float = 1e-6,
    looks: int = 1,
    scale: float | None = None,
) -> NDArray[np.bool_]:
    """Order-statistic CFAR (Rohling, 1983).

    A cell is detected where it exceeds the multiplier times the k-th smallest of its N training
    cells, k = ceil(quantile N).

    Parameters
    ----------
    power : (range, velocity) float
        Power, linear, in any unit: only ratios count. Not decibels, not magnitudes.
    guard, train : int
        Width of the guard and of the training band [cells].
    quantile : float
        Rank of the training cell that estimates the noise, as a fraction in (0, 1].
    pfa : float
        False-alarm rate for independent cells, in (0, 1); `os_scale` turns it into the multiplier.
    looks : int
        Channels summed in ``power``.
    scale : float, optional
        The multiplier itself, instead of the one solved for ``pfa``.

    Returns
    -------
    (range, velocity) bool
        True where a cell is detected.

    Raises
    ------
    InputError
        Where the map is not two-dimensional, holds NaN, infinity or a negative value, or has a cell
        without training cells, or where another argument is out of its range.

    Examples
    --------
    >>> import numpy as np
    >>> import rtradar as rt
    >>> power = np.random.default_rng(0).exponential(size=(64, 64))
    >>> power[20, 30] = 1000.0
    >>> [tuple(map(int, cell)) for cell in np.argwhere(rt.process.os_cfar(power))]
    [(20, 30)]
    """
    _check_quantile(quantile)
    # The k-th smallest is below x / alpha exactly where at least k of the ring are: counting needs
    # no sorting.
    cells, law = _checked(power, _Options(guard, train, quantile, pfa, looks, scale))
    thresholds = cells / law.scales.astype(cells.dtype)
    return np.asarray(_count_below(cells, thresholds, guard, guard + train) >= law.ranks)


def ca_cfar(
    power: ArrayLike,
    guard: int = 2,
    train: int = 4,
    pfa: float = 1e-6,
    looks: int = 1,
    scale: float | None = None,
) -> NDArray[np.bool_]:
    """Cell-averaging CFAR: a cell is detected where it exceeds a multiple of the mean of its ring.

    Parameters
    ----------
    power, guard, train, pfa, looks, scale
        What they mean for `os_cfar`; `ca_scale` turns the rate into the multiplier.

    Returns
    -------
    (range, velocity) bool
        True where a cell is detected.

    Raises
    ------
    InputError
        Where `os_cfar` raises it.
    """
    cells, law = _checked(power, _Options(guard, train, None, pfa, looks, scale))
    # A cell exceeds scale times the mean where the sum of its ring is below count / scale times the
    # cell.
    sums_wanted = cells * (law.counts / law.scales).astype(cells.dtype)
    inner = np.zeros(2 * (guard + train) + 1)
    inner[train : train + 2 * guard + 1] = 1
    # The rows beside the guard cells whole, theirs without them: a difference of sums over squares
    # would drown weak cells beside a strong one.
    rows, parts = (_sums(cells, weights, 1) for weights in (np.ones(len(inner)), 1 - inner))
    return np.asarray(_sums(rows, 1 - inner, 0) + _sums(parts, inner, 0) < sums_wanted)


def _sums(cells: NDArray[np.floating], weights: NDArray[np.float64], axis: int) -> Any:
    """Sums of neighbours along an axis, none beyond the edges."""
    return correlate1d(cells, weights, axis, output=np.float64, mode="constant")


class _Options(NamedTuple):
    """Options of a detector; that of the mean has no quantile."""

    guard: int
    train: int
    quantile: float | None
    pfa: float
    looks: int
    scale: float | None


class _Law(NamedTuple):
    """Number of training cells, rank and multiplier of each cell (range, velocity)."""

    counts: NDArray[np.int32]
    ranks: NDArray[np.int32]
    scales: NDArray[np.float64]


# It is the same for all maps of a capture, and as slow as a map.
@lru_cache(maxsize=4)
def _law(shape: tuple[int, ...], options: _Options) -> _Law:
    """Law of the order statistic of a quantile, or of the mean, which has no ranks."""
    guard, train, quantile, pfa, looks, scale = options

    def square(half: int) -> NDArray[np.int32]:
        # How many cells of the square are inside the map, row by row and column by column.
        rows, columns = (
            np.minimum(np.arange(n) + half, n - 1) - np.maximum(np.arange(n) - half, 0) + 1
            for n in shape
        )
        return np.outer(rows, columns).astype(np.int32)

    counts = square(guard + train) - square(guard)
    if counts.size and counts.min() == 0:
        raise InputError(
            f"CFAR: in a map of {shape[0]} x {shape[1]} a cell has no training cells with guard = "
            f"{guard}; each axis, or one of them, needs more than {2 * guard + 1} cells"
        )
    # Once for each number of training cells that occurs.
    ranks, scales = np.zeros((2, int(counts.max(initial=0)) + 1))
    for n in np.unique(counts).tolist():
        if quantile is not None:
            ranks[n] = order_rank(n, quantile)
        if scale is not None:
            scales[n] = scale
        elif quantile is None:
            scales[n] = ca_scale(n, pfa, looks)
        else:
            scales[n] = os_scale(n, quantile, pfa, looks)
    return _Law(counts, ranks[counts].astype(np.int32), scales[counts])


def _checked(power: ArrayLike, options: _Options) -> tuple[NDArray[np.floating], _Law]:
    """The map as C-contiguous float32 or float64, and its law."""
    cells = np.asarray(power)
    if cells.ndim != 2 or cells.dtype.kind not in "fiu":
        raise InputError(
            f"CFAR: power has shape {cells.shape}, type {cells.dtype}; it must be a real "
            "(range, velocity) map"
        )
    cells = np.ascontiguousarray(cells, np.float32 if cells.dtype == np.float32 else np.float64)
    if (cells < 0).any():
        raise InputError("CFAR: power is negative; give linear power, not decibels")
    if not np.isfinite(cells).all():
        raise InputError(
            "CFAR: power holds NaN or infinity; give finite samples, whose squares do not "
            f"exceed {np.finfo(np.float32).max:.1g}"
        )
    _check_count("guard", options.guard, least=0)
    _check_count("train", options.train)
    _check_rate(options.pfa, options.looks)
    if (scale := options.scale) is not None and not 0 < scale < math.inf:
        raise InputError(f"CFAR: scale = {scale!r}; a multiplier must be positive and finite")
    return cells, _law(cells.shape, options)


def _count_below(
    cells: NDArray[np.floating], thresholds: NDArray[np.floating], guard: int, outer: int
) -> NDArray[np.unsignedinteger]:
    """Number of training cells that lie below the threshold of each cell (range, velocity)."""
    rows, columns = cells.shape
    count = np.zeros(cells.shape, dtype=np.min_scalar_type((2 * outer + 1) ** 2))
    # Beyond the edges there is infinity, which is below no threshold. The map is shifted as a whole
    # to each place of the ring.
    below, padded = np.empty(cells.shape, np.bool_), np.pad(cells, outer, constant_values=np.inf)
    for down, right in np.ndindex(2 * outer + 1, 2 * outer + 1):
        if max(abs(down - outer), abs(right - outer)) > guard:
            neighbours = padded[down : down + rows, right : right + columns]
            np.less(neighbours, thresholds, out=below)
            count += below.view(np.uint8)
    return count


# -- multipliers -----------------------------------------------------------------------------------

_DEPTH = 46.0
"""The integrand is followed down to exp(-46) = 1e-20 of its peak."""

_NODES = 160
"""Nodes of the trapezoidal rule on the bell-shaped integrand: an error of 1e-9 of the integral."""

_TINY = 1e-290
"""Below this the incomplete Gamma functions lose digits, and a leading term suffices."""


def order_rank(n_train: int, quantile: float) -> int:
    """Rank ``k = ceil(quantile * n_train)`` of the order statistic from the smallest, at least 1.

    A product that exceeds a whole number only by rounding (0.1 * 30) counts as that number.
    """
    return max(1, math.ceil(quantile * n_train * (1 - 1e-12)))


def os_scale(n_train: int, quantile: float, pfa: float, looks: int = 1) -> float:
    """Multiplier of the order-statistic detector (:eq:`os-cfar`, :eq:`os-cfar-looks`).

    Parameters
    ----------
    n_train : int
        Training cells N.
    quantile : float
        Rank of the order statistic as a fraction in (0, 1]; the rank is ceil(quantile N).
    pfa : float
        Asked false-alarm rate, in (0, 1).
    looks : int
        Independent exponential powers summed in each cell.

    Returns
    -------
    float
        alpha such that a cell above alpha times the order statistic is a false alarm with
        probability ``pfa``.

    Raises
    ------
    InputError
        Where an argument is out of its range.
    """
    _check_count("n_train", n_train)
    _check_rate(pfa, looks)
    _check_quantile(quantile)
    return _os_scale(int(n_train), order_rank(n_train, quantile), float(pfa), int(looks))


def ca_scale(n_train: int, pfa: float, looks: int = 1) -> float:
    """Multiplier of the cell-averaging detector, on the mean of its training cells (:eq:`ca-cfar`).

    Parameters
    ----------
    n_train, pfa, looks
        What they mean for `os_scale`.

    Returns
    -------
    float
        alpha such that a cell above alpha times the mean is a false alarm with probability ``pfa``;
        for one look N (pfa^(-1/N) - 1).

    Raises
    ------
    InputError
        Where an argument is out of its range.
    """
    _check_count("n_train", n_train)
    _check_rate(pfa, looks)
    # F.isf(pfa, 2L, 2NL) = N (1 - y) / y with y the pfa-quantile of Beta(NL, L); 1 - y by itself,
    # without cancellation.
    remainder = betainccinv(looks, n_train * looks, pfa)
    return float(n_train * remainder / betaincinv(n_train * looks, looks, pfa))


def _check_quantile(quantile: float) -> None:
    if not 0 < quantile <= 1:
        raise InputError(f"CFAR: quantile = {quantile!r}; it must be above 0 and at most 1")


def _check_rate(pfa: float, looks: int) -> None:
    if not 0 < pfa < 1:
        raise InputError(f"CFAR: pfa = {pfa!r}; a false-alarm rate must lie between 0 and 1")
    _check_count("looks", looks)


def _check_count(name: str, count: int, least: int = 1) -> None:
    if isinstance(count, bool) or count != int(count) or count < least:
        raise InputError(f"CFAR: {name} = {count!r}; it must be a whole number, at least {least}")


@lru_cache(maxsize=4096)
def _os_scale(n_train: int, rank: int, pfa: float, looks: int) -> float:
    goal = math.log(pfa)
    index = np.arange(n_train, n_train - rank, -1.0)

    def excess(log_alpha: float) -> float:
        alpha = math.exp(log_alpha)
        # For one look the product in closed form, in logarithms, which do not underflow at small
        # rates.
        if looks == 1:
            return -float(np.log1p(alpha / index).sum()) - goal
        return _log_os_pfa(alpha, n_train, rank, looks) - goal

    # The rate falls with the multiplier: an interval that holds the root, and then the root.
    low, high = -1.0, 1.0
    while excess(low) < 0:
        low -= 2.0
    while excess(high) > 0:
        high += 1.0
    return math.exp(brentq(excess, low, high, xtol=1e-12, rtol=1e-14))


def _log_os_pfa(alpha: float, n_train: int, rank: int, looks: int) -> float:
    """Logarithm of the false-alarm rate: the mean over the order statistic z, over t = log z.

    The integrand has one peak and falls at least exponentially on both sides, so the trapezoidal
    rule between the points where it has vanished converges faster than any power of the step.
    """

    def log_integrand(t: NDArray[np.float64]) -> NDArray[np.float64]:
        z = np.exp(t)
        # Density of the k-th smallest of N at z, over t = log z: (k - 1) below it, the others
        # above, and the alarm above alpha z.
        below = _log_or(gammainc(looks, z), looks * t - z - gammaln(looks + 1))
        above = _log_upper(looks, z)
        alarm = _log_upper(looks, alpha * z)
        return constant + looks * t - z + (rank - 1) * below + (n_train - rank) * above + alarm

    constant = float(
        gammaln(n_train + 1) - gammaln(rank) - gammaln(n_train - rank + 1) - gammaln(looks)
    )
    t = np.linspace(*_support(log_integrand, looks), _NODES)
    values = log_integrand(t)
    # Relative to its peak, so that the integral does not underflow.
    peak = values.max()
    return float(peak + np.log(np.exp(values - peak).sum() * (t[1] - t[0])))


def _log_upper(looks: int, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithm of the regularised upper incomplete Gamma function."""
    return _log_or(gammaincc(looks, z), (looks - 1) * np.log(z) - z - gammaln(looks))


def _log_or(value: NDArray[np.float64], leading: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithm of a value, or its ``leading`` term where the value underflows."""
    small = value < _TINY
    return np.where(small, leading, np.log(np.where(small, 1.0, value)))


def _support(
    log_integrand: Callable[[NDArray[np.float64]], NDArray[np.float64]], looks: int
) -> tuple[float, float]:
    """Where the integrand lies less than `_DEPTH` under its peak, found by narrowing a grid."""
    low, high = math.log(looks) - 60.0, math.log(looks) + 8.0
    for _ in range(4):
        t = np.linspace(low, high, 64)
        values = log_integrand(t)
        alive = np.flatnonzero(values > values.max() - _DEPTH)
        low, high = t[max(alive[0] - 1, 0)], t[min(alive[-1] + 1, t.size - 1)]
    return float(low), float(high)
