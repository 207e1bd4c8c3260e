"""Reflections from part to part: against full wave on pairs of spheres, and `rays` on a walker.

Spheres of 5 cm, 2 and 10 cm apart, are seen at 4 m and 12 GHz from 20 to 90 degrees off their axis,
V and H. The truth is `full-wave`, which ``full_wave.py`` holds against multipoles. The error of an
aspect is that of the complex field over its size; its mean at 40 to 90 degrees may be at most half
of what one reflection leaves. At 20 and 30 degrees one sphere shades the other.

A walker is seen at several instants over 12 to 16 GHz by `rays` with two bounces. The sum of
squares over instants and frequencies says how much power two bounces have over one, and how far
`specular` is from `rays`. Most of that is the creases between parts that touch, which `specular`
leaves out; what it would have with them is measured, too.

What they cost is the CPU time of the echoes of 96 channels over that of single reflections, the
least of three in turn.

    python validation/other_methods/double_reflections.py [--quick] [--json FILE]
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Iterator
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.echoes import Echoes
from rtradar.scatter import build_model
from rtradar.scatter.common.interpolation import interpolation_weights
from rtradar.scatter.double_reflections import LEAST_DB, DoubleReflections
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import rms
from levels_against_full_wave import Polarization, antennas, field

Complex = NDArray[np.complex128]
judged, reported = (
    partial(kind, key="double-reflections") for kind in (rows.judged, rows.reported)
)

LEVELS = ("specular", "fresnel", "physical-optics")
ASPECTS_DEG = np.array([20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0])
SPHERE_M, FREQUENCY_HZ = 0.05, 12e9
C = 299_792_458.0


def pair_errors(
    gap: float, polarization: Polarization, quick: bool
) -> dict[tuple[str, int], Complex]:
    """Complex error of each aspect over the size of the field, by level and bounces."""
    apart = SPHERE_M + gap / 2
    pair = rt.Ellipsoids(
        [[0, 0, apart], [0, 0, -apart]], [np.eye(3)] * 2, np.full((2, 3), SPHERE_M)
    )
    at = antennas(tuple(ASPECTS_DEG[::3] if quick else ASPECTS_DEG))
    given = pair, at, FREQUENCY_HZ
    truth = field(*given, "full-wave", polarization)
    return {
        (level, n): np.abs(field(*given, level, polarization, bounces=n) / truth - 1)
        for level, n in product(LEVELS, (1, 2))
    }


def pair_rows(quick: bool) -> Iterator[Row]:
    steep = (ASPECTS_DEG[::3] if quick else ASPECTS_DEG) >= 40
    gathered: dict[tuple[str, int], list[Complex]] = {}
    for gap, polarization in product((0.02, 0.10), ("v", "h")):
        for (level, bounces), error in pair_errors(gap, polarization, quick).items():
            gathered.setdefault((level, bounces), []).append(error)
            claim = f"spheres, gap {100 * gap:g} cm, {polarization.upper()}, `{level}`"
            name = f"complex error, {bounces} reflection{'s' if bounces > 1 else ''}"
            yield reported(claim, f"{name}, 40 to 90 degrees", "%", 100 * error[steep].mean())
            yield reported(claim, f"{name}, 20 and 30 degrees", "%", 100 * error[~steep].mean())
    for level in LEVELS:
        one, both = (
            float(np.mean([error[steep] for error in gathered[level, bounces]]))
            for bounces in (1, 2)
        )
        says = "reflections from part to part on pairs of spheres, against full wave"
        what = "mean complex error at 40 to 90 degrees over that of one reflection"
        count = sum(steep) * len(gathered[level, 1])
        yield judged(f"all pairs, `{level}`", what, "", both / one, 0.5, says=says, cases=count)
        yield reported(f"all pairs, `{level}`", "mean complex error, 40 to 90 degrees", "", both)


def by_bounces(echoes: Echoes, frequency: NDArray[np.float64]) -> dict[int, Complex]:
    """Field (frequency, chirp, rx) of the echoes of each number of bounces."""
    weights = interpolation_weights(echoes.frequency, frequency)
    turns = np.exp(2j * np.pi / C * frequency[:, None, None, None] * echoes.length)
    fields = np.tensordot(weights, echoes.amplitude, axes=1) * turns
    return {n: fields[..., echoes.bounces == n].sum(axis=-1) for n in (1, 2)}


def walker_rows(quick: bool) -> Iterator[Row]:
    array = {"tx_y": 1, "tx_z": 0, "rx_y": 1, "rx_z": 0}
    radar = dataclasses.replace(rt.Radar.preset("paper-12ghz"), **array)
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=1.5))
    instants = 2 if quick else 24
    times = (np.arange(instants) + 0.5) / instants * body.duration_s
    chirps = np.round(times / radar.chirp_interval_s).astype(np.int64)
    frequency = radar.start_frequency_hz + radar.bandwidth_hz * np.linspace(0, 1, 33)
    coarse = {"rays_per_wavelength": 2.5} if quick else {}
    rays = by_bounces(
        build_model("rays", radar, body, bounces=2, **coarse).echoes(chirps), frequency
    )
    truth = rays[1] + rays[2]
    single = build_model("specular", radar, body).echoes(chirps)
    tracer = BodyTracer(use(select("auto")), body.semi_axes)
    claim = "walker, two bounces"
    yield reported(
        claim, "power over one bounce, `rays`", "dB", 20 * np.log10(rms(truth) / rms(rays[1]))
    )
    one = by_bounces(single, frequency)[1]
    yield reported(
        claim, "`specular`, one bounce, to `rays`", "%", 100 * rms(one - truth) / rms(truth)
    )
    for name, touching, least in (
        ("as it is", False, LEAST_DB),
        ("all that do not touch", False, -60.0),
        ("with those that touch", True, -60.0),
    ):
        doubles = DoubleReflections(radar, body, tracer, touching=touching, least_db=least)
        found = by_bounces(doubles.beside(single, chirps), frequency)
        whole = found[1] + found[2]
        gain, away = 20 * np.log10(rms(whole) / rms(found[1])), rms(whole - truth) / rms(truth)
        alike = abs(np.vdot(found[2], rays[2])) / np.linalg.norm(found[2]) / np.linalg.norm(rays[2])
        yield reported(claim, f"pairs, {name}", "", float(len(doubles.pairs)))
        yield reported(claim, f"power over one bounce, `specular`, {name}", "dB", gain)
        yield reported(claim, f"`specular` to `rays`, {name}", "%", 100 * away)
        yield reported(claim, f"correlation of second bounces, {name}", "", alike)


def cost_rows(quick: bool) -> Iterator[Row]:
    radar = rt.Radar.preset("paper-12ghz")
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=1.5))
    models = {n: build_model("specular", radar, body, bounces=n) for n in (1, 2)}
    chirps = np.arange(800 if quick else 6400)
    spent = dict.fromkeys(models, np.inf)
    for _ in range(4):  # the first compiles
        for bounces, model in models.items():
            began = time.process_time()
            for block in np.array_split(chirps, len(chirps) // 800):
                model.echoes(block)
            spent[bounces] = min(spent[bounces], time.process_time() - began)
    quantity = "CPU time of echoes, two bounces over one"
    yield reported("walker, `specular`, 96 channels", quantity, "", spent[2] / spent[1])


def measure(quick: bool) -> list[Row]:
    return [*pair_rows(quick), *walker_rows(quick), *cost_rows(quick)]


if __name__ == "__main__":
    sys.exit(main("Reflections from part to part.", measure))
