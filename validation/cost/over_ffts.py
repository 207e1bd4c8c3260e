"""How many times longer runs take than SciPy's FFTs of the same size would, to the cloud and after.

    python validation/cost/over_ffts.py [--repeats 5] [--duration 3] [--json FILE]

The FFTs are those of range, one of each chirp at each receiver, and of Doppler, one of each frame,
channel and range bin, in complex64, by as many threads as there are cores. They and runs take
turns, each run in a process of its own; printed are the medians of the ratios of each round.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
import scipy.fft
from tqdm import tqdm

from rtradar.bench.runs import Case, Runner
from rtradar.radar import Radar

CASES = {
    ("paper-12ghz", "analytic"): (1.0, 1.2),
    ("paper-12ghz", "specular"): (1.4, 1.2),
    ("paper-12ghz", "physical-optics"): (3.5, 1.2),
    ("paper-77ghz", "specular"): (None, None),
}
"""Radar and level, and what was asked for: times of SciPy's FFTs, to the cloud and after it."""

MOST_OF_77_GHZ = 2.8
"""What was asked for `specular` at 77 GHz to the cloud, relative to 12 GHz."""


def ffts_s(radar: Radar, duration_s: float) -> float:
    """Time of the FFTs of range and Doppler of a capture [s], window by window."""
    cycles, samples, channels = radar.cycles_per_frame, radar.samples_per_chirp, radar.n_channels
    noise = np.random.default_rng(0).standard_normal((2, channels, cycles, samples))
    frame = (noise[0] + 1j * noise[1]).astype(np.complex64)
    frames = int(duration_s / radar.frame_duration_s)
    windows = 1 + int((duration_s - radar.frame_duration_s) / radar.frame_hop_s + 1e-6)
    began = time.perf_counter()
    for _ in range(frames):
        spectra = scipy.fft.fft(frame, axis=2, workers=os.cpu_count())
    by_bin = np.ascontiguousarray(spectra.transpose(0, 2, 1))  # the faster layout
    range_s, began = time.perf_counter() - began, time.perf_counter()
    for _ in range(windows):
        scipy.fft.fft(by_bin, axis=2, workers=os.cpu_count())
    return range_s + time.perf_counter() - began


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5, help="rounds (default: 5)")
    parser.add_argument("--duration", type=float, default=3.0, help="length of a walk [s]")
    parser.add_argument("--json", type=Path, help="write all seconds there")
    options = parser.parse_args()
    cases = {key: Case(*key, options.duration) for key in CASES}
    seconds: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as folder:
        runner = Runner(Path(folder))
        for case in cases.values():
            runner.run(case)  # compiles
        for _ in tqdm(range(options.repeats), unit="round", disable=None):
            for radar in dict.fromkeys(radar for radar, _ in CASES):
                own = ffts_s(Radar.preset(radar), options.duration)
                seconds.setdefault(f"{radar}, FFTs", []).append(own)
            for (radar, level), case in cases.items():
                run = runner.run(case)
                for what, value in (
                    ("to", run.to_cloud_s),
                    ("after", run.whole_s - run.to_cloud_s),
                ):
                    seconds.setdefault(f"{radar}, {level}, {what}", []).append(value)
    print(f"{'':44}{'median [s]':>12}{'over FFTs':>11}{'asked':>7}")
    for name, found in seconds.items():
        ratio = ratio_of(found, seconds[f"{name.split(', ')[0]}, FFTs"])
        radar, level, what = (*name.split(", "), "")[:3]
        asked = CASES.get((radar, level), (None, None))[what == "after"] or "-"
        print(f"{name:44}{median(found):12.2f}{ratio:11.2f}{asked:>7}")
    high, low = (seconds[f"paper-{band}ghz, specular, to"] for band in (77, 12))
    print(
        f"specular to the cloud, 77 over 12 GHz: {ratio_of(high, low):.2f}, {MOST_OF_77_GHZ} asked"
    )
    if options.json is not None:
        options.json.write_text(json.dumps(seconds, indent=1))
    return 0


def ratio_of(one: list[float], other: list[float]) -> float:
    """Median of the ratios of the same rounds."""
    return median(a / b for a, b in zip(one, other, strict=True))


if __name__ == "__main__":
    sys.exit(main())
