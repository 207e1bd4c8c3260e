"""How long runs take beside those of another checkout, to the range-Doppler-time cloud and as a whole.

    python validation/cost/speed_since.py CHECKOUT [--repeats 7] [--duration 3] [--json FILE]

CHECKOUT is a folder with another version of the sources, such as `git worktree add` makes; both run on the packages of this
Python. Runs of both alternate, each in a process of its own, after one of each that is not counted; told are the medians of the
seconds and of the ratios of neighbours, so that a slow minute falls on both.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

from tqdm import tqdm

from rtradar.bench.times import paired_ratio, to_cloud_s

CASES = {
    "analytic": ("--fidelity", "analytic"),
    "specular": ("--fidelity", "specular"),
    "fresnel": ("--fidelity", "fresnel"),
    "physical-optics": ("--fidelity", "physical-optics"),
    "auto": ("--fidelity", "auto"),
    "specular, mean removed": ("--fidelity", "specular", "--clutter-removal", "mean"),
    "specular, living-room": ("--fidelity", "specular", "--scene", "living-room"),
}
RUN = "import sys; sys.path.insert(0, sys.argv.pop(1)); from rtradar.cli import main; sys.exit(main())"


def seconds(checkout: Path, words: list[str], folder: Path) -> tuple[float, float]:
    """To the cloud, and the whole run after its warm-up [s]."""
    told = folder / "summary.json"
    with tempfile.TemporaryDirectory(dir=folder) as out:
        command = [
            sys.executable,
            "-P",
            "-c",
            RUN,
            str(checkout),
            "run",
            *words,
            "--out",
            out,
            "--json",
            str(told),
        ]
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    if done.returncode:
        raise SystemExit(f"{checkout}: {' '.join(words)}: {done.stderr.strip()}")
    summary = json.loads(told.read_text())
    return to_cloud_s(summary["stages"], summary["wall_s"]), summary["wall_s"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkout", type=Path, help="folder of another version")
    parser.add_argument("--repeats", type=int, default=7, help="pairs of runs (default: 7)")
    parser.add_argument("--duration", default="3", help="of the walk [s] (default: 3)")
    parser.add_argument(
        "--only", nargs="+", choices=CASES, default=list(CASES), help="cases (default: all)"
    )
    parser.add_argument("--json", type=Path, help="write all seconds there")
    options = parser.parse_args()
    checkouts = (options.checkout.resolve(), Path(__file__).resolve().parents[2])
    found: dict[str, list[list[tuple[float, float]]]] = {}
    print(
        f"{'':26} {'to the cloud, before, now [s]':>30} {'ratio':>7} {'whole run, before, now [s]':>30} {'ratio':>7}"
    )
    for name in options.only:
        words = ["synthetic:walk", "--duration", options.duration, *CASES[name]]
        with tempfile.TemporaryDirectory() as folder:
            rounds = [
                [seconds(checkout, words, Path(folder)) for checkout in checkouts]
                for _ in tqdm(range(options.repeats + 1), desc=name, disable=None)
            ][1:]
        found[name] = rounds
        line = f"{name:26}"
        for which in (0, 1):
            before, after = ([pair[version][which] for pair in rounds] for version in (0, 1))
            line += (
                f" {median(before):15.2f} {median(after):14.2f} {paired_ratio(after, before):7.3f}"
            )
        print(line, flush=True)
    if options.json is not None:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
