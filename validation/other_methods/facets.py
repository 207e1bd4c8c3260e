"""Physical optics over facets against closed forms, a convergent quadrature, and symmetries.

Spheres: the closed form of the same integral, ka 5 to 400, from several directions. A square plate
of 5 m: 4 pi A^2 / lambda^2 and the lobes beside it. Ellipsoids of the body at 4 m, one antenna and
pairs: the quadrature of ``physical_optics.py``, which uses no mesh; behind a sphere, that of
``occlusion.py``, whose shadow is exact. Symmetries: Tx and Rx swapped, everything rotated, and
parts added up. Bodies: what facets by the sizes of parts leave, against 81 920 a part.

    python validation/other_methods/facets.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from occlusion import ANTENNA, BEFORE_M, TARGET, Target
from physical_optics import lit_points
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body import Body
from rtradar.errors import InputError
from rtradar.scatter import build_model
from rtradar.scatter.facets.radiation import body_facets
from rtradar.scatter.facets.target import facet_scattering
from rtradar.validate.rows import Row, judged, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import one_ellipsoid, rms

Array = NDArray[np.float64]
SPEED_OF_LIGHT = 299_792_458.0
FAR_M = 1e6
TURNED = Rotation.from_rotvec([0.3, 0.2, 0.4]).as_matrix()


def field(
    target: object, tx: Array, rx: Array, frequency: float, facets: int | None = None
) -> NDArray[np.complex128]:
    tx, rx = np.atleast_2d(tx), np.atleast_2d(rx)
    return facet_scattering(target, tx, rx, np.full(len(tx), frequency), facets=facets)


def directions(n: int, seed: int) -> Array:
    random = np.random.default_rng(seed).normal(size=(n, 3))
    return random / np.linalg.norm(random, axis=1, keepdims=True)


# -- closed forms ----------------------------------------------------------------------------------


def sphere_rows(quick: bool) -> Iterator[Row]:
    kas = np.geomspace(5, 400, 6 if quick else 25)
    worst, complex_errors = 0.0, []
    for index, ka in enumerate(kas):
        frequency = ka * SPEED_OF_LIGHT / (2 * np.pi * 0.1)
        tx = FAR_M * directions(1 if quick or ka > 200 else 4, index)
        ratio = field(one_ellipsoid(np.full(3, 0.1)), tx, tx, frequency) / rt.rcs.sphere(
            0.1, frequency, "po"
        )
        worst = max(worst, float(np.abs(20 * np.log10(np.abs(ratio))).max()))
        complex_errors += list(ratio - 1)
    claim = "sphere of facets, ka 5 to 400"
    cases, says = (
        len(complex_errors),
        "a sphere of traced facets against physical optics' closed form, ka 5 to 400",
    )
    yield judged(
        claim,
        f"worst |dB| to PO's closed form, {cases} cases",
        "dB",
        worst,
        0.1,
        key="sphere",
        says=says,
        cases=cases,
    )
    yield reported(claim, "rms complex error", "", rms(np.array(complex_errors)), key="sphere")
    try:
        field(
            one_ellipsoid(np.full(3, 0.1)),
            FAR_M * directions(1, 0),
            FAR_M * directions(1, 0),
            401 * SPEED_OF_LIGHT / (0.2 * np.pi),
        )
        accepted = 1.0
    except InputError:
        accepted = 0.0
    says = (
        "beyond ka 400 a sphere of facets is refused unless their number is given (1: it was not)"
    )
    quantity = "accepted without asking for its facets"
    yield judged("sphere of facets, ka 401", quantity, "", accepted, 0.0, key="sphere", says=says)


def plate_rows() -> Iterator[Row]:
    corners = [[0, -2.5, -2.5], [0, 2.5, -2.5], [0, 2.5, 2.5], [0, -2.5, 2.5]]
    plate = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    for frequency in (1e9, 3e9):
        wavelength = SPEED_OF_LIGHT / frequency
        claim = f"square plate of 5 m, {frequency / 1e9:g} GHz"
        straight = np.array([[FAR_M, 0.0, 0.0]])
        ours = float(20 * np.log10(np.abs(field(plate, straight, straight, frequency))[0]))
        expected = float(10 * np.log10(4 * np.pi * 25.0**2 / wavelength**2))
        # The wavefront's curvature is 2 pi 2.5^2 / (lambda 1e6 m) of phase over the plate.
        says = "square plate of 5 m at 1 and 3 GHz by facets against 4 pi A² / λ²"
        yield judged(
            claim,
            "cross-section to 4 pi A^2 / lambda^2",
            "dB",
            ours,
            0.01,
            reference=expected,
            key="plate",
            says=says,
        )
        angle = np.radians(np.linspace(0.5, 30, 60))
        aslant = FAR_M * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
        lobes = (
            50
            * np.sqrt(np.pi)
            / wavelength
            * np.cos(angle)
            * np.sinc(10 / wavelength * np.sin(angle))
        )
        error = rms(np.abs(field(plate, aslant, aslant, frequency)) - np.abs(lobes)) / rms(lobes)
        says = "square plate of 5 m by facets, lobes to 30 degrees against sinc: rms over rms"
        yield judged(
            claim,
            "lobes to 30 degrees, rms over rms",
            "",
            error,
            1e-3,
            key="plate",
            says=says,
            cases=len(angle),
        )


# -- quadrature ------------------------------------------------------------------------------------


def ellipsoid_rows(quick: bool) -> Iterator[Row]:
    actor = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0))
    rng = np.random.default_rng(5)
    antenna = np.array([-4.0, 0.0, 0.0])
    for name, apart in (("one antenna", 0.0), ("pairs 0.5 m apart", 0.5)):
        for frequency, facets in ((12e9, 5120), (16e9, 5120), (79e9, 20480)):
            if quick and frequency > 20e9:
                continue
            errors, fields = [], []
            for axes in actor.semi_axes[:: 4 if quick else 1]:
                frame = Rotation.random(random_state=rng.integers(2**31)).as_matrix()
                side = rng.normal(size=3) * [0, 1, 1]
                side *= apart / 2 / max(float(np.linalg.norm(side)), 1e-12)
                tx, rx = (antenna + sign * side for sign in (1, -1))
                expected = lit_points(tx @ frame, rx @ frame, axes, frequency).scattering_length(
                    frequency
                )
                errors.append(
                    field(one_ellipsoid(axes, frame), tx, rx, frequency, facets)[0] - expected
                )
                fields.append(expected)
            claim = f"ellipsoids of the body at 4 m, {frequency / 1e9:g} GHz, {name}"
            # 2 % is 0.17 dB; the quadrature omits polarisation, by which pairs 0.5 m apart lose
            # 1 - cos(7 degrees).
            error = rms(np.array(errors)) / rms(np.array(fields))
            says = (
                "parts of the body by facets at 4 m, 12 to 79 GHz, "
                "against physical optics by quadrature: rms complex error"
            )
            quantity = f"{facets} facets: rms complex error to quadrature"
            yield judged(
                claim, quantity, "", error, 0.02, key="ellipsoid", says=says, cases=len(errors)
            )


def shadow_rows(quick: bool) -> Iterator[Row]:
    radius, frequency = 0.25, 14e9
    target = Target.upright(TARGET, frequency, 5.0)
    reach = TARGET[1] * (4.0 - BEFORE_M) / 4.0
    for facets in (5120,) if quick else (5120, 20480):
        errors = []
        for shift in radius + reach * np.linspace(-1.15, 1.15, 7 if quick else 25):
            occluder = np.array([-BEFORE_M, shift, 0.0])
            both = rt.Ellipsoids(
                [np.zeros(3), occluder], np.tile(np.eye(3), (2, 1, 1)), [TARGET, np.full(3, radius)]
            )
            before = rt.Ellipsoids([occluder], [np.eye(3)], [np.full(3, radius)])
            whole, front, free = (
                field(each, ANTENNA, ANTENNA, frequency, facets)[0]
                for each in (both, before, one_ellipsoid(TARGET))
            )
            errors.append((whole - front) / free - target.field(occluder, radius))
        claim = "thigh behind the edge of a sphere, 14 GHz"
        quantity = f"{facets} facets: rms error of the field over the free one"
        says = (
            "a thigh behind an edge by facets against a geometric shadow: "
            "rms error over the free field"
        )
        yield judged(
            claim,
            quantity,
            "",
            rms(np.array(errors)),
            0.02,
            key="edge",
            says=says,
            cases=len(errors),
        )


# -- symmetries ------------------------------------------------------------------------------------


def law_rows() -> Iterator[Row]:
    rng = np.random.default_rng(6)
    turn = Rotation.from_euler("z", 1.0).as_matrix()
    frames = Rotation.random(2, random_state=1).as_matrix()
    centres, axes = (
        np.array([[0.0, 0.4, 0.0], [0.1, -0.4, 0.1]]),
        np.array([[0.05, 0.07, 0.2], [0.1, 0.1, 0.1]]),
    )
    target, turned = (
        rt.Ellipsoids(centres, frames, axes),
        rt.Ellipsoids(centres @ turn.T, turn @ frames, axes),
    )
    tx = np.array([-4.0, 0.0, 0.0]) + rng.normal(0, 0.2, (20, 3))
    rx = tx + rng.normal(0, 0.2, (20, 3))
    here = field(target, tx, rx, 14e9, 5120)
    parts = [
        field(
            rt.Ellipsoids(centres[i : i + 1], frames[i : i + 1], axes[i : i + 1]),
            tx,
            rx,
            14e9,
            5120,
        )
        for i in (0, 1)
    ]
    others = {
        "Tx and Rx swapped": field(target, rx, tx, 14e9, 5120),
        "everything turned about the vertical": field(turned, tx @ turn.T, rx @ turn.T, 14e9, 5120),
        "parts beside each other, each alone and added": sum(parts),
    }
    for name, there in others.items():
        # All is in float64; were shadows computed in float32, none of these would hold.
        change = float(np.abs(there - here).max()) / rms(here)
        says = "facets: Tx and Rx swapped, everything rotated, parts added up: largest change"
        yield judged(
            "laws",
            f"{name}: largest change over rms",
            "",
            change,
            1e-8,
            key="ellipsoid",
            says=says,
            cases=len(tx),
        )


# -- facets of a body ------------------------------------------------------------------------------


def by_size_rows(quick: bool) -> Iterator[Row]:
    """What the number of facets that parts have by their size leaves of a body's field.

    Nothing is judged: the sum over many more facets is this package's own. That it converges to the
    right value is what the other rows say.
    """
    radar = rt.Radar.preset("paper-12ghz")
    for activity in ("walk",) if quick else ("walk", "kick", "punch"):
        body = Body.from_motion(rt.synthetic_motion(activity, seed=1, duration_s=2.0))
        last = int(2.0 / radar.chirp_interval_s)
        chirps = np.linspace(0, last - 1, 6 if quick else 60).astype(np.int64)
        fields = []
        for facets in (None, 81920):
            echoes = build_model("reference", radar, body, facets=facets).echoes(chirps)
            middle = len(echoes.frequency) // 2
            turns = echoes.frequency[middle] / SPEED_OF_LIGHT * echoes.length
            amplitude = echoes.amplitude[middle].conj()
            fields.append((amplitude * np.exp(-2j * np.pi * turns)).sum(axis=-1))
        yield reported(
            f"{activity} at 12 GHz, facets by size against 81 920 a part",
            "rms complex error",
            "",
            rms(fields[0] - fields[1]) / rms(fields[1]),
            key="facets",
        )
    axes = np.array([0.08, 0.06, 0.2])
    counts = body_facets(axes[None], 2 * np.pi * 14e9 / SPEED_OF_LIGHT)
    limb = rt.Ellipsoids([[0, 0, 0]], [TURNED], [axes])
    for apart_deg in (0, 60):
        angle = np.radians(apart_deg)
        rx = 4.0 * np.array([np.cos(angle), 0.0, np.sin(angle)])
        few, many = (field(limb, [4.0, 0, 0], rx, 14e9, facets=n) for n in (int(counts[0]), 81920))
        yield reported(
            f"a limb, Tx and Rx {apart_deg} degrees apart, facets by size against 81 920",
            "complex error",
            "",
            float(abs(few - many)[0] / abs(many)[0]),
            key="facets",
        )


def measure(quick: bool) -> list[Row]:
    return [
        *sphere_rows(quick),
        *plate_rows(),
        *ellipsoid_rows(quick),
        *shadow_rows(quick),
        *law_rows(),
        *by_size_rows(quick),
    ]


if __name__ == "__main__":
    sys.exit(main("Physical optics over facets.", measure))
