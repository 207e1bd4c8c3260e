"""Compare the time, first use and memory of runs with those of another checkout.

    python validation/cost/speed_since.py CHECKOUT [--repeats 7] [--duration 3] [--json FILE]

CHECKOUT is a folder with another version of the sources, such as `git worktree add` makes. Both
versions use the packages of this Python. Their runs alternate, each in a process of its own, after
one run of each that is not counted. The table has medians, and the median of the ratios of
neighbouring runs, so that a slow minute of the machine falls on both. The CPU time is that of the
whole process and of all that it starts, with its imports, which a loaded machine changes least.

With `--first-use` every process begins with an empty cache of compiled code, and the columns are
the seconds of the whole process and its peak memory.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

from tqdm import tqdm

from rtradar.bench.runs import paired_ratio
from rtradar.pipeline.timing import to_cloud_s

CASES = {
    "analytic": ("--fidelity", "analytic"),
    "specular": ("--fidelity", "specular"),
    "physical-optics": ("--fidelity", "physical-optics"),
    "auto": ("--fidelity", "auto"),
    "specular, mean removed": ("--fidelity", "specular", "--clutter-removal", "mean"),
    "specular, living-room": ("--fidelity", "specular", "--scene", "living-room"),
    "specular, 77 GHz": ("--fidelity", "specular", "--radar", "paper-77ghz"),
    "specular, board": ("--fidelity", "specular", "--radar", "iwr6843"),
}
RUN = """import sys
sys.path.insert(0, sys.argv.pop(1))
from rtradar.cli import main
sys.exit(main())"""
WARM = ("to the cloud [s]", "whole run [s]", "CPU [s]", "peak memory [MB]")
FIRST_USE = ("whole process [s]", "peak memory [MB]")


def measure(checkout: Path, words: list[str], folder: Path, first_use: bool) -> tuple[float, ...]:
    """Run once; return the figures that `WARM` or `FIRST_USE` name."""
    summary_file = folder / "summary.json"
    with tempfile.TemporaryDirectory(dir=folder) as out, tempfile.TemporaryDirectory() as cache:
        command = [sys.executable, "-P", "-c", RUN, str(checkout), "run", *words]
        command += ["--out", out, "--json", str(summary_file)]
        environment = os.environ | ({"NUMBA_CACHE_DIR": cache} if first_use else {})
        began, used_s = time.perf_counter(), children_s()
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, cwd=folder, env=environment
        )
        whole_s, used_s = time.perf_counter() - began, children_s() - used_s
    if done.returncode:
        raise SystemExit(f"{checkout}: {' '.join(words)}: {done.stderr.strip()}")
    summary = json.loads(summary_file.read_text())
    peak_mb = summary["peak_memory_mb"]
    if first_use:
        return whole_s, peak_mb
    return to_cloud_s(summary["stages"], summary["wall_s"]), summary["wall_s"], used_s, peak_mb


def children_s() -> float:
    """CPU time of all processes that were started and have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkout", type=Path, help="folder of another version")
    parser.add_argument("--repeats", type=int, default=7, help="pairs of runs (default: 7)")
    parser.add_argument("--duration", default="3", help="duration of the walk [s] (default: 3)")
    parser.add_argument("--first-use", action="store_true", help="with an empty cache each time")
    parser.add_argument(
        "--only", nargs="+", choices=CASES, default=list(CASES), help="cases (default: all)"
    )
    parser.add_argument("--json", type=Path, help="file for all figures")
    options = parser.parse_args()
    checkouts = (options.checkout.resolve(), Path(__file__).resolve().parents[2])
    quantities = FIRST_USE if options.first_use else WARM
    found: dict[str, list[list[tuple[float, ...]]]] = {}
    print("| | " + " | ".join(f"{name}: before | now | ratio" for name in quantities) + " |")
    print("|---" * (1 + 3 * len(quantities)) + "|")
    for name in options.only:
        words = ["synthetic:walk", "--duration", options.duration, *CASES[name]]
        with tempfile.TemporaryDirectory() as folder:
            rounds = [
                [measure(each, words, Path(folder), options.first_use) for each in checkouts]
                for _ in tqdm(range(options.repeats + 1), desc=name, disable=None)
            ][1:]
        found[name] = rounds
        cells = [name]
        for which in range(len(quantities)):
            before, now = ([pair[version][which] for pair in rounds] for version in (0, 1))
            cells += [f"{median(before):.4g}", f"{median(now):.4g}"]
            cells += [f"{paired_ratio(now, before):.3f}"]
        print("| " + " | ".join(cells) + " |", flush=True)
    if options.json is not None:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
