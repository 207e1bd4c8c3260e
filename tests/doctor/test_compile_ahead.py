"""All levels compiled ahead: nothing is left that a run would compile."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from rtradar.doctor import compile_ahead as ahead
from rtradar.system.threads import THREADS_VARIABLE

RUNS = """
import sys
import rtradar as rt
motion, radar = rt.synthetic_motion("kick", seed=1, duration_s=0.2), rt.Radar.preset("paper-77ghz")
for level in "analytic-paper", "analytic", "specular", "physical-optics", "auto":
    rt.run(motion, radar, fidelity=level, clutter_removal="mti", out=f"{sys.argv[1]}/{level}")
gradual = {"visibility": "gradual"}
rt.run(motion, radar, fidelity="specular", model_options=gradual, out=f"{sys.argv[1]}/gradual")
rt.run(motion, rt.Radar.preset("iwr6843"), rt.Scene.load("bedroom"), out=f"{sys.argv[1]}/room")
"""


@pytest.mark.slow
def test_runs_of_all_levels_find_their_code(tmp_path: Path) -> None:
    def code() -> set[Path]:
        return set((tmp_path / "cache").rglob("*.nbc"))

    def python(*words: str) -> str:
        environment = {
            **os.environ,
            "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
            THREADS_VARIABLE: "2",
        }
        command = [sys.executable, "-W", "ignore", "-c", *words]
        return subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True
        ).stdout

    said = python(
        "from rtradar.doctor.compile_ahead import *\n"
        "print(compile_ahead() > 0, left_to_compile(), compile_ahead())"
    )
    assert said.split("\n")[-2] == "True set() 0.0"
    before = code()
    assert before
    python(RUNS, str(tmp_path))
    assert code() == before


def test_nothing_is_done_where_all_is_on_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ahead, "left_to_compile", set)
    assert ahead.compile_ahead() == 0.0
