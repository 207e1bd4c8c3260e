"""Whole runs and the paper's method, each in a process of its own, and what their seconds say.

In a process of its own, peak memory and first use are what a user gets.
"""

from __future__ import annotations

import json
import os
import site
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from tqdm import tqdm

from rtradar.pipeline.timing import to_cloud_s
from rtradar.system.files import temporary_folder
from rtradar.validate import validation_folder

MOTION = "synthetic:walk"

CHEAPEST = "analytic"
"""Model with which all others are compared."""

ELSEWHERE = "elsewhere"
"""Time of a run outside all of its stages, such as copies into frames; it counts to the cloud."""

IF_STAGE = "echoes and IF"
"""Stage of the paper's method that compares with our ``scatter`` and ``signal``."""

_QUICK_CYCLES = 12


class Case(NamedTuple):
    """One whole run: options of the command line, and the length of the capture [s]."""

    radar: str
    fidelity: str
    duration_s: float


class RunError(RuntimeError):
    """A run did not end well; the message is its last line."""


def spread(seconds: Sequence[float]) -> dict[str, float]:
    """Best and median of some measurements of one thing [s]."""
    return {"best": min(seconds), "median": median(seconds)}


def by_stage(runs: Sequence[Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """`spread` by stage over runs, in order of appearance; a run that lacks one spent 0 s there."""
    names = dict.fromkeys(name for run in runs for name in run)
    return {name: spread([run.get(name, 0.0) for run in runs]) for name in names}


def paired_ratio(seconds: Sequence[float], of: Sequence[float]) -> float:
    """Median of the ratios of neighbours, so that a slow minute affects both."""
    return median(one / other for one, other in zip(seconds, of, strict=True))


@dataclass(frozen=True)
class Run:
    """What one process gave: its time from start to end [s], and its summary."""

    process_s: float
    summary: dict[str, Any]

    @property
    def stages(self) -> dict[str, Any]:
        """Seconds by stage, ``elsewhere`` among them: not below zero, should stages overlap."""
        stages = self.summary["stages"]
        return stages | {ELSEWHERE: max(self.whole_s - sum(stages.values()), 0.0)}

    @property
    def whole_s(self) -> float:
        """Time of the run after warm-up [s]."""
        return float(self.summary["wall_s"])

    @property
    def to_cloud_s(self) -> float:
        """Time that leads to the range-Doppler-time cloud [s]."""
        return to_cloud_s(self.summary["stages"], self.whole_s)

    @property
    def from_start_to_cloud_s(self) -> float:
        """Time to the cloud with start, imports, compiling and warm-up [s]."""
        return self.process_s - self.whole_s + self.to_cloud_s


class Runner:
    """Runs cases in processes of their own, with caches in a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.first: dict[str, Run] = {}
        """First use of each model."""

    def measure(self, cases: Sequence[Case], repeats: int, what: str) -> dict[Case, list[Run]]:
        """Run every case some times, all cases in turn, each model once before that."""
        # The first run of a model also compiles, and is kept apart.
        fresh = {case.fidelity: case for case in reversed(cases) if case.fidelity not in self.first}
        runs: dict[Case, list[Run]] = {case: [] for case in cases}
        count = len(fresh) + repeats * len(cases)
        with tqdm(total=count, desc=what, unit="run", disable=None) as bar:
            for fidelity, case in reversed(fresh.items()):
                self.first[fidelity] = self.run(case)
                bar.update()
            for case in repeats * list(cases):
                runs[case].append(self.run(case))
                bar.update()
        return runs

    def run(self, case: Case) -> Run:
        """One run of a case."""
        with temporary_folder(inside=self._folder) as out:
            # Runs go through the command line, as those of a user do.
            words = f"-m rtradar run {MOTION} --duration {case.duration_s}".split()
            words += ["--radar", case.radar, "--fidelity", case.fidelity, "--variant", "cpu"]
            words += ["--out", str(out / "run")]
            what = f"{case.fidelity}, radar {case.radar}"
            began = time.perf_counter()
            home = self._folder / case.fidelity
            home.mkdir(exist_ok=True)
            summary = _json_of(words, out / "summary.json", what, with_caches_in(home))
            return Run(time.perf_counter() - began, summary)


def with_caches_in(home: Path) -> dict[str, str]:
    """Environment with all caches of compiled code and of fonts in a folder."""
    # Packages of the user are found through HOME, unless their folder is named.
    own = {"PYTHONUSERBASE": site.getuserbase(), "HOME": str(home)}
    own |= {"XDG_CACHE_HOME": str(home / "cache"), "NUMBA_CACHE_DIR": str(home / "numba")}
    return dict(os.environ) | own


def _json_of(
    words: Sequence[str], written: Path, what: str, environment: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """What Python, run with these words, writes into a JSON file; `RunError` where it fails."""
    command = [sys.executable, *words, "--json", str(written)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or [f"ended with status {done.returncode}"]
        raise RunError(f"bench: {what}: {lines[-1]}")
    found: dict[str, Any] = json.loads(written.read_text(encoding="utf-8"))
    return found


def measure_baseline(radar: str, repeats: int, *, quick: bool) -> dict[str, Any] | None:
    """Time the paper's method in plain NumPy, one thread, for some frames, or a part of each.

    Returns the time for one frame, by ``stages`` and in ``total`` [s], scaled from the ``cycles``
    TDM cycles that were synthesised to ``cycles_per_frame``; None where the validation scripts, one
    of which it is, are not there.
    """
    script = validation_folder() / "other_methods" / "paper_numpy.py"
    if not script.is_file():
        return None
    words = [str(script), "--radar", radar, "--repeats", str(repeats)]
    words += ["--cycles", str(_QUICK_CYCLES)] if quick else []
    with temporary_folder() as folder:
        found = _json_of(words, folder / "frames.json", script.name)
    frames = found["frames"]
    return {
        "stages": by_stage(frames),
        "total": spread([sum(frame.values()) for frame in frames]),
        "cycles": found["cycles"],
        "cycles_per_frame": found["cycles_per_frame"],
    }
