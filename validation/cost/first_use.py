"""What first use costs: CPU time of first runs beyond the second, and of each function's compiling.

Runs are of a walk of 1 s, each a process of its own, which begins with caches of compiled code and
of fonts that are empty, and then with those that the first has filled. Functions are compiled by
one process that runs all levels and a room in turn; a function is named with all that it takes in
and that no function before it needed. `rtradar doctor` is timed by the clock.

    python validation/cost/first_use.py [--duration 1] [--json FILE]
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from numba.core import event
from speed_since import CASES, children_s

from rtradar.bench.runs import with_caches_in
from rtradar.validate.rows import Row, judged, reported, table

MOST_S = {"specular": 6.0, "specular, living-room": 14.0}
ALL_S, FUNCTION_S, DOCTOR_S = 45.0, 4.0, 5.0
_FUNCTIONS = "functions"


class Compiling(event.Listener):
    """CPU time [s] of each function that Python calls, in ``seconds`` by name."""

    def __init__(self) -> None:
        self.seconds: Counter[str] = Counter()
        self._depth, self._began = 0, 0.0

    def on_start(self, _: event.Event) -> None:
        if not self._depth:
            self._began = time.process_time()
        self._depth += 1

    def on_end(self, ended: event.Event) -> None:
        self._depth -= 1
        if not self._depth:
            function = ended.data["dispatcher"].py_func
            name = f"{function.__module__}.{function.__qualname__}"
            self.seconds[name] += time.process_time() - self._began


def compile_all(runs: list[list[str]]) -> int:
    """Do these runs in this process, and print the CPU time of each function as JSON."""
    from rtradar.cli import main as rtradar

    with event.install_listener("numba:compile", Compiling()) as compiling:
        for words in runs:
            rtradar(words)
    print(json.dumps(compiling.seconds))
    return 0


def run(words: list[str], home: Path) -> tuple[str, float, float]:
    """Run Python with caches in a folder; return what it said, and its time and CPU time [s]."""
    began, used_s = time.perf_counter(), children_s()
    done = subprocess.run(
        [sys.executable, *words], env=with_caches_in(home), capture_output=True, text=True
    )
    if done.returncode:
        raise SystemExit(f"{' '.join(words)}: {done.stderr.strip()}")
    return done.stdout, time.perf_counter() - began, children_s() - used_s


def measure(duration: str) -> list[Row]:
    rows: list[Row] = []
    walk = ["run", "synthetic:walk", "--duration", duration, "--overwrite", "--out"]
    for name, options in CASES.items():
        with tempfile.TemporaryDirectory() as folder:
            words, home = ["-m", "rtradar", *walk, f"{folder}/out", *options], Path(folder)
            first, second = (run(words, home)[2] for _ in range(2))
        what: Any = (name, "CPU of the first run beyond the second", "s", first - second)
        rows.append(judged(*what, MOST_S[name]) if name in MOST_S else reported(*what))
    with tempfile.TemporaryDirectory() as folder:
        runs = [[*walk, f"{folder}/out", *options] for options in CASES.values()]
        said, _, _ = run([__file__, _FUNCTIONS, json.dumps(runs)], Path(folder))
        doctor_s = run(["-m", "rtradar", "doctor"], Path(folder))[1]
    seconds = json.loads(said.splitlines()[-1])
    rows.append(judged("all functions", "CPU", "s", sum(seconds.values()), ALL_S))
    slowest_first = sorted(seconds, key=seconds.__getitem__, reverse=True)
    rows += [judged(name, "CPU", "s", seconds[name], FUNCTION_S) for name in slowest_first]
    rows.append(judged("rtradar doctor", "time", "s", doctor_s, DOCTOR_S))
    return rows


def main() -> int:
    if sys.argv[1:2] == [_FUNCTIONS]:
        return compile_all(json.loads(sys.argv[2]))
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--duration", default="1", help="duration of the walk [s] (default: 1)")
    parser.add_argument("--json", type=Path, help="file for all figures")
    options = parser.parse_args()
    rows = measure(options.duration)
    print(table(rows))
    if options.json is not None:
        options.json.write_text(json.dumps([dataclasses.asdict(row) for row in rows]) + "\n")
    return int(not all(row.passed for row in rows))


if __name__ == "__main__":
    sys.exit(main())
