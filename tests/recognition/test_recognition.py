"""Recognition of a run: the forest in NumPy, windows of clouds, and what is warned of."""

from __future__ import annotations

import dataclasses
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from sklearn.ensemble import ExtraTreesClassifier

from rtradar.campaign.recogniser import arrays_of, best_temperature
from rtradar.classify.outcomes import Answers, calibration_error
from rtradar.cli import main
from rtradar.clouds.files import save_cloud_npz
from rtradar.errors import InputError
from rtradar.motion import ACTIVITIES
from rtradar.radar import Radar
from rtradar.recognition import UNKNOWN, Recogniser, predict
from rtradar.recognition.recogniser import (
    EDGE_S,
    OUTLINE,
    WINDOW_S,
    cut_windows,
    describe,
    envelopes,
    occupancy,
    outline,
    with_temperature,
)


def cloud(n_points: int, length_s: float = 3.0) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Points of somebody whose parts swing at 1 Hz."""
    random = np.random.default_rng(0)
    time, size = random.uniform(0, length_s, n_points), random.uniform(0, 0.3, n_points)
    phase = 2 * np.pi * time
    place, velocity = 4 + size * np.sin(phase), 2 * np.pi * size * np.cos(phase)
    return np.stack([time, place, velocity], axis=1)


def run_folder(folder: Path, radar: Radar, **parameters: Any) -> Path:
    """Write what a run leaves of a cloud of 3 s."""
    usual = {"scene": "free-space", "snr_db": 20.0, "radar": dataclasses.asdict(radar)}
    content = {"parameters": usual | parameters, "capture_s": 3.0, "people": [{}]}
    (folder / "summary.json").write_text(json.dumps(content))
    save_cloud_npz(folder / "cloud_rdt.npz", cloud(3000))
    return folder


def test_the_forest_in_numpy_answers_as_scikit_learn_does(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    described = random.normal(size=(80, 5)).astype(np.float32)
    forest = ExtraTreesClassifier(20, random_state=0).fit(described, random.integers(3, size=80))
    usual = {"mean": np.zeros(5), "inverse_covariance": np.eye(5), "most": 1.0}
    card = {"classes": ["a", "b", "c"], "temperature": 1.0, "usual": usual}
    Recogniser(arrays_of(forest), card).save(tmp_path / "weights.npz")
    recogniser = Recogniser.load(tmp_path / "weights.npz")
    assert recogniser.classes == ("a", "b", "c")
    asked = random.normal(size=(50, 5)).astype(np.float32)
    found = np.array([recogniser.of_description(one) for one in asked])
    assert found == pytest.approx(forest.predict_proba(asked), abs=1e-3)  # half precision


@given(st.floats(0.05, 60.0), st.integers(0, 400))
def test_windows_are_alike_and_leave_only_the_edges_out(length_s: float, n_points: int) -> None:
    points = cloud(n_points, length_s)
    windows = cut_windows(points, length_s)
    for window in windows:
        assert np.ptp(window[:, 0]) < WINDOW_S if len(window) else True
    inside = (points[:, 0] >= EDGE_S + 1e-9) & (points[:, 0] < length_s - EDGE_S - 1e-9)
    kept = {tuple(point) for window in windows for point in window.tolist()}
    assert {tuple(point) for point in points[inside].tolist()} <= kept


def test_what_a_run_shows_is_one_of_the_actors_activities(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run_folder(tmp_path, Radar.preset("paper-12ghz"))
    answer = tmp_path / "answer.json"
    assert main(["predict", str(tmp_path), "--json", str(answer)]) == 0
    found = json.loads(answer.read_text())
    assert set(found) == {"activity", "probabilities", "windows", "warnings", "made_from"}
    assert [set(one) for one in found["windows"]] == [{"start_s", "probabilities", "activity"}] * 5
    means = np.mean([[*one["probabilities"].values()] for one in found["windows"]], axis=0)
    assert [*found["probabilities"].values()] == pytest.approx(means)
    files = [Path(entry["path"]).name for entry in found["made_from"]["files"]]
    assert files == ["cloud_rdt.npz", "weights.npz"]
    assert set(found["probabilities"]) <= {*ACTIVITIES, UNKNOWN}
    assert sum(found["probabilities"].values()) == pytest.approx(1)
    assert found["probabilities"][found["activity"]] == max(found["probabilities"].values())
    assert capsys.readouterr().out.startswith(found["activity"])
    assert not any("radar" in warning for warning in found["warnings"])


@pytest.mark.parametrize(
    ("radar", "parameters", "warning"),
    [
        ("iwr1443", {}, "radar 'iwr1443' is not like .* range resolution"),
        ("paper-12ghz", {"scene": "living-room"}, "scene 'living-room': .* free space"),
        ("paper-12ghz", {"snr_db": -10.0}, "SNR -10 dB"),
        ("paper-12ghz", {"scene": None}, "measured samples"),
    ],
)
def test_what_was_not_learnt_is_warned_of(
    tmp_path: Path, radar: str, parameters: dict[str, Any], warning: str
) -> None:
    answer = predict(run_folder(tmp_path, Radar.preset(radar), **parameters))
    assert any(re.search(warning, one) for one in answer["warnings"])


def test_unusual_motion_and_few_points_are_warned_of(tmp_path: Path) -> None:
    run_folder(tmp_path, Radar.preset("paper-12ghz"))
    fast = cloud(60) * [1.0, 1.0, 3.0]
    save_cloud_npz(tmp_path / "cloud_rdt.npz", fast)
    warnings = " ".join(predict(tmp_path)["warnings"])
    assert "unlike any that was learnt from" in warnings
    assert "windows have 2" in warnings  # of 60 points 1.4 s of 3 s hold 28, half of the least


def test_something_else_than_the_activities_is_unknown(tmp_path: Path) -> None:
    run_folder(tmp_path, Radar.preset("paper-12ghz"))
    stands = np.random.default_rng(0).normal([0, 4, 0], [0, 0.1, 0.08], size=(3000, 3))
    stands[:, 0] = np.linspace(0, 3, 3000)
    save_cloud_npz(tmp_path / "cloud_rdt.npz", stands)
    assert predict(tmp_path)["activity"] == UNKNOWN


@pytest.mark.parametrize("name", ["summary.json", "cloud_rdt.npz"])
@pytest.mark.parametrize("damage", [None, b"", b"{}", b"[1]"])
def test_damaged_runs_are_one_line(tmp_path: Path, name: str, damage: bytes | None) -> None:
    run_folder(tmp_path, Radar.preset("paper-12ghz"))
    (tmp_path / name).unlink()
    if damage is not None:
        (tmp_path / name).write_bytes(damage)
    with pytest.raises(InputError, match=r"holds no run|is damaged"):
        predict(tmp_path)


def test_no_extra_is_needed() -> None:
    asked = "import sys, rtradar.recognition; sys.exit(bool({'torch', 'sklearn'} & {*sys.modules}))"
    assert subprocess.run([sys.executable, "-c", asked], check=False).returncode == 0


def test_a_temperature_mends_what_is_too_sure_of_itself() -> None:
    random = np.random.default_rng(0)
    honest = random.uniform(0.05, 0.95, 4000)
    truth = (random.random(4000) > honest).astype(int)
    names = np.arange(4000).astype(str)
    both = np.stack([honest, 1 - honest], axis=1)
    sure = with_temperature(both, 0.5)
    assert calibration_error(Answers(sure, truth, names, names)) > 0.1
    assert best_temperature(sure, truth) == pytest.approx(2, rel=0.1)
    mended = with_temperature(sure, 2.0)
    assert mended == pytest.approx(both)
    assert calibration_error(Answers(mended, truth, names, names)) < 0.03  # 4000 answers


def window(n_points: int, seed: int = 0) -> NDArray[np.float64]:
    """Points of somebody who swings, in 1.4 s."""
    random = np.random.default_rng(seed)
    time = random.uniform(0, 1.4, n_points)
    velocity = 2 * np.sin(5 * time) + random.normal(0, 0.5, n_points)
    return np.stack([time, 4 + 0.2 * np.cos(5 * time), velocity], axis=1)


def test_a_description_has_three_parts() -> None:
    points = window(500)
    found = describe(points)
    assert len(outline(points)) == OUTLINE
    assert found == pytest.approx([*outline(points), *envelopes(points), *occupancy(points)])


@given(st.floats(-10, 10), st.floats(-3, 3), st.integers(0, 9))
def test_when_and_where_do_not_matter(later_s: float, farther_m: float, seed: int) -> None:
    points = window(300, seed)
    moved = points + np.array([later_s, farther_m, 0.0])
    order = np.random.default_rng(seed).permutation(len(points))
    assert describe(moved[order]) == pytest.approx(describe(points), abs=1e-8)  # rounding


def test_cells_hold_all_points() -> None:
    assert np.sum(occupancy(window(400)) ** 2) == pytest.approx(1)


def test_a_shift_of_the_swing_leaves_the_statistics_of_envelopes() -> None:
    time = np.repeat(np.arange(140) / 100 + 0.005, 10)
    speeds = [np.sin(2 * np.pi * (time / 0.7 - late)) for late in (0.0, 1 / 7)]
    first, second = (np.stack([time, np.full(1400, 4.0), speed], axis=1) for speed in speeds)
    # Means, deviations, extremes and quartiles: the same slices in another order.
    assert envelopes(second)[:66] == pytest.approx(envelopes(first)[:66], abs=1e-9)


@pytest.mark.parametrize("n_points", [1, 2, 24])
def test_few_or_equal_points_are_described(n_points: int) -> None:
    for points in (window(n_points), np.tile([[0.5, 4.0, 1.0]], (n_points, 1))):
        assert np.isfinite(describe(points)).all()
