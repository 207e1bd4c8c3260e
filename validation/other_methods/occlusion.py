"""Occlusion by `specular` against physical optics with a geometric shadow, and the tracer itself.

A part straight behind another must return nothing. A half covered part returns all or nothing, by
its specular point; its error against physical optics is reported over the covered fraction. In
time, a sphere passes before an upright ellipsoid, and the power beside the Doppler line of the
ellipsoid is compared for ramps of several lengths, and for the model itself with keyframes 10 ms
apart, whatever the instant between them at which the specular point disappears.

The reference adds up the points of ``physical_optics.py`` that the occluder, a sphere, does not
hide from the antenna, by the distance of its centre from each ray. The edge is softened over one
cell, so that the sum converges with the square of the cell.

What Mitsuba answers about the lines of sight of moving bodies is compared with a closed form in
float64.

    python validation/other_methods/occlusion.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from physical_optics import lit_points, wave_number
from scipy.signal.windows import hann

import rtradar as rt
from rtradar.body.body import Poses
from rtradar.kernels.jit import compiled
from rtradar.motion import place
from rtradar.scatter import build_model
from rtradar.scatter.common.poses import keyframe_step
from rtradar.scatter.specular_points import SpecularVisibility
from rtradar.system.threads import in_threads
from rtradar.trace.backend import select, use
from rtradar.trace.tracers import BodyTracer
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import rms

Array = NDArray[np.float64]
judged, reported = (partial(kind, key="edge") for kind in (rows.judged, rows.reported))
ANTENNA = np.array([-4.0, 0.0, 0.0])  # the target is at the origin
BEFORE_M = 0.5  # distance of the occluder before the target
TO_OCCLUDER_M = 3.5
OCCLUDER_RADIUS_M = 0.06
TARGET = np.array([0.07, 0.07, 0.2])
BESIDE_MPS = 1.5


@dataclass(frozen=True)
class Band:
    """One of the paper's radars as one of its channels sees it: one chirp in each TDM cycle."""

    name: str
    start: float
    cycle_s: float
    cycles: int
    density: float  # of the reference's points
    standing_density: float

    @property
    def centre(self) -> float:
        return self.start + 2e9

    @property
    def radar(self) -> rt.Radar:
        """One Tx and one Rx in one place; the keyframes stay 10 ms apart."""
        return rt.Radar(
            name=self.name,
            start_frequency_hz=self.start,
            chirp_duration_s=self.cycle_s,
            tx_y=1,
            tx_z=0,
            rx_y=1,
            rx_z=0,
            position_m=tuple(ANTENNA),
        )


BANDS = (
    Band("12 GHz radar", 12e9, 0.75e-3, 133, 5.0, 5.0),
    Band("77 GHz radar", 77e9, 0.15e-3, 666, 2.5, 2.5),
)


# -- the reference ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Target:
    """Points of an upright ellipsoid before one antenna, and what each adds at one frequency."""

    points: Array  # (n, 3), from the antenna [m]
    contribution: NDArray[np.complex128]
    cell: float  # typical spacing of points across the line of sight [m]

    @classmethod
    def upright(cls, axes: Array, frequency: float, density: float) -> Target:
        quadrature = lit_points(ANTENNA, ANTENNA, axes, frequency, density=density)
        k = wave_number(frequency)
        contribution = (
            1j * k / np.sqrt(np.pi) * quadrature.weight * np.exp(-1j * k * quadrature.path)
        )
        area = np.pi * axes[1] * axes[2]
        return cls(
            quadrature.points - ANTENNA, contribution, float(np.sqrt(area / len(quadrature.weight)))
        )

    def field(self, occluder: Array, radius: float) -> complex:
        """F with the shadow of a sphere at ``occluder (3,)`` [m], over the free one."""
        given = self.points, self.contribution, occluder - ANTENNA, radius, self.cell
        shadowed = in_threads(_shadowed, len(self.points), *given)
        return complex(sum(shadowed) / self.contribution.sum())


@compiled(fastmath=True)
def _shadowed(start, stop, points, contribution, occluder, radius, cell):
    total_re, total_im = 0.0, 0.0
    square = occluder[0] ** 2 + occluder[1] ** 2 + occluder[2] ** 2
    for i in range(start, stop):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        length = np.sqrt(x * x + y * y + z * z)
        along = (x * occluder[0] + y * occluder[1] + z * occluder[2]) / length
        # Distance at which the ray passes outside the sphere, seen at the target.
        clearance = (np.sqrt(max(square - along * along, 0.0)) - radius) * length / along
        fraction = min(max(0.5 + clearance / cell, 0.0), 1.0)
        total_re += fraction * contribution[i].real
        total_im += fraction * contribution[i].imag
    return complex(total_re, total_im)


def covered_fraction(axes: Array, occluder: Array, radius: float) -> float:
    """Fraction of the target's outline that lies in the shadow, by counting."""
    rng = np.random.default_rng(0)
    disc = rng.normal(size=(200_000, 2))
    disc *= np.sqrt(rng.uniform(size=len(disc)) / (disc**2).sum(axis=1))[:, None]
    rays, way = (
        np.column_stack([np.zeros(len(disc)), disc * axes[1:]]) - ANTENNA,
        occluder - ANTENNA,
    )
    along = rays @ way / np.linalg.norm(rays, axis=1)
    return float(np.mean(way @ way - along**2 < radius**2))


# -- at rest ---------------------------------------------------------------------------------------


def one(ellipsoids: rt.Ellipsoids, part: int) -> rt.Ellipsoids:
    return rt.Ellipsoids(
        *(
            getattr(ellipsoids, field)[part : part + 1]
            for field in ("centres", "frames", "semi_axes")
        )
    )


def ours(axes: Array, occluder: Array, radius: float, frequency: float) -> complex:
    """Field of the target with the occluder before it, less the occluder's, over the free one."""
    both = rt.Ellipsoids(
        [np.zeros(3), occluder], np.tile(np.eye(3), (2, 1, 1)), [axes, np.full(3, radius)]
    )
    whole, free, before = (
        rt.scattering_length(target, ANTENNA, ANTENNA, frequency)[0]
        for target in (both, one(both, 0), one(both, 1))
    )
    return complex((whole - before) / free)


def hidden_rows(quick: bool) -> Iterator[Row]:
    """Body parts straight behind a torso, a head or another limb, for every pair of antennas."""
    rng = np.random.default_rng(1)
    actor = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0))
    worst, cases = 0.0, 0
    for preset in ("paper-12ghz", "paper-77ghz"):
        radar = rt.Radar.preset(preset)
        tx = np.repeat(radar.tx, radar.n_rx, axis=0) - radar.position_m
        rx = radar.rx[radar.rx_of_tx].reshape(-1, 3) - radar.position_m
        for axes in actor.semi_axes[:: 5 if quick else 1]:
            distance, gap = rng.uniform(2.5, 5.0), rng.uniform(0.05, 0.6)
            direction = np.array([1.0, *rng.uniform(-0.3, 0.3, 2)])
            direction /= np.linalg.norm(direction)
            # As large as it takes to occlude the whole part from the ends of the array too.
            cover = 1.3 * axes.max() + gap / distance * 0.4 + 0.1
            far = distance + cover + gap + axes.max()
            both = rt.Ellipsoids(
                [far * direction, distance * direction],
                np.tile(np.eye(3), (2, 1, 1)),
                [axes, np.full(3, cover)],
            )
            whole, free, before = (
                rt.scattering_length(target, tx, rx, radar.centre_frequency_hz)
                for target in (both, one(both, 0), one(both, 1))
            )
            worst = max(worst, float((np.abs(whole - before) / np.abs(free)).max() ** 2))
            cases += len(tx)
    says = "a part straight behind another by `specular`: most of its free power"
    yield judged(
        "straight behind another part",
        f"most of the free power, {cases} cases",
        "",
        worst,
        1e-6,
        says=says,
        cases=cases,
    )


def covered_rows(quick: bool) -> Iterator[Row]:
    shapes = {"thigh": TARGET, "head": np.array([0.06, 0.06, 0.1])}
    radius = 0.25
    for band in BANDS:
        for name, axes in shapes.items():
            claim = f"{band.name}, {name} behind an edge"
            target = Target.upright(axes, band.centre, band.standing_density)
            reach = axes[1] * TO_OCCLUDER_M / 4.0
            errors, crossing = [], []
            for shift in radius + reach * np.linspace(-1.15, 1.15, 9 if quick else 15):
                occluder = np.array([-BEFORE_M, shift, 0.0])
                fraction = covered_fraction(axes, occluder, radius)
                optics, got = (
                    target.field(occluder, radius),
                    ours(axes, occluder, radius, band.centre),
                )
                errors.append(abs(got - optics))
                if 0.02 < fraction < 0.98:
                    crossing.append(errors[-1])
                    quantity = f"{fraction:3.0%} covered: field over the free one"
                    row = reported(claim, quantity, "", abs(got), reference=abs(optics))
                    yield replace(row, error=errors[-1])
            # All or nothing is wrong by half where half of the field is left, and PO overshoots.
            says = "a part half behind an edge by `specular`, seen or not: worst complex error"
            yield judged(
                claim, "worst complex error", "", max(errors), 0.6, says=says, cases=len(errors)
            )
            yield reported(
                claim,
                "rms complex error where partly covered",
                "",
                float(np.sqrt(np.mean(np.square(crossing)))),
            )


# -- in time ---------------------------------------------------------------------------------------


def smooth(x: Array) -> Array:
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


RAMPS = {
    "linear 1.25 ms": (1.25e-3, lambda x: np.clip(x, 0.0, 1.0)),
    "smooth 5 ms": (5e-3, smooth),
    "smooth 10 ms": (10e-3, smooth),
    "smooth 20 ms": (20e-3, smooth),
}


def beside_db(field: Array | NDArray[np.complex128], band: Band) -> float:
    """Mean power beside the Doppler line over its peak."""
    spectrum = np.abs(np.fft.fft(field * hann(len(field), sym=False))) ** 2
    velocity = np.fft.fftfreq(len(field), band.cycle_s) * 299_792_458.0 / band.centre / 2
    return float(10 * np.log10(spectrum[np.abs(velocity) > BESIDE_MPS].mean() / spectrum.max()))


@dataclass(frozen=True)
class Passing:
    """A body of two parts: a static ellipsoid, and a sphere that uncovers it at ``instant``."""

    speed: float
    instant: float
    duration_s: float = 0.2
    part_names: tuple[str, ...] = ("target", "occluder")

    @property
    def semi_axes(self) -> Array:
        return np.array([TARGET, np.full(3, OCCLUDER_RADIUS_M)])

    def sphere(self, times: Array) -> Array:
        y = OCCLUDER_RADIUS_M + self.speed * (np.asarray(times) - self.instant)
        return np.stack([np.full_like(y, -BEFORE_M), y, np.zeros_like(y)], axis=-1)

    @property
    def owner(self) -> NDArray[np.int64]:
        return np.zeros(len(self.semi_axes), dtype=np.int64)

    def at(self, times: Array) -> Poses:
        sphere = self.sphere(times)
        centres = np.stack([np.zeros_like(sphere), sphere], axis=1)
        return Poses(centres, np.broadcast_to(np.eye(3), (len(sphere), 2, 3, 3)), self.semi_axes)


def fade_rows(quick: bool) -> Iterator[Row]:
    for band in BANDS:
        target = Target.upright(TARGET, band.centre, band.density / (2.0 if quick else 1.0))
        times = band.radar.chirp_times(band.cycles)
        # Instants at which the specular point is uncovered, over one interval between keyframes, in
        # whole cycles.
        late = (
            np.linspace(0, round(10e-3 / band.cycle_s), 3 if quick else 11)[:-1].round().astype(int)
        )
        for speed in (1.5,) if quick else (0.5, 1.5, 4.0):
            claim = f"{band.name}, {speed:g} m/s"
            passing = Passing(speed, float(times.mean()))
            before = np.arange(-late.max(), band.cycles) * band.cycle_s + times[0]
            series = np.array(
                [target.field(place, OCCLUDER_RADIUS_M) for place in passing.sphere(before)]
            )
            optics = series[late.max() :]
            yield reported(claim, "PO: power beside the line", "dB", beside_db(optics, band))
            if not quick and speed == 1.5:
                # The softened edge must not determine the floor: half the points would show it.
                coarse = Target.upright(TARGET, band.centre, band.density / 1.4)
                check = np.array(
                    [coarse.field(place, OCCLUDER_RADIUS_M) for place in passing.sphere(times)]
                )
                change = beside_db(check, band) - beside_db(optics, band)
                yield reported(claim, "PO, half the points: change beside the line", "dB", change)
                yield reported(
                    claim, "PO, half the points: rms change of the field", "", rms(check - optics)
                )
            for name, (length, shape) in RAMPS.items():
                # Occluded from the arrival of the sphere's front, if it arrives in this frame,
                # until its rear uncovers the point.
                gone, back = (passing.instant - 2 * OCCLUDER_RADIUS_M / speed, passing.instant)
                ramp = (
                    1 - shape((times - gone) / length + 0.5) + shape((times - back) / length + 0.5)
                )
                yield reported(claim, f"{name}: power beside the line", "dB", beside_db(ramp, band))
                yield reported(claim, f"{name}: rms complex error", "", rms(ramp - optics))
            floors, errors = [], []
            for shift in late:
                moved = Passing(speed, passing.instant + shift * band.cycle_s)
                model = build_model("specular", band.radar, moved)
                amplitude = model.echoes(np.arange(band.cycles)).amplitude[0, :, 0, 0].real
                floors.append(beside_db(amplitude, band))
                first = late.max() - shift
                errors.append(
                    rms(amplitude / amplitude.max() - series[first : first + band.cycles])
                )
            yield reported(
                claim,
                f"specular, {len(late)} instants: power beside the line",
                "dB",
                db_mean(floors),
            )
            yield reported(
                claim, f"specular, {len(late)} instants: worst of them", "dB", max(floors)
            )
            yield reported(
                claim,
                f"specular, {len(late)} instants: rms complex error",
                "",
                rms(np.array(errors)),
            )


def db_mean(values: list[float]) -> float:
    return float(10 * np.log10(np.mean(10 ** (np.array(values) / 10))))


# -- the tracer ------------------------------------------------------------------------------------


class ClosedForm:
    """Whether a part is between two points, in float64, in place of the tracer."""

    def __init__(self, semi_axes: Array) -> None:
        self._axes = semi_axes

    def pose(self, centres: Array, frames: Array) -> None:
        self._centres, self._frames = centres, frames

    def sees(self, origins: Array, targets: Array, own: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether each line stays outside of every part but its own, scaled to a unit sphere."""
        seen = np.ones(len(origins), dtype=bool)
        for part, axes in enumerate(self._axes):
            centre, frame = self._centres[part], self._frames[part]
            start = (origins - centre) @ frame / axes
            line = (targets - origins) @ frame / axes
            nearest = np.clip(-np.sum(start * line, axis=1) / np.sum(line * line, axis=1), 0, 1)
            distance = np.linalg.norm(start + nearest[:, None] * line, axis=1)
            seen &= (own == part) | (distance >= 1)
        return seen


class Both:
    """The tracer's answers, with a count of those that the closed form contradicts."""

    def __init__(self, tracer: BodyTracer, reference: ClosedForm) -> None:
        self._tracer, self._reference = tracer, reference
        self.lines, self.different = 0, 0

    def pose(self, centres: Array, frames: Array) -> None:
        self._tracer.pose(centres, frames)
        self._reference.pose(centres, frames)

    def sees(self, origins: Array, targets: Array, own: NDArray[np.int64]) -> NDArray[np.bool_]:
        seen = self._tracer.sees(origins, targets, own)
        self.lines += len(seen)
        self.different += int((seen != self._reference.sees(origins, targets, own)).sum())
        return seen


def visibilities(radar: rt.Radar, body: rt.Body, tracer: Any, chirps: NDArray[np.int64]) -> Array:
    """Fraction of the amplitude (chirp, rx, part) that is left of each part by `specular`."""
    visibility = SpecularVisibility(radar, body, tracer)
    return np.concatenate([visibility.at(chirp)[0] for chirp in chirps[:, None]])


def tracer_rows(quick: bool) -> Iterator[Row]:
    """Mitsuba's answers on moving bodies against the closed form, and the power of the parts."""
    radar, mi = rt.Radar.preset("paper-12ghz"), use(select("cpu"))
    lines, different, worst, cases = 0, 0, 0.0, 0
    for activity in ("walk",) if quick else ("walk", "kick", "punch", "jumping_jack"):
        motion = rt.synthetic_motion(activity, seed=0)
        duration = 0.5 if quick else 3.0
        body = rt.Body.from_motion(place(motion, start_s=0.0, duration_s=duration))
        traced = Both(BodyTracer(mi, body.semi_axes), ClosedForm(body.semi_axes))
        # Power of each part at one chirp of every keyframe, by the tracer and by the closed form.
        step = keyframe_step(radar)
        chirps = np.arange(0, int(body.duration_s / radar.chirp_interval_s) - 1, step)
        amplitude = build_model("analytic", radar, body).echoes(chirps).amplitude[0]
        powers = []
        for tracer in (traced, ClosedForm(body.semi_axes)):
            fractions = visibilities(radar, body, tracer, chirps)
            powers.append((np.abs(amplitude) ** 2 * fractions**2).sum(axis=1))
        lines, different = lines + traced.lines, different + traced.different
        # Averages over 0.1 s, of parts within 30 dB of the strongest.
        n = round(0.1 / (step * radar.chirp_interval_s))
        ours, theirs = (
            np.add.reduceat(power, np.arange(0, len(power), n), axis=0) for power in powers
        )
        strong = theirs > 1e-3 * theirs.max(axis=1, keepdims=True)
        decibels = 10 * np.log10(ours[strong] / theirs[strong])
        worst, cases = max(worst, float(np.sqrt(np.mean(decibels**2)))), cases + int(strong.sum())
    yield judged(
        "tracer against closed form",
        f"fraction of {lines} lines of sight with another answer",
        "",
        different / lines,
        1e-5,
        says="fraction of lines of sight on which Mitsuba and the closed form differ",
        cases=lines,
        key="tracer",
    )
    yield judged(
        "tracer against closed form",
        "power of parts within 30 dB of the strongest, over 0.1 s: rms difference",
        "dB",
        worst,
        0.01,
        says="power of the parts of a moving body, occluded by Mitsuba or in closed form: rms",
        cases=cases,
        key="tracer",
    )


def measure(quick: bool) -> list[Row]:
    return [*hidden_rows(quick), *covered_rows(quick), *fade_rows(quick), *tracer_rows(quick)]


if __name__ == "__main__":
    sys.exit(
        main("Occlusion of `specular` against physical optics with a geometric shadow.", measure)
    )
