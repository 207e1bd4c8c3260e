"""Lengths of specular paths in float64 against a solution to 60 digits, near by and 10 km away.

The point at which two antennas see each other in a sphere is Alhazen's problem; an ellipsoid is
harder. Here the shortest path Tx-surface-Rx is found by Newton's method in decimal arithmetic, with
derivatives from differences of 1e-15, for which 60 digits suffice, starting from a general
minimiser. Nothing of it comes from the library. The reference is tested itself: the law of
reflection must hold at the point that is found, and the path of a sphere seen from one place must
be twice the distance less the radius.

Lengths are those of `mirror`, which solves for every Tx, Rx and part, and those of whole models for
a radar that is far away and a scene that is far from its own origin.

    python validation/closed_forms/path.py [--quick] [--json FILE]
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal, getcontext

import numpy as np
from doppler_floor import FlyingSphere, Moving, TurningEllipsoid
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body.body import Poses
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.scatter import build_model
from rtradar.scatter.specular_points import solve_specular_points
from rtradar.validate.rows import Row, judged, main

Array = NDArray[np.float64]
Vector = list[Decimal]
# All models but `analytic-paper`, whose path goes to the centre of the ellipsoid.
MODELS = ("analytic", "specular", "physical-optics", "rays", "reference")
TOLERANCE_M = 1e-6
STEP = Decimal("1e-15")
getcontext().prec = 60


def exact(vector: Array) -> Vector:
    return [Decimal(float(value)) for value in vector]


def norm(vector: Vector) -> Decimal:
    return sum((value * value for value in vector), Decimal(0)).sqrt()


@dataclass(frozen=True)
class Surface:
    """An ellipsoid before two antennas, exactly as the float64 numbers describe it."""

    tx: Array
    rx: Array
    centre: Array
    frame: Array
    axes: Array

    def roughly(self) -> Array:
        """Direction on the unit sphere near the point of the shortest path, by a minimiser."""
        local_t, local_r = (
            (self.tx - self.centre) @ self.frame,
            (self.rx - self.centre) @ self.frame,
        )
        pole = self.axes * (local_t / np.linalg.norm(local_t) + local_r / np.linalg.norm(local_r))
        pole /= np.linalg.norm(pole)
        east = np.cross(pole, np.eye(3)[np.argmin(np.abs(pole))])
        east /= np.linalg.norm(east)
        north = np.cross(pole, east)

        def place(step: Array) -> Array:
            unit = pole + step[0] * east + step[1] * north
            return np.asarray(unit / np.linalg.norm(unit))

        def longer(step: Array) -> float:
            # |T - p| - |T| without cancellation.
            point = place(step) * self.axes
            legs = (
                float(point @ (point - 2 * a)) / (np.linalg.norm(point - a) + np.linalg.norm(a))
                for a in (local_t, local_r)
            )
            return float(sum(legs))

        return place(
            minimize(
                longer, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-16}
            ).x
        )

    def solve(self) -> tuple[Decimal, Decimal]:
        """Shortest path [m], and the error of the law of reflection (sine of the angle)."""
        start = self.roughly()
        pole = int(np.argmax(np.abs(start)))
        side = 1 if start[pole] > 0 else -1
        others = [axis for axis in range(3) if axis != pole]
        at = [Decimal(float(start[axis] / (1 + side * start[pole]))) for axis in others]
        tx, rx, centre, axes = exact(self.tx), exact(self.rx), exact(self.centre), exact(self.axes)
        frame = [exact(row) for row in self.frame]

        def point(s: Decimal, t: Decimal) -> Vector:
            """Stereographic from the opposite pole, so that the point is exactly on the surface."""
            size = 1 + s * s + t * t
            local = [Decimal(0)] * 3
            local[pole] = side * (1 - s * s - t * t) / size * axes[pole]
            for axis, value in zip(others, (s, t), strict=True):
                local[axis] = 2 * value / size * axes[axis]
            return [
                centre[i] + sum((frame[i][j] * local[j] for j in range(3)), Decimal(0))
                for i in range(3)
            ]

        def length(s: Decimal, t: Decimal) -> Decimal:
            p = point(s, t)
            return norm([a - b for a, b in zip(tx, p, strict=True)]) + norm(
                [a - b for a, b in zip(rx, p, strict=True)]
            )

        for _ in range(8):
            s, t = at
            f = {(i, j): length(s + i * STEP, t + j * STEP) for i in (-1, 0, 1) for j in (-1, 0, 1)}
            slope_s, slope_t = (f[1, 0] - f[-1, 0]) / (2 * STEP), (f[0, 1] - f[0, -1]) / (2 * STEP)
            ss = (f[1, 0] - 2 * f[0, 0] + f[-1, 0]) / STEP**2
            tt = (f[0, 1] - 2 * f[0, 0] + f[0, -1]) / STEP**2
            st = (f[1, 1] - f[1, -1] - f[-1, 1] + f[-1, -1]) / (4 * STEP**2)
            determinant = ss * tt - st * st
            at = [
                s - (tt * slope_s - st * slope_t) / determinant,
                t - (ss * slope_t - st * slope_s) / determinant,
            ]
        s, t = at
        p = point(s, t)
        # Where the path is stationary, the bisector has no component along the surface. Its
        # components along both parameters are taken as sines.
        sight = [Decimal(0)] * 3
        for antenna in (tx, rx):
            way = [a - b for a, b in zip(antenna, p, strict=True)]
            size = norm(way)
            sight = [a + b / size for a, b in zip(sight, way, strict=True)]
        missed = Decimal(0)
        for ds, dt in ((STEP, Decimal(0)), (Decimal(0), STEP)):
            along = [
                a - b for a, b in zip(point(s + ds, t + dt), point(s - ds, t - dt), strict=True)
            ]
            size = norm(along)
            missed = max(
                missed,
                abs(sum((a * b / size for a, b in zip(sight, along, strict=True)), Decimal(0))),
            )
        return length(s, t), missed


def antennas(distance: float, apart: str, rng: np.random.Generator) -> tuple[Array, Array]:
    """Positions about the origin: in one place, the array's length apart, or anywhere in front."""
    first, second = rng.normal(size=(2, 3))
    first *= distance / np.linalg.norm(first)
    if apart == "monostatic":
        return first, first
    if apart == "array":
        return first, first + second / np.linalg.norm(second) * 0.3
    second *= distance * rng.uniform(0.5, 1.0) / np.linalg.norm(second)
    # More than 100 degrees apart the path would be grazing: the antenna goes to the same side.
    return first, second if first @ second > -0.17 * distance**2 else -second


def mirror_rows(quick: bool) -> Iterator[Row]:
    rng = np.random.default_rng(0)
    missed, own = Decimal(0), Decimal(0)
    distances = (4.0, 1e3, 1e4) if quick else (4.0, 100.0, 1e3, 1e4)
    for distance in distances:
        for shape in ("sphere", "ellipsoid"):
            for apart in ("monostatic", "array", "bistatic"):
                worst = 0.0
                count = 4 if quick else 40
                for _ in range(count):
                    axes = (
                        np.full(3, rng.uniform(0.02, 0.3))
                        if shape == "sphere"
                        else rng.uniform(0.03, 0.3, 3)
                    )
                    frame = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
                    # Half of the cases are far from the origin of the coordinates as well.
                    centre = rng.normal(size=3) * (distance if rng.uniform() < 0.5 else 1.0)
                    tx, rx = (centre + place for place in antennas(distance, apart, rng))
                    reference, sine = Surface(tx, rx, centre, frame, axes).solve()
                    missed = max(missed, sine)
                    if shape == "sphere" and apart == "monostatic":
                        away = norm([a - b for a, b in zip(exact(tx), exact(centre), strict=True)])
                        own = max(own, abs(reference - 2 * (away - Decimal(float(axes[0])))))
                    length = solve_specular_points(
                        Geometry(
                            tx[None],
                            rx[None, None],
                            centre[None, None],
                            frame[None, None],
                            axes[None],
                        )
                    )[0]
                    worst = max(worst, abs(float(Decimal(float(length[0, 0, 0])) - reference)))
                claim = f"mirror, {distance:g} m, {shape}, {apart}"
                says = (
                    "path over the specular point against 60 digits, "
                    "4 m to 10 km, one place to bistatic"
                )
                quantity = f"worst error of the path, {count} cases"
                yield judged(claim, quantity, "m", worst, TOLERANCE_M, says=says, cases=count)
    yield judged(
        "the reference",
        "law of reflection missed by",
        "rad",
        float(missed),
        1e-20,
        says="the reference of paths: error of the law of reflection",
    )
    # The frame is orthonormal to 1e-16 only, and the sphere is round to the same accuracy.
    quantity = "sphere from one place, against 2 (|T - O| - a)"
    yield judged(
        "the reference",
        quantity,
        "m",
        float(own),
        1e-15,
        says=f"the reference of paths: {quantity}",
    )


@dataclass(frozen=True)
class Shifted:
    """A moving body at another place."""

    body: Moving
    by_m: Array
    part_names: tuple[str, ...] = ("part",)
    duration_s: float = 1.0

    @property
    def semi_axes(self) -> Array:
        return self.body.semi_axes

    def at(self, times: Array) -> Poses:
        poses = self.body.at(times)
        return Poses(poses.centres + self.by_m, poses.frames, poses.semi_axes)


def model_rows(quick: bool) -> Iterator[Row]:
    bodies: dict[str, Moving] = {
        "flying sphere": FlyingSphere((2.0, 0.3, 0.1)),
        "turning ellipsoid": TurningEllipsoid(5.0, (0.05, 0.09, 0.2)),
    }
    whole = rt.Radar.preset("paper-77ghz")
    chirps = np.arange(0, whole.chirps_per_frame, 2663 if quick else 887)
    for away in (1e3, 1e4):
        for name, body in bodies.items():
            for where, shift in {
                "at the origin": np.zeros(3),
                "10 km from it": np.array([1e4, -3e3, 50.0]),
            }.items():
                there = Shifted(body, shift)
                place = shift + away * np.array([-0.96, 0.28, 0.01])
                radar = dataclasses.replace(whole, position_m=tuple(place.tolist()))
                for fidelity in MODELS:
                    if fidelity == "rays" and (quick or away > 1e3):
                        continue  # it takes a minute
                    echoes = build_model(fidelity, radar, there).echoes(chirps)
                    poses = there.at((chirps + 0.5) * radar.chirp_duration_s)
                    worst = 0.0
                    for index, chirp in enumerate(chirps):
                        tx = int(chirp % radar.n_tx)
                        for rx in (0, radar.n_rx - 1):
                            places = radar.tx[tx], radar.rx[radar.rx_of_tx[tx, rx]]
                            pose = (
                                poses.centres[index, 0],
                                poses.frames[index, 0],
                                poses.semi_axes[0],
                            )
                            reference, _ = Surface(*places, *pose).solve()
                            worst = max(
                                worst,
                                abs(float(Decimal(float(echoes.length[index, rx, 0])) - reference)),
                            )
                    claim = f"{fidelity}, radar {away / 1e3:g} km away, {name} {where}"
                    says = (
                        f"path of a moving body by every model, radar {away / 1e3:g} km away, "
                        "scene up to 10 km from its origin"
                    )
                    yield judged(
                        claim,
                        "worst error of the path",
                        "m",
                        worst,
                        TOLERANCE_M,
                        says=says,
                        cases=2 * len(chirps),
                    )


def measure(quick: bool) -> list[Row]:
    return [*mirror_rows(quick), *model_rows(quick)]


if __name__ == "__main__":
    sys.exit(main("Lengths of specular paths in float64 against 60 digits.", measure))
