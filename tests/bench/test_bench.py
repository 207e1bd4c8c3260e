"""`rtradar bench` from processes, which stand-ins replace here, to JSON, tables and figure."""

from __future__ import annotations

import json
import stat
from pathlib import Path
from typing import Any

import pytest

import rtradar.bench
from rtradar.bench import runs
from rtradar.bench.runs import (
    Case,
    Run,
    RunError,
    Runner,
    by_stage,
    paired_ratio,
    spread,
)
from rtradar.cli import main
from rtradar.pipeline.timing import to_cloud_s

pytestmark = pytest.mark.drawn

CHIRPS = 1596 * 3  # three frames of the paper's radar
BASELINE = {
    "stages": {"echoes and IF": spread([8.0]), "cfar": spread([2.0])},
    "total": spread([10.0]),
    "cycles": 12,
    "cycles_per_frame": 133,
}


def summary(scatter_s: float) -> dict[str, Any]:
    return {
        "stages": {
            "scatter": scatter_s,
            "signal": 1.0,
            "cloud": 0.5,
            "angle": 0.25,
            "write": 0.25,
            "pictures": 1.0,
        },
        "wall_s": scatter_s + 3.5,  # half a second elsewhere
        "warmup_s": 0.25,
        "capture_s": 0.3,
        "chirps": CHIRPS,
        "peak_memory_mb": 400.0,
    }


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> list[Case]:
    """A machine without surprises; the cases that ran on it."""
    done: list[Case] = []

    def run(self: Runner, case: Case) -> Run:
        first = not any(other.fidelity == case.fidelity for other in done)
        done.append(case)
        usual = {"analytic-paper": 1.0, "analytic": 2.0, "specular": 6.0}
        scatter = usual.get(case.fidelity, 9.0) * (5 if "77" in case.radar else 1)
        return Run(scatter + 3.5 + 0.25 + 1.0 + (7.0 if first else 0.0), summary(scatter))

    monkeypatch.setattr(Runner, "run", run)
    monkeypatch.setattr(rtradar.bench, "measure_baseline", lambda radar, repeats, quick: BASELINE)
    return done


def test_all_that_is_measured_is_in_the_json(
    machine: list[Case], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["bench", "--fidelity", "analytic-paper,analytic,specular", "--repeats", "2"]
    words += ["--only", "models", "--json", str(tmp_path / "b.json")]
    words += ["--figure", str(tmp_path / "b.png")]
    assert main(words) == 0
    found = json.loads((tmp_path / "b.json").read_text())
    assert list(found) == ["settings", "machine", "models", "paper", "growth"]
    assert found["settings"]["repeats"] == 2
    rows = found["models"]
    assert [(row["radar"], row["fidelity"]) for row in rows] == [
        (radar, fidelity)
        for radar in ("paper-12ghz", "paper-77ghz")
        for fidelity in found["settings"]["fidelities"]
    ]
    specular = rows[2]
    assert specular["to_cloud_s"] == {"best": 8.0, "median": 8.0}
    assert specular["whole_s"]["median"] == 9.5
    assert specular["first_use"] == {"adds_s": 7.0, "process_s": 17.75, "warmup_s": 0.25}
    assert specular["over_analytic"] == 2.0  # 8 s over 4 s
    assert specular["paper_over"] == {"to_cloud": 30.0 / 8.0, "if": 24.0 / 7.0}
    assert specular["stages"]["elsewhere"]["median"] == 0.5
    assert specular["stages"]["pictures"] == {"best": 1.0, "median": 1.0}
    assert [row["first_use"] is None for row in rows] == [False, False, False, True, True, True]
    assert found["growth"]["chirps"][0] == {
        "radar": "paper-77ghz",
        "of_radar": "paper-12ghz",
        "fidelity": "analytic-paper",
        "chirps": 1.0,
        "to_cloud": 7.0 / 3.0,
        "peak_memory": 1.0,
    }
    assert (tmp_path / "b.png").stat().st_size > 1000
    said = capsys.readouterr()
    assert "| paper-12ghz | `specular`" in said.out
    assert "8.00 s" in said.out
    assert "| paper-77ghz: stage" in said.out
    assert "| all to the cloud" in said.out
    assert said.err == ""  # no progress bar where there is no terminal


def test_models_take_turns_after_their_first_use(
    machine: list[Case], capsys: pytest.CaptureFixture[str]
) -> None:
    words = "bench --radar paper-12ghz --fidelity analytic,specular --repeats 2 --only models"
    assert main(words.split()) == 0
    assert [case.fidelity for case in machine] == ["analytic", "specular"] * 3


def test_growth_with_length(
    machine: list[Case], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["bench", "--quick", "--only", "growth"]
    words += ["--json", str(tmp_path / "b.json"), "--figure", str(tmp_path / "b.png")]
    assert main(words) == 0
    growth = json.loads((tmp_path / "b.json").read_text())["growth"]
    assert growth["fidelity"] == "specular"
    assert [row["duration_s"] for row in growth["duration"]] == [0.5, 1.0]
    assert growth["chirps"] == []
    assert (tmp_path / "b.png").stat().st_size > 1000
    assert "| recording, `specular` |" in capsys.readouterr().out


def test_without_the_validation_scripts_the_table_says_so(
    machine: list[Case],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(rtradar.bench, "measure_baseline", runs.measure_baseline)
    monkeypatch.setattr(runs, "validation_folder", lambda: tmp_path)
    assert main(["bench", "--quick", "--only", "models", "--json", str(tmp_path / "b.json")]) == 0
    assert "the paper's method was not timed: there is no paper_numpy.py" in capsys.readouterr().out
    assert json.loads((tmp_path / "b.json").read_text())["models"][0]["paper_over"] is None


def test_the_baseline_is_timed_in_a_process_of_its_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    folder = tmp_path / "other_methods"
    folder.mkdir()
    (folder / "paper_numpy.py").write_text(
        "import json, sys\n"
        "assert sys.argv[1:5] == ['--radar', 'paper-77ghz', '--repeats', '2']\n"
        "assert '--cycles' in sys.argv\n"
        "frames = [{'echoes and IF': 1.0, 'cfar': 0.5}, {'echoes and IF': 3.0, 'cfar': 0.5}]\n"
        "found = {'cycles': 12, 'cycles_per_frame': 133, 'frames': frames}\n"
        "open(sys.argv[sys.argv.index('--json') + 1], 'w').write(json.dumps(found))\n"
    )
    monkeypatch.setattr(runs, "validation_folder", lambda: tmp_path)
    found = runs.measure_baseline("paper-77ghz", 2, quick=True)
    assert found == {
        "stages": {"echoes and IF": spread([1.0, 3.0]), "cfar": spread([0.5])},
        "total": {"best": 1.5, "median": 2.5},
        "cycles": 12,
        "cycles_per_frame": 133,
    }
    (folder / "paper_numpy.py").write_text("raise ArithmeticError('the abacus is broken')")
    with pytest.raises(RunError, match=r"paper_numpy.py: ArithmeticError: the abacus is broken"):
        runs.measure_baseline("paper-77ghz", 2, quick=True)


def test_a_run_that_fails_is_one_line_and_status_1(
    machine: list[Case], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(self: Runner, case: Case) -> Run:
        raise RunError("bench: analytic, radar paper-12ghz: rtradar: no backend works")

    monkeypatch.setattr(Runner, "run", fails)
    assert main(["bench", "--quick", "--only", "models"]) == 1
    assert (
        capsys.readouterr().err
        == "rtradar: bench: analytic, radar paper-12ghz: rtradar: no backend works\n"
    )


def stand_in(folder: Path, script: str) -> str:
    """A program in place of Python, which is given the words of `rtradar run`."""
    program = folder / "python"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return str(program)


def test_a_process_has_caches_of_its_own_and_gives_its_summary(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "summary.json").write_text(json.dumps(summary(2.0)))
    # The last word is the file for the summary.
    script = f'env > {tmp_path}/env; echo "$@" > {tmp_path}/words; for last; do :; done; '
    script += f'cp {tmp_path}/summary.json "$last"'
    monkeypatch.setattr(runs.sys, "executable", stand_in(tmp_path, script))
    folder = tmp_path / "caches"
    folder.mkdir()
    run = Runner(folder).run(Case("paper-77ghz", "rays", 0.5))
    assert run.to_cloud_s == 4.0
    assert run.from_start_to_cloud_s == pytest.approx(run.process_s - 1.5)
    environment = dict(
        line.split("=", 1) for line in (tmp_path / "env").read_text().splitlines() if "=" in line
    )
    for name in ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR"):
        assert environment[name].startswith(str(folder / "rays"))
    assert (
        "run synthetic:walk --duration 0.5 --radar paper-77ghz --fidelity rays"
        in (tmp_path / "words").read_text()
    )
    assert [item.name for item in folder.iterdir()] == ["rays"]  # what the run wrote is gone


def test_a_process_that_fails_says_its_last_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(
        runs.sys, "executable", stand_in(tmp_path, "echo first >&2; echo 'rtradar: no' >&2; exit 2")
    )
    with pytest.raises(RunError, match=r"^bench: specular, radar mine.toml: rtradar: no$"):
        Runner(tmp_path).run(Case("mine.toml", "specular", 0.5))


# -- arithmetic on given seconds -------------------------------------------------------------------


def test_what_leads_to_the_cloud_is_all_but_other_products_and_files() -> None:
    stages = {"scatter": 1.0, "cloud": 0.5, "angle": 2.0, "spectrogram": 0.25}
    stages |= {"write": 0.125, "pictures": 4.0, "report": 8.0}
    # 15.875 s in stages, and 0.125 s elsewhere.
    assert to_cloud_s(stages, wall_s=16.0) == 1.625
    assert Run(20.0, {"stages": stages, "wall_s": 16.0}).stages["elsewhere"] == 0.125
    # Stages that overlap leave nothing elsewhere.
    assert Run(20.0, {"stages": stages, "wall_s": 3.0}).stages["elsewhere"] == 0.0


def test_a_stage_that_a_run_lacks_took_it_no_time() -> None:
    found = by_stage([{"a": 1.0}, {"a": 3.0, "b": 1.0}, {"a": 2.5, "b": 5.0}])
    assert list(found) == ["a", "b"]
    assert found == {"a": {"best": 1.0, "median": 2.5}, "b": {"best": 0.0, "median": 1.0}}


def test_ratios_are_of_neighbours() -> None:
    # The third pair was measured in a slow minute, which is no matter.
    assert paired_ratio([2.0, 4.0, 40.0], of=[1.0, 1.0, 20.0]) == 2.0
