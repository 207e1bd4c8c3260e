"""The cost of a furnished room over free space, and of two people over one.

Runs of a walk in memory, from motion to cloud, by `specular` with the paper's radar at 12 GHz and
clutter removal by the mean on both sides, in turn after a warm-up; of the ratios of each turn the
median counts, by the clock and by the processor's time, which other programs disturb less. A room
is new where the radar stands a micrometre from where it stood before: then nothing that was traced
can be used again. With --quick nothing is measured: in half a second what a run costs once would
weigh too much for a limit.

    python validation/cost/room_cost.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import rtradar as rt
from rtradar.validate.rows import Row, judged, leave_out, main, reported

REPEATS = 5
MOST_NEW, MOST_KNOWN, MOST_PEOPLE = 2.8, 2.0, 2.1
ROOM = "living-room"


def seconds(who: object, scene: rt.Scene) -> np.ndarray:
    """Time of a run [s], by the clock and by the processor."""
    began, used = time.perf_counter(), time.process_time()
    rt.run(who, rt.Radar.preset("paper-12ghz"), scene, fidelity="specular", clutter_removal="mean")
    return np.array([time.perf_counter() - began, time.process_time() - used])


def turns(walk: rt.Motion, two: list[rt.Person], room: rt.Scene, count: int) -> np.ndarray:
    """Times of runs (turn, kind, 2): free space, the room traced before and new, two people [s]."""
    found, (x, y, z) = [], room.radar_position_m
    for turn in range(count + 1):
        new = replace(room, radar_position_m=(x, y, z + 1e-6 * (turn + 1)))
        runs = (walk, rt.Scene()), (walk, room), (walk, new), (two, room)
        found.append([seconds(*run) for run in runs])
    return np.array(found[1:])


def cost_rows(walk: rt.Motion, claim: str) -> Iterator[Row]:
    room = rt.Scene.load(ROOM)
    x, y = room.person_position_m[:2]
    # Both walk side by side.
    two = [rt.Person(walk, (x, y + side)) for side in (0.6, -0.6)]
    times = turns(walk, two, room, REPEATS)
    free, known, new, people = np.moveaxis(times, 1, 0)
    says = "a furnished room over free space, motion to cloud by `specular`: "
    for number, clock in enumerate(("clock", "processor")):
        yield reported(claim, f"free space, {clock}", "s", float(np.median(free[:, number])))
    for what, ours, base, most, words in (
        ("room over free space, traced before", known, free, MOST_KNOWN, says + "traced before"),
        ("room over free space, new", new, free, MOST_NEW, says + "new"),
        (
            "two people over one in the room",
            people,
            known,
            MOST_PEOPLE,
            "two people over one in a furnished room, motion to cloud by `specular`",
        ),
    ):
        ratio, processor = np.median(ours / base, axis=0).tolist()
        yield judged(claim, what, "1", ratio, most, says=words)
        yield reported(claim, f"{what}, processor", "1", processor)


def measure(quick: bool) -> list[Row]:
    if quick:
        leave_out("the cost of rooms", "a run without --quick")
        return []
    return list(cost_rows(rt.synthetic_motion("walk", seed=0, duration_s=3.0), "a walk of 3 s"))


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
