"""CFAR detectors on a range-Doppler power map: order statistic and cell averaging; their registry.

The training cells of a cell are the square ring of half-width ``guard + train`` without the square
of half-width ``guard`` around it. At the edges of the map only those that exist count, with the
rank and the multiplier of their number.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.kernels.cfar import ca_cfar_rows, os_cfar_rows
from rtradar.process.cfar_thresholds import (
    ca_scale,
    check_count,
    check_pfa,
    check_quantile,
    check_scale,
    checked_power,
    order_rank,
    os_scale,
)
from rtradar.system.registry import Registry
from rtradar.system.threads import thread_map

_ROWS_A_THREAD = 64

Detector = Callable[[NDArray[np.floating]], NDArray[np.bool_]]
"""Power (range, velocity) in, mask of the same shape out."""

DETECTORS = Registry(
    "rtradar.detectors",
    "detector",
    {"os-cfar": "rtradar.process.cfar:os_cfar", "ca-cfar": "rtradar.process.cfar:ca_cfar"},
)
"""Functions of power (range, velocity), ``pfa`` and ``looks``, the channels summed in the power."""

register_detector = DETECTORS.register


def build_detector(name: str, *, pfa: float, looks: int) -> Detector:
    """Detector of a name, for a false-alarm rate and a number of looks.

    Parameters
    ----------
    name : str
        Name in `DETECTORS`.
    pfa : float
        Asked false-alarm rate of each cell.
    looks : int
        Channels summed in the power.

    Returns
    -------
    callable
        From power (range, velocity) to a bool mask of the same shape.

    Raises
    ------
    InputError
        Where there is no such detector.
    ExtensionError
        Where it comes from another package, and fails; also when it is called.
    """
    find = DETECTORS.find(name)

    def detect(power: NDArray[np.floating]) -> NDArray[np.bool_]:
        with DETECTORS.guarded(name):
            mask = np.asarray(find(power, pfa=pfa, looks=looks))
        if mask.dtype != np.bool_ or mask.shape != power.shape:
            raise DETECTORS.refuse(
                name, f"gave {mask.dtype} of shape {mask.shape}, not bool of shape {power.shape}"
            )
        return mask

    return detect


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
    """
    cells, counts = _checked(power, guard, train, pfa, looks, scale)
    check_quantile(quantile)
    scales, ranks = _os_law(cells.shape, guard, train, quantile, pfa, looks, scale)
    thresholds = cells / scales.astype(cells.dtype)
    return _by_rows(os_cfar_rows, cells, thresholds, ranks, counts, guard, guard + train)


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
    cells, counts = _checked(power, guard, train, pfa, looks, scale)
    scales = _ca_law(cells.shape, guard, train, pfa, looks, scale)
    sums_wanted = cells * (counts / scales).astype(cells.dtype)
    return _by_rows(ca_cfar_rows, cells, sums_wanted, guard, guard + train)


# What depends on the shape alone is the same for all maps of a capture, and as slow as a map.
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
    ranks = _by_count(counts, lambda n: order_rank(n, quantile)).astype(np.int32)
    if scale is not None:
        return np.full(shape, scale), ranks
    return _by_count(counts, lambda n: os_scale(n, quantile, pfa, looks)), ranks


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
    cells = checked_power("CFAR", power)
    check_count("guard", guard, least=0)
    check_count("train", train)
    check_count("looks", looks)
    check_pfa(pfa)
    check_scale("CFAR", scale)
    counts = _training_counts(cells.shape[0], cells.shape[1], guard, guard + train)
    if counts.size and counts.min() == 0:
        raise InputError(
            f"CFAR: in a map of {cells.shape[0]} x {cells.shape[1]} a cell has no training cells "
            f"with guard = {guard}; each axis, or one of them, needs more than {2 * guard + 1} "
            "cells"
        )
    return cells, counts


@_remembered
def _training_counts(n_range: int, n_velocity: int, guard: int, outer: int) -> NDArray[np.int32]:
    def overlap(n: int, half: int) -> NDArray[np.int32]:
        i = np.arange(n)
        return (np.minimum(i + half, n - 1) - np.maximum(i - half, 0) + 1).astype(np.int32)

    all_of_it, inner = (
        overlap(n_range, half)[:, None] * overlap(n_velocity, half) for half in (outer, guard)
    )
    return all_of_it - inner


def _by_count(counts: NDArray[np.int32], of_count: Callable[[int], float]) -> NDArray[np.float64]:
    """A function of the number of training cells (range, velocity), once for each that occurs."""
    table = np.zeros(int(counts.max(initial=0)) + 1)
    for n in np.unique(counts):
        table[n] = of_count(int(n))
    return table[counts]


def _by_rows(
    kernel: Callable[..., None], cells: NDArray[np.floating], *given: object
) -> NDArray[np.bool_]:
    """Mask of a map, some rows to a thread."""
    mask = np.empty(cells.shape, dtype=np.bool_)
    thread_map(
        lambda first: kernel(first, min(first + _ROWS_A_THREAD, len(cells)), cells, *given, mask),
        range(0, len(cells), _ROWS_A_THREAD),
    )
    return mask
