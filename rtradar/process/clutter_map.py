"""Clutter-map CFAR: each cell of a range-Doppler map against its own past, not its neighbours.

The map of a cell is the mean of its power in past frames, whose weights fall with their age by the
time constant; until there are enough, all have the same weight. Whatever stays in its cell becomes
part of the map and is no longer detected: the room, but also a person who does not move.

The law. In noise the map of one channel is the sum of w_j |z_j|^2 over past frames j, the z_j
complex Gaussian with the correlation C of frames that share chirps. That is :eq:`clutter-map`, with
l_j the eigenvalues of sqrt(w_i) C_ij sqrt(w_j). For L channels ("looks"): a Gamma variable of shape
L is the wait for L Poisson events, so the rate is the probability of fewer than L events while
alpha times the map passes. Those are a sum of negative binomial numbers of success probabilities
r_j = alpha l_j / (1 + alpha l_j), and the probabilities c_k of k events follow from the power sums
of r_j, k c_k = L (p_1 c_(k-1) + ... + p_k c_0), p_m = sum r_j^m, without cancellation.

Frames that share chirps with the one under test (three of the paper's radars) wait outside the map
until they no longer do; otherwise an echo would hide itself. Frames in the map that share chirps
with each other count for fewer than they are, 40 of the paper's for 21, which C contains. If they
were taken for independent, the rate asked at 1e-3 would rise to 2.2 times with one look and 1.4
times with 96 while the map is young, to 1.25 and 1.1 times later
(validation/closed_forms/clutter.py).
"""

from __future__ import annotations

import math
from collections import deque
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eig_banded

from rtradar.errors import InputError
from rtradar.process.cfar import (
    check_count,
    check_pfa,
    check_scale,
    checked_power,
    multiplier,
)
from rtradar.process.clutter import check_time_constant
from rtradar.process.window_functions import DEFAULT_WINDOWS, WindowFunctions, weights
from rtradar.radar import Radar

_FORGOTTEN = 1e-4
"""Weight of all frames that are left out of the law because of their age."""

_MOST_WINDOWS = 4000
"""Most frames of the law; with more the rate is up to 5 % lower than asked at 1e-6, less above."""


class ClutterMap:
    """Clutter-map CFAR on the maps of a stream of frames, in constant memory.

    Parameters
    ----------
    radar : Radar
        Radar that gives the frames and what they share.
    time_constant_s : float
        Time constant of the exponential average [s].
    pfa : float
        False-alarm rate in white noise, in (0, 1). It holds from the first frame that is tested.
        Where a cell holds a steady echo as well, its power scatters less and alarms are fewer.
    looks : int
        Channels summed in each cell.
    scale : float, optional
        The multiplier itself, instead of those solved for ``pfa``.
    window_functions : WindowFunctions
        Window functions of the maps; that in slow time tells how frames that share chirps are
        correlated.

    Raises
    ------
    InputError
        Where an argument is out of its range.
    """

    def __init__(
        self,
        radar: Radar,
        *,
        time_constant_s: float = 1.0,
        pfa: float = 1e-6,
        looks: int = 1,
        scale: float | None = None,
        window_functions: WindowFunctions = DEFAULT_WINDOWS,
    ) -> None:
        check_pfa(pfa)
        check_count("looks", looks)
        check_scale("clutter map", scale)
        self._law, self._given = (radar, float(pfa), int(looks), window_functions), scale
        hops = check_time_constant(time_constant_s) / (
            radar.frame_period_s or radar.hop_cycles * radar.cycle_duration_s
        )
        self._weight = -math.expm1(-1 / hops)
        self._memory = math.ceil(min(-math.log(_FORGOTTEN) * hops, _MOST_WINDOWS))  # of the law
        self._apart = _windows_apart(radar)
        self._waiting: deque[NDArray[np.floating]] = deque()
        self._map: NDArray[np.float64] | None = None
        self._count = 0  # frames in the map
        self._solved_for, self._scale = 0, math.inf

    def push(self, power: ArrayLike) -> NDArray[np.bool_]:
        """Test the next frame against the map, and update the map.

        Parameters
        ----------
        power : (range, velocity) float
            Power, linear, in any unit, of the frame that follows the last call's.

        Returns
        -------
        (range, velocity) bool
            True where a cell exceeds the multiplier times its map. Nowhere in the first frames,
            which have no map: the first of all and those that share chirps with it.

        Raises
        ------
        InputError
            Where the map is not two-dimensional, of another shape than the last, or holds NaN,
            infinity or a negative value.
        """
        cells = checked_power("clutter map", power)
        if self._map is None:
            self._map = np.zeros(cells.shape)
        if cells.shape != self._map.shape:
            raise InputError(
                f"clutter map: power has shape {cells.shape}, the windows before it "
                f"{self._map.shape}; all must be alike"
            )
        found = np.zeros(cells.shape, dtype=np.bool_)
        if self._count:
            found = cells > self._multiplier() * self._map
        self._waiting.append(cells.copy())
        if len(self._waiting) == self._apart:
            # The oldest shares no chirp with the frame that comes next.
            self._count += 1
            self._map += max(self._weight, 1 / self._count) * (self._waiting.popleft() - self._map)
        return found

    def _multiplier(self) -> float:
        if self._given is not None:
            return self._given
        count = min(self._count, self._memory)
        # The more frames, the less one more matters: it is solved anew for each of the first 100,
        # then in growing steps. Meanwhile that of fewer frames is kept, whose rate is at most 5 %
        # too low at 1e-6, less above.
        if count >= self._solved_for + max(1.0, self._solved_for**2 / 5000):
            self._scale = _scale_after(count, self._weight, *self._law)
            self._solved_for = count
        return self._scale


def clutter_map_scale(weights: ArrayLike, pfa: float, looks: int = 1) -> float:
    """Multiplier of a detector whose level is a weighted sum of independent cells of noise.

    For one look this is :eq:`clutter-map`.

    Parameters
    ----------
    weights : (window,) float
        Weight of each cell, at least 0; n times 1/n is cell averaging, `ca_scale`.
    pfa : float
        Asked false-alarm rate, in (0, 1).
    looks : int
        Independent exponential powers summed in each cell, that under test as well.

    Returns
    -------
    float
        alpha such that a cell above alpha times the sum is a false alarm with probability ``pfa``.

    Raises
    ------
    InputError
        Where an argument is out of its range.
    """
    check_pfa(pfa)
    check_count("looks", looks)
    spread = np.asarray(weights)
    real = spread.ndim == 1 and spread.dtype.kind in "fiu"
    if not real or not (np.isfinite(spread) & (spread >= 0)).all():
        raise InputError(
            f"clutter map: weights have shape {spread.shape}; they must be finite numbers "
            "(window,), at least 0"
        )
    total = float(spread.sum())
    if total <= 0:
        raise InputError("clutter map: weights sum to 0; the level needs at least one cell")
    parts = spread[spread > 0] / total
    goal = math.log(pfa)

    def excess(log_alpha: float) -> float:
        return _log_rate(math.exp(log_alpha), parts, looks) - goal

    return multiplier(excess, xtol=1e-11, rtol=1e-13) / total


def _log_rate(alpha: float, spread: NDArray[np.float64], looks: int) -> float:
    """Logarithm of the false-alarm rate, by the law at the head of this module."""
    r = alpha * spread / (1 + alpha * spread)
    # The c_k are in units of c_0, or they would underflow.
    log_unit = -looks * float(np.log1p(alpha * spread).sum())
    c, p, powers = np.zeros(looks), np.zeros(looks), np.ones_like(r)
    c[0] = 1.0
    for k in range(1, looks):
        powers = powers * r
        p[k - 1] = powers.sum()
        c[k] = looks / k * (p[:k] @ c[:k][::-1])
        if c[k] > 1e200:
            c *= 1e-200
            log_unit += 200 * math.log(10)
    return log_unit + math.log(c.sum())


@lru_cache(maxsize=1024)
def _scale_after(
    count: int,
    weight: float,
    radar: Radar,
    pfa: float,
    looks: int,
    window_functions: WindowFunctions,
) -> float:
    """Multiplier of a map that holds this many frames; the captures of one radar share these."""
    steps = np.maximum(weight, 1 / np.arange(1.0, count + 1))
    # What the steps after it leave of each.
    later = np.append(np.cumprod((1 - steps)[:0:-1])[::-1], 1.0)
    root = np.sqrt(steps * later)
    band = np.zeros((min(_windows_apart(radar), count), count))
    band[0] = root**2
    if len(band) > 1:
        n = radar.cycles_per_frame
        starts = radar.window_starts((math.ceil(count * radar.hop_cycles) + n) * radar.n_tx)[:count]
        slow = weights(window_functions.doppler, n)
        shared = np.append(np.correlate(slow, slow, "full")[n - 1 :], 0.0)
        shared /= shared[0]
        for lag in range(1, len(band)):
            apart = np.minimum(starts[lag:] - starts[:-lag], n)
            band[lag, :-lag] = shared[apart] * root[lag:] * root[:-lag]
    spread = eig_banded(band, lower=True, eigvals_only=True)
    return clutter_map_scale(np.maximum(spread, 0.0), pfa, looks)  # zeros come out as rounding


def _windows_apart(radar: Radar) -> int:
    """Number of frames after which one shares no chirp with this one."""
    return math.ceil(radar.cycles_per_frame / radar.hop_cycles * (1 - 1e-12))
