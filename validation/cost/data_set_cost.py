"""What a data set costs beside the stages of its runs, and how many samples a second it makes.

    python validation/cost/data_set_cost.py [--repeats 5] [--samples 24] [--against CHECKOUT]
        [--json FILE]

Samples are clouds alone, of synthetic actors for 3 s by `specular`, without pictures and views.
First one process makes some in turn at 12 GHz, after one that compiles: printed are the medians of
the time of a sample, from motion to what is stored, and of its ratio to the sum of the run's stages
to the cloud. Then whole data sets of the paper's 12 GHz radar, without angles, and of a board,
which measures them, are built by one worker and by two, start of the workers included. CHECKOUT is
a folder with another version of the sources, which then builds each data set, too.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Any

from tqdm import tqdm

from rtradar.campaign import kept
from rtradar.campaign.samples import SamplePlan, make_sample, plan_samples
from rtradar.campaign.spec_file import read_spec
from rtradar.clouds.sample_files import write_sample
from rtradar.system.clock import Moment

MOST = 1.05
"""What was asked for: time of a sample over the sum of its stages."""

SPEC = """
angles = {angles}
[windows]
duration_s = 3.0
[each]
fidelity = ["specular"]
radar = ["{radar}"]
[[synthetic]]
label = "walk"
count = {half}
[[synthetic]]
label = "kick"
count = {half}
"""

CHECKOUT = Path(__file__).resolve().parents[2]
BUILD = """import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
if __name__ == "__main__":
    from rtradar.campaign import build_dataset
    report = build_dataset(Path(sys.argv[2]), Path(sys.argv[3]), workers=int(sys.argv[4]))
    print(json.dumps([report["made"], report["wall_s"]]))
"""


def samples_per_s(checkout: Path, spec: Path, out: Path, workers: int) -> float:
    """Build a data set by a version of the sources, and return its samples a second."""
    script = out.with_suffix(".py")
    script.write_text(BUILD)
    command = [sys.executable, script, checkout, spec, out, str(workers)]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    made, wall_s = json.loads(done.stdout.splitlines()[-1])
    return float(made / wall_s)


def seconds_of(plan: SamplePlan, folder: Path) -> tuple[float, float]:
    """Time to make and store a sample without its warm-up, and the sum of its run's stages [s]."""
    captures: list[Any] = []
    prepare = kept.prepare

    def noted(*given: Any) -> Any:
        captures.append(prepare(*given))
        return captures[-1]

    kept.prepare = noted
    try:
        began = Moment.now().work_s
        made = make_sample(plan.packed())
        write_sample(folder, plan.identity, made.sample, made.spatial, made.maps)
        seconds = Moment.now().work_s - began
    finally:
        kept.prepare = prepare
    (capture,) = captures
    return seconds, sum(capture.stages.seconds.values())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5, help="samples in turn (default: 5)")
    parser.add_argument("--samples", type=int, default=24, help="of a data set (default: 24)")
    parser.add_argument("--against", type=Path, help="another checkout, which builds the same")
    parser.add_argument("--json", type=Path, help="write all figures there")
    options = parser.parse_args()
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        plans = {}
        for angles in ("false", "true"):
            spec = folder / f"angles_{angles}.toml"
            values = {"angles": angles, "half": options.samples // 2, "radar": "paper-12ghz"}
            spec.write_text(SPEC.format(**values))
            plans[angles] = plan_samples(read_spec(spec))
        seconds_of(plans["true"][0], folder)  # compiles
        found: dict[str, list[tuple[float, float]]] = {angles: [] for angles in plans}
        for number in tqdm(range(options.repeats), unit="round", disable=None):
            for angles, planned in plans.items():
                found[angles].append(seconds_of(planned[number % len(planned)], folder))
        for angles, pairs in found.items():
            taken, ratio = median(one for one, _ in pairs), median(a / b for a, b in pairs)
            asked = f", {MOST} asked" if angles == "false" else ""
            what = "clouds alone" if angles == "false" else "with angles"
            print(f"{what}: {taken:.2f} s a sample, {ratio:.3f} of its stages{asked}")
            figures[what] = {"sample_s": taken, "over_stages": ratio}
        board = folder / "board.toml"
        board.write_text(SPEC.format(angles="true", half=options.samples // 2, radar="iwr6843"))
        versions = {"now": CHECKOUT}
        if options.against is not None:
            versions = {"before": options.against.resolve(), **versions}
        for what, spec in (("paper-12ghz", folder / "angles_false.toml"), ("iwr6843", board)):
            for workers in (1, 2):
                rates = {}
                for version, checkout in versions.items():
                    out = folder / f"{what}_{workers}_{version}"
                    rates[version] = samples_per_s(checkout, spec, out, workers)
                said = ", ".join(f"{rate:.2f} {version}" for version, rate in rates.items())
                name = f"{what}, {workers} worker{'s' * (workers > 1)}"
                print(f"{name}: samples a second {said}", flush=True)
                figures[name] = {"samples_per_s": rates}
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
