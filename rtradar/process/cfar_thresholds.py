"""Multipliers of CFAR detectors: by how much a detected cell exceeds its neighbours.

The sections on detection of the theory page have the laws, :eq:`os-cfar-looks` and :eq:`ca-cfar`.
They hold for training cells that are independent of each other. In windowed maps neighbouring cells
are correlated, and the rate is higher than asked; validation/closed_forms/cfar.py measures by how
much.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.special import betainccinv, betaincinv, gammainc, gammaincc, gammaln

from rtradar.errors import InputError

_DEPTH = 46.0
"""The integrand is followed down to exp(-46) = 1e-20 of its peak."""

_NODES = 160
"""Nodes of the trapezoidal rule on the bell-shaped integrand: an error of 1e-9 of the integral."""

_TINY = 1e-290
"""Below this the incomplete Gamma functions lose digits; far outside the peak a leading term
suffices."""


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
    _check_law(n_train, pfa, looks)
    check_quantile(quantile)
    return _os_scale(int(n_train), order_rank(n_train, quantile), float(pfa), int(looks))


def ca_scale(n_train: int, pfa: float, looks: int = 1) -> float:
    """Multiplier of the cell-averaging detector, on the mean of its training cells (:eq:`ca-cfar`).

    Parameters
    ----------
    n_train : int
        Training cells N.
    pfa : float
        Asked false-alarm rate, in (0, 1).
    looks : int
        Independent exponential powers summed in each cell.

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
    _check_law(n_train, pfa, looks)
    # F.isf(pfa, 2L, 2NL) = N (1 - y) / y with y the pfa-quantile of Beta(NL, L); 1 - y by itself,
    # without cancellation.
    remainder = betainccinv(looks, n_train * looks, pfa)
    return float(n_train * remainder / betaincinv(n_train * looks, looks, pfa))


def check_quantile(quantile: float) -> None:
    """Raise InputError unless the quantile lies in (0, 1]."""
    if not 0 < quantile <= 1:
        raise InputError(f"CFAR: quantile = {quantile!r}; it must be above 0 and at most 1")


def check_pfa(pfa: float) -> None:
    """Raise InputError unless the false-alarm rate lies in (0, 1)."""
    if not 0 < pfa < 1:
        raise InputError(f"CFAR: pfa = {pfa!r}; a false-alarm rate must lie between 0 and 1")


def check_count(name: str, count: int, least: int = 1) -> None:
    """Raise InputError unless a count is a whole number of at least so many."""
    if isinstance(count, bool) or count != int(count) or count < least:
        raise InputError(f"CFAR: {name} = {count!r}; it must be a whole number, at least {least}")


def check_scale(where: str, scale: float | None) -> None:
    """Raise InputError unless a given multiplier is positive and finite."""
    if scale is not None and not 0 < scale < math.inf:
        raise InputError(f"{where}: scale = {scale!r}; a multiplier must be positive and finite")


def checked_power(where: str, power: ArrayLike) -> NDArray[np.floating]:
    """Power (range, velocity), C-contiguous float32 or float64; InputError if it is no power."""
    cells = np.asarray(power)
    if cells.ndim != 2 or cells.dtype.kind not in "fiu":
        raise InputError(
            f"{where}: power has shape {cells.shape}, type {cells.dtype}; it must be a real "
            "(range, velocity) map"
        )
    kind = np.float32 if cells.dtype == np.float32 else np.float64
    cells = np.ascontiguousarray(cells, dtype=kind)
    if not (cells >= 0).all() or not np.isfinite(cells).all():
        raise InputError(
            f"{where}: power holds NaN, infinity or a negative value; give linear power, not "
            "decibels"
        )
    return cells


def _check_law(n_train: int, pfa: float, looks: int) -> None:
    check_count("n_train", n_train)
    check_pfa(pfa)
    check_count("looks", looks)


@lru_cache(maxsize=4096)
def _os_scale(n_train: int, rank: int, pfa: float, looks: int) -> float:
    goal = math.log(pfa)
    index = np.arange(n_train, n_train - rank, -1.0)

    def excess(log_alpha: float) -> float:
        alpha = math.exp(log_alpha)
        if looks == 1:
            return -float(np.log1p(alpha / index).sum()) - goal
        return _log_os_pfa(alpha, n_train, rank, looks) - goal

    return multiplier(excess, xtol=1e-12, rtol=1e-14)


def multiplier(excess: Callable[[float], float], *, xtol: float, rtol: float) -> float:
    """The multiplier at whose logarithm, to these tolerances, a falling function passes 0."""
    low, high = -1.0, 1.0
    while excess(low) < 0:
        low -= 2.0
    while excess(high) > 0:
        high += 1.0
    return math.exp(brentq(excess, low, high, xtol=xtol, rtol=rtol))


def _log_os_pfa(alpha: float, n_train: int, rank: int, looks: int) -> float:
    """Logarithm of the false-alarm rate: the mean over the order statistic z, over t = log z.

    The integrand has one peak and falls at least exponentially on both sides, so the trapezoidal
    rule between the points where it has vanished converges faster than any power of the step.
    """

    def log_integrand(t: NDArray[np.float64]) -> NDArray[np.float64]:
        z = np.exp(t)
        below, above = _log_lower(looks, z), _log_upper(looks, z)
        alarm = _log_upper(looks, alpha * z)
        return constant + looks * t - z + (rank - 1) * below + (n_train - rank) * above + alarm

    constant = float(
        gammaln(n_train + 1) - gammaln(rank) - gammaln(n_train - rank + 1) - gammaln(looks)
    )
    t = np.linspace(*_support(log_integrand, looks), _NODES)
    values = log_integrand(t)
    peak = values.max()
    return float(peak + np.log(np.exp(values - peak).sum() * (t[1] - t[0])))


def _log_lower(looks: int, z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Logarithm of the regularised lower incomplete Gamma function."""
    return _log_or(gammainc(looks, z), looks * np.log(z) - z - gammaln(looks + 1))


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
