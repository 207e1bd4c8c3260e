"""Which way to model each part at each instant, so that the whole stays within a tolerance and costs little."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.scatter.echo_models import MODELS
from rtradar.scatter.models.auto_errors import (
    ANALYTIC,
    FRESNEL,
    LEFT_OUT,
    PHYSICAL_OPTICS,
    WAYS,
    Forecast,
)

_COST = np.array([0.0, *(MODELS[name].relative_cost for name in WAYS[1:])])  # type: ignore[attr-defined]
"""Rough cost of a part: it says which change to try first, where several would do."""


_SYSTEMATIC, _INTERFERING = 0.5, 0.6
"""Of a tolerance on power: what the sum of all powers may be off by, and the field, whose parts interfere.

A frame holds some ten independent looks at how echoes interfere, and a field that is off by a share e leaves its power
off by up to 1.3 e in the worst frame of a hundred (``validation/cost/auto.py``). What curvature adds turns faster and averages out.
"""


def choose(told: Forecast, power_share: float, complex_share: float | None) -> NDArray[np.int64]:
    """Way of each part at each instant (time, part), as numbers into `rtradar.scatter.models.auto_errors.WAYS`.

    Parameters
    ----------
    told : Forecast
    power_share : float
        Largest error of the power of all parts together, over that power.
    complex_share : float, optional
        Largest rms complex error of all parts together over the root of their power; None: not asked for.

    Notes
    -----
    All parts begin with the cheapest; as long as the whole misses the tolerance, the one change that mends the most for
    its cost is made. What a part needs at an instant it is given at the ones before and after, too.
    """
    chosen = np.where(told.hidden, LEFT_OUT, ANALYTIC)
    whole = told.true.sum(axis=1)
    excess = told.power - told.true[:, None]

    def refine() -> None:
        # What mends one tolerance may break another: until nothing changes, and choices only rise.
        before = np.full_like(chosen, -1)
        while not np.array_equal(chosen, before):
            before[:] = chosen
            if complex_share is not None:
                _raise(chosen, told.wrong + told.optics, complex_share**2 * whole)
            _raise(chosen, told.wrong, (_INTERFERING * power_share) ** 2 * whole)
            _raise(chosen, excess, _SYSTEMATIC * power_share * whole)
            # Facets, once meshed and traced for one part, serve all.
            by_facets = np.flatnonzero((chosen >= PHYSICAL_OPTICS).any(axis=1))
            chosen[by_facets] = np.where(
                chosen[by_facets] == FRESNEL, PHYSICAL_OPTICS, chosen[by_facets]
            )

    refine()
    padded = np.pad(chosen, ((1, 1), (0, 0)), mode="edge")
    chosen = np.maximum(np.maximum(padded[:-2], padded[2:]), chosen)
    refine()
    return chosen


def _raise(
    chosen: NDArray[np.int64], error: NDArray[np.float64], allowed: NDArray[np.float64]
) -> None:
    """Raise choices until the sum of the errors (time, way, part) is within what is allowed (time,); in place."""
    parts = error.shape[2]
    while True:
        current = np.take_along_axis(error, chosen[:, None], axis=1)
        total = current.sum(axis=(1, 2))
        missed = np.flatnonzero(np.abs(total) > allowed)
        if not len(missed):
            return
        after = total[missed, None, None] - current[missed] + error[missed]
        gain = np.abs(total[missed])[:, None, None] - np.abs(after)
        dearer = _COST[:, None] - _COST[chosen[missed]][:, None]
        # More than is allowed need not be mended.
        gain = np.minimum(gain, (np.abs(total[missed]) - allowed[missed])[:, None, None])
        worth = np.where(
            (dearer > 0) & (gain > 0), gain / np.maximum(dearer, 1e-9), -np.inf
        ).reshape(len(missed), -1)
        best = worth.argmax(axis=1)
        possible = worth[np.arange(len(missed)), best] > -np.inf
        if not possible.any():
            return
        way, part = np.divmod(best[possible], parts)
        chosen[missed[possible], part] = way
