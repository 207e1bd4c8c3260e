"""Several models side by side: the same noise, and differences that are there or are not; and
folders of measured and simulated samples."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rtradar as rt
from rtradar.cli import main
from rtradar.errors import InputError
from rtradar.pipeline import compare_folders, plan_levels
from rtradar.pipeline.compared import above_noise, chamfer, chamfer_bins, level_agreement
from rtradar.report.comparison import _spread

MODELS = ("analytic-paper", "analytic", "specular")


@pytest.fixture(scope="module")
def compared(
    kick: rt.Motion, small: rt.Radar, tmp_path_factory: pytest.TempPathFactory
) -> rt.Comparison:
    return rt.compare(
        kick,
        small,
        out=tmp_path_factory.mktemp("compare") / "out",
        fidelities=MODELS,
        duration_s=0.15,
        start_s=0.4,
    )


def test_the_reference_differs_in_nothing_from_itself(compared: rt.Comparison) -> None:
    found = compared.summary["fidelities"]["specular"]
    assert compared.summary["reference"] == "specular"
    differences = (
        "power_mean_db",
        "power_rms_db",
        "range_doppler_mean_db",
        "range_doppler_rms_db",
        "spectrogram_rms_db",
    )
    assert [found[key] for key in (*differences, "rdt_chamfer_bins")] == [0] * 6
    alike = ("range_doppler_correlation", "detection_overlap", "spectrogram_correlation")
    assert [found[key] for key in alike] == pytest.approx([1] * 3, abs=1e-12)


def test_another_seed_is_what_differences_are_held_against(compared: rt.Comparison) -> None:
    again = compared.summary["other_seed"]
    # No model differs, so no power does; noise and points do.
    assert again["power_rms_db"] == 0
    assert 0 < again["rdt_chamfer_bins"] < 3
    assert 0.9 < again["range_doppler_correlation"] < 1
    assert "specular, other seed" in compared.table().splitlines()[0]
    assert not list(compared.out.glob("*again*"))


def test_only_what_traces_hides(compared: rt.Comparison) -> None:
    found = compared.summary["fidelities"]
    assert found["analytic"]["occluded_share"] == found["analytic-paper"]["occluded_share"] == 0
    assert 0.01 < found["specular"]["occluded_share"] < 0.5
    assert found["analytic"]["power_mean_db"] > 0
    occluded = found["specular"]["part_occluded_share"]
    # `specular` is `analytic` but for what is occluded, and for the near field: 1 dB at most here.
    ratio = {
        part: power / found["analytic"]["part_power_m2"][part]
        for part, power in found["specular"]["part_power_m2"].items()
    }
    assert occluded == pytest.approx({part: 1 - one for part, one in ratio.items()}, abs=0.2)
    assert max(occluded.values()) > 0.4


def test_the_papers_ranges_are_farther_apart_than_the_occlusion_is(compared: rt.Comparison) -> None:
    found = compared.summary["fidelities"]
    assert (
        found["analytic-paper"]["range_doppler_correlation"]
        < found["analytic"]["range_doppler_correlation"]
        < 1
    )
    assert found["analytic-paper"]["detection_overlap"] < found["analytic"]["detection_overlap"] < 1


def test_all_have_the_noise_of_the_first(compared: rt.Comparison) -> None:
    power = [
        json.loads((compared.out / name / "summary.json").read_text())["noise_power_m2"]
        for name in MODELS
    ]
    assert power == [compared.summary["noise_power_m2"]] * 3
    # Where no echo is the maps are the same but for side lobes of the echoes, some 60 dB below
    # them.
    maps = []
    for name in MODELS:
        with h5py.File(compared.out / name / "maps.h5") as file:
            maps.append(file["range_doppler"][0, 5:40, :])
    difference = np.abs(maps[0] / maps[2] - 1)
    assert np.median(difference) < 1e-3
    assert np.quantile(difference, 0.95) < 1e-2


def test_files_and_table(compared: rt.Comparison) -> None:
    pictures = {
        f"compare_{name}.png"
        for name in ("power", "parts", "range_doppler", "spectrogram", "cloud")
    }
    assert {file.name for file in compared.out.iterdir()} == {
        *MODELS,
        "compare.json",
        "compare.html",
        "compare.csv",
        *pictures,
        *(name.replace(".png", ".pdf") for name in pictures),
    }
    assert json.loads((compared.out / "compare.json").read_text()) == compared.summary
    page = (compared.out / "compare.html").read_text()
    page = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert page.count('src="data:image/png;base64,') == 5
    assert not re.search(r"(src|href)=[\"']?https?:", page)
    lines = compared.table().splitlines()
    assert len({len(line) for line in lines}) == 1
    headings = "analytic-paper analytic specular (reference) specular, other seed"
    assert " ".join(lines[0].split()) == headings


@pytest.mark.parametrize(
    ("fidelities", "says"),
    [
        ((), "two or more"),
        (("analytic",), "two or more"),
        (("analytic", "analytic"), "each once"),
        (("analytic", "best"), "best"),
    ],
)
def test_models_that_cannot_be_compared(
    kick: rt.Motion, small: rt.Radar, fidelities: tuple[str, ...], says: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=says):
        rt.compare(kick, small, out=tmp_path / "out", fidelities=fidelities)
    assert not (tmp_path / "out").exists()


def test_the_field_of_the_echoes_is_compared(compared: rt.Comparison) -> None:
    found = compared.summary["fidelities"]
    # What is occluded is part of the difference, and the paper's ranges turn every phase.
    error = {name: found[name]["field_error"] for name in MODELS}
    assert error["specular"] == compared.summary["other_seed"]["field_error"] == 0
    assert 0.05 < error["analytic"] < 0.8 < error["analytic-paper"]


def test_the_table_is_kept_for_other_programs(compared: rt.Comparison) -> None:
    with (compared.out / "compare.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["of"] for row in rows} == {*MODELS, "specular, other seed"}
    found = {(row["measure"], row["of"]): row["value"] for row in rows}
    detections = compared.summary["fidelities"]["analytic"]["detections"]
    assert found["detections", "analytic"] == str(detections)
    assert (compared.out / "compare_power.pdf").read_bytes().startswith(b"%PDF")


def test_over_recordings_it_is_the_mean_and_its_interval(
    small_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["compare", "synthetic:punch", "synthetic:kick", "--radar", str(small_file)]
    # Too short for a spectrogram.
    words += ["--duration", "0.06", "--fidelities", "analytic-paper, analytic"]
    out = tmp_path / "out"
    assert main([*words, "--out", str(out), "--json", str(tmp_path / "c.json")]) == 0
    summary = json.loads((out / "compare.json").read_text())
    assert json.loads((tmp_path / "c.json").read_text()) == summary
    each = [json.loads((out / name / "compare.json").read_text()) for name in summary["recordings"]]
    assert [one["parameters"]["motion"] for one in each] == ["synthetic:punch", "synthetic:kick"]
    one, two = (own["fidelities"]["analytic-paper"]["power_rms_db"] for own in each)
    found = summary["fidelities"]["analytic-paper"]["power_rms_db"]
    assert found["mean"] == pytest.approx((one + two) / 2)
    # Student's t of one degree of freedom, 12.706, times half the difference of two.
    assert found["high"] - found["mean"] == pytest.approx(12.706 * abs(one - two) / 2, rel=1e-4)
    said = capsys.readouterr().out
    assert "Overlap of detections" in said
    assert "±" in said
    header = (out / "compare.csv").read_text().splitlines()[0]
    assert header == "measure,of,mean,low,high"
    assert "compare_spectrogram.png" not in each[0]["files"]
    assert each[0]["fidelities"]["analytic-paper"]["spectrogram_correlation"] is None
    page = (out / summary["recordings"][0] / "compare.html").read_text()
    assert page.count('src="data:image/png;base64,') == 4


def test_the_command_refuses_a_level_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["compare", "synthetic:punch", "--fidelities", "analytic,perfect"]
    assert main([*words, "--out", str(tmp_path / "no")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "perfect" in said
    assert not (tmp_path / "no").exists()


def test_colours_of_differences_end_at_those_of_echoes() -> None:
    model, reference = np.full(100, -60.0), np.full(100, -60.0)
    reference[:40], model[:40] = -20.0, -20.0 + np.linspace(0.0, 4.0, 40)
    model[50] = -45.0  # below the floor, whatever it differs by
    assert _spread(model, reference, -40.0) == pytest.approx(3.8)
    assert _spread(model, reference, 0.0) == 0.0


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
    for name in ("summary.json", "cloud_rdt.npz", "cloud_xyz.npz"):
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
        rt.run(kick, radar, out=tmp_path / name, fidelity="analytic", duration_s=0.3)
    found = compare_folders([tmp_path / "a", tmp_path / "b"], out=tmp_path / "out")
    clouds = [np.load(tmp_path / name / "cloud_rdt.npz")["points"] for name in ("a", "b")]
    expected = chamfer_bins(*clouds, small)
    assert found.summary["folders"]["a"]["rdt_chamfer_bins"] == pytest.approx(expected)


EVERYWHERE = np.ones(4, dtype=bool)


def test_levels_by_hand() -> None:
    # 0, 10, 20, 30 dB against 0, 10, 20, 34 dB.
    found = level_agreement([1, 10, 100, 1000], [1, 10, 100, 10**3.4], EVERYWHERE)
    assert found.mean_db == pytest.approx(-1.0)
    assert found.rms_db == pytest.approx(2.0)
    # Deviations from the means 15 and 16: sums of products 610, of squares 500 and 760.
    deviations = np.array([-15, -5, 5, 15]), np.array([-16, -6, 4, 18])
    expected = (
        deviations[0]
        @ deviations[1]
        / math.sqrt((deviations[0] @ deviations[0]) * (deviations[1] @ deviations[1]))
    )
    assert found.correlation == pytest.approx(expected)


def test_only_cells_that_count_do() -> None:
    found = level_agreement([1, 10, 0, 0], [2, 20, 5, 0], np.array([True, True, False, False]))
    assert found.correlation == pytest.approx(1.0)
    assert found.mean_db == pytest.approx(-10 * math.log10(2))


@given(gain=st.floats(0.01, 100))
def test_a_gain_is_a_shift_and_no_other_shape(gain: float) -> None:
    power = np.array([1.0, 3.0, 200.0, 7.0])
    found = level_agreement(gain * power, power, EVERYWHERE)
    assert found.correlation == pytest.approx(1.0)
    assert found.mean_db == pytest.approx(10 * math.log10(gain), abs=1e-9)
    assert found.rms_db == pytest.approx(abs(found.mean_db), abs=1e-9)


def test_nothing_to_compare_is_no_number() -> None:
    assert all(math.isnan(value) for value in level_agreement([1.0], [1.0], np.array([False])))
    flat = level_agreement([1.0, 1.0], [1.0, 2.0], np.array([True, True]))
    assert math.isnan(flat.correlation)
    assert flat.rms_db > 0


def test_noise_is_left_out() -> None:
    power = np.full(100, 1.0)
    power[:3] = [9.0, 11.0, 1e9]
    assert np.flatnonzero(above_noise(power)).tolist() == [2]  # 11 is 80 dB below the peak
    power[2] = 1e6
    assert np.flatnonzero(above_noise(power)).tolist() == [1, 2]


def test_chamfer_by_hand() -> None:
    first, second = np.array([[0.0, 0], [2, 0]]), np.array([[0.0, 3]])
    # There: 3 and sqrt(13); back: 3.
    expected = ((3 + math.sqrt(13)) / 2 + 3) / 2
    assert (
        chamfer(first, second, (1, 1)) == chamfer(second, first, (1, 1)) == pytest.approx(expected)
    )
    assert chamfer(first, first, (1, 1)) == 0
    assert chamfer(first * [2, 5], second * [2, 5], (2, 5)) == pytest.approx(expected)


def test_chamfer_of_nothing() -> None:
    nothing = np.zeros((0, 3))
    assert chamfer(nothing, nothing, (1, 1, 1)) == 0
    assert chamfer(nothing, np.zeros((1, 3)), (1, 1, 1)) == math.inf


# -- what a level will take, and which to take -----------------------------------------------------


def test_a_plan_draws_short_runs_on_to_the_whole(
    kick: rt.Motion, small: rt.Radar, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A level with 1 s for all and 2 s a second, and one whose two frames take 30 s.

    The first run of each loads something for 5 s.
    """
    asked: list[tuple[str, float]] = []

    def timed(out: Path, *given: Any) -> rt.Result:
        (*_, settings), duration_s = given, given[-1].duration_s
        asked.append((settings.fidelity, duration_s))
        wall_s = 1 + 2 * duration_s if settings.fidelity != "reference" else 400 * duration_s
        wall_s += 5 * ([level for level, _ in asked].count(settings.fidelity) == 1)
        summary = {"wall_s": wall_s, "peak_memory_mb": 100.0}
        return rt.Result(np.zeros((0, 3)), None, summary, small)  # type: ignore[arg-type]

    monkeypatch.setattr(sys.modules["rtradar.pipeline.compare"], "run_into", timed)
    levels = ["analytic", "reference"]
    found = plan_levels(kick, small, fidelities=levels, duration_s=0.5, tolerance_db=0.5)
    capture_s = found["capture_s"]
    assert capture_s == pytest.approx(0.5, abs=0.001)
    assert found["advice"]["level"] == "specular"
    assert "0.163 is allowed" in found["advice"]["why"]
    assert [*found["levels"]] == ["specular", *levels]
    assert found["levels"]["analytic"]["wall_s"] == pytest.approx(1 + 2 * capture_s)
    # A slow level runs once, and what it loads is drawn on, too: rather too much than too little.
    first_s = small.frame_duration_s + small.frame_hop_s
    expected_s = (5 + 400 * first_s) * capture_s / first_s
    assert found["levels"]["reference"]["wall_s"] == pytest.approx(expected_s)
    assert [own for level, own in asked if level == "reference"] == pytest.approx([first_s])


def test_a_plan_is_printed_and_nothing_is_written(
    small_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["compare", "synthetic:kick", "--duration", "0.2", "--radar", str(small_file)]
    words += ["--fidelities", "analytic,analytic-paper", "--out", str(tmp_path / "out")]
    assert main([*words, "--plan"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in said] == ["Run", "analytic", "analytic-paper"]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["synthetic:kick", "synthetic:walk", "--plan"], "of one recording"),
        ([".", "synthetic:walk", "--plan"], "of one recording"),
        (["synthetic:kick", "--advise", "-1"], "tolerance_db = -1"),
        (["--scene", "living-room", "--duration", "0.2", "--plan"], "nobody is in scene"),
    ],
)
def test_a_plan_that_has_no_meaning_is_refused_in_one_line(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", *words, "--out", str(tmp_path / "out")]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert said in lines[0]
