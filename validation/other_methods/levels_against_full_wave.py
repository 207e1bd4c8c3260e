"""Every fidelity level against full wave: single parts of a body, and pairs of spheres and limbs.

The truth is `full-wave`, which ``full_wave.py`` holds against Mie's series and against multipoles;
no level has a part in it. Parts of a synthetic walker are perfect conductors at the origin, seen by
one antenna at 4 m from along their axis to across it; frequencies are 12, 14 and 16 GHz. Figures
are root mean squares over aspects and frequencies, of decibels and of the complex difference over
the root mean square of the field. `reference` is here the same as `physical-optics`: nothing is
interpolated. Figures are reported, not judged, for optics is what it is; that the second term of
`specular` brings it nearer than `physical-optics` is judged.

Limbs are a shank under a thigh, on one axis, by modes at 12 GHz, and a forearm across an upper arm
by surfaces at 4.5 GHz, extrapolated from two meshes as in ``full_wave_surfaces.py``.

    python validation/other_methods/levels_against_full_wave.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from functools import partial
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from numpy.typing import NDArray

import rtradar as rt
from rtradar.full_wave import ClosedMesh, ConductingSurface
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

sys.path.append(str(Path(__file__).resolve().parents[1]))

from closed_meshes import limit, spheroid
from helpers import field_db, one_ellipsoid, rms

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
reported = partial(rows.reported, key="levels-against-full-wave")

RANGE_M = 4.0
LEVELS = ("analytic", "specular", "physical-optics", "reference", "rays")
ASPECTS_DEG = (10.0, 30.0, 50.0, 70.0, 90.0)
PAIR_ASPECTS_DEG = (20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0)
PARTS = ("thigh", "forearm", "foot", "head", "upper torso")
TWO_TERMS = ("specular", {"terms": 2})
GRADUAL = ("specular", {"visibility": "gradual"})
TWICE = ("specular", "physical-optics")
"""Levels that have reflections from part to part if asked; `rays` has three bounces here."""

CROSSED_HZ, CROSSED_EDGES_M = 4.5e9, (7.2e-3, 6e-3)
Polarization = Literal["v", "h"]
POLARIZATIONS: tuple[Polarization, ...] = ("v", "h")


def antennas(angles_deg: tuple[float, ...]) -> Array:
    """Antennas (aspect, 3) at angles from the z axis, in the plane of x and z [m]."""
    angle = np.radians(angles_deg)
    return RANGE_M * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)


def field(
    target: rt.Ellipsoids,
    at: Array,
    frequency: float,
    level: str,
    polarization: Polarization,
    **options: int | str,
) -> Complex:
    # Limits of validity are what is measured here.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rt.ValidityWarning)
        return rt.scattering_length(
            target, at, at, frequency, level, polarization=polarization, **options
        )


def axes_of(name: str) -> Array:
    """Semi-axes of a part of a walker [m], the last along the bone."""
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0))
    names = [name.removeprefix("left ") for name in body.part_names]
    return np.asarray(body.semi_axes[names.index(name)])


def parts() -> dict[str, rt.Ellipsoids]:
    return {name: one_ellipsoid(axes_of(name)) for name in PARTS}


def part_rows(quick: bool) -> Iterator[Row]:
    shapes = parts()
    if quick:
        shapes = {"head": shapes["head"]}
    frequencies = (12e9,) if quick else (12e9, 14e9, 16e9)
    at, gathered = antennas(ASPECTS_DEG), {}
    for (name, target), polarization in product(shapes.items(), ("v", "h")):
        truth = [field(target, at, f, "full-wave", polarization) for f in frequencies]
        for level, options in [*((level, {}) for level in LEVELS), TWO_TERMS]:
            found = [field(target, at, f, level, polarization, **options) for f in frequencies]
            pair = np.concatenate(found), np.concatenate(truth)
            named = f"`{level}`" + (", two terms" if options else "")
            gathered.setdefault(named, []).append(pair)
            yield from compared(f"{name}, {polarization.upper()}, {named}", *pair)
    relative = {}
    for named, pairs in gathered.items():
        decibels = rms(np.concatenate([field_db(found / truth) for found, truth in pairs]))
        relative[named] = rms([rms(found - truth) / rms(truth) for found, truth in pairs])
        yield reported(f"all parts, {named}", "rms over parts", "dB", decibels)
        yield reported(f"all parts, {named}", "rms over parts, complex", "%", 100 * relative[named])
    # A level that costs less is plainly nearer: by a third at least.
    yield rows.judged(
        "second term of `specular`",
        "complex difference over that of `physical-optics`",
        "",
        relative["`specular`, two terms"] / relative["`physical-optics`"],
        0.7,
        says="`specular` with two terms is nearer to full wave than `physical-optics`: complex "
        "difference of single parts over that of `physical-optics`",
        cases=len(gathered["`specular`"]),
        key="levels-against-full-wave",
    )


def bistatic_rows() -> Iterator[Row]:
    """Spheres by one term and by two, over angles between Tx and Rx."""
    frequencies = np.linspace(12e9, 16e9, 9)
    for radius, polarization in product((0.04, 0.06), ("v", "h")):
        sphere = one_ellipsoid(np.full(3, radius))
        for degrees in (0, 30, 60, 90):
            half = np.radians(degrees / 2)
            tx = np.tile(RANGE_M * np.array([np.cos(half), np.sin(half), 0.0]), (9, 1))
            given = sphere, tx, tx * [1, -1, 1], frequencies
            truth = rt.scattering_length(*given, "full-wave", polarization=polarization)
            for terms in (1, 2):
                found = rt.scattering_length(
                    *given, "specular", polarization=polarization, terms=terms
                )
                claim = f"sphere of {100 * radius:g} cm, {polarization.upper()}, {degrees} degrees"
                claim += f" between Tx and Rx, {terms} term{'s' if terms > 1 else ''}"
                error = 100 * rms(found - truth) / rms(truth)
                yield reported(claim, "rms, complex", "%", error)


def compared(claim: str, found: Complex, truth: Complex) -> Iterator[Row]:
    yield reported(claim, "rms", "dB", rms(field_db(found / truth)))
    yield reported(claim, "rms, complex", "%", 100 * rms(found - truth) / rms(truth))


def pair_rows(quick: bool) -> Iterator[Row]:
    radius = 0.02 if quick else 0.05
    levels = [(level, {}) for level in (("specular", "rays") if quick else LEVELS)]
    levels += [("specular", {"bounces": 2})]
    at = antennas(PAIR_ASPECTS_DEG)
    steep = np.array(PAIR_ASPECTS_DEG) >= 40
    for gap, polarization in product((0.02,) if quick else (0.02, 0.10), ("v", "h")):
        apart = 2 * radius + gap
        centres = [[0.0, 0.0, -apart / 2], [0.0, 0.0, apart / 2]]
        pair = rt.Ellipsoids(centres, [np.eye(3)] * 2, np.full((2, 3), radius))
        truth = field(pair, at, 12e9, "full-wave", polarization)
        for level, options in levels:
            found = field(pair, at, 12e9, level, polarization, **options)
            claim = f"two spheres, gap {100 * gap:g} cm, {polarization.upper()}, `{level}`"
            claim += ", two bounces" if options else ""
            for name, some in (("40 to 90 degrees", steep), ("20 and 30 degrees", ~steep)):
                error = rms(found[some] - truth[some]) / rms(truth[some])
                yield reported(claim, f"rms, complex, {name}", "%", 100 * error)
            worst = float(np.abs(field_db(found / truth))[steep].max())
            yield reported(claim, "worst, 40 to 90 degrees", "dB", worst)


def limb_rows() -> Iterator[Row]:
    thigh, shank = axes_of("thigh"), axes_of("shank")
    apart = thigh[2] + 0.02 + shank[2]
    coaxial = rt.Ellipsoids([[0, 0, 0], [0, 0, -apart]], [np.eye(3)] * 2, [thigh, shank])
    at = antennas(PAIR_ASPECTS_DEG)
    for polarization in POLARIZATIONS:
        truth = field(coaxial, at, 12e9, "full-wave", polarization)
        given = coaxial, at, 12e9, polarization
        yield from of_levels("shank under thigh, 12 GHz", *given, truth)
    wrong: dict[str, list[Complex]] = {"sharp": [], "gradual": []}
    upper, fore = axes_of("upper arm"), axes_of("forearm")
    for gap in (0.02, 0.10):
        # The forearm is before the upper arm, as seen from 90 degrees.
        before = [upper[0] + gap + fore[0], 0.0, 0.0]
        across = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
        crossed = rt.Ellipsoids([[0, 0, 0], before], [np.eye(3), across], [upper, fore])
        surfaces = [
            ConductingSurface(mesh_of(crossed, edge_m), CROSSED_HZ) for edge_m in CROSSED_EDGES_M
        ]
        squares = [1 / one.mesh.unknowns for one in surfaces]  # as that of an edge's length
        claim = f"forearm across upper arm, gap {100 * gap:g} cm, 4.5 GHz"
        for polarization in POLARIZATIONS:
            coarse, fine = (one.scattering_length(at, at, polarization) for one in surfaces)
            between = f"{claim}, {polarization.upper()}, two meshes"
            yield reported(between, "rms", "dB", rms(field_db(fine / coarse)))
            given = crossed, at, CROSSED_HZ
            truth = limit(coarse, fine, squares)
            yield from of_levels(claim, *given, polarization, truth)
            for visibility, errors in wrong.items():
                found = field(*given, "specular", polarization, visibility=visibility)
                errors.append((found - truth) / rms(truth))
    yield rows.judged(
        "forearm across upper arm, gradual over sharp",
        "complex difference from full wave over that of sharp visibility",
        "",
        rms(np.array(wrong["gradual"])) / rms(np.array(wrong["sharp"])),
        1.0,
        says="`specular` with a gradual visibility behind an occluder is no farther from full wave "
        "than with a sharp one: complex difference over that of the sharp one",
        cases=len(wrong["sharp"]) * len(PAIR_ASPECTS_DEG),
        key="levels-against-full-wave",
    )


def mesh_of(limbs: rt.Ellipsoids, edge_m: float) -> ClosedMesh:
    """One mesh of ellipsoids of revolution, with edges of about this length."""
    meshes = []
    for centre, frame, axes in zip(limbs.centres, limbs.frames, limbs.semi_axes, strict=True):
        mesh = spheroid(axes[2], axes[0]).mesh(edge_m)
        mesh.vertices = centre + mesh.vertices[:, [1, 2, 0]] @ frame.T
        meshes.append(mesh)
    whole = trimesh.util.concatenate(meshes)
    return ClosedMesh(np.array(whole.vertices), np.array(whole.faces, dtype=np.int64))


def of_levels(
    claim: str,
    target: rt.Ellipsoids,
    at: Array,
    frequency: float,
    polarization: Polarization,
    truth: Complex,
) -> Iterator[Row]:
    levels = [(level, {}) for level in LEVELS] + [(level, {"bounces": 2}) for level in TWICE]
    for level, options in [*levels, GRADUAL]:
        found = field(target, at, frequency, level, polarization, **options)
        more = {"bounces": ", two bounces", "visibility": ", gradual"}
        name = f"{claim}, {polarization.upper()}, `{level}`"
        yield from compared(name + "".join(more[option] for option in options), found, truth)


def measure(quick: bool) -> list[Row]:
    found = [*part_rows(quick), *pair_rows(quick)]
    return found if quick else [*found, *limb_rows(), *bistatic_rows()]


if __name__ == "__main__":
    sys.exit(main("Every level against full wave.", measure))
