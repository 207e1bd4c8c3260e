"""Every level in every scene, with every antenna, multiplexing, material and company.

A cell of the matrix is one whole run in memory, of 0.05 s by a small radar, whose maps must be
finite and hold power. Cells are chosen so that any two values of two factors meet in one of them (a
pairwise array, made greedily with a fixed seed); without ``--quick`` all cells follow, of the
levels that are quick, a process to each core. Nothing in the matrix is forbidden by physics: a cell
that is refused or fails is named on stderr.

    python validation/robustness/matrix.py [--quick] [--json FILE]
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
import random
import sys
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import rtradar as rt
from rtradar.errors import InputError
from rtradar.system.threads import thread_environment
from rtradar.validate.rows import Row, judged, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import patch_antenna

DURATION_S = 0.05
SLOW = ("rays", "reference")
FACTORS: dict[str, tuple[str, ...]] = {
    "level": (
        "analytic-paper", "analytic", "specular", "physical-optics", "auto", *SLOW,
    ),
    "scene": ("free-space", "living-room", "corridor", "behind-plasterboard"),
    "antenna": ("isotropic", "patch"),
    "multiplexing": ("tdm", "fdm", "ddm"),
    "material": ("perfect-conductor", "skin"),
    "who": ("one", "two", "fan"),
}  # fmt: skip

Cell = dict[str, str]


def pairwise(factors: dict[str, tuple[str, ...]], seed: int = 0) -> list[Cell]:
    """Cells in which any two values of two factors meet, few of them: the best of many drawn."""
    rng, names = random.Random(seed), tuple(factors)
    missing = {
        ((a, x), (b, y))
        for a, b in itertools.combinations(names, 2)
        for x, y in itertools.product(factors[a], factors[b])
    }

    def pairs(cell: Cell) -> set[tuple[tuple[str, str], tuple[str, str]]]:
        return missing.intersection(itertools.combinations(cell.items(), 2))

    chosen = []
    while missing:
        # One pair that is missing, and all else drawn.
        must = dict(min(missing))
        drawn = [{n: must.get(n, rng.choice(factors[n])) for n in names} for _ in range(300)]
        chosen.append(max(drawn, key=lambda cell: len(pairs(cell))))
        missing -= pairs(chosen[-1])
    return chosen


def whole_product(factors: dict[str, tuple[str, ...]]) -> list[Cell]:
    return [
        dict(zip(factors, values, strict=True)) for values in itertools.product(*factors.values())
    ]


@cache
def motion(activity: str) -> rt.Motion:
    return rt.synthetic_motion(activity, seed=0, duration_s=2 * DURATION_S)


def company(who: str, scene: rt.Scene) -> Any:
    """One person where the scene puts them, another half a metre behind, or a fan beside them."""
    x, y = scene.person_position_m
    first = rt.Person(motion("walk"), (x, y), scene.heading_deg)
    if who == "two":
        return [first, rt.Person(motion("kick"), (x + 0.5, y + 0.3), scene.heading_deg)]
    if who == "fan":
        turning = rt.Turning(rate_hz=5.0)
        return [
            first, rt.Object("fan", "fan", "metal", position_m=(x, y + 0.8, 1.0), motion=turning)
        ]  # fmt: skip
    return first


def radar(cell: Cell) -> rt.Radar:
    element = patch_antenna() if cell["antenna"] == "patch" else None
    return rt.Radar(
        name="small",
        bandwidth_hz=1e9,
        chirp_duration_s=250e-6,
        samples_per_chirp=64,
        tx_y=2,
        tx_z=1,
        rx_y=2,
        rx_z=2,
        channels="all",
        frame_duration_s=0.02,
        frame_hop_s=0.02,
        multiplexing=cell["multiplexing"],  # type: ignore[arg-type]
        tx_antenna=element,
        rx_antenna=element,
    )


def trouble_of(cell: Cell) -> tuple[str, str]:
    """What is wrong with a cell: nothing, "refused" or "failed", and why."""
    scene = rt.Scene.load(cell["scene"])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = rt.run(
                company(cell["who"], scene),
                radar(cell),
                scene,
                fidelity=cell["level"],
                body_material=cell["material"],
                duration_s=DURATION_S,
                order=1,
            )
        except InputError as error:
            return "refused", str(error)
        except Exception as error:  # whatever goes wrong is what is looked for here
            return "failed", f"{type(error).__name__}: {error}"
    for name in ("range_doppler", "range_time"):
        power = found.maps[name].values
        if not power.size or not np.isfinite(power).all() or not power.any():
            return "failed", f"{name} of shape {power.shape} is empty or not finite"
    return "", ""


def rows_of(name: str, cells: Sequence[Cell], found: Iterable[tuple[str, str]]) -> list[Row]:
    """Name what went wrong in each cell, by `trouble_of`, on stderr, and count it."""
    counts = Counter[str]()
    for number, (cell, (kind, why)) in enumerate(zip(cells, found, strict=True), 1):
        if number % 100 == 0:
            print(f"{name}: {number} of {len(cells)}", file=sys.stderr, flush=True)
        if kind:
            counts[kind] += 1
            print(f"{kind}, {number} {' '.join(cell.values())}: {why}", file=sys.stderr, flush=True)
    rows = [
        judged(
            name,
            f"cells {kind}",
            "cells",
            counts[kind],
            0.0,
            cases=len(cells),
            says=f"cells of the matrix of levels, scenes, antennas and company that {do}",
        )
        for kind, do in (("refused", "are refused"), ("failed", "fail"))
    ]
    return [*rows, reported(name, "cells run", "cells", float(len(cells)))]


def measure(quick: bool) -> list[Row]:
    if quick:
        few = {name: values for name, values in FACTORS.items() if name != "level"}
        few["level"] = ("analytic", "specular")
        array = pairwise(few)
        return rows_of("two levels, pairwise", array, map(trouble_of, array))
    array = pairwise(FACTORS)
    quick_levels = tuple(level for level in FACTORS["level"] if level not in SLOW)
    product = whole_product(FACTORS | {"level": quick_levels})
    os.environ.update(thread_environment(1))  # of the processes, one to a core
    # Started anew, because threads do not follow into a forked process.
    pool = ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn"))
    try:
        first, then = pool.map(trouble_of, array), pool.map(trouble_of, product)
        return [
            *rows_of("all levels, pairwise", array, first),
            *rows_of("quick levels, all cells", product, then),
        ]
    finally:
        pool.shutdown(cancel_futures=True)  # an interrupt does not wait for all cells


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
