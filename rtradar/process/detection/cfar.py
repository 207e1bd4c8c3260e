"""CFAR detectors on a range-Doppler power map: order statistic and cell averaging, in two dimensions.

The training cells of a cell are the square ring of half-width ``guard + train`` without the square of half-width ``guard``
around it. At the edges of the map only those that exist count, with the rank and the multiplier of their number.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.kernels.jit import compiled
from rtradar.process.detection.cfar_thresholds import (
    ca_scale,
    check_looks,
    check_pfa,
    check_quantile,
    order_rank,
    os_scale,
)
from rtradar.system.threads import in_threads

_ROWS_A_THREAD = 64


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

    A cell is detected where it exceeds the multiplier times the k-th smallest of its N training cells,
    k = ceil(quantile N).

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
        Where the map is not two-dimensional, holds NaN, infinity or a negative value, or has a cell without training
        cells, or where another argument is out of its range.
    """
    cells, counts = _checked(power, guard, train, pfa, looks, scale)
    check_quantile(quantile)
    scales, ranks = _os_law(cells.shape, guard, train, quantile, pfa, looks, scale)
    return _by_rows(
        _os_kernel, cells, cells / scales.astype(cells.dtype), ranks, counts, guard, guard + train
    )


def ca_cfar(
    power: ArrayLike,
    guard: int = 2,
    train: int = 4,
    pfa: float = 1e-6,
    looks: int = 1,
    scale: float | None = None,
) -> NDArray[np.bool_]:
    """Cell-averaging CFAR: a cell is detected where it exceeds the multiplier times the mean of its training cells.

    Parameters
    ----------
    power, guard, train, pfa, looks, scale
        As in `os_cfar`; `ca_scale` turns ``pfa`` into the multiplier.

    Returns
    -------
    (range, velocity) bool
        True where a cell is detected.

    Raises
    ------
    InputError
        As in `os_cfar`.
    """
    cells, counts = _checked(power, guard, train, pfa, looks, scale)
    scales = _ca_law(cells.shape, guard, train, pfa, looks, scale)
    return _by_rows(
        _ca_kernel, cells, cells * (counts / scales).astype(cells.dtype), guard, guard + train
    )


# What depends on the shape of the map alone is the same for all maps of a capture, and takes as long as the map itself.
_remembered = lru_cache(maxsize=4)


@_remembered
def _os_law(
    shape: tuple[int, int],
    guard: int,
    train: int,
    quantile: float,
    pfa: float,
    looks: int,
    scale: float | None,
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Multiplier and rank of each cell (range, velocity)."""
    counts = _training_counts(*shape, guard, guard + train)
    scales = _by_count(
        counts, lambda n: os_scale(n, quantile, pfa, looks) if scale is None else scale
    )
    return scales, _by_count(counts, lambda n: order_rank(n, quantile)).astype(np.int32)


@_remembered
def _ca_law(
    shape: tuple[int, int], guard: int, train: int, pfa: float, looks: int, scale: float | None
) -> NDArray[np.float64]:
    """Multiplier of each cell (range, velocity)."""
    return _by_count(
        _training_counts(*shape, guard, guard + train),
        lambda n: ca_scale(n, pfa, looks) if scale is None else scale,
    )


def _checked(
    power: ArrayLike, guard: int, train: int, pfa: float, looks: int, scale: float | None
) -> tuple[NDArray[np.floating], NDArray[np.int32]]:
    """The map as C-contiguous float32 or float64, and the number of training cells of each cell."""
    cells = np.asarray(power)
    if cells.ndim != 2 or cells.dtype.kind not in "fiu":
        raise InputError(
            f"CFAR: power has shape {cells.shape}, type {cells.dtype}; it must be a real (range, velocity) map"
        )
    for name, value, least in (("guard", guard, 0), ("train", train, 1)):
        if isinstance(value, bool) or value != int(value) or value < least:
            raise InputError(
                f"CFAR: {name} = {value!r}; it must be a whole number of cells, at least {least}"
            )
    check_pfa(pfa)
    check_looks(looks)
    if scale is not None and not 0 < scale < np.inf:
        raise InputError(f"CFAR: scale = {scale!r}; a multiplier must be positive and finite")
    cells = np.ascontiguousarray(
        cells, dtype=np.float32 if cells.dtype == np.float32 else np.float64
    )
    if not (cells >= 0).all() or not np.isfinite(cells).all():
        raise InputError(
            "CFAR: power holds NaN, infinity or a negative value; give linear power, not decibels"
        )
    counts = _training_counts(cells.shape[0], cells.shape[1], guard, guard + train)
    if counts.size and counts.min() == 0:
        raise InputError(
            f"CFAR: in a map of {cells.shape[0]} x {cells.shape[1]} a cell has no training cells with guard = {guard}; "
            f"each axis, or one of them, needs more than {2 * guard + 1} cells"
        )
    return cells, counts


@_remembered
def _training_counts(n_range: int, n_velocity: int, guard: int, reach: int) -> NDArray[np.int32]:
    def overlap(n: int, half: int) -> NDArray[np.int32]:
        i = np.arange(n)
        return (np.minimum(i + half, n - 1) - np.maximum(i - half, 0) + 1).astype(np.int32)

    outer = overlap(n_range, reach)[:, None] * overlap(n_velocity, reach)
    return outer - overlap(n_range, guard)[:, None] * overlap(n_velocity, guard)


def _by_count(counts: NDArray[np.int32], of_count: Callable[[int], float]) -> NDArray[np.float64]:
    """A function of the number of training cells, worked out once for each number that occurs, (range, velocity)."""
    table = np.zeros(int(counts.max(initial=0)) + 1)
    for n in np.unique(counts):
        table[n] = of_count(int(n))
    return table[counts]


def _by_rows(
    kernel: Callable[..., None], cells: NDArray[np.floating], *given: object
) -> NDArray[np.bool_]:
    """Mask of a map, some rows to a thread."""
    mask = np.empty(cells.shape, dtype=np.bool_)
    in_threads(
        lambda first: kernel(first, min(first + _ROWS_A_THREAD, len(cells)), cells, *given, mask),
        range(0, len(cells), _ROWS_A_THREAD),
    )
    return mask


@compiled()
def _os_kernel(begin, end, cells, thresholds, ranks, counts, guard, reach, mask):
    """Mask of the rows from begin to end: at least ``rank`` training cells lie below the threshold, the cell over its multiplier.

    Counting needs no sorting, and stops after the first rows that settle the question: for most cells, which hold noise, as
    few as could, and those are counted for all cells of a row side by side.
    """
    n_range, n_velocity = cells.shape
    inside = max(n_velocity - 2 * reach, 0)  # cells with all their neighbours in the row
    below_first = np.empty(inside, dtype=np.int32)
    for i in range(begin, end):
        top, bottom = max(i - reach, 0), min(i + reach, n_range - 1)
        seen_first = 0
        below_first[:] = 0
        limits = thresholds[i, reach : reach + inside]
        for a in range(top, bottom + 1):
            if i - guard <= a <= i + guard or inside == 0:
                continue
            if seen_first > counts[i, reach] - ranks[i, reach]:
                break
            for shift in range(2 * reach + 1):
                neighbours = cells[a, shift : shift + inside]
                for j in range(inside):
                    below_first[j] += neighbours[j] < limits[j]
            seen_first += 2 * reach + 1
        for j in range(n_velocity):
            if (
                reach <= j < reach + inside
                and seen_first - below_first[j - reach] > counts[i, j] - ranks[i, j]
            ):
                mask[i, j] = False
                continue
            left, right = max(j - reach, 0), min(j + reach, n_velocity - 1)
            inner_left, inner_right = max(j - guard, 0), min(j + guard, n_velocity - 1)
            threshold = thresholds[i, j]
            missing = ranks[i, j]  # cells below the threshold that are still wanted
            spare = counts[i, j] - missing  # cells that may lie at or above it
            for a in range(top, bottom + 1):
                below = 0
                seen = right - left + 1
                if a < i - guard or a > i + guard:
                    for b in range(left, right + 1):
                        below += cells[a, b] < threshold
                else:
                    for b in range(left, inner_left):
                        below += cells[a, b] < threshold
                    for b in range(inner_right + 1, right + 1):
                        below += cells[a, b] < threshold
                    seen -= inner_right - inner_left + 1
                missing -= below
                spare -= seen - below
                if missing <= 0 or spare < 0:
                    break
            mask[i, j] = missing <= 0


@compiled()
def _ca_kernel(begin, end, cells, sums_wanted, guard, reach, mask):
    """Mask of the rows from begin to end: the training cells sum to less than the cell times their number over the multiplier.

    Summed afresh for each cell: running sums would drown the weak cells beside a strong one in its rounding.
    """
    n_range, n_velocity = cells.shape
    for i in range(begin, end):
        top, bottom = max(i - reach, 0), min(i + reach, n_range - 1)
        for j in range(n_velocity):
            left, right = max(j - reach, 0), min(j + reach, n_velocity - 1)
            inner_left, inner_right = max(j - guard, 0), min(j + guard, n_velocity - 1)
            total = 0.0
            for a in range(top, bottom + 1):
                if a < i - guard or a > i + guard:
                    for b in range(left, right + 1):
                        total += cells[a, b]
                else:
                    for b in range(left, inner_left):
                        total += cells[a, b]
                    for b in range(inner_right + 1, right + 1):
                        total += cells[a, b]
            mask[i, j] = total < sums_wanted[i, j]
