"""`specular` against closed forms far away and against physical optics near by.

Far: at one kilometre, over shape and aspect, against the cross-section of geometric optics.
Near: at 4 m, monostatic and for each pair of Tx and Rx at the corners of the array, against scalar
physical optics by the convergent quadrature of ``physical_optics.py``, for every part of the body
for which k times the smaller radius of curvature at the specular point is 10 or more. Physical
optics adds a wave from the terminator, about 1/(2k h) of the return with h the depth of the lit
side, that no real body has, so single differences ripple and their rms is judged. The same integral
along the path of steepest descent from the specular point has no terminator, and no ripple.

    python validation/other_methods/specular.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from physical_optics import lit_points, specular_contribution, wave_number
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.motion.placement import place
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import field_db, one_ellipsoid, rms

Array = NDArray[np.float64]
judged, reported = (partial(kind, key="ellipsoid") for kind in (rows.judged, rows.reported))
FAR_M, NEAR_M = 1000.0, 4.0
LEAST_K_RHO = 10.0
BANDS = {"12 GHz": ("paper-12ghz", (12e9, 14e9, 16e9)), "77 GHz": ("paper-77ghz", (79e9,))}


class Case(NamedTuple):
    """One part, alone, before one pair of antennas."""

    part: str
    target: rt.Ellipsoids
    tx: Array
    rx: Array


def body() -> rt.Body:
    return rt.Body.from_motion(place(rt.synthetic_motion("walk", seed=0)))


def kind(part: str) -> str:
    """Kind of a part: left and right are alike, and so are the three parts of the torso."""
    return "torso" if "torso" in part else part.removeprefix("left ").removeprefix("right ")


def shapes() -> dict[str, Array]:
    """Semi-axes of all 21 parts, each shape once."""
    actor = body()
    return {kind(part): axes for part, axes in zip(actor.part_names, actor.semi_axes, strict=True)}


def angles(direction: Array) -> tuple[Array, Array]:
    return np.arccos(direction[..., 2] / np.linalg.norm(direction, axis=-1)), np.arctan2(
        direction[..., 1], direction[..., 0]
    )


def directions(n: int, rng: np.random.Generator) -> Array:
    """Random directions and the three axes, where angles degenerate."""
    random = rng.normal(size=(n, 3))
    return np.concatenate([np.eye(3), random / np.linalg.norm(random, axis=1, keepdims=True)])


# -- far -------------------------------------------------------------------------------------------


def far_rows(quick: bool) -> Iterator[Row]:
    rng = np.random.default_rng(0)
    groups: dict[str, list[Array]] = {
        "parts of the body": list(shapes().values()),
        "spheres": [np.full(3, a) for a in (0.03, 0.1, 0.3)],
        "discs": [np.array([0.1, 0.1, 0.01]), np.array([0.2, 0.2, 0.05])],
        "tri-axial": list(np.exp(rng.uniform(np.log(0.05), np.log(0.25), (40, 3)))),
    }
    for name, group in groups.items():
        errors = []
        for axes in group:
            sight = directions(40 if quick else 400, rng)
            formula = np.sqrt(rt.rcs.ellipsoid(*axes, *angles(sight)))
            errors.append(
                field_db(
                    rt.scattering_length(one_ellipsoid(axes), FAR_M * sight, FAR_M * sight, 14e9)
                    / formula
                )
            )
        # 0.01 dB was asked for. The bent wavefront takes 4.3 (R1 + R2) / R dB, so R1 + R2 < 2 m.
        most = float(np.abs(np.concatenate(errors)).max())
        rate = partial(judged, key="sphere") if name == "spheres" else judged
        says = "`specular` at 1 km against the closed form, over shape and aspect"
        cases = sum(map(len, errors))
        yield rate(
            f"1 km, {name}", "worst |dB| to rcs.ellipsoid", "dB", most, 0.01, says=says, cases=cases
        )
    # A needle of 12 m radius: the far field begins farther away, and the near field says how much.
    needle = np.array([0.03, 0.03, 0.6])
    sight = np.array([[1.0, 0.0, 0.0]])
    ours = float(
        field_db(rt.scattering_length(one_ellipsoid(needle), FAR_M * sight, FAR_M * sight, 14e9))[0]
    )
    formula = float(10 * np.log10(rt.rcs.ellipsoid(*needle, np.pi / 2, 0.0)))
    yield reported(
        "1 km, needle of R = 12 m",
        "broadside, dB to rcs.ellipsoid",
        "dBsm",
        ours,
        reference=formula,
    )
    # Exact by symmetry, so that only rounding is left.
    near = float(10 * np.log10(near_field_section(needle, np.array([1.0, 0.0, 0.0]), FAR_M)))
    claim, says = (
        "1 km, needle of R = 12 m",
        "a needle of R = 12 m at 1 km by `specular` against its near field",
    )
    yield judged(claim, "broadside, to the near field", "dB", ours, 1e-6, reference=near, says=says)


def near_field_section(axes: Array, axis: Array, distance: float) -> float:
    """Cross-section along a symmetry axis at ``distance`` from the centre, for bent wavefronts."""
    to_surface = distance - float(np.abs(axis) @ axes)
    smaller, larger = rt.rcs.ellipsoid_radii(*axes, *angles(axis))
    gap = (distance / to_surface) ** 4
    return float(np.pi * gap / ((1 / smaller + 1 / to_surface) * (1 / larger + 1 / to_surface)))


# -- near ------------------------------------------------------------------------------------------


def corner_pairs(radar: rt.Radar) -> list[tuple[Array, Array]]:
    """First and last Tx of each line with first and last Rx of the same line."""
    y, z = (0, radar.tx_y - 1), (radar.tx_y, radar.n_tx - 1)
    pairs = [
        (tx, line * radar.rx_y + rx)
        for line, ends in enumerate((y, z))
        for tx in ends
        for rx in (0, radar.rx_y - 1)
    ]
    return [(radar.tx[tx], radar.rx[rx]) for tx, rx in pairs]


def monostatic_cases(radar: rt.Radar, n: int) -> Iterator[Case]:
    antenna = np.array([-NEAR_M, 0.0, 0.0])
    actor = body()
    for seed, (part, axes) in enumerate(zip(actor.part_names, actor.semi_axes, strict=True)):
        for frame in Rotation.random(n, random_state=seed).as_matrix():
            yield Case(kind(part), one_ellipsoid(axes, frame), antenna, antenna)


def pair_cases(radar: rt.Radar, n: int) -> Iterator[Case]:
    shift = np.asarray(radar.position_m) + np.array([NEAR_M, 0.0, 0.0])
    actor = body()
    for seed, (part, axes) in enumerate(zip(actor.part_names, actor.semi_axes, strict=True)):
        for draw, frame in enumerate(Rotation.random(n, random_state=100 + seed).as_matrix()):
            # Pairs ripple alike, aspects do not: every pair gets a new aspect.
            tx, rx = corner_pairs(radar)[draw % 8]
            yield Case(kind(part), one_ellipsoid(axes, frame), tx - shift, rx - shift)


def pose_cases(radar: rt.Radar, n: int) -> Iterator[Case]:
    """The walk at several instants, each of the 21 parts alone, from the radar's position."""
    actor = body()
    for time in np.linspace(0.2, actor.duration_s - 0.2, n):
        pose = actor.ellipsoids(float(time))
        for part, centre, frame, axes in zip(
            actor.part_names, pose.centres, pose.frames, pose.semi_axes, strict=True
        ):
            for tx, rx in corner_pairs(radar)[::3]:
                yield Case(kind(part), one_ellipsoid(axes, frame), tx - centre, rx - centre)


class Comparison(NamedTuple):
    """One case at one frequency: our field, PO's, and that of PO's specular point alone."""

    part: str
    k_rho: float
    ours: complex
    optics: complex
    stationary: complex


def compare(case: Case, frequencies: tuple[float, ...]) -> Iterator[Comparison]:
    frame, axes = case.target.frames[0], case.target.semi_axes[0]
    tx, rx = case.tx @ frame, case.rx @ frame
    normal = tx / np.linalg.norm(tx) + rx / np.linalg.norm(rx)
    rho = float(rt.rcs.ellipsoid_radii(*axes, *angles(normal))[0])
    served = [f for f in frequencies if wave_number(f) * rho >= LEAST_K_RHO]
    if not served:
        return
    quadrature = lit_points(tx, rx, axes, max(served))
    n = len(served)
    ours = rt.scattering_length(
        case.target, np.tile(case.tx, (n, 1)), np.tile(case.rx, (n, 1)), np.array(served)
    )
    for f, value in zip(served, ours, strict=True):
        optics, stationary = quadrature.scattering_length(f), specular_contribution(tx, rx, axes, f)
        yield Comparison(case.part, wave_number(f) * rho, complex(value), optics, stationary)


def near_rows(quick: bool) -> Iterator[Row]:
    yield from convergence(16e9)
    if not quick:
        yield from convergence(79e9)
    for band, (preset, frequencies) in BANDS.items():
        radar = rt.Radar.preset(preset)
        draws = (
            {"monostatic": 40, "per Tx/Rx": 40, "walk": 3}
            if band == "12 GHz"
            else {"monostatic": 4, "per Tx/Rx": 4}
        )
        if quick:
            draws = {"monostatic": 4, "per Tx/Rx": 4} if band == "12 GHz" else {"monostatic": 1}
        everything: list[Comparison] = []
        for view, source in (
            ("monostatic", monostatic_cases),
            ("per Tx/Rx", pair_cases),
            ("walk", pose_cases),
        ):
            if view not in draws:
                continue
            found = [c for case in source(radar, draws[view]) for c in compare(case, frequencies)]
            everything += found
            claim = f"4 m, {band}, {view}"
            ours, optics, stationary = (
                np.array([getattr(c, name) for c in found])
                for name in ("ours", "optics", "stationary")
            )
            # 0.1 dB was asked for, as an rms over all 21 parts and random aspects; nearly all that
            # is left is PO's terminator. Neck, feet and hands alone exceed it, and so does the
            # walk, whose aspects are few and alike.
            quantity, error = f"rms dB to PO, {len(found)} cases", rms(field_db(ours / optics))
            if view == "walk":
                yield reported(claim, quantity, "dB", error)
            else:
                says = (
                    f"`specular` at 4 m against physical optics, {band}, all parts, any aspect: rms"
                )
                yield judged(claim, quantity, "dB", error, 0.1, says=says, cases=len(found))
            yield reported(claim, "rms complex error to PO", "", rms(ours / optics - 1))
            # Geometric optics is the first term; the second, 1/(2jk rho), only shifts the phase.
            error, says = (
                rms(field_db(ours / stationary)),
                "`specular` at 4 m against the specular point in physical optics, all parts: rms",
            )
            yield judged(
                claim,
                "rms dB to PO's specular point",
                "dB",
                error,
                0.02,
                says=says,
                cases=len(found),
            )
            yield reported(
                claim, "rms complex error to PO's specular point", "", rms(ours / stationary - 1)
            )
        yield from part_rows(band, everything)
    yield from broadside_rows(quick)


def broadside_rows(quick: bool) -> Iterator[Row]:
    """Error of the far-field formula at 4 m across the long axis, where limbs reflect most."""
    antenna = np.array([NEAR_M, 0.0, 0.0])
    for band, frequencies in {
        "12 GHz": np.linspace(12e9, 16e9, 5 if quick else 33),
        "77 GHz": np.array([79e9]),
    }.items():
        lacks = []
        for part, axes in shapes().items():
            # As in the model `analytic`: the formula's return, with the spreading of the path to
            # the surface and not to the centre.
            formula = (
                np.sqrt(rt.rcs.ellipsoid(*axes, np.pi / 2, 0.0))
                * (NEAR_M / (NEAR_M - axes[0])) ** 2
            )
            quadrature = lit_points(antenna, antenna, axes, float(frequencies.max()))
            optics = np.array([quadrature.scattering_length(float(f)) for f in frequencies])
            ours = rt.scattering_length(
                one_ellipsoid(axes), np.tile(antenna, (len(frequencies), 1)), antenna, frequencies
            )
            lack, our_lack = (
                10 * np.log10(np.mean(np.abs(field) ** 2) / formula**2) for field in (optics, ours)
            )
            lacks.append(lack)
            # The mean over the sweep removes most of the terminator's ripple.
            claim, quantity = f"4 m, {band}, {part}", "broadside over rcs.ellipsoid, ref. PO"
            says = (
                "near field at 4 m under the far-field formula by `specular`, broadside, "
                "against physical optics"
            )
            yield judged(claim, quantity, "dB", our_lack, 0.1, reference=lack, says=says)
        yield reported(
            f"4 m, {band}, all parts",
            "broadside over rcs.ellipsoid, PO, mean",
            "dB",
            float(np.mean(lacks)),
        )


def part_rows(band: str, found: list[Comparison]) -> Iterator[Row]:
    for part in dict.fromkeys(c.part for c in found):
        own = [c for c in found if c.part == part]
        claim = f"4 m, {band}, {part}"
        least = min(c.k_rho for c in own)
        optics, stationary = (
            field_db(np.array([c.ours / getattr(c, name) for c in own]))
            for name in ("optics", "stationary")
        )
        yield reported(
            claim, f"rms dB to PO, {len(own)} cases, k rho from {least:.0f}", "dB", rms(optics)
        )
        # The limit asked for of every part, against PO without the artefact of its terminator.
        says = "`specular` at 4 m against the specular point in physical optics, part by part: rms"
        yield judged(
            claim,
            "rms dB to PO's specular point",
            "dB",
            rms(stationary),
            0.1,
            says=says,
            cases=len(own),
        )


def convergence(frequency: float) -> Iterator[Row]:
    """The reference against itself with 2.9 times the points, and against a sphere's form."""
    tx, rx = np.array([2.4, 1.2, 3.0]), np.array([2.6, 1.1, 2.8])
    whole, stationary = [], []
    for axes in shapes().values():
        coarse, fine = (
            lit_points(tx, rx, axes, frequency, density=d).scattering_length(frequency)
            for d in (1.0, 1.7)
        )
        whole.append(abs(coarse / fine - 1))
        coarse, fine = (
            specular_contribution(tx, rx, axes, frequency, density=d) for d in (1.0, 1.7)
        )
        stationary.append(abs(coarse / fine - 1))
    far, radius = np.array([1e6, 0.0, 0.0]), 0.1
    ka = wave_number(frequency) * radius
    own = lit_points(far, far, np.full(3, radius), frequency).scattering_length(frequency)
    whole.append(abs(own / complex(rt.rcs.sphere(radius, frequency, "po")) - 1))
    own = specular_contribution(far, far, np.full(3, radius), frequency)
    # PO of a sphere: sqrt(pi) a ((1 + j/2ka) exp(2jka) - j/2ka); the last term is the terminator's.
    stationary.append(abs(own / (np.sqrt(np.pi) * radius * np.exp(2j * ka) * (1 + 0.5j / ka)) - 1))
    for name, errors in (("PO", whole), ("PO's specular point", stationary)):
        # A thousandth of the limits that it serves would suffice.
        claim = f"the reference, {frequency / 1e9:g} GHz"
        says, cases = (
            "the reference: physical optics by quadrature, 2.9 times the points, "
            "and a sphere's closed form: change",
            len(errors),
        )
        yield judged(
            claim,
            f"{name}: worst change, 2.9 times the points",
            "",
            max(errors),
            1e-5,
            says=says,
            cases=cases,
        )


# -- symmetries ------------------------------------------------------------------------------------


def law_rows(quick: bool) -> Iterator[Row]:
    rng = np.random.default_rng(3)
    n = 20 if quick else 200
    swapped, moved, scaled = [], [], []
    for axes in shapes().values():
        frame = Rotation.random(random_state=int(rng.integers(1 << 30)))
        tx, rx = NEAR_M * directions(n, rng), np.zeros((n + 3, 3))
        rx = tx + rng.normal(0, 0.3, tx.shape)
        there = rt.scattering_length(one_ellipsoid(axes, frame.as_matrix()), tx, rx, 14e9)
        back = rt.scattering_length(one_ellipsoid(axes, frame.as_matrix()), rx, tx, 14e9)
        swapped.append(np.abs(there / back - 1))
        turn, shift = Rotation.from_euler("z", rng.uniform(0, 6)), rng.normal(0, 3, 3)
        target = one_ellipsoid(axes, (turn * frame).as_matrix(), shift)
        away = rt.scattering_length(target, turn.apply(tx) + shift, turn.apply(rx) + shift, 14e9)
        moved.append(
            np.abs(
                referred_to(shift, away, turn.apply(tx) + shift, turn.apply(rx) + shift, 14e9)
                / there
                - 1
            )
        )
        double = rt.scattering_length(
            one_ellipsoid(2 * axes, frame.as_matrix()), 2 * tx, 2 * rx, 7e9
        )
        scaled.append(np.abs(double / there / 2 - 1))
    # 4 m are 1200 rad at 14 GHz, of which float64 keeps 2e-13; the point has 1e-7 of an axis.
    for name, errors in (
        ("Tx and Rx swapped", swapped),
        ("all moved and rotated", moved),
        ("all twice as large", scaled),
    ):
        change, says = (
            np.concatenate(errors),
            "`specular`: Tx and Rx swapped, all moved and rotated, all twice as large: change",
        )
        yield judged("4 m, laws", name, "", float(change.max()), 1e-7, says=says, cases=len(change))


def referred_to(
    place: Array, value: NDArray[np.complex128], tx: Array, rx: Array, frequency: float
) -> NDArray[np.complex128]:
    """Scattering length with its phase relative to ``place`` instead of the origin."""
    old = [np.linalg.norm(antenna, axis=1) for antenna in (tx, rx)]
    new = [np.linalg.norm(antenna - place, axis=1) for antenna in (tx, rx)]
    phase = np.exp(1j * wave_number(frequency) * (sum(new) - sum(old)))
    return value * new[0] * new[1] / (old[0] * old[1]) * phase


def measure(quick: bool) -> list[Row]:
    return [*far_rows(quick), *near_rows(quick), *law_rows(quick)]


if __name__ == "__main__":
    sys.exit(main("`specular` against closed forms and physical optics.", measure))
