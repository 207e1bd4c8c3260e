"""What a data set costs beside the stages of its runs, and how many samples a second it makes.

    python validation/cost/data_set_cost.py [--repeats 5] [--samples 24] [--json FILE]

Samples are clouds alone, of synthetic actors for 3 s by `specular` at 12 GHz, without angles,
pictures and views. First one process makes some in turn, after one that compiles: printed are the
medians of the time of a sample, from motion to what is stored, and of its ratio to the sum of the
run's stages to the cloud. Then whole data sets are built by one worker and by two, start of the
workers included.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Any

from tqdm import tqdm

from rtradar.campaign import build_dataset, kept
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
[[synthetic]]
label = "walk"
count = {half}
[[synthetic]]
label = "kick"
count = {half}
"""


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
    parser.add_argument("--json", type=Path, help="write all figures there")
    options = parser.parse_args()
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plans = {}
        for angles in ("false", "true"):
            spec = folder / f"angles_{angles}.toml"
            spec.write_text(SPEC.format(angles=angles, half=options.samples // 2))
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
        for workers in (1, 2):
            out = folder / f"by_{workers}"
            report = build_dataset(folder / "angles_false.toml", out, workers=workers)
            rate = report["made"] / report["wall_s"]
            print(f"{workers} worker{'s' * (workers > 1)}: {rate:.2f} samples a second")
            figures[f"{workers} workers"] = {"samples_per_s": rate, "wall_s": report["wall_s"]}
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
