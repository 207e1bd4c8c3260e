"""Ghosts and clutter of a room in the summary of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.pipeline.output.summary import at_rest


def test_power_at_rest_is_that_within_two_bins() -> None:
    velocity = np.arange(-4, 5) * 0.5
    power = np.ones((3, 9)) * 10.0 ** np.abs(np.arange(-4, 5))
    assert at_rest(power, velocity) == pytest.approx(3 * (1 + 2 * 10 + 2 * 100))


def test_the_summary_tells_ghosts_and_what_removal_gained(
    beside_a_wall: tuple[rt.Radar, rt.Scene], tmp_path: Path
) -> None:
    radar, room = beside_a_wall
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.3)
    options = {"fidelity": "analytic", "clutter_removal": "mean"}
    found = rt.run(motion, radar, room, out=tmp_path / "run", **options).summary["room"]
    ghosts = found["ghosts"]
    assert 0 < ghosts["time_s"] < 0.3
    assert {ghost["path"] for ghost in ghosts["paths"]} <= {p["path"] for p in found["paths"]}
    direct_m = 4.0
    assert all(ghost["range_m"] > direct_m - 0.5 for ghost in ghosts["paths"])
    clutter = found["clutter"]
    # The mean over the frame takes out all that stands still, to float32, but not the person.
    assert clutter["after_removal_db"] > clutter["signal_to_clutter_db"] + 3
    # The same without a folder.
    assert rt.run(motion, radar, room, **options).summary["room"]["ghosts"] == ghosts
