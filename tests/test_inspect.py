"""`rtradar inspect`: what a file means, by the command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rtradar as rt
from rtradar.cli import main

SMPL = (
    "pelvis", "spine1", "spine2", "spine3", "neck", "head",
    *(f"{side}_{joint}" for side in ("left", "right") for joint in
      ("hip", "knee", "ankle", "foot", "shoulder", "elbow", "wrist")),
)  # fmt: skip


def looked(folder: Path, *arguments: str) -> dict[str, Any]:
    """What the command writes of a file."""
    assert main(["inspect", *arguments, "--json", str(folder / "found.json")]) == 0
    found: dict[str, Any] = json.loads((folder / "found.json").read_text())
    return found


def test_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    walk = rt.synthetic_motion("walk", seed=0, duration_s=1.0)
    nodes = ["root", "lowerback", "upperback", "thorax", "neck", "head"]
    for side in "lr":
        limbs = ("hip", "knee", "ankle", "toe", "shoulder", "elbow", "wrist")
        nodes += [f"{side}_{node}" for node in limbs]
    places = walk.positions[:, [walk.joints.index(node) for node in nodes]]
    y_down = places[..., [1, 2, 0]] * [1, -1, -1] * 1000.0
    np.savez(tmp_path / "a.npz", joints=np.array(SMPL), positions=y_down, rate_hz=120.0)
    found = looked(tmp_path, str(tmp_path / "a.npz"))
    assert found["kind"] == "motion"
    assert (found["unit_m"], found["up"], found["rate_hz"]) == (0.001, "-y", 120.0)
    assert 1.5 < found["stature_m"] < 1.9
    assert 2 < found["largest_speed_mps"] < 8
    assert found["warnings"] == []
    assert "up: -y, for along it the person stands on a floor" in capsys.readouterr().out
    found = looked(tmp_path, str(tmp_path / "a.npz"), "--up", "z")
    assert any("with z up, as given, the person lies" in line for line in found["warnings"])


def test_a_radar_and_a_scene(tmp_path: Path) -> None:
    (tmp_path / "r.toml").write_text('name = "mine"\ntx_y = 2\ntx_z = 0\nrx_y = 4\nrx_z = 0\n')
    found = looked(tmp_path, str(tmp_path / "r.toml"))
    assert (found["kind"], found["name"], found["n_tx"], found["n_rx"]) == ("radar", "mine", 2, 4)
    (tmp_path / "s.toml").write_text(
        '[[furniture]]\nname = "s"\nmesh = "sofa"\nmaterial = "wood"\nposition_m = [1, 1, 0]\n'
    )
    found = looked(tmp_path, str(tmp_path / "s.toml"))
    assert (found["kind"], found["furniture"]) == ("scene", 1)


def test_what_comes_along_is_told_apart(tmp_path: Path) -> None:
    for folder, kind in (("radars", "radar"), ("scenes", "scene")):
        for file in sorted((Path(__file__).parents[1] / folder).glob("*.toml")):
            found = looked(tmp_path, str(file))
            assert (found["kind"], bool(found["name"])) == (kind, True), file


def test_samples(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.save(tmp_path / "a.npy", np.ones((8, 3, 4, 16), np.complex64))
    found = looked(tmp_path, str(tmp_path / "a.npy"))
    assert (found["kind"], found["chirps"], found["tx_per_cycle"]) == ("samples", 24, 3)
    assert "which does not tell of its radar (--radar)" in capsys.readouterr().out
    radar = str(Path(__file__).parents[1] / "radars" / "iwr1843.toml")
    assert looked(tmp_path, str(tmp_path / "a.npy"), "--radar", radar)["radar"] == "iwr1843"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.asf", "a skeleton without its motion; give the .amc, and this as --skeleton"),
        ("", "a folder, not a motion file; name one of its files"),
        ("a.txt", "unknown kind of motion file '.txt'"),
        ("none.bvh", "cannot read this BVH file"),
    ],
)
def test_what_is_none_of_these_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, words: str
) -> None:
    if name.startswith("a."):
        (tmp_path / name).write_text("x")
    assert main(["inspect", str(tmp_path / name)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
