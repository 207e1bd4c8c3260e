"""What it costs if matrix products take all threads: time of a run with these over that with one.

Runs of a walk in memory by `specular` with the paper's radar at 12 GHz and clutter removal by the
mean, warm, in turn. The median of the ratios of neighbours counts.

    python validation/cost/threads.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import time
from contextlib import nullcontext
from statistics import median
from typing import Any
from unittest import mock

import rtradar as rt
from rtradar.system import threads
from rtradar.validate.rows import Row, main, reported

REPEATS = 5


class _Unlimited:
    """Stands for the libraries of matrix products, and leaves them their threads."""

    def limit(self, **options: Any) -> Any:
        return nullcontext()


def seconds(motion: rt.Motion, scene: rt.Scene) -> float:
    began = time.perf_counter()
    radar = rt.Radar.preset("paper-12ghz")
    rt.run(motion, radar, scene, fidelity="specular", clutter_removal="mean")
    return time.perf_counter() - began


def measure(quick: bool) -> list[Row]:
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.5 if quick else 3.0)
    found = []
    for scene in (rt.Scene(), rt.Scene.load("living-room")):
        seconds(motion, scene)
        one, all_threads = list[float](), list[float]()
        for _ in range(2 if quick else REPEATS):
            one.append(seconds(motion, scene))
            with mock.patch.object(threads, "_libraries", _Unlimited):
                all_threads.append(seconds(motion, scene))
        ratio = median(many / own for many, own in zip(all_threads, one, strict=True))
        found += [
            reported(scene.name, "time of a run", "s", median(one)),
            reported(scene.name, "matrix products by all threads, over that", "1", ratio),
        ]
    return found


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
