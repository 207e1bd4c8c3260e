"""What a forest is told of windows of points: the person's, and not the room's."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

FRAMES = 60


@pytest.fixture(scope="module")
def windows(script: Callable[[str], ModuleType]) -> ModuleType:
    return script("measurements/radhar_windows.py")


def person(windows: ModuleType, seed: int = 0, **changes: Any) -> Any:
    """Points of somebody at 2 m: two that move in each frame, and now and then a still one."""
    random = np.random.default_rng(seed)
    frame = np.repeat(np.arange(FRAMES), 3)
    doppler = np.tile([1, -2, 0], FRAMES)
    kept = (doppler != 0) | (random.random(3 * FRAMES) < 0.3)
    places = np.array([2.0, 0.0, 0.0]) + random.normal(0, 0.1, (3 * FRAMES, 3))
    cell = np.rint(np.linalg.norm(places, axis=1) / 0.0436).astype(int)
    cloud = windows.Cloud(places, doppler, cell, frame, FRAMES).some(kept)
    return cloud._replace(**changes)


def together(windows: ModuleType, *clouds: Any) -> Any:
    columns = zip(*(cloud[:4] for cloud in clouds), strict=True)
    return windows.Cloud(*(np.concatenate(column) for column in columns), FRAMES)


def test_what_always_stands_still_is_the_room_and_changes_nothing(windows: ModuleType) -> None:
    count = 2 * FRAMES
    places = np.tile([[2.3, 0.2, 0.1], [4.0, -1.0, 0.3]], (FRAMES, 1))
    cells = np.tile([90, 97], FRAMES)  # where the person has no point
    frames = np.repeat(np.arange(FRAMES), 2)
    room = windows.Cloud(places, np.zeros(count, dtype=int), cells, frames, FRAMES)
    alone = person(windows)
    both = together(windows, alone, room)
    np.testing.assert_allclose(windows.described(both), windows.described(alone), atol=1e-12)


def test_without_points_all_figures_are_finite(windows: ModuleType) -> None:
    whole = windows.described(person(windows))
    empty = windows.described(person(windows).some(np.zeros(len(person(windows).cell), dtype=bool)))
    assert whole.shape == empty.shape
    assert np.isfinite(empty).all()
    assert np.isfinite(whole).all()


def test_where_somebody_stands_sideways_does_not_matter(windows: ModuleType) -> None:
    here = person(windows)
    # Turned about the radar: the distances stay.
    turn = np.array([[0.96, -0.28, 0.0], [0.28, 0.96, 0.0], [0.0, 0.0, 1.0]])
    there = here._replace(places=here.places @ turn.T)
    spread = windows.described(here) - windows.described(there)
    # Only spreads and correlations along the turned axes may change.
    assert np.count_nonzero(np.abs(spread) > 1e-9) <= 26


def test_moving_points_alone_are_thinned(windows: ModuleType) -> None:
    whole = person(windows)
    thin = whole.thinned(0.25, np.random.default_rng(0))
    assert (thin.doppler == 0).sum() == (whole.doppler == 0).sum()
    assert (thin.doppler != 0).sum() == pytest.approx(0.25 * 2 * FRAMES, abs=15)
    later = whole.window(20, 30)
    assert later.frames == 30
    assert set(later.frame.tolist()) == set(range(30))
