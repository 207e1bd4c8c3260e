"""Ghosts between anchors: their error beside the sum of all of them, chirp by chirp."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rtradar as rt
from rtradar.errors import InputError

RADAR = replace(rt.Radar.preset("paper-12ghz"), tx_y=2, tx_z=0, rx_y=2, rx_z=0)
ROOM = rt.Scene.load("living-room")
SMOOTH = [replace(wall, roughness_m=0.0) for wall in ROOM.walls]
WALLS = replace(ROOM, furniture=(), walls=tuple(SMOOTH[:2]))
WALK = rt.synthetic_motion("walk", seed=0, duration_s=0.2)


def simulated(radar: rt.Radar = RADAR, scene: rt.Scene = WALLS, **options: Any) -> rt.IfSamples:
    return rt.simulate(WALK, radar, scene, snr_db=math.inf, **options)


def power(samples: NDArray[np.complexfloating]) -> float:
    return float((np.abs(samples) ** 2).mean())


BEHIND = pytest.mark.filterwarnings("ignore:.*clutter power is from behind the antennas")


@BEHIND
@pytest.mark.parametrize(
    "multiplexing",
    ["tdm", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("fdm", "ddm"))],
)
def test_error_is_below_the_tolerance(multiplexing: Any) -> None:
    radar = replace(RADAR, multiplexing=multiplexing)
    exact, free = simulated(radar, path_tolerance_db=None), simulated(radar, rt.Scene())
    for tolerance_db in (-35.0, -50.0):
        found = simulated(radar, path_tolerance_db=tolerance_db)
        error = power(found.samples - exact.samples) / power(free.samples)
        assert 0 < error < 10 ** (tolerance_db / 10)


@BEHIND
def test_exact_ghosts_are_asked_for_by_none_or_minus_infinity() -> None:
    none, infinite = (simulated(path_tolerance_db=db) for db in (None, -math.inf))
    assert np.array_equal(none.samples, infinite.samples)


@pytest.mark.parametrize("tolerance_db", [1.0, math.inf, math.nan, -500.0])
def test_other_tolerances_are_refused(tolerance_db: float) -> None:
    with pytest.raises(InputError, match="--path-tolerance-db"):
        rt.RunSettings(path_tolerance_db=tolerance_db)
