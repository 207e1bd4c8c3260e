"""The closed-form cross-section of the ellipsoid against curvature, and two models far away.

The reference is pi R1 R2 = pi / K, where the Gaussian curvature K comes from the first and second
fundamental forms E, F, G, L, M, N of the surface (a sin u cos v, b sin u sin v, c cos u). It uses
neither the support function, on which the closed form and the model `analytic` are based, nor the
Hessian of the path, on which `specular` is based. Two antennas far apart see the point whose normal
bisects their directions, with the same pi / K, times the co-polar fraction of the reflected field
E_r = 2 (n.E) n - E.

    python validation/closed_forms/ellipsoid.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.validate.rows import Row, judged, main

Array = NDArray[np.float64]
FAR_M = 1e6
FREQUENCY_HZ = 14e9


def gaussian_curvature(axes: Array, u: Array, v: Array) -> Array:
    """Gaussian curvature K [1/m^2] at surface parameters, from both fundamental forms."""
    a, b, c = axes
    s, t, p, q = np.sin(u), np.cos(u), np.cos(v), np.sin(v)
    along_u = np.stack([a * t * p, b * t * q, -c * s], axis=-1)
    along_v = np.stack([-a * s * q, b * s * p, np.zeros_like(s)], axis=-1)
    second_uu = -np.stack([a * s * p, b * s * q, c * t], axis=-1)
    second_uv = np.stack([-a * t * q, b * t * p, np.zeros_like(s)], axis=-1)
    second_vv = -np.stack([a * s * p, b * s * q, np.zeros_like(s)], axis=-1)
    normal = np.cross(along_u, along_v)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    E, F, G = (
        np.sum(first * second, axis=-1)
        for first, second in ((along_u, along_u), (along_u, along_v), (along_v, along_v))
    )
    L, M, N = (np.sum(second * normal, axis=-1) for second in (second_uu, second_uv, second_vv))
    return np.asarray((L * N - M * M) / (E * G - F * F))


def normal_at(axes: Array, u: Array, v: Array) -> Array:
    """Outward unit normal at surface parameters."""
    a, b, c = axes
    gradient = np.stack(
        [np.sin(u) * np.cos(v) / a, np.sin(u) * np.sin(v) / b, np.cos(u) / c], axis=-1
    )
    return np.asarray(gradient / np.linalg.norm(gradient, axis=-1, keepdims=True))


def shapes(n: int, rng: np.random.Generator) -> dict[str, list[Array]]:
    return {
        "spheres": [np.full(3, a) for a in (1e-3, 0.1, 10.0)],
        "limbs": [
            np.array([0.05, 0.05, 0.2]),
            np.array([0.04, 0.04, 0.08]),
            np.array([0.1, 0.1, 0.07]),
        ],
        "tri-axial": list(np.exp(rng.uniform(np.log(0.02), np.log(0.5), (n, 3)))),
        "needles and discs, 1000:1": [
            np.array(axes) for axes in ((1e-3, 1e-3, 1.0), (1.0, 1.0, 1e-3), (1e-3, 0.03, 1.0))
        ],
    }


def formula_rows(quick: bool) -> Iterator[Row]:
    rng = np.random.default_rng(0)
    for name, group in shapes(10 if quick else 100, rng).items():
        worst = 0.0
        for axes in group:
            u, v = np.arccos(rng.uniform(-0.999, 0.999, 400)), rng.uniform(-np.pi, np.pi, 400)
            normal = normal_at(axes, u, v)
            theta, phi = (
                np.arctan2(np.hypot(normal[:, 0], normal[:, 1]), normal[:, 2]),
                np.arctan2(normal[:, 1], normal[:, 0]),
            )
            ratio = rt.rcs.ellipsoid(*axes, theta, phi) * gaussian_curvature(axes, u, v) / np.pi
            worst = max(worst, float(np.abs(10 * np.log10(ratio)).max()))
        # At the tip of a needle, the rounding errors of the angles are multiplied by 1000^2.
        says = (
            "closed form of an ellipsoid's cross-section against pi R1 R2, "
            "over aspect and shape, to 1000:1"
        )
        cases = 400 * len(group)
        yield judged(
            f"rcs.ellipsoid, {name}",
            "worst |dB| to pi R1 R2",
            "dB",
            worst,
            1e-6,
            says=says,
            cases=cases,
        )


def mirror_polarization(to_tx: Array, to_rx: Array, normal: Array) -> Array:
    """Fraction of the field that stays in v, which is z projected across each line of sight."""
    up = np.array([0.0, 0.0, 1.0])
    across = []
    for way in (to_tx, to_rx):
        part = up - (way @ up)[:, None] * way
        across.append(part / np.linalg.norm(part, axis=1, keepdims=True))
    there, back = across
    reflected = 2 * np.sum(there * normal, axis=1, keepdims=True) * normal - there
    return np.abs(np.sum(reflected * back, axis=1))


def far_rows(quick: bool) -> Iterator[Row]:
    rng = np.random.default_rng(1)
    for bistatic_deg in (0.0, 30.0, 90.0, 140.0):
        errors: dict[str, list[float]] = {"analytic": [], "specular": []}
        for name, group in shapes(3 if quick else 20, rng).items():
            if "needles" in name:
                continue  # their radius of curvature, a kilometre, is not small beside the distance
            for axes in group:
                n = 10 if quick else 40
                u, v = np.arccos(rng.uniform(-0.999, 0.999, n)), rng.uniform(-np.pi, np.pi, n)
                frame = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
                normal = normal_at(axes, u, v) @ frame.T
                aside = np.cross(normal, rng.normal(size=(n, 3)))
                aside /= np.linalg.norm(aside, axis=1, keepdims=True)
                half = np.radians(bistatic_deg / 2)
                to_tx, to_rx = (
                    np.cos(half) * normal + sign * np.sin(half) * aside for sign in (1, -1)
                )
                target = rt.Ellipsoids([np.zeros(3)], [frame], [axes])
                reference = np.sqrt(np.pi / gaussian_curvature(axes, u, v))
                turned = {"analytic": 1.0, "specular": mirror_polarization(to_tx, to_rx, normal)}
                for fidelity, error in errors.items():
                    # Where the reflection is cross-polar, nothing is left to compare.
                    clear = np.broadcast_to(turned[fidelity] > 0.1, n)
                    field = rt.scattering_length(
                        target, FAR_M * to_tx, FAR_M * to_rx, FREQUENCY_HZ, fidelity
                    )
                    ratio = np.abs(field) / (reference * turned[fidelity])
                    error.append(float(np.abs(20 * np.log10(ratio[clear])).max(initial=0.0)))
        for fidelity, error in errors.items():
            # Radii up to 25 m seen from 1000 km: the wavefront's curvature accounts for 2e-4 dB.
            says = (
                f"ellipsoids by `{fidelity}` from afar against pi R1 R2, "
                "Tx and Rx 0 to 140 degrees apart"
            )
            claim = f"{fidelity}, 1000 km, {bistatic_deg:g} deg apart"
            yield judged(
                claim,
                "worst |dB| to pi R1 R2",
                "dB",
                max(error),
                0.01,
                says=says,
                cases=n * len(error),
            )


def measure(quick: bool) -> list[Row]:
    return [*formula_rows(quick), *far_rows(quick)]


if __name__ == "__main__":
    sys.exit(
        main(
            "Ellipsoids far away: the closed form and both closed-form models against curvature.",
            measure,
        )
    )
