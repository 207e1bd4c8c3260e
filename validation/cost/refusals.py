"""How long the command line takes to show a help text, and to refuse what cannot be used.

    python validation/cost/refusals.py [--repeats 10]

Printed is the median of each command's wall-clock time, with the start of Python, beside that of
Python alone. The commands take turns. Python keeps compiled modules, as it does by default, in a
folder that is removed at the end; the first round, which compiles them, does not count.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

RUN = ("run", "synthetic:walk", "--out", "out")
COMMANDS = (
    ((), 0),
    (("--help",), 0),
    (("--version",), 0),
    (("run", "--help"), 0),
    ((*RUN, "--fidelty", "analytic"), 2),
    ((*RUN, "--seed", "one"), 2),
    ((*RUN, "--pfa", "3"), 2),
    ((*RUN, "--radar", "paper-13ghz"), 2),
    ((*RUN, "--scene", "moon"), 2),
    ((*RUN, "--fidelity", "perfect"), 2),
    ((*RUN, "--radar", "damaged.toml"), 2),
    ((*RUN, "--scene", "damaged.toml"), 2),
    (("run", "synthetic:fly", "--out", "out"), 2),
    (("run", "none.bvh", "--out", "out"), 2),
    (("compare", "none.bvh", "--out", "out"), 2),
    (("view", "none"), 2),
)
"""Arguments of ``rtradar``, and the exit status that they have."""


def timed(words: list[str], folder: str, status: int, environment: dict[str, str]) -> float:
    """Wall-clock time of a command [s]; ValueError if it ends with another status."""
    began = time.perf_counter()
    done = subprocess.run(
        words, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    seconds = time.perf_counter() - began
    if done.returncode != status:
        raise ValueError(f"{' '.join(words)}: status {done.returncode}; {done.stderr}")
    return seconds


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=10, help="rounds (default: 10)")
    repeats = parser.parse_args().repeats
    python = [sys.executable, "-c", "pass"]
    named = {"(Python alone)": (python, 0)} | {
        " ".join(["rtradar", *words]): ([sys.executable, "-m", "rtradar", *words], status)
        for words, status in COMMANDS
    }
    found: dict[str, list[float]] = {name: [] for name in named}
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "damaged.toml").write_text("bandwidth_hz : 4e9\n", encoding="utf-8")
        environment = os.environ | {"PYTHONPYCACHEPREFIX": str(Path(folder) / "compiled")}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        for turn in range(repeats + 1):
            for name, (words, status) in named.items():
                seconds = timed(words, folder, status, environment)
                if turn:  # the first one compiles, and reads files from the disk
                    found[name].append(seconds)
    for name, seconds in found.items():
        print(f"{median(seconds):6.3f} s  {name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
