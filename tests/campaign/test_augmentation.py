"""Copies of recordings: mirrored, faster, taller, drifting, and never beyond the recording."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from rtradar.campaign.intervals import Augmented, mirrored, vary
from rtradar.campaign.samples import make_sample, plan_samples
from rtradar.campaign.spec_file import read_spec
from rtradar.errors import InputError
from rtradar.motion import synthetic_motion
from rtradar.motion.skeleton import NODES

PLAIN = {"mirror": False, "tempo": 1.0, "height": 1.0, "build": 1.0} | {
    "drift_mps": 0.0,
    "drift_deg": 0.0,
}


def test_a_mirrored_person_moves_the_other_side_alike() -> None:
    kicker = synthetic_motion("kick", seed=1, duration_s=2.0)
    other = mirrored(kicker)
    times = np.linspace(0, 2, 50)
    here, there = kicker.at(times)[0], other.at(times)[0]
    for node in NODES:
        twin = {"l": "r", "r": "l"}.get(node[0], "") + node[1:] if node[1] == "_" else node
        place, opposite = (NODES.index(name) for name in (node, twin))
        assert there[:, opposite] == pytest.approx(here[:, place] * [1, -1, 1], abs=1e-9)
    assert mirrored(other).positions == pytest.approx(kicker.positions, abs=1e-12)


def test_tempo_height_build_and_drift_are_those_that_are_said() -> None:
    walker = synthetic_motion("walk", seed=1, duration_s=2.0)
    how = PLAIN | {"tempo": 1.25, "height": 1.1, "build": 0.9, "drift_mps": 0.4, "drift_deg": 90.0}
    other = vary(walker, how)
    assert other.duration_s == pytest.approx(1.6)
    assert other.girth == pytest.approx(walker.girth * 1.1 * 0.9)
    times = np.linspace(0, 1.6, 40)
    expected = 1.1 * walker.at(1.25 * times)[0] + 0.4 * times[:, None, None] * [0, 1, 0]
    # PCHIP of a sum is not the sum of both, to some micrometres.
    assert other.at(times)[0] == pytest.approx(expected, abs=2e-5)
    assert vary(walker, PLAIN).positions == pytest.approx(walker.positions)


def test_copies_never_reach_beyond_the_recording() -> None:
    augmented = Augmented(1)
    for seed in range(200):
        drawn = augmented.draw(seed, 0.4, 1.6, 2.05)
        assert drawn["start_s"] >= 0
        assert drawn["start_s"] + 1.6 * drawn["varied"]["tempo"] <= 2.05 + 1e-9
    assert len({augmented.draw(seed, 0.4, 1.6, 9.0)["start_s"] for seed in range(9)}) == 9


def test_a_data_set_has_the_copies_beside_the_recording(
    tmp_path: Path, small_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walker = synthetic_motion("walk", seed=2, duration_s=1.5)
    monkeypatch.setattr("rtradar.campaign.samples.load_motion", lambda path, skeleton: walker)
    (tmp_path / "walk.bvh").touch()
    shutil.copy(small_file, tmp_path)
    text = (
        "[windows]\nduration_s = 0.5\nstart_s = 0.5\n[augmented]\ncopies = 3\n[each]\n"
        'fidelity = ["analytic"]\nradar = ["small.toml"]\n'
        '[[recordings]]\nfile = "walk.bvh"\nlabel = "walk"\n'
    )
    (tmp_path / "set.toml").write_text(text)
    plans = plan_samples(read_spec(tmp_path / "set.toml"))
    assert len({plan.identity for plan in plans}) == 4
    assert sum("varied" in plan.parameters for plan in plans) == 3
    copy = next(plan for plan in plans if "varied" in plan.parameters)
    assert len(make_sample(copy.packed()).sample.points)
    (tmp_path / "set.toml").write_text(text.replace("copies = 3", "copies = 3\nmirror = true"))
    with pytest.raises(InputError, match=r"\[augmented\] .*mirror"):
        read_spec(tmp_path / "set.toml")
