"""How much longer the first run of each level takes than the second, and what `doctor` takes over.

    python validation/cost/first_use.py [--duration 1] [--json FILE]

Of each level and of a room, two runs are timed as whole processes: in folders for compiled code
and for fonts that are empty, one for each, and in those that ``rtradar doctor`` has filled, one for
all, as after ``make demo``. What the first run takes beyond the second is what first use adds.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from speed_since import CASES as LEVELS_AND_ROOM

from rtradar.bench.runs import with_caches_in

CASES = {"analytic-paper": ("--fidelity", "analytic-paper"), **LEVELS_AND_ROOM}


def timed(words: list[str], home: Path) -> float:
    """Wall-clock time of ``rtradar`` with these words [s], its caches in this folder."""
    command = [sys.executable, "-m", "rtradar", *words]
    began = time.perf_counter()
    done = subprocess.run(command, env=with_caches_in(home), capture_output=True, text=True)
    seconds = time.perf_counter() - began
    if done.returncode:
        raise SystemExit(f"rtradar {' '.join(words)}: {done.stderr.strip()}")
    return seconds


def added(name: str, duration: str, home: Path) -> float:
    """Seconds that the first run of a case takes beyond the second."""
    with tempfile.TemporaryDirectory() as out:
        words = ["run", "synthetic:walk", "--duration", duration, *CASES[name], "--out", out]
        first, second = timed(words, home), timed([*words, "--overwrite"], home)
    return first - second


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--duration", default="1", help="duration of the walk [s] (default: 1)")
    parser.add_argument("--json", type=Path, help="file for all figures")
    options = parser.parse_args()
    found: dict[str, dict[str, float]] = {"doctor": {}}
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        first, second = timed(["doctor"], home), timed(["doctor"], home)
        found["doctor"] = {"first_s": first, "second_s": second}
        print(f"rtradar doctor takes {first:.1f} s, and {second:.1f} s when all is compiled\n")
        print(
            "| level | first use adds, nothing compiled [s] | after `doctor` [s] |\n|---|---|---|"
        )
        for name in CASES:
            after = added(name, options.duration, home)
            with tempfile.TemporaryDirectory() as empty:
                before = added(name, options.duration, Path(empty))
            found[name] = {"nothing_compiled_s": before, "after_doctor_s": after}
            print(f"| {name} | {before:.1f} | {after:.1f} |", flush=True)
    if options.json is not None:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
