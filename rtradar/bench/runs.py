"""Whole runs, each in a process of its own, so that peak memory and first use are what a user gets."""

from __future__ import annotations

import json
import os
import site
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from rtradar.bench.plan import Case
from rtradar.bench.times import to_cloud_s, with_elsewhere
from rtradar.system.files import temporary_folder

MOTION = "synthetic:walk"


class RunError(RuntimeError):
    """A run did not end well; the message is its last line."""


@dataclass(frozen=True)
class Run:
    """What one process gave.

    Parameters
    ----------
    process_s : float
        From its start to its end [s].
    summary : dict
        As `rtradar.run` writes it.
    """

    process_s: float
    summary: dict[str, Any]

    @property
    def stages(self) -> dict[str, float]:
        """Seconds by stage, ``elsewhere`` among them."""
        return with_elsewhere(self.summary["stages"], self.whole_s)

    @property
    def whole_s(self) -> float:
        """The run after warm-up [s]."""
        return float(self.summary["wall_s"])

    @property
    def to_cloud_s(self) -> float:
        """What of it leads to the range-Doppler-time cloud [s]."""
        return to_cloud_s(self.summary["stages"], self.whole_s)

    @property
    def from_start_to_cloud_s(self) -> float:
        """The process but for what does not lead to the cloud: with start, imports, compiling and warm-up [s]."""
        return self.process_s - self.whole_s + self.to_cloud_s

    @property
    def peak_memory_mb(self) -> float:
        """Largest resident size [MB]."""
        return float(self.summary["peak_memory_mb"])


def can_pin() -> bool:
    """Whether this system can keep a process on one core."""
    return hasattr(os, "sched_setaffinity")


class Runner:
    """Runs cases in fresh processes, whose compiled code it keeps in a folder of its own, model by model.

    So the first run of a model finds nothing compiled, all later ones everything, and the user's caches are left alone.

    Parameters
    ----------
    folder : path
        For the caches and for what runs write, which is thrown away.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.first: dict[str, Run] = {}
        """First use of each model."""

    def measure(self, cases: Sequence[Case], repeats: int, what: str) -> dict[Case, list[Run]]:
        """Run every case so often, all cases in turn; models that were not used yet are first used, apart.

        Raises
        ------
        RunError
            Where a run fails.
        """
        fresh = {
            case.fidelity: case
            for case in reversed(cases)
            if case.fidelity not in self.first and not case.one_core
        }
        runs: dict[Case, list[Run]] = {case: [] for case in cases}
        with tqdm(
            total=len(fresh) + repeats * len(cases), desc=what, unit="run", disable=None
        ) as bar:
            for fidelity, case in reversed(fresh.items()):
                self.first[fidelity] = self.run(case)
                bar.update()
            for _ in range(repeats):
                for case in cases:
                    runs[case].append(self.run(case))
                    bar.update()
        return runs

    def run(self, case: Case) -> Run:
        """One run of a case."""
        with temporary_folder(inside=self._folder) as out:
            written = out / "said.json"
            command = [
                sys.executable,
                "-m",
                "rtradar",
                "run",
                MOTION,
                "--duration",
                str(case.duration_s),
                "--radar",
                case.radar,
            ]
            # Its floors are of the CPU.
            command += [
                "--fidelity",
                case.fidelity,
                "--variant",
                "cpu",
                "--out",
                str(out / "run"),
                "--json",
                str(written),
            ]
            with _on_one_core(case.one_core):
                began = time.perf_counter()
                done = subprocess.run(
                    command,
                    env=self._environment(case.fidelity),
                    capture_output=True,
                    text=True,
                    check=False,
                )
                process_s = time.perf_counter() - began
            if done.returncode != 0:
                lines = done.stderr.strip().splitlines() or [f"ended with status {done.returncode}"]
                raise RunError(f"bench: {case.fidelity}, radar {case.radar}: {lines[-1]}")
            return Run(process_s, json.loads(written.read_text(encoding="utf-8")))

    def _environment(self, fidelity: str) -> dict[str, str]:
        """With caches of compiled code, of Numba and of Dr.Jit, and of fonts in a folder of the model."""
        home = self._folder / fidelity
        home.mkdir(exist_ok=True)
        # Packages that the user installed for himself are found through HOME, unless told otherwise.
        moved = {"HOME": home, "XDG_CACHE_HOME": home / "cache", "NUMBA_CACHE_DIR": home / "numba"}
        return {
            **os.environ,
            "PYTHONUSERBASE": site.getuserbase(),
            **{name: str(place) for name, place in moved.items()},
        }


@contextmanager
def _on_one_core(wanted: bool) -> Iterator[None]:
    """Keep this process, and those that it starts meanwhile, on one core."""
    if not wanted:
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)
