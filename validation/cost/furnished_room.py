"""Time of a furnished room over free space, to the cloud, by `specular`, in one process.

A walk of 3 s in the living room and in free space, with the same clutter removal, after warm-up:
once with a room that has to be traced, and once with the traced room at hand. CPU time of all cores
is reported beside, for a machine that computes something else as well.

    python validation/cost/furnished_room.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import time

import rtradar as rt
from rtradar.bench.runs import to_cloud_s
from rtradar.scatter.clutter import static_clutter
from rtradar.validate.rows import Row, main, reported

FIRST_LIMIT, AGAIN_LIMIT = 2.8, 2.0


def timed(scene: rt.Scene, duration_s: float) -> tuple[float, float]:
    """Time to the cloud, and CPU time of the whole run [s]."""
    motion = rt.synthetic_motion("walk", duration_s=4.0)
    began = time.process_time()
    radar = rt.Radar.preset("paper-12ghz")
    options = {"fidelity": "specular", "duration_s": duration_s, "clutter_removal": "mean"}
    result = rt.run(motion, radar, scene, **options)
    summary = result.summary
    cloud_s = summary.get("cloud_s") or to_cloud_s(summary["stages"], summary["wall_s"])
    return cloud_s, time.process_time() - began


def measure(quick: bool) -> list[Row]:
    duration_s = 0.3 if quick else 3.0
    free, room = rt.Scene(), rt.Scene.load("living-room")
    for scene in (free, room):  # everything is compiled then
        timed(scene, 0.15)
    found: list[Row] = []
    for kind, limit in (("first time", FIRST_LIMIT), ("traced room at hand", AGAIN_LIMIT)):
        if limit == FIRST_LIMIT:
            static_clutter.forget_rooms()
        base, inside = timed(free, duration_s), timed(room, duration_s)
        claim = f"living room over free space, {duration_s:g} s"
        for what, one, other in zip(("to the cloud", "CPU"), inside, base, strict=True):
            quantity = f"{kind}, {what}: {one:.2f} over {other:.2f} s, asked {limit:g}"
            found.append(reported(claim, quantity, "", one / other))
    return found


if __name__ == "__main__":
    sys.exit(main("Time of a furnished room over free space.", measure))
