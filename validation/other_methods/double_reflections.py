"""Reflections from part to part: against full wave on pairs of spheres, and `rays` on a walker.

Spheres of 5 cm, 2 and 10 cm apart, are seen at 4 m and 12 GHz from 20 to 90 degrees off their axis,
V and H. The truth is `full-wave`, which ``full_wave.py`` holds against multipoles. The error of an
aspect is that of the complex field over its size; its mean at 40 to 90 degrees may be at most half
of what one reflection leaves. At 20 and 30 degrees one sphere shades the other.

A walker is seen at several instants over 12 to 16 GHz by `rays` with two bounces, as it is and
without the creases between parts that touch, which no person has and the other levels leave out:
there a ray that goes from a part to one that touches it is lost. The sum of squares over instants
and frequencies says how much power two bounces have over one, and how far each level is from
`rays`, with one bounce and with two. Where `anny` is at hand, the human mesh, which has no creases,
is seen by `rays` at the same instants beside ellipsoids.

Where thighs pass each other, the path over both grazes one of them, where geometric optics ends.
The truth there is `full-wave` by surfaces of the two thighs alone at 3 GHz, at five instants of the
walk.

Two people 8 m apart return what each returns alone, and a walk begins alike whatever its length.

What they cost is the CPU time of the echoes of 96 channels over that of single reflections, the
least of three in turn.

    python validation/other_methods/double_reflections.py [--quick] [--json FILE]
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import HumanMesh
from rtradar.body.people import body_of_people
from rtradar.echoes import Echoes
from rtradar.full_wave import ConductingSurface
from rtradar.motion import cut
from rtradar.scatter import build_model
from rtradar.scatter.common.interpolation import interpolation_weights
from rtradar.scatter.double_reflections import DoubleReflections, pairs_apart
from rtradar.scatter.models.rays import Rays
from rtradar.settings import RunSettings
from rtradar.trace.backend import select, use
from rtradar.trace.tracers import BodyTracer
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import rms
from levels_against_full_wave import POLARIZATIONS, Polarization, antennas, field, mesh_of

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
judged, reported = (
    partial(kind, key="double-reflections") for kind in (rows.judged, rows.reported)
)

LEVELS = ("specular", "physical-optics")
ASPECTS_DEG = np.array([20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0])
SPHERE_M, FREQUENCY_HZ = 0.05, 12e9
THIGHS_HZ = 3e9
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


class WithoutCreases(Rays):
    """`rays`, but what a part sends to another that touches it is lost."""

    def __init__(self, radar: rt.Radar, body: rt.Body, **options: Any) -> None:
        super().__init__(radar, body, **options)
        self._target._tracer = PartsApart(use(select("auto")), body.semi_axes)


class PartsApart(BodyTracer):
    """Posed ellipsoids, of which rays go only from one to another that does not touch it."""

    def pose(self, centres: Array, frames: Array) -> None:
        super().pose(centres, frames)
        pairs = pairs_apart(centres, frames, self._semi_axes)
        self._apart = np.zeros((len(centres), len(centres)), dtype=bool)
        self._apart[pairs[:, 0], pairs[:, 1]] = True

    def meets(
        self, points: Array, normals: Array, directions: Array, own: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], Array]:
        met, distance = super().meets(points, normals, directions, own)
        lost = ~self._apart[own, met]
        return np.where(lost, -1, met), np.where(lost, np.inf, distance)


class WeakPairs(DoubleReflections):
    """Pairs down to -60 dB."""

    least_db = -60.0


class TouchingPairs(WeakPairs):
    """The same with pairs that touch."""

    @staticmethod
    def pairs(centres: Array, frames: Array, semi_axes: Array) -> NDArray[np.int64]:
        return np.array(list(permutations(range(len(semi_axes)), 2)), dtype=np.int64)


def walker_rows() -> Iterator[Row]:
    array = {"tx_y": 1, "tx_z": 0, "rx_y": 1, "rx_z": 0}
    radar = dataclasses.replace(rt.Radar.preset("paper-12ghz"), **array)
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=1.5))
    times = (np.arange(24) + 0.5) / 24 * body.duration_s
    chirps = np.round(times / radar.chirp_interval_s).astype(np.int64)
    frequency = radar.start_frequency_hz + radar.bandwidth_hz * np.linspace(0, 1, 33)
    tracer = BodyTracer(use(select("auto")), body.semi_axes)
    single = {level: build_model(level, radar, body).echoes(chirps) for level in LEVELS}
    first = {level: by_bounces(echoes, frequency)[1] for level, echoes in single.items()}
    seconds: dict[str, Complex] = {}
    for name, kind in (
        ("as it is", DoubleReflections),
        ("all that do not touch", WeakPairs),
        ("with those that touch", TouchingPairs),
    ):
        doubles = kind(radar, body, tracer)
        found = by_bounces(doubles.beside(single["specular"], chirps), frequency)
        seconds[name] = found[2]
        count = len(doubles.account()["double_reflections"])
        yield reported("walker, two bounces", f"pairs, {name}", "", float(count))
    for model, judge in ((Rays, "`rays`"), (WithoutCreases, "`rays` without creases")):
        rays = by_bounces(model(radar, body, bounces=2).echoes(chirps), frequency)
        truth = rays[1] + rays[2]
        gain = 20 * np.log10(rms(truth) / rms(rays[1]))
        claim = f"walker, two bounces, {judge}"
        yield reported(claim, "power over one bounce", "dB", gain)
        for level in LEVELS:
            claim = f"walker, `{level}` to {judge}"
            today = rms(first[level] - truth)
            yield reported(claim, "one bounce", "%", 100 * today / rms(truth))
            for name, second in seconds.items():
                away = rms(first[level] + second - truth)
                yield reported(claim, f"two, pairs {name}", "%", 100 * away / rms(truth))
                yield reported(claim, f"two over one, pairs {name}", "", away / today)
        for name, second in seconds.items():
            alike = abs(np.vdot(second, rays[2])) / np.linalg.norm(second) / np.linalg.norm(rays[2])
            claim = f"walker, second bounces to {judge}"
            yield reported(claim, f"correlation, pairs {name}", "", alike)


def second_bounces(body: rt.Body, chirps: NDArray[np.int64]) -> Complex:
    """Field (chirp, rx) of two bounces by `specular` at the middle of the sweep."""
    radar = dataclasses.replace(
        rt.Radar.preset("paper-12ghz"), tx_y=1, tx_z=0, rx_y=2, rx_z=0, position_m=(-4.0, 0.0, 1.0)
    )
    echoes = build_model("specular", radar, body, bounces=2).echoes(chirps)
    return by_bounces(echoes, np.array([radar.centre_frequency_hz]))[2][0]


def law_rows() -> Iterator[Row]:
    """Two people are the sum of each alone, and a walk begins alike whatever its length."""
    walk, kick = (rt.synthetic_motion(name, seed=0, duration_s=2.0) for name in ("walk", "kick"))
    chirps = np.arange(0, 1600, 10)

    def there(*people: rt.Person) -> rt.Body:
        return body_of_people(people, RunSettings(duration_s=0.1))

    left, right = rt.Person(walk, (0.0, 4.0)), rt.Person(kick, (0.0, -4.0))
    alone = second_bounces(there(left), chirps) + second_bounces(there(right), chirps)
    error = np.abs(second_bounces(there(left, right), chirps) - alone).max() / np.abs(alone).max()
    says = "two bounces of two people 8 m apart against the sum of each alone"
    yield judged("a walker and a kicker", "largest change", "", float(error), 1e-6, says=says)
    short, whole = (
        second_bounces(rt.Body.from_motion(cut(walk, 0.0, end)), chirps) for end in (0.3, 2.0)
    )
    error = np.abs(short - whole).max() / np.abs(whole).max()
    says = "two bounces in the first 0.1 s of a walk of 0.3 s against those of one of 2 s"
    yield judged("a walker", "largest change", "", float(error), 1e-6, says=says)


def mesh_rows() -> Iterator[Row]:
    """Power of two bounces over one of the same walker as a human mesh, which has no creases."""
    motion = rt.synthetic_motion("walk", seed=0, duration_s=1.5)
    shapes: dict[str, Callable[[float], Any]] = {
        "ellipsoids": rt.Body.from_motion(motion).ellipsoids
    }
    if find_spec("anny") is not None:
        shapes["human mesh"] = partial(HumanMesh(motion).trimesh, divisions=1)
    times = (np.arange(24) + 0.5) / 24 * motion.duration_s
    frequency = np.linspace(12e9, 16e9, 9)
    at = np.tile([-4.0, 1.0, 1.0], (len(frequency), 1))
    for name, seen_at in shapes.items():
        found: dict[int, list[Complex]] = {1: [], 2: []}
        for bounces, time_s in product(found, times.tolist()):
            given = seen_at(time_s), at, at, frequency, "rays"
            found[bounces].append(rt.scattering_length(*given, bounces=bounces))
        one, two = np.array(found[1]), np.array(found[2])
        claim = f"walker, {name} by `rays`"
        gain = 20 * np.log10(rms(two) / rms(one))
        yield reported(claim, "power of two bounces over one", "dB", gain)
        yield reported(claim, "second bounces over first", "%", 100 * rms(two - one) / rms(one))


def thigh_rows() -> Iterator[Row]:
    """The two thighs of the walker alone, against full wave by surfaces."""
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=1.5))
    thighs = [body.part_names.index(name) for name in ("left thigh", "right thigh")]
    times, frequency = np.array([0.65, 0.78, 0.91, 1.03, 1.16]), THIGHS_HZ
    at = np.array([[-4.0, 1.0, 1.0]])
    centres, frames, semi_axes = body.at(times)
    levels = [(level, {"bounces": n}) for level, n in product((*LEVELS, "rays"), (1, 2))]
    pairs = [
        rt.Ellipsoids(centres[pose, thighs], frames[pose, thighs], semi_axes[thighs])
        for pose in range(len(times))
    ]
    # A little less than an eighth of a wavelength, so that none has to be divided.
    surfaces = (ConductingSurface(mesh_of(pair, C / frequency / 10), frequency) for pair in pairs)
    truths = [
        [surface.scattering_length(at, at, own) for own in POLARIZATIONS] for surface in surfaces
    ]
    for number, polarization in enumerate(POLARIZATIONS):
        truth = np.array(truths)[:, number]
        claim = f"thighs of a walker, {frequency / 1e9:g} GHz, {polarization.upper()}"
        for level, more in levels:
            found = [field(pair, at, frequency, level, polarization, **more) for pair in pairs]
            name = f"`{level}` to full wave, bounces: {more['bounces']}"
            yield reported(claim, name, "%", 100 * rms(np.array(found) - truth) / rms(truth))


def cost_rows() -> Iterator[Row]:
    radar = rt.Radar.preset("paper-12ghz")
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=1.5))
    models = {n: build_model("specular", radar, body, bounces=n) for n in (1, 2)}
    chirps = np.arange(6400)
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
    rows = [*pair_rows(quick), *law_rows()]
    if not quick:  # of a walker it only reports
        rows += [*walker_rows(), *mesh_rows(), *thigh_rows(), *cost_rows()]
    return rows


if __name__ == "__main__":
    sys.exit(main("Reflections from part to part.", measure))
