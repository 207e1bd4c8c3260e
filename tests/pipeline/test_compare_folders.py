"""Folders of measured and simulated samples beside each other."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.cli import main
from rtradar.pipeline.compare_folders import compare_folders
from rtradar.pipeline.compared import chamfer_bins


@pytest.fixture(scope="module")
def folders(
    kick: rt.Motion, small: rt.Radar, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Path]:
    """A run; its samples as the numbers of an ADC, shorter; and those of another radar."""
    place = tmp_path_factory.mktemp("folders")
    samples = rt.simulate(kick, small, fidelity="analytic", duration_s=0.23, seed=3).samples.values
    found = {name: place / name for name in ("simulated", "measured", "other")}
    rt.process_samples(samples, small, found["simulated"])
    rt.process_samples(samples[:700] * 1e5, small, found["measured"], unit="count")
    other = dataclasses.replace(small, bandwidth_hz=small.bandwidth_hz / 2)
    rt.process_samples(samples[:400], other, found["other"])
    return found


def test_a_factor_between_both_is_a_mean_difference_alone(
    folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [str(folders["measured"]), str(folders["simulated"])]
    assert main(["compare", *words, "--out", str(tmp_path / "both")]) == 0
    said = capsys.readouterr().out
    assert said.splitlines()[0].split() == ["measured", "simulated", "(reference)"]
    summary = json.loads((tmp_path / "both" / "compare.json").read_text())
    found = summary["folders"]["measured"]
    assert found["range_doppler_mean_db"] == pytest.approx(100.0, abs=1e-3)
    assert found["range_doppler_rms_db"] == pytest.approx(0.0, abs=1e-2)
    assert found["range_doppler_correlation"] == pytest.approx(1.0, abs=1e-4)
    assert found["detection_overlap"] > 0.99
    assert found["unit"] == "count"
    assert found["windows"] < summary["folders"]["simulated"]["windows"]
    assert summary["folders"]["simulated"]["range_doppler_rms_db"] == 0.0
    page = (tmp_path / "both" / "compare.html").read_text()
    assert len(re.findall("data:image/png", page)) == 3
    assert "numbers of an ADC" not in said
    assert {file.name for file in (tmp_path / "both").iterdir()} == set(summary["files"])


def test_what_cannot_be_laid_on_each_other_is_refused(
    folders: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").mkdir()
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    for name in ("summary.json", "cloud_rdt.npz"):
        (damaged / name).write_bytes((folders["simulated"] / name).read_bytes())
    (damaged / "maps.h5").write_bytes(b"no maps")
    simulated = folders["simulated"]
    for one, other, says in (
        (folders["other"], simulated, "has a range axis of 128 steps to"),
        (simulated, simulated, "two or more, each of another name"),
        (tmp_path / "empty", simulated, "holds no run"),
        (damaged, simulated, "is damaged, or of another kind"),
        ("synthetic:kick", simulated, "'synthetic:kick' is no folder"),
    ):
        assert main(["compare", str(one), str(other), "--out", str(tmp_path / "out")]) == 2
        said = capsys.readouterr().err
        assert says in said
        assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_clouds_are_apart_in_the_bins_of_the_reference(
    small: rt.Radar, kick: rt.Motion, tmp_path: Path
) -> None:
    slower = dataclasses.replace(small, frame_hop_s=2 * small.frame_hop_s)
    for name, radar in (("a", slower), ("b", small)):
        rt.run(
            kick, radar, out=tmp_path / name, fidelity="analytic", duration_s=0.3, pictures=False
        )
    found = compare_folders([tmp_path / "a", tmp_path / "b"], out=tmp_path / "out")
    clouds = [np.load(tmp_path / name / "cloud_rdt.npz")["points"] for name in ("a", "b")]
    expected = chamfer_bins(*clouds, small)
    assert found.summary["folders"]["a"]["rdt_chamfer_bins"] == pytest.approx(expected)
