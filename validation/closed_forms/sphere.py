"""Spheres: closed forms against miepython for ka from 0.01 to 10 000, `specular` from ka = 5 on.

The exact series is compared with miepython for a metal's very large index, in magnitude and, up to
a constant of convention, in phase. Geometric optics is compared with miepython in its range of
validity: 0.45 dB from ka = 12.6 on, and 0.02 dB from 60 on. So is its second term in powers of 1/k,
for Tx and Rx apart. The closed form of physical optics is
compared with its own integral over the lit half, by composite Gauss-Legendre rules.

    python validation/closed_forms/sphere.py [--quick] [--json FILE]
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

os.environ["MIEPYTHON_USE_JIT"] = "1"  # read when it is imported

import miepython
import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
judged, reported = (partial(kind, key="sphere") for kind in (rows.judged, rows.reported))

FREQUENCY_HZ = 14e9
WAVE_NUMBER = 2 * np.pi * FREQUENCY_HZ / 299_792_458.0
LEAST_KA, LARGEST_KA, LEAST_OPTICAL_KA = 0.01, 1e4, 5.0
# Geometric optics omits the creeping wave and terms of order 1/(ka)^2.
GO_DB = {(12.6, 60.0): 0.45, (60.0, LARGEST_KA): 0.02}
FAR_M = 1e7


def spread(least: float, largest: float, n: int) -> Array:
    """Values of ka on a logarithmic scale, a little off any pattern."""
    return np.geomspace(least, largest, n)


def exact(ka: Array) -> Complex:
    """Backscattered F [m] at the frequency of this script by miepython, up to a constant phase."""
    fields = []
    for x in ka:
        # A skin of 1e-8 of the radius or 1e-7 of a wavelength; thinner skins take miepython longer.
        metal = 1 - 1j * max(1e6, 1e8 / x)
        power = miepython.efficiencies_mx(metal, float(x))[2] * np.pi * (x / WAVE_NUMBER) ** 2
        amplitude = complex(miepython.S1_S2(metal, float(x), [-1.0])[0][0])
        fields.append(np.sqrt(power) * amplitude / abs(amplitude))
    return np.array(fields)


def optics_integral(ka: float) -> complex:
    """F [m] of physical optics: jk/sqrt(pi) 2 pi a^2 Int_0^1 u exp(2jka u) du."""
    x, w = np.polynomial.legendre.leggauss(16)
    panels = max(4, int(np.ceil(ka)))
    u = ((np.arange(panels)[:, None] + (x + 1) / 2) / panels).ravel()
    integral = np.sum(np.tile(w / (2 * panels), panels) * u * np.exp(2j * ka * u))
    return complex(2j * np.sqrt(np.pi) * ka**2 / WAVE_NUMBER * integral)


def specular(ka: Array) -> Complex:
    sphere = [rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [np.full(3, x / WAVE_NUMBER)]) for x in ka]
    far = [FAR_M, 0.0, 0.0]
    return np.array([rt.scattering_length(one, far, far, FREQUENCY_HZ)[0] for one in sphere])


def decibels(ratio: Complex) -> float:
    return float(np.abs(20 * np.log10(np.abs(ratio))).max())


def closed_rows(quick: bool) -> Iterator[Row]:
    ka = spread(LEAST_KA, LARGEST_KA, 60 if quick else 300)
    radius, reference = ka / WAVE_NUMBER, exact(ka)
    mie = rt.rcs.sphere(radius, FREQUENCY_HZ, "mie")
    claim = f"ka {LEAST_KA:g} to {LARGEST_KA:g}"
    # The index of 1e6 shifts the phase by 2e-6; apart from that both series have rounding only.
    about = {
        "says": f"Mie's series against miepython, {claim}: power and phase, relative",
        "cases": len(ka),
    }
    error = float(np.abs(abs(mie / reference) ** 2 - 1).max())
    yield judged(claim, "Mie against miepython, worst relative power", "", error, 1e-5, **about)
    ratio = mie / reference
    turned = float(np.abs(ratio / ratio[0] / abs(ratio / ratio[0]) - 1).max())
    yield judged(
        claim, "Mie against miepython, worst phase but for a constant", "", turned, 1e-5, **about
    )
    optics = rt.rcs.sphere(radius, FREQUENCY_HZ, "po")
    integral = np.array([optics_integral(float(x)) for x in ka])
    # Phases reach 2e4 rad, and their rounding alone is 4e-12.
    about["says"] = f"physical optics' closed form against its integral, {claim}: complex, relative"
    yield judged(
        claim,
        "PO against its integral, worst relative",
        "",
        float(np.abs(optics / integral - 1).max()),
        1e-9,
        **about,
    )
    for (least, largest), tolerance in GO_DB.items():
        some = spread(least, largest, 40 if quick else 200)
        go = rt.rcs.sphere(some / WAVE_NUMBER, FREQUENCY_HZ, "go")
        claim, error = f"ka {least:g} to {largest:g}", decibels(go / exact(some))
        about = {
            "says": f"geometric optics of a sphere against miepython, {claim}",
            "cases": len(some),
        }
        yield judged(claim, "GO against miepython, worst", "dB", error, tolerance, **about)
        po = rt.rcs.sphere(some / WAVE_NUMBER, FREQUENCY_HZ, "po")
        yield reported(
            f"ka {least:g} to {largest:g}",
            "PO against miepython, worst",
            "dB",
            decibels(po / exact(some)),
        )


def specular_rows(quick: bool) -> Iterator[Row]:
    n = 12 if quick else 80
    ka = spread(LEAST_OPTICAL_KA, LARGEST_KA, n)
    go = rt.rcs.sphere(ka / WAVE_NUMBER, FREQUENCY_HZ, "go")
    claim = f"specular, ka {LEAST_OPTICAL_KA:g} to {LARGEST_KA:g}"
    # From 10 000 km: the largest sphere has a radius of 34 m, and the curvature of the wavefronts
    # accounts for 3.4e-6 of the field; the path of 2e7 m is rounded to 4e-9 m, 1e-6 rad. Both are a
    # hundred times below what is claimed of optics.
    error = float(np.abs(specular(ka) / go - 1).max())
    says = (
        "a sphere by `specular` against geometric optics, "
        f"ka {LEAST_OPTICAL_KA:g} to {LARGEST_KA:g}: complex, relative"
    )
    yield judged(claim, "against GO, worst complex", "", error, 1e-4, says=says, cases=n)
    some = spread(LEAST_OPTICAL_KA, 12.6, n)
    yield reported(
        "specular, ka 5 to 12.6",
        "against miepython, worst",
        "dB",
        decibels(specular(some) / exact(some)),
    )
    for (least, largest), tolerance in GO_DB.items():
        some = spread(least, largest, n)
        error = decibels(specular(some) / exact(some))
        says = f"a sphere by `specular` against miepython, ka {least:g} to {largest:g}"
        claim = f"specular, ka {least:g} to {largest:g}"
        yield judged(claim, "against miepython, worst", "dB", error, tolerance, says=says, cases=n)


TERM_KA, APART_DEG = 3000.0, (0.0, 15.0, 30.0, 45.0, 60.0, 75.0)


def second_term_rows() -> Iterator[Row]:
    """The coefficient c of 1 + j c / 2ka, the field over that of geometric optics, V and H."""
    radius = TERM_KA / WAVE_NUMBER
    sphere = rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [np.full(3, radius)])
    for number, polarization in enumerate(("v", "h")):
        errors = []
        for apart in np.radians(APART_DEG):
            tx, rx = FAR_M * np.array([[1.0, 0, 0], [np.cos(apart), np.sin(apart), 0]])
            one, two = (
                rt.scattering_length(
                    sphere, tx, rx, FREQUENCY_HZ, "specular", terms=n, polarization=polarization
                )[0]
                for n in (1, 2)
            )
            ours = (two / one - 1) * 2 * TERM_KA / 1j
            series = miepython.S1_S2(1 - 1e7j, TERM_KA, [-np.cos(apart)], norm="bohren")
            # The mirror is at cos(i) before the centre; S1 and S2 have opposite signs there.
            mirror = (-1) ** number * -1j * TERM_KA * np.exp(2j * TERM_KA * np.cos(apart / 2))
            exactly = (complex(series[number][0]) / mirror - 1) * 2 * TERM_KA / 1j
            errors.append(abs(exactly - ours))
        yield judged(
            f"second term, {polarization}, to 75 degrees",
            "coefficient against miepython, worst",
            "",
            float(max(errors)),
            5e-3,
            says="second term of geometric optics of a sphere against miepython, Tx and Rx "
            "0 to 75 degrees apart: its coefficient",
            cases=len(errors),
        )


def small_sphere_rows() -> Iterator[Row]:
    """One term and two against miepython where Tx and Rx are 60 to 90 degrees apart."""
    apart = np.radians(np.arange(60.0, 91.0, 2.5))
    rx = FAR_M * np.stack([np.cos(apart), np.sin(apart), np.zeros_like(apart)], axis=1)
    for ka in (10.0, 15.0, 20.0, 40.0):
        sphere = rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [np.full(3, ka / WAVE_NUMBER)])
        series = miepython.S1_S2(1 - 1e7j, ka, -np.cos(apart), norm="bohren")
        for number, polarization in enumerate(("v", "h")):
            one, two = (
                rt.scattering_length(
                    sphere,
                    np.broadcast_to([FAR_M, 0.0, 0.0], rx.shape),
                    rx,
                    FREQUENCY_HZ,
                    "specular",
                    terms=n,
                    polarization=polarization,
                )
                for n in (1, 2)
            )
            mirror = (-1) ** number * -1j * ka * np.exp(2j * ka * np.cos(apart / 2))
            exactly = np.asarray(series[number]) / mirror
            left, all_of_it = (
                float(np.sqrt(np.mean(np.abs(exactly - value) ** 2))) for value in (two / one, 1.0)
            )
            yield judged(
                f"ka {ka:g}, 60 to 90 degrees, {polarization}",
                "rms of the field off with two terms over that with one",
                "",
                left / all_of_it,
                1.0,
                says="spheres of ka 10 to 40, Tx and Rx 60 to 90 degrees apart: what two terms "
                "leave over what one does",
            )


def draw(_: list[Row], path: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    ka = spread(LEAST_KA, LARGEST_KA, 800)
    radius = ka / WAVE_NUMBER
    unit = np.sqrt(np.pi) * radius
    figure, axes = plt.subplots(2, 1, figsize=(7, 6), sharex=True, layout="constrained")
    reference = exact(ka)
    forms = {
        f"rtradar, {name}": rt.rcs.sphere(radius, FREQUENCY_HZ, method)
        for name, method in (("Mie", "mie"), ("PO", "po"))
    }
    axes[0].semilogx(
        ka, 20 * np.log10(np.abs(reference) / unit), color="black", linewidth=2.5, label="miepython"
    )
    for name, values in forms.items():
        axes[0].semilogx(ka, 20 * np.log10(np.abs(values) / unit), linewidth=1, label=name)
    seen = spread(LEAST_OPTICAL_KA, LARGEST_KA, 60)
    found = specular(seen)
    axes[0].semilogx(
        seen,
        20 * np.log10(np.abs(found) / (np.sqrt(np.pi) * seen / WAVE_NUMBER)),
        ".",
        label="specular",
    )
    axes[0].set(ylim=(-40, 10), ylabel="RCS / πa² [dB]", title="Conducting sphere, backscatter")
    axes[0].legend()
    for name, values in forms.items():
        axes[1].loglog(
            ka, np.abs(20 * np.log10(np.abs(values / reference))) + 1e-12, linewidth=1, label=name
        )
    axes[1].loglog(
        seen, np.abs(20 * np.log10(np.abs(found / exact(seen)))) + 1e-12, ".", label="specular"
    )
    for (least, largest), tolerance in GO_DB.items():
        axes[1].plot([least, largest], [tolerance, tolerance], color="tab:red", linewidth=2)
    axes[1].set(xlabel="ka", ylabel="|error| to miepython [dB]", ylim=(1e-9, 100))
    axes[1].legend()
    figure.savefig(path, dpi=130)
    plt.close(figure)


def measure(quick: bool) -> list[Row]:
    return [*closed_rows(quick), *specular_rows(quick), *second_term_rows(), *small_sphere_rows()]


if __name__ == "__main__":
    sys.exit(
        main("Spheres: closed forms against miepython, `specular` against both.", measure, draw)
    )
