"""A recogniser for a board: built of few actors, asked about others, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rtradar as rt
from rtradar.campaign.build import UnmadeSamplesError
from rtradar.campaign.recogniser import _OF_POINTS, RecogniserPlan, _leave_out, build_recogniser
from rtradar.cli import main
from rtradar.clouds.sample_files import read_index, write_index
from rtradar.errors import InputError
from rtradar.motion.formats import save_motion
from rtradar.recognition import NOBODY, UNKNOWN, Recogniser, predict

pytestmark = pytest.mark.usefixtures("here")

BOARD: Any = {"base": "radhar", "name": "board", "frame_period_s": 0.1}
CLASSES = {"walk": ["walk_in_place"], "boxing": ["boxing", "punch"]}


@pytest.fixture(scope="module")
def radar() -> rt.Radar:
    return rt.Radar.load(BOARD)


def built(radar: rt.Radar, out: Path, **options: Any) -> Recogniser:
    usual: dict[str, Any] = {"unknown": ["stand"], "scene": "free-space", "takes": 5}
    usual |= {"radar": radar, "activities": CLASSES, "window_s": 2.0}
    return build_recogniser(RecogniserPlan(**usual | options), out)


def test_a_recogniser_is_built_goes_on_and_names_a_run_and_a_file(
    radar: rt.Radar, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(_OF_POINTS, "n_estimators", 25)  # as good here as hundreds
    out, spec = tmp_path / "weights.npz", tmp_path / "set.toml"
    save_motion(tmp_path / "march.motion", rt.synthetic_motion("walk_in_place", duration_s=3.0))
    spec.write_text('[[recordings]]\nfile = "march.motion"\nlabel = "walk"\nsubject = "she"\n')
    made = built(radar, out, motions=spec)
    assert set(CLASSES) <= set(made.classes) <= {*CLASSES, UNKNOWN, NOBODY}
    assert made.card["samples"] == {"synthetic": 15, "recorded": 1}
    assert set(made.card["held_out"]) == set(made.classes)
    files = {path: path.stat().st_mtime_ns for path in (tmp_path / "weights").glob("*/*.npz")}
    assert len(files) == 16
    # A second build takes the samples that are there, and gives the same bytes.
    first = out.read_bytes()
    next(iter(files)).unlink()
    board, card = tmp_path / "board.toml", tmp_path / "card.json"
    board.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in BOARD.items()))
    words = ["recogniser", "build", "--radar", str(board), "--motions", str(spec), "--takes", "5"]
    words += ["--activities", "walk=walk_in_place,boxing=boxing+punch", "--unknown", "stand"]
    words += ["--scene", "free-space", "--window", "2", "--out", str(out), "--json", str(card)]
    assert main(words) == 0
    assert json.loads(card.read_text())["samples"] == {"synthetic": 15, "recorded": 1}
    kept = [path for path, stamp in files.items() if path.stat().st_mtime_ns == stamp]
    assert len(kept) == 15
    assert out.read_bytes() == first
    # A run of that radar, and its points as a file.
    result = rt.run(
        "synthetic:boxing",
        radar,
        fidelity="analytic",
        snr_db="physical",
        detector="ti-oob",
        duration_s=4.0,
        out=tmp_path / "run",
    )
    found = predict(tmp_path / "run", out)
    assert len(found["windows"]) == 3
    chances = [sum(one["probabilities"].values()) for one in found["windows"]]
    assert chances == pytest.approx([1.0, 1.0, 1.0])
    cloud = result.spatial
    places = (cloud.points - radar.position_m) @ radar.axes
    columns = np.column_stack([cloud.time, places, cloud.velocity])
    head = "time_s,x_m,y_m,z_m,velocity_mps"
    np.savetxt(tmp_path / "points.csv", columns, "%.9g", ",", header=head, comments="")
    answer = tmp_path / "answer.json"
    words = ["predict", str(tmp_path / "points.csv"), "--weights", str(out)]
    assert main([*words, "--json", str(answer)]) == 0
    asked = json.loads(answer.read_text())
    assert asked["reading"] == "x is ahead and y to the left"
    assert asked["activity"] == found["activity"]
    assert asked["probabilities"] == pytest.approx(found["probabilities"], abs=0.05)
    # Weights and what they are asked about must fit.
    with pytest.raises(InputError, match="these weights know RDT clouds"):
        predict(tmp_path / "points.csv")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"activities": {"walk": ["walk"]}}, "give at least two"),
        ({"activities": {"walk": ["walk"], "a": ["crawl"]}}, "'crawl' is no actor"),
        ({"activities": {"a": ["jump:low"], "b": ["walk"]}}, "styles of jump are high, hop"),
        ({"activities": {"a": ["walk"], "b": ["walk"]}}, "actor 'walk' is of two classes, a and b"),
        ({"activities": {"unknown": ["walk"], "b": ["sit"]}}, "class of every recogniser"),
        ({"takes": 2}, "at least 5 are needed"),
        ({"window_s": 0.1}, "1 to 60 s"),
        ({"out": Path("weights.txt")}, r"weights are a file \.npz"),
    ],
)
def test_what_cannot_be_learnt_is_refused_at_once(
    radar: rt.Radar, tmp_path: Path, options: dict[str, Any], words: str
) -> None:
    given = {"radar": radar, "activities": CLASSES, "out": tmp_path / "w.npz"} | options
    out = given.pop("out")
    with pytest.raises(InputError, match=words):
        build_recogniser(RecogniserPlan(**given), out)
    assert not list(tmp_path.iterdir())


def test_few_samples_that_cannot_be_made_are_left_out(tmp_path: Path) -> None:
    write_index(tmp_path, [f"s{number}" for number in range(20)])
    for number in range(19):
        (tmp_path / f"s{number}.npz").touch()
    error = UnmadeSamplesError("somebody stands in a wall")
    with pytest.warns(rt.ValidityWarning, match="in a wall: left out"):
        _leave_out(tmp_path, error)
    assert len(read_index(tmp_path)) == 19
    for number in range(10):
        (tmp_path / f"s{number}.npz").unlink()
    with pytest.raises(UnmadeSamplesError, match="in a wall"):
        _leave_out(tmp_path, error)


def test_recordings_must_be_of_the_classes(radar: rt.Radar, tmp_path: Path) -> None:
    save_motion(tmp_path / "bend.motion", rt.synthetic_motion("bend", duration_s=3.0))
    spec = tmp_path / "set.toml"
    spec.write_text('[[recordings]]\nfile = "bend.motion"\nlabel = "bend"\n')
    with pytest.raises(InputError, match="label 'bend' is none of"):
        built(radar, tmp_path / "w.npz", motions=spec)
    spec.write_text('[[synthetic]]\nlabel = "bend"\ncount = 1\n[windows]\nduration_s = 2.0\n')
    with pytest.raises(InputError, match="it names no recordings"):
        built(radar, tmp_path / "w.npz", motions=spec)
