"""A level that is gone: one line says what to take, and what was made by it is still read."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.cli import main
from rtradar.clouds.sample_files import Sample, write_index, write_sample
from rtradar.errors import InputError

LINE = (
    "fidelity 'fresnel' is gone; take 'specular' with visibility = 'gradual' "
    "(--model-option visibility=gradual), or 'physical-optics'"
)
MOTION = rt.synthetic_motion("walk", seed=0, duration_s=0.3)
SPHERE = rt.Ellipsoids(np.zeros((1, 3)), np.eye(3)[None], np.full((1, 3), 0.1))
IN_PYTHON: dict[str, Callable[[rt.Radar, Path], object]] = {
    "run": lambda radar, out: rt.run(MOTION, radar, fidelity="fresnel", out=out),
    "scattering_length": lambda radar, out: rt.scattering_length(
        SPHERE, [4.0, 0, 0], [4.0, 0, 0], 12e9, "fresnel"
    ),
}


@pytest.mark.parametrize("call", IN_PYTHON)
def test_in_python_one_line_says_what_to_take(call: str, small: rt.Radar, tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        IN_PYTHON[call](small, tmp_path / "out")
    assert str(caught.value) == LINE
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ["compare", "dataset"])
def test_on_the_command_line_it_is_the_same_line(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "set.toml").write_text(
        "[windows]\nduration_s = 2.0\n[[synthetic]]\nlabel = 'walk'\ncount = 1\n"
        "[each]\nfidelity = ['fresnel']\n"
    )
    words = {
        "compare": ["synthetic:walk", "--fidelities", "specular,fresnel", "--out", "OUT"],
        "dataset": ["build", str(tmp_path / "set.toml"), "--out", "OUT"],
    }[command]
    words = [str(tmp_path / "out") if word == "OUT" else word for word in words]
    assert main([command, *words]) == 2
    said = capsys.readouterr().err
    assert LINE in said
    assert len(said.splitlines()) == 1


def made_by_it(folder: Path, out: Path) -> Path:
    """A copy of a run folder that says that it was made by that level."""
    shutil.copytree(folder, out)
    summary = json.loads((out / "summary.json").read_text())
    summary["parameters"]["fidelity"] = "fresnel"
    (out / "summary.json").write_text(json.dumps(summary))
    return out


def test_run_folders_are_compared_as_ever(small_run: Path, tmp_path: Path) -> None:
    old = made_by_it(small_run, tmp_path / "old")
    assert main(["compare", str(small_run), str(old), "--out", str(tmp_path / "both")]) == 0
    assert (tmp_path / "both" / "compare.html").exists()


def test_samples_of_a_data_set_are_read_as_ever(tmp_path: Path) -> None:
    cloud = np.zeros((3, 4), dtype=np.float32)
    write_sample(tmp_path, "000", Sample(cloud, "walk", {"fidelity": "fresnel"}), cloud)
    write_index(tmp_path, ["000"])
    table = rt.Collection(tmp_path).to_pandas()
    assert table["fidelity"].tolist() == ["fresnel"]
