"""Echo power that parts of a body occlude, by four levels, against each part alone.

What a level calls occluded is the power that it lacks of the same level of each part alone, so that
no level is compared with another. `specular` asks one ray a part, `physical-optics` and `reference`
shade facets, and `rays` shoots tubes: they share the tracer, and nothing else. `specular` is all or
nothing at an edge, where the others fade over the Fresnel zone, and is reported. Fields that
diffract may add up: a fraction below 0 is power that others let a part gain. Three recordings are
looked at, or three synthetic motions where none are at hand.

    python validation/other_methods/occluded_power.py [--quick] [--json FILE]
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import rtradar as rt
from rtradar.motion import place
from rtradar.scatter import build_model
from rtradar.scatter.link_budget import link_budget, power_of_parts_alone
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

judged, reported = (partial(kind, key="edge") for kind in (rows.judged, rows.reported))

LEVELS = ("specular", "physical-optics", "rays", "reference")
TAKES = {
    "walk": ("cmu/02_01.amc", "cmu/02.asf", 0.5),
    "kick": ("cmu/135_02.amc", "cmu/135.asf", 1.0),
    "punch": ("cmu/02_05.amc", "cmu/02.asf", 1.0),
}
TOLERANCE = 0.01
"""Of the power. The levels differ by as much of the field at 12 GHz (`whole_bodies.py`), twice that
in power, of which a part is occluded in a few per cent of the time."""


def recordings() -> dict[str, tuple[rt.Motion, float]]:
    """Three recordings, each with the start of an interval [s]; synthetic ones without them."""
    folder = Path(os.environ.get("RTRADAR_MOCAP", "no-recordings"))
    if not folder.is_dir():
        return {name: (rt.synthetic_motion(name, seed=0), 0.5) for name in TAKES}
    return {
        name: (rt.load_motion(folder / take, folder / skeleton), start)
        for name, (take, skeleton, start) in TAKES.items()
    }


def occluded(level: str, radar: rt.Radar, body: rt.Body) -> float:
    """Fraction of the power that parts occlude of each other."""
    n_chirps = radar.chirps_in(body.duration_s)
    alone = power_of_parts_alone(partial(build_model, level, radar), radar, body, n_chirps)
    seen = link_budget(build_model(level, radar, body), radar, body, n_chirps).power_at
    return float(1 - seen.sum() / alone.sum())


def measure(quick: bool) -> Iterator[Row]:
    """Yield the occluded fraction of each level and recording."""
    radar = rt.Radar.preset("paper-12ghz")
    for motion, start in recordings().values():
        body = rt.Body.from_motion(place(motion, start_s=start, duration_s=0.1 if quick else 0.5))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rt.ValidityWarning)
            found = {level: occluded(level, radar, body) for level in LEVELS}
        for level in ("physical-optics", "rays"):
            yield judged(
                f"occluded power, {motion.name}",
                level,
                "",
                found[level],
                TOLERANCE,
                reference=found["reference"],
                says=f"echo power that parts occlude, by `{level}` against `reference`: fraction",
            )
        for level in ("specular", "reference"):
            yield reported(f"occluded power, {motion.name}", level, "", found[level])


def measure_all(quick: bool) -> list[Row]:
    return list(measure(quick))


if __name__ == "__main__":
    sys.exit(main("Echo power that parts of a body occlude, by four levels.", measure_all))
