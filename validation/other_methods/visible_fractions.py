"""`specular` with a gradual visibility where one part half covers another, against another sum.

Edges cross a target, at each of three frequencies of the sweep: that of a flat plate, that of a
torso, and both edges of a limb. The same is done before all antennas of both radars, of which the
corner channels and two in the middle are compared. In time, a sphere passes before an upright
ellipsoid, and the power beside the Doppler line of the ellipsoid is compared.

The reference adds up the points of ``physical_optics.py`` that the occluder does not hide from
either antenna, by the discriminant of the ray and the occluder; it uses no specular points, facets
or rays. Complex errors are relative to the free field.

    python validation/other_methods/visible_fractions.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from occlusion import (
    ANTENNA,
    BANDS,
    OCCLUDER_RADIUS_M,
    TARGET,
    Band,
    Passing,
    Target,
    beside_db,
    db_mean,
    one,
    rms,
)
from physical_optics import lit_points, wave_number
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body.body import Poses
from rtradar.scatter.models.specular import Specular
from rtradar.validate.rows import Row, judged, main, reported

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
OURS = "`specular` with a gradual visibility"
TARGETS = {
    "thigh": TARGET,
    "head": np.array([0.06, 0.06, 0.1]),
    "torso": np.array([0.1, 0.12, 0.25]),
}
OCCLUDERS = {
    "plate": np.array([0.005, 0.8, 0.8]),
    "torso": np.array([0.1, 0.14, 0.3]),
    "forearm": np.array([0.03, 0.03, 0.14]),
}
EDGE_ERROR = 0.05


# -- the reference ---------------------------------------------------------------------------------


def hidden(
    points: Array, antenna: Array, centre: Array, frame: Array, axes: Array
) -> NDArray[np.bool_]:
    """Whether the line from the antenna to each point (n, 3) passes through an ellipsoid."""
    a, p = (antenna - centre) @ frame / axes, (points - centre) @ frame / axes
    d = p - a
    # |a + t d|^2 = 1 has a root between the antenna and the point.
    dd, ad, aa = np.sum(d * d, axis=-1), d @ a, a @ a - 1
    discriminant = ad * ad - dd * aa
    enter = (-ad - np.sqrt(np.maximum(discriminant, 0.0))) / dd
    return (discriminant > 0) & (enter > 0) & (enter < 1)


@dataclass(frozen=True)
class Lit:
    """The points of an ellipsoid that two antennas light, and what each adds at each frequency."""

    pair: tuple[Array, Array]
    points: Array  # (point, 3) [m]
    contribution: Complex  # (frequency, point)

    @classmethod
    def of(
        cls,
        pair: tuple[Array, Array],
        centre: Array,
        frame: Array,
        axes: Array,
        frequencies: Array,
        density: float,
    ) -> Lit:
        tx, rx = ((antenna - centre) @ frame for antenna in pair)
        quadrature = lit_points(tx, rx, axes, float(frequencies.max()), density=density)
        k = np.array([wave_number(float(frequency)) for frequency in frequencies])
        # A factor that is common to all points of one frequency does not matter.
        contribution = quadrature.weight * np.exp(-1j * np.multiply.outer(k, quadrature.path))
        return cls(pair, centre + quadrature.points @ frame.T, contribution)

    def lit_fraction(self, occluder: rt.Ellipsoids) -> Complex:
        """Field (frequency,) with an ellipsoid before it, over the free field."""
        shape = occluder.centres[0], occluder.frames[0], occluder.semi_axes[0]
        dark = hidden(self.points, self.pair[0], *shape)
        if self.pair[1] is not self.pair[0]:
            dark |= hidden(self.points, self.pair[1], *shape)
        return np.asarray(self.contribution[:, ~dark].sum(axis=1) / self.contribution.sum(axis=1))


def scene(target: Array, occluder: Array, place: Array, turn: Array) -> rt.Ellipsoids:
    """A target at the origin, rotated a little, and the occluder."""
    frames = [Rotation.from_rotvec(turn).as_matrix(), Rotation.from_rotvec(turn[::-1]).as_matrix()]
    return rt.Ellipsoids([np.zeros(3), place], frames, [target, occluder])


def ours(ellipsoids: rt.Ellipsoids, frequency: Array) -> Complex:
    """Field at each frequency."""
    antenna = np.broadcast_to(ANTENNA, (len(frequency), 3))
    return rt.scattering_length(ellipsoids, antenna, antenna, frequency, visibility="gradual")


def gradual(radar: rt.Radar, body: object) -> Specular:
    """The level of a moving body."""
    return Specular(radar, body, visibility="gradual")  # type: ignore[arg-type]


# -- at rest ---------------------------------------------------------------------------------------


def edge_rows(quick: bool) -> Iterator[Row]:
    rng = np.random.default_rng(0)
    for band in BANDS:
        frequencies = band.centre + np.array([-2e9, 0.0, 2e9])
        density = 2.0 if band.start < 50e9 else 1.2
        for index, (name, occluder) in enumerate(OCCLUDERS.items()):
            errors, rough = [], []
            for target in list(TARGETS.values())[slice(index, index + 1) if quick else slice(None)]:
                for _ in range(1 if quick else 3):
                    # The edge covers half of the target, in any direction.
                    tilt, turn = rng.uniform(0, np.pi), rng.uniform(-0.4, 0.4, 3)
                    across = np.array([0.0, np.cos(tilt), np.sin(tilt)])
                    extent = float(np.linalg.norm(occluder * across))
                    reach = 0.875 * float(np.linalg.norm(target * across))
                    alone = one(scene(target, occluder, np.zeros(3), turn), 0)
                    free = ours(alone, frequencies)
                    lit = Lit.of(
                        (ANTENNA, ANTENNA),
                        np.zeros(3),
                        alone.frames[0],
                        target,
                        frequencies,
                        density,
                    )
                    for shift in extent + reach * (
                        np.linspace(-1.1, 1.1, 9 if quick else 21) + rng.uniform(-0.05, 0.05)
                    ):
                        ellipsoids = scene(
                            target, occluder, np.array([-0.5, 0.0, 0.0]) + shift * across, turn
                        )
                        optics = lit.lit_fraction(one(ellipsoids, 1))
                        partly = (np.abs(optics) > 1e-9) & (np.abs(optics - 1) > 1e-9)
                        before = ours(one(ellipsoids, 1), frequencies)
                        wrong = np.abs((ours(ellipsoids, frequencies) - before) / free - optics)
                        errors.append(wrong[partly])
                        rough.append(np.abs(np.round(np.abs(optics)) - optics)[partly])
            claim = f"{band.name}, edge of a {name}"
            wrong = np.concatenate(errors)
            quantity = f"rms complex error, {len(wrong)} cases partly covered"
            says = (
                f"knife edge and limbs across a specular point by {OURS}, 12 and 77 GHz: "
                "rms complex error"
            )
            yield judged(
                claim, quantity, "", rms(wrong), EDGE_ERROR, key="edge", says=says, cases=len(wrong)
            )
            yield reported(claim, "worst of them", "", float(wrong.max()), key="edge")
            yield reported(
                claim,
                "rms complex error of the better of all and nothing",
                "",
                rms(np.concatenate(rough)),
                key="edge",
            )


@dataclass(frozen=True)
class Standing:
    """A body that stands still, for a model."""

    pose: rt.Ellipsoids
    duration_s: float = 0.1
    part_names: tuple[str, ...] = ("target", "occluder")

    @property
    def semi_axes(self) -> Array:
        return self.pose.semi_axes

    @property
    def owner(self) -> NDArray[np.int64]:
        return np.zeros(len(self.semi_axes), dtype=np.int64)

    def at(self, times: Array) -> Poses:
        n = len(np.asarray(times))
        fields = (np.broadcast_to(a, (n, *a.shape)) for a in (self.pose.centres, self.pose.frames))
        return Poses(*fields, self.pose.semi_axes)


def array_rows(quick: bool) -> Iterator[Row]:
    """Every channel sees the edge from another place, so errors of the array polynomial enter."""
    rng = np.random.default_rng(2)
    for preset, density in (("paper-12ghz", 2.0), ("paper-77ghz", 1.2)):
        radar = rt.Radar.preset(preset)
        middle_hz = np.array([radar.centre_frequency_hz])
        errors, spreads = [], []
        for target in list(TARGETS.values())[: 1 if quick else None]:
            for _ in range(1 if quick else 4):
                place = np.array([-0.5, rng.uniform(-1, 1) * 0.6 * target[1], 0.0])
                place[1] += OCCLUDERS["torso"][1] * rng.choice([-1.0, 1.0])
                pose = scene(target, OCCLUDERS["torso"], place, rng.uniform(-0.3, 0.3, 3))
                # Straight in front of the radar.
                pose = rt.Ellipsoids(
                    pose.centres + np.array([0.0, 1.0, 1.0]), pose.frames, pose.semi_axes
                )
                echoes = gradual(radar, Standing(pose)).echoes(np.arange(radar.n_tx))
                alone = Standing(one(pose, 0), part_names=("target",))
                free = gradual(radar, alone).echoes(np.arange(radar.n_tx))
                middle = len(echoes.frequency) // 2
                got = (echoes.amplitude[middle, ..., 0] / free.amplitude[middle, ..., 0]).conj()
                spreads.append(np.abs(got - got.mean(axis=(0, 1))).ravel())
                for tx in (0, 5, 11) if quick else (0, 2, 5, 6, 11):
                    for rx in (0, 7) if quick else (0, 3, 7):
                        pair = (radar.tx[tx], radar.rx[radar.rx_of_tx[tx, rx]])
                        lit = Lit.of(
                            pair, pose.centres[0], pose.frames[0], target, middle_hz, density
                        )
                        errors.append(got[tx, rx] - lit.lit_fraction(one(pose, 1))[0])
        claim = f"{preset}, edge of a torso before the array"
        quantity, error = f"rms complex error, {len(errors)} channels", rms(np.array(errors))
        says = f"an edge before the array by {OURS}, channel by channel: rms complex error"
        yield judged(
            claim, quantity, "", error, EDGE_ERROR, key="edge", says=says, cases=len(errors)
        )
        yield reported(
            claim,
            "rms difference of channels from their mean",
            "",
            rms(np.concatenate(spreads)),
            key="edge",
        )


# -- in time ---------------------------------------------------------------------------------------


def passing_rows(band: Band, speed: float, quick: bool) -> Iterator[Row]:
    claim = f"{band.name}, passed at {speed:g} m/s"
    target = Target.upright(TARGET, band.centre, band.density / (2.0 if quick else 1.0))
    times = band.radar.chirp_times(band.cycles)
    middle = Passing(speed, float(times.mean()))
    floors, optics_floors, errors = [], [], []
    # Instants over one interval between keyframes.
    for late in np.linspace(0, 10e-3, 3 if quick else 6)[:-1]:
        passing = Passing(speed, middle.instant + late)
        optics = np.array(
            [target.field(place, OCCLUDER_RADIUS_M) for place in passing.sphere(times)]
        )
        echoes = gradual(band.radar, passing).echoes(np.arange(band.cycles))
        amplitude = echoes.amplitude[len(echoes.frequency) // 2, :, 0, 0].conj()
        free = gradual(band.radar, Passing(speed, -1.0)).echoes(np.arange(1))
        field = amplitude / np.abs(free.amplitude[len(free.frequency) // 2, 0, 0, 0])
        floors.append(beside_db(field, band))
        optics_floors.append(beside_db(optics, band))
        errors.append(rms(field - optics))
    yield reported(claim, "PO: power beside the line", "dB", db_mean(optics_floors), key="edge")
    # A lower floor than that of physical optics is no fault; its own ripple differs by 3 dB.
    above = db_mean(floors) - db_mean(optics_floors)
    quantity = f"power beside the line above that of PO, {len(floors)} instants"
    says = "power beside the Doppler line while an edge passes, over that of physical optics"
    yield judged(claim, quantity, "dB", above, 3.0, key="edge", says=says, cases=len(floors))
    yield reported(claim, "worst instant: power beside the line", "dB", max(floors), key="edge")
    error, says = (
        rms(np.array(errors)),
        f"an edge passing by {OURS}, over a frame: rms complex error",
    )
    yield judged(
        claim,
        "rms complex error over the frame",
        "",
        error,
        EDGE_ERROR,
        key="edge",
        says=says,
        cases=len(errors),
    )


def measure(quick: bool) -> list[Row]:
    rows = [*edge_rows(quick), *array_rows(quick)]
    for band in BANDS[: 1 if quick else None]:
        for speed in (1.5,) if quick else (0.5, 1.5, 4.0):
            rows += passing_rows(band, speed, quick)
    return rows


if __name__ == "__main__":
    sys.exit(
        main(
            f"Partly covered parts by {OURS} against physical optics with a geometric shadow.",
            measure,
        )
    )
