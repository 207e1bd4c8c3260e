"""Whole runs through the command line: each level, scene and command, and recordings.

Other tests look into one thing each. These go all the way, so that nothing that a user starts with
is broken between its parts.
"""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.cli import main
from rtradar.cli.parser import parser
from rtradar.system.registries import MODELS, scene_files

LESS = {  # levels that take minutes for a second, with few rays and facets
    "rays": ("--model-option", "rays_per_wavelength=1"),
    "reference": ("--model-option", "facets=320"),
}
BANDAI = "bandai_namco_CC-BY-NC/dataset-1_kick_normal"
SHORT = ("--duration", "0.06", "--snr-db", "30")


def fraction_at(out: Path, range_m: float) -> float:
    """Fraction of the points of a run's cloud that are where the person is, to 0.8 m."""
    with np.load(out / "cloud_rdt.npz") as cloud:
        return float(np.mean(np.abs(cloud["points"][:, 1] - range_m) < 0.8))


@pytest.mark.parametrize("level", MODELS.built_in)
def test_a_run_by_every_level(level: str, small_file: Path, tmp_path: Path) -> None:
    words = ["--radar", str(small_file), *SHORT, *LESS.get(level, ()), "--out", str(tmp_path)]
    words += ["--pictures"] if level == "specular" else []
    assert main(["run", "synthetic:kick", "--fidelity", level, *words]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["fidelity"] == level
    assert summary["occlusion"] == ("none" if level.startswith("analytic") else "mitsuba")
    # From (-4, 1) to somebody at the origin.
    assert fraction_at(tmp_path, np.hypot(4, 1)) > 0.9


@pytest.mark.parametrize("name", scene_files())
def test_a_run_in_every_scene(name: str, small_file: Path, tmp_path: Path) -> None:
    scene, radar = rt.Scene.load(name), tmp_path / "one_tx.toml"
    radar.write_text(small_file.read_text().replace("tx_y = 2", "tx_y = 1"))
    words = ["--radar", str(radar), *SHORT, "--clutter-removal", "mean"]
    words += ["--scene", name, "--out", str(tmp_path / "out")]
    words += ["--pictures"] if name == "living-room" else []
    assert main(["run", "synthetic:kick", *words]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["parameters"]["scene"] == name
    assert ("room" in summary) == (name != "free-space")
    place = np.array(scene.radar_position_m or (-4.0, 1.0, 1.0))[:2]
    distance = float(np.linalg.norm(place - np.array(scene.person_position_m)))
    # Some rooms show their person over walls, too.
    assert fraction_at(tmp_path / "out", distance) > 0.3


@pytest.mark.parametrize(
    "recording", ["cmu/02_01.amc --skeleton cmu/02.asf", "cmu/135_02.c3d", f"{BANDAI}_001.bvh"]
)
def test_a_run_of_a_recording(
    recording: str, mocap: Path, small_file: Path, tmp_path: Path
) -> None:
    words = [word if word.startswith("-") else str(mocap / word) for word in recording.split()]
    words += ["--radar", str(small_file), *SHORT, "--start", "0.5", "--out", str(tmp_path)]
    assert main(["run", *words]) == 0
    assert fraction_at(tmp_path, np.hypot(4, 1)) > 0.9


SPEC = """
[windows]
duration_s = 0.1
[each]
radar = ["small.toml"]
fidelity = ["analytic"]
[[synthetic]]
label = "walk"
count = 4
[[synthetic]]
label = "kick"
count = 4
"""


def test_from_a_data_set_to_an_answer(
    small_file: Path, small_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(small_file, tmp_path)
    (tmp_path / "set.toml").write_text(SPEC)
    clouds, trained = tmp_path / "clouds", tmp_path / "trained"
    train = ["--out", trained, "--points", 24, "--epochs", 2, "--folds", 2]
    for words in (
        ["dataset", "init", tmp_path / "new.toml"],
        ["dataset", "build", tmp_path / "set.toml", "--out", clouds, "--workers", 1],
        ["dataset", "export", clouds, "--out", tmp_path / "clouds.zarr"],
        ["train", clouds, *train],
        ["evaluate", trained],
        ["predict", small_run, "--json", tmp_path / "answer.json"],
    ):
        assert main([str(word) for word in words]) == 0, words
    answer = json.loads((tmp_path / "answer.json").read_text())
    assert {path.name for path in trained.iterdir()} >= {"training-01", "training-02"}
    assert answer


ON_A_RUN = {
    "compare": ["compare", "synthetic:kick", *SHORT, "--fidelities", "analytic,specular"],
    "process": ["process", "RUN"],
    "export": ["export", "RUN", "--out", "OUT.nc"],
    "view": ["view", "RUN", "--no-browser", "--out", "OUT.html"],
    "inspect": ["inspect", "FILE", "--json", "OUT.json"],
    "list": ["list", "fidelities", "--json", "OUT.json"],
    "validate": ["validate", "--quick", "--only", "materials", "--json", "OUT.json"],
    "doctor": ["doctor", "--json", "OUT.json"],
    "bench": ["bench", "--quick", "--only", "models", "--fidelity", "analytic"],
    "paper": ["paper", "--quick"],
}
LONG = {"bench", "doctor", "paper"}  # half a minute, compiling of all levels, and minutes
HERE = {
    "run",
    "dataset",
    "train",
    "evaluate",
    "predict",
    "recogniser",
}  # commands of the tests above


@pytest.mark.parametrize(
    "command",
    [pytest.param(name, marks=[pytest.mark.slow] if name in LONG else []) for name in ON_A_RUN],
)
def test_every_other_command(
    command: str, small_file: Path, small_run: Path, tmp_path: Path
) -> None:
    words = ON_A_RUN[command]
    for name, path in {"RUN": small_run, "FILE": small_file, "OUT": tmp_path / "out"}.items():
        words = [word.replace(name, str(path)) for word in words]
    if command in ("compare", "bench"):
        words += ["--radar", str(small_file)]
    if command in ("compare", "process", "paper"):
        words += ["--out", str(tmp_path / "out")]
    if command == "bench":
        words += ["--json", str(tmp_path / "out.json")]
    assert main(words) == 0
    assert list(tmp_path.iterdir())


def test_no_command_is_left_out() -> None:
    actions = parser()._actions
    (commands,) = (one.choices for one in actions if isinstance(one, argparse._SubParsersAction))
    assert set(commands) == HERE | {words[0] for words in ON_A_RUN.values()}
