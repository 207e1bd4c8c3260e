"""What two rules for threads save: the time of a run without each over that with both.

Products of matrices take one thread; in a room the shadow in the clutter is computed beside the
echoes and their tones. Runs are of a walk, in memory, by `specular` with the radar `paper-12ghz`
and clutter removal by the mean, warm, in turn. The median of the ratios of neighbours counts.

    python validation/cost/threads.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import time
from contextlib import AbstractContextManager
from statistics import median
from typing import Any
from unittest import mock

import rtradar as rt
from rtradar.signal import clutter
from rtradar.system import threads
from rtradar.validate.rows import Row, main, reported

REPEATS = 5


def _without() -> dict[str, AbstractContextManager[Any]]:
    return {
        "matrix products by all threads": mock.patch.object(
            threads, "_libraries", mock.MagicMock()
        ),
        "echoes and shadow one after another": mock.patch.object(
            clutter, "begun", lambda work: work
        ),
    }


def seconds(motion: rt.Motion, scene: rt.Scene) -> float:
    began = time.perf_counter()
    radar = rt.Radar.preset("paper-12ghz")
    rt.run(motion, radar, scene, fidelity="specular", clutter_removal="mean")
    return time.perf_counter() - began


def measure(quick: bool) -> list[Row]:
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.15 if quick else 3.0)
    found = []
    for scene in (rt.Scene(), rt.Scene.load("living-room")):
        seconds(motion, scene)
        as_it_is, ratios = list[float](), {name: list[float]() for name in _without()}
        for _ in range(1 if quick else REPEATS):
            as_it_is.append(seconds(motion, scene))
            for name, change in _without().items():
                with change:
                    ratios[name].append(seconds(motion, scene) / as_it_is[-1])
        found.append(reported(scene.name, "time of a run", "s", median(as_it_is)))
        found += [
            reported(scene.name, f"{name}, over that", "1", median(own))
            for name, own in ratios.items()
        ]
    return found


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
